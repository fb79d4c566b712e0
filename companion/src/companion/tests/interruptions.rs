//! Every state against every interruption, on the scripted autopilots; random sequences of them are
//! in `random`.

extern crate std;
use std::format;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::MavCmd;

use super::super::*;
use crate::autopilot::AutopilotKind;
use crate::autopilot::{ardupilot, px4};
use crate::link::commands::{ACCEPTED, TEMPORARILY_REJECTED};
use crate::link::intent::{GROUNDED, ON_PLAN, OUT_OF_PLAN};
use crate::planner::{PlanInputs, RequestedPlan};
use crate::testing::fake_autopilot::*;
use planner_core::Point;

mod carried;
mod false_ground;
mod lost_messages;
mod old_values;
mod random;
mod reported_ground;
mod reports;

const ARM: u16 = 400;
const SET_MODE: u16 = 176;
const TAKE_OFF: u16 = 22;
/// True height above the ground up to which a disarmed vehicle does not fall far, metres.
const HARMLESS_M: f32 = 0.35;

/// A flight mode into which a pilot switches the autopilot.
fn pilot_mode(kind: AutopilotKind) -> u32 {
    match kind {
        AutopilotKind::Px4 => px4::HOLD,
        AutopilotKind::ArduPilot => ardupilot::BRAKE,
    }
}

/// Sends a command of the ground station; returns the MAV_RESULT that answers it.
fn order(b: &mut Bench, command: MavCmd, param1: f32) -> Option<u8> {
    b.acks.clear();
    b.command(command, param1, SYSTEM, crate::COMPANION_COMPONENT);
    b.acks.pop().map(|ack| ack.1)
}

fn pause(b: &mut Bench) -> Option<u8> {
    order(b, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0)
}

fn resume(b: &mut Bench) -> Option<u8> {
    order(b, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0)
}

fn land(b: &mut Bench) -> Option<u8> {
    order(b, MavCmd::MAV_CMD_NAV_LAND, 0.0)
}

/// A vehicle on its pad, in `Ready`; an ArduCopter lifts off 2 s after NAV_TAKEOFF.
fn bench(kind: AutopilotKind) -> Bench {
    let mut bench = match kind {
        AutopilotKind::Px4 => Bench::new(config()),
        AutopilotKind::ArduPilot => Bench::ardupilot(config()),
    };
    bench.spool = Duration::from_millis(2000);
    bench.run_until(State::Ready, 6.0);
    bench
}

/// A bench in a state that can be interrupted; from there the vehicle stands still, so that nothing
/// but the interruption moves the mission on.
fn reach(kind: AutopilotKind, state: State, paused_in: Option<State>) -> Option<Bench> {
    use State::*;
    let mut b = match state {
        SwarmLinkLost | Blocked => {
            let mut b = Bench::started_with_neighbour(two_vehicles());
            b.run_until(Follow, 20.0);
            b.run(1.0);
            b
        }
        _ => {
            let mut b = bench(kind);
            b.start();
            b
        }
    };
    match state {
        TakeOff if kind == AutopilotKind::Px4 => return None,
        SwarmLinkLost | Blocked if kind == AutopilotKind::ArduPilot => return None,
        TakeOff => b.run_until(TakeOff, 20.0),
        Climb => {
            b.run_until(Climb, 20.0);
            b.run_until_lifted();
            b.run(0.7);
        }
        Follow => {
            b.run_until(Follow, 20.0);
            b.run(0.5);
        }
        Paused => {
            b.run_until(paused_in?, 20.0);
            b.run_until_lifted();
            b.run(0.3);
            assert_eq!(pause(&mut b), Some(ACCEPTED));
            b.run(3.0);
        }
        SwarmLinkLost => {
            b.neighbour = None;
            b.run_until(SwarmLinkLost, 5.0);
            b.run(2.0);
        }
        Blocked => {
            b.answer_detour = None;
            b.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
            b.run_until(Blocked, 3.0);
        }
        Land => {
            b.run_until(Follow, 20.0);
            b.run(1.0);
            b.never_lands = true;
            assert_eq!(land(&mut b), Some(ACCEPTED));
            b.run_until(Land, 8.0);
            b.run(2.0);
        }
        _ => return None,
    }
    // In `Follow` it must keep following: a vehicle that stands would be off its setpoint.
    b.stuck = state != Follow;
    if state == TakeOff {
        b.spool = Duration::from_secs(1000);
    }
    assert_eq!(b.state(), state);
    Some(b)
}

