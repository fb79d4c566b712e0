//! What the page shows of a coverage mission: which vehicle photographs what, from when on, and
//! what pictures show.

use planner_core::Point;
use serde::Serialize;

use super::pack;
use super::track::Footprint;

/// A coverage mission.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CoverageLayers {
    /// Distance from one lane to the next, metres.
    pub lane_m: f32,
    /// The plan, and what became of it, by rising time: at least one.
    pub divisions: Vec<Division>,
    /// Pictures, by rising time.
    #[serde(serialize_with = "pack::footprints")]
    pub footprints: Vec<Footprint>,
}

/// Division of the area among the vehicles from a time on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Division {
    /// Seconds.
    pub t_s: f32,
    /// Vehicles that do not take part any more.
    pub lost: Vec<u8>,
    /// Part of each vehicle that flies.
    pub parts: Vec<Part>,
    /// Waypoints that changed hands.
    pub taken: Vec<Taken>,
}

/// Part of one vehicle.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Part {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Waypoints.
    pub waypoints: u32,
    /// Path of the vehicle, metres.
    #[serde(serialize_with = "pack::points")]
    pub path: Vec<Point>,
    /// Both ends of each stretch of a lane that it photographs, metres.
    #[serde(serialize_with = "pack::points")]
    pub lanes: Vec<Point>,
}

/// Waypoints that go from one vehicle to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Taken {
    /// Vehicle that had the waypoints before.
    pub from: u8,
    /// Vehicle that has the waypoints now.
    pub to: u8,
    /// Number of waypoints.
    pub waypoints: u32,
}
