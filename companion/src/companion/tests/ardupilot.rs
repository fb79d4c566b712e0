//! The mission against a scripted ArduCopter: what differs from PX4, and what must not.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::{MavCmd, TIMESYNC_DATA};

use super::super::*;
use crate::autopilot::ardupilot;
use crate::testing::fake_autopilot::*;
use planner_core::Point;

/// A bench whose vehicle is in the middle of its path.
fn following() -> Bench {
    let mut bench = Bench::ardupilot(config());
    bench.run_until(State::Ready, 6.0);
    bench.start();
    bench.run_until(State::Follow, 20.0);
    bench.run(2.0);
    assert_eq!(bench.state(), State::Follow);
    bench
}

fn numbers(bench: &Bench) -> Vec<u16> {
    bench.commands.iter().map(|c| c.0).filter(|c| [176, 400, 22].contains(c)).collect()
}

#[test]
fn flies_guided_from_silence_to_the_goal() {
    let mut bench = Bench::ardupilot(config());
    bench.run_until(State::Ready, 6.0);
    for stream in ardupilot::STREAMS {
        assert!(
            bench.commands.contains(&(511, f32::from(stream.0), stream.1, 0.0)),
            "stream {}",
            stream.0
        );
    }
    bench.start();
    bench.run_until(State::TakeOff, 10.0);
    let before = bench.setpoints.len();
    assert!(before >= 20, "a second of setpoints before Guided");
    bench.run_until(State::Climb, 6.0);
    assert_eq!(
        bench.setpoints.len(),
        before,
        "a setpoint before the lift-off would cancel the take-off"
    );
    bench.run_until(State::Done, 60.0);
    assert_eq!(numbers(&bench), [176, 400, 22, 176]);
    assert!(
        bench.commands.contains(&(176, 1.0, 4.0, 0.0))
            && bench.commands.contains(&(176, 1.0, 9.0, 0.0))
    );
    // Home lies two metres below the pad; the climb is 1.5 m.
    assert!((bench.takeoff_m - 3.5).abs() < 0.01, "take-off to {} m above home", bench.takeoff_m);
    assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2, "{:?}", bench.enu);
    // The setpoints stay on the path, though ArduCopter projects about its own origin, 300 m away.
    for (_, at, mask) in &bench.setpoints {
        assert_eq!(*mask, ardupilot::MASK_POSITION_VELOCITY);
        assert!((at.y - 12.0).abs() < 0.02 && at.x > 7.98 && at.x < 16.02 && at.z < 3.52, "{at:?}");
    }
}

#[test]
fn waits_for_the_estimator() {
    let mut bench = Bench::ardupilot(config());
    for flags in [0x400, 0xA7] {
        bench.ekf_flags = flags;
        bench.run(10.0);
        assert_eq!(bench.state(), State::WaitPosition, "EKF flags {flags:#x}");
    }
    bench.ekf_flags = 0x33F;
    bench.run_until(State::Ready, 3.0);
    // In flight an estimator that is no longer ready counts as a lost position.
    let mut bench = following();
    bench.ekf_flags = 0xA7;
    bench.run_until(State::PositionLost, 3.0);
    bench.run(0.1);
    assert_eq!(bench.setpoints.last().unwrap().2, ardupilot::MASK_VELOCITY);
}

#[test]
fn asks_for_the_streams_again_after_a_reboot() {
    let mut bench = Bench::ardupilot(config());
    bench.run_until(State::Ready, 6.0);
    bench.streams.clear();
    bench.run(4.0);
    assert_eq!(bench.state(), State::Ready, "back before the position counts as lost");
    assert!(ardupilot::STREAMS.iter().all(|(id, _)| bench.streams.contains(id)));
    // The same in flight, here under the pilot.
    let mut bench = following();
    bench.mode = ardupilot::BRAKE;
    bench.run_until(State::PilotControl, 3.0);
    bench.streams.clear();
    bench.run(4.0);
    assert!(ardupilot::STREAMS.iter().all(|(id, _)| bench.streams.contains(id)));
}

#[test]
fn a_pilot_is_never_fought_and_gets_the_current_position_back() {
    let mut bench = following();
    bench.mode = ardupilot::BRAKE;
    bench.run_until(State::PilotControl, 3.0);
    let asked = numbers(&bench).len();
    bench.enu += Point::new(0.0, 0.3, 0.0);
    bench.run(3.0);
    // The setpoints that are still sent take effect as soon as Guided is entered: they must hold
    // the current position.
    bench.mode = ardupilot::GUIDED;
    let at = bench.enu;
    bench.run(3.0);
    assert!((bench.enu - at).norm() < 0.05 && bench.state() == State::PilotReturned);
    assert_eq!(numbers(&bench).len(), asked, "and no command");
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, crate::COMPANION_COMPONENT);
    bench.run_until(State::Done, 60.0);
}

#[test]
fn its_failsafe_gets_no_setpoints() {
    let mut bench = following();
    (bench.mode, bench.status) = (ardupilot::RTL, 5);
    bench.run_until(State::Failsafe, 3.0);
    let sent = bench.setpoints.len();
    bench.run(5.0);
    assert_eq!(bench.setpoints.len(), sent);
}

#[test]
fn timesync_is_answered_and_its_answers_are_not() {
    let mut bench = Bench::ardupilot(config());
    bench.run(1.0);
    bench.send(&TIMESYNC_DATA { tc1: 0, ts1: 77 });
    assert_eq!(bench.timesyncs, [(bench.now.as_micros() as i64 * 1000, 77)]);
    bench.send(&TIMESYNC_DATA { tc1: 5, ts1: 78 });
    assert_eq!(bench.timesyncs.len(), 1);
}

#[test]
fn another_autopilots_heartbeat_changes_nothing() {
    let mut bench = Bench::ardupilot(config());
    bench.run_until(State::Ready, 6.0);
    bench.kind = crate::autopilot::AutopilotKind::Px4;
    bench.armed = true;
    bench.run(3.5);
    assert_eq!(bench.state(), State::WaitAutopilot, "its own is silent");
}

#[test]
fn what_was_flown_while_the_estimator_was_not_ready_is_no_jump() {
    let mut bench = following();
    bench.ekf_flags = 0xA7;
    bench.stuck = true;
    // The vehicle moves 2.5 m before its position counts again.
    for _ in 0..10 {
        bench.enu.x += 0.25;
        bench.run(0.05);
    }
    bench.ekf_flags = 0x33F;
    bench.run(0.5);
    assert!(!bench.companion.telemetry.is_position_settling(bench.now), "{:?}", bench.texts);
}
