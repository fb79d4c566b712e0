//! Calls of coverage planning: plans of one area for three vehicles, division of the work left
//! after a loss, and areas at a board's capacities. Their results go into a checksum, by which a
//! test compares board and host bit by bit.

use firmware::capacity::{AREA_VERTICES, GATES, LANES, NO_FLY_CORNERS, VEHICLES, WAYPOINTS};
use heapless::Vec;
use planner_core::Point;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::bound::lower_bound_s;
use planner_core::coverage::divide;
use planner_core::coverage::footprint::{Camera, Footprint, Spacing};
use planner_core::coverage::pack::{self, CoverageProblem, Heights, RoutePlan, TrackUnit, Vehicle};
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;
use planner_core::coverage::{Flat, around, powell, sweep};
use planner_core::detour::{DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::{VehiclePlan, WaypointRange};

use super::Meter;
use super::coverage_workspace::CoverageWorkspace;

/// Most changes of the lanes' order that the planner tries.
pub const BOARD_SEARCH_STEPS: u32 = companion::planner::coverage::BOARD_SEARCH_STEPS;
/// Vehicles in the plans for which the bench sets a limit of instructions.
const SMALL_SWARM_VEHICLES: usize = 3;
/// Settings of the POWELL search, as on the host.
const POWELL_SEARCH: powell::PowellConfig = powell::PowellConfig::USUAL;
const HEIGHTS: Heights = Heights { max_picture_height_m: 35.0, layer_spacing_m: 5.0 };

/// Checksum of numbers that depends on their order.
struct Checksum(u32);

impl Checksum {
    fn add(&mut self, bits: u32) {
        self.0 = (self.0 ^ bits).wrapping_mul(0x0100_0193);
    }

    fn add_floats(&mut self, reals: &[f32]) {
        reals.iter().for_each(|real| self.add(real.to_bits()));
    }

    fn add_tracks(&mut self, tracks: &Tracks<LANES>) {
        for lane in tracks.lanes() {
            self.add_floats(&[lane.from.x, lane.from.y, lane.to.x, lane.to.y, lane.start_along_m]);
            self.add(lane.waypoint_count);
        }
    }

    fn add_plan(&mut self, plan: &RoutePlan<VEHICLES>) {
        for route in &plan.routes {
            let numbers = [
                u32::from(route.vehicle_index),
                route.lowest_waypoint,
                route.waypoint_end,
                u32::from(route.layer),
            ];
            numbers.into_iter().for_each(|number| self.add(number));
            self.add(route.direction as u32);
            self.add_floats(&[route.ground_length_m, route.cost_m, route.cost_s]);
        }
    }
}

/// Makes all calls of coverage planning; returns the checksum of their results.
#[inline(never)]
pub fn measure_coverage_calls(meter: &mut impl Meter, lent: &mut CoverageWorkspace) -> u32 {
    let mut sum = Checksum(1);
    measure_cameras(meter, &mut sum);
    // Area of five vertices, 300 by 150 m; its lanes are 10 m apart.
    let five = [[0.0, 0.0], [300.0, 0.0], [320.0, 80.0], [300.0, 150.0], [0.0, 150.0]].map(flat);
    let area = Area::new(&five, &[Ring { end: 5, kind: RingKind::Outer }]).expect("an area");
    measure_plans(meter, area, lent, &mut sum);
    // Area of 512 lanes for 32 vehicles: as many of both as a board holds.
    let wide = [[0.0, 0.0], [2559.0, 0.0], [2559.0, 400.0], [0.0, 400.0]].map(flat);
    let area = Area::new(&wide, &[Ring { end: 4, kind: RingKind::Outer }]).expect("an area");
    measure_division(meter, area, lent, &mut sum);
    measure_largest_area(meter, lent, &mut sum);
    sum.0
}

fn flat([x, y]: [f32; 2]) -> Flat {
    Flat::new(x, y)
}

/// The lanes to be divided among `vehicles`, waypoint by waypoint.
fn work_of_lanes<'a, const L: usize, const N: usize>(
    tracks: &'a Tracks<L>,
    transit: &'a TransitGraph<'a, N>,
    vehicles: &'a [Vehicle],
) -> CoverageProblem<'a, L, N> {
    CoverageProblem {
        tracks,
        transit,
        vehicles,
        heights: HEIGHTS,
        unit: TrackUnit::Waypoint,
        following: None,
    }
}

/// Equal vehicles whose pads are 5 m apart, south of the area.
fn vehicles(count: usize) -> Vec<Vehicle, VEHICLES> {
    let vehicle = |i: usize| {
        let place = Flat::new(5.0 * i as f32, -10.0);
        let (cruise_mps, climb_mps, descend_mps) = (5.0, 3.0, 1.0);
        Vehicle {
            transit_start: place,
            home: place,
            cruise_mps,
            climb_mps,
            descend_mps,
            weight: 1.0,
        }
    };
    (0..count).map(vehicle).collect()
}

