//! Reasons for a landing, and where there is room for it.

use planner_core::flight::{Path, VehiclePlan};
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::State::*;
use super::*;

/// The vehicle is commanded to land while the neighbour leaves no room below: the landing is held.
fn held_by(b: &mut Bench, neighbour: Neighbour) {
    b.neighbour = neighbour;
    b.run(0.3);
    land(b);
    b.run_until(LandingHeld, 8.0);
}

/// A vehicle in the middle of its path whose landing is held, since another one is below.
fn held() -> Bench {
    let mut bench = accompanied(Follow, 2.0);
    let below = beside_the_column(&bench);
    held_by(&mut bench, below);
    bench
}

/// Another vehicle in the air, beside the column below this one.
pub(super) fn beside_the_column(b: &Bench) -> Neighbour {
    flies(b.enu + Point::new(1.0, 0.0, -2.5), ON_PLAN)
}

/// Another vehicle so near the pad that there is no room to land on it.
fn at_the_pad() -> Neighbour {
    flies(START - Point::new(1.35, 0.0, 1.35), ON_PLAN)
}

/// The vehicle lands at the end of the path aside.
fn lands_aside(b: &mut Bench, seconds: f32) {
    b.run_until(Land, seconds);
    assert!((b.enu - GOAL).xy().norm() < 0.5, "where the way aside ends: {:?}", b.enu);
}

pub(super) fn are_commanded(scenes: &mut Scenes) {
    scenes.play(flying(), back, Aborted, 60.0);
    scenes.play(to(Climb), back, Aborted, 60.0);
}

/// Landings at limits of the battery and of the geofence.
pub(super) fn at_a_limit(scenes: &mut Scenes) {
    scenes.play(flying(), |b| b.battery = 10, Aborted, 30.0);
    scenes.play(flying(), |b| b.battery = 5, Aborted, 30.0);
    let low = Point::new(0.0, 0.0, -1.0);
    let narrow = fenced(config(), low, Point::new(12.0, 30.0, 10.0));
    scenes.play(Bench::following(narrow), nothing, Aborted, 60.0);
    // While another vehicle lies below, this one waits inside the geofence until there is room.
    let narrow = fenced(two_vehicles(), low, Point::new(10.0, 30.0, 10.0));
    let waits_inside = |b: &mut Bench| {
        b.neighbour = landed(Point::new(11.0, 12.0, 0.0));
        b.run(20.0);
        assert!(b.state() == Follow && (9.8..10.05).contains(&b.enu.x), "{:?}", b.enu);
        b.neighbour = landed(Point::new(8.0, 20.0, 0.0));
        b.run_until(Land, 5.0);
    };
    scenes.play(Bench::started_with_neighbour(narrow), waits_inside, Aborted, 60.0);
}

/// At random places and angles a path leaves the geofence: the vehicle stops there and does not fly
/// on along the fence. The position estimate is exact here, so that its error does not end the
/// flight.
#[test]
fn a_vehicle_at_the_fence_lands_where_its_path_leaves_it() {
    let mut rng = Pcg32::new(1, 1);
    let mut draw =
        |low: f32, high: f32| low + (high - low) * (rng.next_u32() >> 8) as f32 / 16_777_216.0;
    for case in 0..60 {
        let angle = draw(-1.3, 1.3);
        let way = Point::new(12.0 * libm::cosf(angle), 12.0 * libm::sinf(angle), draw(0.0, 7.0));
        let mut path = Path::new();
        for point in [START, START + way, START + way + Point::new(0.0, 12.0, 0.0)] {
            path.push(point, 1.2).unwrap();
        }
        let leaves = START + way * draw(0.1, 0.8);
        let most = Point::new(leaves.x, 90.0, 90.0);
        let mut config = fenced(config(), Point::new(0.0, -90.0, -1.0), most);
        config.cruise_mps = draw(0.5, 3.0);
        let mut b = Bench::new(config);
        b.answer_plan = Some(Ok(VehiclePlan { path, ..plan() }));
        b.run_until(Ready, 6.0);
        b.start();
        b.run_until(Land, 60.0);
        let away_m = (b.enu - leaves).norm();
        assert!(away_m < 0.4, "case {case}: {away_m} m from {leaves:?}: {:?}", b.texts);
    }
}

/// Another vehicle is below where this one lands.
pub(super) fn wait_for_room(scenes: &mut Scenes) {
    let nowhere_for_long = |b: &mut Bench| {
        b.run_until(Follow, 25.0);
        // There is no room above its pad either, and no place aside.
        b.neighbour = at_the_pad();
        b.answer_detour = Some(Err(PlanFailure::Unreachable));
        b.run_until(LandingHeld, 120.0);
        b.run(85.0);
        assert!(b.state() == LandingHeld && b.enu.z > 0.8, "{:?} {:?}", b.texts, b.enu);
        b.neighbour = flies(Point::new(8.0, 30.0, 1.5), ON_PLAN);
    };
    scenes.play(held(), nowhere_for_long, Aborted, 30.0);
    scenes.play(held(), |b| b.battery = 5, Aborted, 30.0);
}

/// There is no room above its pad, but a place aside.
pub(super) fn end_aside(scenes: &mut Scenes) {
    let on_its_way_up = |b: &mut Bench| {
        held_by(b, stands(Point::new(b.enu.x - 1.0, b.enu.y, 0.0), OUT_OF_PLAN));
        b.run_until(Follow, 25.0);
        lands_aside(b, 60.0);
    };
    scenes.play(accompanied(Climb, 2.0), on_its_way_up, Aborted, 30.0);
    let on_its_way_back = |b: &mut Bench| {
        back(b);
        b.neighbour = at_the_pad();
        lands_aside(b, 120.0);
    };
    scenes.play(accompanied(Follow, 2.0), on_its_way_back, Aborted, 30.0);
}
