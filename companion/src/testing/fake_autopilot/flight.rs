//! Motion of the scripted autopilot's vehicle: to the setpoint at a limited speed, straight down in
//! the landing mode.

use planner_core::Point;

use super::Bench;
use crate::Duration;
use crate::autopilot::AutopilotKind;

impl Bench {
    /// Whether the vehicle is on the ground in truth.
    pub(crate) fn on_ground(&self) -> bool {
        self.enu.z < 0.05
    }

    /// Whether the landing detector reports the ground.
    pub(super) fn reports_ground(&self) -> bool {
        self.on_ground() || self.false_ground
    }

    /// Error of the estimated position, estimated minus true, ENU metres.
    pub(super) fn height_error(&self) -> Point {
        Point::new(0.0, 0.0, self.height_error_m)
    }

    /// Whether the vehicle can leave the ground: an ArduCopter only once its motors have spun up
    /// after NAV_TAKEOFF.
    fn lifts(&self) -> bool {
        self.kind == AutopilotKind::Px4 || self.took_off && self.now >= self.lifts_at
    }

    /// Moves the vehicle for 50 ms; disarms 2.2 s after a landing, and when idle on the ground.
    pub(super) fn fly(&mut self) {
        let step = self.step_m;
        let target = match self.mode {
            mode if mode == self.kind.setpoint_mode() && self.lifts() => self.target,
            mode if mode == self.kind.land_mode() && !self.never_lands => {
                Some(Point::new(self.enu.x, self.enu.y, 0.0))
            }
            _ => None,
        };
        if let Some(target) = target.filter(|_| self.armed && !self.stuck) {
            let way = target - self.enu;
            self.enu += way * (step / way.norm().max(step));
            self.enu.z = self.enu.z.max(0.0);
        }
        let landing = self.mode == self.kind.land_mode() && self.on_ground() && self.armed;
        self.landed_at = if landing { self.landed_at.or(Some(self.now)) } else { None };
        if self.landed_at.is_some_and(|at| self.now - at > Duration::from_millis(2200))
            && !self.stays_armed
        {
            self.armed = false;
        }
        self.disarm_by_itself();
    }

    /// Disarms after 10 s on the ground without a take-off, as both autopilot kinds do
    /// (`COM_DISARM_PRFLT`, `DISARM_DELAY`).
    fn disarm_by_itself(&mut self) {
        let streamed =
            self.setpoints.last().is_some_and(|s| self.now - s.0 < Duration::from_secs(1));
        let takes_off = match self.kind {
            AutopilotKind::Px4 => streamed && self.mode == self.kind.setpoint_mode(),
            AutopilotKind::ArduPilot => self.took_off,
        };
        let idle = self.armed && self.on_ground() && !takes_off && !self.stays_armed;
        self.idle_since = if idle { self.idle_since.or(Some(self.now)) } else { None };
        if self.idle_since.is_some_and(|at| self.now - at > Duration::from_secs(10)) {
            self.armed = false;
        }
    }
}
