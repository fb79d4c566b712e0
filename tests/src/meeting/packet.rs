//! Frames on the radio of a meeting, and the meetings' origin.

use companion::Instant;
use companion::link::intent::Intent;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

/// Origin of the mission frame.
pub(super) const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };

/// Content of a radio frame, decoded for the referee.
#[derive(Clone, Debug)]
pub(super) enum RadioContent {
    /// GLOBAL_POSITION_INT: position (ENU metres), velocity (ENU m/s), `time_boot_ms`.
    Position(Point, Point, u32),
    Intent(Intent),
    /// Any other message.
    Other,
}

/// A frame on its way to a receiver.
pub(super) struct Packet {
    /// When it arrives.
    pub(super) due_at: Instant,
    /// Index of the vehicle that sent it.
    pub(super) from: usize,
    pub(super) bytes: Vec<u8>,
    pub(super) content: RadioContent,
}
