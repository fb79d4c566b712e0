//! What a vehicle of a coverage mission sends beside its state, and how often: roster reports and
//! the number of photographed waypoints.

extern crate std;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    MavParamType, NAMED_VALUE_FLOAT_DATA, PARAM_SET_DATA, TUNNEL_DATA,
};

use super::State::*;
use super::divisions::{FAR_AWAY, bytes, over_a_field_with, own_roster};
use super::*;
use crate::Link;
use crate::link::frame::{self, Frame, Header};
use crate::link::roster::{self, RosterReport, ShareStatus};

/// Seconds over which messages are counted.
const COUNTED_S: usize = 20;

/// Lengths of the frames of roster reports that the vehicle sends in [`COUNTED_S`], and the last
/// report.
fn counted_rosters(b: &mut Bench, state: State) -> (Vec<usize>, RosterReport) {
    b.swarm.clear();
    for _ in 0..COUNTED_S {
        b.run(1.0);
        assert_eq!(b.state(), state, "{:?}", b.texts);
    }
    let mut last = None;
    let mut length = |frame: &Frame| {
        let mut padded = [0; 255];
        padded[..frame.payload().len()].copy_from_slice(frame.payload());
        let of_roster = frame.message_id == TUNNEL_DATA::ID
            && padded[..2] == roster::PAYLOAD_TYPE.to_le_bytes();
        of_roster.then(|| {
            last = RosterReport::decode(&padded, SYSTEM);
            // TUNNEL's own five bytes, and the frame's twelve.
            usize::from(padded[4]) + 5 + 12
        })
    };
    let lengths = b.swarm.iter().filter_map(&mut length).collect();
    (lengths, last.expect("it is valid"))
}

/// The rate of position and intent, `swarm_hz`, makes no difference.
#[test]
fn rosters_go_out_twice_a_second_in_flight_and_five_times_while_dividing() {
    for swarm_hz in [2, 3, 5, 10] {
        let mut b = over_a_field_with(AutopilotKind::Px4, |config| config.swarm_hz = swarm_hz);
        b.start();
        b.run_until(Follow, 30.0);
        b.stuck = true;
        let (flying, report) = counted_rosters(&mut b, Follow);
        assert!(flying.len().abs_diff(2 * COUNTED_S) <= 1, "{} at {swarm_hz} Hz", flying.len());
        assert_eq!(report.entries.len(), 3);
        b.stuck = false;
        let mut leaves = own_roster(&b);
        leaves.entries[2].status = ShareStatus::Left;
        b.companion.handle_bytes(Link::Swarm, b.now, &bytes(&leaves, 0));
        b.run_until(Dividing, 40.0);
        let (dividing, report) = counted_rosters(&mut b, Dividing);
        assert!(dividing.len().abs_diff(5 * COUNTED_S) <= 1, "{} at {swarm_hz} Hz", dividing.len());
        assert_eq!(report.entries[2].status, ShareStatus::Left);
        // Length of a roster report of three vehicles by the table of docs/coverage-losses.md.
        assert!(flying.iter().chain(&dividing).all(|length| *length == 50), "{dividing:?}");
    }
}

/// A bench in `Ready`, whose plan has four pictures, 2, 4, 6 and 8 m along the path.
fn over_four_pictures() -> Bench {
    let mut photographs = PicturePlan::new(2.0, HeadingMode::Ahead, Trigger::None);
    photographs.add_stretch(1, 3, WaypointRange { first: 0, end: 4 }).unwrap();
    let mut config = two_vehicles();
    config.lost_vehicle_down_after_s = Some(60.0);
    let mut b = Bench::new(config);
    b.answer_plan = Some(Ok(Plan { task: Task::Photograph(photographs), ..field_plan() }));
    b.neighbour = FAR_AWAY;
    b.run_until(Ready, 6.0);
    b
}

/// Values of FLK_DONE that the vehicle sends in the next second.
fn done_count(b: &mut Bench) -> Vec<f32> {
    b.swarm.clear();
    b.run(1.0);
    let of_count = |frame: &&Frame| {
        frame.message_id == NAMED_VALUE_FLOAT_DATA::ID && frame.payload()[8..16] == *b"FLK_DONE"
    };
    let value =
        |frame: &Frame| f32::from_le_bytes(frame.payload()[4..8].try_into().expect("four bytes"));
    b.swarm.iter().filter(of_count).map(value).collect()
}

/// A waypoint counts once the vehicle is one picture spacing past it; none counts before the start.
#[test]
fn the_number_of_photographed_waypoints_is_sent_each_second() {
    let mut b = over_four_pictures();
    (0..3).for_each(|_| assert_eq!(done_count(&mut b), [0.0]));
    b.start();
    let mut values = Vec::new();
    while b.state() != Done && values.len() < 90 {
        let before_m = b.companion.guidance.reference_along_m();
        let sent = done_count(&mut b);
        assert_eq!(sent.len(), 1, "{:?} {:?}", b.state(), b.texts);
        let after_m = b.companion.guidance.reference_along_m();
        let past = |along_m: f32| ((along_m - 2.0) / 2.0).floor().clamp(0.0, 4.0);
        if b.state() == Follow {
            assert!((past(before_m)..=past(after_m)).contains(&sent[0]), "{sent:?} at {after_m}");
        }
        values.extend(sent);
    }
    assert_eq!(values.last(), Some(&4.0), "{values:?}");
}

/// Sets a parameter as a ground station does.
fn set_parameter(b: &mut Bench, name: &str, value: f32) {
    let message = PARAM_SET_DATA {
        param_value: value,
        target_system: SYSTEM,
        target_component: crate::COMPANION_COMPONENT,
        param_id: name.into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    };
    let mut out = [0; frame::MAX_FRAME_LEN];
    let header = Header { system: 255, component: 190, sequence: 0 };
    let length = frame::encode(header, &message, &mut out);
    b.companion.handle_bytes(Link::Swarm, b.now, &out[..length]);
    b.run(1.0);
}

/// A flight ends early; checks what the next start leaves out.
#[test]
fn a_new_start_leaves_out_what_is_done_unless_flk_resume_is_0() {
    for resume in [1.0, 0.0] {
        let mut b = over_four_pictures();
        b.start();
        b.run_until(Follow, 30.0);
        let flown_m = |b: &Bench| {
            b.companion.guidance.reported_progress_m(b.state(), &b.companion.guidance_inputs())
        };
        while flown_m(&b) < 5.5 {
            b.tick();
        }
        b.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
        b.run_until(Aborted, 30.0);
        // While it brakes to land the vehicle passes the place of the next picture, and takes none
        // there.
        assert!(flown_m(&b) > 6.1, "{}", flown_m(&b));
        let known = done_count(&mut b);
        assert_eq!(known, [1.0]);
        set_parameter(&mut b, "FLK_RESUME", resume);
        // The vehicle is carried back to its pad.
        b.enu = Point::new(START.x, START.y, 0.0);
        b.start();
        b.run_until(Ready, 10.0);
        let (left_out, count) = (b.companion.excluded_waypoints(), known[0] as u32);
        if resume == 0.0 {
            assert_eq!(left_out, [], "all is planned again");
            assert_eq!(done_count(&mut b), [0.0]);
        } else {
            assert_eq!(left_out, [WaypointRange { first: 0, end: count }]);
            assert_eq!(done_count(&mut b), known);
        }
    }
}
