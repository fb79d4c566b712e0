//! The calls of a coverage mission: plans of one area for three vehicles, division of what is left after a loss, and areas at a
//! board's capacities. What they answer is summed up bit by bit, to be compared with the desk's.

use heapless::Vec;
use planner_core::Point;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::bound::lower_bound_s;
use planner_core::coverage::divide;
use planner_core::coverage::footprint::{Camera, Footprint, Spacing};
use planner_core::coverage::pack::{self, Heights, Plan, Unit, Vehicle, Work};
use planner_core::coverage::tracks::{self, Pattern, Tracks};
use planner_core::coverage::transit::Transit;
use planner_core::coverage::{Flat, around, powell, sweep};
use planner_core::detour::{DetourRequest, Goal, KeepOff, Nature};
use planner_core::flight::{Range, VehiclePlan};

use super::Meter;
use crate::capacity::{AREA_CORNERS, AREA_VERTICES, GATES, LANES, VEHICLES, WAYPOINTS};
use crate::scratch::Coverage;

/// Changes of the lanes' order that are tried.
pub const MAX_ORDER_CHANGES: u32 = companion::planner::coverage::MAX_ORDER_CHANGES;
/// Vehicles of the plans that have a limit.
const LIMITED_VEHICLES: usize = 3;
/// Packings that POWELL tries.
const POWELL_SEARCH: powell::Config = powell::Config::USUAL;
const HEIGHTS: Heights = Heights { mission_m: 35.0, layer_m: 5.0 };

/// A sum of bits in which order counts.
struct Sum(u32);

impl Sum {
    fn add(&mut self, bits: u32) {
        self.0 = (self.0 ^ bits).wrapping_mul(0x0100_0193);
    }

    fn reals(&mut self, reals: &[f32]) {
        reals.iter().for_each(|real| self.add(real.to_bits()));
    }

    fn tracks(&mut self, tracks: &Tracks<LANES>) {
        for lane in tracks.lanes() {
            self.reals(&[lane.from.x, lane.from.y, lane.to.x, lane.to.y, lane.start_m]);
            self.add(lane.count);
        }
    }

    fn plan(&mut self, plan: &Plan<VEHICLES>) {
        for route in &plan.routes {
            let numbers = [u32::from(route.vehicle), route.first, route.end, u32::from(route.layer)];
            numbers.into_iter().for_each(|number| self.add(number));
            self.add(route.heading as u32);
            self.reals(&[route.ground_m, route.cost_m, route.cost_s]);
        }
    }
}

/// Makes all of them; the sum of the answers.
#[inline(never)]
pub fn run(meter: &mut impl Meter, lent: &mut Coverage) -> u32 {
    let mut sum = Sum(1);
    cameras(meter, &mut sum);
    // Five vertices, 300 by 150 m, lanes of 10 m.
    let five = [[0.0, 0.0], [300.0, 0.0], [320.0, 80.0], [300.0, 150.0], [0.0, 150.0]].map(flat);
    let area = Area::new(&five, &[Ring { end: 5, kind: RingKind::Outer }]).expect("an area");
    plans(meter, area, lent, &mut sum);
    // The most lanes, for the most vehicles.
    let wide = [[0.0, 0.0], [2559.0, 0.0], [2559.0, 400.0], [0.0, 400.0]].map(flat);
    let area = Area::new(&wide, &[Ring { end: 4, kind: RingKind::Outer }]).expect("an area");
    division(meter, area, lent, &mut sum);
    edges(meter, lent, &mut sum);
    sum.0
}

fn flat([x, y]: [f32; 2]) -> Flat {
    Flat::new(x, y)
}

fn vehicles(count: usize) -> Vec<Vehicle, VEHICLES> {
    let vehicle = |i: usize| {
        let place = Flat::new(5.0 * i as f32, -10.0);
        let (cruise_mps, climb_mps, descend_mps) = (5.0, 3.0, 1.0);
        Vehicle { place, home: place, cruise_mps, climb_mps, descend_mps, weight: 1.0 }
    };
    (0..count).map(vehicle).collect()
}

