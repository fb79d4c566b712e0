//! Checks the table against its copy in docs/table.md, and that every state can be reached and
//! left, and that all texts fit.

extern crate std;
use std::fmt::Write;
use std::string::String;
use std::vec::Vec;

use super::row::AT_ONCE;
use super::*;
use crate::autopilot::telemetry::{MAX_HEARTBEAT_AGE, MAX_POSITION_AGE};
use crate::mission::table::*;
use crate::time::Duration;
use Action as A;
use Guard as G;
use State::*;

/// The table as Markdown.
fn printed() -> String {
    let mut out = String::from(
        "| from | guard | for | to | action | STATUSTEXT |\n|---|---|---|---|---|---|\n",
    );
    for row in TABLE {
        let from: Vec<String> = row.from.iter().map(|s| std::format!("{s:?}")).collect();
        let limit = match row.limit.as_micros() {
            0 => String::new(),
            us => std::format!("{} s", us as f64 / 1e6),
        };
        let to = match row.to {
            TargetState::State(to) => std::format!("{to:?}"),
            TargetState::Interrupted => "the interrupted state".into(),
        };
        let action =
            if row.action == A::None { String::new() } else { std::format!("{:?}", row.action) };
        writeln!(
            out,
            "| {} | {:?} | {limit} | {to} | {action} | {} |",
            from.join(", "),
            row.guard,
            row.text
        )
        .unwrap();
    }
    out
}

/// Sets the inputs that an interruption changes.
type Shows = fn(&mut GuardInputs);

/// The interruptions: the name of each, and its change of the inputs.
const INTERRUPTIONS: &[(&str, Shows)] = &[
    ("pause", |i| i.pause_pending = true),
    ("resume", |i| i.resume_pending = true),
    ("land", |i| (i.land_pending, i.in_setpoint_mode) = (true, !i.mode_foreign)),
    ("return", |i| i.return_pending = true),
    ("start", |i| i.start_pending = true),
    ("pilot's mode", |i| (i.mode_foreign, i.in_setpoint_mode) = (true, false)),
    ("failsafe", |i| {
        (i.mode_foreign, i.in_setpoint_mode, i.autopilot_critical) = (true, false, true);
    }),
    ("position lost", |i| i.position_age = Duration::from_secs(3)),
    ("position jumps", |i| (i.position_age, i.position_jumped) = (MAX_POSITION_AGE, true)),
    ("autopilot silent", |i| i.heartbeat_age = Duration::from_secs(4)),
    ("disarmed", |i| (i.armed, i.airborne) = (false, false)),
    ("battery low", |i| (i.battery_low, i.room_below) = (true, true)),
    ("battery critical", |i| (i.battery_low, i.battery_critical) = (true, true)),
    ("outside the fence", |i| (i.outside_geofence, i.room_below) = (true, true)),
    ("neighbours silent", |i| i.unlinked_for = Duration::from_secs(11)),
];

/// Inputs of a state in which nothing happens.
pub(crate) fn quiet(state: State) -> GuardInputs {
    let on_ground = WAITING_ON_GROUND.contains(&state)
        || STARTED_ON_PAD.contains(&state)
        || matches!(state, Done | Aborted);
    let mut i = GuardInputs {
        armed: !on_ground,
        airborne: !on_ground,
        at_pad: true,
        ..GuardInputs::default()
    };
    (i.plan_leaves_pad, i.has_flown, i.in_own_mode) = (true, !on_ground, !on_ground);
    match state {
        WaitAutopilot => i.heartbeat_age = MAX_HEARTBEAT_AGE,
        WaitPosition => i.position_age = MAX_POSITION_AGE,
        Blocked => i.path_blocked = true,
        AutopilotSilent => i.heartbeat_age = Duration::from_secs(5),
        PositionLost => i.position_age = Duration::from_secs(2),
        Disarm => (i.airborne, i.in_land_mode) = (false, true),
        PilotControl | Failsafe => i.mode_foreign = true,
        _ => {}
    }
    assert_eq!(first_applicable_row(state, &i).map(|row| row.guard), None, "{state:?}");
    i
}

