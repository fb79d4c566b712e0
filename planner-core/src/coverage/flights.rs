//! Routes as flights: each vehicle's path, and the order of the vehicles where two of them meet.
//!
//! Source: CPP §3.2: up to the own layer, over to the first waypoint, down, along the lanes, up, home in the layer, down.
//! The take-off ends and the landing begins close above the pad: all between is path, on which a vehicle can wait.
//! A flight is one path like any other mission's, so [`crate::schedule`] keeps it apart from the others: the vehicle that
//! flies longest leaves first, each other one as early as those before it allow, and gates hold that order in the air.

use heapless::Vec;

use super::lanes::Lane;
use super::pack::{Heading, Plan, Route, Vehicle, Work};
use super::transit::Transit;
use super::{Flat, divide};
use crate::Point;
use crate::field::follow::Following;
use crate::flight::{Flight, Look, Path, PathError, Photographs, Range, Task, Trigger};
use crate::plan::{PlanError, SwarmPlan};
use crate::schedule::{self, MAX_TIMED_SEGMENT_M, ScheduleConfig, ScheduleError, ScheduleWorkspace};
use crate::sort;

/// Acceleration and braking that coverage flights are planned with, m/s².
pub const PLANNED_ACCEL_MPS2: f32 = 1.5;
/// Longest path, metres: vehicles report their progress to each other in 16 bits, in decimetres.
pub const MAX_PATH_LENGTH_M: f32 = 6_553.0;

/// A vehicle of the mission, beside what it is packed by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pad {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// First point of its path, above the pad. Its place is the vehicle's in [`Work::vehicles`].
    pub start: Point,
    /// Height of that over where the vehicle stands, metres; 0 of one that is in the air.
    pub climb_m: f32,
    /// Height of the last point of its path, above its home, metres up in the mission frame.
    pub end_z_m: f32,
    /// Height of that over the ground there, metres.
    pub descent_m: f32,
    /// Whether it is in the air: without a route it flies home.
    pub aloft: bool,
}

/// How pictures are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Greatest distance from one picture to the next, metres.
    pub waypoint_m: f32,
    /// Heading of the vehicles.
    pub look: Look,
    /// Trigger of the pictures.
    pub trigger: Trigger,
}

/// Inputs of flights beside the routes.
#[derive(Clone, Copy, Debug)]
pub struct Swarm<'a> {
    /// The vehicles, in the order of [`Work::vehicles`].
    pub pads: &'a [Pad],
    /// How pictures are taken.
    pub manner: Manner,
    /// Clearance that every leg is taken to have, metres: there are no walls.
    pub clearance_m: f32,
    /// Separation and nominal speeds; each vehicle's own are those of [`Work::vehicles`].
    pub schedule: ScheduleConfig,
    /// Most gates of one vehicle.
    pub gates_most: usize,
    /// Waypoints of the area that the lanes leave out, in rising order.
    pub done: &'a [Range],
    /// Layers that are not free, a bit each.
    pub layers_held: u64,
    /// Surface that lanes, and paths between them, follow where the ground is not level: all below
    /// the lowest layer.
    pub following: Option<Following<'a>>,
}

