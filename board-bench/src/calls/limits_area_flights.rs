//! Calls on the flights of a divided area, on divisions after losses, and on detours home above the
//! area, with extreme and invalid arguments.

use planner_core::Point;
use planner_core::coverage::flights::{self, CaptureSettings, FlightInputs, Pad};
use planner_core::coverage::losses::{self, DivisionProblem, VehicleStatus};
use planner_core::coverage::pack::{
    CoverageProblem, PackWorkspace, Route, RouteDirection, RoutePlan, TrackUnit, Vehicle,
};
use planner_core::coverage::{CoverageError, Flat, around};
use planner_core::detour::{DetourError, DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::{HeadingMode, Path, Trigger, VehiclePlan, WaypointRange};
use planner_core::map::field::follow::TerrainFollowing;
use planner_core::map::field::{self, FieldShape, FieldView};
use planner_core::plan::{PlanError, SwarmPlan};
use planner_core::schedule::{ScheduleConfig, ScheduleWorkspace};

use super::coverage_flights;
use super::limits_coverage::{
    self as coverage, CORNERS, FLEET, HEIGHTS, LANES, Lanes, VEHICLES, ZoneTransit,
};
use super::limits_results::{
    CallListener, EXTREME_NUMBERS, Results, extreme_points, heights_with_extreme_number,
    is_positive_and_finite,
};

/// Capacities of these calls: waypoints and gates of one vehicle's plan.
const WAYPOINTS: usize = 24;
const GATES: usize = 8;

type Flights = SwarmPlan<VEHICLES, WAYPOINTS>;

/// A closure that plans the flights of given routes by `flights::plan_flights`, and checks the
/// result.
type PlanCall<'p> =
    dyn FnMut(&AreaWork<'_>, &RoutePlan<VEHICLES>, &FlightInputs<'_>) -> PlanResult + 'p;
type AreaWork<'w> = CoverageProblem<'w, LANES, CORNERS>;
type PlanResult = Result<(), PlanError>;

/// Memory that is lent to the calls.
pub(super) struct FlightWorkspaces {
    area: coverage::CoverageMemory,
    losses: losses::LossesWorkspace<LANES, VEHICLES>,
    out: Flights,
    own: VehiclePlan<WAYPOINTS, GATES>,
}

impl FlightWorkspaces {
    /// Empty workspaces, whose bytes are all zeros.
    pub(super) const fn new() -> Self {
        Self {
            area: coverage::CoverageMemory::new(),
            losses: losses::LossesWorkspace::new(),
            out: SwarmPlan::new(),
            own: VehiclePlan::new(),
        }
    }
}

const PAD: Pad = Pad {
    vehicle_id: 1,
    path_start: Point::new(-5.0, -5.0, 1.5),
    climb_m: 1.5,
    path_end_z_m: 1.5,
    descent_m: 1.5,
    airborne: false,
};
const PADS: [Pad; VEHICLES] = [
    PAD,
    Pad { vehicle_id: 2, path_start: Point::new(5.0, -5.0, 1.5), ..PAD },
    Pad { vehicle_id: 3, path_start: Point::new(15.0, -5.0, 1.5), ..PAD },
];
const FLIGHT_INPUTS: FlightInputs<'_> = FlightInputs {
    pads: &PADS,
    capture: CaptureSettings {
        max_picture_spacing_m: 10.0,
        heading_mode: HeadingMode::Ahead,
        trigger: Trigger::None,
    },
    max_gates: GATES,
    ..coverage_flights::FLIGHT_INPUTS
};

