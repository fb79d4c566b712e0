//! Reads COMMAND_LONG and COMMAND_INT into one type; MAV_RESULT values of the answers.

use crate::link::wire::PayloadReader;

// Values of MAV_RESULT.
pub const ACCEPTED: u8 = 0;
pub const TEMPORARILY_REJECTED: u8 = 1;
pub const DENIED: u8 = 2;
pub const UNSUPPORTED: u8 = 3;
pub const FAILED: u8 = 4;

/// Parameter 2 of COMPONENT_ARM_DISARM that arms or disarms without checks.
const ARM_FORCE: f32 = 21_196.0;
/// MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.
pub const CUSTOM_MODE: u8 = 1;

/// A received command.
pub struct ReceivedCommand {
    /// Number of the command (MAV_CMD).
    pub id: u16,
    /// Parameters 1 to 4.
    pub param: [f32; 4],
    /// Parameter 5 as a number, for commands where it is no latitude.
    pub param5: f32,
    /// Latitude and longitude (parameters 5 and 6), degrees; NaN where not given.
    pub lat_lon_deg: [f64; 2],
    /// Parameter 7, for most commands an altitude, metres.
    pub z: f32,
    /// Whether altitude `z` counts from home; false: from sea level.
    pub relative_to_home: bool,
}

impl ReceivedCommand {
    /// Reads the payload of a COMMAND_LONG.
    pub fn from_command_long(fields: &PayloadReader<'_>) -> Self {
        let place = [f64::from(fields.f32(16)), f64::from(fields.f32(20))];
        Self {
            id: fields.u16(28),
            param: params_1_to_4(fields),
            param5: fields.f32(16),
            lat_lon_deg: place,
            z: fields.f32(24),
            relative_to_home: false,
        }
    }

    /// Reads the payload of a COMMAND_INT.
    pub fn from_command_int(fields: &PayloadReader<'_>) -> Self {
        let degrees = |at: usize| match fields.i32(at) {
            i32::MAX => f64::NAN,
            scaled => f64::from(scaled) * 1e-7,
        };
        let relative = matches!(fields.u8(32), 3 | 6);
        let place = [degrees(16), degrees(20)];
        Self {
            id: fields.u16(28),
            param: params_1_to_4(fields),
            param5: fields.i32(16) as f32,
            lat_lon_deg: place,
            z: fields.f32(24),
            relative_to_home: relative,
        }
    }
}

/// Parameters 1 to 4 of a command message.
fn params_1_to_4(fields: &PayloadReader<'_>) -> [f32; 4] {
    [fields.f32(0), fields.f32(4), fields.f32(8), fields.f32(12)]
}

/// Whether a command was carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandOutcome {
    /// It was.
    Done,
    /// It was not, and nothing changed.
    Refused,
}

impl CommandOutcome {
    /// Whether the command was carried out.
    pub fn is_done(self) -> bool {
        self == Self::Done
    }

    /// MAV_RESULT of the command: ACCEPTED if it was carried out, else `refused`.
    pub fn result_or(self, refused: u8) -> u8 {
        match self {
            Self::Done => ACCEPTED,
            Self::Refused => refused,
        }
    }
}

/// How arming or disarming is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arming {
    /// With its checks.
    Checked,
    /// Whatever the checks say.
    Forced,
}

impl Arming {
    /// As COMPONENT_ARM_DISARM commands it.
    pub fn commanded_by(command: &ReceivedCommand) -> Self {
        if command.param[1] == ARM_FORCE { Self::Forced } else { Self::Checked }
    }
}

/// The message id that a float parameter holds; `None` outside 24 bits.
pub fn message_id_from_param(value: f32) -> Option<u32> {
    (0.0..16_777_216.0).contains(&value).then_some(value as u32)
}
