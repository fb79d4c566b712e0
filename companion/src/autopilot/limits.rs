//! What the autopilot's parameters allow: limits of speed, acceleration and jerk.
//!
//! They are read on connecting. A value that did not come, or that no vehicle has, counts as the
//! default of its kind. Source: PX4 1.17 `mc_pos_control` parameters, ArduCopter 4.6 `WPNAV_*` and
//! `PSC_*`.

/// The quantity that an autopilot's parameter limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Speed across, m/s.
    Speed,
    /// Speed upwards, m/s.
    Climb,
    /// Speed downwards, m/s.
    Descend,
    /// Acceleration across, m/s².
    Accel,
    /// Acceleration upwards, m/s².
    AccelUp,
    /// Acceleration downwards, m/s².
    AccelDown,
    /// Jerk across, m/s³.
    Jerk,
    /// Jerk upwards and downwards, m/s³.
    JerkZ,
}

/// Number of kinds of limits.
const LIMIT_KINDS: usize = 8;

impl Limit {
    /// The values that a vehicle may have, least and greatest: a value outside is no limit but a
    /// switch (0, −1) or a mistake.
    fn range(self) -> (f32, f32) {
        match self {
            Self::Speed | Self::Climb | Self::Descend => (0.1, 50.0),
            Self::Accel | Self::AccelUp | Self::AccelDown => (0.2, 20.0),
            Self::Jerk | Self::JerkZ => (1.0, 100.0),
        }
    }
}

/// A parameter of an autopilot that limits what it flies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitParameter {
    /// Name of the parameter, at most 16 bytes.
    pub name: &'static str,
    /// The quantity that the parameter limits.
    pub limit: Limit,
    /// Unit of the parameter, in metres and seconds.
    pub unit: f32,
    /// Default of the parameter, in its own unit.
    pub default: f32,
}

/// The limits that the autopilot's parameters set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutopilotLimits {
    values: [f32; LIMIT_KINDS],
}

impl AutopilotLimits {
    /// The defaults of parameters.
    pub(crate) fn from_defaults(parameters: &[LimitParameter]) -> Self {
        let mut limits = Self { values: [f32::INFINITY; LIMIT_KINDS] };
        for parameter in parameters {
            limits.values[parameter.limit as usize] = parameter.default * parameter.unit;
        }
        limits
    }

    /// A limit.
    pub(crate) fn get(&self, limit: Limit) -> f32 {
        self.values[limit as usize]
    }

    /// Takes a value as it was read; whether a limit changed. One that no vehicle has is ignored.
    pub(crate) fn set(&mut self, parameter: &LimitParameter, value: f32) -> bool {
        let (value, (least, most)) = (value * parameter.unit, parameter.limit.range());
        if !(least..=most).contains(&value) {
            return false;
        }
        core::mem::replace(&mut self.values[parameter.limit as usize], value) != value
    }
}