/// The text of docs/table.md: the table, and the state to which each interruption of each state
/// leads.
fn page() -> String {
    let mut out = String::from(
        "# The mission's table

Generated from `companion/src/mission/table.rs` by the test `the_page_prints_this_table`;
`FLOCKMATE_WRITE=1 cargo test -p companion the_page` writes it. From the top, the first row is taken
whose `from` holds the state and whose guard has held for the time in `for`. A text after an
interruption (`Interrupted: Climb`) names the state that is kept; \"the interrupted state\" is the
way back to it.

## Rows

",
    );
    out += &printed();
    out += "
## Interruptions

Where each state goes when one thing happens and all else is as it should be; an empty cell: it
stays. A command that leads nowhere is refused, or answered ACCEPTED where it is done already.
(back): the way out leads to the interrupted state.

| state |";
    INTERRUPTIONS.iter().for_each(|(name, _)| write!(out, " {name} |").unwrap());
    out += "\n|---|";
    INTERRUPTIONS.iter().for_each(|_| out += "---|");
    out += "\n";
    for state in State::ALL {
        write!(out, "| {state:?} |").unwrap();
        for (_, interrupt) in INTERRUPTIONS {
            let mut inputs = quiet(*state);
            interrupt(&mut inputs);
            let back = |to| {
                TABLE.iter().any(|row| row.from.contains(&to) && row.to == TargetState::Interrupted)
            };
            match first_applicable_row(*state, &inputs).map(|row| row.to) {
                None => out += " |",
                Some(TargetState::Interrupted) => out += " the interrupted state |",
                Some(TargetState::State(to))
                    if back(to) || to == PilotControl || to == AutopilotSilent =>
                {
                    write!(out, " {to:?} (back) |").unwrap();
                }
                Some(TargetState::State(to)) => write!(out, " {to:?} |").unwrap(),
            }
        }
        out += "\n";
    }
    out
}

#[test]
fn the_page_prints_this_table() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/table.md");
    if std::env::var_os("FLOCKMATE_WRITE").is_some() {
        std::fs::write(path, page()).unwrap();
    }
    let written = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        written == page(),
        "docs/table.md is older than the table: FLOCKMATE_WRITE=1 cargo test -p companion the_page"
    );
}

