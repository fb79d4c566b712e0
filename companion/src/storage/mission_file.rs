//! The mission file, uploaded beside the roadmap: the vehicles with their starts, their goals or
//! their area, speeds and separations.
//!
//! The file is little-endian, has a version, and ends with a CRC-32; `companion/README.md` lists it
//! byte by byte. Lengths are metres, speeds m/s, points east, north, up in the mission frame.
//! Companions compare the file's CRC by radio. The file holds the roadmap's CRC, so vehicles with
//! the same CRC compute the same plan. What each vehicle may choose for itself (own speed limit,
//! tolerances) is a parameter instead.
//!
//! [`MissionView::parse`] checks the whole file once, in O(vehicles² + goals); afterwards every
//! accessor returns numbers in range, whatever the bytes were.

use heapless::Vec;
use planner_core::Point;
use planner_core::file::{CRC32, FileError};
use planner_core::geo::frames::Geodetic;
use planner_core::plan::{GoalMode, Objective, PlanRequest, VehicleTask};
use planner_core::roadmap::RoadmapView;
use planner_core::schedule::ScheduleConfig;
use planner_core::track::deconflict::Method;

use self::coverage::{CoverageBlock, CoverageView};
use self::numbers::{f32_at, point_at, put_numbers, u16_at, u32_at};
use crate::config::{Config, DEFAULT_GROUND_STATION_IDS, RosterEntry, box_contains};

pub mod coverage;
mod error;
mod header;
mod numbers;
mod records;
pub use error::MissionError;
pub use header::MissionHeader;
pub use records::{GOAL_LEN, MissionGoal, MissionVehicle, NO_GOAL, VEHICLE_LEN};

/// First eight bytes of the file.
pub const MAGIC: [u8; 8] = *b"FLKMISS\n";
/// Version of the mission file that this code writes. It also reads version 2, which has goals
/// only, and version 1, which names no ground station: then system id 255 is one.
pub const VERSION: u16 = 3;
/// Version 2, which has no kind of mission: its vehicles fly to goals.
const VERSION_WITHOUT_KIND: u16 = 2;
/// Version 1, which names no ground stations: system id 255 is one.
const VERSION_WITHOUT_GROUND_STATIONS: u16 = 1;
/// Longest mission file that a board stores, bytes.
pub const MAX_BYTES: usize = 4096;
/// Bytes of the file before its first vehicle.
pub const HEADER_LEN: usize = 104;
/// Length of the CRC-32 at the end, bytes.
const CRC_LEN: usize = 4;
/// Flag of a mission file that has a geofence.
const FLAG_FENCED: u8 = 1;
/// Kinds of mission: the value of the byte after the flags.
const KIND_GOALS: u8 = 0;
/// Kind of a mission with an area.
const KIND_COVERAGE: u8 = 1;

/// What the vehicles of a mission do, as read from its file.
#[derive(Clone, Copy, Debug)]
pub enum MissionKind<'a> {
    /// The vehicles fly to goals on a roadmap.
    Goals,
    /// The vehicles photograph an area.
    Coverage(CoverageView<'a>),
}

/// What the vehicles of a mission do, to be written to its file.
#[derive(Clone, Copy, Debug)]
pub enum MissionBlock<'a> {
    /// The vehicles fly to these goals.
    Goals(&'a [MissionGoal]),
    /// The vehicles photograph this area.
    Coverage(CoverageBlock<'a>),
}

impl MissionBlock<'_> {
    /// The goals; none in a coverage mission.
    fn goals(&self) -> &[MissionGoal] {
        match self {
            Self::Goals(goals) => goals,
            Self::Coverage(_) => &[],
        }
    }

    /// Length of the mission file, bytes, CRC included, with so many vehicles.
    pub fn file_len(&self, vehicles: usize) -> usize {
        let block = match self {
            Self::Goals(_) => 0,
            Self::Coverage(parts) => parts.encoded_len(),
        };
        encoded_len(vehicles, self.goals().len()) + block
    }
}

