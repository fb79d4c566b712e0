//! Calls on areas, lanes and their division with extreme and invalid arguments.

use heapless::Vec;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::footprint::Spacing;
use planner_core::coverage::pack::{
    self, CoverageProblem, Heights, PackWorkspace, Route, RouteDirection, RoutePlan, TrackUnit,
    Vehicle,
};
use planner_core::coverage::powell::{self, powell};
use planner_core::coverage::tracks::{self, Lane, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;
use planner_core::coverage::{CoverageError, Flat, bound, divide, exact, given, sweep};
use planner_core::flight::{WaypointRange, WaypointSet};

use super::limits_cameras::{SPACING, call_cameras};
use super::limits_results::{CallListener, EXTREME_NUMBERS, Results, heights_with_extreme_number};

/// Capacities of these calls: lanes, vertices, corners of no-fly zones, vehicles.
pub(super) const LANES: usize = 8;
pub(super) const VERTICES: usize = 12;
pub(super) const CORNERS: usize = 4;
pub(super) const VEHICLES: usize = 3;
/// Waypoint numbers and range ends that are tried.
const WAYPOINT_NUMBERS: [u32; 6] = [0, 1, 7, 1 << 24, u32::MAX - 1, u32::MAX];

const AREA_AND_ZONE_VERTICES: [Flat; 8] = [
    Flat::new(0.0, 0.0),
    Flat::new(40.0, 0.0),
    Flat::new(40.0, 30.0),
    Flat::new(0.0, 30.0),
    Flat::new(12.0, 12.0),
    Flat::new(18.0, 12.0),
    Flat::new(18.0, 17.0),
    Flat::new(12.0, 17.0),
];
const RINGS: [Ring; 2] =
    [Ring { end: 4, kind: RingKind::Outer }, Ring { end: 8, kind: RingKind::NoFly }];
const PATTERN: LanePattern = LanePattern {
    spacing: SPACING,
    angle_from_east_deg: None,
    border_overshoot_m: 0.0,
    max_search_steps: 100,
};
pub(super) const HEIGHTS: Heights = Heights { max_picture_height_m: 35.0, layer_spacing_m: 5.0 };

const VEHICLE: Vehicle = Vehicle {
    transit_start: Flat::new(-5.0, -5.0),
    home: Flat::new(-5.0, -5.0),
    cruise_mps: 5.0,
    climb_mps: 3.0,
    descend_mps: 1.0,
    weight: 1.0,
};
pub(super) const FLEET: [Vehicle; VEHICLES] = [
    VEHICLE,
    Vehicle { transit_start: Flat::new(5.0, -5.0), home: Flat::new(5.0, -5.0), ..VEHICLE },
    Vehicle { transit_start: Flat::new(15.0, -5.0), home: Flat::new(15.0, -5.0), ..VEHICLE },
];
/// Equal shares of the path for all vehicles.
const SHARES: [f32; VEHICLES] = [1.0; VEHICLES];

pub(super) type Lanes = Tracks<LANES>;
pub(super) type ZoneTransit<'a> = TransitGraph<'a, CORNERS>;

/// Memory that is lent to the coverage calls with extreme arguments.
pub(super) struct CoverageMemory {
    pub(super) tracks: Lanes,
    remaining: Lanes,
    build: tracks::LaneWorkspace<VERTICES>,
    pub(super) powell: powell::PowellWorkspace<VEHICLES>,
    pub(super) plan: RoutePlan<VEHICLES>,
}

impl CoverageMemory {
    /// Empty memory, whose bytes are all zeros.
    pub(super) const fn new() -> Self {
        Self {
            tracks: Tracks::new(),
            remaining: Tracks::new(),
            build: tracks::LaneWorkspace::new(),
            powell: powell::PowellWorkspace::new(),
            plan: RoutePlan::new(),
        }
    }
}

/// Makes all calls on areas, lanes and divisions. Leaves lanes and routes of [`test_area`] in
/// `lent`.
pub(super) fn call_coverage(to: &mut Results<'_, impl CallListener>, lent: &mut CoverageMemory) {
    call_waypoint_sets(to);
    call_cameras(to);
    call_areas(to);
    let area = test_area();
    let mut transit = to.call("transit::TransitGraph::empty", ZoneTransit::empty);
    call_transits(to, &mut transit);
    call_lanes(to, &area, &transit, lent);
    call_divisions(to, &transit, lent);
    call_packing(to, &transit, lent);
    call_share_searches(to, &transit, lent);
}

/// An area of 40 by 30 m with a no-fly zone inside.
pub(super) fn test_area() -> Area<'static> {
    Area::new(&AREA_AND_ZONE_VERTICES, &RINGS).expect("an area")
}

