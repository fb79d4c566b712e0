//! PX4's commander: arming, modes, failsafe, take-off and landing, as observed in PX4 1.17.
//!
//! | state | left by |
//! |---|---|
//! | disarmed | arm command, unless the mode cannot run (such as Offboard without a stream, Land) |
//! | armed, on the ground | a demand to climb, `COM_SPOOLUP_TIME` after arming; `COM_DISARM_PRFLT` disarms |
//! | ramp | thrust rises over `MPC_TKO_RAMP_T`, whatever is demanded; in-air is reported early |
//! | flying | on the ground for `LNDMC_TRIG_TIME` with a demand to descend: landed |
//! | landed | a demand to climb; `COM_DISARM_LAND` disarms |
//!
//! In Offboard the failsafe `COM_OBL_RC_ACT` starts when no setpoint came for `COM_OF_LOSS_T`; the
//! next setpoint ends it. Times are arguments, in microseconds since boot; no clock is read.

mod flight;
mod modes;
pub mod params;
pub mod setpoint;
mod smoothed_approach;

mod commands;
pub mod software;

use planner_core::Point;

pub use self::modes::Px4Mode;
use self::params::Px4Tuning;
use self::setpoint::OffboardSetpoint;
use self::smoothed_approach::SmoothedApproach;
use crate::GpsFix;
use crate::link::command::{Arming, CommandOutcome};
use crate::physics::shaping::JerkLimitedRate;
use crate::physics::vehicle::Demand;
use crate::platform::{FlightModeOutput, IntegralAction, Platform, SensorReadings};
use crate::services::mission_flight::MissionLeg;
use crate::status::MotorState;

/// Delay of the failsafe beyond `COM_OF_LOSS_T` (1.0 s by default: 1.15 s in all), seconds. In
/// recordings it started at most 1.23 s after the last setpoint, and gaps of 1.25 s started it.
const LOSS_REACTION_S: f32 = 0.15;
/// Fraction of the thrust ramp after which the land detector reports a take-off: in recordings
/// after 0.9 to 1.0 s of 3 s, before the vehicle lifts.
const IN_AIR_RAMP_SHARE: f32 = 0.31;
/// Least commanded descent rate at which the land detector can report a landing, m/s: 1.1 times the
/// default of `LNDMC_Z_VEL_MAX` (`MulticopterLandDetector`). PX4 checks only the velocity setpoint:
/// with a position setpoint alone it reports itself in the air even on the ground, however far
/// below the setpoint lies.
const LAND_DETECTOR_DESCENT_MPS: f32 = 0.275;
/// Factor on `MPC_LAND_CRWL` that gives the descent rate seen in recordings: 0.22 m/s at a
/// parameter of 0.3 m/s.
const CRAWL_FACTOR: f32 = 0.75;
/// Delay of the land detector beyond `LNDMC_TRIG_TIME`, by its filters, seconds.
const LAND_FILTER_S: f32 = 0.5;
/// Delay of automatic disarming beyond `COM_DISARM_LAND`, seconds: 2.2 to 2.4 s after ON_GROUND in
/// recordings, with `COM_DISARM_LAND` 2.0.
const DISARM_REACTION_S: f32 = 0.25;

/// Phase of an armed flight, as the module's table lists them; `Ground` includes landed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FlightPhase {
    Ground,
    Ramp { since_us: u64 },
    Flying,
}

/// Leg of a return; `up` is its height, ENU metres (NaN: not computed yet).
#[derive(Clone, Copy, Debug, PartialEq)]
enum ReturnLeg {
    Climb { up: f32 },
    Cross { up: f32 },
    Descend,
    Land,
}

/// State of AUTO.MISSION.
#[derive(Clone, Copy, Debug, Default)]
struct MissionFlight {
    /// Whether a mission is stored.
    is_stored: bool,
    /// Leg of the mission that is flown; `None` outside AUTO.MISSION.
    leg: Option<MissionLeg>,
    /// Start of that leg, ENU metres.
    leg_start: Point,
}

