//! Fast flights that are stopped and go on at any moment, as over a field: the setpoint stays on its path, and on the curve
//! that stops with it.

use planner_core::flight::Path;
use proptest::prelude::ProptestConfig;

use super::*;

/// A way back and forth over a field, lanes `apart_m` apart.
fn lanes(long_m: f32, apart_m: f32) -> Plan {
    let mut path = Path::new();
    path.push(START, 1.2).unwrap();
    for lane in 0..4 {
        let y = START.y + apart_m * lane as f32;
        let xs = if lane % 2 == 0 {
            [START.x + 10.0, START.x + long_m]
        } else {
            [START.x + long_m, START.x + 10.0]
        };
        for x in xs {
            path.push(Point::new(x, y, START.z), 10.0).unwrap();
        }
    }
    VehiclePlan { path, descent_m: START.z, ..plan() }
}

fn beside_m(path: &Path<WAYPOINTS>, place: &Point) -> f32 {
    let legs = path.waypoints().windows(2);
    let off = legs.map(|leg| {
        let along = leg[1].position - leg[0].position;
        let share = ((place - leg[0].position).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (leg[0].position + along * share - place).norm()
    });
    off.fold(f32::INFINITY, f32::min)
}

proptest::proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 200 } else { 2000 }))]
    #[test]
    fn a_pause_at_any_speed_is_flown_on_the_curve_and_on_the_path(
        cruise_mps in 1f32..15.0,
        (long_m, apart_m) in (20f32..80.0, 3f32..40.0),
        stops in proptest::collection::vec((1u32..100, 1u32..100), 1..8),
    ) {
        let mut config = config();
        config.cruise_mps = cruise_mps;
        let mut bench = Bench::new(config);
        let plan = lanes(long_m, apart_m);
        let path = plan.path.clone();
        bench.answer_plan = Some(Ok(plan));
        bench.step_m = cruise_mps * 0.06;
        bench.until(State::Ready, 6.0);
        bench.start();
        bench.until(State::Follow, 20.0);
        bench.setpoints.clear();
        let order = |bench: &mut Bench, go: f32| {
            bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, go, SYSTEM, crate::COMPONENT);
        };
        let mut off_m = 0f32;
        let mut fly = |bench: &mut Bench, ticks: u32| {
            for _ in 0..ticks {
                bench.tick();
                off_m = off_m.max(bench.companion.guidance.smoother.off_curve_m());
            }
        };
        for (flown, paused) in stops {
            fly(&mut bench, flown);
            order(&mut bench, 0.0);
            fly(&mut bench, paused);
            order(&mut bench, 1.0);
        }
        proptest::prop_assert!(off_m < 0.3, "{off_m} m off its curve at {cruise_mps} m/s");
        let beside = bench.setpoints.iter().map(|(_, place, _)| beside_m(&path, place));
        let worst = beside.fold(0.0, f32::max);
        proptest::prop_assert!(worst < 0.3, "{worst} m beside the path at {cruise_mps} m/s");
    }
}
