//! A coverage mission is started where some of the area is photographed already.

use planner_core::flight::WaypointRange;

use super::State::*;
use super::losses::{over_a_field, report_status, tunnels};
use super::*;
use crate::link::photographed::{self, PhotographedReport};
use crate::link::roster::ShareStatus;

/// The other vehicle reports from the ground what it knows to be photographed.
fn knows(b: &mut Bench, first: u32, round: u8) {
    reports(b, &PhotographedReport { round, ..report(first) });
}

/// A report of vehicle 77 that the ten waypoints from `first` on are photographed.
fn report(first: u32) -> PhotographedReport {
    let ranges = [WaypointRange { first, end: first + 10 }].into_iter().collect();
    PhotographedReport {
        system_id: 77,
        mission_crc: 0xC0FFEE,
        ranges,
        ..PhotographedReport::default()
    }
}

/// Vehicle 77 sends this report.
fn reports(b: &mut Bench, report: &PhotographedReport) {
    let mut payload = [0; photographed::MAX_LEN];
    let len = report.encode(&mut payload);
    tunnels(b, &payload[..len]);
}

pub(super) fn others_know_of_more(scenes: &mut Scenes) {
    for state in [Ready, Scheduled] {
        let reported = |b: &mut Bench| {
            knows(b, 20, 0);
            b.run(1.0);
            assert_eq!(b.companion.excluded_waypoints(), [WaypointRange { first: 20, end: 30 }]);
        };
        let end = if state == Ready { Ready } else { Follow };
        scenes.play(over_a_field(state), reported, end, 20.0);
    }
}

pub(super) fn another_plan_is_flown(scenes: &mut Scenes) {
    let another = |b: &mut Bench| {
        let flown = b.neighbour;
        b.neighbour = flown.map(|(place, flags, along_m, crc)| (place, flags, along_m, !crc));
        b.run(12.0);
        assert_eq!(b.companion.state(), Scheduled);
        b.neighbour = flown;
    };
    scenes.play(over_a_field(Scheduled), another, Follow, 30.0);
}

/// A vehicle that starts late leaves out the same waypoints as those in flight, whatever others on
/// the ground report.
#[test]
fn a_vehicle_that_comes_late_takes_the_set_of_those_that_fly() {
    let mut bench = over_a_field(Ready);
    knows(&mut bench, 40, 0);
    bench.run(1.0);
    reports(
        &mut bench,
        &PhotographedReport { flies: true, are_ranges_left_out_by_plan: true, ..report(20) },
    );
    bench.run(1.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 20, end: 30 }]);
    knows(&mut bench, 60, 0);
    bench.run(1.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 20, end: 30 }]);
}

/// Waypoints photographed by a vehicle in flight, or in an earlier round, change no plan on the
/// ground; a later round replaces all known waypoints.
#[test]
fn only_what_others_on_the_ground_know_changes_the_plan() {
    let mut bench = over_a_field(Ready);
    reports(&mut bench, &PhotographedReport { flies: true, ..report(20) });
    bench.run(2.0);
    assert_eq!((bench.companion.state(), bench.companion.excluded_waypoints()), (Ready, &[][..]));
    knows(&mut bench, 40, 3);
    bench.run(2.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 40, end: 50 }]);
    knows(&mut bench, 60, 2);
    bench.run(2.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 40, end: 50 }]);
    // In flight nothing changes the plan.
    bench.start();
    bench.run_until(Follow, 30.0);
    knows(&mut bench, 80, 4);
    bench.run(2.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 40, end: 50 }]);
}

/// Two vehicles that were started before they had heard each other's reports plan again, as long as
/// both stand on the ground: else each would wait for the other's plan for good.
#[test]
fn whoever_was_started_plans_again_with_another_that_waits_on_its_pad_too() {
    let mut bench = over_a_field(Scheduled);
    bench.neighbour = bench.neighbour.map(|(place, _, along_m, crc)| {
        (Point::new(place.x, place.y, 0.0), ON_PLAN | GROUNDED, along_m, !crc)
    });
    let mut roster = super::super::divisions::own_roster(&bench);
    roster.has_started = true;
    let bytes = super::super::divisions::bytes(&roster, 0);
    bench.companion.handle_bytes(crate::Link::Swarm, bench.now, &bytes);
    bench.run(1.0);
    knows(&mut bench, 20, 0);
    bench.run(1.0);
    assert_eq!(bench.companion.excluded_waypoints(), [WaypointRange { first: 20, end: 30 }]);
}

/// Reports of vehicles that have landed do not change the plan of one that was started but still
/// waits: it would fly another plan than the flight under way.
#[test]
fn whoever_was_started_keeps_its_plan_when_others_have_landed() {
    for status in [ShareStatus::Finished, ShareStatus::Left] {
        let mut bench = over_a_field(Scheduled);
        report_status(&mut bench, ShareStatus::Alive, status);
        knows(&mut bench, 20, 0);
        bench.run(1.0);
        assert_eq!(bench.companion.excluded_waypoints(), [], "{:?}", bench.texts);
        bench.run_until(Follow, 30.0);
    }
}
