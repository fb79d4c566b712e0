//! What a scenario says, table by table.

use std::path::PathBuf;

use companion::config::GROUND_STATIONS;
use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::frames::Geodetic;
use planner_core::prm::Sampling;
use sim_autopilot::{AutopilotKind, Estimator};

use super::coverage::Area;
use super::error::ScenarioError;
use crate::link::LinkUrl;
use crate::map::Unknown;

/// A scenario, checked.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its name: the path it was read from.
    pub path: String,
    /// Its text, as read.
    pub text: String,
    /// Of everything random.
    pub seed: u64,
    /// `[map]`
    pub map: Map,
    /// `[roadmap]`
    pub roadmap: Roadmap,
    /// `[mission]`
    pub mission: Mission,
    /// `[[vehicles]]`, as they stand in the file.
    pub vehicles: Vec<Vehicle>,
    /// Where the start of each stands, as `FILE:LINE`.
    pub vehicle_places: Vec<String>,
    /// `[deconfliction]`
    pub deconfliction: Deconfliction,
    /// `[simulation]`
    pub simulation: Simulation,
    /// `[[faults]]`
    pub faults: Vec<Fault>,
    /// `[area]`: what a coverage mission photographs.
    pub area: Option<Area>,
    /// `[formation]`
    pub formation: Option<Unbuilt>,
    /// What is asked for and not built yet, in the file's order.
    pub(super) unsupported: Vec<ScenarioError>,
}

/// A table that is read by a part not built yet.
#[derive(Clone, Debug, PartialEq)]
pub struct Unbuilt {
    /// The table as TOML values.
    pub table: toml::Table,
}

/// `[map]`
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// A builtin's name, or a path that is relative to the working directory (resolved against the scenario's folder). Empty where
    /// a coverage mission has no map: level ground at height 0.
    pub file: String,
    /// Edge of a planning cell.
    pub resolution_m: f32,
    /// Whether unknown space may be flown through.
    pub unknown: Unknown,
    /// Mission origin.
    pub origin: Geodetic,
}

/// `[roadmap]`
#[derive(Clone, Debug, PartialEq)]
pub struct Roadmap {
    /// Random nodes besides starts and goals.
    pub nodes: u32,
    /// Shortest edge.
    pub edge_min_m: f32,
    /// Longest edge.
    pub edge_max_m: f32,
    /// The same as shares of the map's longest side, where they are given so (P2D).
    pub edge_min_share: Option<f32>,
    /// See `edge_min_share`.
    pub edge_max_share: Option<f32>,
    /// Whether edges join two terminals.
    pub terminals: Terminals,
    /// Margin beyond a vehicle's radius.
    pub safety_margin_m: f32,
    /// How nodes are drawn.
    pub sampling: Sampling,
    /// Whether passages that they miss get nodes of their own.
    pub passages: bool,
}

/// Whether edges join two starts or goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Terminals {
    /// As any other nodes (P3D).
    Joined,
    /// Never (P2D).
    Apart,
}

/// `[mission]`
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// Which vehicle goes where.
    pub mode: Mode,
    /// What an assignment minimises.
    pub objective: Objective,
    /// Speed along a path, metres a second.
    pub cruise_mps: f32,
    /// Tasks, ENU metres.
    pub goals: Vec<Point>,
    /// Where each stands, as `FILE:LINE`.
    pub goal_places: Vec<String>,
    /// Where vehicles may be.
    pub geofence: Option<Geofence>,
    /// System ids whose commands count; 0 is no id.
    pub ground_stations: [u8; GROUND_STATIONS],
}

/// Which vehicle goes where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Goals are shared out.
    Unlabelled,
    /// Each vehicle names its goal.
    Labelled,
    /// All to the one goal.
    SingleGoal,
    /// An area is covered.
    Coverage,
    /// A formation is flown.
    Formation,
}

/// What an assignment minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The sum of path lengths.
    Total,
    /// The longest path.
    Makespan,
}

/// A box, ENU metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Geofence {
    /// Lowest corner.
    pub min: Point,
    /// Highest corner.
    pub max: Point,
}

impl Geofence {
    /// Whether a place is inside; its faces are.
    pub fn holds(&self, place: &Point) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&place[axis]))
    }
}

/// One of `[[vehicles]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// MAVLink system id, 1 to 250.
    pub id: u8,
    /// Where it stands, ENU metres.
    pub start: Point,
    /// Index of its goal, in labelled missions.
    pub goal: Option<usize>,
    /// Radius of its hull.
    pub radius_m: f32,
    /// Its layer on 2D maps.
    pub altitude_m: Option<f32>,
    /// Highest speed, metres a second.
    pub speed_max_mps: f32,
    /// Flight time on one battery.
    pub endurance_s: Option<f32>,
    /// What it can carry.
    pub payload_kg: Option<f32>,
    /// What autopilot it has.
    pub personality: AutopilotKind,
    /// Its home, if not its start.
    pub home: Option<Geodetic>,
    /// Its EKF origin, if not its home.
    pub ekf_origin: Option<Geodetic>,
    /// Where its companion runs.
    pub companion: Companion,
    /// Coverage: its share of the work beside those of the others.
    pub weight: Option<f32>,
    /// Coverage: speed of climb, metres a second.
    pub climb_mps: Option<f32>,
    /// Coverage: speed of descent, metres a second.
    pub descend_mps: Option<f32>,
}