/// Lanes, and waypoints on them, `lane_m` apart; `angle_deg` from east, `None` for the planner's.
fn pattern(angle_deg: Option<f32>, lane_m: f32) -> LanePattern {
    let footprint = Footprint { along_m: lane_m, across_m: lane_m };
    let spacing = Spacing { footprint, max_lane_spacing_m: lane_m, max_waypoint_spacing_m: lane_m };
    LanePattern {
        spacing,
        angle_from_east_deg: angle_deg,
        border_overshoot_m: 0.0,
        max_search_steps: BOARD_SEARCH_STEPS,
    }
}

fn measure_cameras(meter: &mut impl Meter, sum: &mut Checksum) {
    let sensor = Camera::Sensor { sides_mm: [23.5, 15.6], focal_mm: 16.0, pixels: [6000, 4000] };
    for camera in [sensor, Camera::Diagonal { fov_deg: 73.7, aspect: 1.5 }] {
        let footprint = meter.call("footprint::Camera::footprint", 0, || camera.footprint(35.0));
        let footprint = footprint.expect("a camera");
        sum.add(footprint.along_m.to_bits() ^ footprint.across_m.to_bits());
    }
    let height_m =
        meter.call("footprint::Camera::height_for_gsd", 0, || sensor.height_for_gsd(0.02));
    sum.add(height_m.expect("a sensor").to_bits());
}

/// Plans the area for three vehicles, as a whole and step by step, and again after the loss of one.
fn measure_plans(
    meter: &mut impl Meter,
    area: Area<'_>,
    lent: &mut CoverageWorkspace,
    sum: &mut Checksum,
) {
    let transit = TransitGraph::<1>::empty();
    let few = vehicles(SMALL_SWARM_VEHICLES);
    let CoverageWorkspace { tracks, remaining: left, lane_workspace: build, powell, plan, .. } =
        lent;
    let bytes = size_of_val(tracks) + size_of_val(build) + size_of_val(powell);
    meter.call("a coverage plan, 3", bytes, || {
        tracks::build_lanes(&area, &pattern(None, 10.0), &transit, build, tracks).expect("lanes");
        let work = work_of_lanes(tracks, &transit, &few);
        powell::powell(&work, &POWELL_SEARCH, powell, plan).expect("routes");
    });
    sum.add_tracks(tracks);
    sum.add_plan(plan);
    let work = work_of_lanes(tracks, &transit, &few);
    meter
        .call("powell::powell, 3", size_of_val(powell), || {
            powell::powell(&work, &POWELL_SEARCH, powell, plan)
        })
        .expect("routes");
    let pack = &mut powell.pack;
    for unit in [TrackUnit::Lane, TrackUnit::Waypoint] {
        let work = CoverageProblem { unit, ..work };
        meter
            .call("pack::binpat, 3", size_of_val(pack), || pack::binpat(&work, pack, plan))
            .expect("routes");
        sum.add_plan(plan);
    }
    let bound_s =
        meter.call("bound::lower_bound_s, 3", 0, || lower_bound_s(&work)).expect("a bound");
    sum.add(bound_s.to_bits());
    // Each vehicle has photographed its first ten waypoints when the first vehicle is lost.
    let done = flown_ranges(plan, 10);
    let rest = &few[1..];
    let bytes = size_of_val(left) + size_of_val(pack);
    meter.call("left and binpat, 3", bytes, || {
        divide::remaining_lanes(tracks, &done, &transit, left).expect("something is left");
        let work = work_of_lanes(left, &transit, rest);
        pack::binpat(&work, pack, plan).expect("routes");
    });
    sum.add_tracks(left);
    sum.add_plan(plan);
}

/// The `count` lowest waypoint numbers of each route, in ascending order.
fn flown_ranges(plan: &RoutePlan<VEHICLES>, count: u32) -> Vec<WaypointRange, VEHICLES> {
    let mut done: Vec<WaypointRange, VEHICLES> = plan
        .routes
        .iter()
        .map(|r| WaypointRange {
            first: r.lowest_waypoint,
            end: (r.lowest_waypoint + count).min(r.waypoint_end),
        })
        .collect();
    done.sort_unstable_by_key(|range| range.first);
    done
}

