//! Flights of a coverage mission: each vehicle's path along its route, and the order of take-offs.
//!
//! Source: paper CPP §3.2: climb to the vehicle's own layer, transit, descent, lanes, climb,
//! transit home in the layer, descent. Take-off ends and landing begins close above the pad: all
//! between is path, on which the vehicle can wait. [`crate::schedule`] separates the flights as in
//! any other mission: the vehicle with the longest flight takes off first, each other one as early
//! as those before it allow, and gates keep that order in the air.

mod builder;

use heapless::Vec;

use self::builder::{FlightPathBuilder, point_at_height};
use super::divide;
use super::lanes::Lane;
use super::pack::{CoverageProblem, Route, RouteDirection, RoutePlan, Vehicle};
use crate::flight::{
    Flight, HeadingMode, Path, PathError, PicturePlan, Task, Trigger, WaypointOrder, WaypointRange,
};
use crate::map::field::follow::TerrainFollowing;
use crate::plan::{PlanError, SwarmPlan};
use crate::schedule::{
    self, DEFAULT_MAX_SEGMENT_M, ScheduleConfig, ScheduleError, ScheduleWorkspace,
};
use crate::sort;
use crate::{Length, Point};

/// Acceleration and braking that missions are planned with, m/s².
pub const PLANNED_ACCEL_MPS2: f32 = 1.5;
/// Longest path, metres: vehicles report progress to each other in decimetres, in 16 bits.
pub const MAX_PATH_LENGTH_M: f32 = 6_553.0;

/// A vehicle's pad, and the heights of its take-off and of its landing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pad {
    /// Id of the vehicle, unique in the swarm.
    pub vehicle_id: u8,
    /// First point of the vehicle's path, over [`Vehicle::transit_start`]: above the pad, or where
    /// a vehicle in the air holds; ENU metres.
    pub path_start: Point,
    /// Height of `path_start` above the pad, metres; 0 for a vehicle in the air.
    pub climb_m: f32,
    /// Height of the path's last point, which is over the vehicle's home: z in the mission frame,
    /// metres.
    pub path_end_z_m: f32,
    /// Height of the path's last point above the ground below it, metres.
    pub descent_m: f32,
    /// Whether the vehicle is in the air: without a route it flies home.
    pub airborne: bool,
}

/// Settings of the camera during a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaptureSettings {
    /// Greatest distance over ground between neighbouring pictures, metres.
    pub max_picture_spacing_m: f32,
    /// Heading of the vehicles while they photograph.
    pub heading_mode: HeadingMode,
    /// How the cameras are triggered.
    pub trigger: Trigger,
}

/// Inputs of [`plan_flights`] besides the routes.
#[derive(Clone, Copy, Debug)]
pub struct FlightInputs<'a> {
    /// The vehicles' pads, in the order of [`CoverageProblem::vehicles`].
    pub pads: &'a [Pad],
    /// Settings of the camera during a flight.
    pub capture: CaptureSettings,
    /// Clearance that every leg is taken to have, metres: there are no walls.
    pub assumed_clearance_m: f32,
    /// Separations and nominal speeds; legs are timed by the speeds in
    /// [`CoverageProblem::vehicles`].
    pub schedule: ScheduleConfig,
    /// Most gates that a vehicle may have.
    pub max_gates: usize,
    /// Waypoints of the area that are photographed or promised, by their numbers on the path over
    /// the whole area, ascending: the lanes do not contain them.
    pub done_waypoints: &'a [WaypointRange],
    /// Transit layers in which no vehicle may fly home, since a lost vehicle may be in them: bit
    /// `i` is layer `i`.
    pub occupied_layers: u64,
    /// Height band above terrain that lanes and paths between them follow, all below the lowest
    /// layer. `None` over level ground.
    pub following: Option<TerrainFollowing<'a>>,
}

