//! Limits of speed, acceleration and jerk that the autopilot's own parameters set.
//!
//! They are read on connecting. A parameter that was not received, or whose value is outside of
//! [`Limit`]'s range, counts with the default of its autopilot kind. Source: PX4 1.17
//! `mc_pos_control` parameters, ArduCopter 4.6 `WPNAV_*` and `PSC_*`.

/// The quantity that an autopilot's parameter limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Horizontal speed, m/s.
    SpeedXy,
    /// Speed upwards, m/s.
    Climb,
    /// Speed downwards, m/s.
    Descend,
    /// Horizontal acceleration, m/s².
    AccelXy,
    /// Acceleration upwards, m/s².
    AccelUp,
    /// Acceleration downwards, m/s².
    AccelDown,
    /// Horizontal jerk, m/s³.
    JerkXy,
    /// Vertical jerk, upwards and downwards, m/s³.
    JerkZ,
}

/// Number of variants of [`Limit`].
const LIMIT_KINDS: usize = 8;

impl Limit {
    /// Least and greatest value that counts as a limit, in metres and seconds. A parameter outside
    /// is a switch (0, −1) or a mistake, and is ignored.
    fn range(self) -> (f32, f32) {
        match self {
            Self::SpeedXy | Self::Climb | Self::Descend => (0.1, 50.0),
            Self::AccelXy | Self::AccelUp | Self::AccelDown => (0.2, 20.0),
            Self::JerkXy | Self::JerkZ => (1.0, 100.0),
        }
    }
}

/// An autopilot's parameter that limits how the vehicle flies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitParameter {
    /// Name of the parameter, at most 16 bytes.
    pub name: &'static str,
    /// The quantity that the parameter limits.
    pub limit: Limit,
    /// Factor from the parameter's own unit to metres and seconds: 0.01 for centimetres.
    pub to_si: f32,
    /// Default of the parameter, in the parameter's own unit.
    pub default: f32,
}

/// The limits that the autopilot's parameters set, in metres and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutopilotLimits {
    /// By [`Limit`] as index.
    values: [f32; LIMIT_KINDS],
}

impl AutopilotLimits {
    /// The limits by the defaults of `parameters`; infinite for a quantity that none of them
    /// limits.
    pub(crate) fn from_defaults(parameters: &[LimitParameter]) -> Self {
        let mut limits = Self { values: [f32::INFINITY; LIMIT_KINDS] };
        for parameter in parameters {
            limits.values[parameter.limit as usize] = parameter.default * parameter.to_si;
        }
        limits
    }

    /// The value of a limit, in metres and seconds; infinite if the autopilot has no such limit.
    pub(crate) fn get(&self, limit: Limit) -> f32 {
        self.values[limit as usize]
    }

    /// Stores a parameter's value, given in the parameter's own unit, unless it is outside of
    /// `Limit::range`. Returns whether the limit changed.
    pub(crate) fn set(&mut self, parameter: &LimitParameter, value: f32) -> bool {
        let (value, (least, most)) = (value * parameter.to_si, parameter.limit.range());
        if !(least..=most).contains(&value) {
            return false;
        }
        core::mem::replace(&mut self.values[parameter.limit as usize], value) != value
    }
}
