//! Cuts a route that takes longer than a battery lasts into sorties, between its lanes. Each sortie
//! flies from the pad and back to it, in the route's layer.
//!
//! Of all cuts with the fewest sorties, dynamic programming over the lanes finds the one with the
//! least total time. Adding a lane never shortens a sortie, since its transits are shortest paths.
//! So the search backwards for a sortie's first lane ends at the first lane that is too far back.
//! That takes n · m steps for n lanes of which at most m fit into a sortie.
//!
//! Sorties are flown in rounds: the k-th sorties of all vehicles form a round, which begins
//! [`BATTERY_SWAP_S`] after the last vehicle of the round before has landed. So departures keep
//! vehicles apart within a round, however long a swap really takes. Units: seconds, metres.
//!
//! The cost C_k of paper CPP has one climb, one descent and no turns. The battery has to last for
//! what is really flown: also the descent from the layer to the lanes, the climb back, and turns
//! from rest to rest.

use planner_core::coverage::flights::PLANNED_ACCEL_MPS2;
use planner_core::coverage::pack::Route;

use super::CoveragePlan;
use super::flight::WaypointAction;
pub use super::planned::Sortie;

/// Share of its battery charge that a vehicle may use before it lands (`FLK_BATT_LOW`).
pub const USABLE_CHARGE: f32 = 0.85;
/// Planned time from a landing to the next start with another battery, seconds.
pub const BATTERY_SWAP_S: f32 = 120.0;

/// A single sortie that flies the whole route.
pub(super) fn whole_route_sortie(planned: &CoveragePlan<'_>, route: Route) -> Sortie {
    Sortie {
        route,
        number: 1,
        sorties_of_vehicle: 1,
        round_begin_s: 0.0,
        departure_delay_s: 0.0,
        flight_duration_s: route_duration_s(planned, &route),
    }
}

/// Power that a vehicle is assumed to draw at `speed_mps`, as a multiple of its power in a hover.
pub fn power_ratio_at_speed(speed_mps: f32) -> f32 {
    1.0 + 0.004 * speed_mps * speed_mps
}

/// Time of a route from pad to pad, seconds: at cruise speed, from rest to rest on each horizontal
/// leg.
pub fn route_duration_s(planned: &CoveragePlan<'_>, route: &Route) -> f32 {
    let index = usize::from(route.vehicle_index);
    let (vehicle, heights) = (&planned.vehicles[index], planned.area_settings.heights);
    let over_lanes_m = f32::from(route.layer) * heights.layer_spacing_m;
    let top_m = heights.max_picture_height_m + over_lanes_m;
    let up_m = (top_m - planned.scenario.vehicles[index].start.z).abs() + over_lanes_m;
    let level_s = route.ground_length_m / vehicle.cruise_mps + stops_extra_s(planned, route);
    if planned.terrain_following.is_some() {
        return level_s + vertical_and_corner_time_s(planned, route);
    }
    level_s + up_m / vehicle.climb_mps + up_m / vehicle.descend_mps
}

/// Time of all climbs and descents of a flight over terrain, each as if flown alone, and of stops
/// at the corners at which its path rises or falls, seconds.
fn vertical_and_corner_time_s(planned: &CoveragePlan<'_>, route: &Route) -> f32 {
    let vehicle = &planned.vehicles[usize::from(route.vehicle_index)];
    let points = super::flight::flight_points(planned, route);
    let ups = points.windows(2).map(|pair| match pair[1].position.z - pair[0].position.z {
        up_m if up_m > 0.0 => up_m / vehicle.climb_mps,
        down_m => -down_m / vehicle.descend_mps,
    });
    let corners =
        points.iter().filter(|point| point.action == WaypointAction::AtLaneHeight).count() as f32;
    ups.sum::<f32>() + corners * vehicle.cruise_mps / PLANNED_ACCEL_MPS2
}

/// Extra time of stops at both ends of each lane and above the pad, seconds. Lanes and transits
/// from and to the pad are assumed long enough to reach cruise speed.
fn stops_extra_s(planned: &CoveragePlan<'_>, route: &Route) -> f32 {
    let cruise_mps = planned.vehicles[usize::from(route.vehicle_index)].cruise_mps;
    let [from, to] = [route.lowest_waypoint, route.waypoint_end - 1]
        .map(|number| planned.tracks.lane_of(number));
    let lanes = (to - from + 1) as f32;
    let stop_s = cruise_mps / PLANNED_ACCEL_MPS2;
    // The path from one lane to the next may be too short to reach cruise speed.
    let step_m = planned.area_settings.spacing.max_lane_spacing_m.min(cruise_mps * stop_s);
    let step_s = 2.0 * (step_m / PLANNED_ACCEL_MPS2).sqrt() - step_m / cruise_mps;
    (lanes + 2.0) * stop_s + (lanes - 1.0) * step_s
}