fn pattern(angle_deg: Option<f32>, lane_m: f32) -> Pattern {
    let footprint = Footprint { along_m: lane_m, across_m: lane_m };
    let spacing = Spacing { footprint, lane_m, waypoint_m: lane_m };
    Pattern { spacing, angle_deg, margin_m: 0.0, looks: MAX_ORDER_CHANGES }
}

fn cameras(meter: &mut impl Meter, sum: &mut Sum) {
    let sensor = Camera::Sensor { sides_mm: [23.5, 15.6], focal_mm: 16.0, pixels: [6000, 4000] };
    for camera in [sensor, Camera::Diagonal { fov_deg: 73.7, aspect: 1.5 }] {
        let footprint = meter.call("footprint::Camera::footprint", 0, || camera.footprint(35.0));
        let footprint = footprint.expect("a camera");
        sum.add(footprint.along_m.to_bits() ^ footprint.across_m.to_bits());
    }
    let height_m = meter.call("footprint::Camera::height_for_gsd", 0, || sensor.height_for_gsd(0.02));
    sum.add(height_m.expect("a sensor").to_bits());
}

/// The whole plan of three vehicles, and its parts.
fn plans(meter: &mut impl Meter, area: Area<'_>, lent: &mut Coverage, sum: &mut Sum) {
    let transit = Transit::<1>::empty();
    let few = vehicles(LIMITED_VEHICLES);
    let Coverage { tracks, left, build, powell, plan, .. } = lent;
    let bytes = size_of_val(tracks) + size_of_val(build) + size_of_val(powell);
    meter.call("a coverage plan, 3", bytes, || {
        tracks::build(&area, &pattern(None, 10.0), &transit, build, tracks).expect("lanes");
        let work = Work { tracks, transit: &transit, vehicles: &few, heights: HEIGHTS, unit: Unit::Waypoint };
        powell::powell(&work, &POWELL_SEARCH, powell, plan).expect("routes");
    });
    sum.tracks(tracks);
    sum.plan(plan);
    let work = Work { tracks, transit: &transit, vehicles: &few, heights: HEIGHTS, unit: Unit::Waypoint };
    meter
        .call("powell::powell, 3", size_of_val(powell), || {
            powell::powell(&work, &POWELL_SEARCH, powell, plan)
        })
        .expect("routes");
    let pack = &mut powell.pack;
    for unit in [Unit::Lane, Unit::Waypoint] {
        let work = Work { unit, ..work };
        meter.call("pack::binpat, 3", size_of_val(pack), || pack::binpat(&work, pack, plan)).expect("routes");
        sum.plan(plan);
    }
    let bound_s = meter.call("bound::lower_bound_s, 3", 0, || lower_bound_s(&work)).expect("a bound");
    sum.add(bound_s.to_bits());
    // Each has flown ten waypoints, and the first is lost.
    let done = flown(plan, 10);
    let rest = &few[1..];
    let bytes = size_of_val(left) + size_of_val(pack);
    meter.call("left and binpat, 3", bytes, || {
        divide::left(tracks, &done, &transit, left).expect("something is left");
        let work =
            Work { tracks: left, transit: &transit, vehicles: rest, heights: HEIGHTS, unit: Unit::Waypoint };
        pack::binpat(&work, pack, plan).expect("routes");
    });
    sum.tracks(left);
    sum.plan(plan);
}

fn flown(plan: &Plan<VEHICLES>, count: u32) -> Vec<Range, VEHICLES> {
    let mut done: Vec<Range, VEHICLES> =
        plan.routes.iter().map(|r| Range { first: r.first, end: (r.first + count).min(r.end) }).collect();
    done.sort_unstable_by_key(|range| range.first);
    done
}

