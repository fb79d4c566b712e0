//! The referee of a simulation: sees the true motion at every physics step, and nothing of what
//! companions estimate or report but their state and progress.
//!
//! A wall contact is a body (a sphere of the vehicle's radius) that reaches into an obstacle of the
//! exact map; a contact that lasts counts once. While a vehicle takes off or lands, obstacle cells
//! below its centre are the floor, no wall. A wreck is an obstacle too: touching it is a contact,
//! passing near it is no violation. Of the contacts, those of a vehicle that its pilot flies are
//! marked: its companion sends it no setpoints.

mod standstill;

use planner_core::Point;
use planner_core::map::segment::point_clearance;
use planner_core::map::voxel::VoxelGrid;

use crate::coverage::obstacles::MapObstacles;
use crate::map::edt::ClearanceField;
use crate::terrain::HeightGrid;

/// Rounding of positions, metres: an overlap of less than this is no contact.
const CONTACT_ROUNDING_M: f32 = 1e-3;
/// Time between two points of the recorded tracks and samples, seconds.
const RECORD_EVERY_S: f64 = 0.2;

/// Phase of a vehicle's flight, as far as the referee's rules differ by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefereePhase {
    /// On the ground with motors off, before or after the flight.
    Grounded,
    /// On the ground with motors on, or in the air off its path.
    TakeOffOrLanding,
    /// In the air on its path.
    Flying,
    /// Falls, its motors off.
    Falling,
    /// Lies on the ground after a fall: an obstacle to the others from then on.
    Wreck,
}

/// What the referee sees of one vehicle at one step.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Centre of the body, ENU metres.
    pub position: Point,
    /// Phase of the vehicle's flight.
    pub phase: RefereePhase,
    /// Whether the vehicle stands still by command of operator or pilot.
    pub holds_by_command: bool,
    /// Whether its pilot flies it: no setpoint of its companion counts.
    pub flown_by_pilot: bool,
    /// Arc length along its path, metres; `None`: moving by 1 m counts as progress instead.
    pub progress_m: Option<f32>,
}

/// Smallest distances of all vehicles since the sample before.
#[derive(Clone, Copy, Debug)]
pub struct DistanceSample {
    /// Seconds since the start of the simulation.
    pub t_s: f32,
    /// Smallest distance between two centres, not both on the ground and neither of a falling
    /// vehicle or a wreck, metres; infinite if no such pair.
    pub min_separation_m: f32,
    /// Smallest distance of a flying centre to an obstacle of a map, or its height above uneven
    /// ground, metres; infinite if no obstacle was near and no ground is uneven.
    pub min_clearance_m: f32,
}

/// What the referee remembers of one vehicle.
#[derive(Clone, Debug)]
struct WatchedVehicle {
    /// System id.
    id: u8,
    /// Radius of the hull, metres.
    radius_m: f32,
    /// True position at the last step, ENU metres; `None` before the first.
    last_position: Option<Point>,
    /// Length of the track flown so far, metres.
    flown_m: f64,
    /// Whether it touched an obstacle at the last step.
    in_contact: bool,
    /// Where the vehicle's distance to the nearest obstacle was last measured, and that distance,
    /// metres. `None` before.
    measured_clearance: Option<(Point, f32)>,
    /// Greatest arc length along its present path so far, metres.
    best_progress_m: f32,
    /// Where the vehicle last made progress, or did not have to.
    progress_position: Point,
    /// When that was, seconds; moved on by the time that it stood by command since then.
    last_progress_s: f64,
    /// Whether its present standstill was counted as a deadlock.
    in_deadlock: bool,
    /// Since when it stands by command in that standstill, seconds; `None` if it does not.
    deadlock_held_since_s: Option<f64>,
    /// Recorded track: times in seconds, positions in ENU metres.
    track: Vec<(f32, Point)>,
}