fn call_areas(to: &mut Results<'_, impl CallListener>) {
    for x in EXTREME_NUMBERS {
        for y in EXTREME_NUMBERS {
            let mut vertices = AREA_AND_ZONE_VERTICES;
            vertices[2] = Flat::new(x, y);
            let found = to.call("area::Area::new", || Area::new(&vertices, &RINGS));
            to.add_count(usize::from(found.is_ok()));
            let place = Flat::new(x, y);
            let holds = to.call("area::Area::contains", || test_area().contains(&place));
            let forbids =
                to.call("area::Area::is_in_no_fly_zone", || test_area().is_in_no_fly_zone(&place));
            assert!(holds || !forbids, "the zone lies in the area");
            let Ok(area) = found else { continue };
            let mut hull: Vec<Flat, VERTICES> = Vec::new();
            let direction = to.call("sweep::direction_of_least_width", || {
                sweep::direction_of_least_width(&area, &mut hull)
            });
            assert!(direction.is_ok_and(|found| (found.along.norm() - 1.0).abs() < 1e-3));
            to.add(direction.map_or(0.0, |found| found.across.x));
        }
        let direction = to.call("sweep::LaneDirection::at_deg", || sweep::LaneDirection::at_deg(x));
        to.add(direction.along.x);
    }
    let rings = |ends: [u16; 2], kind: RingKind| ends.map(|end| Ring { end, kind });
    for (end, kind) in [
        (0, RingKind::Outer),
        (9, RingKind::Outer),
        (u16::MAX, RingKind::NoFly),
        (4, RingKind::Hole),
    ] {
        for rings in [rings([end, 8], kind), rings([4, end], kind), rings([end, end], kind)] {
            let found = to.call("area::Area::new", || Area::new(&AREA_AND_ZONE_VERTICES, &rings));
            assert!(found.is_err());
        }
    }
    assert!(Area::new(&[], &[]).is_err());
    let area = test_area();
    for index in [0, 1, 2, usize::MAX] {
        let ring = to.call("area::Area::ring", || area.ring(index));
        assert_eq!(ring.len(), if index < 2 { 4 } else { 0 });
    }
    assert_eq!(to.call("area::Area::vertices", || area.vertices()).len(), 8);
    assert_eq!(to.call("area::Area::rings", || area.rings()).len(), 2);
    assert!(to.call("area::Area::has_no_fly", || area.has_no_fly()));
    let mut none: Vec<Flat, 2> = Vec::new();
    assert!(sweep::direction_of_least_width(&area, &mut none).is_err(), "no room for the hull");
}

fn call_transits(to: &mut Results<'_, impl CallListener>, transit: &mut ZoneTransit<'static>) {
    let mut small = TransitGraph::<3>::empty();
    let full = to.call("transit::TransitGraph::set_area", || small.set_area(test_area()));
    assert_eq!(full, Err(CoverageError::NoFlyFull));
    for known in [false, true] {
        if known {
            assert_eq!(
                to.call("transit::TransitGraph::set_area", || transit.set_area(test_area())),
                Ok(())
            );
        }
        let corners = to.call("transit::TransitGraph::corners", || transit.corners().len());
        assert_eq!(corners, if known { CORNERS } else { 0 });
        for x in EXTREME_NUMBERS {
            for y in EXTREME_NUMBERS {
                let (from, there) = (Flat::new(x, y), Flat::new(15.0, 40.0));
                let forbids = to.call("transit::TransitGraph::is_in_no_fly_zone", || {
                    transit.is_in_no_fly_zone(&from)
                });
                assert!(known || !forbids);
                let clear = to.call("transit::TransitGraph::is_line_clear", || {
                    transit.is_line_clear(&from, &there)
                });
                to.add_count(usize::from(clear));
                let distance_m = || transit.distance_m(&from, &there);
                let far_m = to.call("transit::TransitGraph::distance_m", distance_m);
                to.add(far_m);
                let mut corners: Vec<Flat, CORNERS> = Vec::new();
                let way = to.call("transit::TransitGraph::shortest_path", || {
                    transit.shortest_path(&from, &there, &mut corners)
                });
                to.add_count(usize::from(way.is_ok()));
                to.add_count(corners.len());
                let back = transit.shortest_path(&there, &from, &mut corners);
                to.add_count(usize::from(back.is_ok()));
            }
        }
    }
}

