//! Routes with more lanes than a path holds: how often all divide what is left, if nobody is lost.

use anyhow::bail;
use companion::swarm::fleet::{COMMITMENT_S, Lot, MAX_DIVISIONS};
use planner_core::flight::{Flight, Task};

use super::ready::{Mission, SwarmPlan};
use crate::capacity::WAYPOINTS;

/// Number of divisions, out of `MAX_DIVISIONS`, that are reserved for losses of vehicles.
const DIVISIONS_RESERVED_FOR_LOSSES: usize = 3;

/// Time at which a flight will ask for a division by its plan, seconds after the plan began; none if its route ends with its path.
fn division_due_s(flight: &Flight<WAYPOINTS>) -> Option<f32> {
    let Task::Photograph(photographs) = &flight.task else { return None };
    let end_m = photographs.end_m(&flight.path).filter(|_| photographs.goes_on)?;
    let end = flight.path.waypoints().iter().find(|waypoint| waypoint.along_m >= end_m)?;
    Some(flight.depart_s + end.at_s - COMMITMENT_S)
}

/// Lot of a flight if all are to hold `t_s` seconds after the plan began.
fn lot(flight: &Flight<WAYPOINTS>, t_s: f32) -> Lot {
    let waypoints = flight.path.waypoints();
    let flown_s = t_s - flight.depart_s;
    let Some(next) = waypoints.iter().position(|waypoint| waypoint.at_s > flown_s) else {
        return Lot {
            lives: !flight.task.flies(),
            along_dm: if flight.task.flies() { Lot::WHOLE_PATH } else { 0 },
        };
    };
    let on_pad = flight.climb_m > 0.0 && (next == 0 || flown_s <= 0.0);
    if !flight.task.flies() || on_pad {
        return Lot { lives: true, along_dm: 0 };
    }
    let along_m = match next.checked_sub(1).map(|before| (waypoints[before], waypoints[next])) {
        Some((a, b)) => a.along_m + (b.along_m - a.along_m) * (flown_s - a.at_s) / (b.at_s - a.at_s),
        None => 0.0,
    };
    Lot { lives: true, along_dm: ((along_m * 10.0).ceil() as u16).max(1) }
}

/// Lots when the first vehicle of a plan requests a division, by rank; none where no route goes on.
pub fn next_lots(plan: &SwarmPlan) -> Option<Vec<Lot>> {
    let hold_s = plan.flights.iter().filter_map(division_due_s).min_by(f32::total_cmp)? + COMMITMENT_S;
    let mut flights: Vec<_> = plan.flights.iter().collect();
    flights.sort_by_key(|flight| flight.id);
    Some(flights.into_iter().map(|flight| lot(flight, hold_s)).collect())
}

impl Mission {
    /// The divisions that routes need if nobody is lost are fewer than vehicles may agree on.
    pub(super) fn check_stretches(&self, plan: &SwarmPlan) -> anyhow::Result<()> {
        let mut losses: Vec<Vec<Lot>> = Vec::new();
        let mut next = next_lots(plan);
        while let Some(lots) = next {
            losses.push(lots);
            if losses.len() > MAX_DIVISIONS - DIVISIONS_RESERVED_FOR_LOSSES {
                bail!(
                    "area too large: {}: its routes take more than {} stretches of {WAYPOINTS} corners each\nhint: more \
                     vehicles, wider lanes, or the plans of `cover`, which autopilots fly alone",
                    self.scenario.path,
                    MAX_DIVISIONS - DIVISIONS_RESERVED_FOR_LOSSES
                );
            }
            next = next_lots(&*self.plan_rest(&[], losses.iter().map(|lots| &lots[..]))?);
        }
        Ok(())
    }
}
