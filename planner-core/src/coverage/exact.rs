//! The exact minimum of max C_k, the largest cost of a route, over all contiguous divisions,
//! subsets of vehicles, layers and directions: the benchmark of the other methods. For desktops
//! only: 10 vehicles have 2²⁰ states.
//!
//! A dynamic program decides whether all waypoints can be photographed within a time T. Its state
//! (vehicles, layers) holds the most waypoints, counted from the first, that this set of vehicles
//! in this set of layers can photograph within T. A route's cost does not fall if it is extended at
//! either end, by the triangle inequality; so each step takes as many waypoints as fit, which two
//! pointers find for all first waypoints at once. T is found by bisection to
//! [`RELATIVE_TIME_RESOLUTION`].
//!
//! Over terrain a longer route can cost less, where it begins or ends on a hill instead of in a
//! valley. The plan's costs are right there too, and no higher than BINPAT's; but a lower one may
//! exist.
//!
//! Cost, for K vehicles and n waypoints: a few dozen rounds, each of C(K, m)² · (K − m)² steps
//! summed over m from 0 to K, and K² · n for the pointers.

use super::CoverageError;
use super::pack::{CoverageProblem, PackWorkspace, Route, RoutePlan, binpat, set_costs};

/// Most vehicles of an exact division.
pub const MAX_EXACT_VEHICLES: usize = 10;
/// Relative resolution to which the least T is found.
pub const RELATIVE_TIME_RESOLUTION: f32 = 1e-5;

/// Memory that the caller lends, with lengths from [`ExactWorkspace::required_lengths`].
pub struct ExactWorkspace<'a> {
    /// Transit lengths, metres: for each vehicle first from its start to every waypoint, then from
    /// every waypoint home.
    pub transit_lengths_m: &'a mut [f32],
    /// For each vehicle, layer and first waypoint of a route: the number of the last waypoint that
    /// the vehicle can then photograph within T, plus one.
    pub reachable_ends: &'a mut [u32],
    /// States of the dynamic program, indexed by set of vehicles, then set of layers: most
    /// waypoints photographed, and the step that led there (vehicle times number of vehicles plus
    /// layer).
    pub states: &'a mut [(u32, u16)],
}

impl ExactWorkspace<'_> {
    /// Lengths of the three slices for these numbers of vehicles and waypoints; `usize::MAX`
    /// instead of an overflow.
    pub fn required_lengths(vehicles: usize, waypoints: usize) -> [usize; 3] {
        let vehicles = vehicles.min(MAX_EXACT_VEHICLES);
        let reaches = (vehicles * vehicles).saturating_mul(waypoints.saturating_add(1));
        [(2 * vehicles).saturating_mul(waypoints), reaches, 1 << (2 * vehicles)]
    }
}

/// Writes the plan with the least max C_k to `out`.
///
/// # Errors
/// Those of [`binpat`]; [`CoverageError::Vehicles`] for more than [`MAX_EXACT_VEHICLES`];
/// [`CoverageError::WorkspaceTooSmall`].
pub fn plan_exact<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    ws: &mut ExactWorkspace<'_>,
    pack: &mut PackWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    problem.check::<K>()?;
    let (count, waypoints) = (problem.vehicles.len(), problem.tracks.waypoint_count() as usize);
    if count > MAX_EXACT_VEHICLES {
        return Err(CoverageError::Vehicles);
    }
    let [ways, reaches, states] = ExactWorkspace::required_lengths(count, waypoints);
    if ws.transit_lengths_m.len() < ways
        || ws.reachable_ends.len() < reaches
        || ws.states.len() < states
    {
        return Err(CoverageError::WorkspaceTooSmall);
    }
    // Upper bound of T: BINPAT's division is possible. Lower bound: 0 s.
    binpat(problem, pack, out)?;
    let mut table = DivisionTable { problem, ws, vehicle_count: count, waypoint_count: waypoints };
    table.fill_transit_lengths();
    let (mut low, mut high) = (0.0, out.max_cost_s() * (1.0 + RELATIVE_TIME_RESOLUTION));
    let mut found = out.clone();
    let mut middle = high;
    while high - low > high * RELATIVE_TIME_RESOLUTION {
        if table.find_division_within(middle) {
            table.write_plan(&mut found);
            high = libm::fminf(middle, found.max_cost_s());
            if found.max_cost_s() <= out.max_cost_s() {
                out.clone_from(&found);
            }
        } else {
            low = middle;
        }
        middle = low + (high - low) / 2.0;
    }
    Ok(())
}

/// A coverage problem, and the tables of its dynamic program.
struct DivisionTable<'t, 'w, 'm, const L: usize, const N: usize> {
    problem: &'t CoverageProblem<'w, L, N>,
    ws: &'t mut ExactWorkspace<'m>,
    /// Number of vehicles among which the waypoints are divided.
    vehicle_count: usize,
    /// Number of waypoints of all lanes.
    waypoint_count: usize,
}

