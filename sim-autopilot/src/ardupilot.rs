//! ArduCopter 4.6's state machine: arming, modes, take-off, Guided, failsafes and landing, as
//! observed.
//!
//! | state | left by |
//! |---|---|
//! | disarmed | arm command in a mode that allows it, with the estimator ready |
//! | armed, on the ground | NAV_TAKEOFF in Guided; `DISARM_DELAY` disarms. Setpoints do not lift the vehicle |
//! | take-off | lifts off 2.07 s after the command (at the earliest 3.05 s after arming) and climbs; a setpoint ends it (before lift-off: stays on the ground) |
//! | flying | on the ground for 1.6 s without a demand to climb: landed |
//! | landed | in LAND, RTL and a landing in AUTO disarms 0.4 s later, else after `DISARM_DELAY` |
//!
//! In Guided a velocity is held for `GUID_TIMEOUT` after the last setpoint, a position for ever.
//! Times are arguments, in microseconds since boot; no clock is read.

mod arming;
mod auto;
mod auto_state;
pub(super) mod commands;
mod flight;
mod modes;
pub mod params;
pub mod reference;
pub mod setpoint;
mod unsolicited;

pub use self::modes::CopterMode;

use planner_core::Point;

use self::auto_state::Auto;
use self::params::CopterTuning;
use self::reference::CopterReference;
use self::setpoint::GuidedGoal;
use crate::link::command::{Arming, CommandOutcome};
use crate::link::msg::SET_POSITION_TARGET_LOCAL_NED;
use crate::link::port::Sender;
use crate::link::wire::PayloadReader;
use crate::physics::vehicle::{AirframeParameters, Demand};
use crate::platform::{FlightModeOutput, IntegralAction, Platform, SensorReadings};
use crate::services::params::Params;
use crate::status::{AutopilotStatus, MotorState};
use crate::{GpsFix, SimulatedKind};

/// Time from arming to lift-off if NAV_TAKEOFF comes at once, seconds: `MOT` arming delay 2 s,
/// spool-up 0.5 s, and the throttle's slew to hover.
const ARM_TO_LIFT_S: f32 = 3.05;
/// Time from a later NAV_TAKEOFF to lift-off, seconds.
const TAKEOFF_TO_LIFT_S: f32 = 2.07;
/// Time on the ground until landed, seconds: `LAND_DETECTOR_TRIGGER_SEC` and filters; 1.68 s seen.
const LAND_DETECTOR_S: f32 = 1.6;
/// Time from landed to disarmed in LAND and RTL, seconds: 0.4 s seen; HEARTBEAT shows it at 0.8 s.
const LAND_DISARM_S: f32 = 0.4;
/// Time by which ArduCopter disarms earlier than `DISARM_DELAY`, seconds: 9.94 s of 10 seen.
const IDLE_DISARM_EARLY_S: f32 = 0.06;
/// Delay of the ground-station failsafe beyond `FS_GCS_TIMEOUT`, seconds: 5.1 s of 5 seen.
const GCS_REACTION_S: f32 = 0.1;
/// Time from the loss of the position to the EKF failsafe, seconds (`EKF_CHECK_ITERATIONS_MAX` and
/// the estimator's own timeout).
const ESTIMATOR_REACTION_S: f32 = 1.5;
/// Time from boot until the estimator has an attitude, seconds: 5.8 s seen.
const BOOT_TO_ATTITUDE_S: f32 = 5.8;
/// Time from boot until the estimator has an origin, as a share of the time until it has a
/// position: 20 of 41.6 s seen.
const BOOT_TO_ORIGIN_SHARE: f32 = 0.48;
/// Time from boot until HEARTBEAT reports STANDBY, seconds.
const BOOT_TO_STANDBY_S: f32 = 3.0;