fn call_lanes(
    to: &mut Results<'_, impl CallListener>,
    area: &Area<'_>,
    transit: &ZoneTransit<'_>,
    lent: &mut CoverageMemory,
) {
    let CoverageMemory { tracks, build, .. } = lent;
    *build = to.call("strips::LaneWorkspace::new", tracks::LaneWorkspace::new);
    *tracks = to.call("lanes::Tracks::new", Tracks::new);
    call_waypoint_numbers(to, tracks);
    for hard in EXTREME_NUMBERS {
        for pattern in [
            LanePattern { angle_from_east_deg: Some(hard), ..PATTERN },
            LanePattern { border_overshoot_m: hard, ..PATTERN },
            LanePattern { spacing: Spacing { max_lane_spacing_m: hard, ..SPACING }, ..PATTERN },
            LanePattern {
                spacing: Spacing { max_waypoint_spacing_m: hard, ..SPACING },
                max_search_steps: u32::MAX,
                ..PATTERN
            },
            LanePattern { max_search_steps: 0, ..PATTERN },
        ] {
            let built = to.call("tracks::build_lanes", || {
                tracks::build_lanes(area, &pattern, transit, build, tracks)
            });
            to.add_count(usize::from(built.is_ok()));
            if built.is_ok() {
                call_waypoint_numbers(to, tracks);
            }
        }
        for end in EXTREME_NUMBERS {
            let (from, end) = (Flat::new(hard, 0.0), Flat::new(0.0, end));
            for count in WAYPOINT_NUMBERS {
                let (first_waypoint, waypoint_count, start_along_m) = (count, count, 0.0);
                let lane =
                    Lane { from, to: end, first_waypoint, waypoint_count, start_along_m, strip: 0 };
                let length_m = to.call("lanes::Lane::length_m", || lane.length_m());
                to.add(length_m);
                let place = to.call("lanes::Lane::waypoint", || lane.waypoint(u32::MAX));
                to.add(place.x);
            }
        }
    }
    call_given_lanes(to, transit, tracks);
    let many = LanePattern { spacing: Spacing { max_lane_spacing_m: 1.0, ..SPACING }, ..PATTERN };
    assert_eq!(
        tracks::build_lanes(area, &many, transit, build, tracks),
        Err(CoverageError::LanesFull)
    );
    assert_eq!(tracks::build_lanes(area, &PATTERN, transit, build, tracks), Ok(()));
    call_waypoint_numbers(to, tracks);
}

/// Calls of `given::order_given_lanes`: with no lanes, with parallel ones, and with extreme ends.
fn call_given_lanes(
    to: &mut Results<'_, impl CallListener>,
    transit: &ZoneTransit<'_>,
    tracks: &mut Lanes,
) {
    let lane = |x: f32, y: f32| [Flat::new(0.0, y), Flat::new(x, y)];
    for hard in EXTREME_NUMBERS {
        let lanes = [lane(30.0, 0.0), lane(30.0, 8.0), lane(hard, 16.0), lane(9.0, hard)];
        for count in [0, 2, 3, 4] {
            let ordered = to.call("given::order_given_lanes", || {
                given::order_given_lanes(&lanes[..count], &SPACING, 100, transit, tracks)
            });
            to.add_count(usize::from(ordered.is_ok()));
            assert!(count > 2 || ordered.is_ok() == (count == 2));
        }
    }
}