/// Plans the flights of all vehicles, flight `i` for vehicle `i`, with their take-off times. A
/// vehicle on its pad without a route stays there. If the path of a route has more waypoints or
/// lanes than `W` and a [`PicturePlan`] allow, or is longer than [`MAX_PATH_LENGTH_M`], the flight
/// covers the route's first lanes only ([`PicturePlan::is_first_part`]): as many as leave room for
/// the path home. The next division ([`super::losses`]) divides the other lanes.
///
/// # Errors
/// [`PlanError::Path`] for a route of which not one lane fits, [`PlanError::Schedule`] for a
/// vehicle that cannot be kept apart from the others, [`PlanError::CountMismatch`] if pads,
/// vehicles, routes and lanes are inconsistent, [`PlanError::Config`] for a setting,
/// [`PlanError::BadTask`] for a setting of a vehicle, [`PlanError::SameId`].
pub fn plan_flights<
    const L: usize,
    const N: usize,
    const K: usize,
    const V: usize,
    const W: usize,
>(
    problem: &CoverageProblem<'_, L, N>,
    routes: &RoutePlan<K>,
    inputs: &FlightInputs<'_>,
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    check_inputs(problem, &routes.routes, inputs)?;
    out.flights.clear();
    let used = |layer: u8| routes.routes.iter().any(|route| route.layer == layer);
    let mut layers = free_layers(inputs.occupied_layers).filter(|layer| !used(*layer));
    for (index, pad) in inputs.pads.iter().enumerate() {
        let flight =
            match routes.routes.iter().find(|route| usize::from(route.vehicle_index) == index) {
                Some(route) => route_flight(problem, route, inputs, pad),
                None if pad.airborne => {
                    // Cannot fail: there are more layers than vehicles.
                    flight_home(
                        problem,
                        layers.next().unwrap_or(u8::MAX),
                        &problem.vehicles[index],
                        inputs,
                        pad,
                    )
                }
                None => grounded_flight(pad),
            };
        let flight = flight.map_err(|e| PlanError::Path(pad.vehicle_id, e))?;
        out.flights.push(flight).map_err(|_| PlanError::SwarmFull)?;
    }
    let most_gates = schedule_departures(inputs, ws, out)?;
    let crowded = |index: &usize| most_gates[*index] as usize > inputs.max_gates;
    for (index, flight) in out.flights.iter().enumerate().filter(|(index, _)| crowded(index)) {
        schedule::gate_merge_distance_m(
            &inputs.schedule,
            &out.flights,
            index,
            inputs.max_gates,
            ws,
        )
        .map_err(|e| PlanError::Schedule(flight.vehicle_id, e))?;
    }
    out.set_crc(&inputs.schedule);
    Ok(())
}

/// Checks that all numbers are in range and that the inputs are consistent.
fn check_inputs<const L: usize, const N: usize>(
    problem: &CoverageProblem<'_, L, N>,
    routes: &[Route],
    inputs: &FlightInputs<'_>,
) -> Result<(), PlanError> {
    inputs.schedule.check().map_err(PlanError::Config)?;
    let settings = [
        ("mission_m", problem.heights.max_picture_height_m),
        ("layer_m", problem.heights.layer_spacing_m),
        ("waypoint_m", inputs.capture.max_picture_spacing_m),
    ];
    crate::check_positive(&settings).map_err(PlanError::Config)?;
    let all = problem.tracks.waypoint_count();
    let within = |route: &Route| {
        route.lowest_waypoint < route.waypoint_end
            && route.waypoint_end <= all
            && usize::from(route.vehicle_index) < problem.vehicles.len()
    };
    if inputs.pads.len() != problem.vehicles.len()
        || !routes.iter().all(within)
        || !divide::is_sorted_disjoint(inputs.done_waypoints)
    {
        return Err(PlanError::CountMismatch);
    }
    for (index, (pad, vehicle)) in inputs.pads.iter().zip(problem.vehicles).enumerate() {
        let speeds = [
            ("cruise_mps", vehicle.cruise_mps),
            ("climb_mps", vehicle.climb_mps),
            ("descend_mps", vehicle.descend_mps),
        ];
        let heights = [pad.climb_m, pad.descent_m];
        let places = pad
            .path_start
            .iter()
            .chain(vehicle.transit_start.iter())
            .chain(vehicle.home.iter())
            .chain([&pad.path_end_z_m]);
        if crate::check_positive(&speeds).is_err()
            || !heights.iter().all(|height_m| *height_m >= 0.0 && height_m.is_finite())
            || !places.into_iter().all(|place| place.is_finite())
        {
            return Err(PlanError::BadTask(pad.vehicle_id));
        }
        if inputs.pads[..index].iter().any(|other| other.vehicle_id == pad.vehicle_id) {
            return Err(PlanError::SameId(pad.vehicle_id));
        }
    }
    Ok(())
}