const CASES: &[(State, Option<State>)] = &[
    (State::TakeOff, None),
    (State::Climb, None),
    (State::Follow, None),
    (State::Paused, Some(State::Climb)),
    (State::Paused, Some(State::Follow)),
    (State::SwarmLinkLost, None),
    (State::Blocked, None),
    (State::Land, None),
];

#[test]
fn an_interruption_returns_to_the_state_that_it_interrupted() {
    type Script = fn(&mut Bench);
    let there_and_back: &[(&str, State, Script, Script)] = &[
        ("position", State::PositionLost, |b| b.no_position = true, |b| b.no_position = false),
        (
            "jump",
            State::PositionLost,
            // The vehicle is in the end where it was before the jump.
            |b| {
                b.enu.y += 5.0;
                b.run(0.05);
                b.enu.y -= 5.0;
            },
            |_| {},
        ),
        ("autopilot", State::AutopilotSilent, |b| b.silent = true, |b| b.silent = false),
        (
            "pilot",
            State::PilotControl,
            |b| b.mode = pilot_mode(b.kind),
            |b| {
                b.run(2.0);
                assert_eq!(resume(b), Some(TEMPORARILY_REJECTED), "a resume under the pilot");
                b.mode = b.kind.setpoint_mode();
                b.run_until(State::PilotReturned, 2.0);
                b.run(3.0);
                assert_eq!(b.state(), State::PilotReturned, "the mode alone");
                assert_eq!(resume(b), Some(ACCEPTED));
            },
        ),
    ];
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for &(state, paused_in) in CASES {
            for (name, through, there, back) in there_and_back {
                let Some(mut b) = reach(kind, state, paused_in) else { continue };
                // The autopilot lands by itself: neither a lost position nor a silence interrupts
                // the landing.
                if state == State::Land && *through != State::PilotControl {
                    continue;
                }
                let case = format!("{kind:?} {state:?} {paused_in:?} {name}");
                there(&mut b);
                let neighbour = b.neighbour;
                for _ in 0..80 {
                    if b.state() == *through {
                        break;
                    }
                    b.tick();
                }
                assert_eq!(b.state(), *through, "{case}: {:?}", b.texts);
                back(&mut b);
                b.neighbour = neighbour;
                let mut seen = Vec::new();
                for _ in 0..100 {
                    seen.push(b.state());
                    if b.state() == state {
                        break;
                    }
                    b.tick();
                }
                assert_eq!(b.state(), state, "{case}: {seen:?} {:?}", b.texts);
                let begun = [State::Climb, State::Follow, State::Land];
                assert!(
                    seen.iter().all(|s| *s == state || !begun.contains(s)),
                    "{case} goes elsewhere first: {seen:?}"
                );
                if let Some(paused_in) = paused_in {
                    assert_eq!(resume(&mut b), Some(ACCEPTED), "{case}");
                    assert_eq!(b.state(), paused_in, "{case}");
                }
            }
        }
    }
}

#[test]
fn after_an_interruption_of_the_climb_the_climb_goes_on_and_the_goal_is_reached() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for (paused, lost) in [(true, false), (false, true), (true, true)] {
            let mut b = bench(kind);
            b.start();
            b.run_until(State::Climb, 20.0);
            // A pause takes effect only in the upper half of the climb.
            b.run_until_lifted();
            while b.enu.z < 0.8 {
                b.run(0.05);
            }
            b.stuck = lost;
            if paused {
                assert_eq!(pause(&mut b), Some(ACCEPTED));
                b.run(2.0);
            }
            if lost {
                b.no_position = true;
                b.run_until(State::PositionLost, 3.0);
                b.no_position = false;
                b.run(2.5);
                b.stuck = false;
            }
            if paused {
                assert_eq!(b.state(), State::Paused);
                let height_m = b.enu.z;
                b.run(3.0);
                assert!((b.enu.z - height_m).abs() < 0.2, "held in the climb");
                resume(&mut b);
            }
            assert_eq!(b.state(), State::Climb, "{:?}", b.texts);
            b.run_until(State::Done, 60.0);
        }
    }
}