/// Calls with waypoint numbers that exist and that do not.
fn call_waypoint_numbers(to: &mut Results<'_, impl CallListener>, tracks: &Lanes) {
    let count = to.call("lanes::Tracks::waypoint_count", || tracks.waypoint_count());
    let lanes = to.call("lanes::Tracks::lanes", || tracks.lanes().len());
    let along = to.call("lanes::Tracks::lane_direction", || tracks.lane_direction());
    let length_m = to.call("lanes::Tracks::length_m", || tracks.length_m());
    for number in WAYPOINT_NUMBERS.into_iter().chain([count, count.saturating_sub(1)]) {
        let lane = to.call("lanes::Tracks::lane_of", || tracks.lane_of(number));
        assert!(lane < lanes.max(1));
        let place = to.call("lanes::Tracks::waypoint", || tracks.waypoint(number));
        assert_eq!(place.is_some(), number < count);
        let along_m = to.call("lanes::Tracks::distance_to_waypoint_m", || {
            tracks.distance_to_waypoint_m(number)
        });
        assert!(along_m <= length_m * 1.001);
        to.add(along_m + along.x);
    }
}

fn call_divisions(
    to: &mut Results<'_, impl CallListener>,
    transit: &ZoneTransit<'_>,
    lent: &mut CoverageMemory,
) {
    let CoverageMemory { tracks, remaining: left, .. } = lent;
    for first in WAYPOINT_NUMBERS {
        for end in WAYPOINT_NUMBERS {
            let done = [WaypointRange { first: 0, end: 2 }, WaypointRange { first, end }];
            for done in [&done[..], &done[1..]] {
                let found = to.call("divide::remaining_lanes", || {
                    divide::remaining_lanes(tracks, done, transit, left)
                });
                assert!(found.is_err() || first <= end && end <= tracks.waypoint_count());
                to.add_count(usize::from(found.is_ok()));
                for number in WAYPOINT_NUMBERS {
                    let whole = to.call("divide::number_on_whole_path", || {
                        divide::number_on_whole_path(done, number)
                    });
                    assert!(whole >= number);
                    to.add_count(whole as usize);
                }
            }
        }
    }
    let all = [WaypointRange { first: 0, end: tracks.waypoint_count() }];
    assert_eq!(
        divide::remaining_lanes(tracks, &all, transit, left),
        Err(CoverageError::NothingToCover)
    );
    let mut none = Tracks::<1>::new();
    assert!(divide::remaining_lanes(&none.clone(), &[], transit, &mut none).is_err());
}

/// [`FLEET`] six times, each time with `hard` in another field of the second vehicle.
fn fleets_with_extreme_number(hard: f32) -> [[Vehicle; VEHICLES]; 6] {
    let with = |vehicle: Vehicle| [FLEET[0], vehicle, FLEET[2]];
    [
        with(Vehicle { transit_start: Flat::new(hard, 0.0), ..VEHICLE }),
        with(Vehicle { home: Flat::new(0.0, hard), ..VEHICLE }),
        with(Vehicle { cruise_mps: hard, ..VEHICLE }),
        with(Vehicle { climb_mps: hard, ..VEHICLE }),
        with(Vehicle { descend_mps: hard, ..VEHICLE }),
        with(Vehicle { weight: hard, ..VEHICLE }),
    ]
}

/// All of the path, for the whole fleet.
fn whole_work<'a>(
    tracks: &'a Tracks<LANES>,
    transit: &'a ZoneTransit<'_>,
) -> CoverageProblem<'a, LANES, CORNERS> {
    let unit = TrackUnit::Waypoint;
    CoverageProblem { tracks, transit, vehicles: &FLEET, heights: HEIGHTS, unit, following: None }
}