/// Counts contacts, violations and deadlocks, and records the smallest distances.
#[derive(Debug)]
pub struct Referee<'a> {
    /// The map.
    grid: VoxelGrid<'a>,
    /// Lower bounds of the distance to the nearest obstacle.
    field: &'a ClearanceField,
    /// Height of uneven ground, which the grid does not hold; `None` over level ground.
    pub terrain: Option<&'a HeightGrid>,
    /// Obstacles of the map beside an area, which the grid does not hold; `None` without one.
    pub area_obstacles: Option<&'a MapObstacles>,
    /// Distance that two vehicles keep, metres.
    safety_distance_m: f32,
    vehicles: Vec<WatchedVehicle>,
    /// By pair, at `i * n + j` for vehicles `j < i`: whether they are nearer than the safety
    /// distance; if one falls or is a wreck, whether they touch.
    too_near: Vec<bool>,
    /// By pair as above: whether they touch, if neither falls or is a wreck.
    touching: Vec<bool>,
    /// When the last sample was recorded, seconds.
    last_recorded_s: f64,
    /// Smallest distances since the last sample.
    sample_so_far: DistanceSample,
    /// Whether a deadlock that ends no longer counts: where faults strike, vehicles wait until it
    /// is known what became of the struck vehicle, and for their turn to fly around it.
    pub retracts_ended_deadlocks: bool,
    /// Whether a deadlock that ends by flying on within 60 s (`MAX_OUT_OF_RANGE_WAIT_S`) no longer
    /// counts: where vehicles may be out of radio range, they wait until one counts as lost. Time
    /// in which it stands by command is left out of the 60 s.
    pub retracts_out_of_range_waits: bool,
    /// Spherical obstacles that are in no map: centre and radius, metres.
    pub sphere_obstacles: Vec<(Point, f32)>,
    /// Number of times that a body began to touch an obstacle, a falling vehicle or a wreck.
    pub wall_contacts: u32,
    /// Number of times that a pair came nearer than the safety distance.
    pub violations: u32,
    /// Number of times that a vehicle made no progress in flight for 20 s; without those that
    /// ended, if [`Self::retracts_ended_deadlocks`] or [`Self::retracts_out_of_range_waits`].
    pub deadlocks: u32,
    /// Smallest distance of a flying centre to an obstacle of a map, or its height above uneven
    /// ground, in the whole flight, metres; an obstacle counts only where it is nearer than 3 m
    /// (`MAX_MEASURED_CLEARANCE_M`). Infinite if nothing counted.
    pub min_clearance_m: f32,
    /// Smallest distance between two centres, not both on the ground and neither of a falling
    /// vehicle or a wreck, in the whole flight, metres.
    pub min_separation_m: f32,
    /// Smallest distances over time, one sample each 0.2 s.
    pub samples: Vec<DistanceSample>,
    /// Contacts, violations, deadlocks, and standstills that ended.
    pub incidents: Vec<Incident>,
}

/// What the referee saw.
#[derive(Clone, Debug)]
pub struct Incident {
    /// When it began; for a deadlock, when it counted as one. Seconds.
    pub t_s: f64,
    /// Index of the vehicle.
    pub vehicle: usize,
    /// What happened.
    pub text: String,
    /// Whether it is a standstill that ended, and no longer counts as a deadlock.
    pub retracted: bool,
    /// Whether it is a wall contact of a vehicle that its pilot flies.
    pub contact_under_pilot: bool,
}

impl Incident {
    fn new(t_s: f64, vehicle: usize, text: String) -> Self {
        Self { t_s, vehicle, text, retracted: false, contact_under_pilot: false }
    }
}

