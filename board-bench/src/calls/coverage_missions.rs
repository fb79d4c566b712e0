//! Plans and divisions of coverage missions, each the whole call of a board: from the mission file
//! to one vehicle's plan with its gates.

use companion::planner::coverage::{self, Request};
use companion::storage::mission_file::coverage::{
    CoverageBlock, CoverageHeader, HeadingRule, PartEligibility, VehicleShare,
};
use companion::storage::mission_file::{
    self, MAX_BYTES, MissionBlock, MissionHeader, MissionKind, MissionVehicle, MissionView,
};
use companion::swarm::fleet::{DivisionInputs, VehicleDivisionInput};
use firmware::capacity::{AREA_VERTICES, GATES, LANES, NO_FLY_CORNERS, VEHICLES, WAYPOINTS};
use firmware::workspace::CoveragePlanWorkspace;
use heapless::Vec;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::pack::TrackUnit;
use planner_core::flight::{Trigger, VehiclePlan};
use planner_core::plan::{self, VehicleTask};
use planner_core::schedule::ScheduleConfig;
use planner_core::track::deconflict::Method;

use super::coverage_flights::{
    CLIMB_M, CLIMB_MPS, CRUISE_MPS, DESCEND_MPS, FIVE_VERTICES, Flights, HEIGHTS, NO_FLY_ZONES,
    PAD_SPACING_M, SCHEDULE, SMALL_SWARM_VEHICLES, WIDE_VERTICES, add_to_checksum, rings, spacing,
};
use super::coverage_workspace::CoverageWorkspace;
use super::{Meter, coverage_flights, flight};

/// Most divisions of a mission that are measured.
const MAX_DIVISIONS: usize = 3;

/// A coverage mission, and the names of its calls' rows in `docs/worst-case.md`.
struct Mission<'a> {
    /// Vertices of the area, metres east and north.
    outline: &'a [[f32; 2]],
    /// Vertices of each no-fly zone, metres east and north.
    zones: &'a [[[f32; 2]; 4]],
    /// Direction of the lanes, degrees from east; `None` for the planner's choice.
    angle_deg: Option<f32>,
    /// Distance between lanes, and between waypoints, metres.
    lane_m: f32,
    /// Separation of flights in the schedule, metres.
    separation_m: f32,
    vehicle_count: usize,
    /// Row of the plan before take-off.
    plan_row: &'static str,
    /// Row of a division after one further loss: the board has planned all divisions before it.
    further_loss_row: &'static str,
    /// Row of a division of which the board has planned nothing yet: the board was restarted, or
    /// the division before was withdrawn.
    whole_division_row: &'static str,
}

/// Three vehicles over an area without no-fly zones.
const PLAIN: Mission<'static> = Mission {
    outline: &FIVE_VERTICES,
    zones: &[],
    angle_deg: None,
    lane_m: 10.0,
    separation_m: SCHEDULE.separation_m,
    vehicle_count: SMALL_SWARM_VEHICLES,
    plan_row: "planner::coverage::plan_flights, 3",
    further_loss_row: "a division, 3",
    whole_division_row: "a division, 3, nothing known",
};

/// Measures all coverage plans and divisions; returns a checksum of the results.
#[inline(never)]
pub fn measure_coverage_flights(
    meter: &mut impl Meter,
    lent: &mut CoveragePlanWorkspace,
    parts: &mut CoverageWorkspace,
    out: &mut Flights,
) -> u32 {
    measure_missions(meter, lent, out) ^ coverage_flights::measure_plan_parts(meter, parts, out)
}

/// Measures plans and divisions of all missions; returns a checksum of the results.
#[inline(never)]
fn measure_missions(
    meter: &mut impl Meter,
    lent: &mut CoveragePlanWorkspace,
    out: &mut Flights,
) -> u32 {
    let zones = Mission {
        zones: &NO_FLY_ZONES,
        plan_row: "planner::coverage::plan_flights, 3, zones",
        further_loss_row: "a division, 3, zones",
        whole_division_row: "a division, 3, zones, nothing known",
        ..PLAIN
    };
    let wide = Mission {
        outline: &WIDE_VERTICES,
        angle_deg: Some(90.0),
        lane_m: 5.0,
        vehicle_count: VEHICLES,
        plan_row: "planner::coverage::plan_flights, 32",
        further_loss_row: "a division, 32",
        whole_division_row: "a division, 32, nothing known",
        ..PLAIN
    };
    let mut sum = 1;
    for mission in [PLAIN, zones, wide] {
        let mut bytes = [0; MAX_BYTES];
        let len = write_mission(&mission, &mut bytes);
        let view = MissionView::parse(&bytes[..len]).expect("it was written");
        let mut board = Board { mission: &mission, view, lent, out, sum: &mut sum };
        measure_losses(meter, &mut board);
    }
    sum
}

