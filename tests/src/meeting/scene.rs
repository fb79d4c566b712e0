//! Random meetings: each vehicle's path and plan, and the events that happen to it.

mod happenings;
mod passing;
mod types;
mod vehicles;
mod ways;

use planner_core::Point;
use planner_core::flight::Flight;
use planner_core::schedule::{self, ScheduleWorkspace};

use self::happenings::draw_events;
pub use self::passing::{PASSINGS, passing_scene};
pub use self::types::{
    CLIMB_MPS, CRUISE_MPS, GATES, Lie, MeetingEvent, PLATFORM_RADIUS_M, Plan, SAFETY_DISTANCE_M,
    SCHEDULE, START_S, Scene, TIME_LIMIT_S, TimedEvent, VEHICLES, Vehicle, WAYPOINTS,
};
use self::vehicles::{common_plan, own_plan, vehicle};
use self::ways::{KINDS, Placement, draw_path, fits_beside, flight_along};
use super::autopilot::Catch;
use super::dice::Dice;

/// Latest departure of a vehicle, seconds.
const LATEST_DEPARTURE_S: f32 = 40.0;
/// Time limit of a meeting in which something catches a vehicle, seconds after its start.
const CAUGHT_LIMIT_S: f32 = 360.0;

/// Height of the ground below a place, metres: the platform under a pad or goal above the floor,
/// else 0.
pub fn floor_z(vehicles: &[Vehicle], place: &Point) -> f32 {
    let mut floor = 0.0_f32;
    for vehicle in vehicles {
        for pad in [vehicle.pad, landing_point(&vehicle.plan).unwrap_or(vehicle.pad)] {
            if pad.z > 0.0 && (pad - place).xy().norm() < PLATFORM_RADIUS_M && place.z > pad.z - 0.3
            {
                floor = floor.max(pad.z);
            }
        }
    }
    floor
}

/// Place on the ground where a plan ends; `None` for an empty path.
pub fn landing_point(plan: &Plan) -> Option<Point> {
    plan.path.waypoints().last().map(|w| w.position - Point::new(0.0, 0.0, plan.descent_m))
}

/// The scene that follows from a seed.
pub fn random_scene(seed: u64) -> Scene {
    // Draws again if only one vehicle found a path: that is no meeting.
    (0..).find_map(|draw| draw_scene(seed, draw)).expect("some draw has room for two")
}

/// The scene of a seed in which something catches one vehicle in its flight, and nothing else
/// happens.
pub fn scene_with_caught_vehicle(seed: u64) -> Scene {
    let mut scene = random_scene(seed);
    let mut dice = Dice::new(seed ^ 0xCA06);
    scene.events.retain(|happening| happening.what == MeetingEvent::Start);
    let vehicle = dice.below(scene.vehicles.len());
    let at_s = START_S + scene.vehicles[vehicle].plan.depart_s + dice.real(3.0, 20.0);
    let how = [Catch::Wall, Catch::Ledge, Catch::Net, Catch::Wind][dice.below(4)];
    scene.events.push(TimedEvent { at_s, vehicle, what: MeetingEvent::Caught(how) });
    scene.events.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    // Vehicles that wait for the caught one fly around it or land, one after the other.
    scene.limit_s = CAUGHT_LIMIT_S;
    scene.liar = None;
    scene
}

fn draw_scene(seed: u64, draw: u64) -> Option<Scene> {
    let mut dice = Dice::new(seed ^ draw << 48);
    let kind = KINDS[dice.below(KINDS.len())];
    let on_plan = dice.chance(0.6);
    let count = 2 + [0, 0, 0, 1, 1, 2, 3, 4][dice.below(8)];
    let angle = dice.real(0.0, core::f32::consts::TAU);
    let placement = Placement {
        middle: Point::new(12.0, 12.0, 0.0),
        along: Point::new(angle.cos(), angle.sin(), 0.0),
        angle,
        z: dice.real(1.5, 6.0),
    };
    let mut workspace = Box::new(ScheduleWorkspace::new());
    let mut flights: Vec<Flight<WAYPOINTS>> = Vec::new();
    for i in 0..count {
        for _ in 0..40 {
            let path = draw_path(kind, i, &placement, &mut dice);
            let Some(mut next) = flight_along(i as u8 + 1, &path) else { continue };
            if !fits_beside(&flights, &next) {
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
                if depart_s > LATEST_DEPARTURE_S {
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
    let events = draw_events(&vehicles, &mut dice);
    let delay = if dice.chance(0.5) { dice.real(0.0, 0.15) } else { dice.real(0.0, 0.9) };
    let radio_delay_s = (delay, (delay + dice.real(0.0, 0.3)).min(1.0));
    let radio_loss = if dice.chance(0.5) { 0.0 } else { dice.real(0.0, 0.3) };
    let liar = seed.is_multiple_of(6).then(|| draw_liar(vehicles.len(), &mut dice));
    let limit_s = TIME_LIMIT_S;
    Some(Scene { seed, kind, on_plan, limit_s, vehicles, events, radio_delay_s, radio_loss, liar })
}

/// Index of the vehicle whose messages are false, and what is false in them.
fn draw_liar(count: usize, dice: &mut Dice) -> (usize, Lie) {
    let lie = match dice.below(6) {
        0 | 1 => Lie::Position(dice.direction() * 0.5),
        2 => Lie::Velocity(dice.direction() * 0.5),
        3 => Lie::Still,
        4 => Lie::Progress(dice.real(0.5, 20.0)),
        _ => Lie::Points(dice.direction() * dice.real(0.5, 3.0)),
    };
    (dice.below(count), lie)
}
