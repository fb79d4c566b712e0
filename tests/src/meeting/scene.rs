//! Random meetings: each vehicle's path and plan, and the events that happen to it.

mod happenings;
mod passing;
mod types;
mod vehicles;
mod ways;

use planner_core::Point;
use planner_core::flight::Flight;
use planner_core::schedule::{self, ScheduleWorkspace};

use self::happenings::happenings;
pub use self::passing::{PASSINGS, passing};
pub use self::types::{
    CLIMB_MPS, CRUISE_MPS, GATES, LIMIT_S, Lie, MeetingEvent, PLATFORM_M, Plan, SAFETY_M, SCHEDULE,
    START_S, Scene, TimedEvent, VEHICLES, Vehicle, WAYPOINTS,
};
use self::vehicles::{common_plan, own_plan, vehicle};
use self::ways::{KINDS, Shape, fits, flight, way};
use super::autopilot::Catch;
use super::dice::Dice;

/// Latest departure of a vehicle, seconds.
const LATEST_S: f32 = 40.0;
/// Time limit of a meeting in which something catches a vehicle, seconds after its start.
const CAUGHT_LIMIT_S: f32 = 360.0;

/// Height of the ground below a place, metres: the platform under a pad or goal above the floor,
/// else 0.
pub fn floor_z(vehicles: &[Vehicle], place: &Point) -> f32 {
    let mut floor = 0.0_f32;
    for vehicle in vehicles {
        for pad in [vehicle.pad, landing(&vehicle.plan).unwrap_or(vehicle.pad)] {
            if pad.z > 0.0 && (pad - place).xy().norm() < PLATFORM_M && place.z > pad.z - 0.3 {
                floor = floor.max(pad.z);
            }
        }
    }
    floor
}

/// Place on the ground where a plan ends; `None` for an empty path.
pub fn landing(plan: &Plan) -> Option<Point> {
    plan.path.waypoints().last().map(|w| w.position - Point::new(0.0, 0.0, plan.descent_m))
}

/// The scene that follows from a seed.
pub fn scene(seed: u64) -> Scene {
    // Draws again if only one vehicle found a path: that is no meeting.
    (0..).find_map(|draw| drawn(seed, draw)).expect("some draw has room for two")
}

/// The scene of a seed in which something catches one vehicle in its flight, and nothing else
/// happens.
pub fn caught(seed: u64) -> Scene {
    let mut scene = scene(seed);
    let mut dice = Dice::new(seed ^ 0xCA06);
    scene.happenings.retain(|happening| happening.what == MeetingEvent::Start);
    let vehicle = dice.below(scene.vehicles.len());
    let at_s = START_S + scene.vehicles[vehicle].plan.depart_s + dice.real(3.0, 20.0);
    let how = [Catch::Wall, Catch::Ledge, Catch::Net, Catch::Wind][dice.below(4)];
    scene.happenings.push(TimedEvent { at_s, vehicle, what: MeetingEvent::Caught(how) });
    scene.happenings.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    // Vehicles that wait for the caught one fly around it or land, one after the other.
    scene.limit_s = CAUGHT_LIMIT_S;
    scene.liar = None;
    scene
}

fn drawn(seed: u64, draw: u64) -> Option<Scene> {
    let mut dice = Dice::new(seed ^ draw << 48);
    let kind = KINDS[dice.below(KINDS.len())];
    let on_plan = dice.chance(0.6);
    let count = 2 + [0, 0, 0, 1, 1, 2, 3, 4][dice.below(8)];
    let angle = dice.real(0.0, core::f32::consts::TAU);
    let shape = Shape {
        middle: Point::new(12.0, 12.0, 0.0),
        along: Point::new(angle.cos(), angle.sin(), 0.0),
        angle,
        z: dice.real(1.5, 6.0),
    };
    let mut workspace = Box::new(ScheduleWorkspace::new());
    let mut flights: Vec<Flight<WAYPOINTS>> = Vec::new();
    for i in 0..count {
        for _ in 0..40 {
            let way = way(kind, i, &shape, &mut dice);
            let Some(mut next) = flight(i as u8 + 1, &way) else { continue };
            if !fits(&flights, &next) {
                continue;
            }
            if on_plan {
                let earliest = schedule::earliest_departure(
                    &SCHEDULE,
                    &next,
                    0.0,
                    flights.iter(),
                    &mut workspace,
                );
                let Ok(depart_s) = earliest else { continue };
                if depart_s > LATEST_S {
                    continue;
                }
                next.depart_s = depart_s;
            } else {
                next.depart_s = if dice.chance(0.5) { 0.0 } else { dice.real(0.0, 10.0) };
            }
            flights.push(next);
            break;
        }
    }
    if flights.len() < 2 {
        return None;
    }
    let vehicles = (0..flights.len()).map(|i| {
        let plan =
            if on_plan { common_plan(&flights, i, &mut workspace) } else { own_plan(&flights, i) };
        vehicle(&flights[i], plan, &mut dice)
    });
    let vehicles: Vec<_> = vehicles.collect();
    let happenings = happenings(&vehicles, &mut dice);
    let delay = if dice.chance(0.5) { dice.real(0.0, 0.15) } else { dice.real(0.0, 0.9) };
    let delay_s = (delay, (delay + dice.real(0.0, 0.3)).min(1.0));
    let loss = if dice.chance(0.5) { 0.0 } else { dice.real(0.0, 0.3) };
    let liar = seed.is_multiple_of(6).then(|| liar(vehicles.len(), &mut dice));
    Some(Scene { seed, kind, on_plan, limit_s: LIMIT_S, vehicles, happenings, delay_s, loss, liar })
}

/// Index of the vehicle whose messages are false, and what is false in them.
fn liar(count: usize, dice: &mut Dice) -> (usize, Lie) {
    let lie = match dice.below(6) {
        0 | 1 => Lie::Position(dice.direction() * 0.5),
        2 => Lie::Velocity(dice.direction() * 0.5),
        3 => Lie::Still,
        4 => Lie::Progress(dice.real(0.5, 20.0)),
        _ => Lie::Points(dice.direction() * dice.real(0.5, 3.0)),
    };
    (dice.below(count), lie)
}
