//! What one page shows.

use planner_core::Point;
use serde::Serialize;

use super::coverage::CoverageLayers;
use super::figures::Figure;
use super::pack;
use super::surface::MapSurface;
use super::track::TrackPoint;

/// All that one page shows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportData {
    /// Heading of the page, such as the scenario's name.
    pub title: String,
    /// The command that wrote it: `plan`, `fly`, `demo`.
    pub command: String,
    /// Program and version, such as `host-sim 0.1.0`.
    pub generated_by: String,
    /// The scenario as it was run, shown as text.
    pub scenario_toml: String,
    /// Surface of the obstacle map, where there is one.
    pub map: Option<MapSurface>,
    /// Roadmap, where there is one.
    pub roadmap: Option<RoadmapLines>,
    /// Vehicles in the order of the table.
    pub vehicles: Vec<VehicleTrack>,
    /// Borders on the ground: the area of a coverage mission.
    pub outlines: Vec<Outline>,
    /// Division of the area, in a coverage mission.
    pub coverage: Option<CoverageLayers>,
    /// Obstacles that are not in the map.
    pub obstacles: Vec<SphereObstacle>,
    /// Events, in any order.
    pub events: Vec<Event>,
    /// Plots over time, in order.
    pub plots: Vec<Plot>,
    /// Figures of a paper, below all that.
    pub figures: Vec<Figure>,
    /// Content of `result.json`.
    pub result: serde_json::Value,
    /// Content of `timing.json`.
    pub timing: Option<serde_json::Value>,
}

/// A closed border on the ground.
#[derive(Clone, Debug, Serialize)]
pub struct Outline {
    /// Area, hole or no-fly zone.
    pub kind: OutlineKind,
    /// Corners of the border, metres.
    #[serde(serialize_with = "pack::points")]
    pub points: Vec<Point>,
}

/// Kind of the region that a border encloses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutlineKind {
    /// Area to photograph.
    Area,
    /// A part of it that is left out.
    Hole,
    /// A region that no vehicle enters.
    NoFly,
}

/// Nodes and edges of a roadmap.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RoadmapLines {
    /// Node positions, metres.
    #[serde(serialize_with = "pack::points")]
    pub nodes: Vec<Point>,
    /// Each undirected edge once, as indices of its two nodes.
    #[serde(serialize_with = "pack::pairs")]
    pub edges: Vec<[u16; 2]>,
}

/// One vehicle: its task, and its track.
#[derive(Clone, Debug, Default, Serialize)]
pub struct VehicleTrack {
    /// MAVLink system id.
    pub id: u8,
    /// Radius of the body, metres.
    pub radius_m: f32,
    /// sRGB; [`vehicle_color`] of its place in the list where absent.
    pub color: Option<[u8; 3]>,
    /// Index of the goal it was given.
    pub goal_index: Option<usize>,
    /// Start of the vehicle, metres.
    #[serde(serialize_with = "pack::point")]
    pub start: Point,
    /// Place where the vehicle shall land or hold, metres.
    #[serde(serialize_with = "pack::maybe_point")]
    pub goal: Option<Point>,
    /// Planned path, metres.
    #[serde(serialize_with = "pack::points")]
    pub planned: Vec<Point>,
    /// Flown track by rising time, 5–10 Hz; empty where nothing was flown.
    #[serde(serialize_with = "pack::track")]
    pub track: Vec<TrackPoint>,
}

/// An obstacle that appears during the flight.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SphereObstacle {
    /// Centre, metres.
    #[serde(serialize_with = "pack::point")]
    pub position: Point,
    /// Radius, metres.
    pub radius_m: f32,
    /// When it appears, seconds.
    pub from_s: f32,
    /// When it goes, seconds; `None` stays.
    pub until_s: Option<f32>,
}

/// Severity of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Part of a clean mission.
    #[default]
    Info,
    /// A fault or a deviation that was handled.
    Warning,
    /// The mission, or a safety figure, is lost.
    Error,
}

/// One line of the event log.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Event {
    /// Time, seconds.
    pub t_s: f32,
    /// Vehicle of the event; `None` concerns the swarm.
    pub vehicle: Option<u8>,
    /// Severity.
    pub level: Level,
    /// Text of the event.
    pub text: String,
}

/// Curves over one time axis and one value axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Plot {
    /// Title, such as `Smallest separation`.
    pub title: String,
    /// Unit of the values, such as `m`.
    pub unit: String,
    /// A line the values are judged by, such as the safety distance.
    pub limit: Option<Limit>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// A horizontal line in a plot.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Limit {
    /// Value in the plot's unit.
    pub value: f32,
    /// Label of the curve, such as `safety distance`.
    pub label: String,
}

/// One curve: `values[i]` at `t_s[i]`. A value that is not finite is a gap.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// The vehicle it belongs to, for its colour.
    pub vehicle: Option<u8>,
    /// Rising times, seconds.
    #[serde(serialize_with = "pack::floats")]
    pub t_s: Vec<f32>,
    /// Values, as many as times.
    #[serde(serialize_with = "pack::floats")]
    pub values: Vec<f32>,
}

/// The colour of the `index`-th vehicle, sRGB: ten that stay apart on a dark ground, then ever
/// darker rounds of them.
pub fn vehicle_color(index: usize) -> [u8; 3] {
    const ROUND: [[u8; 3]; 10] = [
        [77, 163, 255],
        [255, 149, 64],
        [87, 211, 128],
        [255, 99, 112],
        [180, 140, 255],
        [64, 216, 216],
        [255, 214, 77],
        [255, 133, 205],
        [163, 204, 82],
        [214, 160, 120],
    ];
    let percent = [100, 78, 60][(index / ROUND.len()) % 3];
    ROUND[index % ROUND.len()].map(|c| (u16::from(c) * percent / 100) as u8)
}
