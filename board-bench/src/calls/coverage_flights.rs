//! The parts of a coverage mission's plans: all vehicles' flights with departure times, and the
//! division after a loss; whole plans are in [`super::coverage_missions`]. The results go into a
//! checksum, by which a test compares board and host bit by bit.

use firmware::capacity::{GATES, NO_FLY_CORNERS, VEHICLES, WAYPOINTS};
use heapless::Vec;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::flights::{self, CaptureSettings, FlightInputs, Pad};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::losses::{self, DivisionProblem, VehicleStatus};
use planner_core::coverage::pack::{self, CoverageProblem, Heights, TrackUnit, Vehicle};
use planner_core::coverage::tracks::{self, LanePattern};
use planner_core::coverage::transit::TransitGraph;
use planner_core::flight::{HeadingMode, Trigger};
use planner_core::plan::SwarmPlan;
use planner_core::schedule::ScheduleConfig;

use super::Meter;
use super::coverage_workspace::CoverageWorkspace;

/// Flights of the largest swarm that the board holds.
pub type Flights = SwarmPlan<VEHICLES, WAYPOINTS>;

/// Vehicles in the plans for which the bench sets a limit of instructions.
pub(super) const SMALL_SWARM_VEHICLES: usize = 3;
pub(super) const HEIGHTS: Heights = Heights { max_picture_height_m: 35.0, layer_spacing_m: 5.0 };
/// Cruise speed, m/s.
pub(super) const CRUISE_MPS: f32 = 5.0;
/// Climb speed, m/s.
pub(super) const CLIMB_MPS: f32 = 3.0;
/// Descent speed, m/s.
pub(super) const DESCEND_MPS: f32 = 1.0;
pub(super) const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.75,
    cruise_mps: CRUISE_MPS,
    vertical_mps: DESCEND_MPS,
};
/// Flight settings for lanes 10 m apart; its list of pads is empty, to be filled in.
pub(super) const FLIGHT_INPUTS: FlightInputs<'static> = FlightInputs {
    pads: &[],
    capture: CaptureSettings {
        max_picture_spacing_m: 10.0,
        heading_mode: HeadingMode::FixedEnuRad(0.0),
        trigger: Trigger::Distance,
    },
    assumed_clearance_m: 10.0,
    schedule: SCHEDULE,
    max_gates: GATES,
    done_waypoints: &[],
    occupied_layers: 0,
    following: None,
};
/// Height of a path's first point above its pad, metres.
pub(super) const CLIMB_M: f32 = 2.0;
/// Distance between neighbouring pads, metres.
pub(super) const PAD_SPACING_M: f32 = 5.0;
/// Vertices of the area, metres: 300 by 150 m.
pub(super) const FIVE_VERTICES: [[f32; 2]; 5] =
    [[0.0, 0.0], [300.0, 0.0], [320.0, 80.0], [300.0, 150.0], [0.0, 150.0]];
/// Vertices of two no-fly zones within that area.
pub(super) const NO_FLY_ZONES: [[[f32; 2]; 4]; 2] = [
    [[80.0, 40.0], [110.0, 45.0], [105.0, 80.0], [75.0, 70.0]],
    [[200.0, 60.0], [240.0, 60.0], [240.0, 110.0], [200.0, 110.0]],
];
/// Vertices of an area of 512 lanes, 5 m apart, as many as a board holds.
pub(super) const WIDE_VERTICES: [[f32; 2]; 4] =
    [[0.0, 0.0], [2559.0, 0.0], [2559.0, 400.0], [0.0, 400.0]];

pub(super) fn add_to_checksum(sum: &mut u32, flights: &Flights) {
    *sum = sum.rotate_left(5).wrapping_mul(0x9e37_79b1) ^ flights.crc;
}

/// The rings of an area: an outer ring of `corners` vertices, and `zones` no-fly zones of four.
pub(super) fn rings(corners: usize, zones: usize) -> Vec<Ring, 4> {
    let zone = |k: usize| Ring { end: (corners + 4 * (k + 1)) as u16, kind: RingKind::NoFly };
    let outer = Ring { end: corners as u16, kind: RingKind::Outer };
    core::iter::once(outer).chain((0..zones).map(zone)).collect()
}

/// Spacing with lanes this far apart.
pub(super) fn spacing(lane_m: f32) -> Spacing {
    Spacing {
        footprint: Footprint { along_m: lane_m, across_m: lane_m },
        max_lane_spacing_m: lane_m,
        max_waypoint_spacing_m: lane_m,
    }
}

