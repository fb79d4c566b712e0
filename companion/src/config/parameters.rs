//! The tunables of one vehicle as MAVLink parameters: names, ranges, defaults, and their record in
//! flash.
//!
//! All are sent as REAL32, since ground tools decode integers differently for each autopilot kind.
//! Settings that the whole swarm must share are in the mission file instead. A changed value takes
//! effect once the vehicle is disarmed and idle; a changed system id only after a restart.

use crate::config::{Config, REACHES_ALL_M};

/// Longest name of a parameter, bytes.
pub const NAME_LEN: usize = 16;
/// Bytes of a parameter in flash: name and value.
const ENTRY_LEN: usize = NAME_LEN + 4;

/// Declaration of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name, at most 16 bytes of ASCII.
    pub name: &'static str,
    /// Least value that can be set.
    pub min: f32,
    /// Greatest value that can be set.
    pub max: f32,
    /// Value on a new board.
    pub default: f32,
    /// Whether only whole numbers can be set.
    pub whole: bool,
}

/// A parameter with a real value from `least` to `most`.
const fn real_parameter(name: &'static str, least: f32, most: f32, default: f32) -> Parameter {
    Parameter { name, min: least, max: most, default, whole: false }
}

/// A parameter with a whole value from `least` to `most`.
const fn whole_parameter(name: &'static str, least: f32, most: f32, default: f32) -> Parameter {
    Parameter { name, min: least, max: most, default, whole: true }
}

/// Number of parameters.
pub const PARAMETER_COUNT: usize = 10;
/// Bytes of all parameters in flash.
pub const STORED_LEN: usize = PARAMETER_COUNT * ENTRY_LEN;

/// All parameters, sorted by name; `companion/README.md` prints the same table.
pub const TABLE: [Parameter; PARAMETER_COUNT] = [
    real_parameter("FLK_ACCEL", 0.2, 5.0, 1.5),
    whole_parameter("FLK_BATT_LOW", 0.0, 100.0, 15.0),
    real_parameter("FLK_CLIMB_MAX", 0.2, 5.0, 5.0),
    real_parameter("FLK_EST_M", 0.05, 10.0, 0.1),
    real_parameter("FLK_RADIO_M", 1.0, REACHES_ALL_M, REACHES_ALL_M),
    whole_parameter("FLK_RESUME", 0.0, 1.0, 1.0),
    real_parameter("FLK_SPEED_MAX", 0.1, 20.0, 20.0),
    real_parameter("FLK_START_TOL", 0.2, 20.0, 2.0),
    whole_parameter("FLK_SWARM_HZ", 2.0, 10.0, 5.0),
    whole_parameter("FLK_SYS_ID", 0.0, 250.0, 0.0),
];

// Indices in `TABLE`, by the parameters' names without `FLK_`.
const ACCEL: usize = 0;
const BATT_LOW: usize = 1;
const CLIMB_MAX: usize = 2;
const EST_M: usize = 3;
const RADIO_M: usize = 4;
const RESUME: usize = 5;
const SPEED_MAX: usize = 6;
const START_TOL: usize = 7;
const SWARM_HZ: usize = 8;
const SYS_ID: usize = 9;

/// Reason why a parameter value was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterError {
    /// No parameter has this index.
    Unknown,
    /// The value is NaN, infinite, out of range, or a fraction where a whole number is required.
    Range,
}

/// The values of all parameters, in the order of [`TABLE`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETER_COUNT],
}

impl Default for Parameters {
    fn default() -> Self {
        Self { values: TABLE.map(|parameter| parameter.default) }
    }
}

impl Parameters {
    /// Index of the parameter of this name; `None` if there is none.
    pub fn index_of(name: &[u8]) -> Option<usize> {
        TABLE.iter().position(|parameter| parameter.name.as_bytes() == name)
    }

    /// Name and value of the parameter at this index; `None` if there is none.
    pub fn get(&self, index: usize) -> Option<(&'static str, f32)> {
        Some((TABLE.get(index)?.name, *self.values.get(index)?))
    }

    /// Sets the value of the parameter at this index. Returns whether it changed.
    ///
    /// # Errors
    /// No parameter has the index, or the value is out of range: nothing changes.
    pub fn set(&mut self, index: usize, value: f32) -> Result<bool, ParameterError> {
        let (Some(parameter), Some(held)) = (TABLE.get(index), self.values.get_mut(index)) else {
            return Err(ParameterError::Unknown);
        };
        let fraction = parameter.whole && libm::truncf(value) != value;
        if !(parameter.min..=parameter.max).contains(&value) || fraction {
            return Err(ParameterError::Range);
        }
        Ok(core::mem::replace(held, value) != value)
    }

    /// The system id that the companion is to use; `None` (value 0) for the autopilot's.
    pub fn system_id(&self) -> Option<u8> {
        Some(self.values[SYS_ID] as u8).filter(|id| *id != 0)
    }

    /// Applies the values to the mission's settings; speeds only ever become lower.
    pub fn apply<const V: usize>(&self, config: &mut Config<V>) {
        config.accel_mps2 = self.values[ACCEL];
        config.battery_low_percent = self.values[BATT_LOW] as i8;
        config.climb_mps = libm::fminf(config.climb_mps, self.values[CLIMB_MAX]);
        config.descend_mps = libm::fminf(config.descend_mps, self.values[CLIMB_MAX]);
        config.cruise_mps = libm::fminf(config.cruise_mps, self.values[SPEED_MAX]);
        config.min_estimate_error_m = self.values[EST_M];
        config.radio_range_m = self.values[RADIO_M];
        config.skips_photographed = self.values[RESUME] != 0.0;
        config.start_tolerance_m = self.values[START_TOL];
        config.swarm_hz = self.values[SWARM_HZ] as u8;
    }

    /// The parameters as they are stored in flash: for each its name, padded with zeros, and its
    /// value.
    pub fn to_bytes(&self) -> [u8; STORED_LEN] {
        let mut bytes = [0; STORED_LEN];
        for (entry, (parameter, value)) in
            bytes.chunks_exact_mut(ENTRY_LEN).zip(TABLE.iter().zip(self.values))
        {
            entry[..parameter.name.len()].copy_from_slice(parameter.name.as_bytes());
            entry[NAME_LEN..].copy_from_slice(&value.to_le_bytes());
        }
        bytes
    }

    /// Restores one parameter from flash. A firmware with other names or ranges may have written
    /// the entry: an unknown name or a value that is out of range here changes nothing.
    pub fn restore(&mut self, entry: &[u8; ENTRY_LEN]) {
        let name = entry[..NAME_LEN].split(|b| *b == 0).next().unwrap_or_default();
        let value = f32::from_le_bytes([entry[16], entry[17], entry[18], entry[19]]);
        if let Some(index) = Self::index_of(name) {
            // A value out of range here is ignored.
            let _ = self.set(index, value);
        }
    }
}

#[cfg(test)]
mod tests;
