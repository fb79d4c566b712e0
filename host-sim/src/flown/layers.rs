//! Data for the report page of a flight: which vehicle photographs which waypoints, in the plan and
//! after each new division.

use std::collections::BTreeMap;

use companion::swarm::fleet::VehicleDivisionInput;
use planner_core::Point;
use planner_core::flight::{Flight, Task, WaypointRange};

use crate::capacity::MAX_WAYPOINTS;
use crate::coverage::check::Picture;
use crate::coverage::{CoveragePlan, report_layers};
use crate::mission::{HostPlan, PreparedMission};
use crate::report::{CoverageLayers, ReportDivision, ReportPart, WaypointTransfer};
use crate::swarm::SwarmFlight;
use crate::swarm::divisions::FlownDivision;

/// Id of the vehicle that photographs a waypoint, by waypoint number.
type WaypointOwners = BTreeMap<u32, u8>;

/// Coverage data of the report page for a flight: the planned division, each later division, and
/// the pictures taken.
///
/// # Errors
/// A division that companions made cannot be planned here.
pub fn flown_layers(
    planned: &CoveragePlan<'_>,
    mission: &PreparedMission,
    plan: &HostPlan,
    flight: &SwarmFlight,
    pictures: Vec<Picture>,
) -> anyhow::Result<CoverageLayers> {
    let mut ids: Vec<u8> = plan.flights.iter().map(|flight| flight.vehicle_id).collect();
    ids.sort_unstable();
    let mut shown: Vec<ReportDivision> = Vec::new();
    let (mut before, mut gone, mut divisions) =
        (WaypointOwners::new(), Vec::new(), Vec::<&[VehicleDivisionInput]>::new());
    let whole = FlownDivision {
        t_s: 0.0,
        vehicle: 0,
        number: 0,
        inputs: Vec::new(),
        plan_crc: 0,
        agreement_s: None,
    };
    for division in std::iter::once(&whole).chain(&flight.divisions) {
        // Skipped: a division already shown, which another vehicle begins to fly later; and a
        // division whose inputs no vehicle reported, with all that follow, since they cannot be
        // planned here.
        if usize::from(division.number) != shown.len()
            || (division.number > 0 && division.inputs.is_empty())
        {
            continue;
        }
        divisions.extend((division.number > 0).then_some(&division.inputs[..]));
        let rest = match divisions.is_empty() && flight.photographed_before.is_empty() {
            true => None,
            false => Some(
                mission.plan_remaining(&flight.photographed_before, divisions.iter().copied())?,
            ),
        };
        let flights = rest.as_ref().map_or(&plan.flights, |rest| &rest.flights);
        let own = waypoint_owners(flights);
        let lost =
            ids.iter().zip(&division.inputs).filter(|(_, input)| !input.alive).map(|(id, _)| *id);
        let lost: Vec<u8> = lost.filter(|id| !gone.contains(id)).collect();
        gone.extend(&lost);
        shown.push(ReportDivision {
            t_s: division.t_s,
            lost,
            parts: flights
                .iter()
                .filter(|flight| flight.task.leaves_pad())
                .map(report_part)
                .collect(),
            transfers: waypoint_transfers(&before, &own),
        });
        before = own;
    }
    Ok(report_layers::coverage_layers(planned, shown, pictures))
}

/// The path of a flight, and what it photographs.
fn report_part(flight: &Flight<MAX_WAYPOINTS>) -> ReportPart {
    let path = &flight.path;
    let (mut lanes, mut waypoints) = (Vec::<Point>::new(), 0);
    if let Task::Photograph(photographs) = &flight.task {
        waypoints = photographs.planned_count(path);
        for shots in photographs.stretches(path) {
            lanes.extend([shots.from_m, shots.to_m].iter().filter_map(|at_m| path.point_at(*at_m)));
        }
    }
    let places = path.waypoints().iter().map(|waypoint| waypoint.position);
    ReportPart {
        vehicle: flight.vehicle_id,
        waypoint_count: waypoints,
        path: places.collect(),
        lane_ends: lanes,
    }
}

/// Which vehicle photographs each waypoint by the plan of these flights.
fn waypoint_owners(flights: &[Flight<MAX_WAYPOINTS>]) -> WaypointOwners {
    let mut owners = WaypointOwners::new();
    for flight in flights {
        let Task::Photograph(photographs) = &flight.task else { continue };
        for range in photographs
            .waypoints_of_pictures(&flight.path, WaypointRange { first: 0, end: u32::MAX })
        {
            owners.extend((range.first..range.end).map(|number| (number, flight.vehicle_id)));
        }
    }
    owners
}

/// Counts the waypoints that went from one vehicle to another, for each pair of vehicles.
fn waypoint_transfers(before: &WaypointOwners, now: &WaypointOwners) -> Vec<WaypointTransfer> {
    let mut counts = BTreeMap::<(u8, u8), u32>::new();
    for (number, to) in now {
        if let Some(from) = before.get(number).filter(|from| *from != to) {
            *counts.entry((*from, *to)).or_default() += 1;
        }
    }
    counts
        .into_iter()
        .map(|((from, to), waypoints)| WaypointTransfer { from, to, waypoint_count: waypoints })
        .collect()
}