/// Measures the planning of flights for given routes, and the division after the loss of a vehicle,
/// for three vehicles and for 32.
#[inline(never)]
pub(super) fn measure_plan_parts(
    meter: &mut impl Meter,
    lent: &mut CoverageWorkspace,
    out: &mut Flights,
) -> u32 {
    let mut sum = 1;
    let names = ["flights::plan_flights, 3", "losses::redivide_work, 3"];
    for zones in [&[][..], &NO_FLY_ZONES[..]] {
        let corners = FIVE_VERTICES.iter().chain(zones.iter().flatten());
        let vertices: Vec<Flat, 16> = corners.map(|[x, y]| Flat::new(*x, *y)).collect();
        let rings = rings(FIVE_VERTICES.len(), zones.len());
        let case = Case {
            area: Area::new(&vertices, &rings).expect("an area"),
            angle_deg: None,
            lane_m: 10.0,
            vehicle_count: SMALL_SWARM_VEHICLES,
        };
        measure_division(meter, &case, names, lent, out, &mut sum);
    }
    let wide = WIDE_VERTICES.map(|[x, y]| Flat::new(x, y));
    let rings = [Ring { end: 4, kind: RingKind::Outer }];
    let case = Case {
        area: Area::new(&wide, &rings).expect("an area"),
        angle_deg: Some(90.0),
        lane_m: 5.0,
        vehicle_count: VEHICLES,
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
    /// Angle of the lanes, degrees; `None`: the planner chooses it.
    angle_deg: Option<f32>,
    /// Spacing of the lanes, metres.
    lane_m: f32,
    vehicle_count: usize,
}

fn vehicles(count: usize) -> (Vec<Vehicle, VEHICLES>, Vec<Pad, VEHICLES>) {
    let place = |k: usize| Flat::new(PAD_SPACING_M * k as f32, -10.0);
    let vehicle = |k: usize| Vehicle {
        transit_start: place(k),
        home: place(k),
        cruise_mps: CRUISE_MPS,
        climb_mps: CLIMB_MPS,
        descend_mps: DESCEND_MPS,
        weight: 1.0,
    };
    let pad = |k: usize| Pad {
        vehicle_id: 1 + k as u8,
        path_start: Point::new(place(k).x, place(k).y, CLIMB_M),
        climb_m: CLIMB_M,
        path_end_z_m: CLIMB_M,
        descent_m: CLIMB_M,
        airborne: false,
    };
    ((0..count).map(vehicle).collect(), (0..count).map(pad).collect())
}

fn measure_division(
    meter: &mut impl Meter,
    case: &Case<'_>,
    [flights_name, again_name]: [&'static str; 2],
    lent: &mut CoverageWorkspace,
    out: &mut Flights,
    sum: &mut u32,
) {
    let mut transit = TransitGraph::<NO_FLY_CORNERS>::empty();
    transit.set_area(case.area).expect("they fit");
    let CoverageWorkspace {
        tracks,
        lane_workspace: build,
        powell,
        plan: routes,
        losses,
        schedule,
        ..
    } = lent;
    let pack = &mut powell.pack;
    let pattern = LanePattern {
        spacing: spacing(case.lane_m),
        angle_from_east_deg: case.angle_deg,
        border_overshoot_m: 0.0,
        max_search_steps: super::coverage::BOARD_SEARCH_STEPS,
    };
    tracks::build_lanes(&case.area, &pattern, &transit, build, tracks).expect("lanes");
    let (vehicles, pads) = vehicles(case.vehicle_count);
    let work = CoverageProblem {
        tracks,
        transit: &transit,
        vehicles: &vehicles,
        heights: HEIGHTS,
        unit: TrackUnit::Waypoint,
        following: None,
    };
    losses.reset_with_done(tracks, &transit, &[]).expect("nothing is done");
    pack::binpat(&work, pack, routes).expect("routes");
    let manner = CaptureSettings { max_picture_spacing_m: case.lane_m, ..FLIGHT_INPUTS.capture };
    let flight_inputs = FlightInputs { pads: &pads, capture: manner, ..FLIGHT_INPUTS };
    meter
        .call(flights_name, size_of_val(schedule), || {
            flights::plan_flights(&work, routes, &flight_inputs, schedule, out)
        })
        .expect("flights");
    add_to_checksum(sum, out);
    let bytes = size_of_val(losses) + size_of_val(pack) + size_of_val(schedule);
    // The first vehicle is lost; all others go on from halfway along their paths.
    let fate = |k: usize| VehicleStatus {
        continues: k > 0,
        photographed_to_m: 0.5 * out.flights[k].path.length_m(),
    };
    let statuses: Vec<VehicleStatus, VEHICLES> = (0..case.vehicle_count).map(fate).collect();
    let division =
        DivisionProblem { problem: &work, flight_inputs: &flight_inputs, statuses: &statuses };
    meter
        .call(again_name, bytes, || {
            losses::redivide_work(&division, losses, pack, schedule, routes, out)
        })
        .expect("a division");
    add_to_checksum(sum, out);
}
