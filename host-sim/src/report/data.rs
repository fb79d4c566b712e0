//! The data that one report page shows.

use planner_core::Point;
use serde::Serialize;

use super::coverage::CoverageLayers;
use super::figures::Figure;
use super::pack;
use super::surface::MapSurface;
use super::track::TrackPoint;

/// All data that one report page shows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportData {
    /// Heading of the page, such as the scenario's name.
    pub title: String,
    /// The command that made the page, such as `plan` or `fly`.
    pub command: String,
    /// Program and version, such as `host-sim 0.1.0`.
    pub generated_by: String,
    /// The scenario's TOML as it was run, shown as text.
    pub scenario_toml: String,
    /// Surface of the obstacle map; `None` where the mission has no map.
    pub map: Option<MapSurface>,
    /// Nodes and edges of the roadmap; `None` where the mission has no roadmap.
    pub roadmap: Option<RoadmapLines>,
    /// Vehicles in the order of the page's table of vehicles.
    pub vehicles: Vec<ReportVehicle>,
    /// Borders on the ground: area, holes and no-fly zones of a coverage mission.
    pub outlines: Vec<AreaOutline>,
    /// Divisions of the area and pictures; `None` outside coverage missions.
    pub coverage: Option<CoverageLayers>,
    /// Obstacles that appear in flight and are not in the map.
    pub obstacles: Vec<SphereObstacle>,
    /// Events, in any order.
    pub events: Vec<LogEvent>,
    /// Plots over time, in order.
    pub plots: Vec<Plot>,
    /// Figures that reproduce those of a paper, at the end of the page.
    pub figures: Vec<Figure>,
    /// Content of `result.json`.
    pub result: serde_json::Value,
    /// Content of `timing.json`; `None` leaves it out.
    pub timing: Option<serde_json::Value>,
}

/// A closed border on the ground.
#[derive(Clone, Debug, Serialize)]
pub struct AreaOutline {
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
    /// A part of the area that is not photographed.
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

/// One vehicle: its goal, its planned path and its flown track.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportVehicle {
    /// MAVLink system id.
    pub id: u8,
    /// Radius of the body, metres.
    pub radius_m: f32,
    /// Colour in the page, sRGB; `None` takes [`vehicle_color`] of the vehicle's index.
    pub color: Option<[u8; 3]>,
    /// Index (from 0) of the goal that the vehicle was assigned; `None` if it has none.
    pub goal_index: Option<usize>,
    /// Where the vehicle's path begins, metres.
    #[serde(serialize_with = "pack::point")]
    pub start: Point,
    /// Goal where the vehicle is to land or hold, metres; `None` if it has none.
    #[serde(serialize_with = "pack::maybe_point")]
    pub goal: Option<Point>,
    /// Planned path, metres.
    #[serde(serialize_with = "pack::points")]
    #[serde(rename = "planned")]
    pub planned_path: Vec<Point>,
    /// Flown track by rising time, 5–10 points a second; empty if nothing was flown.
    #[serde(serialize_with = "pack::track")]
    pub track: Vec<TrackPoint>,
    /// When the vehicle lost its power, or its motors in the air, seconds; `None` if it did not.
    #[serde(rename = "lost_s")]
    pub power_lost_at_s: Option<f32>,
}

/// A spherical obstacle that appears during the flight.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SphereObstacle {
    /// Centre, metres.
    #[serde(serialize_with = "pack::point")]
    pub position: Point,
    /// Radius, metres.
    pub radius_m: f32,
    /// When it appears, seconds.
    pub from_s: f32,
    /// When it disappears, seconds; `None` if it stays to the end.
    pub until_s: Option<f32>,
}

/// Severity of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Part of a mission without faults.
    #[default]
    Info,
    /// A fault or a deviation that was handled.
    Warning,
    /// The mission failed, or a safety rule was violated.
    Error,
}

/// One line of the event log.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LogEvent {
    /// Time, seconds.
    pub t_s: f32,
    /// MAVLink id of the vehicle that the event is about; `None` for the swarm.
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
    /// Limit for the values, drawn as a line, such as the safety distance; `None` draws none.
    pub limit: Option<PlotLimit>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// A horizontal line in a plot.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PlotLimit {
    /// Value in the plot's unit.
    pub value: f32,
    /// Label of the line, such as `safety distance`.
    pub label: String,
}

/// One curve of a plot: `values[i]` at `t_s[i]`. A value that is not finite is a gap.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Id of the vehicle whose colour the curve has; `None` for a curve of the whole swarm.
    pub vehicle: Option<u8>,
    /// Rising times, seconds.
    #[serde(serialize_with = "pack::floats")]
    pub t_s: Vec<f32>,
    /// Values, as many as times.
    #[serde(serialize_with = "pack::floats")]
    pub values: Vec<f32>,
}

/// The colour of the `index`-th vehicle, sRGB: ten that differ clearly on a dark ground, then the
/// same at 78 % and at 60 % of their brightness, then from the first again.
pub fn vehicle_color(index: usize) -> [u8; 3] {
    const PALETTE: [[u8; 3]; 10] = [
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
    let percent = [100, 78, 60][(index / PALETTE.len()) % 3];
    PALETTE[index % PALETTE.len()].map(|c| (u16::from(c) * percent / 100) as u8)
}
