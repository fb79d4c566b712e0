//! The calls on the flights of a divided area, on divisions after losses and on ways home at their limits and beyond.

use planner_core::Point;
use planner_core::coverage::flights::{self, Manner, Pad, Swarm};
use planner_core::coverage::losses::{self, Fate, Loss};
use planner_core::coverage::pack::{Heading, Heights, PackWorkspace, Plan, Route, Unit, Vehicle, Work};
use planner_core::coverage::{CoverageError, Flat, around};
use planner_core::detour::{DetourError, DetourRequest, Goal, KeepOff, Nature};
use planner_core::field::follow::Following;
use planner_core::field::{self, FieldShape, FieldView};
use planner_core::flight::{Look, Path, Range, Trigger, VehiclePlan};
use planner_core::plan::{PlanError, SwarmPlan};
use planner_core::schedule::{ScheduleConfig, ScheduleWorkspace};

use super::coverage_flights;
use super::limits::{Answers, HARD_NUMBERS, Listener, points};
use super::limits_coverage::{self as coverage, CORNERS, FLEET, HEIGHTS, LANES, Lanes, VEHICLES, Ways};

/// Waypoints and gates of one vehicle.
const WAYPOINTS: usize = 24;
const GATES: usize = 8;

type Flights = SwarmPlan<VEHICLES, WAYPOINTS>;

/// Memory lent to the calls.
pub(super) struct Lent {
    area: coverage::Lent,
    losses: losses::Workspace<LANES, VEHICLES>,
    out: Flights,
    own: VehiclePlan<WAYPOINTS, GATES>,
}

impl Lent {
    /// All zeros.
    pub(super) const fn new() -> Self {
        Self {
            area: coverage::Lent::new(),
            losses: losses::Workspace::new(),
            out: SwarmPlan::new(),
            own: VehiclePlan::new(),
        }
    }
}

const PAD: Pad = Pad {
    id: 1,
    start: Point::new(-5.0, -5.0, 1.5),
    climb_m: 1.5,
    end_z_m: 1.5,
    descent_m: 1.5,
    aloft: false,
};
const PADS: [Pad; VEHICLES] = [
    PAD,
    Pad { id: 2, start: Point::new(5.0, -5.0, 1.5), ..PAD },
    Pad { id: 3, start: Point::new(15.0, -5.0, 1.5), ..PAD },
];
const SWARM: Swarm<'_> = Swarm {
    pads: &PADS,
    manner: Manner { waypoint_m: 10.0, look: Look::Ahead, trigger: Trigger::None },
    gates_most: GATES,
    ..coverage_flights::SWARM
};

/// Makes all calls on coverage.
pub(super) fn coverage(
    to: &mut Answers<'_, impl Listener>,
    schedule: &mut ScheduleWorkspace,
    lent: &mut Lent,
) {
    let Lent { area, losses, out, own } = lent;
    coverage::coverage(to, area);
    let mut transit = Ways::empty();
    transit.learn(coverage::area()).expect("there is room");
    let good = work(&area.tracks, &transit);
    plans(to, &good, &area.plan, schedule, out);
    let pack = &mut area.powell.pack;
    divisions(to, &good, &area.plan, &mut Memory { losses, pack, schedule, out });
    ways_home(to, &transit, own);
}

fn work<'a>(tracks: &'a Lanes, transit: &'a Ways<'a>) -> Work<'a, LANES, CORNERS> {
    Work { tracks, transit, vehicles: &FLEET, heights: HEIGHTS, unit: Unit::Waypoint }
}

fn is_good(number: f32) -> bool {
    number > 0.0 && number.is_finite()
}

/// Whether every place of every flight is one.
fn is_finite(out: &Flights) -> bool {
    let places = out.flights.iter().flat_map(|flight| flight.path.waypoints());
    places.into_iter().all(|waypoint| waypoint.position.iter().all(|c| c.is_finite()))
}

