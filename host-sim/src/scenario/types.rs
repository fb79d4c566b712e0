//! The tables of a scenario, as read and checked.

use std::path::PathBuf;

use companion::autopilot::AutopilotKind;
use companion::config::MAX_GROUND_STATIONS;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::prm::Sampling;
use planner_core::track::deconflict::Method;

use super::coverage::AreaSection;
use super::error::ScenarioError;
use crate::link::LinkUrl;
use crate::map::UnknownSpace;

/// Radio range, metres, from which on companions take it that the radio reaches every vehicle. The
/// simulated radio keeps the scenario's range.
const RADIO_REACHES_ALL_FROM_M: f32 = 500.0;

/// A scenario, read and checked.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Name of the scenario: the path it was read from.
    pub path: String,
    /// Text of the scenario, as read.
    pub text: String,
    /// Seed of all random numbers of the run.
    pub seed: u64,
    /// `[map]`
    pub map: MapSection,
    /// `[roadmap]`
    pub roadmap: RoadmapSection,
    /// `[mission]`
    pub mission: MissionSection,
    /// `[[vehicles]]`, in the order of the file.
    pub vehicles: Vec<VehicleSection>,
    /// Where each vehicle's start stands in the file, as `FILE:LINE`.
    pub vehicle_file_lines: Vec<String>,
    /// `[deconfliction]`
    pub deconfliction: Deconfliction,
    /// `[simulation]`
    pub simulation: Simulation,
    /// `[[faults]]`
    pub faults: Vec<Fault>,
    /// `[area]`: what a coverage mission photographs; `None` in a mission with goals.
    pub area: Option<AreaSection>,
    /// `[formation]`, which is not supported yet.
    pub formation: Option<UnsupportedTable>,
    /// An error for each setting that is not supported yet, in the order of reading.
    pub(super) unsupported: Vec<ScenarioError>,
}

/// A table of the scenario that no code uses yet.
#[derive(Clone, Debug, PartialEq)]
pub struct UnsupportedTable {
    /// The table as TOML values.
    pub table: toml::Table,
}

/// `[map]`: the obstacle map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSection {
    /// Name of a built-in map, or path of the map file relative to the working directory (resolved
    /// against the scenario's folder). Empty in a coverage mission: level ground, at height 0 or at
    /// the terrain's lowest height.
    pub file: String,
    /// Edge of a cell of the planning grid, metres.
    pub resolution_m: f32,
    /// Whether unknown space may be flown through.
    pub unknown: UnknownSpace,
    /// Origin of the mission frame.
    pub origin: Geodetic,
}

/// `[roadmap]`: how the roadmap is built.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadmapSection {
    /// Number of random nodes besides starts and goals.
    pub random_nodes: u32,
    /// Shortest length of an edge, metres.
    pub edge_min_m: f32,
    /// Longest length of an edge, metres.
    pub edge_max_m: f32,
    /// Shortest edge as a share of the map's longest side (paper P2D); `None`: `edge_min_m` counts.
    pub edge_min_share: Option<f32>,
    /// Longest edge as a share of the map's longest side (paper P2D); `None`: `edge_max_m` counts.
    pub edge_max_share: Option<f32>,
    /// Whether edges may join two terminals, that is starts or goals.
    pub terminal_edges: TerminalEdges,
    /// Clearance of edges beyond a vehicle's radius, metres.
    pub safety_margin_m: f32,
    /// How random nodes are sampled.
    pub sampling: Sampling,
    /// Whether narrow passages that random nodes miss get nodes of their own.
    pub adds_passages: bool,
}

/// Whether edges may join two terminals, that is starts or goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TerminalEdges {
    /// Two terminals are joined as any other nodes (paper P3D).
    Allowed,
    /// No edge joins two terminals (paper P2D).
    Forbidden,
}

/// `[mission]`
#[derive(Clone, Debug, PartialEq)]
pub struct MissionSection {
    /// How goals are assigned to vehicles, or which other kind of mission it is.
    pub mode: MissionMode,
    /// What the assignment of goals minimises.
    pub objective: AssignmentObjective,
    /// Nominal speed of the vehicles along their paths, m/s.
    pub cruise_mps: f32,
    /// Goals of the vehicles, ENU metres.
    pub goals: Vec<Point>,
    /// Where each goal stands in the file, as `FILE:LINE`.
    pub goal_file_lines: Vec<String>,
    /// Box that vehicles must not leave; `None`: there is no fence.
    pub geofence: Option<Geofence>,
    /// MAVLink system ids of the ground stations whose commands count; 0 fills unused places.
    pub ground_stations: [u8; MAX_GROUND_STATIONS],
}

