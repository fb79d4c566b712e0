//! In a coverage mission another vehicle leaves, or the others count this one as lost.

use super::State::*;
use super::*;
use crate::Link;
use crate::link::frame::{self, Header, MAX_FRAME_LEN};
use crate::link::roster::{self, RosterReport, RosterReportEntry, ShareStatus};
use crate::swarm::fleet::Fleet;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;

/// A coverage mission of two vehicles with the path of `field_plan`, in this state.
pub(super) fn over_a_field(state: State) -> Bench {
    over_a_field_with(field_plan(), state)
}

/// As [`over_a_field`], with this plan.
pub(super) fn over_a_field_with(plan: Plan, state: State) -> Bench {
    over_a_field_of(two_vehicles(), plan, state)
}

/// As [`over_a_field`], with these settings and this plan.
fn over_a_field_of(mut config: Config<4>, plan: Plan, state: State) -> Bench {
    config.lost_vehicle_down_after_s = Some(60.0);
    let mut bench = Bench::new(config);
    bench.answer_plan = Some(Ok(plan));
    bench.neighbour = on_pad(ON_PLAN);
    bench.run_until(Ready, 6.0);
    if state != Ready {
        bench.start();
        bench.run_until(state, 20.0);
    }
    bench
}

/// Settings with three vehicles: one alone is no majority.
fn three() -> Config<4> {
    let mut config = two_vehicles();
    let start = Point::new(8.0, 28.0, 1.5);
    config.roster.push(RosterEntry { system_id: 78, path_start: start }).unwrap();
    config
}

/// The other vehicle sends a roster report with these states of this vehicle and of itself.
pub(super) fn report_status(b: &mut Bench, own: ShareStatus, other: ShareStatus) {
    let entry = |standing| RosterReportEntry { status: standing, ..RosterReportEntry::default() };
    let entries = [entry(own), entry(other)].into_iter().collect();
    let plan = super::super::divisions::own_roster(b).plan_crc8;
    let roster = RosterReport {
        system_id: 77,
        mission_crc: 0xC0FFEE,
        plan_crc8: plan,
        entries,
        ..RosterReport::default()
    };
    let mut payload = [0; roster::MAX_LEN];
    let len = roster.encode(&mut payload);
    tunnels(b, &payload[..len]);
}

/// The other vehicle sends a TUNNEL.
pub(super) fn tunnels(b: &mut Bench, payload: &[u8]) {
    let mut out = [0; MAX_FRAME_LEN];
    let header = Header { system: 77, component: crate::COMPANION_COMPONENT, sequence: 0 };
    let n = frame::encode_raw(header, TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC, payload, &mut out);
    b.companion.handle_bytes(Link::Swarm, b.now, &out[..n]);
}

/// The other vehicle leaves the mission; runs until this one holds for the division.
pub(super) fn leaves(b: &mut Bench) {
    report_status(b, ShareStatus::Alive, ShareStatus::Left);
    b.run_until(Dividing, 30.0);
}

pub(super) fn another_leaves(scenes: &mut Scenes) {
    scenes.play(over_a_field(Follow), leaves, Done, 120.0);
    // A commitment binds until the division is committed, whatever is heard later: others may have
    // computed the division with it.
    let had_finished = |b: &mut Bench| {
        b.answer_division = false;
        leaves(b);
        report_status(b, ShareStatus::Alive, ShareStatus::Finished);
        b.run(5.0);
        assert_eq!(b.state(), Dividing);
        b.answer_division = true;
    };
    scenes.play(over_a_field(Follow), had_finished, Done, 120.0);
    let again = |b: &mut Bench| {
        b.run_until(Done, 60.0);
        b.start();
        b.run_until(Ready, 10.0);
        b.run(6.0);
        b.start();
        b.run_until(Follow, 20.0);
    };
    scenes.play(over_a_field(Follow), again, Done, 120.0);
    let undividable = |b: &mut Bench| {
        b.undividable = true;
        leaves(b);
        b.run_until(Follow, 5.0);
    };
    scenes.play(over_a_field(Follow), undividable, Done, 120.0);
    let unanswered = |b: &mut Bench| {
        b.answer_division = false;
        leaves(b);
        b.run(301.0);
    };
    scenes.play(over_a_field(Follow), unanswered, Aborted, 60.0);
}

pub(super) fn the_others_give_it_up(scenes: &mut Scenes) {
    // Of three it hears none: no majority.
    let unheard_below_its_layer = |b: &mut Bench| (b.neighbour, b.stuck) = (None, true);
    let climbs = over_a_field_of(three(), field_plan(), Climb);
    scenes.play(climbs, unheard_below_its_layer, Aborted, 60.0);
    let given_up = |b: &mut Bench| report_status(b, ShareStatus::Lost, ShareStatus::Alive);
    for state in [Climb, Follow, Scheduled, Streaming] {
        scenes.play(over_a_field(state), given_up, Aborted, 60.0);
    }
}

