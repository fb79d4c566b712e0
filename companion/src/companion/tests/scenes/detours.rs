//! Another vehicle is not heard, lies below the path, or flies where this one is to fly.

use planner_core::flight::Gate;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use std::vec::Vec;

use super::State::*;
use super::*;

/// The shell's answer that there is no detour.
pub(super) const NO_WAY: Option<Result<(), PlanFailure>> = Some(Err(PlanFailure::Unreachable));

/// Another vehicle lies below the path from now on.
fn blocked(b: &mut Bench) {
    b.neighbour = below_the_path(OUT_OF_PLAN);
    b.run_until(Blocked, 3.0);
}

pub(super) fn others_are_not_heard(scenes: &mut Scenes) {
    let unheard = |b: &mut Bench| b.neighbour = None;
    scenes.play(accompanied(Follow, 1.0), unheard, SwarmLinkLost, 5.0);
    scenes.play(accompanied(Follow, 1.0), unheard, Aborted, 60.0);
    let for_a_while = |b: &mut Bench| {
        b.neighbour = None;
        b.run_until(SwarmLinkLost, 5.0);
        b.neighbour = on_pad(ON_PLAN);
    };
    scenes.play(accompanied(Follow, 1.0), for_a_while, Done, 60.0);
    // The other vehicle is out of radio range. It reported that it flies on beyond the place that
    // opens the gate, or only up to before that place.
    let mut far = two_vehicles();
    far.radio_range_m = 5.0;
    let mut gated = plan();
    gated.gates.push(Gate { at_m: 0.5, wait_for_id: 77, open_from_progress_m: 6.0 }).unwrap();
    let gated_until = |clear_m| {
        let mut bench = Bench::new(far.clone());
        bench.answer_plan = Some(Ok(gated.clone()));
        bench.neighbour = Some((Point::new(8.0, 60.0, 10.0), FLYING | ON_PLAN, 5.0, 5));
        bench.neighbour_clear_m = clear_m;
        bench.run_until(Ready, 6.0);
        bench.start();
        bench.run_until(Follow, 30.0);
        bench
    };
    for (clear_m, end) in [(50.0, Done), (5.0, Aborted)] {
        let out_of_range = |b: &mut Bench| {
            b.neighbour = None;
            b.run_until(SwarmLinkLost, 10.0);
        };
        scenes.play(gated_until(clear_m), out_of_range, end, 60.0);
    }
    // The other vehicle is heard, and never passes the place that opens the gate.
    scenes.play(gated_until(5.0), |b| b.run(605.0), Aborted, 60.0);
    // A third vehicle is never heard: it does not count as standing.
    let mut three = two_vehicles();
    three.roster.push(RosterEntry { system_id: 78, ..three.roster[1] }).unwrap();
    let third_unheard = |b: &mut Bench| {
        blocked(b);
        b.run(601.0);
    };
    scenes.play(accompanied_with(three, Follow, 1.0), third_unheard, Aborted, 60.0);
}

/// Once all others stand this vehicle flies around the other one, or lands.
pub(super) fn another_lies_below_the_path(scenes: &mut Scenes) {
    scenes.play(accompanied(Follow, 1.0), blocked, Done, 60.0);
    let for_a_while = |b: &mut Bench| {
        blocked(b);
        b.neighbour = on_pad(ON_PLAN);
    };
    scenes.play(accompanied(Follow, 1.0), for_a_while, Done, 60.0);
    // In a plan without a goal the detour leads home.
    let mut bench = Bench::new(two_vehicles());
    (bench.answer_plan, bench.neighbour) = (Some(Ok(field_plan())), on_pad(ON_PLAN));
    bench.run_until(Ready, 6.0);
    bench.start();
    bench.run_until(Follow, 30.0);
    bench.run(1.0);
    let flown_home = |b: &mut Bench| {
        blocked(b);
        b.run_until(Done, 60.0);
        assert!((b.enu - Point::new(START.x, START.y, 0.0)).norm() < 0.3, "{}", b.enu);
    };
    scenes.play(bench, flown_home, Done, 1.0);
    let unanswered = |b: &mut Bench| {
        b.answer_detour = None;
        blocked(b);
        b.run_until(Replanning, 6.0);
        b.run_until(Blocked, 6.0);
    };
    scenes.play(accompanied(Follow, 1.0), unanswered, Replanning, 20.0);
    let no_way = |b: &mut Bench| {
        b.answer_detour = NO_WAY;
        blocked(b);
    };
    scenes.play(accompanied(Follow, 1.0), no_way, Aborted, 120.0);
    // The other vehicle lies so near that there is no room to land either: this one flies back
    // along its path.
    let so_near = |b: &mut Bench| {
        no_way(b);
        b.run_until(Blocked, 5.0);
        b.run(1.0);
        b.neighbour = stands(Point::new(b.enu.x + 1.2, b.enu.y, 0.1), OUT_OF_PLAN);
        b.run_until(Follow, 120.0);
    };
    scenes.play(accompanied(Follow, 1.0), so_near, Aborted, 60.0);
}