/// How goals are assigned to vehicles, or that the mission has none: an area to photograph, or a
/// formation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionMode {
    /// Any vehicle may fly to any goal: the assignment decides.
    Unlabelled,
    /// Each vehicle flies to the goal that its `goal` names.
    Labelled,
    /// All vehicles fly to the one goal, each to a slot of its own around it.
    SingleGoal,
    /// An area is photographed.
    Coverage,
    /// A formation is flown (not supported yet).
    Formation,
}

/// What the assignment of goals minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AssignmentObjective {
    /// The sum of all path lengths.
    TotalDistance,
    /// The length of the longest path.
    Makespan,
}

/// A box that vehicles must not leave, ENU metres.
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
pub struct VehicleSection {
    /// MAVLink system id, 1 to 250.
    pub id: u8,
    /// Where the vehicle's path begins, ENU metres; in a coverage mission, as read, its pad on the
    /// ground.
    pub start: Point,
    /// Index (from 0) into [`MissionSection::goals`], for labelled missions. `None` in other
    /// missions.
    pub goal_index: Option<usize>,
    /// Radius of the vehicle's hull, metres.
    pub radius_m: f32,
    /// Height at which the vehicle flies on 2D maps, metres (not supported yet).
    pub altitude_m: Option<f32>,
    /// Highest speed of the vehicle, m/s.
    pub speed_max_mps: f32,
    /// Time in a hover on one battery, seconds; `None`: 1200 s.
    pub hover_endurance_s: Option<f32>,
    /// Payload of the vehicle, kg (not supported yet).
    pub payload_kg: Option<f32>,
    /// Autopilot of the vehicle: PX4 or ArduPilot.
    pub autopilot: AutopilotKind,
    /// Home of the autopilot; `None`: the place where it arms.
    pub home: Option<Geodetic>,
    /// EKF origin of the autopilot; `None`: the vehicle's pad.
    pub ekf_origin: Option<Geodetic>,
    /// Where the vehicle's companion runs.
    pub companion: CompanionHost,
    /// Coverage: relative weight of the vehicle in the division of the work; `None`: 1.
    pub weight: Option<f32>,
    /// Coverage: climb speed (V_a in paper CPP), m/s; `None`: 3 m/s.
    pub climb_mps: Option<f32>,
    /// Coverage: descent speed (V_d in paper CPP), m/s; `None`: 1 m/s.
    pub descend_mps: Option<f32>,
}

/// Climb speed (V_a in paper CPP) if the vehicle gives none, m/s.
const DEFAULT_CLIMB_MPS: f32 = 3.0;
/// Descent speed (V_d in paper CPP) if the vehicle gives none, m/s.
const DEFAULT_DESCEND_MPS: f32 = 1.0;
/// Time in a hover on one battery if the vehicle gives none, seconds.
const DEFAULT_ENDURANCE_S: f32 = 1200.0;

impl VehicleSection {
    /// Speeds of climb and descent, m/s.
    pub fn climb_and_descent_mps(&self) -> [f32; 2] {
        [
            self.climb_mps.unwrap_or(DEFAULT_CLIMB_MPS),
            self.descend_mps.unwrap_or(DEFAULT_DESCEND_MPS),
        ]
    }

    /// Time that the vehicle hovers on a full battery, seconds.
    pub fn battery_hover_s(&self) -> f32 {
        self.hover_endurance_s.unwrap_or(DEFAULT_ENDURANCE_S)
    }
}

/// Where a vehicle's companion runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CompanionHost {
    /// The companion runs in this process.
    InProcess {
        /// File that holds the companion's flash; `None` in every scenario read from a file.
        flash: Option<PathBuf>,
    },
    /// On a board, or in another process, reached by links.
    Url {
        /// Link to the companion's port for the autopilot.
        autopilot: LinkUrl,
        /// Link to the companion's port for the radio; `None` if the radio is connected by another
        /// program, or not at all.
        radio: Option<LinkUrl>,
    },
    /// On a board in QEMU in lock step with the simulation; no scenario file can choose this.
    Emulated {
        /// Program of the board: the firmware built for the board `qemu`.
        program: PathBuf,
        /// File for the log of the board.
        log: PathBuf,
    },
}