impl<'a> Referee<'a> {
    /// A referee for vehicles with these ids and radii (metres), in this order.
    pub fn new(
        grid: VoxelGrid<'a>,
        field: &'a ClearanceField,
        safety_distance_m: f32,
        vehicles: &[(u8, f32)],
    ) -> Self {
        let watched = |&(id, radius_m): &(u8, f32)| WatchedVehicle {
            id,
            radius_m,
            last_position: None,
            flown_m: 0.0,
            in_contact: false,
            measured_clearance: None,
            best_progress_m: f32::NEG_INFINITY,
            progress_position: Point::zeros(),
            last_progress_s: 0.0,
            in_deadlock: false,
            deadlock_held_since_s: None,
            track: Vec::new(),
        };
        Self {
            grid,
            field,
            terrain: None,
            area_obstacles: None,
            safety_distance_m,
            vehicles: vehicles.iter().map(watched).collect(),
            too_near: vec![false; vehicles.len() * vehicles.len()],
            touching: vec![false; vehicles.len() * vehicles.len()],
            last_recorded_s: f64::NEG_INFINITY,
            sample_so_far: EMPTY_SAMPLE,
            retracts_ended_deadlocks: false,
            retracts_out_of_range_waits: false,
            sphere_obstacles: Vec::new(),
            wall_contacts: 0,
            violations: 0,
            deadlocks: 0,
            min_clearance_m: f32::INFINITY,
            min_separation_m: f32::INFINITY,
            samples: Vec::new(),
            incidents: Vec::new(),
        }
    }

    /// Checks all vehicles at one physics step; each 0.2 s it records their positions.
    pub fn observe(&mut self, t_s: f64, seen: &[Observation]) {
        for (i, now) in seen.iter().enumerate() {
            self.watch_walls(i, t_s, now);
            self.watch_progress(i, t_s, now);
            let vehicle = &mut self.vehicles[i];
            if let Some(last) = vehicle.last_position.replace(now.position) {
                vehicle.flown_m += f64::from((now.position - last).norm());
            }
        }
        self.watch_pairs(t_s, seen);
        if t_s - self.last_recorded_s >= RECORD_EVERY_S - 1e-6 {
            self.last_recorded_s = t_s;
            self.samples.push(DistanceSample { t_s: t_s as f32, ..self.sample_so_far });
            self.sample_so_far = EMPTY_SAMPLE;
            for (vehicle, now) in self.vehicles.iter_mut().zip(seen) {
                vehicle.track.push((t_s as f32, now.position));
            }
        }
    }

    /// Number of the wall contacts in which its pilot flew the vehicle.
    pub fn wall_contacts_under_pilot(&self) -> u32 {
        self.incidents.iter().filter(|incident| incident.contact_under_pilot).count() as u32
    }

    /// Length of the track that a vehicle has flown so far, metres.
    pub fn flown_m(&self, vehicle: usize) -> f64 {
        self.vehicles[vehicle].flown_m
    }

    /// Recorded track of a vehicle: times in seconds, positions in ENU metres.
    pub fn track(&self, vehicle: usize) -> &[(f32, Point)] {
        &self.vehicles[vehicle].track
    }

    /// Whether a body in flight reaches into uneven ground; records its height above ground too.
    fn check_ground_contact(&mut self, place: &Point, radius_m: f32) -> bool {
        let Some(ground_m) = self.terrain.and_then(|terrain| terrain.height_at(&place.xy())) else {
            return false;
        };
        let above_m = place.z - ground_m;
        self.sample_so_far.min_clearance_m = self.sample_so_far.min_clearance_m.min(above_m);
        self.min_clearance_m = self.min_clearance_m.min(above_m);
        above_m < radius_m - CONTACT_ROUNDING_M
    }

