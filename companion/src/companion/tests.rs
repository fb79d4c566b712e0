//! Whole missions on a scripted PX4: the regular flight, and what may go wrong.

extern crate std;

/// Declares the enum of events of a random test, and the list of all of them.
macro_rules! happens {
    ($($name:ident),* $(,)?) => {
        /// An event in a random test.
        #[derive(Clone, Copy, Debug)]
        enum Happens {
            $($name),*
        }

        const ALL: &[Happens] = &[$(Happens::$name),*];
    };
}

mod ardupilot;
mod area_reports;
mod divisions;
mod echoes;
mod estimate;
mod holds;
mod hostile;
mod interruptions;
mod paces;
mod promises;
mod roster_lies;
mod scenes;
mod setpoint_place;
mod unheard;

use std::vec::Vec;

use mavlink::dialects::ardupilotmega::MavCmd;
use planner_core::track::deconflict::Method;

use super::*;
use crate::autopilot::px4;
use crate::testing::fake_autopilot::*;
use planner_core::Point;
use planner_core::flight::{HeadingMode, PicturePlan, Task, Trigger, WaypointRange};

/// Checks that no two setpoints of the flight are more than 100 ms apart.
pub(super) fn assert_no_gap(bench: &Bench) {
    for pair in bench.setpoints.windows(2) {
        assert!(pair[1].0 - pair[0].0 <= Duration::from_millis(100), "{pair:?}");
    }
}

/// The states that the mission has entered so far, in order.
fn states(bench: &Bench) -> Vec<State> {
    let to = |e: &Event| match e {
        Event::StateChanged { to, .. } => Some(*to),
        Event::PlanRequested(_)
        | Event::RestartRequested
        | Event::WaitsForUnstartedVehicle { .. }
        | Event::DetourSkippedWaypoints { .. } => None,
    };
    bench.events.iter().filter_map(to).collect()
}

#[test]
fn flies_the_mission_and_lands_at_the_goal() {
    let mut bench = Bench::new(config());
    bench.run_until(State::Ready, 6.0);
    bench.run(15.0);
    assert!(!bench.armed && bench.setpoints.is_empty(), "nothing before MISSION_START");
    bench.start();
    assert_eq!(bench.acks.pop(), Some((300, 0, 255, 190)));
    bench.run_until(State::Done, 60.0);
    use State::*;
    let flown =
        [Scheduled, Streaming, Engaging, Arming, TakeOff, Climb, Follow, Land, Disarm, Done];
    assert!(states(&bench).ends_with(&flown), "{:?}", states(&bench));
    assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2, "{:?}", bench.enu);
    assert!(!bench.armed);
    assert_no_gap(&bench);
    // Command 176, DO_SET_MODE, requests Offboard.
    let engaged = bench.commands.iter().position(|c| c.0 == 176).unwrap();
    assert_eq!(bench.commands[engaged], (176, 1.0, 6.0, 0.0));
    // The setpoints stay within a tube around the path, though the EKF origin is 300 m away.
    for (_, at, mask) in &bench.setpoints {
        assert_eq!(*mask, px4::MASK_POSITION_VELOCITY_ACCELERATION);
        assert!((at.y - 12.0).abs() < 0.02 && at.x > 7.98 && at.x < 16.02 && at.z < 3.52, "{at:?}");
    }
}

/// Every setpoint with a position has the heading of the task; without one the yaw is ignored.
#[test]
fn looks_where_its_task_says() {
    for look in [None, Some(0.7f32), Some(-2.5)] {
        let mut bench = Bench::new(config());
        if let Some(heading) = look {
            let mut photographs =
                PicturePlan::new(2.0, HeadingMode::FixedEnuRad(heading), Trigger::None);
            photographs.add_stretch(1, 2, WaypointRange { first: 0, end: 2 }).unwrap();
            bench.answer_plan =
                Some(Ok(Plan { task: Task::Photograph(photographs), ..field_plan() }));
        }
        bench.run_until(State::Ready, 6.0);
        bench.start();
        bench.run_until(State::Done, 90.0);
        assert!(bench.headings.len() > 200 && bench.headings.len() == bench.setpoints.len());
        for ((at, _, mask), heading) in bench.setpoints.iter().zip(&bench.headings) {
            let wanted = look.filter(|_| *mask != px4::MASK_VELOCITY);
            let near = |(a, b): (f32, f32)| (a - b).abs() < 1e-3;
            assert!(
                *heading == wanted || heading.zip(wanted).is_some_and(near),
                "{heading:?} at {at:?}"
            );
        }
    }
}