/// Makes all calls on coverage: areas and lanes, flights, divisions, detours home.
pub(super) fn call_area_flights(
    to: &mut Results<'_, impl CallListener>,
    schedule: &mut ScheduleWorkspace,
    lent: &mut FlightWorkspaces,
) {
    let FlightWorkspaces { area, losses, out, own } = lent;
    coverage::call_coverage(to, area);
    let mut transit = ZoneTransit::empty();
    transit.set_area(coverage::test_area()).expect("there is room");
    let good = division_work(&area.tracks, &transit);
    call_flight_plans(to, &good, &area.plan, schedule, out);
    let pack = &mut area.powell.pack;
    call_divisions(to, &good, &area.plan, &mut BorrowedWorkspaces { losses, pack, schedule, out });
    call_detours_home(to, &transit, own);
}

fn division_work<'a>(
    tracks: &'a Lanes,
    transit: &'a ZoneTransit<'a>,
) -> CoverageProblem<'a, LANES, CORNERS> {
    CoverageProblem {
        tracks,
        transit,
        vehicles: &FLEET,
        heights: HEIGHTS,
        unit: TrackUnit::Waypoint,
        following: None,
    }
}

/// Whether all waypoints of all flights have finite coordinates.
fn has_finite_waypoints(out: &Flights) -> bool {
    let places = out.flights.iter().flat_map(|flight| flight.path.waypoints());
    places.into_iter().all(|waypoint| waypoint.position.iter().all(|c| c.is_finite()))
}

fn call_flight_plans(
    to: &mut Results<'_, impl CallListener>,
    good: &CoverageProblem<'_, LANES, CORNERS>,
    routes: &RoutePlan<VEHICLES>,
    ws: &mut ScheduleWorkspace,
    out: &mut Flights,
) {
    let mut plan = |work: &CoverageProblem<'_, LANES, CORNERS>,
                    routes: &RoutePlan<VEHICLES>,
                    flight_inputs: &FlightInputs<'_>| {
        let result = to.call("flights::plan_flights", || {
            flights::plan_flights(work, routes, flight_inputs, ws, out)
        });
        to.add_count(usize::from(result.is_ok()));
        assert!(result.is_err() || has_finite_waypoints(out), "{flight_inputs:?}");
        result
    };
    assert_eq!(plan(good, routes, &FLIGHT_INPUTS), Ok(()));
    for hard in EXTREME_NUMBERS {
        for heights in heights_with_extreme_number(HEIGHTS, hard) {
            let planned = plan(&CoverageProblem { heights, ..*good }, routes, &FLIGHT_INPUTS);
            assert_eq!(matches!(planned, Err(PlanError::Config(_))), !is_positive_and_finite(hard));
        }
        call_hard_vehicles(&mut plan, good, routes, hard);
        for look in [HeadingMode::Ahead, HeadingMode::FixedEnuRad(hard)] {
            for assumed_clearance_m in [10.0, hard] {
                let capture = CaptureSettings {
                    max_picture_spacing_m: hard,
                    heading_mode: look,
                    ..FLIGHT_INPUTS.capture
                };
                let inputs = FlightInputs { capture, assumed_clearance_m, ..FLIGHT_INPUTS };
                let planned = plan(good, routes, &inputs);
                assert!(is_positive_and_finite(hard) || planned.is_err());
            }
        }
        let schedule = ScheduleConfig { separation_m: hard, ..FLIGHT_INPUTS.schedule };
        let planned = plan(good, routes, &FlightInputs { schedule, ..FLIGHT_INPUTS });
        assert!(is_positive_and_finite(hard) || matches!(planned, Err(PlanError::Config(_))));
    }
    let pads = [PADS[0], PADS[0], PADS[2]];
    assert_eq!(
        plan(good, routes, &FlightInputs { pads: &pads, ..FLIGHT_INPUTS }),
        Err(PlanError::SameId(1))
    );
    assert_eq!(
        plan(good, routes, &FlightInputs { pads: &PADS[1..], ..FLIGHT_INPUTS }),
        Err(PlanError::CountMismatch)
    );
    let ranges = [WaypointRange { first: 4, end: 9 }, WaypointRange { first: 8, end: u32::MAX }];
    let planned = plan(good, routes, &FlightInputs { done_waypoints: &ranges, ..FLIGHT_INPUTS });
    assert_eq!(planned, Err(PlanError::CountMismatch));
    for done in [&ranges[..1], &ranges[1..]] {
        let _ = plan(good, routes, &FlightInputs { done_waypoints: done, ..FLIGHT_INPUTS });
    }
    for (max_gates, occupied_layers) in [(0, 0), (usize::MAX, u64::MAX)] {
        let _ = plan(good, routes, &FlightInputs { max_gates, occupied_layers, ..FLIGHT_INPUTS });
    }
    call_unusual_routes(&mut plan, good, routes);
    call_field_plans(&mut plan, good, routes);
}