#[test]
fn a_pause_holds_the_vehicle_on_its_pad_until_the_resume() {
    use State::*;
    for at in [Ready, Scheduled, Streaming, Engaging, Arming] {
        let mut b = bench(AutopilotKind::Px4);
        if at == Arming {
            b.refused.push(ARM);
        }
        if at != Ready {
            b.start();
            b.run_until(at, 8.0);
        }
        assert_eq!(pause(&mut b), Some(ACCEPTED), "{at:?}");
        b.refused.clear();
        if at == Ready {
            b.start();
        }
        b.run(12.0);
        assert_eq!(
            (b.state(), b.armed, b.on_ground()),
            (Scheduled, false, true),
            "{at:?}: {:?}",
            b.texts
        );
        assert_eq!(resume(&mut b), Some(ACCEPTED), "{at:?}");
        b.run_until(Done, 60.0);
    }
}

#[test]
fn a_vehicle_that_is_landed_before_it_lifts_off_ends_on_the_ground() {
    for command in [MavCmd::MAV_CMD_NAV_LAND, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH] {
        for tenths in 0..40 {
            let mut b = bench(AutopilotKind::ArduPilot);
            b.start();
            b.run_until(State::Arming, 10.0);
            b.run(tenths as f32 * 0.1);
            assert_eq!(order(&mut b, command, 0.0), Some(ACCEPTED), "{tenths}");
            b.run(25.0);
            assert!(
                b.on_ground() && !b.armed,
                "{tenths}: {:?} at {:?}, {:?}",
                b.state(),
                b.enu,
                b.texts
            );
            assert_eq!(b.state(), State::Aborted);
        }
    }
}

#[test]
fn a_disarm_is_never_answered_by_arming() {
    // Arming is undone before HEARTBEAT shows it: first with the ack received, then with it lost.
    let mut b = bench(AutopilotKind::Px4);
    b.never_arms = true;
    b.start();
    b.run(30.0);
    assert_eq!(b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count(), 1);
    assert_eq!(b.state(), State::Aborted);
    let mut b = bench(AutopilotKind::Px4);
    (b.never_arms, b.mute) = (true, true);
    b.start();
    b.run(30.0);
    assert_eq!(b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count(), 2);
    // The autopilot is silent meanwhile: arming is requested at most once more.
    let mut b = bench(AutopilotKind::Px4);
    b.start();
    b.run_until(State::Arming, 5.0);
    (b.never_arms, b.mute) = (true, true);
    let asked = b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count();
    b.run(0.2);
    b.silent = true;
    b.run(2.0);
    b.silent = false;
    b.run(5.0);
    assert!(b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count() <= asked + 1);
    // HEARTBEAT shows the vehicle armed, then disarmed.
    let mut b = bench(AutopilotKind::ArduPilot);
    b.start();
    b.run_until(State::TakeOff, 10.0);
    (b.armed, b.took_off) = (false, false);
    b.run(30.0);
    assert_eq!(b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count(), 1);
}

#[test]
fn a_denied_arming_is_requested_each_second_for_twenty_seconds() {
    let mut b = bench(AutopilotKind::Px4);
    b.refused.push(ARM);
    b.start();
    b.run_until(State::Arming, 5.0);
    b.run(40.0);
    let asked = b.commands.iter().filter(|c| c.0 == ARM && c.1 == 1.0).count();
    assert!((18..=21).contains(&asked), "{asked}");
    let said = b
        .texts
        .iter()
        .filter(|t| *t == "Autopilot refuses to arm or disarm: 400 (result 4)")
        .count();
    assert!((1..=4).contains(&said), "{said} on two links, arming and disarming: {:?}", b.texts);
    assert_eq!(b.state(), State::Aborted);
    // Arming is accepted in the end.
    let mut b = bench(AutopilotKind::Px4);
    b.refused.push(ARM);
    b.start();
    b.run_until(State::Arming, 5.0);
    b.run(12.0);
    b.refused.clear();
    b.run_until(State::Done, 60.0);
}

