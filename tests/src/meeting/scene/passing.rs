//! Meetings of two vehicles that pass as near as their schedule allows.

use planner_core::Point;
use planner_core::flight::Flight;
use planner_core::schedule::{self, ScheduleWorkspace};

use super::types::{MeetingEvent, SCHEDULE, START_S, Scene, TIME_LIMIT_S, TimedEvent, WAYPOINTS};
use super::vehicles::{common_plan, vehicle};
use super::ways::{PathWithPads, at_height, flight_along};
use crate::meeting::dice::Dice;

/// Geometries of [`passing_scene`].
pub const PASSINGS: [&str; 6] =
    ["opposite", "alongside", "overhead", "climb beside", "crossing", "lane"];

/// A scene of two vehicles of one plan that pass at exactly the separation of the schedule, or one
/// after the other; nothing else happens. The radio loses 30 % of the frames and delays them by 0.3
/// s.
pub fn passing_scene(seed: u64) -> Scene {
    let mut dice = Dice::new(seed ^ 0xFA15E);
    let kind = PASSINGS[seed as usize % PASSINGS.len()];
    let angle = dice.real(0.0, core::f32::consts::TAU);
    let along = Point::new(angle.cos(), angle.sin(), 0.0);
    let across = Point::new(-along.y, along.x, 0.0);
    let z = dice.real(1.5, 5.0);
    // Any nearer, and the schedule would give them a gate.
    let apart_m = SCHEDULE.separation_m + 1e-3;
    let place =
        |x: f32, y: f32, z: f32| at_height(Point::new(12.0, 12.0, 0.0) + along * x + across * y, z);
    let (a, b) = (dice.real(5.0, 9.0), dice.real(5.0, 9.0));
    let first = vec![place(-a, 0.0, z), place(b, 0.0, z)];
    let second = match kind {
        "opposite" => {
            vec![place(b + dice.real(-2.0, 2.0), apart_m, z), place(-a + 1.0, apart_m, z)]
        }
        "alongside" => {
            let shift = dice.real(-2.0, 2.0);
            vec![place(-a + shift, apart_m, z), place(b + shift, apart_m, z)]
        }
        "overhead" => vec![place(0.0, -a, z + apart_m), place(0.0, b, z + apart_m)],
        "climb beside" => {
            let x = dice.real(-2.0, 2.0);
            let mut points =
                vec![place(x, apart_m, z + dice.real(1.0, 10.0)), place(x, 8.0, z + 2.0)];
            points[1].z = points[0].z;
            if dice.chance(0.5) {
                points.reverse();
            }
            points
        }
        "crossing" => vec![place(0.0, -a, z), place(0.0, b, z)],
        _ => {
            vec![
                place(-a, 4.0, z),
                place(-a + 2.0, 0.0, z),
                place(b - 3.0, 0.0, z),
                place(b - 3.0, -5.0, z),
            ]
        }
    };
    let mut workspace = Box::new(ScheduleWorkspace::new());
    let flights = scheduled_flights([first, second], &mut workspace);
    let vehicles = (0..2)
        .map(|i| vehicle(&flights[i], common_plan(&flights, i, &mut workspace), &mut dice))
        .collect();
    let start = |vehicle| TimedEvent { at_s: START_S, vehicle, what: MeetingEvent::Start };
    Scene {
        seed,
        kind,
        on_plan: true,
        limit_s: TIME_LIMIT_S,
        vehicles,
        events: vec![start(0), start(1)],
        radio_delay_s: (0.3, 0.3),
        radio_loss: 0.3,
        liar: None,
    }
}

/// The flights along these ways, the second as early as the first allows.
fn scheduled_flights(
    ways: [Vec<Point>; 2],
    workspace: &mut ScheduleWorkspace,
) -> Vec<Flight<WAYPOINTS>> {
    let mut flights: Vec<Flight<WAYPOINTS>> = Vec::new();
    for (i, points) in ways.into_iter().enumerate() {
        let pad = at_height(points[0], 0.0);
        let way = PathWithPads { pad, points, goal_ground_z: 0.0 };
        let mut flight = flight_along(i as u8 + 1, &way).expect("a short flight");
        let departs =
            schedule::earliest_departure(&SCHEDULE, &flight, 0.0, flights.iter(), workspace);
        flight.depart_s = departs.expect("room for two");
        flights.push(flight);
    }
    flights
}