/// Plans with `hard` in one field of the second vehicle or of its pad.
fn call_hard_vehicles(
    plan: &mut PlanCall<'_>,
    good: &CoverageProblem<'_, LANES, CORNERS>,
    routes: &RoutePlan<VEHICLES>,
    hard: f32,
) {
    let vehicle = FLEET[1];
    for vehicle in [
        Vehicle { home: Flat::new(hard, -5.0), ..vehicle },
        Vehicle { cruise_mps: hard, ..vehicle },
        Vehicle { climb_mps: hard, ..vehicle },
        Vehicle { descend_mps: hard, ..vehicle },
    ] {
        let vehicles = [FLEET[0], vehicle, FLEET[2]];
        let planned =
            plan(&CoverageProblem { vehicles: &vehicles, ..*good }, routes, &FLIGHT_INPUTS);
        assert!(hard.is_finite() || planned == Err(PlanError::BadTask(2)));
    }
    let pad = PADS[1];
    for pad in [
        Pad { path_start: Point::new(5.0, -5.0, hard), ..pad },
        Pad { path_end_z_m: hard, ..pad },
        Pad { climb_m: hard, ..pad },
        Pad { descent_m: hard, ..pad },
        Pad { path_start: Point::new(hard, hard, 30.0), climb_m: 0.0, airborne: true, ..pad },
    ] {
        let pads = [PADS[0], pad, PADS[2]];
        let planned = plan(good, routes, &FlightInputs { pads: &pads, ..FLIGHT_INPUTS });
        assert!(hard.is_finite() || planned == Err(PlanError::BadTask(2)));
    }
}

/// Plans with unusual routes. An unknown vehicle or a wrong waypoint range must be refused; an odd
/// direction or layer may be planned or refused; no routes at all must be planned.
fn call_unusual_routes(
    plan: &mut PlanCall<'_>,
    good: &CoverageProblem<'_, LANES, CORNERS>,
    routes: &RoutePlan<VEHICLES>,
) {
    let first = routes.routes[0];
    let count = good.tracks.waypoint_count();
    for route in [
        Route { vehicle_index: u8::MAX, ..first },
        Route { waypoint_end: first.lowest_waypoint, ..first },
        Route { waypoint_end: count + 1, ..first },
        Route { lowest_waypoint: u32::MAX, waypoint_end: u32::MAX, ..first },
    ] {
        let mut routes = routes.clone();
        routes.routes[0] = route;
        assert_eq!(plan(good, &routes, &FLIGHT_INPUTS), Err(PlanError::CountMismatch));
    }
    for (direction, layer) in [(RouteDirection::Backward, 0), (RouteDirection::Forward, u8::MAX)] {
        let mut routes = routes.clone();
        routes.routes[0] = Route { direction, layer, ..first };
        let _ = plan(good, &routes, &FLIGHT_INPUTS);
    }
    let aloft = PADS.map(|pad| Pad {
        path_start: pad.path_start + Point::new(0.0, 0.0, 40.0),
        airborne: true,
        ..pad
    });
    assert_eq!(
        plan(good, &RoutePlan::new(), &FlightInputs { pads: &aloft, ..FLIGHT_INPUTS }),
        Ok(())
    );
    assert_eq!(plan(good, &RoutePlan::new(), &FLIGHT_INPUTS), Ok(()));
}