/// Error: a lane that takes longer than a battery lasts, flown alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneTooLong {
    /// Index of the lane in the path.
    pub lane: usize,
    /// Time from the pad to the lane, along it and home, seconds.
    pub takes_s: f32,
}

/// Cuts a route into the fewest parts that take at most `most_s` seconds each, in the order in
/// which they are flown.
///
/// # Errors
/// A single lane takes longer than `most_s`.
pub fn cut_route(
    planned: &CoveragePlan<'_>,
    route: &Route,
    most_s: f32,
) -> Result<Vec<Route>, LaneTooLong> {
    if route_duration_s(planned, route) <= most_s {
        return Ok(vec![*route]);
    }
    let lanes = RouteLanes::new(planned, route);
    let count = lanes.pad_distances_m.len();
    // For each number of lanes, counted from the route's first lane: fewest sorties that fly them,
    // their total time, seconds, and index of the first lane of the last of these sorties.
    let mut best = vec![(0u32, 0.0f64, 0usize)];
    for end in 1..=count {
        let parts = (0..end)
            .rev()
            .map(|first| (first, route_duration_s(planned, &lanes.sub_route(first, end))));
        let fitting = parts.take_while(|(_, own_s)| *own_s <= most_s);
        let all = fitting
            .map(|(first, own_s)| (best[first].0 + 1, best[first].1 + f64::from(own_s), first));
        let found = all.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        best.push(found.ok_or_else(|| LaneTooLong {
            lane: planned.tracks.lane_of(lanes.waypoint_bounds[end - 1]),
            takes_s: route_duration_s(planned, &lanes.sub_route(end - 1, end)),
        })?);
    }
    let (mut parts, mut end) = (Vec::new(), count);
    while end > 0 {
        let first = best[end].2;
        parts.push(lanes.sub_route(first, end));
        end = first;
    }
    // The parts are now in reverse order along the path, which is the order of flight of a backward
    // route.
    if route.first_and_last().0 == route.lowest_waypoint {
        parts.reverse();
    }
    Ok(parts)
}

/// The lanes of a route, the first and the last of them possibly only in part.
struct RouteLanes<'a> {
    /// The plan that the route belongs to.
    planned: &'a CoveragePlan<'a>,
    route: &'a Route,
    /// First waypoint of each lane within the route, and the end of the route (exclusive).
    waypoint_bounds: Vec<u32>,
    /// For each lane: length of the path around no-fly zones from the pad to the lane's first
    /// waypoint within the route, and to its last, metres.
    pad_distances_m: Vec<[f32; 2]>,
}

impl<'a> RouteLanes<'a> {
    fn new(planned: &'a CoveragePlan<'a>, route: &'a Route) -> Self {
        let tracks = &planned.tracks;
        let [from, to] =
            [route.lowest_waypoint, route.waypoint_end - 1].map(|number| tracks.lane_of(number));
        let inner = tracks.lanes()[from + 1..=to].iter().map(|lane| lane.first_waypoint);
        let bounds: Vec<u32> = std::iter::once(route.lowest_waypoint)
            .chain(inner)
            .chain([route.waypoint_end])
            .collect();
        let pad = planned.vehicles[usize::from(route.vehicle_index)].transit_start;
        let way_m = |number: u32| {
            tracks.waypoint(number).map_or(0.0, |place| planned.transit.distance_m(&pad, &place))
        };
        let ways_m = bounds.windows(2).map(|pair| [way_m(pair[0]), way_m(pair[1] - 1)]).collect();
        Self { planned, route, waypoint_bounds: bounds, pad_distances_m: ways_m }
    }

    /// The lanes `first..end` of the route as a route of their own.
    fn sub_route(&self, first: usize, end: usize) -> Route {
        let (planned, heights) = (self.planned, self.planned.area_settings.heights);
        let vehicle = &planned.vehicles[usize::from(self.route.vehicle_index)];
        let (from, to) = (self.waypoint_bounds[first], self.waypoint_bounds[end]);
        let inside_m = planned.tracks.distance_to_waypoint_m(to - 1)
            - planned.tracks.distance_to_waypoint_m(from);
        let ground_m = self.pad_distances_m[first][0] + inside_m + self.pad_distances_m[end - 1][1];
        let top_m =
            heights.max_picture_height_m + f32::from(self.route.layer) * heights.layer_spacing_m;
        let delay_s = top_m / vehicle.climb_mps + top_m / vehicle.descend_mps;
        Route {
            lowest_waypoint: from,
            waypoint_end: to,
            ground_length_m: ground_m,
            cost_m: ground_m + 2.0 * top_m,
            cost_s: ground_m / vehicle.cruise_mps + delay_s,
            ..*self.route
        }
    }
}
