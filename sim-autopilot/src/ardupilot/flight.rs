//! The demand of each of ArduCopter's flight modes to the position controller.

use planner_core::Point;

use super::reference::CopterReference;
use super::setpoint::GuidedGoal;
use super::{Copter, CopterMode, RtlLeg, micros_from_s};
use crate::physics::shaping::approach_rate;
use crate::physics::vehicle::Demand;
use crate::platform::SensorReadings;

/// Distance below its target height at which a take-off is complete, metres. With this value
/// landed_state 2 comes 9.3 s after a command to 10 m, as recorded.
const TAKEOFF_DONE_BELOW_TARGET_M: f32 = 0.12;
/// Profile of a lift-off as recorded: time since lift-off until which each entry applies (s), and
/// upward acceleration (m/s²). First the throttle slowly passes hover while the controllers'
/// integrals wind up; then they push.
const LIFT_OFF_PROFILE: [(f32, f32); 2] = [(0.70, 0.57), (0.90, 5.2)];
/// Deceleration of BRAKE, m/s² (`BRAKE_MODE_DECEL_RATE`). The jerk limit of 5 m/s³ acts first, so
/// it is never reached: the speed decays with a time constant of 7.5 / 5 s.
const BRAKE_MPS2: f32 = 7.5;
/// Distance within which a leg of RTL has reached its target, metres.
const ARRIVED_M: f32 = 0.5;

impl Copter {
    /// The demand of the mode in this step.
    pub(super) fn demand(&mut self, sensors: &SensorReadings, dt: f32) -> Demand {
        let mut tuning = self.tuning;
        tuning.speed_max = self.commanded_speed.unwrap_or(tuning.speed_max);
        let goal = match self.mode {
            CopterMode::Auto => self.auto_goal(sensors),
            CopterMode::Guided if self.takeoff.is_some() => self.take_off_goal(),
            CopterMode::Guided => self.guided_goal(sensors.now_us, dt),
            CopterMode::Brake => {
                tuning.acceleration_max = BRAKE_MPS2;
                GuidedGoal::STOP
            }
            CopterMode::Stabilize | CopterMode::AltHold | CopterMode::Loiter => {
                tuning.descend_max = tuning.low_stick_descent_rate;
                GuidedGoal {
                    velocity: Point::new(0.0, 0.0, -tuning.low_stick_descent_rate),
                    ..GuidedGoal::STOP
                }
            }
            CopterMode::Rtl => self.return_goal(sensors),
            CopterMode::Land => self.landing_goal(sensors),
        };
        self.reference.advance(&goal, &tuning, dt);
        // Without a position estimate the horizontal position is not controlled.
        let across = self.position_known(sensors.now_us);
        let (p, v, a) =
            (self.reference.position, self.reference.velocity, self.reference.acceleration);
        let position = Point::new(
            if across { p.x } else { f32::NAN },
            if across { p.y } else { f32::NAN },
            p.z,
        );
        // The simulated controller's derivative acts on the measured acceleration, ArduPilot's on
        // the error: the difference is added to the feed-forward.
        let d = 1.0 + tuning.gains.velocity_d[0];
        if sensors.touching && v.z < 0.0 {
            // On the ground the reference does not continue below the vehicle.
            self.reference.position.z = sensors.position.z;
        }
        Demand {
            position,
            velocity: v,
            acceleration: Point::new(a.x * d, a.y * d, a.z),
            heading: goal.heading,
            heading_rate: goal.heading_rate,
            lift_off_acceleration: self.lift_off_acceleration(sensors.now_us),
            ..tuning.default_demand()
        }
    }

    /// Upward acceleration during lift-off, m/s²; NaN after it.
    fn lift_off_acceleration(&self, now_us: u64) -> f32 {
        let since_s = now_us.saturating_sub(self.since.lifted_us) as f32 * 1e-6;
        LIFT_OFF_PROFILE
            .iter()
            .find(|(until_s, _)| since_s < *until_s)
            .map_or(f32::NAN, |&(_, up)| up)
    }

    /// The goal of a take-off; ends the take-off once the reference is at its target height.
    pub(super) fn take_off_goal(&mut self) -> GuidedGoal {
        let Some(takeoff) = self.takeoff else { return GuidedGoal::STOP };
        let at = self.reference.position;
        let goal = GuidedGoal::hold(Point::new(at.x, at.y, takeoff.up));
        if takeoff.up - at.z < TAKEOFF_DONE_BELOW_TARGET_M {
            self.takeoff = None;
            self.goal = goal;
        }
        goal
    }

    /// The goal of Guided in this step. A goal position moves with the goal velocity, which becomes
    /// zero after `GUID_TIMEOUT`.
    fn guided_goal(&mut self, now_us: u64, dt: f32) -> GuidedGoal {
        let age_us = now_us.saturating_sub(self.goal_set_us);
        if self.goal.expires && age_us > micros_from_s(self.tuning.guided_timeout_s) {
            self.goal =
                GuidedGoal { velocity: Point::zeros(), acceleration: Point::zeros(), ..self.goal };
            self.goal.heading_rate = f32::NAN;
        }
        if let Some(position) = &mut self.goal.position {
            *position += self.goal.velocity * dt;
        }
        self.goal
    }

    /// The goal that lands the vehicle: it descends as if to stop at `LAND_ALT_LOW` above home, at
    /// least at `LAND_SPEED` and at most at `WPNAV_SPEED_DN` (`Mode::land_run_vertical_control`).
    /// Heights count from home, since no rangefinder measures the ground.
    pub(super) fn landing_goal(&self, sensors: &SensorReadings) -> GuidedGoal {
        let tuning = &self.tuning;
        let above_low = sensors.position.z - sensors.home.z - tuning.land_slow_below.max(1.0);
        let rate =
            approach_rate(above_low.max(0.0), tuning.gains.position[1], tuning.acceleration_max_z);
        let sink = rate.min(tuning.descend_max).max(tuning.land_speed);
        GuidedGoal { velocity: Point::new(0.0, 0.0, -sink), ..GuidedGoal::STOP }
    }

    /// The goal of a return: climbs, flies home, waits and lands.
    pub(super) fn return_goal(&mut self, sensors: &SensorReadings) -> GuidedGoal {
        let home = sensors.home;
        let at = self.reference.position;
        let away = libm::hypotf(home.x - sensors.position.x, home.y - sensors.position.y);
        if let RtlLeg::Climb { up } = &mut self.rtl_leg
            && up.is_nan()
        {
            // Near home the cone `RTL_CONE_SLOPE` limits the climb.
            let height = self.tuning.return_height.min(away * self.tuning.return_cone_slope);
            *up = (home.z + height).max(sensors.position.z);
        }
        match self.rtl_leg {
            RtlLeg::Climb { up } => {
                if up - sensors.position.z < ARRIVED_M {
                    self.rtl_leg = RtlLeg::Cross { up };
                }
                GuidedGoal::hold(Point::new(at.x, at.y, up))
            }
            RtlLeg::Cross { up } => {
                if away < ARRIVED_M {
                    self.rtl_leg = RtlLeg::Wait { since_us: sensors.now_us, up };
                }
                GuidedGoal::hold(Point::new(home.x, home.y, up))
            }
            RtlLeg::Wait { since_us, up } => {
                if sensors.now_us - since_us >= micros_from_s(self.tuning.return_loiter_s) {
                    self.rtl_leg = RtlLeg::Land;
                    self.reference = CopterReference::new(at, self.reference.velocity);
                }
                GuidedGoal::hold(Point::new(home.x, home.y, up))
            }
            RtlLeg::Land => self.landing_goal(sensors),
        }
    }
}
