//! What was last heard of the autopilot may be old: the vehicle is not flown to where it no longer
//! is, a pilot whom no HEARTBEAT shows is not overridden again and again, and a vehicle that is
//! flown after its landing does not count as landed.

use super::*;
use crate::link::intent::LANDED;

/// Whether a setpoint carries a place.
fn has_place(b: &Bench, mask: u16) -> bool {
    mask & 7 == 0 && b.state().streams_setpoints()
}

/// The pilot flies the vehicle away while its position is lost, and gives it back: it is led to no
/// place until its position is known again, and then to where it is.
#[test]
fn a_vehicle_given_back_without_a_position_is_led_to_no_old_place() {
    const FAR_M: f32 = 1.0;
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for &(state, paused_in) in CASES {
            let Some(mut b) = reach(kind, state, paused_in) else { continue };
            let case = format!("{kind:?} {state:?} {paused_in:?}");
            b.stuck = true;
            (b.mode, b.status) = (pilot_mode(kind), 3);
            b.run_until(State::PilotControl, 2.0);
            b.no_position = true;
            for tick in 0..200 {
                if tick < 80 {
                    b.enu.y += 0.25;
                    b.enu.z = b.enu.z.max(3.0);
                } else {
                    b.mode = kind.setpoint_mode();
                }
                b.no_position = tick < 140;
                b.setpoints.clear();
                b.tick();
                let known = !(12..=160).contains(&tick);
                let unknown = (14..140).contains(&tick);
                let still = b.companion.guidance.smoother.velocity().norm() < 0.01;
                assert!(
                    !unknown || !b.companion.guidance.smoother.has_setpoint() || still,
                    "{case}: an old velocity is sent at tick {tick}"
                );
                for &(_, place, mask) in b.setpoints.iter().filter(|s| has_place(&b, s.2)) {
                    let far_m = (place - b.enu).norm();
                    assert!(
                        if known { tick < 12 || far_m < FAR_M } else { tick >= 140 },
                        "{case}: led to {far_m} m away at tick {tick} in {:?}, mask {mask:#x}",
                        b.state()
                    );
                }
            }
        }
    }
}

/// The telemetry ends, and the pilot takes over: the companion may try to land a vehicle that it
/// does not hear, but a few times only.
#[test]
fn a_pilot_who_is_not_heard_is_overridden_a_few_times_at_most() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for &(state, paused_in) in CASES {
            for all in [true, false] {
                let Some(mut b) = reach(kind, state, paused_in) else { continue };
                (b.silent, b.no_heartbeat) = (all, true);
                b.run(3.5);
                let before = b.commands.len();
                for _ in 0..20 * 200 {
                    (b.mode, b.status) = (pilot_mode(kind), 3);
                    b.tick();
                }
                let acts = b.commands[before..].iter().filter(|c| [SET_MODE, ARM].contains(&c.0));
                let count = acts.count();
                assert!(count <= 6, "{kind:?} {state:?} {paused_in:?} {all}: {count} times");
            }
        }
    }
}

/// The landing mode was confirmed, then HEARTBEAT is lost, and the pilot takes over: the mode is
/// not requested again.
#[test]
fn a_confirmed_landing_is_not_requested_again_unheard() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = reach(kind, State::Land, None).expect("it can land");
        assert_eq!(b.mode, kind.land_mode());
        b.no_heartbeat = true;
        let before = b.commands.len();
        for _ in 0..56 {
            (b.mode, b.status) = (pilot_mode(kind), 3);
            b.tick();
        }
        let acts = b.commands[before..].iter().filter(|c| [SET_MODE, ARM].contains(&c.0));
        assert_eq!((b.state(), acts.count()), (State::Land, 0), "{kind:?}");
    }
}

/// A pilot flies the vehicle again after its mission has ended: it reports that it flies, off its
/// plan, until it is down again.
#[test]
fn a_vehicle_flown_after_its_landing_is_not_reported_as_landed() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = bench(kind);
        b.start();
        b.run_until(State::Done, 90.0);
        b.run(1.0);
        let landed = b.companion.own_intent();
        assert_eq!(landed.flags & (LANDED | GROUNDED), LANDED | GROUNDED, "{landed:?}");
        (b.mode, b.armed, b.stuck, b.enu.z) = (pilot_mode(kind), true, true, 4.0);
        b.run(1.5);
        assert_eq!(b.state(), State::Done);
        let flown = b.companion.own_intent();
        assert_eq!(flown.flags & (LANDED | GROUNDED), 0, "{kind:?} {flown:?}");
        assert_ne!(flown.flags & OUT_OF_PLAN, 0, "{kind:?} {flown:?}");
        assert!(flown.may_come_down, "{kind:?} {flown:?}");
        (b.armed, b.enu.z) = (false, 0.0);
        b.run(1.5);
        let down = b.companion.own_intent();
        assert_eq!(down.flags & (LANDED | GROUNDED), LANDED | GROUNDED, "{kind:?} {down:?}");
    }
}

/// An autopilot that does not know the charge of its battery reports −1 in each SYS_STATUS: the
/// vehicle does not take off.
#[test]
fn an_unknown_charge_is_not_a_known_one() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = bench(kind);
        b.start();
        b.run_until(State::Follow, 20.0);
        let waits = b.texts.iter().any(|text| text.starts_with("Battery charge unknown"));
        assert!(!waits, "{kind:?}, charge reported: {:?}", b.texts);
        let mut b = bench(kind);
        b.battery = -1;
        b.run(6.0);
        b.start();
        b.run(20.0);
        assert!(b.texts.iter().any(|text| text == "Battery charge unknown: start waits"));
        assert!(!b.armed && b.commands.iter().all(|c| (c.0, c.1) != (ARM, 1.0)), "{:?}", b.texts);
    }
}

/// HEARTBEAT and the landing detector's report are lost while arming is requested: a vehicle that
/// rises meanwhile is not disarmed in the air.
#[test]
fn a_vehicle_that_rises_unheard_before_its_climb_is_not_disarmed() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for tenths in 0..20 {
            let mut b = bench(kind);
            b.refused.push(ARM);
            b.start();
            b.run_until(State::Arming, 12.0);
            b.run(tenths as f32 * 0.1);
            b.refused.clear();
            (b.no_heartbeat, b.no_landed_state, b.stuck, b.armed) = (true, true, true, true);
            for _ in 0..120 {
                b.mode = pilot_mode(kind);
                b.enu.z = (b.enu.z + 0.05).min(3.0);
                let before = b.commands.len();
                let z_m = b.enu.z;
                b.tick();
                let disarms = b.commands[before..].iter().any(|c| (c.0, c.1) == (ARM, 0.0));
                assert!(!disarms || z_m <= HARMLESS_M, "{kind:?} {tenths}: at {z_m} m");
                (b.armed, b.stuck) = (true, true);
            }
        }
    }
}

/// A pilot gives the vehicle back while its position is lost: it does not hover without a limit.
#[test]
fn a_vehicle_given_back_without_a_position_lands() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = reach(kind, State::Follow, None).expect("it flies");
        b.mode = pilot_mode(kind);
        b.run_until(State::PilotControl, 2.0);
        b.no_position = true;
        b.run(5.0);
        b.mode = kind.setpoint_mode();
        b.run(100.0);
        assert!(b.on_ground() && !b.armed, "{kind:?} {:?}: {:?}", b.state(), b.texts);
    }
}