/// Algorithm 2 of paper P3D, lines 18 to 25: the vehicle flies waypoint after waypoint, then lands
/// where it is, without a guided descent.
#[test]
fn algorithm2_lands_where_it_reaches_its_last_waypoint() {
    let mut slow = config();
    slow.method = Method::Algorithm2;
    let mut bench = Bench::new(slow);
    bench.run_until(State::Ready, 6.0);
    bench.start();
    bench.run_until(State::Land, 60.0);
    let left = (bench.enu - GOAL).norm();
    assert!(left < 0.4, "{:?} {left}", bench.enu);
    for (_, at, _) in &bench.setpoints {
        assert!((at.y - 12.0).abs() < 0.02 && at.x > 7.98 && at.x < 16.02 && at.z < 3.52, "{at:?}");
    }
    // Up to the landing no setpoint leads down, and none leaves the corner before the vehicle has
    // reached it.
    let heights: Vec<f32> = bench.setpoints.iter().map(|(_, at, _)| at.z).collect();
    assert!(heights.windows(2).all(|pair| pair[1] > pair[0] - 1e-3), "{heights:?}");
    let (_, last, _) = bench.setpoints.last().unwrap();
    assert!((last - GOAL).norm() < 0.4, "{last:?}");
    bench.run_until(State::Done, 60.0);
    assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.5, "{:?}", bench.enu);
    assert_no_gap(&bench);
}

#[test]
fn a_pilot_is_never_fought() {
    let mut bench = Bench::following(config());
    bench.mode = 0x0003_0000;
    bench.run_until(State::PilotControl, 3.0);
    let asked = bench.commands.len();
    bench.enu += Point::new(0.0, 0.3, 0.0);
    bench.run(3.0);
    let (_, at, _) = *bench.setpoints.last().unwrap();
    assert!((at - bench.enu).norm() < 0.01, "only the current position goes out");
    assert_eq!(bench.commands.len(), asked, "and no command");
    // Offboard alone does not resume the mission: the resume command is needed too.
    bench.mode = px4::OFFBOARD;
    bench.run(3.0);
    assert_eq!(bench.state(), State::PilotReturned);
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.state(), State::Follow);
    bench.run_until(State::Done, 60.0);
    assert_no_gap(&bench);
}

#[test]
fn far_from_the_path_it_lands_instead_of_cutting_through_walls() {
    let mut bench = Bench::following(config());
    bench.mode = 0x0003_0000;
    bench.run_until(State::PilotControl, 3.0);
    for _ in 0..20 {
        bench.enu += Point::new(0.0, 0.1, 0.0);
        bench.run(0.1);
    }
    bench.mode = px4::OFFBOARD;
    bench.run(2.0);
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.state(), State::Land);
    bench.run_until(State::Aborted, 30.0);
}

#[test]
fn a_jump_of_five_metres_is_not_flown_after() {
    for jump in [Point::new(0.0, 5.0, 0.0), Point::new(5.0, 0.0, 0.0), Point::new(-5.0, 0.0, 0.0)] {
        let mut bench = Bench::following(config());
        bench.enu += jump;
        let jumped_at = bench.now;
        bench.run_until(State::PositionLost, 0.2);
        bench.run_until(State::Land, 2.0);
        let lasted = bench.now - jumped_at;
        assert!(
            lasted >= crate::autopilot::telemetry::POSITION_SETTLE_TIME
                && lasted < Duration::from_millis(1300),
            "{lasted:?}"
        );
        // The first setpoint after the jump may be made before the new position is received.
        let mut stops = 0;
        for (at, place, mask) in &bench.setpoints {
            if *at > jumped_at + Duration::from_millis(60) {
                let stop = *mask == px4::MASK_VELOCITY;
                assert!(
                    stop || (place - bench.enu).norm() < 0.15,
                    "{place} sent at {:?}",
                    bench.enu
                );
                stops += u32::from(stop);
            }
        }
        assert!(stops >= 18, "{stops}");
        bench.run_until(State::Aborted, 30.0);
        assert_no_gap(&bench);
    }
}