/// Length of the file of a mission with goals, bytes, CRC included.
pub const fn encoded_len(vehicles: usize, goals: usize) -> usize {
    HEADER_LEN + vehicles * VEHICLE_LEN + goals * GOAL_LEN + CRC_LEN
}

/// Writes a mission file to `out`. Returns its length.
///
/// # Errors
/// The mission is one that [`MissionView::parse`] rejects, or `out` is too small.
pub fn write_mission(
    header: &MissionHeader,
    vehicles: &[MissionVehicle],
    block: &MissionBlock<'_>,
    out: &mut [u8],
) -> Result<usize, MissionError> {
    let goals = block.goals();
    let (Ok(vehicle_count), Ok(goal_count)) =
        (u16::try_from(vehicles.len()), u16::try_from(goals.len()))
    else {
        return Err(FileError::Length.into());
    };
    let needed = block.file_len(vehicles.len());
    let out = out.get_mut(..needed).ok_or(MissionError::BufferTooSmall { needed })?;
    write_header(header, block, [vehicle_count, goal_count], out);
    let (to_vehicles, rest) =
        out[HEADER_LEN..needed - CRC_LEN].split_at_mut(vehicles.len() * VEHICLE_LEN);
    let (to_goals, to_block) = rest.split_at_mut(goals.len() * GOAL_LEN);
    for (to, vehicle) in to_vehicles.chunks_exact_mut(VEHICLE_LEN).zip(vehicles) {
        to.copy_from_slice(&vehicle.to_bytes());
    }
    for (to, goal) in to_goals.chunks_exact_mut(GOAL_LEN).zip(goals) {
        put_numbers(to, 0, goal.position.iter().copied().chain([goal.descent_m]));
    }
    if let MissionBlock::Coverage(parts) = block {
        parts.write(to_block);
    }
    let crc = CRC32.checksum(&out[..needed - CRC_LEN]);
    out[needed - CRC_LEN..].copy_from_slice(&crc.to_le_bytes());
    MissionView::parse(out)?;
    Ok(needed)
}

/// Writes the header: all bytes before the first vehicle. `out` is the whole file, since the header
/// states its length.
fn write_header(
    header: &MissionHeader,
    block: &MissionBlock<'_>,
    [vehicle_count, goal_count]: [u16; 2],
    out: &mut [u8],
) {
    let needed = out.len();
    out[..8].copy_from_slice(&MAGIC);
    out[8..10].copy_from_slice(&VERSION.to_le_bytes());
    out[10..12].copy_from_slice(&(HEADER_LEN as u16).to_le_bytes());
    out[12..16].copy_from_slice(&(needed as u32).to_le_bytes());
    out[16..20].copy_from_slice(&header.roadmap_crc.to_le_bytes());
    out[20] = match header.mode {
        GoalMode::Labelled => 0,
        GoalMode::Unlabelled(Objective::TotalDistance) => 1,
        GoalMode::Unlabelled(Objective::Makespan) => 2,
    };
    out[21] = match header.method {
        Method::Off => 0,
        Method::Algorithm2 => 1,
        Method::Priority => 2,
    };
    out[22] = if header.geofence.is_some() { FLAG_FENCED } else { 0 };
    out[23] = match block {
        MissionBlock::Goals(_) => KIND_GOALS,
        MissionBlock::Coverage(_) => KIND_COVERAGE,
    };
    out[24..26].copy_from_slice(&vehicle_count.to_le_bytes());
    out[26..28].copy_from_slice(&goal_count.to_le_bytes());
    out[28..32].copy_from_slice(&header.ground_stations);
    let origin = [header.origin.lat_deg, header.origin.lon_deg, header.origin.alt_m];
    for (to, number) in out[32..56].chunks_exact_mut(8).zip(origin) {
        to.copy_from_slice(&number.to_le_bytes());
    }
    let s = &header.schedule;
    let numbers = [
        header.cruise_mps,
        s.vertical_mps,
        header.safety_distance_m,
        s.separation_m,
        s.parked_separation_m,
    ];
    let (low, high) = header.geofence.unwrap_or_default();
    put_numbers(
        &mut out[..HEADER_LEN],
        56,
        numbers
            .into_iter()
            .chain(low.iter().copied())
            .chain(high.iter().copied())
            .chain([s.cruise_mps]),
    );
}

