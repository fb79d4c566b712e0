//! Routes with more lanes than one path holds are flown in stretches; after each stretch the
//! remaining area is divided again. Counts the divisions that a mission takes if no vehicle is
//! lost.

use anyhow::bail;
use companion::swarm::fleet::{COMMITMENT_S, MAX_DIVISIONS, VehicleDivisionInput};
use planner_core::flight::{Flight, Task};

use super::ready::{HostPlan, PreparedMission};
use crate::capacity::MAX_WAYPOINTS;

/// Number of divisions, out of `MAX_DIVISIONS`, that are reserved for losses of vehicles.
const DIVISIONS_RESERVED_FOR_LOSSES: usize = 3;

/// Time at which a flight, by its plan, will request a division, seconds after the start; `None` if
/// the whole route fits into its path.
fn division_request_s(flight: &Flight<MAX_WAYPOINTS>) -> Option<f32> {
    let Task::Photograph(photographs) = &flight.task else { return None };
    let end_m = photographs.last_picture_m(&flight.path).filter(|_| photographs.is_first_part)?;
    let end = flight.path.waypoints().iter().find(|waypoint| waypoint.along_m >= end_m)?;
    Some(flight.depart_s + end.arrive_s - COMMITMENT_S)
}

/// The input of a vehicle to a division if all vehicles hold `t_s` seconds after the start: whether
/// it still takes part, and how far along its path it holds, decimetres (0 on its pad).
fn division_input_at(flight: &Flight<MAX_WAYPOINTS>, t_s: f32) -> VehicleDivisionInput {
    let waypoints = flight.path.waypoints();
    let flown_s = t_s - flight.depart_s;
    let Some(next) = waypoints.iter().position(|waypoint| waypoint.arrive_s > flown_s) else {
        return VehicleDivisionInput {
            alive: !flight.task.leaves_pad(),
            along_dm: if flight.task.leaves_pad() { VehicleDivisionInput::WHOLE_PATH } else { 0 },
        };
    };
    let on_pad = flight.climb_m > 0.0 && (next == 0 || flown_s <= 0.0);
    if !flight.task.leaves_pad() || on_pad {
        return VehicleDivisionInput { alive: true, along_dm: 0 };
    }
    let along_m = match next.checked_sub(1).map(|before| (waypoints[before], waypoints[next])) {
        Some((a, b)) => {
            a.along_m + (b.along_m - a.along_m) * (flown_s - a.arrive_s) / (b.arrive_s - a.arrive_s)
        }
        None => 0.0,
    };
    VehicleDivisionInput { alive: true, along_dm: ((along_m * 10.0).ceil() as u16).max(1) }
}

/// Inputs, in the order of ids, of the division that the first vehicle to reach the end of its
/// stretch requests; `None` if every route fits into its path.
pub fn next_division_inputs(plan: &HostPlan) -> Option<Vec<VehicleDivisionInput>> {
    let hold_s =
        plan.flights.iter().filter_map(division_request_s).min_by(f32::total_cmp)? + COMMITMENT_S;
    let mut flights: Vec<_> = plan.flights.iter().collect();
    flights.sort_by_key(|flight| flight.vehicle_id);
    Some(flights.into_iter().map(|flight| division_input_at(flight, hold_s)).collect())
}

impl PreparedMission {
    /// Refuses a mission whose routes take more divisions without a loss than `MAX_DIVISIONS` less
    /// the reserve.
    pub(super) fn check_division_count(&self, plan: &HostPlan) -> anyhow::Result<()> {
        let mut divisions: Vec<Vec<VehicleDivisionInput>> = Vec::new();
        let mut next = next_division_inputs(plan);
        while let Some(inputs) = next {
            divisions.push(inputs);
            if divisions.len() > MAX_DIVISIONS - DIVISIONS_RESERVED_FOR_LOSSES {
                bail!(
                    "area too large: {}: its routes take more than {} stretches of {MAX_WAYPOINTS} corners each\nhint: more \
                     vehicles, wider lanes, or the plans of `cover`, which autopilots fly alone",
                    self.scenario.path,
                    MAX_DIVISIONS - DIVISIONS_RESERVED_FOR_LOSSES
                );
            }
            next = next_division_inputs(
                &*self.plan_remaining(&[], divisions.iter().map(|inputs| &inputs[..]))?,
            );
        }
        Ok(())
    }
}
