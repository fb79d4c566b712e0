//! The table against its copy in the README, and against itself: every state reachable, left again, and texts that fit.

extern crate std;
use std::fmt::Write;
use std::string::String;
use std::vec::Vec;

use super::*;
use crate::table::*;
use Action as A;
use Guard as G;
use State::*;

const ALL: &[State] = &[
    WaitAutopilot,
    WaitPosition,
    Planning,
    Ready,
    Scheduled,
    Streaming,
    Engaging,
    Arming,
    TakeOff,
    Climb,
    Follow,
    Paused,
    Alone,
    AutopilotSilent,
    PositionLost,
    Land,
    Disarm,
    PilotControl,
    Failsafe,
    Done,
    Aborted,
    Blocked,
    Replanning,
    PadReplanning,
    Stopping,
];

/// The table as Markdown.
fn printed() -> String {
    let mut out =
        String::from("| from | guard | for | to | action | STATUSTEXT |\n|---|---|---|---|---|---|\n");
    for row in TABLE {
        let from: Vec<String> = row.from.iter().map(|s| std::format!("{s:?}")).collect();
        let limit = match row.limit.micros() {
            0 => String::new(),
            us => std::format!("{} s", us / 1_000_000),
        };
        let action = if row.action == A::None { String::new() } else { std::format!("{:?}", row.action) };
        writeln!(
            out,
            "| {} | {:?} | {limit} | {:?} | {action} | {} |",
            from.join(", "),
            row.guard,
            row.to,
            row.text
        )
        .unwrap();
    }
    out
}

#[test]
fn the_readme_prints_this_table() {
    let readme = include_str!("../README.md");
    assert!(readme.contains(&printed()), "README.md, \"The mission\", should read:\n{}", printed());
}

#[test]
fn every_state_is_reached_and_every_wait_ends() {
    for state in ALL {
        let reached = TABLE.iter().any(|row| row.to == *state && !row.from.contains(state));
        assert!(reached || *state == WaitAutopilot, "{state:?} is never reached");
        let timed = |row: &&Row| row.from.contains(state) && row.limit > NOW;
        // On the ground, disarmed, waiting for a person, an autopilot or a neighbour may last.
        let patient = [WaitAutopilot, WaitPosition, Ready, Scheduled, Done, Aborted];
        assert!(
            TABLE.iter().any(|row| timed(&row)) || patient.contains(state),
            "{state:?} has no time limit"
        );
    }
    for row in TABLE {
        assert!(row.text.len() <= 50 && row.text.is_ascii(), "{}", row.text);
    }
}

/// Inputs under which a guard holds for ever, everything else quiet.
fn inputs_for(guard: Guard) -> Inputs {
    let long = Duration::from_secs(3600);
    let mut i = Inputs { armed: true, ..Inputs::default() };
    match guard {
        G::AutopilotHeard | G::PositionKnown => {}
        G::NoHeartbeat => i.heartbeat_age = long,
        G::NoPosition => i.position_age = long,
        G::PositionJumped => (i.position_age, i.jumped) = (long, true),
        G::FoundFlying => i.airborne = true,
        G::BackOnPath => i.near_path = true,
        G::BackOffPath => {}
        G::PlanReady => i.plan_ready = true,
        G::PlanFailed => i.plan_failed = true,
        G::RoadmapBad => (i.plan_failed, i.roadmap_bad) = (true, true),
        G::StartCommanded => (i.start, i.has_goal, i.at_start, i.armed) = (true, true, true, false),
        G::StartWithoutGoal => (i.start, i.at_start, i.armed) = (true, true, false),
        G::StartElsewhere => (i.start, i.has_goal, i.armed) = (true, true, false),
        G::StartArmed => (i.start, i.has_goal, i.at_start) = (true, true, true),
        G::GatesOpen => i.gates_open = true,
        G::Elapsed => i.in_state = long,
        G::Offboard => i.offboard = true,
        G::ModeTaken => i.mode_foreign = true,
        G::FailsafeActs => (i.mode_foreign, i.critical) = (true, true),
        G::Armed => i.armed = true,
        G::Disarmed => i.armed = false,
        G::LiftedOff => i.lifted_off = true,
        G::ClimbDone => i.climb_done = true,
        G::PathDone => i.path_done = true,
        G::Stalled => i.stalled = long,
        G::PauseCommanded => i.pause = true,
        G::ResumeCommanded => i.resume = true,
        G::ResumedOnPath => (i.offboard, i.resume, i.near_path) = (true, true, true),
        G::ResumedOffPath => (i.offboard, i.resume) = (true, true),
        G::LandCommanded => i.land = true,
        G::ReturnCommanded => i.turn_back = true,
        G::BatteryCritical => (i.battery_low, i.battery_critical) = (true, true),
        G::BatteryLow => (i.battery_low, i.room_below) = (true, true),
        G::OutsideGeofence => (i.outside, i.room_below) = (true, true),
        G::NeighboursSilent => i.neighbour_age = long,
        G::NeighbourHeard => i.neighbour_heard = true,
        G::OnGround => i.on_ground = true,
        G::PathBlocked => i.blocked = true,
        G::PathClear => {}
        G::OurTurn => i.our_turn = true,
        G::DetourReady => i.detour_ready = true,
        G::DetourFailed => i.plan_failed = true,
        G::NoWayAround => (i.detours_failed, i.room_below) = (9, true),
        G::Underneath => i.underneath = long,
        G::Standing => i.standing = true,
    }
    i
}