#[test]
fn a_failsafe_gets_no_setpoints() {
    let mut bench = Bench::following(config());
    (bench.mode, bench.status) = (px4::RTL, 5);
    bench.run_until(State::Failsafe, 3.0);
    let sent = bench.setpoints.len();
    bench.run(5.0);
    assert_eq!(bench.setpoints.len(), sent);
    (bench.armed, bench.enu.z) = (false, 0.0);
    bench.run_until(State::Aborted, 3.0);
    bench.run(5.0);
    assert_eq!(bench.setpoints.len(), sent);
}

#[test]
fn pause_brakes_on_the_path_and_resume_goes_on() {
    let mut bench = Bench::following(config());
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0, 0, 0);
    assert_eq!(bench.state(), State::Paused);
    assert!(bench.acks.iter().all(|a| a.0 != 193), "a broadcast is not answered");
    bench.run(4.0);
    let stood = bench.enu;
    bench.run(4.0);
    assert!((bench.enu - stood).norm() < 0.01 && stood.x < 15.0);
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, 0);
    bench.run_until(State::Done, 60.0);
    assert_no_gap(&bench);
}

#[test]
fn land_and_return_are_obeyed() {
    let mut bench = Bench::following(config());
    bench.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
    bench.run_until(State::Aborted, 30.0);
    assert!(bench.enu.x > 8.5 && bench.enu.x < 15.0);
    assert_no_gap(&bench);
    let mut bench = Bench::following(config());
    bench.run(2.0);
    bench.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
    bench.run_until(State::Aborted, 60.0);
    assert!((bench.enu - Point::new(START.x, START.y, 0.0)).norm() < 0.3, "{:?}", bench.enu);
    assert_no_gap(&bench);
}

#[test]
fn unknown_commands_are_refused_and_foreign_ones_left_alone() {
    let mut bench = Bench::new(config());
    bench.run_until(State::Ready, 6.0);
    bench.command(MavCmd::MAV_CMD_DO_SET_HOME, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.acks.pop(), Some((179, 3, 255, 190)));
    for (system, component) in
        [(SYSTEM, 0), (SYSTEM, 1), (0, 0), (SYSTEM + 1, crate::COMPANION_COMPONENT)]
    {
        bench.command(MavCmd::MAV_CMD_DO_SET_HOME, 0.0, system, component);
    }
    bench.command(MavCmd::MAV_CMD_MISSION_START, 0.0, SYSTEM, 1);
    bench.command(MavCmd::MAV_CMD_MISSION_START, 0.0, SYSTEM + 1, crate::COMPANION_COMPONENT);
    assert_eq!((bench.acks.len(), bench.state()), (0, State::Ready));
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.acks.pop(), Some((193, 1, 255, 190)), "not now");
    bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 7.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.acks.pop(), Some((193, 2, 255, 190)));
    bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, 148.0, SYSTEM, crate::COMPANION_COMPONENT);
    assert_eq!(bench.acks.pop(), Some((512, 0, 255, 190)));
    assert!(bench.swarm.iter().any(|f| f.message_id == 148));
}