/// Plans flights above a height field, with extreme settings for terrain following.
fn call_field_plans(
    plan: &mut PlanCall<'_>,
    good: &CoverageProblem<'_, LANES, CORNERS>,
    routes: &RoutePlan<VEHICLES>,
) {
    let mut file = [0; 64];
    let field = uneven_field(&mut file);
    for hard in EXTREME_NUMBERS {
        let usual =
            TerrainFollowing { field, min_height_m: 30.0, tolerance_m: 3.0, max_slope: 0.5 };
        for following in [
            usual,
            TerrainFollowing { min_height_m: hard, ..usual },
            TerrainFollowing { tolerance_m: hard, ..usual },
            TerrainFollowing { max_slope: hard, ..usual },
        ] {
            let _ =
                plan(good, routes, &FlightInputs { following: Some(following), ..FLIGHT_INPUTS });
        }
    }
}

/// A height field with uneven ground below the area.
fn uneven_field(file: &mut [u8]) -> FieldView<'_> {
    let shape =
        FieldShape { south_west: Flat::new(-20.0, -20.0), cell_m: 40.0, columns: 2, rows: 3 };
    let length = field::write(&shape, &[0, 20, 40, 10, -30, 50], file).expect("it fits");
    FieldView::parse(&file[..length]).expect("a field")
}

struct BorrowedWorkspaces<'m> {
    losses: &'m mut losses::LossesWorkspace<LANES, VEHICLES>,
    pack: &'m mut PackWorkspace<VEHICLES>,
    schedule: &'m mut ScheduleWorkspace,
    out: &'m mut Flights,
}

fn call_divisions(
    to: &mut Results<'_, impl CallListener>,
    good: &CoverageProblem<'_, LANES, CORNERS>,
    routes: &RoutePlan<VEHICLES>,
    memory: &mut BorrowedWorkspaces<'_>,
) {
    *memory.losses = to.call("losses::LossesWorkspace::new", losses::LossesWorkspace::new);
    let all = good.tracks.waypoint_count();
    for (first, end) in
        [(0, 0), (1, 3), (all, all), (3, 1), (0, u32::MAX), (u32::MAX, u32::MAX), (0, all)]
    {
        let done = [WaypointRange { first, end }];
        let begun = to.call("losses::LossesWorkspace::reset_with_done", || {
            memory.losses.reset_with_done(good.tracks, good.transit, &done).is_ok()
        });
        to.add_count(usize::from(begun));
        let done = to.call("losses::LossesWorkspace::done", || memory.losses.done().len());
        assert!(done <= 1);
    }
    let fate = VehicleStatus { continues: true, photographed_to_m: 60.0 };
    let lost = VehicleStatus { continues: false, photographed_to_m: 60.0 };
    for hard in EXTREME_NUMBERS {
        for hit in [
            VehicleStatus { photographed_to_m: hard, ..fate },
            VehicleStatus { photographed_to_m: hard, ..lost },
        ] {
            for statuses in
                [&[fate, hit, fate][..], &[hit; VEHICLES], &[lost, hit, lost], &[hit, fate], &[]]
            {
                memory
                    .losses
                    .reset_with_done(good.tracks, good.transit, &[])
                    .expect("nothing is done");
                flights::plan_flights(good, routes, &FLIGHT_INPUTS, memory.schedule, memory.out)
                    .expect("as before");
                let mut routes = routes.clone();
                let division =
                    DivisionProblem { problem: good, flight_inputs: &FLIGHT_INPUTS, statuses };
                let divided = call_redivide(to, &division, memory, &mut routes);
                assert!(
                    statuses.len() == VEHICLES || divided == Err(CoverageError::Vehicles.into())
                );
                let setting = Err(CoverageError::SettingOutOfRange("photographed_to_m").into());
                assert!(statuses.len() != VEHICLES || hard >= 0.0 || divided == setting);
                to.add_count(routes.routes.len());
                // The same division again: what is already done must not be divided again.
                let _ = call_redivide(to, &division, memory, &mut routes);
                if let Some(route) = routes.routes.first_mut() {
                    route.vehicle_index = u8::MAX;
                    let unknown = call_redivide(to, &division, memory, &mut routes);
                    assert_eq!(unknown, Err(CoverageError::Vehicles.into()));
                }
            }
        }
    }
}