fn plans(
    to: &mut Answers<'_, impl Listener>,
    good: &Work<'_, LANES, CORNERS>,
    routes: &Plan<VEHICLES>,
    ws: &mut ScheduleWorkspace,
    out: &mut Flights,
) {
    let mut plan = |work: &Work<'_, LANES, CORNERS>, routes: &Plan<VEHICLES>, swarm: &Swarm<'_>| {
        let planned = to.call("flights::plan", || flights::plan(work, routes, swarm, ws, out));
        to.is(planned.is_ok());
        assert!(planned.is_err() || is_finite(out), "{swarm:?}");
        planned
    };
    assert_eq!(plan(good, routes, &SWARM), Ok(()));
    for hard in HARD_NUMBERS {
        for heights in [Heights { mission_m: hard, ..HEIGHTS }, Heights { layer_m: hard, ..HEIGHTS }] {
            let planned = plan(&Work { heights, ..*good }, routes, &SWARM);
            assert_eq!(matches!(planned, Err(PlanError::Config(_))), !is_good(hard));
        }
        let vehicle = FLEET[1];
        for vehicle in [
            Vehicle { home: Flat::new(hard, -5.0), ..vehicle },
            Vehicle { cruise_mps: hard, ..vehicle },
            Vehicle { climb_mps: hard, ..vehicle },
            Vehicle { descend_mps: hard, ..vehicle },
        ] {
            let vehicles = [FLEET[0], vehicle, FLEET[2]];
            let planned = plan(&Work { vehicles: &vehicles, ..*good }, routes, &SWARM);
            assert!(hard.is_finite() || planned == Err(PlanError::BadTask(2)));
        }
        let pad = PADS[1];
        for pad in [
            Pad { start: Point::new(5.0, -5.0, hard), ..pad },
            Pad { end_z_m: hard, ..pad },
            Pad { climb_m: hard, ..pad },
            Pad { descent_m: hard, ..pad },
            Pad { start: Point::new(hard, hard, 30.0), climb_m: 0.0, aloft: true, ..pad },
        ] {
            let pads = [PADS[0], pad, PADS[2]];
            let planned = plan(good, routes, &Swarm { pads: &pads, ..SWARM });
            assert!(hard.is_finite() || planned == Err(PlanError::BadTask(2)));
        }
        for look in [Look::Ahead, Look::Fixed(hard)] {
            for clearance_m in [10.0, hard] {
                let manner = Manner { waypoint_m: hard, look, ..SWARM.manner };
                let planned = plan(good, routes, &Swarm { manner, clearance_m, ..SWARM });
                assert!(is_good(hard) || planned.is_err());
            }
        }
        let schedule = ScheduleConfig { separation_m: hard, ..SWARM.schedule };
        let planned = plan(good, routes, &Swarm { schedule, ..SWARM });
        assert!(is_good(hard) || matches!(planned, Err(PlanError::Config(_))));
    }
    let pads = [PADS[0], PADS[0], PADS[2]];
    assert_eq!(plan(good, routes, &Swarm { pads: &pads, ..SWARM }), Err(PlanError::SameId(1)));
    assert_eq!(plan(good, routes, &Swarm { pads: &PADS[1..], ..SWARM }), Err(PlanError::Terminals));
    let ranges = [Range { first: 4, end: 9 }, Range { first: 8, end: u32::MAX }];
    assert_eq!(plan(good, routes, &Swarm { done: &ranges, ..SWARM }), Err(PlanError::Terminals));
    for done in [&ranges[..1], &ranges[1..]] {
        let _ = plan(good, routes, &Swarm { done, ..SWARM });
    }
    for (gates_most, layers_held) in [(0, 0), (usize::MAX, u64::MAX)] {
        let _ = plan(good, routes, &Swarm { gates_most, layers_held, ..SWARM });
    }
    wrong_routes(&mut plan, good, routes);
    fields(&mut plan, good, routes);
}