/// The transit layers whose bit in `held` is 0, from the lowest one, layer 1, on.
pub(super) fn free_layers(held: u64) -> impl Iterator<Item = u8> {
    (1..64).filter(move |layer| held >> layer & 1 == 0)
}

/// Schedules the vehicle that flies longest first, each other one to take off as early as those
/// before it allow. A vehicle for which those before leave no take-off time is moved to the front,
/// and all are scheduled again. Returns for each flight an upper bound of its number of gates.
fn schedule_departures<const V: usize, const W: usize>(
    inputs: &FlightInputs<'_>,
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<[u32; V], PlanError> {
    let cfg = &inputs.schedule;
    // Whether the vehicle leaves its pad, the flight's duration in seconds, and the flight's index.
    let mut order: Vec<(bool, f32, u16), V> = Vec::new();
    for (flight, i) in out.flights.iter().zip(0..) {
        // Cannot overflow: one entry per flight.
        let _ = order.push((flight.task.leaves_pad(), flight.duration_s(cfg), i));
    }
    // Vehicles that stay on their pads are scheduled before all others.
    sort::heapsort_by(&mut order, |a, b| {
        a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2))
    });
    let stay = order.iter().filter(|(flies, ..)| !flies).count();
    let mut tries = order.len();
    loop {
        match schedule_in_order(cfg, &order, ws, out) {
            Ok(most_gates) => return Ok(most_gates),
            Err((place, error)) => {
                tries = tries.saturating_sub(1);
                if tries == 0 || place == stay || error != ScheduleError::Blocked {
                    return Err(PlanError::Schedule(
                        out.flights[usize::from(order[place].2)].vehicle_id,
                        error,
                    ));
                }
                order[stay..=place].rotate_right(1);
            }
        }
    }
}