/// The division of the rest after a loss, of 512 lanes among 32 vehicles.
fn division(meter: &mut impl Meter, area: Area<'_>, lent: &mut Coverage, sum: &mut Sum) {
    let transit = Transit::<1>::empty();
    let many = vehicles(VEHICLES);
    let Coverage { tracks, left, build, powell, plan, .. } = lent;
    let pack = &mut powell.pack;
    // The order is unchanged yet, and each step compares all lanes.
    let pattern = pattern(Some(90.0), 5.0);
    meter
        .call("tracks::build, 512 lanes", size_of_val(build), || {
            tracks::build(&area, &pattern, &transit, build, tracks)
        })
        .expect("lanes");
    assert_eq!(tracks.lanes().len(), LANES);
    sum.tracks(tracks);
    let work = Work { tracks, transit: &transit, vehicles: &many, heights: HEIGHTS, unit: Unit::Waypoint };
    meter.call("pack::binpat, 32", size_of_val(pack), || pack::binpat(&work, pack, plan)).expect("routes");
    sum.plan(plan);
    for number in [0, 1000, tracks.waypoint_count() - 1] {
        let place =
            meter.call("lanes::Tracks::waypoint", 0, || tracks.waypoint(number)).expect("it is there");
        let along_m = meter.call("lanes::Tracks::along_m", 0, || tracks.along_m(number));
        sum.reals(&[place.x, place.y, along_m]);
    }
    // Whole lanes from where each began: no lane is cut in two, so all fit again.
    let whole = |range: Range| {
        let lane = |number: u32| &tracks.lanes()[tracks.lane_of(number)];
        let (from, to) = (lane(range.first), lane(range.end - 1));
        Range { first: from.first, end: to.first + to.count }
    };
    let mut done: Vec<Range, VEHICLES> = flown(plan, 10).into_iter().map(whole).collect();
    for k in 1..done.len() {
        done[k].first = done[k].first.max(done[k - 1].end);
    }
    let rest = &many[1..];
    meter.call("left and binpat, 32", size_of_val(left) + size_of_val(pack), || {
        divide::left(tracks, &done, &transit, left).expect("something is left");
        let work =
            Work { tracks: left, transit: &transit, vehicles: rest, heights: HEIGHTS, unit: Unit::Waypoint };
        pack::binpat(&work, pack, plan).expect("routes");
    });
    sum.tracks(left);
    sum.plan(plan);
    let last = left.waypoint_count() - 1;
    sum.add(meter.call("divide::original, 32", 0, || divide::original(&done, last)));
}

/// The way home, and aside, among zones and four things of each vehicle.
fn ways_home(meter: &mut impl Meter, transit: &Transit<'_, AREA_CORNERS>, sum: &mut Sum) {
    let mut own = VehiclePlan::<WAYPOINTS, GATES>::new();
    meter.call("transit::Transit::corners", 0, || transit.corners().len());
    meter.call("transit::Transit::forbids", 0, || transit.forbids(&Flat::zeros()));
    for case in 0..4 {
        let here = Point::new(150.0, 70.0 - 20.0 * case as f32, 25.0);
        let thing = |i: usize| {
            let from = Point::new(-120.0 + 7.0 * (i % 32) as f32, -40.0 + 23.0 * (i / 32) as f32, 45.0);
            let to = Point::new(from.x, from.y, if i.is_multiple_of(3) { from.z } else { 0.0 });
            KeepOff { from, to, radius_m: 2.0, nature: Nature::Solid }
        };
        let mut things: Vec<KeepOff, { 4 * VEHICLES }> = (0..4 * VEHICLES).map(thing).collect();
        let request = DetourRequest {
            aside: case == 3,
            here,
            leg: [here; 2],
            leg_clearance_m: 10.0,
            goal: Goal::Home { over: Point::new(-150.0, -80.0, 3.0), layer_m: 40.0 },
            descent_m: 3.0,
            required_clearance_m: 1.2,
            fence: None,
        };
        // That no path exists is an answer too.
        let found = meter.call("around::plan, 128 things", 0, || {
            around::plan(transit, None, &request, &mut things, &mut own.path)
        });
        sum.add(u32::from(found.is_ok()) ^ own.path.length_m().to_bits());
        let again = meter.call("around::plan_vehicle, 128 things", 0, || {
            around::plan_vehicle(transit, None, &request, &mut things, &mut own)
        });
        sum.add(u32::from(again.is_ok()));
    }
}