/// Plans routes whose lanes or vehicles are not those of the request: each must be refused.
fn wrong_routes(
    plan: &mut impl FnMut(&Work<'_, LANES, CORNERS>, &Plan<VEHICLES>, &Swarm<'_>) -> Result<(), PlanError>,
    good: &Work<'_, LANES, CORNERS>,
    routes: &Plan<VEHICLES>,
) {
    let first = routes.routes[0];
    let count = good.tracks.waypoint_count();
    for route in [
        Route { vehicle: u8::MAX, ..first },
        Route { end: first.first, ..first },
        Route { end: count + 1, ..first },
        Route { first: u32::MAX, end: u32::MAX, ..first },
    ] {
        let mut routes = routes.clone();
        routes.routes[0] = route;
        assert_eq!(plan(good, &routes, &SWARM), Err(PlanError::Terminals));
    }
    for (heading, layer) in [(Heading::Backward, 0), (Heading::Forward, u8::MAX)] {
        let mut routes = routes.clone();
        routes.routes[0] = Route { heading, layer, ..first };
        let _ = plan(good, &routes, &SWARM);
    }
    let aloft = PADS.map(|pad| Pad { start: pad.start + Point::new(0.0, 0.0, 40.0), aloft: true, ..pad });
    assert_eq!(plan(good, &Plan::new(), &Swarm { pads: &aloft, ..SWARM }), Ok(()));
    assert_eq!(plan(good, &Plan::new(), &SWARM), Ok(()));
}

/// Lanes over a field.
fn fields(
    plan: &mut impl FnMut(&Work<'_, LANES, CORNERS>, &Plan<VEHICLES>, &Swarm<'_>) -> Result<(), PlanError>,
    good: &Work<'_, LANES, CORNERS>,
    routes: &Plan<VEHICLES>,
) {
    let mut file = [0; 64];
    let field = ground(&mut file);
    for hard in HARD_NUMBERS {
        let usual = Following { field, height_m: 30.0, tolerance_m: 3.0, slope: 0.5 };
        for following in [
            usual,
            Following { height_m: hard, ..usual },
            Following { tolerance_m: hard, ..usual },
            Following { slope: hard, ..usual },
        ] {
            let _ = plan(good, routes, &Swarm { following: Some(following), ..SWARM });
        }
    }
}

/// Uneven ground under the area.
fn ground(file: &mut [u8]) -> FieldView<'_> {
    let shape = FieldShape { low: Flat::new(-20.0, -20.0), cell_m: 40.0, columns: 2, rows: 3 };
    let length = field::write(&shape, &[0, 20, 40, 10, -30, 50], file).expect("it fits");
    FieldView::parse(&file[..length]).expect("a field")
}

struct Memory<'m> {
    losses: &'m mut losses::Workspace<LANES, VEHICLES>,
    pack: &'m mut PackWorkspace<VEHICLES>,
    schedule: &'m mut ScheduleWorkspace,
    out: &'m mut Flights,
}

fn divisions(
    to: &mut Answers<'_, impl Listener>,
    good: &Work<'_, LANES, CORNERS>,
    routes: &Plan<VEHICLES>,
    memory: &mut Memory<'_>,
) {
    *memory.losses = to.call("losses::Workspace::new", losses::Workspace::new);
    let all = good.tracks.waypoint_count();
    for (first, end) in [(0, 0), (1, 3), (all, all), (3, 1), (0, u32::MAX), (u32::MAX, u32::MAX), (0, all)] {
        let done = [Range { first, end }];
        let begun = to.call("losses::Workspace::begin", || {
            memory.losses.begin(good.tracks, good.transit, &done).is_ok()
        });
        to.is(begun);
        let done = to.call("losses::Workspace::done", || memory.losses.done().len());
        assert!(done <= 1);
    }
    let fate = Fate { lives: true, along_m: 60.0 };
    let lost = Fate { lives: false, along_m: 60.0 };
    for hard in HARD_NUMBERS {
        for hit in [Fate { along_m: hard, ..fate }, Fate { along_m: hard, ..lost }] {
            for fates in [&[fate, hit, fate][..], &[hit; VEHICLES], &[lost, hit, lost], &[hit, fate], &[]] {
                memory.losses.begin(good.tracks, good.transit, &[]).expect("nothing is done");
                flights::plan(good, routes, &SWARM, memory.schedule, memory.out).expect("as before");
                let mut routes = routes.clone();
                let loss = Loss { work: good, swarm: &SWARM, fates };
                let divided = again(to, &loss, memory, &mut routes);
                assert!(fates.len() == VEHICLES || divided == Err(CoverageError::Vehicles.into()));
                let setting = Err(CoverageError::Setting("along_m").into());
                assert!(fates.len() != VEHICLES || hard >= 0.0 || divided == setting);
                to.count(routes.routes.len());
                // Once more: what is done stays done.
                let _ = again(to, &loss, memory, &mut routes);
                if let Some(route) = routes.routes.first_mut() {
                    route.vehicle = u8::MAX;
                    let unknown = again(to, &loss, memory, &mut routes);
                    assert_eq!(unknown, Err(CoverageError::Vehicles.into()));
                }
            }
        }
    }
}

