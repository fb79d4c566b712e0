//! A landing detector that reports ground in the air; a start that is cancelled in the air; a
//! vehicle that the pilot gives back.

use super::*;

/// What the landing detector has reported since the pad.
#[derive(Clone, Copy, PartialEq)]
enum Reported {
    /// Flight, at least once.
    Flight,
    /// Ground all the time.
    OnlyGround,
}

/// A vehicle at least 0.3 m high in its climb, whose landing detector reports the ground.
fn climbing(kind: AutopilotKind, before: Reported) -> Bench {
    let mut b = bench(kind);
    b.false_ground = before == Reported::OnlyGround;
    b.start();
    b.run_until(State::Climb, 20.0);
    while b.enu.z < 0.3 {
        b.tick();
    }
    // The landing detector reports five times a second.
    b.false_ground = true;
    b.step_m = 0.0;
    b.run(0.25);
    b
}

/// A vehicle whose start is cancelled, but that is armed and lifted off by others; its landing
/// detector never reports flight.
fn cancelled_in_air() -> Bench {
    let mut b = bench(AutopilotKind::Px4);
    (b.refused, b.false_ground) = (std::vec![ARM], true);
    b.start();
    b.run_until(State::Arming, 8.0);
    assert_eq!(land(&mut b), Some(ACCEPTED));
    b.armed = true;
    b.run(1.2);
    (b.enu.z, b.step_m) = (1.0, 0.0);
    b.run(0.1);
    b.refused.clear();
    b.run(1.2);
    assert_eq!(b.state(), State::CancelStart, "{:?}", b.texts);
    assert!(b.armed, "disarmed in the air");
    b.step_m = 0.1;
    b
}

#[test]
fn a_pause_disarms_no_vehicle_in_the_air() {
    use AutopilotKind::*;
    use Reported::*;
    // An ArduCopter that reports no flight stays in `TakeOff`, not in `Climb`.
    for (kind, before) in [(Px4, Flight), (Px4, OnlyGround), (ArduPilot, Flight)] {
        let mut b = climbing(kind, before);
        assert_eq!(pause(&mut b), Some(ACCEPTED));
        b.run(1.0);
        assert_eq!(b.state(), State::Climb, "{kind:?}: {:?}", b.texts);
        b.step_m = 0.1;
        b.run_until(State::Paused, 5.0);
        assert!(
            !b.commands.iter().any(|c| (c.0, c.1) == (ARM, 0.0)),
            "{kind:?} disarms in the air"
        );
    }
}

#[test]
fn a_cancelled_start_that_its_pilot_gives_back_in_the_air_holds_and_lands() {
    let mut b = cancelled_in_air();
    b.mode = pilot_mode(b.kind);
    b.run_until(State::PilotControl, 2.0);
    let asked = b.commands.len();
    b.run(3.0);
    assert_eq!(b.commands.len(), asked, "a request under the pilot: {:?}", b.commands);
    (b.mode, b.false_ground) = (b.kind.setpoint_mode(), false);
    b.run_until(State::PilotReturned, 2.0);
    let (held, sent) = (b.enu, b.setpoints.len());
    b.run(3.0);
    assert!(b.setpoints.len() > sent + 50, "nobody flies it");
    assert!((b.enu - held).norm() < 0.1, "held at {held:?}, not {:?}", b.enu);
    assert_eq!(resume(&mut b), Some(ACCEPTED));
    b.run_until(State::Land, 1.0);
    b.run_until(State::Aborted, 20.0);
    assert!(b.on_ground() && !b.armed);
}

#[test]
fn a_failsafe_in_a_cancelled_start_in_the_air_counts_until_it_has_landed() {
    let mut b = cancelled_in_air();
    (b.mode, b.status) = (px4::RTL, 5);
    b.run_until(State::Failsafe, 2.0);
    (b.mode, b.status) = (b.kind.setpoint_mode(), 3);
    b.run(2.0);
    assert_eq!(b.state(), State::Failsafe);
    assert_eq!(land(&mut b), Some(ACCEPTED));
    b.run_until(State::Aborted, 20.0);
    assert!(b.on_ground() && !b.armed);
}

#[test]
fn a_pilot_ends_a_cancelled_start_on_the_ground() {
    for disarmed in [false, true] {
        let mut b = bench(AutopilotKind::Px4);
        b.refused = std::vec![ARM];
        b.start();
        b.run_until(State::Arming, 8.0);
        assert_eq!(land(&mut b), Some(ACCEPTED));
        assert_eq!(b.state(), State::CancelStart);
        b.armed = !disarmed;
        b.mode = pilot_mode(b.kind);
        b.run(4.0);
        let state = if disarmed { State::Aborted } else { State::PilotControl };
        assert_eq!(b.state(), state, "{:?}", b.texts);
        b.armed = false;
        b.run_until(State::Aborted, 2.0);
    }
}

#[test]
fn a_pilot_that_gives_back_after_a_silence_gives_back_to_setpoints() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = bench(kind);
        b.start();
        b.run_until(State::Follow, 20.0);
        b.mode = pilot_mode(kind);
        b.run_until(State::PilotControl, 2.0);
        b.silent = true;
        b.run(70.0);
        (b.silent, b.mode) = (false, kind.setpoint_mode());
        b.run_until(State::PilotReturned, 2.0);
        let sent = b.setpoints.len();
        b.run(1.0);
        assert!(b.setpoints.len() > sent + 10, "{kind:?}: nobody flies it");
        assert_eq!(resume(&mut b), Some(ACCEPTED));
        b.run_until(State::Done, 60.0);
    }
}