/// An area with as many vertices as there may be, some of them of no-fly zones with as many corners.
fn edges(meter: &mut impl Meter, lent: &mut Coverage, sum: &mut Sum) {
    const ZONES: usize = AREA_CORNERS / 4;
    const OUTER: usize = AREA_VERTICES - AREA_CORNERS;
    let mut vertices: Vec<Flat, AREA_VERTICES> = Vec::new();
    for k in 0..OUTER {
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * k as f32 / OUTER as f32);
        let radius_m = if k % 2 == 0 { 200.0 } else { 190.0 };
        vertices.push(Flat::new(radius_m * cos, radius_m * sin)).expect("there is room");
    }
    let mut rings: Vec<Ring, { ZONES + 1 }> = Vec::new();
    rings.push(Ring { end: OUTER as u16, kind: RingKind::Outer }).expect("there is room");
    for zone in 0..ZONES {
        let (x, y) = (-120.0 + 70.0 * (zone % 4) as f32, if zone < 4 { -60.0 } else { 50.0 });
        for [east, north] in [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]] {
            vertices.push(Flat::new(x + east, y + north)).expect("there is room");
        }
        let end = (OUTER + 4 * (zone + 1)) as u16;
        rings.push(Ring { end, kind: RingKind::NoFly }).expect("there is room");
    }
    let area = meter.call("area::Area::new, 256", 0, || Area::new(&vertices, &rings)).expect("an area");
    let mut transit = Transit::<AREA_CORNERS>::empty();
    let bytes = size_of_val(&transit);
    meter.call("transit::Transit::learn, 32 corners", bytes, || transit.learn(area)).expect("they fit");
    for k in 0..16 {
        let (from, to) = (Flat::new(-150.0, 10.0 * k as f32 - 80.0), Flat::new(150.0, 70.0 - 9.0 * k as f32));
        let clear = meter.call("transit::Transit::is_clear", 0, || transit.is_clear(&from, &to));
        let far_m = meter.call("transit::Transit::distance_m", 0, || transit.distance_m(&from, &to));
        let mut corners: Vec<Flat, AREA_CORNERS> = Vec::new();
        meter.call("transit::Transit::way", 0, || transit.way(&from, &to, &mut corners)).expect("a way");
        let inside = meter.call("area::Area::forbids", 0, || area.forbids(&from));
        sum.add(far_m.to_bits() ^ corners.len() as u32 ^ u32::from(clear) ^ u32::from(inside));
    }
    ways_home(meter, &transit, sum);
    let Coverage { tracks, build, powell, plan, .. } = lent;
    let mut hull: Vec<Flat, AREA_VERTICES> = Vec::new();
    let direction =
        meter.call("sweep::least_width, 256", size_of_val(&hull), || sweep::least_width(&area, &mut hull));
    sum.add(direction.expect("a direction").along.x.to_bits());
    let bytes = size_of_val(build);
    let pattern = pattern(None, 16.0);
    meter
        .call("tracks::build, 256 vertices", bytes, || {
            tracks::build(&area, &pattern, &transit, build, tracks)
        })
        .expect("lanes");
    sum.tracks(tracks);
    let few = vehicles(LIMITED_VEHICLES);
    let work = Work { tracks, transit: &transit, vehicles: &few, heights: HEIGHTS, unit: Unit::Waypoint };
    meter
        .call("pack::binpat, 3 around zones", size_of_val(&powell.pack), || {
            pack::binpat(&work, &mut powell.pack, plan)
        })
        .expect("routes");
    sum.plan(plan);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::boxed::Box;

    use super::*;

    struct Desk;

    impl Meter for Desk {
        fn call<T>(&mut self, _: &'static str, _: usize, work: impl FnOnce() -> T) -> T {
            work()
        }
    }

    #[test]
    fn all_calls_are_made_and_the_sum_is_the_same_again() {
        let mut lent = Box::<Coverage>::default();
        let first = run(&mut Desk, &mut lent);
        assert_eq!(run(&mut Desk, &mut lent), first);
        std::println!("lent {} bytes", size_of::<Coverage>());
    }
}