    /// Measures vehicle `i`'s distance to obstacles, and counts contacts that begin.
    fn watch_walls(&mut self, i: usize, t_s: f64, now: &Observation) {
        if matches!(now.phase, RefereePhase::Grounded | RefereePhase::Falling | RefereePhase::Wreck)
        {
            return;
        }
        let radius_m = self.vehicles[i].radius_m;
        let flying = now.phase == RefereePhase::Flying;
        // Only a clearance that means contact, or is the smallest of this sample, must be exact.
        let wanted =
            if flying { self.sample_so_far.min_clearance_m.max(radius_m) } else { radius_m };
        // A clearance changes by no more than the distance flown since it was measured.
        let (at_least_m, at_most_m) = match self.vehicles[i].measured_clearance {
            Some((place, clearance_m)) => {
                let moved_m = (now.position - place).norm() + CONTACT_ROUNDING_M;
                (clearance_m - moved_m, clearance_m + moved_m)
            }
            None => (0.0, f32::INFINITY),
        };
        let touches = if at_least_m < wanted && self.lower_bound_m(&now.position) < wanted {
            let reach = wanted.min(MAX_MEASURED_CLEARANCE_M);
            let clearance_m = self.clearance_up_to_m(&now.position, reach.min(at_most_m));
            if clearance_m < reach {
                self.vehicles[i].measured_clearance = Some((now.position, clearance_m));
            }
            if flying && clearance_m < reach {
                self.sample_so_far.min_clearance_m =
                    self.sample_so_far.min_clearance_m.min(clearance_m);
                self.min_clearance_m = self.min_clearance_m.min(clearance_m);
            }
            let touches = clearance_m < radius_m - CONTACT_ROUNDING_M;
            touches && (flying || self.touches_beside(&now.position, radius_m))
        } else {
            false
        };
        let touches = touches || (flying && self.check_ground_contact(&now.position, radius_m));
        let inside = |&(centre, extent_m): &(Point, f32)| {
            (now.position - centre).norm() < radius_m + extent_m
        };
        let touches = touches || self.sphere_obstacles.iter().any(inside);
        let was_touching = std::mem::replace(&mut self.vehicles[i].in_contact, touches);
        if touches && !was_touching {
            self.wall_contacts += 1;
            let [x, y, z] = now.position.into();
            let under = if now.flown_by_pilot { " under its pilot" } else { "" };
            let text = format!("touches an obstacle{under} at [{x:.2}, {y:.2}, {z:.2}]");
            let contact = Incident::new(t_s, i, text);
            self.incidents.push(Incident { contact_under_pilot: now.flown_by_pilot, ..contact });
        }
    }

    /// Lower bound of the distance to the nearest obstacle, metres.
    fn lower_bound_m(&self, place: &Point) -> f32 {
        let walls_m = self.area_obstacles.map(|walls| walls.clearance_field().lower_bound_m(place));
        walls_m.unwrap_or(f32::INFINITY).min(self.field.lower_bound_m(place))
    }

    /// Distance to the nearest obstacle, metres; `reach` if none is nearer.
    fn clearance_up_to_m(&self, place: &Point, reach: f32) -> f32 {
        let nearest_m = point_clearance(&self.grid, place, reach);
        self.area_obstacles.map_or(nearest_m, |walls| {
            nearest_m.min(point_clearance(&walls.map.grid(), place, reach))
        })
    }

    /// Whether a body on or near the floor touches an obstacle cell whose top is above the body's
    /// centre.
    fn touches_beside(&self, position: &Point, radius_m: f32) -> bool {
        let walls = self.area_obstacles.map(|walls| walls.map.grid());
        let mut grids = walls.iter().chain([&self.grid]);
        grids.any(|grid| touches_cell_beside(grid, position, radius_m))
    }