/// V_a where a vehicle has none of its own, metres a second.
const CLIMB_MPS: f32 = 3.0;
/// V_d likewise.
const DESCEND_MPS: f32 = 1.0;

impl Vehicle {
    /// V_a and V_d, metres a second.
    pub fn climbs_mps(&self) -> [f32; 2] {
        [self.climb_mps.unwrap_or(CLIMB_MPS), self.descend_mps.unwrap_or(DESCEND_MPS)]
    }
}

/// Where a companion runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Companion {
    /// In this process.
    InProcess {
        /// What it keeps its flash in; no scenario's file says so.
        flash: Option<PathBuf>,
    },
    /// On a board, or in another process.
    Url {
        /// Its port for the autopilot.
        autopilot: LinkUrl,
        /// Its port for the radio; none where that is joined to others by something else, or to nothing.
        radio: Option<LinkUrl>,
    },
    /// On a board in QEMU, in lock step with the simulation; no scenario's file says so.
    Emulated {
        /// The firmware for the board `qemu`.
        program: PathBuf,
        /// What the board logs.
        log: PathBuf,
    },
}

/// `[deconfliction]`
#[derive(Clone, Debug, PartialEq)]
pub struct Deconfliction {
    /// How vehicles keep apart.
    pub method: Method,
    /// What they keep, centre to centre.
    pub safety_distance_m: f32,
    /// What the schedule plans between their paths, centre to centre.
    pub separation_m: f32,
}

/// `[simulation]`
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Mean wind, metres a second.
    pub wind_mps: f32,
    /// Gusts on top.
    pub gust_mps: f32,
    /// Standard deviation of the reported position.
    pub position_noise_m: f32,
    /// How good the autopilots' estimates are.
    pub estimator: Estimator,
    /// Serial links, bits a second.
    pub serial_baud: u32,
    /// Share of bytes corrupted.
    pub serial_corruption: f32,
    /// Share of radio frames lost.
    pub radio_loss: f32,
    /// Delay of a radio frame.
    pub radio_delay_s: f32,
    /// Beyond it nobody hears.
    pub radio_range_m: f32,
    /// When a run is given up.
    pub time_limit_s: f32,
}

/// One of `[[faults]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// When it strikes.
    pub at_s: f32,
    /// How long it lasts; for good if absent.
    pub duration_s: Option<f32>,
    /// The vehicle that it strikes, if one.
    pub vehicle: Option<u8>,
    /// What it is, one of [`FAULT_KINDS`].
    pub kind: &'static str,
    /// `radio-cut`: which way.
    pub direction: Option<String>,
    /// `position-jump`, `origin-change`: by how much.
    pub offset_m: Option<Point>,
    /// `obstacle`: where.
    pub position: Option<Point>,
    /// `obstacle`: how large.
    pub radius_m: Option<f32>,
}

impl Fault {
    /// Whether it strikes this vehicle: one without a vehicle strikes all, an obstacle nobody.
    pub fn strikes(&self, vehicle: &Vehicle) -> bool {
        self.kind != FAULT_OBSTACLE && self.vehicle.is_none_or(|id| id == vehicle.id)
    }
}

/// Every kind of fault.
pub const FAULT_KINDS: [&str; 17] = [
    "kill",
    "radio-cut",
    "serial-stall",
    "serial-corrupt",
    "position-jump",
    "origin-change",
    "gps-loss",
    "battery-low",
    "pilot-takeover",
    "pilot-return",
    "autopilot-reboot",
    "companion-reset",
    "late-plan",
    "bad-roadmap",
    "pause-order",
    "return-order",
    "land-order",
];
/// The fault that puts an obstacle into the world.
pub const FAULT_OBSTACLE: &str = "obstacle";

impl Scenario {
    /// Refuses what the file asks for and is not built yet, so that nothing is silently ignored.
    pub fn check_supported(&self) -> Result<(), ScenarioError> {
        self.unsupported.first().map_or(Ok(()), |error| Err(error.clone()))
    }

    /// The largest clearance any vehicle needs: its radius and the safety margin.
    pub fn required_clearance_m(&self) -> f32 {
        self.largest_radius_m() + self.roadmap.safety_margin_m
    }

    /// The largest vehicle's radius.
    pub fn largest_radius_m(&self) -> f32 {
        self.vehicles.iter().map(|v| v.radius_m).fold(0.0, f32::max)
    }
}