/// PX4's state machine.
#[derive(Clone, Debug)]
pub struct Commander {
    armed: bool,
    landed: bool,
    /// Whether the vehicle has been in the air since it was armed.
    flown_since_arming: bool,
    intended_mode: Px4Mode,
    /// Mode that replaces Return, Takeoff or Land when the vehicle is disarmed.
    mode_after_disarm: Px4Mode,
    /// Mode that the active failsafe flies; `None` without one.
    failsafe: Option<Px4Mode>,
    phase: FlightPhase,
    armed_us: u64,
    landed_us: u64,
    /// Since when the vehicle has touched the ground with a demand to descend.
    touching_us: Option<u64>,
    setpoint: Option<OffboardSetpoint>,
    setpoint_us: u64,
    /// Where the automatic modes hold, or where they fly to, ENU metres.
    hold_point: Point,
    /// Smoothed path to `hold_point`.
    approach: SmoothedApproach,
    hold_heading: f32,
    /// Target height of Takeoff, ENU metres; NaN: `MIS_TAKEOFF_ALT` above home.
    takeoff_up: f32,
    commanded_cruise_speed: Option<f32>,
    return_leg: ReturnLeg,
    /// Descent rate in Land, and the time of its last update, microseconds.
    descent: Option<(u64, JerkLimitedRate)>,
    has_gps_fix: bool,
    mission: MissionFlight,
}

impl Default for Commander {
    fn default() -> Self {
        Self::new()
    }
}

impl Commander {
    /// Disarmed on the ground in Hold, as PX4 boots without a remote control.
    pub fn new() -> Self {
        Self {
            armed: false,
            landed: true,
            flown_since_arming: false,
            intended_mode: Px4Mode::Hold,
            mode_after_disarm: Px4Mode::Hold,
            failsafe: None,
            phase: FlightPhase::Ground,
            armed_us: 0,
            landed_us: 0,
            touching_us: None,
            setpoint: None,
            setpoint_us: 0,
            hold_point: Point::zeros(),
            approach: SmoothedApproach::new(0, &Point::zeros(), &Point::zeros()),
            hold_heading: 0.0,
            takeoff_up: f32::NAN,
            commanded_cruise_speed: None,
            return_leg: ReturnLeg::Descend,
            descent: None,
            has_gps_fix: true,
            mission: MissionFlight::default(),
        }
    }

    /// Whether the motors are armed.
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Whether the land detector reports the vehicle on the ground.
    pub fn landed(&self) -> bool {
        self.landed
    }

    /// The mode that is flown: a failsafe's, else the requested one.
    pub fn mode(&self) -> Px4Mode {
        self.failsafe.unwrap_or(self.intended_mode)
    }

    /// The mode that was last requested, even while a failsafe flies another.
    pub fn intended_mode(&self) -> Px4Mode {
        self.intended_mode
    }

    /// Whether a failsafe is active.
    pub fn in_failsafe(&self) -> bool {
        self.failsafe.is_some()
    }

    /// Value of MAV_LANDED_STATE for EXTENDED_SYS_STATE.
    pub fn landed_state(&self) -> u8 {
        match self.mode() {
            _ if self.landed => 1,
            Px4Mode::Takeoff => 3,
            Px4Mode::Mission if matches!(self.mission.leg, Some(MissionLeg::TakeOff { .. })) => 3,
            Px4Mode::Mission if matches!(self.mission.leg, Some(MissionLeg::Land { .. })) => 4,
            Px4Mode::Land => 4,
            Px4Mode::Return if self.return_leg == ReturnLeg::Land => 4,
            _ => 2,
        }
    }

