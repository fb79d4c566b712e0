//! One message of the autopilot is lost, or all are, in the least favourable state: no vehicle is
//! disarmed in the air, none is left armed in the air, no pilot is overridden.

use mavlink::dialects::ardupilotmega::LOCAL_POSITION_NED_DATA;

use super::*;
use crate::link::frame::Frame;
use crate::link::intent::Intent;

const KINDS: [AutopilotKind; 2] = [AutopilotKind::Px4, AutopilotKind::ArduPilot];

/// Whether a disarming request is among the commands from number `from` on.
fn disarms(b: &Bench, from: usize) -> bool {
    b.commands[from..].iter().any(|c| (c.0, c.1) == (ARM, 0.0))
}

/// Total silence after a pilot gave the vehicle back, and the pilot takes over unheard: no mode is
/// requested for a minute.
#[test]
fn a_pilot_who_takes_a_silent_vehicle_over_is_not_overridden_within_a_minute() {
    for kind in KINDS {
        let mut b = reach(kind, State::Follow, None).expect("it flies");
        b.mode = pilot_mode(kind);
        b.run_until(State::PilotControl, 2.0);
        b.mode = kind.setpoint_mode();
        b.run_until(State::PilotReturned, 3.0);
        b.run(2.0);
        b.silent = true;
        b.run(3.0);
        b.mode = pilot_mode(kind);
        let before = b.commands.len();
        b.run(55.0);
        assert_eq!(b.commands.len(), before, "{kind:?} {:?}: {:?}", b.state(), b.texts);
        // Heard again, still with the pilot: the landing mode is not requested either.
        b.silent = false;
        b.run(5.0);
        assert_eq!(b.mode, pilot_mode(kind), "{kind:?} {:?}: {:?}", b.state(), b.texts);
    }
}

/// Down for its companion after a false report of the ground, the vehicle is heard again in the
/// air, without reports of the landing detector.
#[test]
fn an_aborted_vehicle_in_the_air_lands_without_the_landing_detector() {
    for kind in KINDS {
        let mut b = bench(kind);
        b.start();
        b.run_until(State::Follow, 60.0);
        b.run(1.0);
        b.false_ground = true;
        b.run(1.0);
        b.silent = true;
        b.run_until(State::Land, 70.0);
        b.run_until(State::Aborted, 130.0);
        b.no_landed_state = true;
        b.enu.z = 6.0;
        b.mode = kind.setpoint_mode();
        b.silent = false;
        b.run(60.0);
        assert!(b.on_ground() && !b.armed, "{kind:?} {:?}: {:?}", b.state(), b.texts);
    }
}

/// A false report of the ground ends a landing, then the reports end and the vehicle rises slowly.
#[test]
fn a_vehicle_that_rises_after_a_false_report_is_not_disarmed() {
    for kind in KINDS {
        for lost in [false, true] {
            let mut b = reach(kind, State::Follow, None).expect("it flies");
            b.run(1.0);
            land(&mut b);
            b.run_until(State::Land, 8.0);
            while b.enu.z > 1.2 && b.state() == State::Land {
                b.tick();
            }
            (b.never_lands, b.false_ground) = (true, true);
            b.run_until(State::Disarm, 8.0);
            b.run(0.3);
            b.no_landed_state = lost;
            for _ in 0..240 {
                b.enu.z = (b.enu.z + 0.015).min(4.0);
                let (from, harmful) = (b.commands.len(), b.armed && b.enu.z > HARMLESS_M);
                b.tick();
                assert!(!harmful || !disarms(&b, from), "{kind:?} {lost}: at {}", b.enu.z);
            }
        }
    }
}

/// HEARTBEAT and a later position are handed over at one time, then HEARTBEAT is lost: the height
/// with which the vehicle was last disarmed is that of the HEARTBEAT.
#[test]
fn a_rise_read_with_the_last_heartbeat_is_a_rise() {
    for kind in KINDS {
        let mut b = bench(kind);
        b.refused.push(ARM);
        b.start();
        b.run_until(State::Arming, 12.0);
        b.no_landed_state = true;
        b.run(1.0);
        b.refused.clear();
        let heartbeat = b.heartbeat();
        (b.no_heartbeat, b.stuck) = (true, true);
        b.companion.handle_bytes(Link::Autopilot, b.now, &heartbeat);
        b.enu.z += 0.8;
        let (ned, time_boot_ms) = (b.ned(), b.now.as_boot_ms() + 900);
        let (x, y, z) = (ned.x as f32, ned.y as f32, ned.z as f32);
        b.send(&LOCAL_POSITION_NED_DATA { time_boot_ms, x, y, z, ..Default::default() });
        let from = b.commands.len();
        for _ in 0..220 {
            (b.armed, b.mode) = (true, pilot_mode(kind));
            b.tick();
        }
        assert!(!disarms(&b, from), "{kind:?} {:?}", b.state());
    }
}