fn again(
    to: &mut Answers<'_, impl Listener>,
    loss: &Loss<'_, LANES, CORNERS>,
    memory: &mut Memory<'_>,
    routes: &mut Plan<VEHICLES>,
) -> Result<(), losses::Error> {
    let Memory { losses, pack, schedule, out } = memory;
    let divided = to.call("losses::redivide", || losses::redivide(loss, losses, pack, schedule, routes, out));
    assert!(divided.is_err() || is_finite(out), "{:?}", loss.fates);
    to.is(divided.is_ok());
    divided
}

fn ways_home(
    to: &mut Answers<'_, impl Listener>,
    transit: &Ways<'_>,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    let mut file = [0; 64];
    let field = ground(&mut file);
    let here = Point::new(30.0, 20.0, 35.0);
    let over = Point::new(-5.0, -5.0, 1.5);
    let good = DetourRequest {
        aside: false,
        here,
        leg: [here; 2],
        leg_clearance_m: 10.0,
        goal: Goal::Home { over, layer_m: 40.0 },
        descent_m: 1.5,
        required_clearance_m: 0.8,
        fence: None,
    };
    let natures = [Nature::Solid, Nature::Landing, Nature::Lying];
    for (i, p) in points().enumerate() {
        let hard = HARD_NUMBERS[i % HARD_NUMBERS.len()];
        let thing = KeepOff { from: p, to: here, radius_m: hard, nature: natures[i % 3] };
        for request in [
            good,
            DetourRequest { aside: true, ..good },
            DetourRequest { here: p, ..good },
            DetourRequest { here: p, aside: true, ..good },
            DetourRequest { descent_m: hard, ..good },
            DetourRequest { required_clearance_m: hard, ..good },
            DetourRequest { goal: Goal::Home { over: p, layer_m: 40.0 }, ..good },
            DetourRequest { goal: Goal::Home { over, layer_m: hard }, ..good },
            DetourRequest { goal: Goal::Node(0), ..good },
            DetourRequest { fence: Some((p, here)), ..good },
        ] {
            for field in [None, Some(field)] {
                let mut path = Path::<WAYPOINTS>::new();
                let bad = request.check().is_err() || thing.check().is_err();
                let found = to
                    .call("around::plan", || around::plan(transit, field, &request, &mut [thing], &mut path));
                assert_eq!(matches!(found, Err(DetourError::Config(_))), bad, "{request:?} {thing:?}");
                let finite = path.waypoints().iter().all(|w| w.position.iter().all(|c| c.is_finite()));
                assert!(found.is_err() || finite);
                to.is(found.is_ok());
                let again = to.call("around::plan_vehicle", || {
                    around::plan_vehicle(transit, field, &request, &mut [thing], own)
                });
                assert_eq!(again, found);
                let mut short = Path::<1>::new();
                to.is(around::plan(transit, field, &request, &mut [], &mut short).is_ok());
            }
        }
    }
}