fn call_packing(
    to: &mut Results<'_, impl CallListener>,
    transit: &ZoneTransit<'_>,
    lent: &mut CoverageMemory,
) {
    let CoverageMemory { tracks, powell, plan, .. } = lent;
    *plan = to.call("pack::RoutePlan::new", RoutePlan::new);
    let ws = &mut powell.pack;
    *ws = to.call("pack::PackWorkspace::new", PackWorkspace::new);
    let good = whole_work(tracks, transit);
    let pack = |to: &mut Results<'_, _>,
                work: &CoverageProblem<'_, LANES, CORNERS>,
                ws: &mut _,
                plan: &mut RoutePlan<_>| {
        let checked = to.call("pack::CoverageProblem::check", || work.check::<VEHICLES>());
        let packed = to.call("pack::binpat", || pack::binpat(work, ws, plan));
        assert!(checked.is_ok() || packed == checked);
        to.add_count(usize::from(packed.is_ok()));
        let shares = to.call("pack::PackWorkspace::shares", || *ws.shares());
        shares.iter().for_each(|share| to.add(*share));
        for vehicle in work.vehicles {
            let delay_s = || work.altitude_delay_s(vehicle, u8::MAX);
            let delay_s = to.call("pack::CoverageProblem::altitude_delay_s", delay_s);
            to.add(delay_s);
        }
        let max_s = to.call("pack::RoutePlan::max_cost_s", || plan.max_cost_s());
        to.add(max_s);
        for route in &plan.routes {
            let mut waypoints = to.call("pack::Route::waypoints", || route.waypoints());
            let ends = to.call("pack::Route::first_and_last", || route.first_and_last());
            assert_eq!(waypoints.next(), Some(ends.0));
            to.add_count((ends.0 ^ ends.1) as usize);
        }
    };
    for hard in EXTREME_NUMBERS {
        for unit in [TrackUnit::Lane, TrackUnit::Waypoint] {
            for heights in heights_with_extreme_number(HEIGHTS, hard) {
                pack(to, &CoverageProblem { unit, heights, ..good }, ws, plan);
            }
            for vehicles in &fleets_with_extreme_number(hard) {
                pack(to, &CoverageProblem { unit, vehicles, ..good }, ws, plan);
            }
            call_packing_by_shares(to, &CoverageProblem { unit, ..good }, hard, ws, plan);
        }
    }
    let crowd = [VEHICLE; VEHICLES + 1];
    for vehicles in [&crowd[..], &[]] {
        pack(to, &CoverageProblem { vehicles, ..good }, ws, plan);
    }
    let ends = WAYPOINT_NUMBERS.into_iter().zip(WAYPOINT_NUMBERS.into_iter().rev());
    for (lowest_waypoint, waypoint_end) in ends {
        for direction in [RouteDirection::Forward, RouteDirection::Backward] {
            let whole = Route { lowest_waypoint, waypoint_end, direction, ..plan.routes[0] };
            let whole = Route { vehicle_index: u8::MAX, layer: 0, ..whole };
            for route in [whole, Route { lowest_waypoint: waypoint_end, ..whole }] {
                let ends = to.call("pack::Route::first_and_last", || route.first_and_last());
                let waypoints =
                    to.call("pack::Route::waypoints", || route.waypoints().take(3).count());
                to.add_count((ends.0 ^ ends.1) as usize + waypoints);
            }
        }
    }
}

fn call_packing_by_shares(
    to: &mut Results<'_, impl CallListener>,
    work: &CoverageProblem<'_, LANES, CORNERS>,
    hard: f32,
    ws: &mut PackWorkspace<VEHICLES>,
    plan: &mut RoutePlan<VEHICLES>,
) {
    let (tracks, unit) = (work.tracks, work.unit);
    for shares in [&[hard; VEHICLES][..], &[1.0, hard, 0.0], &[hard], &[]] {
        let by_shares = || pack::binpat_by_shares(work, shares, ws, plan);
        let cut = to.call("pack::binpat_by_shares", by_shares);
        assert!(shares.len() == VEHICLES || cut.is_err());
        to.add_count(usize::from(cut.is_ok()));
        let mut ends = [0; VEHICLES];
        to.call("pack::cbinpack", || pack::cbinpack(tracks, unit, shares, &mut ends));
        assert!(ends.iter().all(|end| *end <= tracks.waypoint_count()), "{shares:?}");
        pack::cbinpack(tracks, unit, &SHARES, &mut ends[..1]);
        pack::cbinpack(&Tracks::<LANES>::new(), unit, shares, &mut ends);
    }
}