    /// Values of MAV_STATE and MAV_MODE_FLAG for HEARTBEAT.
    pub fn heartbeat(&self, now_us: u64, tuning: &Px4Tuning) -> (u8, u8) {
        let mode = self.mode();
        let status = match (self.armed, self.failsafe) {
            (true, Some(_)) => 5,
            (true, None) => 4,
            // Disarmed in a mode that cannot run, PX4 reports 0 (UNINIT), not STANDBY.
            (false, _)
                if mode == Px4Mode::Offboard && !self.is_setpoint_stream_fresh(now_us, tuning) =>
            {
                0
            }
            (false, _) => 3,
        };
        let flags = if mode.is_auto() {
            16 | 8 | 4
        } else if mode.needs_sticks() {
            64 | 16
        } else if self.setpoint.is_some() {
            16
        } else {
            0
        };
        (status, 1 | flags | if self.armed { 128 } else { 0 })
    }

    /// Sets whether GPS has a fix, without which the estimator has no position.
    pub fn set_gps_fix(&mut self, fix: GpsFix) {
        self.has_gps_fix = fix == GpsFix::Held;
    }

    /// Notes whether a mission is stored that AUTO.MISSION can fly.
    pub fn note_stored_mission(&mut self, platform: &Platform) {
        self.mission.is_stored = platform.has_mission();
    }

    /// Stores a valid setpoint and its time.
    pub fn handle_setpoint(&mut self, setpoint: OffboardSetpoint, now_us: u64) {
        self.setpoint = Some(setpoint);
        self.setpoint_us = now_us;
    }

    /// Whether the last setpoint is recent enough for Offboard.
    pub fn is_setpoint_stream_fresh(&self, now_us: u64, tuning: &Px4Tuning) -> bool {
        let limit = micros_from_s(tuning.offboard_loss_timeout_s + LOSS_REACTION_S);
        self.setpoint.is_some() && now_us.saturating_sub(self.setpoint_us) <= limit
    }

    /// Arms if the mode can run and the checks pass, or if forced.
    pub fn arm(
        &mut self,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
        arming: Arming,
    ) -> CommandOutcome {
        if self.armed {
            return CommandOutcome::Done;
        }
        if arming == Arming::Checked && !self.is_armable(sensors, tuning) {
            return CommandOutcome::Refused;
        }
        self.armed = true;
        self.armed_us = sensors.now_us;
        self.flown_since_arming = !self.landed;
        self.enter_mode(self.intended_mode, sensors);
        CommandOutcome::Done
    }

    /// Whether the vehicle may be armed: the requested mode can run, there is a position, and the
    /// battery is not low.
    pub fn is_armable(&self, sensors: &SensorReadings, tuning: &Px4Tuning) -> bool {
        let runs = match self.intended_mode {
            Px4Mode::Offboard => self.is_setpoint_stream_fresh(sensors.now_us, tuning),
            Px4Mode::Hold | Px4Mode::Takeoff => true,
            Px4Mode::Mission => self.mission.is_stored,
            Px4Mode::Land | Px4Mode::Return => false,
            Px4Mode::Manual | Px4Mode::Altitude | Px4Mode::Position => false,
        };
        runs && self.has_gps_fix && sensors.battery >= tuning.battery_low_charge
    }

    /// Disarms. Refused in the air, unless forced.
    pub fn disarm(&mut self, arming: Arming) -> CommandOutcome {
        if self.armed && !self.landed && arming == Arming::Checked {
            return CommandOutcome::Refused;
        }
        self.armed = false;
        self.failsafe = None;
        self.phase = FlightPhase::Ground;
        self.commanded_cruise_speed = None;
        if self.intended_mode.is_left_on_disarm() {
            self.intended_mode = self.mode_after_disarm;
        }
        CommandOutcome::Done
    }

    /// Enters the mode. While armed, a mode that cannot run is refused. The second COMMAND_ACK of
    /// DO_SET_MODE carries the result.
    pub fn request_mode(
        &mut self,
        mode: Px4Mode,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
    ) -> CommandOutcome {
        let runs = match mode {
            Px4Mode::Offboard => self.is_setpoint_stream_fresh(sensors.now_us, tuning),
            Px4Mode::Mission => self.mission.is_stored,
            mode => !mode.needs_sticks(),
        };
        if self.armed && !runs {
            return CommandOutcome::Refused;
        }
        self.force_mode(mode, sensors);
        CommandOutcome::Done
    }