/// A mission file whose bytes have been checked: header and CRC decoded, the rest borrowed.
#[derive(Clone, Copy, Debug)]
pub struct MissionView<'a> {
    /// The decoded header.
    header: MissionHeader,
    /// The CRC-32 at the end of the file.
    crc: u32,
    /// The vehicles, as in the file.
    vehicles: &'a [[u8; VEHICLE_LEN]],
    /// The goals, as in the file; empty in a coverage mission.
    goals: &'a [[u8; GOAL_LEN]],
    /// Whether the vehicles fly to goals or over an area.
    kind: MissionKind<'a>,
}

impl<'a> MissionView<'a> {
    /// Checks the mission file at the start of `bytes`; bytes behind its length are ignored.
    ///
    /// # Errors
    /// The first error found in the file.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, MissionError> {
        let head: &[u8; HEADER_LEN] = bytes.first_chunk().ok_or(FileError::Truncated)?;
        if head[..8] != MAGIC {
            return Err(FileError::Magic.into());
        }
        let (u16_at, u32_at) = (|at: usize| u16_at(head, at), |at: usize| u32_at(head, at));
        let ground_stations = match u16_at(8) {
            VERSION_WITHOUT_GROUND_STATIONS => DEFAULT_GROUND_STATION_IDS,
            VERSION_WITHOUT_KIND | VERSION => [head[28], head[29], head[30], head[31]],
            other => return Err(FileError::Version(other).into()),
        };
        let total = u32_at(12) as usize;
        let (vehicle_count, goal_count) = (usize::from(u16_at(24)), usize::from(u16_at(26)));
        let kind = if u16_at(8) == VERSION { head[23] } else { KIND_GOALS };
        let least = encoded_len(vehicle_count, goal_count);
        let fits = if kind == KIND_GOALS { total == least } else { total > least };
        if usize::from(u16_at(10)) != HEADER_LEN || !fits {
            return Err(FileError::Length.into());
        }
        let body = bytes.get(..total).ok_or(FileError::Truncated)?;
        let (covered, stored) = body.split_last_chunk::<CRC_LEN>().ok_or(FileError::Truncated)?;
        let crc = u32::from_le_bytes(*stored);
        if CRC32.checksum(covered) != crc {
            return Err(FileError::Crc.into());
        }
        let f64_at =
            |at: usize| f64::from_bits(u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32);
        let header = MissionHeader {
            roadmap_crc: u32_at(16),
            mode: match head[20] {
                0 => GoalMode::Labelled,
                1 => GoalMode::Unlabelled(Objective::TotalDistance),
                2 => GoalMode::Unlabelled(Objective::Makespan),
                _ => return Err(FileError::Header("mode").into()),
            },
            method: match head[21] {
                0 => Method::Off,
                1 => Method::Algorithm2,
                2 => Method::Priority,
                _ => return Err(FileError::Header("method").into()),
            },
            origin: Geodetic { lat_deg: f64_at(32), lon_deg: f64_at(40), alt_m: f64_at(48) },
            cruise_mps: f32_at(head, 56),
            schedule: ScheduleConfig {
                cruise_mps: f32_at(head, 100),
                vertical_mps: f32_at(head, 60),
                separation_m: f32_at(head, 68),
                parked_separation_m: f32_at(head, 72),
            },
            safety_distance_m: f32_at(head, 64),
            geofence: match (head[22], head[23]) {
                (_, other) if other != kind => return Err(FileError::Header("flags").into()),
                (0, _) => None,
                (FLAG_FENCED, _) => Some((point_at(head, 76), point_at(head, 88))),
                _ => return Err(FileError::Header("flags").into()),
            },
            ground_stations,
        };
        header.check()?;
        let (vehicles, rest) = covered[HEADER_LEN..].split_at(vehicle_count * VEHICLE_LEN);
        let (goals, block) = rest.split_at(goal_count * GOAL_LEN);
        let kind = match kind {
            KIND_GOALS => MissionKind::Goals,
            KIND_COVERAGE => MissionKind::Coverage(CoverageView::parse(block, vehicle_count)?),
            _ => return Err(FileError::Header("kind").into()),
        };
        let (vehicles, goals) = (vehicles.as_chunks().0, goals.as_chunks().0);
        let view = Self { header, crc, vehicles, goals, kind };
        view.check_vehicles_and_goals()?;
        if u16_at(8) != VERSION_WITHOUT_GROUND_STATIONS
            && view.vehicles().any(|v| ground_stations.contains(&v.task.id))
        {
            return Err(FileError::Header("ground_stations").into());
        }
        Ok(view)
    }

    /// Checks ids, numbers and goals of the vehicles, and that starts and goals are in the
    /// geofence.
    fn check_vehicles_and_goals(&self) -> Result<(), MissionError> {
        let labelled = self.header.mode == GoalMode::Labelled;
        let inside = |place: &Point| {
            self.header.geofence.as_ref().is_none_or(|fence| box_contains(fence, place))
        };
        let mut seen = [false; 256];
        for (i, vehicle) in self.vehicles().enumerate() {
            let id = vehicle.task.id;
            let known = core::mem::replace(&mut seen[usize::from(id)], true);
            if known || !vehicle.is_valid(self.goals.len()) {
                return Err(MissionError::InvalidVehicle(i as u16));
            }
            let same = |other: &[u8; VEHICLE_LEN]| other[2..4] == self.vehicles[i][2..4];
            if labelled && vehicle.task.goal.is_some() && self.vehicles[..i].iter().any(same) {
                return Err(MissionError::SameGoal(id));
            }
            if !inside(&vehicle.path_start) {
                return Err(MissionError::StartOutside(id));
            }
        }
        for (goal, i) in self.goals().zip(0..) {
            if !goal.is_valid() {
                return Err(MissionError::InvalidGoal(i));
            }
            if !inside(&goal.position) {
                return Err(MissionError::GoalOutside(i));
            }
        }
        Ok(())
    }

    /// Settings of the mission that all its vehicles share.
    pub fn header(&self) -> &MissionHeader {
        &self.header
    }

    /// The CRC-32 at the end of the file, by which vehicles recognise their mission on the radio.
    pub fn crc(&self) -> u32 {
        self.crc
    }

    /// What the vehicles do: fly to goals or photograph an area.
    pub fn kind(&self) -> &MissionKind<'a> {
        &self.kind
    }

    /// Length of the file, bytes.
    pub fn byte_len(&self) -> usize {
        let block = match &self.kind {
            MissionKind::Goals => 0,
            MissionKind::Coverage(view) => view.byte_len(),
        };
        encoded_len(self.vehicles.len(), self.goals.len()) + block
    }

    /// The vehicles of the mission, in the order of the roadmap's starts.
    pub fn vehicles(&self) -> impl ExactSizeIterator<Item = MissionVehicle> + '_ {
        self.vehicles.iter().map(MissionVehicle::from_bytes)
    }

    /// The goals of the mission, in the order of the roadmap's goals.
    pub fn goals(&self) -> impl ExactSizeIterator<Item = MissionGoal> + '_ {
        self.goals.iter().map(MissionGoal::from_bytes)
    }

    /// Index of the vehicle with this system id in the mission; `None` if it has none.
    pub fn index_of(&self, system_id: u8) -> Option<usize> {
        self.vehicles().position(|vehicle| vehicle.task.id == system_id)
    }

    /// Whether the mission can be planned with this roadmap: one with goals only on its own
    /// roadmap, a coverage mission with any or none.
    pub fn can_be_planned_with(&self, roadmap: Option<&RoadmapView<'_>>) -> bool {
        match self.kind {
            MissionKind::Goals => roadmap.is_some_and(|roadmap| self.matches_roadmap(roadmap)),
            MissionKind::Coverage(_) => true,
        }
    }

    /// Whether the mission was made for this roadmap: CRC and numbers of starts and goals agree.
    fn matches_roadmap(&self, roadmap: &RoadmapView<'_>) -> bool {
        let terminals =
            (usize::from(roadmap.header().start_count), usize::from(roadmap.header().goal_count));
        self.header.roadmap_crc == roadmap.crc()
            && terminals == (self.vehicles.len(), self.goals.len())
    }

    /// The request to the planner for the whole swarm. `tasks` and `descents_m` are the memory for
    /// its lists; each vehicle has room for `gates_most` gates.
    ///
    /// # Errors
    /// [`MissionError::TooManyVehiclesOrGoals`] if the mission has more than `V` vehicles or goals.
    pub fn plan_request<'b, const V: usize>(
        &self,
        tasks: &'b mut Vec<VehicleTask, V>,
        descents_m: &'b mut Vec<f32, V>,
        gates_most: usize,
    ) -> Result<PlanRequest<'b>, MissionError> {
        if self.vehicles.len() > V || self.goals.len() > V {
            return Err(MissionError::TooManyVehiclesOrGoals);
        }
        tasks.clear();
        tasks.extend(self.vehicles().map(|vehicle| vehicle.task));
        descents_m.clear();
        descents_m.extend(self.goals().map(|goal| goal.descent_m));
        Ok(PlanRequest {
            vehicles: tasks,
            goal_descents_m: descents_m,
            mode: self.header.mode,
            schedule: self.header.schedule,
            max_gates: gates_most,
        })
    }

    /// The settings of one vehicle's companion in this mission; defaults for what the mission does
    /// not set.
    ///
    /// # Errors
    /// The mission has no vehicle with this system id, or more than `V` vehicles.
    pub fn companion_config<const V: usize>(
        &self,
        system_id: u8,
    ) -> Result<Config<V>, MissionError> {
        let index = self.index_of(system_id).ok_or(MissionError::NotInRoster(system_id))?;
        let own = MissionVehicle::from_bytes(&self.vehicles[index]);
        if self.vehicles.len() > V {
            return Err(MissionError::TooManyVehiclesOrGoals);
        }
        let header = &self.header;
        let mut config = Config::new(system_id, own.path_start, header.origin);
        config.roster.clear();
        (config.slowest_vehicle_mps, config.fastest_vehicle_mps) = (header.cruise_mps, 0.0);
        for vehicle in self.vehicles() {
            let cruise_mps = libm::fminf(header.cruise_mps, vehicle.speed_max_mps);
            config.slowest_vehicle_mps = libm::fminf(config.slowest_vehicle_mps, cruise_mps);
            config.fastest_vehicle_mps = libm::fmaxf(config.fastest_vehicle_mps, cruise_mps);
            let entry = RosterEntry { system_id: vehicle.task.id, path_start: vehicle.path_start };
            let at = config.roster.partition_point(|other| other.system_id < entry.system_id);
            config.roster.insert(at, entry).map_err(|_| MissionError::TooManyVehiclesOrGoals)?;
        }
        config.mission_crc = self.crc;
        config.cruise_mps = libm::fminf(header.cruise_mps, own.speed_max_mps);
        config.climb_mps = header.schedule.vertical_mps;
        config.descend_mps = header.schedule.vertical_mps;
        if let MissionKind::Coverage(view) = &self.kind
            && let Some(share) = view.shares().nth(index)
        {
            (config.climb_mps, config.descend_mps) = (share.climb_mps, share.descend_mps);
            config.lost_vehicle_down_after_s = Some(view.unheard_vehicle_down_after_s());
            config.ground = view.header().ground;
        }
        config.radius_m = own.radius_m;
        config.required_clearance_m = own.task.required_clearance_m;
        config.safety_distance_m = header.safety_distance_m;
        config.method = header.method;
        config.geofence = header.geofence;
        config.ground_stations = header.ground_stations;
        Ok(config)
    }
}

#[cfg(test)]
mod tests;