/// Telemetry streams: message id and default interval in µs; 0: off until requested.
pub const STREAMS: [(u32, u32); 25] = [
    (0, 1_000_000),    // HEARTBEAT
    (111, 10_000_000), // TIMESYNC
    (1, 0),            // SYS_STATUS
    (2, 0),            // SYSTEM_TIME
    (24, 0),           // GPS_RAW_INT
    (29, 0),           // SCALED_PRESSURE
    (30, 0),           // ATTITUDE
    (31, 0),           // ATTITUDE_QUATERNION
    (32, 0),           // LOCAL_POSITION_NED
    (33, 0),           // GLOBAL_POSITION_INT
    (36, 0),           // SERVO_OUTPUT_RAW
    (42, 0),           // MISSION_CURRENT
    (49, 0),           // GPS_GLOBAL_ORIGIN
    (62, 0),           // NAV_CONTROLLER_OUTPUT
    (74, 0),           // VFR_HUD
    (83, 0),           // ATTITUDE_TARGET
    (85, 0),           // POSITION_TARGET_LOCAL_NED
    (105, 0),          // HIGHRES_IMU
    (132, 0),          // DISTANCE_SENSOR
    (147, 0),          // BATTERY_STATUS
    (148, 0),          // AUTOPILOT_VERSION
    (193, 0),          // EKF_STATUS_REPORT
    (241, 0),          // VIBRATION
    (242, 0),          // HOME_POSITION
    (245, 0),          // EXTENDED_SYS_STATE
];

/// Which failsafe is active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Failsafe {
    /// The ground station is silent: RTL.
    GroundStation,
    /// There is no position: LAND.
    Estimator,
    /// The battery is low: LAND or RTL.
    Battery,
}

/// A take-off in progress: time of the command, and target height (ENU up), metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TakeOff {
    /// Time of the command, microseconds since boot.
    since_us: u64,
    /// Target height, ENU up, metres.
    up: f32,
}

/// Leg of a return; `up` is its height, ENU metres (NaN: not computed yet).
#[derive(Clone, Copy, Debug, PartialEq)]
enum RtlLeg {
    /// Straight up to `up`.
    Climb { up: f32 },
    /// At height `up` to above home.
    Cross { up: f32 },
    /// Above home, since `since_us`, microseconds since boot.
    Wait { since_us: u64, up: f32 },
    /// Straight down.
    Land,
}

/// Time at which each phase last began, microseconds since boot.
#[derive(Clone, Copy, Debug, Default)]
struct PhaseStartTimes {
    armed_us: u64,
    lifted_us: u64,
    /// Since when the vehicle has stood armed on the ground without a take-off.
    idle_us: u64,
    landed_us: u64,
    /// Since when the vehicle has touched the ground in flight without a demand to climb.
    touching_us: Option<u64>,
}

/// Simulated ArduCopter: state machine and parameters.
#[derive(Clone, Debug)]
pub struct Copter {
    /// All parameters, as MAVLink reports them.
    pub params: Params,
    /// Values of the parameters that have an effect.
    pub tuning: CopterTuning,
    /// Time from which on the estimator has a position while GPS has a fix, microseconds since
    /// boot.
    position_ready_us: u64,
    /// Whether the messages at the estimator's origin and at its first position have been sent.
    reported_origin_and_position: [bool; 2],
    /// Time at which STAT_RUNTIME was last sent, microseconds since boot.
    runtime_sent_us: u64,
    armed: bool,
    since: PhaseStartTimes,
    /// Whether the position controller starts in flight in this step, so that its integral is
    /// initialised.
    controller_starts: bool,
    landed: bool,
    mode: CopterMode,
    /// The failsafe that acts; `None` without one.
    failsafe: Option<Failsafe>,
    has_gps_fix: bool,
    /// When the loss of the position was noticed in a mode that needs one, microseconds since boot;
    /// else `None`.
    position_lost_us: Option<u64>,
    /// When the ground station was last heard, microseconds since boot; `None` before.
    last_gcs_heartbeat_us: Option<u64>,
    /// The take-off in progress; `None` without one.
    takeoff: Option<TakeOff>,
    /// Goal of Guided; other modes compute theirs in each step.
    goal: GuidedGoal,
    /// When a setpoint or DO_REPOSITION last set `goal`, microseconds since boot; `GUID_TIMEOUT`
    /// counts from then.
    goal_set_us: u64,
    reference: CopterReference,
    /// Horizontal speed limit by DO_CHANGE_SPEED, m/s; `None`: `WPNAV_SPEED`.
    commanded_speed: Option<f32>,
    rtl_leg: RtlLeg,
    auto: Auto,
}

