//! Whole plans of a coverage mission, as a board makes them when its companion requests one: lanes,
//! routes and all vehicles' flights with departure times; also divisions after losses. The results
//! go into a checksum, by which a test compares board and host bit by bit.

use companion::planner::coverage::{self, Request};
use companion::storage::mission_file::coverage::{
    CoverageHeader, CoverageParts, HeadingRule, PartEligibility, VehicleShare,
};
use companion::storage::mission_file::{
    self, MissionBlock, MissionHeader, MissionKind, MissionVehicle, MissionView,
};
use companion::swarm::fleet::DivisionInput;
use heapless::Vec;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::flights::{self, CaptureSettings, FlightInputs, Pad};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::losses::{self, Loss, VehicleStatus};
use planner_core::coverage::pack::{self, Heights, TrackUnit, Vehicle, Work};
use planner_core::coverage::tracks::{self, LanePattern};
use planner_core::coverage::transit::Transit;
use planner_core::deconflict::Method;
use planner_core::flight::{HeadingMode, Trigger};
use planner_core::plan::{SwarmPlan, VehicleTask};
use planner_core::schedule::ScheduleConfig;

use super::{Meter, flight};
use crate::capacity::{AREA_CORNERS, AREA_VERTICES, GATES, LANES, VEHICLES, WAYPOINTS};
use crate::scratch;

/// Flights of the largest swarm that the board holds.
pub type Flights = SwarmPlan<VEHICLES, WAYPOINTS>;

/// Vehicles in the plans for which the bench sets a limit of instructions.
const LIMITED_VEHICLES: usize = 3;
const HEIGHTS: Heights = Heights { mission_m: 35.0, layer_m: 5.0 };
const CRUISE_MPS: f32 = 5.0;
const CLIMB_MPS: f32 = 3.0;
const DESCEND_MPS: f32 = 1.0;
const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.75,
    cruise_mps: CRUISE_MPS,
    vertical_mps: DESCEND_MPS,
};
/// Flight settings for lanes 10 m apart; its list of pads is empty, to be filled in.
pub(super) const FLIGHT_INPUTS: FlightInputs<'static> = FlightInputs {
    pads: &[],
    capture: CaptureSettings {
        waypoint_m: 10.0,
        heading_mode: HeadingMode::Fixed(0.0),
        trigger: Trigger::Distance,
    },
    clearance_m: 10.0,
    schedule: SCHEDULE,
    max_gates: GATES,
    photographed: &[],
    held_layers: 0,
    following: None,
};
/// Height of a path's first point above its pad, metres.
const CLIMB_M: f32 = 2.0;
/// Distance between neighbouring pads, metres.
const PAD_SPACING_M: f32 = 5.0;
/// Vertices of the area, metres: 300 by 150 m.
const FIVE_VERTICES: [[f32; 2]; 5] =
    [[0.0, 0.0], [300.0, 0.0], [320.0, 80.0], [300.0, 150.0], [0.0, 150.0]];
/// Vertices of two no-fly zones within that area.
const NO_FLY_ZONES: [[[f32; 2]; 4]; 2] = [
    [[80.0, 40.0], [110.0, 45.0], [105.0, 80.0], [75.0, 70.0]],
    [[200.0, 60.0], [240.0, 60.0], [240.0, 110.0], [200.0, 110.0]],
];

/// Measures all coverage plans and divisions; returns a checksum of the results.
#[inline(never)]
pub fn measure_coverage_flights(
    meter: &mut impl Meter,
    lent: &mut scratch::WorkspaceOverlay,
    out: &mut Flights,
) -> u32 {
    measure_whole_plans(meter, lent.coverage_plan(), out)
        ^ measure_plan_parts(meter, lent.coverage_bench(), out)
}

