//! PX4 as a whole: commander, parameters, a pending mode change, and the gimbal commands at the
//! start of a failsafe.

use super::params::{self, Px4Tuning};
use super::setpoint;
use super::{Commander, Px4Mode};
use crate::SimulatedKind;
use crate::link::cmd;
use crate::link::command::{CommandOutcome, TEMPORARILY_REJECTED};
use crate::link::msg::{COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED};
use crate::link::port::Sender;
use crate::link::wire::PayloadReader;
use crate::physics::vehicle::AirframeParameters;
use crate::platform::{FlightModeOutput, Platform, SensorReadings};
use crate::services::mission_flight::{LandedState, MissionLeg};
use crate::services::params::Params;
use crate::status::AutopilotStatus;

/// Gimbal commands that PX4 was recorded to send when a failsafe starts: take control (1001), point
/// ahead (1000, DO_GIMBAL_MANAGER_PITCHYAW), release control (1001, DO_GIMBAL_MANAGER_CONFIGURE).
/// They go to all components (0) of PX4's own system. No component answers.
const FAILSAFE_GIMBAL_COMMANDS: [(u16, [f32; 5]); 3] = [
    (1001, [1.0, 1.0, -1.0, -1.0, 0.0]),
    (1000, [f32::NAN, f32::NAN, f32::NAN, f32::NAN, 2.0]),
    (1001, [-3.0, -3.0, -1.0, -1.0, 0.0]),
];

/// Simulated PX4: state machine and parameters.
#[derive(Clone, Debug)]
pub struct Px4 {
    /// State machine for arming, modes and failsafe.
    pub commander: Commander,
    /// All parameters, as MAVLink reports them.
    pub params: Params,
    /// Values of the parameters that have an effect.
    pub tuning: Px4Tuning,
    /// A DO_SET_MODE to be decided in the next step: sender, and the requested mode if it is valid.
    pub(super) pending_mode: Option<(Sender, Option<Px4Mode>)>,
}

impl Px4 {
    /// PX4 as it boots. The airframe's limits replace the defaults of some parameters.
    pub fn new(system_id: u8, airframe: &AirframeParameters) -> Self {
        let params = params::default_params(system_id, airframe);
        Self {
            commander: Commander::new(),
            tuning: Px4Tuning::new(&params),
            params,
            pending_mode: None,
        }
    }

    /// Advances one step. A requested mode is decided here, so a setpoint that came just after the
    /// command counts for it.
    pub(crate) fn update(
        &mut self,
        platform: &mut Platform,
        sensors: &SensorReadings,
    ) -> FlightModeOutput {
        self.commander.note_stored_mission(platform);
        if let Some((from, mode)) = self.pending_mode.take() {
            let changed = match mode {
                Some(mode) => self.commander.request_mode(mode, sensors, &self.tuning),
                None => CommandOutcome::Refused,
            };
            platform.acknowledge(from, cmd::DO_SET_MODE, changed.result_or(TEMPORARILY_REJECTED));
        }
        self.fly_mission(platform, sensors);
        let failed = self.commander.in_failsafe();
        let output = self.commander.update(sensors, &self.tuning);
        if self.commander.in_failsafe() && !failed {
            send_gimbal_commands(platform);
        }
        output
    }

    /// Updates the leg of the mission while AUTO.MISSION is active. A return item changes to
    /// AUTO.RTL.
    fn fly_mission(&mut self, platform: &mut Platform, sensors: &SensorReadings) {
        if !self.commander.armed() {
            if let Some(leg) = self.commander.mission.leg.take() {
                if matches!(leg, MissionLeg::Land { .. }) {
                    platform.complete_item();
                }
                platform.rewind_mission();
            }
            return;
        }
        if self.commander.mode() != Px4Mode::Mission {
            if self.commander.mission.leg.take().is_some() {
                platform.missions.progress.restart_item();
            }
            return;
        }
        let landed =
            if self.commander.landed() { LandedState::OnGround } else { LandedState::InAir };
        let leg = platform.advance_mission(sensors, landed);
        let mission = &mut self.commander.mission;
        if leg != mission.leg {
            mission.leg_start = MissionLeg::leg_end(mission.leg, &sensors.position);
        }
        mission.leg = leg;
        if let Some(speed) = platform.missions.take_requested_speed() {
            self.commander.set_cruise_speed(speed);
        }
        if self.commander.mission.leg == Some(MissionLeg::Return) {
            self.commander.mission.leg = None;
            platform.complete_item();
            platform.rewind_mission();
            self.commander.force_mode(Px4Mode::Return, sensors);
        }
    }

    /// State that telemetry reports.
    pub fn status(&self, platform: &Platform, sensors: &SensorReadings) -> AutopilotStatus {
        let (system_status, flags) = self.commander.heartbeat(platform.time_us, &self.tuning);
        AutopilotStatus {
            autopilot: SimulatedKind::Px4,
            custom_mode: self.commander.mode().custom_mode(),
            intended_mode: self.commander.intended_mode().custom_mode(),
            base_mode: flags,
            system_status,
            armable: self.commander.is_armable(sensors, &self.tuning),
            landed_state: self.commander.landed_state(),
            reports_position_target: true,
            ekf_flags: 0,
            origin_known: true,
            // PX4 sends LOCAL_POSITION_NED only while the estimate is valid.
            position_known: platform.gps_ok,
        }
    }

    /// Handles a setpoint message of type `id`; invalid ones are ignored.
    pub fn handle_setpoint(&mut self, platform: &Platform, id: u32, fields: &PayloadReader<'_>) {
        let context = setpoint::FrameContext {
            frame: &platform.frame,
            heading: platform.vehicle.state().heading_rad,
            home_alt_m: platform.home.alt_m,
        };
        let setpoint = if id == SET_POSITION_TARGET_LOCAL_NED {
            setpoint::read_local_ned(fields, &context)
        } else {
            setpoint::read_global_int(fields, &context)
        };
        if let Some(setpoint) = setpoint {
            self.commander.handle_setpoint(setpoint, platform.time_us);
        }
    }
}

fn send_gimbal_commands(platform: &mut Platform) {
    for (command, params) in FAILSAFE_GIMBAL_COMMANDS {
        let mut payload = [0; 33];
        for (k, param) in params.iter().enumerate() {
            payload[4 * k..4 * k + 4].copy_from_slice(&param.to_le_bytes());
        }
        payload[28..30].copy_from_slice(&command.to_le_bytes());
        payload[30] = platform.config.system_id;
        platform.ports.iter_mut().for_each(|port| port.send_raw(COMMAND_LONG, &payload));
    }
}