#[test]
fn every_row_is_taken_when_only_its_guard_holds_and_not_before_its_limit() {
    for row in TABLE {
        for from in row.from {
            let mut inputs = inputs_for(row.guard);
            // Where a position or an autopilot heard already moves on, they are not known yet.
            match (from, row.guard) {
                (PositionLost, G::BackOnPath | G::BackOffPath) | (AutopilotSilent, G::AutopilotHeard) => {}
                (WaitPosition, G::PositionKnown) | (WaitAutopilot, G::AutopilotHeard) => {}
                (PositionLost | WaitPosition, _) => inputs.position_age = FRESH,
                (AutopilotSilent, _) => inputs.heartbeat_age = HEARD,
                (Arming, _) => inputs.armed = false,
                (Blocked, guard) => inputs.blocked = guard != G::PathClear,
                _ => {}
            }
            if row.guard == G::Armed {
                inputs.armed = true;
            }
            if row.guard == G::NoHeartbeat {
                inputs.heartbeat_age = Duration::from_secs(3600);
            }
            let taken = update(*from, &inputs).expect("a row");
            assert!(core::ptr::eq(taken, row), "{from:?} with {:?}: {}", row.guard, taken.text);
            if row.limit > NOW {
                let quiet = Inputs { armed: inputs.armed, ..Inputs::default() };
                let before = update(*from, &quiet);
                assert!(
                    before.is_none_or(|r| !core::ptr::eq(r, row)),
                    "{from:?} {:?} ignores its limit",
                    row.guard
                );
            }
        }
    }
}

#[test]
fn the_pilot_outranks_everything_in_the_air() {
    let everything = Inputs {
        in_state: s(9999),
        stalled: s(9999),
        mode_foreign: true,
        armed: true,
        pause: true,
        resume: true,
        land: true,
        turn_back: true,
        battery_low: true,
        outside: true,
        path_done: true,
        climb_done: true,
        position_age: s(9999),
        ..Inputs::default()
    };
    for state in FLYING.iter().chain(&[Land]) {
        assert_eq!(update(*state, &everything).map(|row| row.to), Some(PilotControl), "{state:?}");
        let failsafe = Inputs { critical: true, ..everything };
        assert_eq!(update(*state, &failsafe).map(|row| row.to), Some(Failsafe), "{state:?}");
    }
}

#[test]
fn every_text_is_explained() {
    let page = include_str!("../../docs/companion.md");
    let served = crate::ftp::TEXTS.iter().map(|(_, text)| *text);
    for text in TABLE.iter().map(|row| row.text).filter(|text| !text.is_empty()).chain(served) {
        assert!(text.len() <= 50, "{text}");
        assert!(page.contains(&std::format!("\n| {text} | ")), "{text}");
    }
}
