//! A coverage mission in the report: which vehicle photographs which lanes, from what time on, and
//! the footprints of the pictures.

use planner_core::Point;
use serde::Serialize;

use super::pack;
use super::track::PictureFootprint;

/// A coverage mission's part of the report data.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CoverageLayers {
    /// Distance from one lane to the next, metres.
    #[serde(rename = "lane_m")]
    pub lane_spacing_m: f32,
    /// Divisions by rising time, at least one: the plan, then each division made in flight.
    pub divisions: Vec<ReportDivision>,
    /// Footprints of the pictures, by rising time.
    #[serde(serialize_with = "pack::footprints")]
    pub footprints: Vec<PictureFootprint>,
}

/// How the area is divided among the vehicles from `t_s` on, until the next division.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportDivision {
    /// Time from which the division holds, seconds.
    pub t_s: f32,
    /// MAVLink ids of the vehicles lost since the division before.
    pub lost: Vec<u8>,
    /// Waypoints and path of each vehicle that still flies.
    pub parts: Vec<ReportPart>,
    /// Waypoints that this division moves from one vehicle to another.
    #[serde(rename = "taken")]
    pub transfers: Vec<WaypointTransfer>,
}

/// What one vehicle photographs in a division.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportPart {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Number of waypoints.
    #[serde(rename = "waypoints")]
    pub waypoint_count: u32,
    /// Path of the vehicle, metres.
    #[serde(serialize_with = "pack::points")]
    pub path: Vec<Point>,
    /// Both ends of each stretch of a lane that the vehicle photographs, metres.
    #[serde(serialize_with = "pack::points")]
    #[serde(rename = "lanes")]
    pub lane_ends: Vec<Point>,
}

/// Waypoints that a division moves from one vehicle to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct WaypointTransfer {
    /// Vehicle that was to photograph the waypoints before.
    pub from: u8,
    /// Vehicle that is to photograph the waypoints now.
    pub to: u8,
    /// Number of waypoints.
    #[serde(rename = "waypoints")]
    pub waypoint_count: u32,
}
