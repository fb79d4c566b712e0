//! The kind of autopilot that flies the vehicle, by HEARTBEAT's `autopilot` field, and that kind's
//! modes, masks, limits and streams (constants of `px4` and `ardupilot`).

use planner_core::geo::frames::Projection;

use super::limits::{AutopilotLimits, LimitParameter};
use super::{ardupilot, px4};

/// A kind of autopilot that the companion can fly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AutopilotKind {
    /// PX4, flown in Offboard.
    #[default]
    Px4,
    /// ArduCopter, flown in Guided.
    ArduPilot,
}

/// PX4's value of `autopilot` in HEARTBEAT.
const MAV_AUTOPILOT_PX4: u8 = 12;
/// ArduPilot's value of `autopilot` in HEARTBEAT.
const MAV_AUTOPILOT_ARDUPILOTMEGA: u8 = 3;

impl AutopilotKind {
    /// The kind by HEARTBEAT's `autopilot` field (`MAV_AUTOPILOT`): 12 PX4, 3 ArduPilot. `None` for
    /// any other, also for 8, a component that is no flight controller.
    pub fn from_heartbeat(autopilot: u8) -> Option<Self> {
        match autopilot {
            MAV_AUTOPILOT_PX4 => Some(Self::Px4),
            MAV_AUTOPILOT_ARDUPILOTMEGA => Some(Self::ArduPilot),
            _ => None,
        }
    }

    /// The projection by which this autopilot converts latitude and longitude to local metres about
    /// its EKF origin.
    pub fn projection(self) -> Projection {
        match self {
            Self::Px4 => Projection::Px4,
            Self::ArduPilot => Projection::ArduPilot,
        }
    }

    /// `custom_mode` of the mode that follows the companion's setpoints: PX4's Offboard,
    /// ArduCopter's Guided.
    pub fn setpoint_mode(self) -> u32 {
        match self {
            Self::Px4 => px4::OFFBOARD,
            Self::ArduPilot => ardupilot::GUIDED,
        }
    }

    /// `custom_mode` of the mode in which the autopilot lands the vehicle where it is.
    pub fn land_mode(self) -> u32 {
        match self {
            Self::Px4 => px4::LAND,
            Self::ArduPilot => ardupilot::LAND,
        }
    }

    /// Parameters 2 and 3 of DO_SET_MODE that switch the autopilot to the mode `custom_mode`.
    pub fn mode_params(self, custom_mode: u32) -> (f32, f32) {
        match self {
            Self::Px4 => px4::mode_params(custom_mode),
            Self::ArduPilot => ardupilot::mode_params(custom_mode),
        }
    }

    /// `type_mask` of a SET_POSITION_TARGET_LOCAL_NED that moves the vehicle: its position and
    /// feed-forward count, its yaw is ignored unless the sender clears the yaw bit for a heading.
    pub fn move_type_mask(self) -> u16 {
        match self {
            Self::Px4 => px4::MASK_POSITION_VELOCITY_ACCELERATION,
            Self::ArduPilot => ardupilot::MASK_POSITION_VELOCITY,
        }
    }

    /// Time, seconds, by which the velocity in a setpoint leads the smoothed setpoint: the velocity
    /// sent is the smoothed setpoint's plus its acceleration times this.
    pub fn velocity_lead_s(self) -> f32 {
        match self {
            Self::Px4 => 0.0,
            Self::ArduPilot => ardupilot::VELOCITY_LEAD_S,
        }
    }

    /// `type_mask` of a SET_POSITION_TARGET_LOCAL_NED whose velocity alone counts: at velocity 0
    /// the vehicle stops where it is.
    pub fn stop_type_mask(self) -> u16 {
        match self {
            Self::Px4 => px4::MASK_VELOCITY,
            Self::ArduPilot => ardupilot::MASK_VELOCITY,
        }
    }

    /// The autopilot's parameters that limit its speed, acceleration and jerk, with unit and
    /// default.
    pub fn limit_parameters(self) -> &'static [LimitParameter] {
        match self {
            Self::Px4 => &px4::LIMITS,
            Self::ArduPilot => &ardupilot::LIMITS,
        }
    }

    /// The limits of an autopilot whose parameters all have their defaults.
    pub(crate) fn default_limits(self) -> AutopilotLimits {
        AutopilotLimits::from_defaults(self.limit_parameters())
    }

    /// Streams to request on connecting: message id and interval in microseconds; −1 switches one
    /// off.
    pub fn streams(self) -> &'static [(u16, f32)] {
        match self {
            Self::Px4 => &px4::STREAMS,
            Self::ArduPilot => &ardupilot::STREAMS,
        }
    }

    /// Whether this autopilot takes off by NAV_TAKEOFF only, as ArduCopter does, where a setpoint
    /// sent before the lift-off would cancel the take-off. PX4 (false) lifts off towards a
    /// setpoint.
    pub fn takes_off_by_command(self) -> bool {
        self == Self::ArduPilot
    }
}