/// Writes the mission file and returns its length.
#[inline(never)]
fn write_mission(mission: &Mission<'_>, out: &mut [u8]) -> usize {
    let header = MissionHeader {
        roadmap_crc: 0,
        mode: crate::cases::ASSIGNMENT_MODE,
        method: Method::Priority,
        origin: flight::ORIGIN,
        cruise_mps: CRUISE_MPS,
        schedule: ScheduleConfig { separation_m: mission.separation_m, ..SCHEDULE },
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: companion::config::DEFAULT_GROUND_STATION_IDS,
    };
    let vehicle = |k: usize| MissionVehicle {
        task: VehicleTask {
            id: 1 + k as u8,
            required_clearance_m: 1.5,
            climb_m: CLIMB_M,
            goal: None,
        },
        path_start: Point::new(PAD_SPACING_M * k as f32, -10.0, CLIMB_M),
        radius_m: 0.3,
        speed_max_mps: 8.0,
    };
    let vehicles: Vec<_, VEHICLES> = (0..mission.vehicle_count).map(vehicle).collect();
    let area = CoverageHeader {
        assignment_unit: TrackUnit::Waypoint,
        part_eligibility: PartEligibility::Anyone,
        heading_rule: HeadingRule::SameOnAllLanes,
        trigger: Trigger::Distance,
        search_steps: super::coverage::BOARD_SEARCH_STEPS,
        heights: HEIGHTS,
        spacing: spacing(mission.lane_m),
        lane_angle_deg: mission.angle_deg,
        border_overshoot_m: 0.0,
        ground: None,
    };
    let share = VehicleShare { weight: 1.0, climb_mps: CLIMB_MPS, descend_mps: DESCEND_MPS };
    let shares: Vec<_, VEHICLES> = core::iter::repeat_n(share, mission.vehicle_count).collect();
    let corners = mission.outline.iter().chain(mission.zones.iter().flatten());
    let vertices: Vec<Flat, 16> = corners.map(|[x, y]| Flat::new(*x, *y)).collect();
    let parts = CoverageBlock {
        header: area,
        shares: &shares,
        rings: &rings(mission.outline.len(), mission.zones.len()),
        vertices: &vertices,
    };
    mission_file::write_mission(&header, &vehicles, &MissionBlock::Coverage(parts), out)
        .expect("a good mission")
}

/// A board that has a mission, and its memory.
struct Board<'a> {
    mission: &'a Mission<'a>,
    view: MissionView<'a>,
    lent: &'a mut CoveragePlanWorkspace,
    /// All vehicles' flights of the last plan.
    out: &'a mut Flights,
    /// Checksum of the plans so far.
    sum: &'a mut u32,
}

/// The inputs of all divisions of a mission.
type Divisions = Vec<DivisionInputs<VEHICLES>, MAX_DIVISIONS>;

impl Board<'_> {
    /// Measures the whole call: the swarm's flights, and the plan of the last vehicle.
    fn measure(&mut self, meter: &mut impl Meter, name: &'static str, losses: &Divisions) {
        let MissionKind::Coverage(area) = self.view.kind() else { return };
        let mission = &self.view;
        let request =
            Request { mission, view: area, field: None, max_gates: GATES, photographed: &[] };
        let mut own = VehiclePlan::<WAYPOINTS, GATES>::new();
        let (out, lent) = (&mut *self.out, &mut *self.lent);
        let schedule = &mission.header().schedule;
        meter
            .call(name, size_of::<CoveragePlanWorkspace>(), || {
                coverage::plan_flights::<
                    AREA_VERTICES,
                    LANES,
                    VEHICLES,
                    NO_FLY_CORNERS,
                    VEHICLES,
                    WAYPOINTS,
                >(
                    &request,
                    losses.iter().map(|inputs| &inputs[..]),
                    &mut lent.area,
                    &mut lent.schedule,
                    out,
                )
                .expect("a plan");
                let last = out.flights.len() - 1;
                plan::vehicle_plan(out, last, schedule, &mut lent.schedule, &mut own)
            })
            .expect("its gates");
        add_to_checksum(self.sum, self.out);
    }

    /// Inputs of a division: the first `lost` vehicles are lost, and all others hold at the
    /// fraction `share` of their paths' lengths.
    fn division_inputs(&self, lost: usize, share: f32) -> DivisionInputs<VEHICLES> {
        let input = |k: usize| {
            let flight = &self.out.flights[k];
            let along_m =
                if flight.task.leaves_pad() { flight.path.length_m() * share } else { 0.0 };
            VehicleDivisionInput { alive: k >= lost, along_dm: (along_m * 10.0) as u16 }
        };
        (0..self.mission.vehicle_count).map(input).collect()
    }
}

/// Measures the plan before take-off, a division after a first and after a second loss, the second
/// division again with other inputs (the first ones were withdrawn), and one after both losses at
/// once.
fn measure_losses(meter: &mut impl Meter, board: &mut Board<'_>) {
    let Mission { plan_row: plan, further_loss_row: further, whole_division_row: whole, .. } =
        *board.mission;
    let mut losses = Divisions::new();
    board.measure(meter, plan, &losses);
    let both = board.division_inputs(2, 0.5);
    losses.push(board.division_inputs(1, 0.5)).expect("there is room");
    board.measure(meter, further, &losses);
    let (second, other) = (board.division_inputs(2, 0.5), board.division_inputs(2, 0.4));
    losses.push(second).expect("there is room");
    board.measure(meter, further, &losses);
    losses[1] = other;
    board.measure(meter, whole, &losses);
    losses.truncate(1);
    losses[0] = both;
    board.measure(meter, whole, &losses);
}

#[cfg(test)]
mod tests;