fn call_redivide(
    to: &mut Results<'_, impl CallListener>,
    division: &DivisionProblem<'_, LANES, CORNERS>,
    memory: &mut BorrowedWorkspaces<'_>,
    routes: &mut RoutePlan<VEHICLES>,
) -> Result<(), losses::LossesError> {
    let BorrowedWorkspaces { losses, pack, schedule, out } = memory;
    let divided = to.call("losses::redivide_work", || {
        losses::redivide_work(division, losses, pack, schedule, routes, out)
    });
    assert!(divided.is_err() || has_finite_waypoints(out), "{:?}", division.statuses);
    to.add_count(usize::from(divided.is_ok()));
    divided
}

fn call_detours_home(
    to: &mut Results<'_, impl CallListener>,
    transit: &ZoneTransit<'_>,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    let mut file = [0; 64];
    let field = uneven_field(&mut file);
    let here = Point::new(30.0, 20.0, 35.0);
    let over = Point::new(-5.0, -5.0, 1.5);
    let good = DetourRequest {
        land_aside: false,
        here,
        leg: [here; 2],
        leg_clearance_m: 10.0,
        goal: DetourGoal::Point { end: over, layer_z_m: 40.0 },
        descent_m: 1.5,
        required_clearance_m: 0.8,
        fence: None,
    };
    let natures = [ZoneKind::Static, ZoneKind::LandingColumn, ZoneKind::Grounded];
    for (i, p) in extreme_points().enumerate() {
        let hard = EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()];
        let thing = KeepOutZone { from: p, to: here, radius_m: hard, kind: natures[i % 3] };
        for request in [
            good,
            DetourRequest { land_aside: true, ..good },
            DetourRequest { here: p, ..good },
            DetourRequest { here: p, land_aside: true, ..good },
            DetourRequest { descent_m: hard, ..good },
            DetourRequest { required_clearance_m: hard, ..good },
            DetourRequest { goal: DetourGoal::Point { end: p, layer_z_m: 40.0 }, ..good },
            DetourRequest { goal: DetourGoal::Point { end: over, layer_z_m: hard }, ..good },
            DetourRequest { goal: DetourGoal::RoadmapGoal(0), ..good },
            DetourRequest { fence: Some((p, here)), ..good },
        ] {
            for field in [None, Some(field)] {
                let mut path = Path::<WAYPOINTS>::new();
                let bad = request.check().is_err() || thing.check().is_err();
                let found = to.call("around::plan_detour", || {
                    around::plan_detour(transit, field, &request, &mut [thing], &mut path)
                });
                assert_eq!(
                    matches!(found, Err(DetourError::Config(_))),
                    bad,
                    "{request:?} {thing:?}"
                );
                let finite =
                    path.waypoints().iter().all(|w| w.position.iter().all(|c| c.is_finite()));
                assert!(found.is_err() || finite);
                to.add_count(usize::from(found.is_ok()));
                let again = to.call("around::plan_detour_for_vehicle", || {
                    around::plan_detour_for_vehicle(transit, field, &request, &mut [thing], own)
                });
                assert_eq!(again, found);
                let mut short = Path::<1>::new();
                to.add_count(usize::from(
                    around::plan_detour(transit, field, &request, &mut [], &mut short).is_ok(),
                ));
            }
        }
    }
}
