//! Which autopilot flies the vehicle, by HEARTBEAT's `autopilot` field, and where its numbers are.

use planner_core::frames::Projection;

use super::limits::{AutopilotLimits, LimitParameter};
use super::{ardupilot, px4};

/// An autopilot the companion can fly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AutopilotKind {
    /// PX4, flown in Offboard.
    #[default]
    Px4,
    /// ArduCopter, flown in Guided.
    ArduPilot,
}

impl AutopilotKind {
    /// The kind by `MAV_AUTOPILOT`; `None` for one the companion cannot fly, and for a component
    /// that is no flight controller (8).
    pub fn from_heartbeat(autopilot: u8) -> Option<Self> {
        match autopilot {
            12 => Some(Self::Px4),
            3 => Some(Self::ArduPilot),
            _ => None,
        }
    }

    /// How it flattens the earth about its EKF origin.
    pub fn projection(self) -> Projection {
        match self {
            Self::Px4 => Projection::Px4,
            Self::ArduPilot => Projection::ArduPilot,
        }
    }

    /// The mode that follows setpoints: Offboard or Guided.
    pub fn setpoint_mode(self) -> u32 {
        match self {
            Self::Px4 => px4::OFFBOARD,
            Self::ArduPilot => ardupilot::GUIDED,
        }
    }

    /// The mode that lands.
    pub fn land_mode(self) -> u32 {
        match self {
            Self::Px4 => px4::LAND,
            Self::ArduPilot => ardupilot::LAND,
        }
    }

    /// Parameters 2 and 3 of DO_SET_MODE.
    pub fn mode_params(self, custom_mode: u32) -> (f32, f32) {
        match self {
            Self::Px4 => px4::mode_params(custom_mode),
            Self::ArduPilot => ardupilot::mode_params(custom_mode),
        }
    }

    /// Mask of a setpoint to move.
    pub fn move_type_mask(self) -> u16 {
        match self {
            Self::Px4 => px4::MASK_POSITION_VELOCITY_ACCELERATION,
            Self::ArduPilot => ardupilot::MASK_POSITION_VELOCITY,
        }
    }

    /// Lead of a setpoint's velocity, as seconds of its acceleration.
    pub fn velocity_lead_s(self) -> f32 {
        match self {
            Self::Px4 => 0.0,
            Self::ArduPilot => ardupilot::VELOCITY_LEAD_S,
        }
    }

    /// Type mask of a setpoint that stops at the current place.
    pub fn stop_type_mask(self) -> u16 {
        match self {
            Self::Px4 => px4::MASK_VELOCITY,
            Self::ArduPilot => ardupilot::MASK_VELOCITY,
        }
    }

    /// The autopilot's parameters that limit what it flies.
    pub fn limits(self) -> &'static [LimitParameter] {
        match self {
            Self::Px4 => &px4::LIMITS,
            Self::ArduPilot => &ardupilot::LIMITS,
        }
    }

    /// The limits of one whose parameters have their defaults.
    pub(crate) fn default_limits(self) -> AutopilotLimits {
        AutopilotLimits::from_defaults(self.limits())
    }

    /// Streams to ask for on connecting: message id and interval in microseconds, −1 off.
    pub fn streams(self) -> &'static [(u16, f32)] {
        match self {
            Self::Px4 => &px4::STREAMS,
            Self::ArduPilot => &ardupilot::STREAMS,
        }
    }

    /// Whether it needs a command to take off: PX4 lifts off towards a setpoint, ArduCopter only by
    /// NAV_TAKEOFF, which a setpoint before the lift-off would cancel.
    pub fn takes_off_by_command(self) -> bool {
        self == Self::ArduPilot
    }
}