    /// Enters the mode as a pilot's switch does, even if it cannot run.
    pub fn force_mode(&mut self, mode: Px4Mode, sensors: &SensorReadings) {
        self.intended_mode = mode;
        if !mode.is_left_on_disarm() {
            self.mode_after_disarm = mode;
        }
        if mode != Px4Mode::Takeoff {
            self.takeoff_up = f32::NAN;
        }
        self.failsafe = None;
        self.enter_mode(mode, sensors);
    }

    /// Enters Takeoff to height `up` in the mission frame, metres; NaN: `MIS_TAKEOFF_ALT` above
    /// home.
    pub fn takeoff(
        &mut self,
        up: f32,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
    ) -> CommandOutcome {
        let accepted = self.request_mode(Px4Mode::Takeoff, sensors, tuning);
        if accepted.is_done() {
            self.takeoff_up = if up.is_nan() { sensors.home.z + tuning.takeoff_height } else { up };
        }
        accepted
    }

    /// Enters Hold at point `to` (DO_REPOSITION), ENU metres; a NaN axis keeps the stopping point's
    /// coordinate. Refused if disarmed.
    pub fn reposition(
        &mut self,
        to: &Point,
        heading: f32,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
    ) -> CommandOutcome {
        if !self.armed
            || self.request_mode(Px4Mode::Hold, sensors, tuning) == CommandOutcome::Refused
        {
            return CommandOutcome::Refused;
        }
        for axis in 0..3 {
            if to[axis].is_finite() {
                self.hold_point[axis] = to[axis];
            }
        }
        if heading.is_finite() {
            self.hold_heading = heading;
        }
        CommandOutcome::Done
    }

    /// Sets the cruise speed of the automatic modes (DO_CHANGE_SPEED), m/s; 0 or less: the
    /// parameter's.
    pub fn set_cruise_speed(&mut self, speed: f32) {
        self.commanded_cruise_speed = (speed > 0.0).then_some(speed);
    }

    /// Advances one step: failsafe, timers, flight phase, and the demand of the mode.
    pub fn update(&mut self, sensors: &SensorReadings, tuning: &Px4Tuning) -> FlightModeOutput {
        let now = sensors.now_us;
        if self.armed {
            self.update_failsafe(sensors, tuning);
            self.disarm_if_due(sensors, tuning);
        }
        if !self.armed {
            // A vehicle disarmed in the air falls; it has landed when it touches the ground.
            if !self.landed && sensors.touching {
                self.landed = true;
                self.landed_us = now;
            }
            let demand = tuning.default_demand();
            return FlightModeOutput {
                motors: MotorState::Idle,
                integral: IntegralAction::SetToZero,
                demand,
            };
        }
        let mut demand = self.demand(sensors, tuning);
        let wants_up = self.demands_lift_off(sensors, &demand);
        let mut integral = IntegralAction::Keep;
        match self.phase {
            FlightPhase::Ground => {
                integral = IntegralAction::SetToZero;
                if wants_up && now.saturating_sub(self.armed_us) >= micros_from_s(tuning.spool_up_s)
                {
                    self.phase = FlightPhase::Ramp { since_us: now };
                }
            }
            FlightPhase::Ramp { since_us } => {
                let progress =
                    now.saturating_sub(since_us) as f32 * 1e-6 / tuning.takeoff_ramp_s.max(0.01);
                // During the ramp the climb limit starts at the value that cancels hover thrust
                // (`TakeoffHandling::updateRamp`).
                let floor = -crate::physics::vehicle::GRAVITY / tuning.gains.velocity_p[1].max(0.1);
                let limit = floor + progress * (demand.climb_max - floor);
                if self.landed && progress >= IN_AIR_RAMP_SHARE {
                    self.landed = false;
                    self.flown_since_arming = true;
                }
                if progress >= 1.0 {
                    self.phase = FlightPhase::Flying;
                } else {
                    demand.climb_max = limit;
                    demand.min_thrust_per_weight = 0.0;
                    demand.acceleration.z = f32::NAN;
                }
            }
            FlightPhase::Flying => {
                self.detect_landing(sensors, &demand, tuning);
            }
        }
        let motors = match self.phase {
            FlightPhase::Ground => MotorState::Idle,
            FlightPhase::Ramp { .. } | FlightPhase::Flying => MotorState::Lifting,
        };
        FlightModeOutput { motors, integral, demand }
    }