pub(super) fn before_take_off(scenes: &mut Scenes) {
    let grounded = |answer| {
        let mut bench = Bench::started_with_neighbour(two_vehicles());
        bench.neighbour = below_the_path(OUT_OF_PLAN);
        bench.answer_detour = answer;
        bench.run(4.5);
        bench
    };
    scenes.play(grounded(Some(Ok(()))), nothing, Done, 60.0);
    scenes.play(grounded(NO_WAY), nothing, Scheduled, 1.0);
    scenes.play(grounded(None), nothing, Scheduled, 6.0);
}

pub(super) fn another_flies_where_it_is_to_fly(scenes: &mut Scenes) {
    // The other vehicle comes down over the first stretch of the path: this one cannot evade
    // backwards, so it requests a path aside, repeatedly.
    let comes_down = |b: &mut Bench| {
        b.answer_detour = None;
        b.neighbour = flies(Point::new(9.5, 12.0, 2.8), 0);
    };
    scenes.play(accompanied(Follow, 0.0), comes_down, Replanning, 6.0);
    // A vehicle on a detour stays in front of this one.
    let stays_in_front = |b: &mut Bench| {
        b.neighbour = flies(Point::new(14.0, 12.0, 1.5), ON_PLAN | crate::link::intent::ON_DETOUR);
    };
    scenes.play(accompanied(Follow, 0.0), stays_in_front, Aborted, 140.0);
    // On its way back this vehicle yields to one that follows the plan, and lands in the end.
    let yields = |b: &mut Bench| {
        back(b);
        b.run(0.2);
        b.neighbour = flies(Point::new(7.0, 12.0, 1.5), ON_PLAN);
    };
    scenes.play(accompanied(Follow, 3.0), yields, Aborted, 100.0);
}

/// A vehicle that hovers and sways beside a lane does not make this one stop and continue
/// repeatedly.
#[test]
fn a_vehicle_that_sways_beside_the_path_over_a_field_blocks_it_once_or_not() {
    let safety_m = config().safety_distance_m;
    let mut rng = Pcg32::seed_from_u64(9);
    let mut real =
        |low: f32, high: f32| low + (high - low) * (rng.next_u32() >> 8) as f32 / 16_777_216.0;
    let flights: Vec<(usize, State)> = (0..40)
        .map(|_| {
            let mut b = losses::over_a_field(Follow);
            let (beside_m, along_m) = (safety_m + real(0.1, 1.5), real(12.0, 15.5));
            let (sway_m, turns) = (real(0.02, 0.24), real(0.3, 3.0));
            for step in 0..6000 {
                let sways_m = sway_m * libm::sinf(turns * 0.05 * step as f32);
                b.neighbour =
                    flies(Point::new(along_m, 12.0 + beside_m + sways_m, 1.5), OUT_OF_PLAN);
                b.run(0.05);
                if matches!(b.state(), Done | Aborted) {
                    break;
                }
            }
            let stops = b.texts.iter().filter(|text| text.starts_with("Path blocked: waiting"));
            (stops.count() / 2, b.state())
        })
        .collect();
    std::println!("{flights:?}");
    assert!(flights.iter().all(|(stops, end)| *stops <= 1 && *end == Done), "{flights:?}");
}