/// A vehicle whose start is barred for long leaves its part to the others, unless none of them
/// flies.
pub(super) fn another_bars_the_start(scenes: &mut Scenes) {
    let over_the_pad = |flags| flies(Point::new(8.0, 12.0, 3.0), flags);
    let started_below = |b: &mut Bench, flags| {
        b.neighbour = over_the_pad(flags);
        b.start();
        b.run(170.0);
        assert_eq!(b.state(), Scheduled);
    };
    scenes.play(over_a_field(Ready), |b| started_below(b, ON_PLAN), Aborted, 15.0);
    // A pause does not count.
    let paused = |b: &mut Bench| {
        started_below(b, ON_PLAN);
        pause(b);
        b.run(60.0);
        resume(b);
        b.run(170.0);
        assert_eq!(b.state(), Scheduled);
    };
    scenes.play(over_a_field(Ready), paused, Aborted, 15.0);
    let with_its_pilot = |b: &mut Bench| {
        started_below(b, OUT_OF_PLAN);
        b.run(60.0);
        assert_eq!(b.state(), Scheduled);
        b.neighbour = on_pad(ON_PLAN);
    };
    scenes.play(over_a_field(Ready), with_its_pilot, Follow, 30.0);
}

/// A vehicle without a part waits, since it may get the part of a vehicle that leaves.
pub(super) fn it_is_in_reserve(scenes: &mut Scenes) {
    let without_part = || Plan { task: Task::Stay, ..field_plan() };
    let started = |b: &mut Bench| {
        b.run(6.0);
        b.start();
        b.run_until(Scheduled, 10.0);
        b.run(200.0);
        assert_eq!(b.state(), Scheduled);
    };
    let none_is_left = |b: &mut Bench| {
        started(b);
        report_status(b, ShareStatus::Alive, ShareStatus::Finished);
    };
    scenes.play(over_a_field_with(without_part(), Ready), none_is_left, Done, 5.0);
    // Of three it hears none: no majority.
    let unheard = |b: &mut Bench| {
        b.run(6.0);
        b.start();
        b.run_until(Scheduled, 10.0);
        b.neighbour = None;
        b.run(290.0);
        assert_eq!(b.state(), Scheduled);
    };
    scenes.play(over_a_field_of(three(), without_part(), Ready), unheard, Done, 30.0);
}

/// A vehicle that reported in flight that it leaves does not count as a new one, even if its
/// autopilot reports ground.
#[test]
fn a_vehicle_that_has_left_in_flight_never_takes_part_again() {
    for false_ground in [false, true] {
        let mut b = over_a_field(Follow);
        pilot_takes(&mut b);
        b.run(25.0);
        b.false_ground = false_ground;
        b.run(1.0);
        b.mode = px4::OFFBOARD;
        b.run(2.0);
        resume(&mut b);
        b.run(1.0);
        let own = super::super::divisions::own_roster(&b).entries[0].status;
        assert_eq!(own, ShareStatus::Left, "{false_ground}: {:?} {:?}", b.state(), b.texts);
    }
}

/// A vehicle that the others count as lost since an earlier flight takes part in a new one.
#[test]
fn a_vehicle_that_was_restarted_comes_back_as_a_new_one() {
    let mut bench = over_a_field(Ready);
    report_status(&mut bench, ShareStatus::Lost, ShareStatus::Alive);
    bench.run(1.0);
    bench.start();
    bench.run_until(Follow, 30.0);
    bench.run_until(Done, 120.0);
}

/// The other vehicle leaves while this one is in reserve. The committed division may give this one
/// a part, so it waits for its plan of that division.
#[test]
fn a_vehicle_in_reserve_waits_for_its_plan_of_a_division_that_counts() {
    let without_part = Plan { task: Task::Stay, ..field_plan() };
    let mut b = over_a_field_with(without_part, Ready);
    b.run(6.0);
    b.start();
    b.run_until(Scheduled, 10.0);
    report_status(&mut b, ShareStatus::Alive, ShareStatus::Left);
    for _ in 0..400 {
        // Once the division is computed the shell no longer answers.
        if b.answer_division {
            b.tick();
            b.answer_division = super::super::divisions::own_roster(&b).pending_hash == 0;
        }
    }
    b.run(3.0);
    let counted = b.companion.neighbours.fleet().map(Fleet::division_count);
    assert_eq!((b.state(), counted), (Scheduled, Some(1)), "{:?}", b.texts);
    b.answer_division = true;
    b.run_until(Done, 60.0);
}
