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
    /// Name of the scenario: the path it was read from.
    pub path: String,
    /// Text of the scenario, as read.
    pub text: String,
    /// Seed of all randomness.
    pub seed: u64,
    /// `[map]`
    pub map: Map,
    /// `[roadmap]`
    pub roadmap: Roadmap,
    /// `[mission]`
    pub mission: Mission,
    /// `[[vehicles]]`, as they stand in the file.
    pub vehicles: Vec<Vehicle>,
    /// Place of each vehicle's start in the file, as `FILE:LINE`.
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
    pub formation: Option<UnsupportedTable>,
    /// Settings that are requested and not built yet, in the file's order.
    pub(super) unsupported: Vec<ScenarioError>,
}

/// A table that is read by a part not built yet.
#[derive(Clone, Debug, PartialEq)]
pub struct UnsupportedTable {
    /// The table as TOML values.
    pub table: toml::Table,
}

/// `[map]`
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// A builtin's name, or a path that is relative to the working directory (resolved against the
    /// scenario's folder). Empty where a coverage mission has no map: level ground at height 0.
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
    /// Range of edges as shares of the map's longest side, where they are given so (P2D).
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
    /// Terminals are joined as any other nodes (P3D).
    Joined,
    /// Never (P2D).
    Apart,
}

/// `[mission]`
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// Which vehicle goes where.
    pub mode: Mode,
    /// Objective that an assignment minimises.
    pub objective: Objective,
    /// Speed along a path, m/s.
    pub cruise_mps: f32,
    /// Tasks, ENU metres.
    pub goals: Vec<Point>,
    /// Place of each goal in the file, as `FILE:LINE`.
    pub goal_places: Vec<String>,
    /// Volume in which vehicles may be.
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

/// Objective that an assignment minimises.
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
    /// Whether a place is inside the box or on one of its faces.
    pub fn contains(&self, place: &Point) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&place[axis]))
    }
}

/// One vehicle of `[[vehicles]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// MAVLink system id, 1 to 250.
    pub id: u8,
    /// Start of the vehicle, ENU metres.
    pub start: Point,
    /// Index of its goal, in labelled missions.
    pub goal: Option<usize>,
    /// Radius of its hull.
    pub radius_m: f32,
    /// Layer of the vehicle on 2D maps.
    pub altitude_m: Option<f32>,
    /// Highest speed, m/s.
    pub speed_max_mps: f32,
    /// Flight time on one battery.
    pub endurance_s: Option<f32>,
    /// Payload of the vehicle.
    pub payload_kg: Option<f32>,
    /// Kind of the vehicle's autopilot.
    pub personality: AutopilotKind,
    /// Home of the vehicle, if not its start.
    pub home: Option<Geodetic>,
    /// EKF origin of the vehicle, if not its home.
    pub ekf_origin: Option<Geodetic>,
    /// Place where the vehicle's companion runs.
    pub companion: Companion,
    /// Coverage: its share of the work beside those of the others.
    pub weight: Option<f32>,
    /// Coverage: speed of climb, m/s.
    pub climb_mps: Option<f32>,
    /// Coverage: speed of descent, m/s.
    pub descend_mps: Option<f32>,
}

/// Climbing speed V_a of a vehicle that has none of its own, m/s.
const DEFAULT_CLIMB_MPS: f32 = 3.0;
/// Descending speed V_d of a vehicle that has none of its own, m/s.
const DEFAULT_DESCEND_MPS: f32 = 1.0;

impl Vehicle {
    /// V_a and V_d, m/s.
    pub fn climbs_mps(&self) -> [f32; 2] {
        [
            self.climb_mps.unwrap_or(DEFAULT_CLIMB_MPS),
            self.descend_mps.unwrap_or(DEFAULT_DESCEND_MPS),
        ]
    }
}

/// Place where a companion runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Companion {
    /// The companion runs in this process.
    InProcess {
        /// File of the companion's flash; no scenario's file names one.
        flash: Option<PathBuf>,
    },
    /// On a board, or in another process.
    Url {
        /// Companion's port for the autopilot.
        autopilot: LinkUrl,
        /// Companion's port for the radio; none where the radio is joined to others by another
        /// program, or to none.
        radio: Option<LinkUrl>,
    },
    /// On a board in QEMU, in lock step with the simulation; no scenario's file says so.
    Emulated {
        /// The firmware for the board `qemu`.
        program: PathBuf,
        /// Log of the board.
        log: PathBuf,
    },
}

/// `[deconfliction]`
#[derive(Clone, Debug, PartialEq)]
pub struct Deconfliction {
    /// How vehicles keep apart.
    pub method: Method,
    /// Distance that vehicles keep, centre to centre.
    pub safety_distance_m: f32,
    /// Distance that the schedule plans between vehicles' paths, centre to centre.
    pub separation_m: f32,
}

/// `[simulation]`
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Mean wind, m/s.
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

/// One fault of `[[faults]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// When it strikes.
    pub at_s: f32,
    /// How long it lasts; for good if absent.
    pub duration_s: Option<f32>,
    /// The vehicle that it strikes, if one.
    pub vehicle: Option<u8>,
    /// Kind of the fault, one of [`FAULT_KINDS`].
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
    /// Whether the fault strikes this vehicle: a fault without a vehicle strikes all, an obstacle
    /// strikes none.
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
