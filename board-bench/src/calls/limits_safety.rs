//! The reachable sets of the safety filter, called with extreme and invalid arguments.

use heapless::Vec;
use planner_core::Point;
use planner_core::track::safety::{
    Braking, Legs, MotionBounds, NeighbourMotion, OwnSet, PlaceOnPoints, ReachableSet,
    ReportedPathReach,
};

use super::limits_results::{CallListener, EXTREME_NUMBERS, Results, extreme_points};

pub(super) fn call_reachable_sets(to: &mut Results<'_, impl CallListener>) {
    for (i, p) in extreme_points().enumerate() {
        let hard = EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()];
        let braking = Braking { accel_mps2: hard, jerk_mps3: p.x };
        let stop_m = to.call("safety::Braking::stop_distance_m", || braking.stop_distance_m(p.y));
        to.add(stop_m);
        let bounds = MotionBounds { braking, speed_max_mps: p.y, stopped_when_unheard_for_s: p.z };
        let checked = to.call("safety::MotionBounds::check", || bounds.check());
        assert!(checked.is_err() || (stop_m >= 0.0 && hard > 0.0));
        let braking = Braking { accel_mps2: 1.5, jerk_mps3: 4.0 };
        let sane = MotionBounds { braking, speed_max_mps: 2.0, stopped_when_unheard_for_s: 45.0 };
        let ahead: Vec<Point, 12> =
            extreme_points().chain(extreme_points()).skip(i).take(12).collect();
        let own = [
            to.call("set::ReachableSet::at", || ReachableSet::at(p)),
            to.call("set::ReachableSet::along", || {
                ReachableSet::along(p, ahead.iter().copied(), hard)
            }),
            to.call("set::ReachableSet::vertical", || ReachableSet::vertical(p, hard)),
        ];
        let mut further = own[0].clone();
        to.call("set::ReachableSet::extend_along", || {
            further.extend_along(ahead.iter().copied(), hard);
        });
        for bounds in [bounds, sane] {
            let points = &ahead[..i % 3];
            let place_on_points =
                to.call("place::PlaceOnPoints::find", || PlaceOnPoints::find(&p, points, &p));
            let along = || ReportedPathReach::new(&p, points, &place_on_points, hard);
            let heard = NeighbourMotion {
                position: p,
                velocity: p,
                speed_mps: hard,
                age_s: p.x,
                delay_s: 0.3,
                reported_points: points,
                place_on_points,
                reported_path_reach: to.call("place::ReportedPathReach::new", along),
                rests_within_m: 0.0,
                grounded: i % 5 == 0,
                column_bottom_z_m: (i % 2 == 0).then_some(hard),
            };
            let reach_m = to
                .call("safety::NeighbourMotion::max_reach_m", || heard.max_reach_m(&bounds, hard));
            to.add(reach_m);
            let beyond = || place_on_points.place_uncertainty_m();
            let more_m = to.call("place::PlaceOnPoints::place_uncertainty_m", beyond);
            to.add(more_m);
            let other = to.call("safety::NeighbourMotion::reachable_set", || {
                heard.reachable_set(&bounds, hard)
            });
            for own in &own {
                let mut legs = Legs::new();
                let own = to.call("own::OwnSet::new", || OwnSet::new(own, &mut legs));
                let away = to.call("own::OwnSet::box_distances", || own.box_distances(&p));
                to.add(away.x + away.y + away.z);
                let near = to.call("own::OwnSet::conflicts", || own.conflicts(&other, &p, hard));
                to.add_count(usize::from(near));
            }
        }
    }
}