/// Sets take-off times in this order. Returns for each flight an upper bound of its number of
/// gates, or the place in `order` of the first vehicle that has no take-off time, and the reason.
fn schedule_in_order<const V: usize, const W: usize>(
    cfg: &ScheduleConfig,
    order: &[(bool, f32, u16)],
    ws: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<[u32; V], (usize, ScheduleError)> {
    let mut most_gates = [0; V];
    for (place, &(flies, _, i)) in order.iter().enumerate() {
        if !flies {
            continue;
        }
        let index = |place: usize| usize::from(order[place].2);
        let mut before = (0..place).map(|place| &out.flights[index(place)]);
        let flight = &out.flights[usize::from(i)];
        let mut count = |place: usize, [own, theirs]: [u32; 2]| {
            most_gates[usize::from(i)] += own;
            most_gates[index(place)] += theirs;
        };
        let departure = schedule::departure_with_conflict_counts(
            cfg,
            flight,
            (0.0, 0.0),
            &mut before,
            ws,
            &mut count,
        );
        out.flights[usize::from(i)].depart_s = departure.map_err(|error| (place, error))?;
    }
    Ok(most_gates)
}

/// The flight of a vehicle that stays on its pad: one waypoint above the pad.
fn grounded_flight<const W: usize>(pad: &Pad) -> Result<Flight<W>, PathError> {
    let mut path = Path::new();
    path.push(pad.path_start, 0.0)?;
    let Pad { vehicle_id: id, climb_m, .. } = *pad;
    Ok(Flight {
        vehicle_id: id,
        task: Task::Stay,
        path,
        climb_m,
        descent_m: 0.0,
        depart_s: 0.0,
        max_segment_m: DEFAULT_MAX_SEGMENT_M,
    })
}

/// Duration of a leg flown at up to `most_mps`, seconds: from rest to rest, since a vehicle nearly
/// stops at corners.
fn leg_duration_s(length_m: f32, most_mps: f32) -> f32 {
    if length_m * PLANNED_ACCEL_MPS2 > most_mps * most_mps {
        length_m / most_mps + most_mps / PLANNED_ACCEL_MPS2
    } else {
        2.0 * fpu::sqrtf(length_m / PLANNED_ACCEL_MPS2)
    }
}

/// Numbers of the first and the last waypoint, both inclusive, of a lane that belong to the route.
fn route_waypoints_on_lane(lane: &Lane, route: &Route) -> (u32, u32) {
    (
        lane.first_waypoint.max(route.lowest_waypoint),
        (lane.first_waypoint + lane.waypoint_count).min(route.waypoint_end) - 1,
    )
}

/// Heading of a vehicle on this route, as set in the inputs. But if the heading is to follow the
/// path, and the route has only one waypoint on some lane, that lane gives no direction: then the
/// heading is fixed to the direction of the lanes for the whole flight.
fn heading_mode<const L: usize, const N: usize>(
    problem: &CoverageProblem<'_, L, N>,
    route: &Route,
    inputs: &FlightInputs<'_>,
) -> HeadingMode {
    let lanes = problem.tracks.lane_of(route.lowest_waypoint)
        ..=problem.tracks.lane_of(route.waypoint_end - 1);
    let alone = |lane: usize| {
        let lane = problem.tracks.lanes().get(lane);
        lane.is_some_and(
            |lane| matches!(route_waypoints_on_lane(lane, route), (begin, end) if begin == end),
        )
    };
    let along = problem.tracks.lane_direction();
    match inputs.capture.heading_mode {
        HeadingMode::Ahead if lanes.into_iter().any(alone) => {
            HeadingMode::FixedEnuRad(libm::atan2f(along.y, along.x))
        }
        look => look,
    }
}

/// The flight along a route, or along its first lanes if the whole route does not fit.
fn route_flight<const L: usize, const N: usize, const W: usize>(
    problem: &CoverageProblem<'_, L, N>,
    route: &Route,
    inputs: &FlightInputs<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let mut most = problem.tracks.lane_of(route.waypoint_end - 1)
        - problem.tracks.lane_of(route.lowest_waypoint)
        + 1;
    loop {
        let mut laid = 0;
        let error = match partial_route_flight(problem, route, inputs, pad, (most, &mut laid)) {
            Ok(flight) if flight.path.length_m() <= MAX_PATH_LENGTH_M => return Ok(flight),
            Ok(flight) => {
                laid = (most as f32 * MAX_PATH_LENGTH_M / flight.path.length_m()) as usize;
                PathError::TooLong
            }
            Err(error) => error,
        };
        // The path home needs room as well, so at least one lane fewer is tried.
        most = laid.min(most - 1);
        if most == 0 || error == PathError::NotFinite {
            return Err(error);
        }
    }
}

/// The flight along the first `most` lanes of a route. `laid` becomes the number of lanes for which
/// the path had room, whether or not the path home had room too.
fn partial_route_flight<const L: usize, const N: usize, const W: usize>(
    problem: &CoverageProblem<'_, L, N>,
    route: &Route,
    inputs: &FlightInputs<'_>,
    pad: &Pad,
    (most, laid): (usize, &mut usize),
) -> Result<Flight<W>, PathError> {
    let vehicle = &problem.vehicles[usize::from(route.vehicle_index)];
    let CaptureSettings { max_picture_spacing_m: waypoint_m, trigger, .. } = inputs.capture;
    let look = heading_mode(problem, route, inputs);
    let done = inputs
        .done_waypoints
        .iter()
        .map(|range| range.end - range.first)
        .fold(0, u32::saturating_add);
    let area = problem.tracks.waypoint_count().saturating_add(done);
    let backward = route.direction == RouteDirection::Backward;
    let order = if backward { WaypointOrder::Falling } else { WaypointOrder::Rising };
    let mut photographs =
        PicturePlan::new(waypoint_m, look, trigger).with_area_waypoints(area, order);
    let max_picture_height_m = problem.heights.max_picture_height_m;
    let layer_z_m = max_picture_height_m + f32::from(route.layer) * problem.heights.layer_spacing_m;
    let place = |number: u32| problem.tracks.waypoint(number).ok_or(PathError::NotFinite);
    let mut draft = FlightPathBuilder::new(
        problem.transit,
        inputs.assumed_clearance_m,
        inputs.following,
        pad.path_start,
    );
    draft.add_straight_leg(pad.path_start)?;
    draft.add_straight_leg(point_at_height(&vehicle.transit_start, layer_z_m))?;
    draft.add_legs_around_zones(&place(route.first_and_last().0)?, layer_z_m)?;
    let lanes = problem.tracks.lane_of(route.lowest_waypoint)
        ..=problem.tracks.lane_of(route.waypoint_end - 1);
    let (low, high) = (*lanes.start(), *lanes.end());
    photographs.is_first_part = most <= high - low;
    for lane in lanes.take(most) {
        let lane = if backward { high - (lane - low) } else { lane };
        let Some(lane) = problem.tracks.lanes().get(lane) else { continue };
        let (begin, end) = route_waypoints_on_lane(lane, route);
        let first = divide::number_on_whole_path(inputs.done_waypoints, begin);
        let waypoints = WaypointRange { first, end: first.saturating_add(end + 1 - begin) };
        let (begin, end) = if backward { (end, begin) } else { (begin, end) };
        let (begin, end) = (place(begin)?, place(end)?);
        let from = match *laid {
            0 => draft.descend_to_lane(&end, max_picture_height_m)?,
            _ => draft.add_picture_legs_around_zones(&begin, max_picture_height_m)?,
        };
        let to = draft.add_picture_leg(&end, max_picture_height_m)?;
        photographs.add_stretch(from, to, waypoints)?;
        *laid += 1;
    }
    finish_with_return(draft, &ReturnInputs { layer_z_m, vehicle, photographs }, inputs, pad)
}

/// The flight home of a vehicle in the air without a route; it takes no pictures.
fn flight_home<const L: usize, const N: usize, const W: usize>(
    problem: &CoverageProblem<'_, L, N>,
    layer: u8,
    vehicle: &Vehicle,
    inputs: &FlightInputs<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let CaptureSettings { max_picture_spacing_m: waypoint_m, heading_mode: look, trigger } =
        inputs.capture;
    let layer_z_m =
        problem.heights.max_picture_height_m + f32::from(layer) * problem.heights.layer_spacing_m;
    let mut draft = FlightPathBuilder::new(
        problem.transit,
        inputs.assumed_clearance_m,
        inputs.following,
        pad.path_start,
    );
    draft.add_straight_leg(pad.path_start)?;
    let photographs = PicturePlan::new(waypoint_m, look, trigger);
    finish_with_return(draft, &ReturnInputs { layer_z_m, vehicle, photographs }, inputs, pad)
}

/// Inputs for the end of a flight, from the last lane to home.
struct ReturnInputs<'a> {
    /// Height of the transit layer, metres up in the mission frame.
    layer_z_m: f32,
    /// The vehicle that flies home.
    vehicle: &'a Vehicle,
    /// The pictures of the whole flight.
    photographs: PicturePlan,
}