/// Measures plans from a mission file, without and with no-fly zones.
#[inline(never)]
fn measure_whole_plans(
    meter: &mut impl Meter,
    lent: &mut scratch::CoveragePlanWorkspace,
    out: &mut Flights,
) -> u32 {
    let mut sum = 1;
    for zones in [&[][..], &NO_FLY_ZONES[..]] {
        measure_mission_plans(meter, zones, lent, out, &mut sum);
    }
    sum
}

fn add_to_checksum(sum: &mut u32, flights: &Flights) {
    *sum = sum.rotate_left(5).wrapping_mul(0x9e37_79b1) ^ flights.crc;
}

/// The rings of an area with `zones` no-fly zones of four vertices.
fn rings(zones: usize) -> Vec<Ring, 4> {
    let zone =
        |k: usize| Ring { end: (FIVE_VERTICES.len() + 4 * (k + 1)) as u16, kind: RingKind::NoFly };
    let outer = Ring { end: FIVE_VERTICES.len() as u16, kind: RingKind::Outer };
    core::iter::once(outer).chain((0..zones).map(zone)).collect()
}

/// Writes the mission file of three vehicles and returns its length.
fn mission_file(zones: &[[[f32; 2]; 4]], out: &mut [u8]) -> usize {
    let header = MissionHeader {
        roadmap_crc: 0,
        mode: crate::cases::ASSIGNMENT_MODE,
        method: Method::Priority,
        origin: flight::ORIGIN,
        cruise_mps: CRUISE_MPS,
        schedule: SCHEDULE,
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: companion::config::USUAL_GROUND_STATIONS,
    };
    let vehicle = |k: usize| MissionVehicle {
        task: VehicleTask {
            id: 1 + k as u8,
            required_clearance_m: 1.5,
            climb_m: CLIMB_M,
            goal: None,
        },
        start: Point::new(PAD_SPACING_M * k as f32, -10.0, CLIMB_M),
        radius_m: 0.3,
        speed_max_mps: 8.0,
    };
    let vehicles: Vec<_, LIMITED_VEHICLES> = (0..LIMITED_VEHICLES).map(vehicle).collect();
    let area = CoverageHeader {
        unit: TrackUnit::Waypoint,
        parts: PartEligibility::Anyone,
        heading: HeadingRule::Sweep,
        trigger: Trigger::Distance,
        search_steps: super::coverage::MAX_ORDER_CHANGES,
        heights: HEIGHTS,
        spacing: spacing(10.0),
        angle_deg: None,
        margin_m: 0.0,
        ground: None,
    };
    let share = VehicleShare { weight: 1.0, climb_mps: CLIMB_MPS, descend_mps: DESCEND_MPS };
    let corners = FIVE_VERTICES.iter().chain(zones.iter().flatten());
    let vertices: Vec<Flat, 16> = corners.map(|[x, y]| Flat::new(*x, *y)).collect();
    let parts = CoverageParts {
        header: area,
        shares: &[share; LIMITED_VEHICLES],
        rings: &rings(zones.len()),
        vertices: &vertices,
    };
    mission_file::write_mission(&header, &vehicles, &MissionBlock::Coverage(parts), out)
        .expect("a good mission")
}

fn spacing(lane_m: f32) -> Spacing {
    Spacing {
        footprint: Footprint { along_m: lane_m, across_m: lane_m },
        lane_m,
        waypoint_m: lane_m,
    }
}