#[test]
fn the_heartbeat_is_believed_and_no_ack() {
    use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavResult};
    let mut bench = Bench::new(config());
    bench.run_until(State::Ready, 6.0);
    bench.refused.push(176);
    bench.start();
    bench.run_until(State::Engaging, 6.0);
    // PX4 first acknowledges DO_SET_MODE as accepted, whether or not the mode changes.
    let ack = |result| COMMAND_ACK_DATA { command: MavCmd::MAV_CMD_DO_SET_MODE, result };
    bench.send(&ack(MavResult::MAV_RESULT_ACCEPTED));
    bench.run(2.0);
    assert_eq!(bench.state(), State::Engaging);
    assert!(bench.commands.iter().filter(|c| c.0 == 176).count() >= 2, "asked again");
    bench.refused.clear();
    bench.send(&ack(MavResult::MAV_RESULT_TEMPORARILY_REJECTED));
    bench.run_until(State::Follow, 20.0);
}

#[test]
fn an_unsound_plan_is_refused() {
    let mut elsewhere = plan();
    elsewhere.path = planner_core::flight::Path::new();
    elsewhere.path.push(Point::new(1.0, 1.0, 1.5), 1.0).unwrap();
    for answer in [Ok(elsewhere), Err(PlanFailure::Unreachable)] {
        let mut bench = Bench::new(config());
        bench.answer_plan = Some(answer);
        bench.run_until(State::Aborted, 6.0);
        bench.answer_plan = Some(Ok(plan()));
        bench.start();
        bench.run_until(State::Ready, 6.0);
        bench.run(10.0);
        assert_eq!(bench.state(), State::Ready, "start must be commanded again");
    }
}

#[test]
fn waits_on_the_ground_for_its_gate_until_the_neighbour_has_passed() {
    let mut gated = plan();
    gated
        .gates
        .push(planner_core::flight::Gate { at_m: -1.5, wait_for_id: 77, open_from_progress_m: 6.0 })
        .unwrap();
    let mut bench = Bench::new(two_vehicles());
    bench.answer_plan = Some(Ok(gated));
    bench.run_until(State::Ready, 6.0);
    bench.start();
    bench.run(20.0);
    let flags = crate::link::intent::ON_PLAN | crate::link::intent::FLYING;
    let hear = |bench: &mut Bench, progress_m: f32, crc: u32| {
        bench.neighbour = Some((Point::new(8.0, 60.0, 10.0), flags, progress_m, crc));
        bench.run(1.0);
    };
    for (progress_m, crc) in [(1.0, 5), (5.9, 5), (6.5, 6)] {
        hear(&mut bench, progress_m, crc);
        assert_eq!(
            (bench.state(), bench.armed),
            (State::Scheduled, false),
            "{progress_m} on plan {crc}"
        );
    }
    assert_eq!(bench.companion.waiting_for(), 77);
    hear(&mut bench, 6.5, 5);
    bench.run_until(State::Follow, 20.0);
}

#[test]
fn a_vehicle_that_never_starts_is_named_while_others_wait_for_it() {
    let named = |bench: &Bench| {
        bench.texts.iter().filter(|text| text.contains("it has not started")).count()
    };
    // Vehicle 77 is never heard; is heard on its pad; is heard in flight.
    let grounded = crate::link::intent::ON_PLAN | crate::link::intent::GROUNDED;
    let flying = crate::link::intent::ON_PLAN | crate::link::intent::FLYING;
    for (flags, expected) in [(None, 2..5), (Some(grounded), 2..5), (Some(flying), 0..1)] {
        let mut gated = plan();
        gated
            .gates
            .push(planner_core::flight::Gate {
                at_m: -1.5,
                wait_for_id: 77,
                open_from_progress_m: 6.0,
            })
            .unwrap();
        let mut bench = Bench::new(two_vehicles());
        bench.answer_plan = Some(Ok(gated));
        bench.run_until(State::Ready, 6.0);
        bench.start();
        for _ in 0..65 {
            bench.neighbour = flags.map(|flags| (Point::new(8.0, 60.0, 10.0), flags, 0.0, 5));
            bench.run(1.0);
        }
        // Each text is sent on both links.
        assert!(expected.contains(&named(&bench)), "{flags:?}: {:?}", bench.texts);
        let reported = bench.events.contains(&Event::WaitsForUnstartedVehicle { id: 77 });
        assert_eq!(reported, flags != Some(flying), "{:?}", bench.events);
    }
}