/// Flights of all vehicles, flight `i` of vehicle `i`, and when each leaves its pad. One without a route stays there. Of a route
/// with more than `W` corners, or longer than [`MAX_PATH_LENGTH_M`], a flight is the first stretch ([`Photographs::goes_on`]): as many lanes as leave
/// room for the way home. What is left is for the next division ([`super::losses`]).
///
/// # Errors
/// [`PlanError::Path`] for a route of which not one lane fits, [`PlanError::Schedule`] for a vehicle that cannot be kept
/// apart from the others, [`PlanError::Terminals`] where pads, vehicles, routes and lanes do not belong together,
/// [`PlanError::Config`] for a setting, [`PlanError::BadTask`] for a vehicle's, [`PlanError::SameId`].
pub fn plan<const L: usize, const N: usize, const K: usize, const V: usize, const W: usize>(
    work: &Work<'_, L, N>,
    routes: &Plan<K>,
    swarm: &Swarm<'_>,
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    check(work, &routes.routes, swarm)?;
    out.flights.clear();
    let used = |layer: u8| routes.routes.iter().any(|route| route.layer == layer);
    let mut layers = free_layers(swarm.layers_held).filter(|layer| !used(*layer));
    for (index, pad) in swarm.pads.iter().enumerate() {
        let flight = match routes.routes.iter().find(|route| usize::from(route.vehicle) == index) {
            Some(route) => flight(work, route, swarm, pad),
            None if pad.aloft => {
                // Cannot fail: there are more layers than vehicles.
                homeward(work, layers.next().unwrap_or(u8::MAX), &work.vehicles[index], swarm, pad)
            }
            None => grounded(pad),
        };
        let flight = flight.map_err(|e| PlanError::Path(pad.id, e))?;
        out.flights.push(flight).map_err(|_| PlanError::SwarmFull)?;
    }
    depart(swarm, ws, out)?;
    for (index, flight) in out.flights.iter().enumerate() {
        schedule::merged_m(&swarm.schedule, &out.flights, index, swarm.gates_most, ws)
            .map_err(|e| PlanError::Schedule(flight.id, e))?;
    }
    out.seal(&swarm.schedule);
    Ok(())
}

/// Whether every number is one that can be planned with, and all belong together.
fn check<const L: usize, const N: usize>(
    work: &Work<'_, L, N>,
    routes: &[Route],
    swarm: &Swarm<'_>,
) -> Result<(), PlanError> {
    swarm.schedule.check().map_err(PlanError::Config)?;
    let settings = [
        ("mission_m", work.heights.mission_m),
        ("layer_m", work.heights.layer_m),
        ("waypoint_m", swarm.manner.waypoint_m),
    ];
    crate::all_positive(&settings).map_err(PlanError::Config)?;
    let all = work.tracks.waypoint_count();
    let within = |route: &Route| {
        route.first < route.end && route.end <= all && usize::from(route.vehicle) < work.vehicles.len()
    };
    if swarm.pads.len() != work.vehicles.len() || !routes.iter().all(within) || !divide::in_order(swarm.done)
    {
        return Err(PlanError::Terminals);
    }
    for (index, (pad, vehicle)) in swarm.pads.iter().zip(work.vehicles).enumerate() {
        let speeds = [
            ("cruise_mps", vehicle.cruise_mps),
            ("climb_mps", vehicle.climb_mps),
            ("descend_mps", vehicle.descend_mps),
        ];
        let heights = [pad.climb_m, pad.descent_m];
        let places =
            pad.start.iter().chain(vehicle.place.iter()).chain(vehicle.home.iter()).chain([&pad.end_z_m]);
        if crate::all_positive(&speeds).is_err()
            || !heights.iter().all(|height_m| *height_m >= 0.0 && height_m.is_finite())
            || !places.into_iter().all(|place| place.is_finite())
        {
            return Err(PlanError::BadTask(pad.id));
        }
        if swarm.pads[..index].iter().any(|other| other.id == pad.id) {
            return Err(PlanError::SameId(pad.id));
        }
    }
    Ok(())
}

/// The layers that no vehicle holds, from the lowest on.
pub(super) fn free_layers(held: u64) -> impl Iterator<Item = u8> {
    (1..64).filter(move |layer| held >> layer & 1 == 0)
}