/// Measures the plans that a board makes from its mission file: before take-off, and after each of
/// two losses.
fn measure_mission_plans(
    meter: &mut impl Meter,
    zones: &[[[f32; 2]; 4]],
    lent: &mut scratch::CoveragePlanWorkspace,
    out: &mut Flights,
    sum: &mut u32,
) {
    let mut bytes = [0; 1024];
    let len = mission_file(zones, &mut bytes);
    let view = MissionView::parse(&bytes[..len]).expect("it was written");
    let MissionKind::Coverage(area) = view.kind() else { return };
    let request =
        Request { mission: &view, view: area, field: None, max_gates: GATES, photographed: &[] };
    let names = match zones.is_empty() {
        true => [
            "planner::coverage::plan_flights, 3",
            "planner::coverage::plan_flights, 3 after two losses",
        ],
        false => [
            "planner::coverage::plan_flights, 3, zones",
            "planner::coverage::plan_flights, 3 after two losses, zones",
        ],
    };
    let lent_bytes = size_of::<scratch::CoveragePlanWorkspace>();
    let mut losses: Vec<[DivisionInput; LIMITED_VEHICLES], 2> = Vec::new();
    for lost in [None, Some(0), Some(1)] {
        if let Some(lost) = lost {
            // At each loss every flying vehicle is halfway along its path; a vehicle lost before is
            // on the ground.
            let lot = |k: usize| {
                let flies = out.flights[k].task.leaves_pad();
                let along_dm =
                    if flies { (out.flights[k].path.length_m() * 5.0) as u16 } else { 0 };
                DivisionInput { alive: k > lost, along_dm }
            };
            losses.push(core::array::from_fn(lot)).expect("there is room");
        }
        let name = names[usize::from(lost.is_some())];
        meter
            .call(name, lent_bytes, || {
                coverage::plan_flights::<
                    AREA_VERTICES,
                    LANES,
                    VEHICLES,
                    AREA_CORNERS,
                    VEHICLES,
                    WAYPOINTS,
                >(
                    &request,
                    losses.iter().map(|lots| &lots[..]),
                    &mut lent.area,
                    &mut lent.schedule,
                    out,
                )
            })
            .expect("a plan");
        add_to_checksum(sum, out);
    }
}

/// Measures the planning of flights for given routes, and the division after the loss of a vehicle,
/// for three vehicles and for 32.
#[inline(never)]
fn measure_plan_parts(
    meter: &mut impl Meter,
    lent: &mut scratch::CoverageBenchWorkspace,
    out: &mut Flights,
) -> u32 {
    let mut sum = 1;
    let names = ["flights::plan_flights, 3", "losses::redivide_work, 3"];
    for zones in [&[][..], &NO_FLY_ZONES[..]] {
        let corners = FIVE_VERTICES.iter().chain(zones.iter().flatten());
        let vertices: Vec<Flat, 16> = corners.map(|[x, y]| Flat::new(*x, *y)).collect();
        let rings = rings(zones.len());
        let case = Case {
            area: Area::new(&vertices, &rings).expect("an area"),
            angle_deg: None,
            lane_m: 10.0,
            count: LIMITED_VEHICLES,
        };
        measure_division(meter, &case, names, lent, out, &mut sum);
    }
    // Area of as many lanes as a board holds, 512, for as many vehicles, 32.
    let wide =
        [[0.0, 0.0], [2559.0, 0.0], [2559.0, 400.0], [0.0, 400.0]].map(|[x, y]| Flat::new(x, y));
    let rings = [Ring { end: 4, kind: RingKind::Outer }];
    let case = Case {
        area: Area::new(&wide, &rings).expect("an area"),
        angle_deg: Some(90.0),
        lane_m: 5.0,
        count: VEHICLES,
    };
    measure_division(
        meter,
        &case,
        ["flights::plan_flights, 32", "losses::redivide_work, 32"],
        lent,
        out,
        &mut sum,
    );
    sum
}

/// An area, the direction and spacing of its lanes, and the number of vehicles.
struct Case<'a> {
    area: Area<'a>,
    angle_deg: Option<f32>,
    lane_m: f32,
    count: usize,
}

