//! A vehicle of a scene and its plan.

use companion::autopilot::AutopilotKind;
use planner_core::flight::Flight;
use planner_core::schedule::{self, ScheduleWorkspace};

use super::types::{Plan, SCHEDULE, Vehicle, WAYPOINTS};
use super::ways::pad_and_goal;
use crate::meeting::autopilot::Failsafe;
use crate::meeting::dice::Dice;

/// The plan of vehicle `i` of vehicles that fly one common plan.
pub(super) fn common_plan(
    flights: &[Flight<WAYPOINTS>],
    i: usize,
    workspace: &mut ScheduleWorkspace,
) -> Plan {
    let mut plan = Plan { swarm_plan_crc: 5, ..own_plan(flights, i) };
    schedule::gates(&SCHEDULE, flights, i, workspace, &mut plan.gates).expect("few gates");
    plan
}

/// The plan of vehicle `i` of vehicles that know nothing of each other's plans.
pub(super) fn own_plan(flights: &[Flight<WAYPOINTS>], i: usize) -> Plan {
    let flight = &flights[i];
    Plan {
        task: flight.task,
        path: flight.path.clone(),
        climb_m: flight.climb_m,
        descent_m: flight.descent_m,
        depart_s: flight.depart_s,
        gates: heapless::Vec::new(),
        swarm_plan_crc: 100 + i as u32,
    }
}

/// The vehicle that flies this flight by this plan.
pub(super) fn vehicle(flight: &Flight<WAYPOINTS>, plan: Plan, dice: &mut Dice) -> Vehicle {
    Vehicle {
        id: flight.vehicle_id,
        kind: if dice.chance(0.6) { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot },
        pad: pad_and_goal(flight)[0],
        plan,
        stream_phase: dice.bits() % 40,
        on_setpoint_loss: if dice.chance(0.5) { Failsafe::Land } else { Failsafe::Return },
    }
}