/// `[deconfliction]`: how vehicles are kept apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Deconfliction {
    /// How vehicles keep apart.
    pub method: Method,
    /// Least allowed distance between two vehicles' centres, metres.
    pub safety_distance_m: f32,
    /// Distance that the schedule keeps between vehicles' paths, centre to centre, metres.
    pub separation_m: f32,
}

/// `[simulation]`: wind, sensors, links and time limit of the simulated flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Mean wind, m/s.
    pub mean_wind_mps: f32,
    /// Peak of the gusts on top of the mean wind, m/s.
    pub gust_peak_mps: f32,
    /// Standard deviation of a random error of the position estimate, metres.
    pub position_noise_sd_m: f32,
    /// Error model of the autopilots' position estimates.
    pub estimator: PositionErrors,
    /// Baud rate of the serial links between companions and autopilots.
    pub serial_baud: u32,
    /// Probability that a byte on a serial link is corrupted.
    pub serial_corruption_per_byte: f32,
    /// Probability that a receiver misses a radio packet.
    pub radio_loss: f32,
    /// Delay of a radio packet, seconds.
    pub radio_delay_s: f32,
    /// Distance beyond which radios do not hear each other, metres.
    pub radio_range_m: f32,
    /// Simulated time after which the flight is given up, seconds.
    pub time_limit_s: f32,
}

/// Error model of the autopilots' position estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionErrors {
    /// No error: the estimate is the true position. No scenario file can choose this.
    Perfect,
    /// Errors of a GPS receiver with fixed RTK: at most 0.1 m horizontally and 0.15 m in height.
    Rtk,
    /// Errors as in the recorded flights of this kind of autopilot.
    Recorded,
}

/// One fault of `[[faults]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// When the fault begins, seconds of simulated time.
    pub at_s: f32,
    /// Duration of the fault, seconds; `None`: it does not end.
    pub duration_s: Option<f32>,
    /// MAVLink id of the vehicle that the fault strikes; `None`: it strikes all.
    pub vehicle: Option<u8>,
    /// Kind of the fault: one of [`VEHICLE_FAULT_KINDS`], or [`FAULT_OBSTACLE`].
    pub kind: &'static str,
    /// `radio-cut`: which direction fails, `tx`, `rx` or `both`; `None`: both.
    pub radio_cut_direction: Option<String>,
    /// `position-jump`, `origin-change`: offset, ENU metres; `None`: the default of the kind.
    pub offset_m: Option<Point>,
    /// `obstacle`: centre of the sphere, ENU metres.
    pub obstacle_position: Option<Point>,
    /// `obstacle`: radius of the sphere, metres.
    pub obstacle_radius_m: Option<f32>,
}

impl Fault {
    /// Whether the fault strikes this vehicle: a fault without a vehicle strikes all, an obstacle
    /// strikes none.
    pub fn strikes(&self, vehicle: &VehicleSection) -> bool {
        self.kind != FAULT_OBSTACLE && self.vehicle.is_none_or(|id| id == vehicle.id)
    }
}

/// Every kind of fault that strikes vehicles.
pub const VEHICLE_FAULT_KINDS: [&str; 17] = [
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
/// The kind of fault that puts a spherical obstacle into the world and strikes no vehicle.
pub const FAULT_OBSTACLE: &str = "obstacle";

impl Scenario {
    /// Refuses a scenario with a setting that is not supported yet, so that none is silently
    /// ignored.
    pub fn check_supported(&self) -> Result<(), ScenarioError> {
        self.unsupported.first().map_or(Ok(()), |error| Err(error.clone()))
    }

    /// Whether the mission photographs an area; it then has no goals, and `area` is there.
    pub fn covers_area(&self) -> bool {
        self.mission.mode == MissionMode::Coverage
    }

    /// Whether a vehicle may be out of the radio range of others.
    pub fn has_short_radio(&self) -> bool {
        self.simulation.radio_range_m < RADIO_REACHES_ALL_FROM_M
    }

    /// The greatest clearance that any vehicle requires, metres: largest radius and safety margin.
    pub fn max_required_clearance_m(&self) -> f32 {
        self.largest_radius_m() + self.roadmap.safety_margin_m
    }

    /// The radius of the largest vehicle, metres.
    pub fn largest_radius_m(&self) -> f32 {
        self.vehicles.iter().map(|v| v.radius_m).fold(0.0, f32::max)
    }
}