#[test]
fn after_the_pilot_one_point_is_held_until_the_resume() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = bench(kind);
        b.start();
        b.run_until(State::Follow, 20.0);
        b.run(2.0);
        b.mode = pilot_mode(kind);
        b.run_until(State::PilotControl, 3.0);
        b.mode = kind.setpoint_mode();
        b.run_until(State::PilotReturned, 2.0);
        let held = b.enu;
        let sent = b.setpoints.len();
        // Wind or a drifting estimate moves the vehicle.
        for _ in 0..100 {
            b.enu.y += 0.15;
            b.tick();
        }
        let worst = b.setpoints[sent + 1..].iter().map(|s| (s.1 - held).norm()).fold(0.0, f32::max);
        assert!(worst < 0.05, "{kind:?}: the setpoint moved by {worst} m");
    }
}

#[test]
fn a_battery_that_is_not_reported_holds_the_take_off_and_is_requested_again() {
    let mut b = Bench::ardupilot(config());
    b.no_battery = true;
    b.run_until(State::Ready, 6.0);
    b.start();
    b.run(20.0);
    assert_eq!(b.state(), State::Scheduled);
    let asked = b.commands.iter().filter(|c| c.0 == 511 && c.1 == 1.0).count();
    assert!(asked > 5, "{asked} requests");
    b.no_battery = false;
    b.run_until(State::Follow, 20.0);
    // While the charge is not reported, the last known one counts.
    b.battery = 2;
    b.no_battery = true;
    b.run(8.0);
    (b.no_battery, b.battery) = (false, 2);
    b.run_until(State::Land, 8.0);
}

#[test]
fn the_same_number_with_other_parameters_is_another_command_and_a_repeat_is_answered_alike() {
    use crate::link::frame::{Header, MAX_FRAME_LEN, encode};
    use mavlink::dialects::ardupilotmega::COMMAND_LONG_DATA;
    let mut b = Bench::following(config());
    let mut send = |param1: f32| {
        let data = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_PAUSE_CONTINUE,
            param1,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            ..Default::default()
        };
        let mut out = [0; MAX_FRAME_LEN];
        let len = encode(Header { system: 255, component: 190, sequence: 99 }, &data, &mut out);
        b.acks.clear();
        b.companion.handle_bytes(Link::Swarm, b.now, &out[..len]);
        b.drain();
        (b.state(), b.acks.clone())
    };
    assert_eq!(send(0.0).0, State::Paused);
    let (state, acks) = send(1.0);
    assert_eq!(
        (state, acks),
        (State::Follow, std::vec![(193, ACCEPTED, 255, 190)]),
        "the same number"
    );
    let (state, acks) = send(0.0);
    assert_eq!(
        (state, acks),
        (State::Follow, std::vec![(193, ACCEPTED, 255, 190)]),
        "repeated: done already"
    );
}

/// The ground station reports an obstacle of 0.5 m at `place`.
fn obstacle(b: &mut Bench, place: Point) {
    b.report_obstacle(&place, 0.5);
}

#[test]
fn an_obstacle_reported_while_a_detour_is_planned_is_not_avoided_by_it() {
    let mut b = Bench::started_with_neighbour(two_vehicles());
    b.run_until(State::Follow, 20.0);
    b.answer_detour = None;
    b.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
    b.run_until(State::Replanning, 10.0);
    // The obstacle lies on the detour that is returned next.
    obstacle(&mut b, Point::new(13.0, 16.0, 2.0));
    let mut inputs = PlanInputs::<4, 16>::new();
    let requested = b.companion.read_plan_inputs(PlanKind::Detour, &mut inputs);
    let Some(RequestedPlan::Detour(request)) = requested else { panic!("it is planning") };
    let mut path = planner_core::flight::Path::new();
    for point in [request.here, Point::new(13.0, 16.0, 2.0), GOAL] {
        path.push(point, 1.2).unwrap();
    }
    b.companion.handle_plan(b.now, PlanKind::Detour, Ok(&VehiclePlan { path, ..plan() }));
    b.drain();
    b.run(1.0);
    assert_eq!(b.state(), State::Blocked, "{:?}", b.texts);
    assert_eq!(b.companion.read_plan_inputs(PlanKind::Detour, &mut inputs), None);
    b.neighbour = Some((Point::new(8.0, 20.0, 0.0), GROUNDED | ON_PLAN, 0.0, 5));
}
