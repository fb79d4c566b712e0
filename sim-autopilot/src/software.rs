//! Dispatches every call that depends on the kind of autopilot.

use crate::ardupilot::{self, Copter};
use crate::config::AutopilotConfig;
use crate::link::command::ReceivedCommand;
use crate::link::port::Sender;
use crate::link::wire::PayloadReader;
use crate::physics::vehicle::Gains;
use crate::platform::{FlightModeOutput, Platform, SensorReadings};
use crate::px4;
use crate::px4::software::Px4;
use crate::services::params::Params;
use crate::status::AutopilotStatus;
use crate::telemetry;
use crate::{GpsFix, SimulatedKind};

/// The autopilot software of one vehicle.
#[derive(Clone, Debug)]
pub enum AutopilotSoftware {
    /// PX4 1.17.
    Px4(Box<Px4>),
    /// ArduCopter 4.6.
    Copter(Box<Copter>),
}

impl AutopilotSoftware {
    pub(super) fn new(config: &AutopilotConfig) -> Self {
        match config.autopilot {
            SimulatedKind::Px4 => Self::Px4(Box::new(Px4::new(config.system_id, &config.vehicle))),
            SimulatedKind::Ardupilot => Self::Copter(Box::new(Copter::new(
                config.system_id,
                &config.vehicle,
                config.estimator_ready_s,
            ))),
        }
    }

    /// Default telemetry streams: message id and interval in µs; 0: off until requested.
    pub(super) fn streams(autopilot: SimulatedKind) -> &'static [(u32, u32)] {
        match autopilot {
            SimulatedKind::Px4 => &telemetry::PX4_STREAMS,
            SimulatedKind::Ardupilot => &ardupilot::STREAMS,
        }
    }

    /// Sends the messages that the autopilot sends at boot.
    pub(super) fn send_boot_messages(&mut self, platform: &mut Platform) {
        match self {
            Self::Px4(_) => platform.announce_origin(),
            Self::Copter(copter) => copter.send_boot_messages(platform),
        }
    }

    pub(super) fn armed(&self) -> bool {
        match self {
            Self::Px4(px4) => px4.commander.armed(),
            Self::Copter(copter) => copter.armed(),
        }
    }

    pub(super) fn landed(&self) -> bool {
        match self {
            Self::Px4(px4) => px4.commander.landed(),
            Self::Copter(copter) => copter.landed(),
        }
    }

    pub(super) fn in_failsafe(&self) -> bool {
        match self {
            Self::Px4(px4) => px4.commander.in_failsafe(),
            Self::Copter(copter) => copter.in_failsafe(),
        }
    }

    pub(super) fn gains(&self) -> &Gains {
        match self {
            Self::Px4(px4) => &px4.tuning.gains,
            Self::Copter(copter) => &copter.tuning.gains,
        }
    }

    /// Advances the flight mode by one step; returns what it gives to the position controller.
    pub(super) fn update(
        &mut self,
        platform: &mut Platform,
        sensors: &SensorReadings,
        dt_s: f32,
    ) -> FlightModeOutput {
        match self {
            Self::Px4(px4) => px4.update(platform, sensors),
            Self::Copter(copter) => copter.update(platform, sensors, dt_s),
        }
    }

    pub(super) fn status(&self, platform: &Platform, sensors: &SensorReadings) -> AutopilotStatus {
        match self {
            Self::Px4(px4) => px4.status(platform, sensors),
            Self::Copter(copter) => copter.status(sensors),
        }
    }

    pub(super) fn handle_command(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        command: &ReceivedCommand,
    ) {
        match self {
            Self::Px4(px4) => px4.handle_command(platform, from, command),
            Self::Copter(copter) => copter.handle_command(platform, from, command),
        }
    }

    pub(super) fn handle_set_mode(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        fields: &PayloadReader<'_>,
    ) {
        match self {
            Self::Px4(px4) => px4.handle_set_mode(platform, fields),
            Self::Copter(copter) => copter.handle_set_mode(platform, from, fields),
        }
    }

    /// Handles SET_POSITION_TARGET_LOCAL_NED (84) or _GLOBAL_INT (86).
    pub(super) fn handle_setpoint(
        &mut self,
        platform: &Platform,
        id: u32,
        fields: &PayloadReader<'_>,
    ) {
        match self {
            Self::Px4(px4) => px4.handle_setpoint(platform, id, fields),
            Self::Copter(copter) => copter.handle_setpoint(platform, id, fields),
        }
    }

    /// Handles REQUEST_DATA_STREAM, which PX4 ignores.
    pub(super) fn handle_stream_request(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        fields: &PayloadReader<'_>,
    ) {
        if let Self::Copter(_) = self {
            ardupilot::commands::handle_stream_request(platform, from, fields);
        }
    }

    /// Handles another system's HEARTBEAT: ArduCopter's ground station failsafe uses it, the
    /// simulated PX4 ignores it.
    pub(super) fn handle_heartbeat(&mut self, platform: &mut Platform, from: Sender) {
        if let Self::Copter(copter) = self {
            copter.handle_heartbeat(platform, from);
        }
    }

    pub(super) fn params(&self) -> &Params {
        match self {
            Self::Px4(px4) => &px4.params,
            Self::Copter(copter) => &copter.params,
        }
    }

    /// Handles PARAM_SET: changes the parameter if the value is valid, and updates the tuning.
    pub(super) fn set_param(&mut self, name: &str, wire: f32, wire_type: u8) {
        match self {
            Self::Px4(px4) => {
                px4.params.set(name, wire, wire_type);
                px4.tuning = px4::params::Px4Tuning::new(&px4.params);
            }
            Self::Copter(copter) => {
                copter.params.set(name, wire, wire_type);
                copter.tuning = ardupilot::params::CopterTuning::new(&copter.params);
            }
        }
    }

    /// Sets an integer parameter, clamped to its type's range; false if this name has no parameter
    /// or a float.
    pub(super) fn set_integer(&mut self, name: &str, value: i32) -> bool {
        let params = self.params();
        let Some((_, old)) = params.index(name).and_then(|index| params.get(index)) else {
            return false;
        };
        let Some(new) = old.with_integer(value) else { return false };
        let wire = params.to_wire(new);
        self.set_param(name, wire, new.wire_type());
        true
    }

    /// Copies the parameters from before a reboot.
    pub(super) fn copy_params_from(&mut self, before: &Self) {
        match (self, before) {
            (Self::Px4(now), Self::Px4(before)) => {
                (now.params, now.tuning) = (before.params.clone(), before.tuning);
            }
            (Self::Copter(now), Self::Copter(before)) => {
                (now.params, now.tuning) = (before.params.clone(), before.tuning);
            }
            _ => {}
        }
    }

    /// Sets GPS's fix.
    pub(super) fn set_gps_fix(&mut self, fix: GpsFix) {
        match self {
            Self::Px4(px4) => px4.commander.set_gps_fix(fix),
            Self::Copter(copter) => copter.set_gps_fix(fix),
        }
    }

    /// Sets the mode of this `custom_mode` as the pilot's switch does; false if there is no such
    /// mode.
    pub(super) fn force_mode(&mut self, custom_mode: u32, sensors: &SensorReadings) -> bool {
        match self {
            Self::Px4(px4) => px4::Px4Mode::from_custom_mode(custom_mode)
                .map(|mode| px4.commander.force_mode(mode, sensors))
                .is_some(),
            Self::Copter(copter) => ardupilot::CopterMode::from_number(custom_mode)
                .map(|mode| copter.force_mode(mode, sensors))
                .is_some(),
        }
    }
}