/// The lanes of the ten lowest waypoint numbers of each route.
fn flown_lanes(tracks: &Tracks<LANES>, plan: &RoutePlan<VEHICLES>) -> Vec<WaypointRange, VEHICLES> {
    // Widened to whole lanes: no lane is cut in two, so the rest fits the capacity.
    let whole = |range: WaypointRange| {
        let lane = |number: u32| &tracks.lanes()[tracks.lane_of(number)];
        let (from, to) = (lane(range.first), lane(range.end - 1));
        WaypointRange { first: from.first_waypoint, end: to.first_waypoint + to.waypoint_count }
    };
    let mut done: Vec<WaypointRange, VEHICLES> =
        flown_ranges(plan, 10).into_iter().map(whole).collect();
    for k in 1..done.len() {
        done[k].first = done[k].first.max(done[k - 1].end);
    }
    done
}

/// Divides 512 lanes among 32 vehicles, and divides the rest again after a loss.
fn measure_division(
    meter: &mut impl Meter,
    area: Area<'_>,
    lent: &mut CoverageWorkspace,
    sum: &mut Checksum,
) {
    let transit = TransitGraph::<1>::empty();
    let many = vehicles(VEHICLES);
    let CoverageWorkspace { tracks, remaining: left, lane_workspace: build, powell, plan, .. } =
        lent;
    let pack = &mut powell.pack;
    // Lanes along y: 2559 m / 5 m are 512; in this convex area their order is not searched.
    let pattern = pattern(Some(90.0), 5.0);
    meter
        .call("tracks::build_lanes, 512 lanes", size_of_val(build), || {
            tracks::build_lanes(&area, &pattern, &transit, build, tracks)
        })
        .expect("lanes");
    assert_eq!(tracks.lanes().len(), LANES);
    sum.add_tracks(tracks);
    let work = work_of_lanes(tracks, &transit, &many);
    meter
        .call("pack::binpat, 32", size_of_val(pack), || pack::binpat(&work, pack, plan))
        .expect("routes");
    sum.add_plan(plan);
    for number in [0, 1000, tracks.waypoint_count() - 1] {
        let place = meter
            .call("lanes::Tracks::waypoint", 0, || tracks.waypoint(number))
            .expect("it is there");
        let along_m = meter.call("lanes::Tracks::distance_to_waypoint_m", 0, || {
            tracks.distance_to_waypoint_m(number)
        });
        sum.add_floats(&[place.x, place.y, along_m]);
    }
    let done = flown_lanes(tracks, plan);
    let rest = &many[1..];
    meter.call("left and binpat, 32", size_of_val(left) + size_of_val(pack), || {
        divide::remaining_lanes(tracks, &done, &transit, left).expect("something is left");
        let work = work_of_lanes(left, &transit, rest);
        pack::binpat(&work, pack, plan).expect("routes");
    });
    sum.add_tracks(left);
    sum.add_plan(plan);
    let last = left.waypoint_count() - 1;
    sum.add(
        meter.call("divide::number_on_whole_path, 32", 0, || {
            divide::number_on_whole_path(&done, last)
        }),
    );
}

/// Plans three detours home and one to a place beside the path, among no-fly zones and 128 keep-out
/// zones.
fn measure_detours_home(
    meter: &mut impl Meter,
    transit: &TransitGraph<'_, NO_FLY_CORNERS>,
    sum: &mut Checksum,
) {
    let mut own = VehiclePlan::<WAYPOINTS, GATES>::new();
    meter.call("transit::TransitGraph::corners", 0, || transit.corners().len());
    meter.call("transit::TransitGraph::is_in_no_fly_zone", 0, || {
        transit.is_in_no_fly_zone(&Flat::zeros())
    });
    for case in 0..4 {
        let here = Point::new(150.0, 70.0 - 20.0 * case as f32, 25.0);
        let thing = |i: usize| {
            let from =
                Point::new(-120.0 + 7.0 * (i % 32) as f32, -40.0 + 23.0 * (i / 32) as f32, 45.0);
            let to = Point::new(from.x, from.y, if i.is_multiple_of(3) { from.z } else { 0.0 });
            KeepOutZone { from, to, radius_m: 2.0, kind: ZoneKind::Static }
        };
        let mut things: Vec<KeepOutZone, { 4 * VEHICLES }> = (0..4 * VEHICLES).map(thing).collect();
        let request = DetourRequest {
            land_aside: case == 3,
            here,
            leg: [here; 2],
            leg_clearance_m: 10.0,
            goal: DetourGoal::Point { end: Point::new(-150.0, -80.0, 3.0), layer_z_m: 40.0 },
            descent_m: 3.0,
            required_clearance_m: 1.2,
            fence: None,
        };
        // That no path exists is a valid result too.
        let found = meter.call("around::plan_detour, 128 things", 0, || {
            around::plan_detour(transit, None, &request, &mut things, &mut own.path)
        });
        sum.add(u32::from(found.is_ok()) ^ own.path.length_m().to_bits());
        let again = meter.call("around::plan_detour_for_vehicle, 128 things", 0, || {
            around::plan_detour_for_vehicle(transit, None, &request, &mut things, &mut own)
        });
        sum.add(u32::from(again.is_ok()));
    }
}