/// The vehicle that flies longest leaves first, each other one as early as those before it allow. One that they leave no
/// departure goes before all of them, and the search begins again.
fn depart<const V: usize, const W: usize>(
    swarm: &Swarm<'_>,
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let cfg = &swarm.schedule;
    let mut order: Vec<(bool, f32, u16), V> = Vec::new();
    for (flight, i) in out.flights.iter().zip(0..) {
        // Cannot overflow: one entry a flight.
        let _ = order.push((flight.task.flies(), flight.lasts_s(cfg), i));
    }
    // Whoever stays on its pad is there before all others.
    sort::by(&mut order, |a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
    let stay = order.iter().filter(|(flies, ..)| !flies).count();
    let mut tries = order.len();
    while let Err((place, error)) = depart_in_order(cfg, &order, ws, out) {
        tries = tries.saturating_sub(1);
        if tries == 0 || place == stay || error != ScheduleError::Blocked {
            return Err(PlanError::Schedule(out.flights[usize::from(order[place].2)].id, error));
        }
        order[stay..=place].rotate_right(1);
    }
    Ok(())
}

/// Lets vehicles leave in this order; the place of the first that cannot.
fn depart_in_order<const V: usize, const W: usize>(
    cfg: &ScheduleConfig,
    order: &[(bool, f32, u16)],
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), (usize, ScheduleError)> {
    for (place, &(flies, _, i)) in order.iter().enumerate() {
        if !flies {
            continue;
        }
        let before = order[..place].iter().map(|&(_, _, j)| &out.flights[usize::from(j)]);
        let flight = &out.flights[usize::from(i)];
        let departure = schedule::earliest_departure(cfg, flight, 0.0, before, ws);
        out.flights[usize::from(i)].depart_s = departure.map_err(|error| (place, error))?;
    }
    Ok(())
}

fn at(place: &Flat, height_m: f32) -> Point {
    Point::new(place.x, place.y, height_m)
}

/// A vehicle that stays on its pad.
fn grounded<const W: usize>(pad: &Pad) -> Result<Flight<W>, PathError> {
    let mut path = Path::new();
    path.push(pad.start, 0.0)?;
    let Pad { id, climb_m, .. } = *pad;
    Ok(Flight {
        id,
        task: Task::Stay,
        path,
        climb_m,
        descent_m: 0.0,
        depart_s: 0.0,
        piece_m: MAX_TIMED_SEGMENT_M,
    })
}

/// A path under construction.
struct Draft<'a, const N: usize, const W: usize> {
    path: Path<W>,
    transit: &'a Transit<'a, N>,
    clearance_m: f32,
    following: Option<Following<'a>>,
    /// Place that the flight has reached.
    here: Point,
}

impl<'a, const N: usize, const W: usize> Draft<'a, N, W> {
    /// Above a pad.
    fn begin<const L: usize>(work: &Work<'a, L, N>, swarm: &Swarm<'a>, pad: &Pad) -> Result<Self, PathError> {
        let Swarm { clearance_m, following, .. } = *swarm;
        let mut draft =
            Self { path: Path::new(), transit: work.transit, clearance_m, following, here: pad.start };
        draft.to(pad.start)?;
        Ok(draft)
    }

    /// Flies straight to a place; the index of its waypoint.
    fn to(&mut self, place: Point) -> Result<usize, PathError> {
        self.path.push(place, self.clearance_m)?;
        self.here = place;
        self.path.last().ok_or(PathError::NotFinite)
    }

    /// The corners of the way around no-fly zones, and its end.
    fn way(&self, to: &Flat) -> impl Iterator<Item = Flat> + use<N, W> {
        let mut corners: Vec<Flat, N> = Vec::new();
        // The plan has a finite length, so there is a way between all that it joins.
        if self.transit.way(&self.here.xy(), to, &mut corners).is_err() {
            corners.clear();
        }
        corners.into_iter().chain([*to])
    }

    /// Flies there around no-fly zones, all at one height.
    fn around(&mut self, to: &Flat, height_m: f32) -> Result<(), PathError> {
        self.way(to).try_for_each(|corner| self.to(at(&corner, height_m)).map(|_| ()))
    }

    /// Comes down to where the first lane begins, which leads to `end`; the index of that waypoint.
    fn down(&mut self, end: &Flat, mission_m: f32) -> Result<usize, PathError> {
        let here = self.here.xy();
        let begin = self.following.map_or(at(&here, mission_m), |following| following.begin(&here, end));
        self.to(begin)
    }