fn call_share_searches(
    to: &mut Results<'_, impl CallListener>,
    transit: &ZoneTransit<'_>,
    lent: &mut CoverageMemory,
) {
    let CoverageMemory { tracks, powell: ws, plan, .. } = lent;
    *ws = to.call("powell::PowellWorkspace::new", powell::PowellWorkspace::new);
    let good = whole_work(tracks, transit);
    let mut ways_m = [0.0; 512];
    let mut reaches = [0; 1024];
    let mut states = [(0, 0); 1 << (2 * VEHICLES)];
    for hard in EXTREME_NUMBERS {
        for vehicles in &fleets_with_extreme_number(hard) {
            let work = CoverageProblem { vehicles, ..good };
            let checked = work.check::<VEHICLES>();
            let bound = to.call("bound::lower_bound_s", || bound::lower_bound_s(&work));
            assert_eq!(bound.is_ok(), checked.is_ok());
            to.add(bound.unwrap_or(0.0));
            for evaluations in [0, 20] {
                let config = powell::PowellConfig { max_evaluations: evaluations };
                let found = to.call("powell::powell", || powell(&work, &config, ws, plan));
                assert!(checked.is_ok() || found == checked);
                to.add_count(usize::from(found.is_ok()));
                to.add(plan.max_cost_s());
            }
            let mut memory = exact::ExactWorkspace {
                transit_lengths_m: &mut ways_m,
                reachable_ends: &mut reaches,
                states: &mut states,
            };
            let found = to.call("exact::plan_exact", || {
                exact::plan_exact(&work, &mut memory, &mut ws.pack, plan)
            });
            assert!(checked.is_ok() || found == checked);
            to.add_count(usize::from(found.is_ok()));
            to.add(plan.max_cost_s());
        }
    }
    for vehicles in [0, VEHICLES, exact::MAX_EXACT_VEHICLES, usize::MAX] {
        for waypoints in [0, 1, usize::MAX] {
            let lengths = to.call("exact::ExactWorkspace::required_lengths", || {
                exact::ExactWorkspace::required_lengths(vehicles, waypoints)
            });
            assert!(lengths[2] <= 1 << (2 * exact::MAX_EXACT_VEHICLES));
        }
    }
    let (transit_lengths_m, reachable_ends) = (&mut [][..], &mut [][..]);
    let mut small = exact::ExactWorkspace { transit_lengths_m, reachable_ends, states: &mut [] };
    assert_eq!(
        exact::plan_exact(&good, &mut small, &mut ws.pack, plan),
        Err(CoverageError::WorkspaceTooSmall)
    );
    assert_eq!(powell(&good, &powell::PowellConfig { max_evaluations: 50 }, ws, plan), Ok(()));
}

/// Inserts ranges into a set of waypoints: reversed, touching, covering all, or without room.
fn call_waypoint_sets(to: &mut Results<'_, impl CallListener>) {
    let ends = [0, 1, 2, 9, 10, 11, 40, u32::MAX - 1, u32::MAX];
    let mut done = to.call("done::WaypointSet::new", WaypointSet::<2>::new);
    for (first, end) in ends.into_iter().flat_map(|first| ends.map(|end| (first, end))) {
        let before = to.call("done::WaypointSet::count", || done.count());
        let inserted =
            to.call("done::WaypointSet::insert", || done.insert(WaypointRange { first, end }));
        let after = done.count();
        assert_eq!(inserted == Ok(true), after > before, "{first} to {end}: {before}, {after}");
        let ranges = to.call("done::WaypointSet::ranges", || done.ranges().len());
        assert_eq!(to.call("done::WaypointSet::is_empty", || done.is_empty()), ranges == 0);
        to.add_count(after as usize);
        if after == u32::MAX || inserted.is_err() {
            to.call("done::WaypointSet::clear", || done.clear());
        }
    }
}
