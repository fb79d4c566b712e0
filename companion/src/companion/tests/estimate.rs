//! Flights with a position estimate that is worse than the margin allows.

extern crate std;

use super::super::*;
use crate::autopilot::AutopilotKind;
use crate::testing::fake_autopilot::*;
use planner_core::Point;

/// With an estimate that is worse than the margin allows, the start is refused; a vehicle in flight
/// slows, then stops, and flies on once the estimate is better.
#[test]
fn the_pace_follows_the_estimate() {
    let fastest = |bench: &mut Bench, seconds: f32| {
        bench.run(4.0);
        let begun = bench.setpoints.len();
        bench.run(seconds);
        let pairs = bench.setpoints[begun..].windows(2);
        pairs
            .map(|p| (p[1].1 - p[0].1).norm() / (p[1].0 - p[0].0).as_secs_f32())
            .fold(0.0, f32::max)
    };
    // The margin of 0.5 m leaves 0.25 m for the estimate at cruise and 0.4 m at a crawl.
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut bench = match kind {
            AutopilotKind::Px4 => Bench::new(config()),
            AutopilotKind::ArduPilot => Bench::ardupilot(config()),
        };
        bench.companion.services.set_parameter_value(3, 0.26).unwrap();
        bench.companion.apply_parameters();
        bench.run_until(State::Ready, 60.0);
        bench.start();
        bench.run_until(State::Aborted, 5.0);
        assert!(
            bench.texts.iter().any(|t| t == "Estimate worse than margin: start refused"),
            "{:?}",
            bench.texts
        );
    }
    let mut long = plan();
    long.path = planner_core::flight::Path::new();
    for point in [START, Point::new(80.0, 12.0, 1.5)] {
        long.path.push(point, 1.2).unwrap();
    }
    let mut bench = Bench::new(config());
    bench.answer_plan = Some(Ok(long));
    bench.run_until(State::Ready, 6.0);
    bench.start();
    bench.run_until(State::Follow, 20.0);
    let full = fastest(&mut bench, 2.0);
    bench.accuracy_m = Some(0.11);
    let slower = fastest(&mut bench, 2.0);
    assert!(full > 1.5 && slower < 0.8 * full && slower > 0.3, "{full} {slower}");
    assert!(
        bench.texts.iter().any(|t| t == "Estimate within 33 cm, margin 25 cm: slower"),
        "{:?}",
        bench.texts
    );
    bench.accuracy_m = Some(0.2);
    bench.run(3.0);
    assert!(fastest(&mut bench, 2.0) < 0.05);
    assert_eq!(bench.state(), State::Follow);
    bench.accuracy_m = Some(0.02);
    assert!(fastest(&mut bench, 2.0) > 1.5, "{:?}", bench.texts);
    // After three seconds without a report the accuracy is unknown.
    bench.accuracy_m = None;
    bench.run(3.0);
    assert!(fastest(&mut bench, 2.0) < 0.05);
    assert!(
        bench.texts.iter().any(|t| t == "Estimate of unknown accuracy: stopping"),
        "{:?}",
        bench.texts
    );
    bench.run_until(State::Land, 40.0);
}

#[test]
fn unsound_variance_ratios_stop_an_arducopter() {
    for variance in [0.81, f32::NAN, f32::INFINITY] {
        let mut bench = Bench::ardupilot(config());
        bench.run_until(State::Ready, 60.0);
        bench.start();
        bench.run_until(State::Follow, 30.0);
        bench.pos_horiz_variance = variance;
        bench.run_until(State::Land, 40.0);
        assert!(
            bench.texts.iter().any(|t| t == "Estimate worse than margin for 30 s: landing"),
            "{:?}",
            bench.texts
        );
    }
}