impl<const L: usize, const N: usize> DivisionTable<'_, '_, '_, L, N> {
    /// Fills [`ExactWorkspace::transit_lengths_m`].
    fn fill_transit_lengths(&mut self) {
        for (v, vehicle) in self.problem.vehicles.iter().enumerate() {
            for i in 0..self.waypoint_count {
                let Some(place) = self.problem.tracks.waypoint(i as u32) else { continue };
                let to = self.problem.transit.distance_m(&vehicle.transit_start, &place);
                let home = if vehicle.transit_start == vehicle.home {
                    to
                } else {
                    self.problem.transit.distance_m(&place, &vehicle.home)
                };
                self.ws.transit_lengths_m[2 * v * self.waypoint_count + i] = to;
                self.ws.transit_lengths_m[(2 * v + 1) * self.waypoint_count + i] = home;
            }
        }
    }

    /// Whether vehicle `v` can photograph waypoints `from` to `end` − 1, transits included, with at
    /// most `most_m` metres of flight over ground. The extra descent and climb over terrain count
    /// as the metres that the vehicle would cruise in their time.
    fn is_within_length(&self, v: usize, from: usize, end: usize, most_m: f32) -> bool {
        let to = &self.ws.transit_lengths_m[2 * v * self.waypoint_count..][..self.waypoint_count];
        let home =
            &self.ws.transit_lengths_m[(2 * v + 1) * self.waypoint_count..][..self.waypoint_count];
        let along = |i: usize| self.problem.tracks.distance_to_waypoint_m(i as u32);
        let (forward_s, backward_s) =
            self.problem.route_extra_vertical_times_s(v, from as u32, end as u32);
        let cruise_mps = self.problem.vehicles[v].cruise_mps;
        let transit = libm::fminf(
            to[from] + home[end - 1] + forward_s * cruise_mps,
            to[end - 1] + home[from] + backward_s * cruise_mps,
        );
        along(end - 1) - along(from) + transit <= most_m
    }

    /// Computes all states for T = `time_s`. Returns whether some state has all waypoints.
    fn find_division_within(&mut self, time_s: f32) -> bool {
        let (count, waypoints) = (self.vehicle_count, self.waypoint_count);
        let over_terrain = self.problem.following.is_some();
        for v in 0..count {
            let vehicle = self.problem.vehicles[v];
            for layer in 0..count {
                let left_s = time_s - self.problem.altitude_delay_s(&vehicle, layer as u8 + 1);
                let most_m = left_s * vehicle.cruise_mps;
                let mut end = 0;
                for from in 0..waypoints {
                    end = end.max(from);
                    while over_terrain && end > from && !self.is_within_length(v, from, end, most_m)
                    {
                        end -= 1;
                    }
                    while end < waypoints && self.is_within_length(v, from, end + 1, most_m) {
                        end += 1;
                    }
                    self.ws.reachable_ends[(v * count + layer) * (waypoints + 1) + from] =
                        end as u32;
                }
                self.ws.reachable_ends[(v * count + layer) * (waypoints + 1) + waypoints] =
                    waypoints as u32;
            }
        }
        let sets = 1usize << count;
        self.ws.states[..sets * sets].fill((0, u16::MAX));
        for flying in 0..sets {
            for layers in (0..sets).filter(|layers| layers.count_ones() == flying.count_ones()) {
                let done = self.ws.states[flying * sets + layers].0;
                for v in (0..count).filter(|v| flying >> v & 1 == 0) {
                    for layer in (0..count).filter(|layer| layers >> layer & 1 == 0) {
                        let end = self.ws.reachable_ends
                            [(v * count + layer) * (waypoints + 1) + done as usize];
                        let next = (flying | 1 << v) * sets + (layers | 1 << layer);
                        if end > self.ws.states[next].0 {
                            self.ws.states[next] = (end, (v * count + layer) as u16);
                        }
                    }
                }
            }
        }
        self.complete_state().is_some()
    }

    /// Index of the state with the fewest vehicles that has all waypoints; `None` if no state has.
    fn complete_state(&self) -> Option<usize> {
        let all = |state: &usize| self.ws.states[*state].0 as usize == self.waypoint_count;
        (0..1usize << (2 * self.vehicle_count)).filter(all).min_by_key(|state| state.count_ones())
    }

    /// Writes the plan that leads to the state of [`Self::complete_state`].
    fn write_plan<const K: usize>(&self, out: &mut RoutePlan<K>) {
        let Some(mut state) = self.complete_state() else { return };
        let (count, sets) = (self.vehicle_count, 1usize << self.vehicle_count);
        let stride = self.waypoint_count + 1;
        out.routes.clear();
        while self.ws.states[state].1 != u16::MAX {
            let (end, step) = self.ws.states[state];
            let (v, layer) = (usize::from(step) / count, usize::from(step) % count);
            state = ((state / sets) & !(1 << v)) * sets + ((state % sets) & !(1 << layer));
            let first = self.ws.states[state].0;
            debug_assert_eq!(
                self.ws.reachable_ends[usize::from(step) * stride + first as usize],
                end
            );
            let (ground_m, direction) = self.problem.ground_length_and_direction(
                &self.problem.vehicles[v],
                &self.problem.route_ends(first, end),
            );
            let route = Route {
                vehicle_index: v as u8,
                lowest_waypoint: first,
                waypoint_end: end,
                direction,
                layer: layer as u8 + 1,
                ground_length_m: ground_m,
                cost_m: 0.0,
                cost_s: 0.0,
            };
            if end > first {
                let _ = out.routes.push(route);
            }
        }
        out.routes.reverse();
        set_costs(self.problem, out);
    }
}
