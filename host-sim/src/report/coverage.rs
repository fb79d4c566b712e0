//! What the page shows of a coverage mission: which vehicle photographs what, from when on, and what pictures show.

use planner_core::Point;
use serde::Serialize;

use super::pack;
use super::track::Footprint;

/// A coverage mission.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CoverageLayers {
    /// From one lane to the next, metres.
    pub lane_m: f32,
    /// The plan, and what became of it, by rising time: at least one.
    pub divisions: Vec<Division>,
    /// Pictures, by rising time.
    #[serde(serialize_with = "pack::footprints")]
    pub footprints: Vec<Footprint>,
}

/// Who photographs what, from a time on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Division {
    /// Seconds.
    pub t_s: f32,
    /// Vehicles that do not take part any more.
    pub lost: Vec<u8>,
    /// One of each vehicle that flies.
    pub parts: Vec<Part>,
    /// What changed hands.
    pub taken: Vec<Taken>,
}

/// What one vehicle photographs.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Part {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Waypoints.
    pub waypoints: u32,
    /// Its path, metres.
    #[serde(serialize_with = "pack::points")]
    pub path: Vec<Point>,
    /// Both ends of each stretch of a lane that it photographs, metres.
    #[serde(serialize_with = "pack::points")]
    pub lanes: Vec<Point>,
}

/// Waypoints that go from one vehicle to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Taken {
    /// Whose they were.
    pub from: u8,
    /// Whose they are.
    pub to: u8,
    /// How many.
    pub waypoints: u32,
}