#[test]
fn every_state_is_reached_and_every_wait_ends() {
    for state in State::ALL {
        let reached = TABLE
            .iter()
            .any(|row| row.to == TargetState::State(*state) && !row.from.contains(state));
        assert!(reached || *state == WaitAutopilot, "{state:?} is never reached");
        let timed = |row: &&TransitionRow| row.from.contains(state) && row.limit > AT_ONCE;
        // On the ground, disarmed, a state that waits for the operator, the autopilot or a
        // neighbour needs no limit.
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

/// Inputs under which this guard is met for any limit, and as few others as possible.
fn inputs_for(guard: Guard) -> GuardInputs {
    let long = Duration::from_secs(3600);
    let mut i = GuardInputs { armed: true, in_land_mode: true, ..GuardInputs::default() };
    match guard {
        G::AutopilotHeard | G::PositionKnown => {}
        G::NoHeartbeat => i.heartbeat_age = long,
        G::NoPosition => i.position_age = long,
        G::StillNoPosition => {
            (i.position_age, i.time_in_state, i.autopilot_heard_for) = (long, long, long);
        }
        G::PositionJumped => (i.position_age, i.position_jumped) = (long, true),
        G::FoundFlying => i.airborne = true,
        G::BackOnPath => i.near_path = true,
        G::BackOffPath => {}
        G::PlanReady => i.plan_ready = true,
        G::PlanFailed => i.plan_failed = true,
        G::RoadmapBad => (i.plan_failed, i.roadmap_unusable) = (true, true),
        G::StartCommanded => {
            (i.start_pending, i.plan_leaves_pad, i.at_pad, i.armed) = (true, true, true, false);
        }
        G::StartWithoutGoal => {
            (i.start_pending, i.shares_plan_with_others, i.at_pad, i.armed) =
                (true, true, true, false);
        }
        G::StartInReserve => {
            (i.start_pending, i.in_reserve, i.shares_plan_with_others, i.at_pad, i.armed) =
                (true, true, true, true, false);
        }
        G::ReserveEnds => (i.is_coverage, i.armed) = (true, false),
        G::StartElsewhere => (i.start_pending, i.plan_leaves_pad, i.armed) = (true, true, false),
        G::StartArmed => (i.start_pending, i.plan_leaves_pad, i.at_pad) = (true, true, true),
        G::StartImprecise => {
            (i.start_pending, i.plan_leaves_pad, i.at_pad, i.armed) = (true, true, true, false);
            (i.imprecise_at_cruise, i.time_in_state) = (true, long);
        }
        G::EstimateImprecise => i.imprecise_at_crawl_for = long,
        G::OriginMoved => i.origin_moved = true,
        G::GatesOpen => i.may_take_off = true,
        G::StartBatteryLow => {
            (i.start_pending, i.plan_leaves_pad, i.at_pad, i.armed, i.battery_low) =
                (true, true, true, false, true);
        }
        G::StartOutside => {
            (i.start_pending, i.plan_leaves_pad, i.at_pad, i.armed, i.outside_geofence) =
                (true, true, true, false, true);
        }
        G::AwayFromPad => i.armed = false,
        G::BatteryLowOnPad => (i.armed, i.battery_low) = (false, true),
        G::OutsideGeofenceOnPad => (i.armed, i.outside_geofence) = (false, true),
        G::DisarmedAtGoal => (i.armed, i.reference_at_goal) = (false, true),
        G::StaysArmed => i.time_in_state = long,
        G::StaysDisarmed => (i.armed, i.time_in_state) = (false, long),
        G::StaysDisarmedStarted => {
            (i.armed, i.time_in_state, i.start_pending) = (false, long, true);
        }
        G::ArmedUnseen => i.armed_bit_overdue = true,
        G::ArmingHeld => {
            (i.arming_unrequested, i.column_blocked_for, i.time_in_state) = (true, long, long);
        }
        G::ArmingUnanswered => i.arming_unanswered = true,
        G::InAir => i.airborne = true,
        G::Unattended => (i.airborne, i.in_setpoint_mode, i.in_own_mode) = (true, true, true),
        G::LandingModeLeft => i.in_land_mode = false,
        G::PausedOnPad => (i.pause_pending, i.time_in_state) = (true, long),
        G::LandUnattended => (i.land_pending, i.airborne, i.in_setpoint_mode) = (true, true, true),
        G::ReturnInClimb => (i.return_pending, i.in_climb) = (true, true),
        G::Elapsed => i.time_in_state = long,
        G::InSetpointMode => i.in_setpoint_mode = true,
        G::ModeTaken => i.mode_foreign = true,
        G::FailsafeActs => (i.mode_foreign, i.autopilot_critical) = (true, true),
        G::ModeTakenArmed => i.mode_foreign = true,
        G::FailsafeActsArmed => (i.mode_foreign, i.autopilot_critical) = (true, true),
        G::Armed => i.armed = true,
        G::Disarmed => i.armed = false,
        G::LiftedOff => i.take_off_command_done = true,
        G::ClimbDone => i.climb_done = true,
        G::BackAtStart => (i.path_done, i.returns_to_start) = (true, true),
        G::PathDone => i.path_done = true,
        G::Unfollowed => i.unfollowed_for = long,
        G::PathBarred => (i.join_barred, i.time_in_state) = (true, long),
        G::Stalled => i.stalled_for = long,
        G::PauseCommanded => i.pause_pending = true,
        G::ResumeCommanded => i.resume_pending = true,
        G::ResumedOnPath => {
            (i.in_setpoint_mode, i.resume_pending, i.near_path) = (true, true, true);
        }
        G::ResumedOffPath => (i.in_setpoint_mode, i.resume_pending) = (true, true),
        G::LandCommanded => i.land_pending = true,
        G::ReturnCommanded => i.return_pending = true,
        G::ReturnInCoverage => (i.return_pending, i.may_seek_path_home) = (true, true),
        G::BlockedInCoverage => {
            (i.path_blocked, i.may_seek_path_home, i.path_blocked_for) = (true, true, long);
        }
        G::MayDetourInCoverage => {
            (i.path_blocked, i.may_detour_and_rejoin, i.path_blocked_for) = (true, true, long);
        }
        G::DetourFlown => i.stands_at_detour_end = true,
        G::OwnPlanReady => i.own_plan_ready = true,
        G::OwnPlanLost => i.own_plan_failed = true,
        G::YieldedInCoverage => {
            (i.yielded_for, i.hindered_for, i.may_seek_path_home) = (long, long, true);
        }
        G::HinderedInCoverage => (i.hindered_for, i.may_seek_path_home) = (long, true),
        G::StartAgain => i.start_pending = true,
        G::StartInCoverage => (i.start_pending, i.is_coverage) = (true, true),
        G::StalledInCoverage => (i.stalled_for, i.may_seek_path_home) = (long, true),
        G::StartBarred => {
            (i.start_barred_for, i.may_leave_part_to_others, i.plan_leaves_pad) =
                (long, true, true);
        }
        G::StandsToReturn => i.ready_to_request_path_home = true,
        G::WayHomeReady => (i.detour_ready, i.seeks_or_flies_path_home) = (true, true),
        G::NoWayHome => (i.seeking_home_for, i.can_turn_back) = (Some(long), true),
        G::LandingBlocked => i.column_blocked_for = long,
        G::LandingClear => i.column_clear_for = long,
        G::NoRoomToLand => {
            (i.column_blocked_for, i.in_setpoint_mode, i.can_turn_back) = (long, true, true);
        }
        G::NoRoomHere => {
            (i.column_blocked_for, i.in_setpoint_mode, i.may_seek_landing_aside) =
                (long, true, true);
        }
        G::WayBackBarred => i.way_back_barred = true,
        G::PadTaken => (i.pad_blocked_for, i.may_seek_landing_aside) = (long, true),
        G::NoPlaceAside => (i.plan_failed, i.seeks_landing_aside) = (true, true),
        G::LandingPlaceReached => i.landing_place_reached = true,
        G::ColumnBlocked => (i.column_blocked_for, i.time_in_state) = (long, long),
        G::Yielded => (i.yielded_for, i.hindered_for) = (long, long),
        G::MayFlyUnheard => i.may_fly_on_unheard = true,
        G::OutOfRange => (i.others_out_of_range, i.time_in_state) = (true, long),
        G::Hindered => i.hindered_for = long,
        G::BatteryCritical => (i.battery_low, i.battery_critical) = (true, true),
        G::BatteryLow => (i.battery_low, i.room_below) = (true, true),
        G::OutsideGeofence => (i.outside_geofence, i.room_below) = (true, true),
        G::NeighboursSilent => i.unlinked_for = long,
        G::LeaseLost => (i.is_coverage, i.unlinked_for) = (true, long),
        G::NotDivided => (i.time_in_state, i.division_overdue) = (long, true),
        G::PausedBeforeLiftOff => (i.pause_pending, i.on_ground) = (true, true),
        G::BarredBeforeLiftOff => (i.hindered_for, i.on_ground) = (long, true),
        G::NeighbourHeard => i.swarm_linked = true,
        G::OnGround => i.on_ground = true,
        G::PathBlocked => i.path_blocked = true,
        G::PathClear => {}
        G::OurTurn => i.our_turn_to_detour = true,
        G::DetourReady => i.detour_ready = true,
        G::DetourFailed => i.plan_failed = true,
        G::NoWayAround => (i.detours_given_up, i.room_below) = (true, true),
        G::NoWayOn => (i.detours_given_up, i.can_turn_back) = (true, true),
        G::BelowLandingVehicle => i.waited_below_landing_for = long,
        G::Standing => i.standing = true,
        G::Excluded => i.excluded = true,
        G::LeftOutSetChanged => i.left_out_set_changed = true,
        G::PlansDiffer => (i.plans_differ, i.time_in_state) = (true, long),
        G::HoldsToDivide => i.holds_to_divide = true,
        G::DivisionReady => i.division_plan_ready = true,
        G::NothingToDivide => i.division_settled = true,
    }
    i
}

#[test]
fn every_row_is_taken_when_only_its_guard_holds_and_not_before_its_limit() {
    for row in TABLE {
        for from in row.from {
            let mut inputs = inputs_for(row.guard);
            // Where a known position, or an autopilot that is heard, would let another row be
            // taken, the position is unknown, or the autopilot silent.
            match (from, row.guard) {
                (PositionLost, G::BackOnPath | G::BackOffPath)
                | (AutopilotSilent, G::AutopilotHeard) => {}
                (WaitPosition, G::PositionKnown) | (WaitAutopilot, G::AutopilotHeard) => {}
                (PositionLost | WaitPosition, _) => inputs.position_age = MAX_POSITION_AGE,
                (AutopilotSilent, _) => inputs.heartbeat_age = MAX_HEARTBEAT_AGE,
                (Arming | CancelStart, G::ModeTaken | G::FailsafeActs) => inputs.armed = false,
                (Arming, G::ModeTakenArmed | G::FailsafeActsArmed) => {}
                (Arming, _) => inputs.armed = false,
                (Scheduled | PadReplanning | Streaming | Engaging, guard) => {
                    inputs.armed = guard == G::Armed;
                }
                (Blocked, guard) => inputs.path_blocked = guard != G::PathClear,
                _ => {}
            }
            if row.guard == G::Armed {
                inputs.armed = true;
            }
            if row.guard == G::NoHeartbeat {
                inputs.heartbeat_age = Duration::from_secs(3600);
            }
            // The vehicle is at its pad, unless the guard says otherwise.
            inputs.at_pad |= !matches!(row.guard, G::AwayFromPad | G::StartElsewhere);
            let taken = first_applicable_row(*from, &inputs).expect("a row");
            assert!(core::ptr::eq(taken, row), "{from:?} with {:?}: {}", row.guard, taken.text);
            if row.limit > AT_ONCE {
                let quiet = GuardInputs { armed: inputs.armed, ..GuardInputs::default() };
                let before = first_applicable_row(*from, &quiet);
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
    let everything = GuardInputs {
        time_in_state: secs(9999),
        path_blocked_for: secs(9999),
        stalled_for: secs(9999),
        mode_foreign: true,
        armed: true,
        pause_pending: true,
        resume_pending: true,
        land_pending: true,
        return_pending: true,
        battery_low: true,
        outside_geofence: true,
        path_done: true,
        climb_done: true,
        position_age: secs(9999),
        ..GuardInputs::default()
    };
    for state in FLYING.iter().chain(&[Land]) {
        let to = |inputs| first_applicable_row(*state, inputs).map(|row| row.to);
        assert_eq!(to(&everything), Some(TargetState::State(PilotControl)), "{state:?}");
        let failsafe = GuardInputs { autopilot_critical: true, ..everything };
        assert_eq!(to(&failsafe), Some(TargetState::State(Failsafe)), "{state:?}");
    }
}

#[test]
fn every_text_is_explained() {
    let page = include_str!("../../../docs/companion.md");
    let served = crate::services::ftp::FTP_TEXTS.iter().map(|(_, text)| *text);
    for text in TABLE.iter().map(|row| row.text).filter(|text| !text.is_empty()).chain(served) {
        assert!(text.len() <= 50, "{text}");
        assert!(page.contains(&std::format!("\n| {text} | ")), "{text}");
    }
}

/// Texts that follow a severity in a source file: `Severity::Warning, "…"`.
fn texts_with_severity(source: &str) -> impl Iterator<Item = &str> {
    source.split("Severity::").skip(1).filter_map(|after| {
        let (name, rest) = after.split_once(',')?;
        let literal = rest.trim_start().strip_prefix('"')?;
        name.chars()
            .all(char::is_alphabetic)
            .then(|| literal.split_once('"'))?
            .map(|(text, _)| text)
    })
}

#[test]
fn every_text_outside_the_table_is_explained() {
    let page = include_str!("../../../docs/companion.md");
    let mut folders = std::vec![std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut texts = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("tests.rs") {
                let source = std::fs::read_to_string(&path).unwrap();
                for text in texts_with_severity(&source) {
                    texts += 1;
                    assert!(page.contains(&std::format!("\n| {text} | ")), "{text}");
                }
            }
        }
    }
    assert!(texts > 20, "{texts}");
}