/// HEARTBEAT is lost as the vehicle is armed, and its pilot takes off with it unheard, while the
/// landing detector falsely reports the ground, or nothing: no disarming above the pad, and the
/// vehicle does not report that it is grounded.
#[test]
fn a_pilot_who_takes_off_unheard_is_not_disarmed() {
    for kind in KINDS {
        for (false_ground, lost) in [(true, false), (false, true), (true, true)] {
            for rise_m in [0.01, 0.03, 0.05] {
                let mut b = bench(kind);
                b.refused.push(ARM);
                b.start();
                b.run_until(State::Arming, 12.0);
                b.refused.clear();
                b.run(0.3);
                (b.no_heartbeat, b.no_landed_state) = (true, lost);
                (b.false_ground, b.stuck, b.armed) = (false_ground, true, true);
                for tick in 0..2400 {
                    (b.armed, b.mode) = (true, pilot_mode(kind));
                    let z_m = f32::min(b.enu.z + rise_m, 5.0);
                    b.enu.z = z_m;
                    let from = b.commands.len();
                    b.tick();
                    let case = format!("{kind:?} {false_ground} {lost} {rise_m} {:?}", b.state());
                    // Below 0.85 m a report of the ground counts more than the height.
                    let most_m = if false_ground { 0.9 } else { HARMLESS_M };
                    assert!(z_m <= most_m || !disarms(&b, from), "{case}: disarmed at {z_m}");
                    let flags = b.companion.own_intent().flags;
                    let grounded = flags & GROUNDED != 0;
                    assert!(!lost || tick < 500 || !grounded, "{case}: reported as grounded");
                }
            }
        }
    }
}

/// The estimated height rises while the motors spin up: a pause still keeps the vehicle on its pad.
#[test]
fn a_pause_holds_a_vehicle_whose_estimate_drifts_on_its_pad() {
    for drift_m in [0.0, 0.1, 0.3, 0.6] {
        let mut b = bench(AutopilotKind::Px4);
        b.start();
        b.run_until(State::Arming, 12.0);
        b.stuck = true;
        for _ in 0..60 {
            if b.companion.telemetry.armed {
                break;
            }
            b.height_error_m = f32::min(b.height_error_m + 0.05, drift_m);
            b.tick();
        }
        pause(&mut b);
        b.run(1.0);
        b.stuck = false;
        b.run(25.0);
        let end = (b.state(), b.armed, b.on_ground());
        assert_eq!(end, (State::Scheduled, false, true), "{drift_m}: {:?}", b.texts);
    }
}

/// The autopilot loses its power after a landing: what the vehicle reports of itself stays.
#[test]
fn a_landed_vehicle_whose_autopilot_is_switched_off_reports_no_change() {
    for kind in KINDS {
        let mut b = reach(kind, State::Follow, None).expect("it flies");
        land(&mut b);
        b.run_until(State::Aborted, 60.0);
        b.run(1.0);
        b.silent = true;
        b.swarm.clear();
        b.run(30.0);
        let flags = |frame: &Frame| Intent::decode(frame.padded_payload(), SYSTEM);
        let flags: Vec<u8> = b.swarm.iter().filter_map(flags).map(|i| i.flags).collect();
        let wanted = GROUNDED | OUT_OF_PLAN;
        assert!(flags.len() > 20, "{}", flags.len());
        assert!(flags.iter().all(|f| f & wanted == wanted), "{kind:?} {flags:?}");
    }
}

/// ArduCopter's estimator gives up while the motors spin up: the start is cancelled by disarming.
#[test]
fn a_start_whose_estimate_is_lost_is_disarmed_on_its_pad() {
    let mut b = bench(AutopilotKind::ArduPilot);
    (b.stays_armed, b.spool) = (true, Duration::from_secs(9));
    b.refused.push(ARM);
    b.start();
    b.run_until(State::Arming, 12.0);
    b.stuck = true;
    b.run(0.3);
    (b.armed, b.ekf_flags, b.no_position) = (true, 0, true);
    b.refused.clear();
    let from = b.commands.len();
    b.run(3.0);
    assert!(disarms(&b, from), "{:?}: {:?}", b.state(), b.texts);
}

/// A vehicle given back without a position is not landed in the gap of HEARTBEATs in which its
/// pilot takes it over.
#[test]
fn a_vehicle_given_back_without_a_position_is_not_landed_unheard() {
    for kind in KINDS {
        let mut b = reach(kind, State::Follow, None).expect("it flies");
        b.mode = pilot_mode(kind);
        b.run_until(State::PilotControl, 2.0);
        b.mode = kind.setpoint_mode();
        b.run_until(State::PilotReturned, 3.0);
        b.no_position = true;
        b.run(16.5);
        let before = b.commands.len();
        b.no_heartbeat = true;
        b.run(0.5);
        b.mode = pilot_mode(kind);
        b.run(30.0);
        let acts = b.commands[before..].iter().filter(|c| c.0 == SET_MODE).count();
        assert_eq!(acts, 0, "{kind:?} {:?}: {:?}", b.state(), b.texts);
    }
}
