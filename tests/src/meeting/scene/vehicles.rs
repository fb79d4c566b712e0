//! The vehicle that flies a flight of a scene.

use companion::autopilot::AutopilotKind;
use planner_core::flight::Flight;
use planner_core::schedule::{self, ScheduleWorkspace};

use super::types::{Plan, SCHEDULE, Vehicle, WAYPOINTS};
use super::ways::pads;
use crate::meeting::autopilot::Failsafe;
use crate::meeting::dice::Dice;

/// Vehicle `i` of a scene with these flights.
pub(super) fn vehicle(
    flights: &[Flight<WAYPOINTS>],
    i: usize,
    on_plan: bool,
    workspace: &mut ScheduleWorkspace,
    dice: &mut Dice,
) -> Vehicle {
    let flight = &flights[i];
    let mut plan = Plan {
        task: flight.task,
        path: flight.path.clone(),
        climb_m: flight.climb_m,
        descent_m: flight.descent_m,
        depart_s: flight.depart_s,
        gates: heapless::Vec::new(),
        plan_crc: if on_plan { 5 } else { 100 + i as u32 },
    };
    if on_plan {
        schedule::gates(&SCHEDULE, flights, i, workspace, &mut plan.gates).expect("few gates");
    }
    Vehicle {
        id: flight.id,
        kind: if dice.chance(0.6) { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot },
        pad: pads(flight)[0],
        plan,
        phase: dice.bits() % 40,
        on_loss: if dice.chance(0.5) { Failsafe::Land } else { Failsafe::Return },
    }
}
