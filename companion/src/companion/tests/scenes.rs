//! A scene for every row of the mission table: something happens to a vehicle in some state, and
//! another state follows.

extern crate std;
use std::string::String;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::MavCmd;

use super::super::*;
use crate::autopilot::px4;
use crate::link::intent::{FLYING, GROUNDED, LANDED, ON_PLAN, OUT_OF_PLAN};
use crate::testing::fake_autopilot::*;
use crate::{Config, RosterEntry};
use planner_core::Point;
use planner_core::flight::Task;

mod autopilot;
mod beneath;
mod detours;
mod homeward;
mod landings;
mod losses;
mod pause;
mod pilot;
mod position;
mod resume;
mod start;

/// The other vehicle: place, flags of its intent, progress, CRC of its plan.
type Neighbour = Option<(Point, u8, f32, u32)>;

/// Plays scenes, and collects the texts of the rows that they take.
#[derive(Default)]
struct Scenes {
    texts: Vec<String>,
}

impl Scenes {
    /// Runs `script`; the state `end` must be reached within `seconds` after it.
    #[track_caller]
    fn play(
        &mut self,
        mut bench: Bench,
        script: impl FnOnce(&mut Bench),
        end: State,
        seconds: f32,
    ) {
        script(&mut bench);
        bench.run_until(end, seconds);
        self.texts.append(&mut bench.texts);
    }
}

/// Every row of the table with a text is taken in some scene.
#[test]
fn every_row_has_its_scene() {
    let mut scenes = Scenes::default();
    let groups: &[fn(&mut Scenes)] = &[
        start::planned,
        start::started,
        start::scheduled,
        start::streaming,
        start::arming,
        autopilot::takes_over,
        autopilot::does_not_do_as_asked,
        autopilot::is_not_heard,
        autopilot::flies_when_the_companion_starts,
        pilot::takes_over,
        pilot::returns,
        position::is_lost,
        position::is_not_to_be_trusted,
        pause::in_flight,
        pause::on_the_ground,
        detours::others_are_not_heard,
        detours::another_lies_below_the_path,
        detours::before_take_off,
        detours::another_flies_where_it_is_to_fly,
        landings::are_commanded,
        landings::at_a_limit,
        landings::wait_for_room,
        landings::end_aside,
        losses::another_leaves,
        losses::the_others_give_it_up,
        losses::another_bars_the_start,
        losses::it_is_in_reserve,
        homeward::is_ordered,
        homeward::flies_around,
        homeward::is_blocked,
        homeward::is_in_the_way_of_another,
        homeward::waits_for_nothing,
        homeward::finds_no_way,
        homeward::meets_an_obstacle,
        resume::others_know_of_more,
        resume::another_plan_is_flown,
    ];
    for group in groups {
        group(&mut scenes);
    }
    for row in crate::mission::table::TABLE.iter().filter(|row| !row.text.is_empty()) {
        assert!(scenes.texts.iter().any(|t| t == row.text), "no scene took: {}", row.text);
    }
}

// Commands of the ground station.

fn land(b: &mut Bench) {
    b.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
}

fn back(b: &mut Bench) {
    b.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
}

fn pause(b: &mut Bench) {
    b.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
}

fn resume(b: &mut Bench) {
    b.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, crate::COMPANION_COMPONENT);
}

// Events of many scenes.

fn nothing(_: &mut Bench) {}

/// The autopilot's failsafe takes the vehicle.
fn fails_safe(b: &mut Bench) {
    (b.mode, b.status) = (px4::RTL, 5);
}

/// The pilot takes the vehicle by the mode switch.
fn pilot_takes(b: &mut Bench) {
    b.mode = px4::HOLD;
}

/// Moves the vehicle by `by` three times, too slowly to count as a jump.
fn drag(b: &mut Bench, by: Point) {
    for _ in 0..3 {
        b.enu += by;
        b.run(0.3);
    }
}

/// Keeps the vehicle from moving for `seconds`.
fn stuck(b: &mut Bench, seconds: f32) {
    b.stuck = true;
    b.run(seconds);
    b.stuck = false;
}

// Starting points of scenes.

/// A vehicle on its pad, in `Ready`, with these settings.
fn ready_with(config: Config<4>) -> Bench {
    let mut bench = Bench::new(config);
    bench.run_until(State::Ready, 6.0);
    bench
}

/// A vehicle on its pad, in `Ready`.
fn ready() -> Bench {
    ready_with(config())
}

/// A vehicle that was started and has reached this state.
fn to(state: State) -> Bench {
    let mut bench = ready();
    bench.start();
    bench.run_until(state, 30.0);
    bench
}

/// A vehicle in the middle of its path.
fn flying() -> Bench {
    Bench::following(config())
}

/// A vehicle that was commanded to land, but does not descend.
fn landing() -> Bench {
    let mut bench = flying();
    bench.never_lands = true;
    land(&mut bench);
    bench.run(2.0);
    assert_eq!(bench.state(), State::Land);
    bench
}

/// A vehicle `seconds` after it reached this state, while vehicle 77 stands on its pad.
fn accompanied(state: State, seconds: f32) -> Bench {
    accompanied_with(two_vehicles(), state, seconds)
}

/// As [`accompanied`], with these settings.
fn accompanied_with(config: Config<4>, state: State, seconds: f32) -> Bench {
    let mut bench = Bench::started_with_neighbour(config);
    bench.run_until(state, 20.0);
    bench.run(seconds);
    bench
}

/// Settings with a geofence.
fn fenced(mut config: Config<4>, low: Point, high: Point) -> Config<4> {
    config.geofence = Some((low, high));
    config
}

// Reports of the other vehicle.

/// The other vehicle is on the ground at `place`; `flags` are set in its intent, too.
fn stands(place: Point, flags: u8) -> Neighbour {
    Some((place, GROUNDED | flags, 0.0, 5))
}

/// The other vehicle is in the air at `place`; `flags` are set in its intent, too.
fn flies(place: Point, flags: u8) -> Neighbour {
    Some((place, FLYING | flags, 0.0, 5))
}

/// The other vehicle has landed at the end of its plan.
fn landed(place: Point) -> Neighbour {
    Some((place, GROUNDED | LANDED | ON_PLAN, 99.0, 5))
}

/// The other vehicle is on its own pad, 8 m beside this one's start.
fn on_pad(flags: u8) -> Neighbour {
    stands(Point::new(8.0, 20.0, 0.0), flags)
}

/// The other vehicle is on ground 1 m high, so near to this one's path that it blocks the path.
fn below_the_path(flags: u8) -> Neighbour {
    stands(Point::new(14.5, 12.5, 1.0), flags)
}