fn vehicles(count: usize) -> (Vec<Vehicle, VEHICLES>, Vec<Pad, VEHICLES>) {
    let place = |k: usize| Flat::new(PAD_SPACING_M * k as f32, -10.0);
    let vehicle = |k: usize| Vehicle {
        place: place(k),
        home: place(k),
        cruise_mps: CRUISE_MPS,
        climb_mps: CLIMB_MPS,
        descend_mps: DESCEND_MPS,
        weight: 1.0,
    };
    let pad = |k: usize| Pad {
        id: 1 + k as u8,
        start: Point::new(place(k).x, place(k).y, CLIMB_M),
        climb_m: CLIMB_M,
        end_z_m: CLIMB_M,
        descent_m: CLIMB_M,
        airborne: false,
    };
    ((0..count).map(vehicle).collect(), (0..count).map(pad).collect())
}

fn measure_division(
    meter: &mut impl Meter,
    case: &Case<'_>,
    [flights_name, again_name]: [&'static str; 2],
    lent: &mut scratch::CoverageBenchWorkspace,
    out: &mut Flights,
    sum: &mut u32,
) {
    let mut transit = Transit::<AREA_CORNERS>::empty();
    transit.set_area(case.area).expect("they fit");
    let scratch::CoverageBenchWorkspace {
        tracks,
        build,
        powell,
        plan: routes,
        losses,
        schedule,
        ..
    } = lent;
    let pack = &mut powell.pack;
    let looks = super::coverage::MAX_ORDER_CHANGES;
    let pattern = LanePattern {
        spacing: spacing(case.lane_m),
        angle_deg: case.angle_deg,
        margin_m: 0.0,
        search_steps: looks,
    };
    tracks::build_lanes(&case.area, &pattern, &transit, build, tracks).expect("lanes");
    let (vehicles, pads) = vehicles(case.count);
    let work = Work {
        tracks,
        transit: &transit,
        vehicles: &vehicles,
        heights: HEIGHTS,
        unit: TrackUnit::Waypoint,
    };
    losses.start_plan(tracks, &transit, &[]).expect("nothing is done");
    pack::binpat(&work, pack, routes).expect("routes");
    let manner = CaptureSettings { waypoint_m: case.lane_m, ..FLIGHT_INPUTS.capture };
    let flight_inputs = FlightInputs { pads: &pads, capture: manner, ..FLIGHT_INPUTS };
    meter
        .call(flights_name, size_of_val(schedule), || {
            flights::plan_flights(&work, routes, &flight_inputs, schedule, out)
        })
        .expect("flights");
    add_to_checksum(sum, out);
    let bytes = size_of_val(losses) + size_of_val(pack) + size_of_val(schedule);
    // The first vehicle is lost; all others go on from halfway along their paths.
    let fate =
        |k: usize| VehicleStatus { alive: k > 0, along_m: 0.5 * out.flights[k].path.length_m() };
    let fates: Vec<VehicleStatus, VEHICLES> = (0..case.count).map(fate).collect();
    let loss = Loss { work: &work, flight_inputs: &flight_inputs, fates: &fates };
    meter
        .call(again_name, bytes, || {
            losses::redivide_work(&loss, losses, pack, schedule, routes, out)
        })
        .expect("a division");
    add_to_checksum(sum, out);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::boxed::Box;

    use super::*;

    struct Uncounted;

    impl Meter for Uncounted {
        fn call<T>(&mut self, name: &'static str, _: usize, work: impl FnOnce() -> T) -> T {
            let began = std::time::Instant::now();
            let result = work();
            std::println!("{name}: {:?}", began.elapsed());
            result
        }
    }

    #[test]
    fn all_flights_are_planned_and_the_sum_is_the_same_again() {
        let mut out = Box::new(Flights::new());
        let mut area = Box::<scratch::CoveragePlanWorkspace>::default();
        let mut lent = Box::<scratch::CoverageBenchWorkspace>::default();
        let mut sums = || {
            [
                measure_whole_plans(&mut Uncounted, &mut area, &mut out),
                measure_plan_parts(&mut Uncounted, &mut lent, &mut out),
            ]
        };
        let first = sums();
        assert_eq!(sums(), first);
    }
}