/// Ends a flight: climb to the layer, transit home, descent; then sets the times of its waypoints.
fn finish_with_return<const N: usize, const W: usize>(
    mut draft: FlightPathBuilder<'_, N, W>,
    way_home: &ReturnInputs<'_>,
    inputs: &FlightInputs<'_>,
    pad: &Pad,
) -> Result<Flight<W>, PathError> {
    let ReturnInputs { layer_z_m, vehicle, .. } = *way_home;
    draft.add_straight_leg(point_at_height(&draft.here.xy(), layer_z_m))?;
    draft.add_legs_around_zones(&vehicle.home, layer_z_m)?;
    draft.add_straight_leg(point_at_height(&vehicle.home, pad.path_end_z_m))?;
    let seconds = |from: &Point, to: &Point| {
        let (way_m, up_m) = ((to - from).xy().length(), to.z - from.z);
        let z_mps = if up_m > 0.0 { vehicle.climb_mps } else { vehicle.descend_mps };
        leg_duration_s(way_m, vehicle.cruise_mps) + leg_duration_s(libm::fabsf(up_m), z_mps)
    };
    draft.path.set_times_by_leg(pad.climb_m / inputs.schedule.vertical_mps, seconds);
    let mut flight = Flight {
        vehicle_id: pad.vehicle_id,
        task: Task::Photograph(way_home.photographs),
        path: draft.path,
        climb_m: pad.climb_m,
        descent_m: pad.descent_m,
        depart_s: 0.0,
        max_segment_m: DEFAULT_MAX_SEGMENT_M,
    };
    flight.choose_segment_length();
    Ok(flight)
}