impl Copter {
    /// ArduCopter as it boots: disarmed in STABILIZE; its estimator has a position after `ready_s`.
    pub fn new(system_id: u8, airframe: &AirframeParameters, ready_s: f32) -> Self {
        let params = params::default_params(system_id, airframe);
        Self {
            tuning: CopterTuning::new(&params),
            params,
            position_ready_us: micros_from_s(ready_s),
            reported_origin_and_position: [false; 2],
            runtime_sent_us: 0,
            armed: false,
            since: PhaseStartTimes::default(),
            controller_starts: false,
            landed: true,
            mode: CopterMode::Stabilize,
            failsafe: None,
            has_gps_fix: true,
            position_lost_us: None,
            last_gcs_heartbeat_us: None,
            takeoff: None,
            goal: GuidedGoal::STOP,
            goal_set_us: 0,
            reference: CopterReference::new(Point::zeros(), Point::zeros()),
            commanded_speed: None,
            rtl_leg: RtlLeg::Land,
            auto: Auto::default(),
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

    /// Whether a failsafe is active.
    pub fn in_failsafe(&self) -> bool {
        self.failsafe.is_some()
    }

    /// Sets whether GPS has a fix, without which the estimator has no position.
    pub fn set_gps_fix(&mut self, fix: GpsFix) {
        self.has_gps_fix = fix == GpsFix::Held;
    }

    /// Whether the estimator has a position.
    fn position_known(&self, now_us: u64) -> bool {
        self.has_gps_fix && now_us >= self.position_ready_us
    }

    /// State that telemetry reports.
    pub fn status(&self, sensors: &SensorReadings) -> AutopilotStatus {
        let now_us = sensors.now_us;
        let known = self.position_known(now_us);
        let sticks = matches!(self.mode, CopterMode::Stabilize | CopterMode::AltHold);
        AutopilotStatus {
            autopilot: SimulatedKind::Ardupilot,
            custom_mode: self.mode.number(),
            intended_mode: self.mode.number(),
            // Flags custom mode, stabilized and manual input; and guided, except in STABILIZE and
            // ALT_HOLD.
            base_mode: 0x51 | if sticks { 0 } else { 8 } | if self.armed { 0x80 } else { 0 },
            system_status: match self.failsafe {
                Some(_) => 5,
                None if now_us < micros_from_s(BOOT_TO_STANDBY_S) => 1,
                None if self.landed => 3,
                None => 4,
            },
            armable: self.check_arming(sensors).is_ok(),
            landed_state: match self.mode {
                _ if self.landed => 1,
                _ if self.takeoff.is_some() => 3,
                CopterMode::Land => 4,
                CopterMode::Auto if self.is_landing_in_auto() => 4,
                CopterMode::Rtl if self.rtl_leg == RtlLeg::Land => 4,
                _ => 2,
            },
            reports_position_target: self.mode == CopterMode::Guided,
            ekf_flags: if now_us < micros_from_s(BOOT_TO_ATTITUDE_S).min(self.position_ready_us) {
                0x400
            } else if known {
                0x33F
            } else {
                0xA7
            },
            origin_known: self.origin_known(now_us),
            position_known: known,
        }
    }

    /// Whether the estimator has an origin.
    fn origin_known(&self, now_us: u64) -> bool {
        now_us as f32 >= BOOT_TO_ORIGIN_SHARE * self.position_ready_us as f32
    }

    /// Handles a setpoint message of type `id`; ignored outside Guided.
    pub fn handle_setpoint(&mut self, platform: &Platform, id: u32, fields: &PayloadReader<'_>) {
        if self.mode != CopterMode::Guided {
            return;
        }
        let goal = if id == SET_POSITION_TARGET_LOCAL_NED {
            setpoint::read_local_ned(fields, platform)
        } else {
            setpoint::read_global_int(fields, platform)
        };
        self.set_guided_goal(goal, &platform.sensors());
    }

    /// Sets the goal of Guided, which ends a take-off in progress.
    fn set_guided_goal(&mut self, goal: GuidedGoal, sensors: &SensorReadings) {
        if self.takeoff.take().is_some() || goal.position.is_some() != self.goal.position.is_some()
        {
            self.reference = CopterReference::new(sensors.position, sensors.velocity);
        }
        (self.goal, self.goal_set_us) = (goal, sensors.now_us);
    }

    /// Handles another system's HEARTBEAT: only that of `SYSID_MYGCS` counts for the failsafe.
    pub(super) fn handle_heartbeat(&mut self, platform: &mut Platform, from: Sender) {
        if from.system != self.tuning.gcs_system {
            return;
        }
        self.last_gcs_heartbeat_us = Some(platform.time_us);
        if self.failsafe == Some(Failsafe::GroundStation) {
            // The vehicle stays in the mode that the failsafe chose.
            self.failsafe = None;
            platform.send_text(4, "GCS Failsafe Cleared");
        }
    }

    /// Enters the mode. Refused while armed, if it needs a position and there is none.
    fn request_mode(&mut self, mode: CopterMode, sensors: &SensorReadings) -> CommandOutcome {
        if self.armed && mode.needs_position() && !self.position_known(sensors.now_us) {
            return CommandOutcome::Refused;
        }
        self.force_mode(mode, sensors);
        CommandOutcome::Done
    }

    /// Enters the mode as a pilot's switch does, even if it cannot run; not if it is current.
    pub fn force_mode(&mut self, mode: CopterMode, sensors: &SensorReadings) {
        if mode == self.mode {
            return;
        }
        // LAND continues with the running controller's reference; all other modes start a new one.
        let runs = self.mode.needs_position() && !self.landed;
        if mode != CopterMode::Land || !runs {
            self.reference = CopterReference::new(sensors.position, sensors.velocity);
            self.reference.acceleration =
                if self.landed { Point::zeros() } else { sensors.acceleration };
            self.controller_starts = !self.landed;
        }
        self.mode = mode;
        self.takeoff = None;
        self.goal = GuidedGoal::STOP;
        self.rtl_leg = RtlLeg::Climb { up: f32::NAN };
    }

    /// Starts a take-off (NAV_TAKEOFF) to height `up` (mission frame). Refused if not possible.
    fn take_off(&mut self, up: f32, sensors: &SensorReadings) -> CommandOutcome {
        let possible =
            self.armed && self.landed && self.mode == CopterMode::Guided && up > sensors.position.z;
        if !possible {
            return CommandOutcome::Refused;
        }
        let since_us = self.takeoff.map_or(sensors.now_us, |takeoff| takeoff.since_us);
        self.takeoff = Some(TakeOff { since_us, up });
        self.auto.may_lift = true;
        CommandOutcome::Done
    }

    /// Advances one step: failsafes, timers, mission, land detector, and the demand of the mode.
    pub fn update(
        &mut self,
        platform: &mut Platform,
        sensors: &SensorReadings,
        dt_s: f32,
    ) -> FlightModeOutput {
        let now_us = sensors.now_us;
        self.send_unsolicited_messages(platform, now_us);
        if self.armed {
            self.update_failsafe(platform, sensors);
            self.disarm_if_due(platform, sensors);
            self.fly_mission(platform, sensors);
        }
        if !self.armed {
            // A vehicle disarmed in the air falls; it has landed when it touches the ground.
            self.landed |= sensors.touching;
            return self.idle_output();
        }
        if self.landed
            && let Some(takeoff) = self.takeoff
            && now_us
                >= (takeoff.since_us + micros_from_s(TAKEOFF_TO_LIFT_S))
                    .max(self.since.armed_us + micros_from_s(ARM_TO_LIFT_S))
        {
            self.landed = false;
            self.since.touching_us = None;
            self.since.lifted_us = now_us;
            self.reference = CopterReference::new(sensors.position, Point::zeros());
        }
        if self.landed {
            return self.idle_output();
        }
        let demand = self.demand(sensors, dt_s);
        self.detect_landing(sensors, &demand);
        let integral = if core::mem::take(&mut self.controller_starts) {
            IntegralAction::Match
        } else {
            IntegralAction::Keep
        };
        FlightModeOutput { motors: MotorState::Lifting, integral, demand }
    }

    /// Output while the motors are off or idle.
    fn idle_output(&self) -> FlightModeOutput {
        FlightModeOutput {
            motors: MotorState::Idle,
            integral: IntegralAction::SetToZero,
            demand: self.tuning.default_demand(),
        }
    }

    /// Starts the failsafes: lost position (LAND), silent ground station (RTL), low battery. That
    /// of a lost position ends once there is a position again, but the mode stays LAND.
    fn update_failsafe(&mut self, platform: &mut Platform, sensors: &SensorReadings) {
        let now_us = sensors.now_us;
        let since = |start: u64| now_us.saturating_sub(start);
        if self.position_known(now_us) {
            self.position_lost_us = None;
            if self.failsafe == Some(Failsafe::Estimator) {
                self.failsafe = None;
            }
        } else if self.tuning.estimator_failsafe
            && self.mode.needs_position()
            && since(*self.position_lost_us.get_or_insert(now_us))
                >= micros_from_s(ESTIMATOR_REACTION_S)
        {
            self.failsafe = Some(Failsafe::Estimator);
            platform.send_text(2, "EKF Failsafe: changed to LAND Mode");
            self.force_mode(CopterMode::Land, sensors);
        }
        if self.failsafe.is_some() || self.landed {
            return;
        }
        let silent =
            |at: u64| since(at) >= micros_from_s(self.tuning.gcs_timeout_s + GCS_REACTION_S);
        if self.tuning.gcs_failsafe && self.last_gcs_heartbeat_us.is_some_and(silent) {
            self.failsafe = Some(Failsafe::GroundStation);
            platform.send_text(4, "GCS Failsafe");
            self.force_mode(CopterMode::Rtl, sensors);
        } else if sensors.battery < self.tuning.battery_low_charge
            && self.tuning.low_battery_action > 0
        {
            self.failsafe = Some(Failsafe::Battery);
            platform.send_text(4, "Battery 1 is low");
            self.force_mode(
                if self.tuning.low_battery_action == 1 {
                    CopterMode::Land
                } else {
                    CopterMode::Rtl
                },
                sensors,
            );
        }
    }

    /// Disarms after a landing, and when the vehicle idles on the ground.
    fn disarm_if_due(&mut self, platform: &mut Platform, sensors: &SensorReadings) {
        let since = |start: u64| sensors.now_us.saturating_sub(start);
        if !self.landed || self.takeoff.is_some() {
            self.since.idle_us = sensors.now_us;
        } else {
            let delay = self.tuning.disarm_delay_s - IDLE_DISARM_EARLY_S;
            let landing = matches!(self.mode, CopterMode::Land | CopterMode::Rtl)
                || self.is_landing_in_auto();
            if landing && since(self.since.landed_us) >= micros_from_s(LAND_DISARM_S)
                || delay > 0.0 && since(self.since.idle_us) >= micros_from_s(delay)
            {
                self.disarm(platform, Arming::Checked);
            }
        }
        if sensors.battery <= 0.0 {
            self.disarm(platform, Arming::Forced);
        }
    }

    /// Updates whether the vehicle counts as landed.
    fn detect_landing(&mut self, sensors: &SensorReadings, demand: &Demand) {
        let climbing = demand.velocity.z > 0.05;
        if !sensors.touching || climbing {
            self.since.touching_us = None;
            return;
        }
        let since = *self.since.touching_us.get_or_insert(sensors.now_us);
        if sensors.now_us - since >= micros_from_s(LAND_DETECTOR_S) {
            self.since.touching_us = None;
            self.landed = true;
            self.since.landed_us = sensors.now_us;
            self.takeoff = None;
            self.goal = GuidedGoal::STOP;
        }
    }
}

/// Seconds to microseconds; negative numbers and NaN give 0.
fn micros_from_s(s: f32) -> u64 {
    (f64::from(s) * 1e6) as u64
}