    /// Flies there straight as low as pictures are taken; the index of its waypoint.
    fn low(&mut self, to: &Flat, mission_m: f32) -> Result<usize, PathError> {
        let Some(following) = self.following else { return self.to(at(to, mission_m)) };
        let here = self.here;
        following.to(&here, to, |corner| self.to(corner).map(|_| ()))?;
        self.path.last().ok_or(PathError::NotFinite)
    }

    /// As `low`, around no-fly zones.
    fn low_around(&mut self, to: &Flat, mission_m: f32) -> Result<usize, PathError> {
        self.way(to).try_for_each(|corner| self.low(&corner, mission_m).map(|_| ()))?;
        self.path.last().ok_or(PathError::NotFinite)
    }
}

/// How long a leg takes that is flown no faster than `most_mps` and from rest to rest: at its corners a vehicle nearly
/// stops. Seconds.
fn leg_s(length_m: f32, most_mps: f32) -> f32 {
    if length_m * PLANNED_ACCEL_MPS2 > most_mps * most_mps {
        length_m / most_mps + most_mps / PLANNED_ACCEL_MPS2
    } else {
        2.0 * libm::sqrtf(length_m / PLANNED_ACCEL_MPS2)
    }
}

/// The first and the last waypoint of a lane that are the route's.
fn part_of(lane: &Lane, route: &Route) -> (u32, u32) {
    (lane.first.max(route.first), (lane.first + lane.count).min(route.end) - 1)
}

/// Heading of a vehicle on this route. A lane of one waypoint has no direction of its own: with the heading along the path, such a
/// route keeps the direction of the other lanes all the way.
fn look<const L: usize, const N: usize>(work: &Work<'_, L, N>, route: &Route, swarm: &Swarm<'_>) -> Look {
    let lanes = work.tracks.lane_of(route.first)..=work.tracks.lane_of(route.end - 1);
    let alone = |lane: usize| {
        let lane = work.tracks.lanes().get(lane);
        lane.is_some_and(|lane| matches!(part_of(lane, route), (begin, end) if begin == end))
    };
    let along = work.tracks.along();
    match swarm.manner.look {
        Look::Ahead if lanes.into_iter().any(alone) => Look::Fixed(libm::atan2f(along.y, along.x)),
        look => look,
    }
}

/// The flight of one route, or of its first stretch.
fn flight<const L: usize, const N: usize, const W: usize>(
    work: &Work<'_, L, N>,
    route: &Route,
    swarm: &Swarm<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let mut most = work.tracks.lane_of(route.end - 1) - work.tracks.lane_of(route.first) + 1;
    loop {
        let mut laid = 0;
        let error = match stretch(work, route, swarm, pad, (most, &mut laid)) {
            Ok(flight) if flight.path.length_m() <= MAX_PATH_LENGTH_M => return Ok(flight),
            Ok(flight) => {
                laid = (most as f32 * MAX_PATH_LENGTH_M / flight.path.length_m()) as usize;
                PathError::TooLong
            }
            Err(error) => error,
        };
        // The way home takes room as well.
        most = laid.min(most - 1);
        if most == 0 || error == PathError::NotFinite {
            return Err(error);
        }
    }
}