/// No-fly zones of the largest area.
const NO_FLY_ZONE_COUNT: usize = NO_FLY_CORNERS / 4;

/// The vertices and rings of an area with as many vertices and corners of no-fly zones as a board
/// holds.
fn largest_area() -> (Vec<Flat, AREA_VERTICES>, Vec<Ring, { NO_FLY_ZONE_COUNT + 1 }>) {
    const OUTER: usize = AREA_VERTICES - NO_FLY_CORNERS;
    let mut vertices: Vec<Flat, AREA_VERTICES> = Vec::new();
    for k in 0..OUTER {
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * k as f32 / OUTER as f32);
        let radius_m = if k % 2 == 0 { 200.0 } else { 190.0 };
        vertices.push(Flat::new(radius_m * cos, radius_m * sin)).expect("there is room");
    }
    let mut rings: Vec<Ring, { NO_FLY_ZONE_COUNT + 1 }> = Vec::new();
    rings.push(Ring { end: OUTER as u16, kind: RingKind::Outer }).expect("there is room");
    for zone in 0..NO_FLY_ZONE_COUNT {
        let (x, y) = (-120.0 + 70.0 * (zone % 4) as f32, if zone < 4 { -60.0 } else { 50.0 });
        for [east, north] in [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]] {
            vertices.push(Flat::new(x + east, y + north)).expect("there is room");
        }
        let end = (OUTER + 4 * (zone + 1)) as u16;
        rings.push(Ring { end, kind: RingKind::NoFly }).expect("there is room");
    }
    (vertices, rings)
}

/// Plans an area with as many vertices, and as many corners of no-fly zones among them, as a board
/// holds.
fn measure_largest_area(meter: &mut impl Meter, lent: &mut CoverageWorkspace, sum: &mut Checksum) {
    let (vertices, rings) = largest_area();
    let area =
        meter.call("area::Area::new, 256", 0, || Area::new(&vertices, &rings)).expect("an area");
    let mut transit = TransitGraph::<NO_FLY_CORNERS>::empty();
    let bytes = size_of_val(&transit);
    meter
        .call("transit::TransitGraph::set_area, 32 corners", bytes, || transit.set_area(area))
        .expect("they fit");
    for k in 0..16 {
        let (from, to) =
            (Flat::new(-150.0, 10.0 * k as f32 - 80.0), Flat::new(150.0, 70.0 - 9.0 * k as f32));
        let clear = meter
            .call("transit::TransitGraph::is_line_clear", 0, || transit.is_line_clear(&from, &to));
        let far_m =
            meter.call("transit::TransitGraph::distance_m", 0, || transit.distance_m(&from, &to));
        let mut corners: Vec<Flat, NO_FLY_CORNERS> = Vec::new();
        meter
            .call("transit::TransitGraph::shortest_path", 0, || {
                transit.shortest_path(&from, &to, &mut corners)
            })
            .expect("a way");
        let inside =
            meter.call("area::Area::is_in_no_fly_zone", 0, || area.is_in_no_fly_zone(&from));
        sum.add(far_m.to_bits() ^ corners.len() as u32 ^ u32::from(clear) ^ u32::from(inside));
    }
    measure_detours_home(meter, &transit, sum);
    let CoverageWorkspace { tracks, lane_workspace: build, powell, plan, .. } = lent;
    let mut hull: Vec<Flat, AREA_VERTICES> = Vec::new();
    let direction = meter.call("sweep::direction_of_least_width, 256", size_of_val(&hull), || {
        sweep::direction_of_least_width(&area, &mut hull)
    });
    sum.add(direction.expect("a direction").along.x.to_bits());
    let bytes = size_of_val(build);
    let pattern = pattern(None, 16.0);
    meter
        .call("tracks::build_lanes, 256 vertices", bytes, || {
            tracks::build_lanes(&area, &pattern, &transit, build, tracks)
        })
        .expect("lanes");
    sum.add_tracks(tracks);
    let few = vehicles(SMALL_SWARM_VEHICLES);
    let work = work_of_lanes(tracks, &transit, &few);
    meter
        .call("pack::binpat, 3 around zones", size_of_val(&powell.pack), || {
            pack::binpat(&work, &mut powell.pack, plan)
        })
        .expect("routes");
    sum.add_plan(plan);
}

#[cfg(test)]
mod tests;