    /// Measures the distances between vehicles, and counts violations that begin.
    fn watch_pairs(&mut self, t_s: f64, seen: &[Observation]) {
        let n = seen.len();
        for i in 0..n {
            for j in 0..i {
                let apart = (seen[i].position - seen[j].position).norm();
                let rests = |phase| matches!(phase, RefereePhase::Grounded | RefereePhase::Wreck);
                let out = |phase| matches!(phase, RefereePhase::Falling | RefereePhase::Wreck);
                match (seen[i].phase, seen[j].phase) {
                    (a, b) if rests(a) && rests(b) => continue,
                    (a, b) if out(a) || out(b) => {
                        let (flier, wreck) = if out(a) { (j, i) } else { (i, j) };
                        self.watch_wreck(t_s, flier, wreck, seen[wreck].phase, apart);
                        continue;
                    }
                    _ => {}
                }
                self.sample_so_far.min_separation_m =
                    self.sample_so_far.min_separation_m.min(apart);
                let near = apart < self.safety_distance_m;
                let was_near = std::mem::replace(&mut self.too_near[i * n + j], near);
                if near && !was_near {
                    self.violations += 1;
                    let text = format!(
                        "nearer than the safety distance to vehicle {}",
                        self.vehicles[j].id
                    );
                    self.incidents.push(Incident::new(t_s, i, text));
                }
                let touches = apart < self.vehicles[i].radius_m + self.vehicles[j].radius_m;
                let was_touching = std::mem::replace(&mut self.touching[i * n + j], touches);
                if touches && !was_touching {
                    self.incidents.push(Incident::new(
                        t_s,
                        i,
                        format!("touches vehicle {}", self.vehicles[j].id),
                    ));
                }
            }
        }
        self.min_separation_m = self.min_separation_m.min(self.sample_so_far.min_separation_m);
    }

    /// A vehicle need not keep the safety distance from a wreck; touching one is a wall contact.
    fn watch_wreck(
        &mut self,
        t_s: f64,
        flier: usize,
        wreck: usize,
        phase: RefereePhase,
        apart_m: f32,
    ) {
        let pair = flier.max(wreck) * self.vehicles.len() + flier.min(wreck);
        let touches = apart_m < self.vehicles[flier].radius_m + self.vehicles[wreck].radius_m;
        if std::mem::replace(&mut self.too_near[pair], touches) || !touches {
            return;
        }
        self.wall_contacts += 1;
        let what = if phase == RefereePhase::Falling {
            "is hit by falling"
        } else {
            "touches the wreck of"
        };
        self.incidents.push(Incident::new(
            t_s,
            flier,
            format!("{what} vehicle {}", self.vehicles[wreck].id),
        ));
    }
}

/// Whether a body touches an obstacle cell of this grid whose top is above the body's centre.
fn touches_cell_beside(grid: &VoxelGrid<'_>, position: &Point, radius_m: f32) -> bool {
    let shape = grid.shape();
    let reach = Point::repeat(radius_m);
    let cell =
        |p: Point| [0, 1, 2].map(|a| ((p[a] - shape.min[a]) / shape.resolution_m).floor() as i64);
    let (low, high) = (cell(position - reach), cell(position + reach));
    let dims = shape.dims.map(i64::from);
    let inside = |c: [i64; 3]| (0..3).all(|a| c[a] >= 0 && c[a] < dims[a]);
    (low[2]..=high[2]).any(|k| {
        (low[1]..=high[1]).any(|j| {
            (low[0]..=high[0]).any(|i| {
                if !inside([i, j, k]) || !grid.is_occupied([i, j, k].map(|c| c as u32)) {
                    return false;
                }
                let corner =
                    shape.min + Point::new(i as f32, j as f32, k as f32) * shape.resolution_m;
                let top = corner.z + shape.resolution_m;
                let nearest =
                    position.sup(&corner).inf(&(corner + Point::repeat(shape.resolution_m)));
                top > position.z && (nearest - position).norm() < radius_m - CONTACT_ROUNDING_M
            })
        })
    })
}

/// Greatest clearance to an obstacle that is measured exactly, metres.
const MAX_MEASURED_CLEARANCE_M: f32 = 3.0;
/// A sample before any distance was measured.
const EMPTY_SAMPLE: DistanceSample =
    DistanceSample { t_s: 0.0, min_separation_m: f32::INFINITY, min_clearance_m: f32::INFINITY };

#[cfg(test)]
mod tests;