/// The flight along so many lanes of a route. `laid` becomes how many of them had room, if not the way home.
fn stretch<const L: usize, const N: usize, const W: usize>(
    work: &Work<'_, L, N>,
    route: &Route,
    swarm: &Swarm<'_>,
    pad: &Pad,
    (most, laid): (usize, &mut usize),
) -> Result<Flight<W>, PathError> {
    let vehicle = &work.vehicles[usize::from(route.vehicle)];
    let Manner { waypoint_m, trigger, .. } = swarm.manner;
    let look = look(work, route, swarm);
    let done = swarm.done.iter().map(|range| range.end - range.first).fold(0, u32::saturating_add);
    let area = work.tracks.waypoint_count().saturating_add(done);
    let backward = route.heading == Heading::Backward;
    let mut photographs = Photographs::new(waypoint_m, look, trigger).of_area(area, backward);
    let mission_m = work.heights.mission_m;
    let layer_m = mission_m + f32::from(route.layer) * work.heights.layer_m;
    let place = |number: u32| work.tracks.waypoint(number).ok_or(PathError::NotFinite);
    let mut draft = Draft::begin(work, swarm, pad)?;
    draft.to(at(&vehicle.place, layer_m))?;
    draft.around(&place(route.ends().0)?, layer_m)?;
    let lanes = work.tracks.lane_of(route.first)..=work.tracks.lane_of(route.end - 1);
    let (low, high) = (*lanes.start(), *lanes.end());
    photographs.goes_on = most <= high - low;
    for lane in lanes.take(most) {
        let lane = if backward { high - (lane - low) } else { lane };
        let Some(lane) = work.tracks.lanes().get(lane) else { continue };
        let (begin, end) = part_of(lane, route);
        let first = divide::original(swarm.done, begin);
        let waypoints = Range { first, end: first.saturating_add(end + 1 - begin) };
        let (begin, end) = if backward { (end, begin) } else { (begin, end) };
        let (begin, end) = (place(begin)?, place(end)?);
        let from = match *laid {
            0 => draft.down(&end, mission_m)?,
            _ => draft.low_around(&begin, mission_m)?,
        };
        let to = draft.low(&end, mission_m)?;
        photographs.mark(from, to, waypoints)?;
        *laid += 1;
    }
    land(draft, &WayHome { layer_m, vehicle, photographs }, swarm, pad)
}

/// The flight home of a vehicle in the air that has no route: it photographs nothing.
fn homeward<const L: usize, const N: usize, const W: usize>(
    work: &Work<'_, L, N>,
    layer: u8,
    vehicle: &Vehicle,
    swarm: &Swarm<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let Manner { waypoint_m, look, trigger } = swarm.manner;
    let layer_m = work.heights.mission_m + f32::from(layer) * work.heights.layer_m;
    let draft = Draft::begin(work, swarm, pad)?;
    let photographs = Photographs::new(waypoint_m, look, trigger);
    land(draft, &WayHome { layer_m, vehicle, photographs }, swarm, pad)
}

/// A vehicle's way home.
struct WayHome<'a> {
    /// Layer of the flight.
    layer_m: f32,
    vehicle: &'a Vehicle,
    /// Pictures taken by then.
    photographs: Photographs,
}

/// Ends a flight: up, home in the layer, down, and labelled.
fn land<const N: usize, const W: usize>(
    mut draft: Draft<'_, N, W>,
    way_home: &WayHome<'_>,
    swarm: &Swarm<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let WayHome { layer_m, vehicle, photographs } = *way_home;
    draft.to(at(&draft.here.xy(), layer_m))?;
    draft.around(&vehicle.home, layer_m)?;
    draft.to(at(&vehicle.home, pad.end_z_m))?;
    let mut path = draft.path;
    let seconds = |from: &Point, to: &Point| {
        let (way_m, up_m) = ((to - from).xy().norm(), to.z - from.z);
        let z_mps = if up_m > 0.0 { vehicle.climb_mps } else { vehicle.descend_mps };
        leg_s(way_m, vehicle.cruise_mps) + leg_s(libm::fabsf(up_m), z_mps)
    };
    path.label_by(pad.climb_m / swarm.schedule.vertical_mps, seconds);
    let mut flight = Flight {
        id: pad.id,
        task: Task::Photograph(photographs),
        path,
        climb_m: pad.climb_m,
        descent_m: pad.descent_m,
        depart_s: 0.0,
        piece_m: MAX_TIMED_SEGMENT_M,
    };
    flight.fit_pieces();
    Ok(flight)
}