    fn update_failsafe(&mut self, sensors: &SensorReadings, tuning: &Px4Tuning) {
        let stream_lost = self.intended_mode == Px4Mode::Offboard
            && !self.is_setpoint_stream_fresh(sensors.now_us, tuning);
        let battery_out = sensors.battery < tuning.battery_critical_charge
            && !self.intended_mode.is_left_on_disarm();
        let action = if !self.has_gps_fix {
            (self.intended_mode != Px4Mode::Land).then_some(Px4Mode::Land)
        } else if stream_lost {
            match tuning.offboard_loss_action {
                4 => Some(Px4Mode::Land),
                5 => Some(Px4Mode::Hold),
                6 | 7 => {
                    self.disarm(Arming::Forced);
                    return;
                }
                // Position, Altitude and Manual (0 to 2) need a remote control, which is absent:
                // Return, as for 3.
                _ => Some(Px4Mode::Return),
            }
        } else if battery_out && tuning.low_battery_action == 2 {
            Some(Px4Mode::Land)
        } else if battery_out && tuning.low_battery_action == 3 {
            Some(Px4Mode::Return)
        } else {
            None
        };
        if action != self.failsafe {
            self.failsafe = action;
            self.enter_mode(self.mode(), sensors);
        }
    }

    fn disarm_if_due(&mut self, sensors: &SensorReadings, tuning: &Px4Tuning) {
        let since = |start: u64| sensors.now_us.saturating_sub(start);
        let idle = self.landed && self.phase == FlightPhase::Ground;
        if idle && !self.flown_since_arming && tuning.disarm_preflight_s > 0.0 {
            if since(self.armed_us) >= micros_from_s(tuning.disarm_preflight_s) {
                self.disarm(Arming::Checked);
            }
        } else if idle
            && self.flown_since_arming
            && tuning.disarm_after_landing_s > 0.0
            && since(self.landed_us)
                >= micros_from_s(tuning.disarm_after_landing_s + DISARM_REACTION_S)
        {
            self.disarm(Arming::Checked);
        }
        if sensors.battery <= 0.0 {
            self.disarm(Arming::Forced);
        }
    }

    fn detect_landing(&mut self, sensors: &SensorReadings, demand: &Demand, tuning: &Px4Tuning) {
        // Outside Offboard the crawl is slower than PX4's (`CRAWL_FACTOR`), so a lower rate counts.
        let share = if self.mode() == Px4Mode::Offboard { 1.0 } else { CRAWL_FACTOR };
        let wants_down = -demand.velocity.z >= share * LAND_DETECTOR_DESCENT_MPS;
        if !sensors.touching || !wants_down {
            self.touching_us = None;
            return;
        }
        let since = *self.touching_us.get_or_insert(sensors.now_us);
        if sensors.now_us - since >= micros_from_s(tuning.land_trigger_s + LAND_FILTER_S) {
            self.touching_us = None;
            self.landed = true;
            self.landed_us = sensors.now_us;
            self.phase = FlightPhase::Ground;
        }
    }
}

/// Seconds to microseconds; negative numbers and NaN give 0.
fn micros_from_s(s: f32) -> u64 {
    (f64::from(s) * 1e6) as u64
}
