//! What must change nothing, what is told to the swarm, and the memory it takes.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA};
use planner_core::Point;

use super::tests::assert_no_gap;
use super::*;
use crate::fake_px4::*;
use crate::intent::Intent;
use crate::px4;

/// Frames that must change nothing in the middle of a flight.
fn nuisance(bench: &mut Bench, kind: u8, seed: u8) -> Vec<u8> {
    use crate::frame::{Header, MAX_SENT, encode};
    let mode = bench.mode;
    bench.mode = px4::RTL;
    let mut wrong = bench.heartbeat();
    bench.mode = mode;
    let data = HEARTBEAT_DATA { custom_mode: px4::RTL, ..Default::default() };
    let foreign = |system, component| {
        let mut out = [0; MAX_SENT];
        let len = encode(Header { system, component, sequence: seed }, &data, &mut out);
        out[..len].to_vec()
    };
    match kind {
        // Damaged, cut, repeated, of another component, of another system, noise.
        0 => {
            let at = usize::from(seed) % wrong.len();
            wrong[at] ^= 1 << (seed % 8);
        }
        1 => wrong.truncate(usize::from(seed) % wrong.len()),
        2 => {
            let now = bench.heartbeat();
            return [now.clone(), now].concat();
        }
        3 => return foreign(SYSTEM, seed | 2),
        4 => return foreign(SYSTEM.wrapping_add(seed | 1), 1),
        _ => return (0..seed).map(|i| i.wrapping_mul(seed) ^ 0xFD).collect(),
    }
    wrong
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]
    #[test]
    fn repeated_cut_foreign_and_damaged_frames_change_nothing(
        script in proptest::collection::vec((0u8..6, proptest::prelude::any::<u8>()), 1..30),
        radio in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300),
    ) {
        let mut bench = Bench::following(config());
        for (kind, seed) in script {
            let bytes = nuisance(&mut bench, kind, seed);
            bench.companion.handle_bytes(Link::Autopilot, bench.now, &bytes);
            bench.companion.handle_bytes(Link::Swarm, bench.now, &radio);
            bench.drain();
            proptest::prop_assert!(matches!(bench.state(), State::Follow | State::Land), "{kind} {seed}: {:?}", bench.texts);
            bench.run(0.1);
        }
        bench.until(State::Done, 60.0);
        proptest::prop_assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2);
        assert_no_gap(&bench);
    }
}

#[test]
fn a_late_frame_does_not_bring_back_an_old_mode() {
    let mut bench = Bench::following(config());
    bench.mode = px4::HOLD;
    let late = bench.heartbeat();
    bench.mode = px4::OFFBOARD;
    bench.run(0.5);
    bench.companion.handle_bytes(Link::Autopilot, bench.now, &late);
    bench.run(0.5);
    assert_eq!(bench.state(), State::Follow);
}

#[test]
fn an_origin_that_moves_is_asked_for_and_at_most_one_setpoint_is_wrong() {
    let mut bench = Bench::following(config());
    bench.origin.lat_deg += 0.0005;
    bench.until(State::Done, 60.0);
    assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2, "{:?}", bench.enu);
    // One setpoint is on its way when the origin moves; from the first position about the new one none is wrong.
    let wrong =
        |(_, at, mask): &&(Instant, Point, u16)| *mask != px4::MASK_VELOCITY && (at.y - 12.0).abs() > 0.1;
    assert!(bench.setpoints.iter().filter(wrong).count() <= 1);
}

#[test]
fn a_neighbour_heard_again_lets_it_go_on() {
    let mut bench = Bench::accompanied(two_vehicles());
    bench.until(State::Follow, 20.0);
    let neighbour = bench.neighbour.take();
    bench.until(State::Alone, 5.0);
    bench.neighbour = neighbour;
    bench.until(State::Done, 60.0);
    assert!(bench.texts.iter().any(|t| t == "Neighbours heard again"));
}

#[test]
fn the_swarm_is_told_where_it_is_and_where_it_goes() {
    let mut bench = Bench::following(config());
    bench.swarm.clear();
    bench.run(1.0);
    let places: Vec<_> = bench
        .swarm
        .iter()
        .filter_map(super::super::frame::Frame::decode::<GLOBAL_POSITION_INT_DATA>)
        .collect();
    let intents: Vec<_> = bench.swarm.iter().filter_map(|f| Intent::decode(f.padded(), SYSTEM)).collect();
    assert_eq!((places.len(), intents.len()), (5, 5));
    let last = &places[4];
    let place = planner_core::frames::Geodetic {
        lat_deg: f64::from(last.lat) * 1e-7,
        lon_deg: f64::from(last.lon) * 1e-7,
        alt_m: f64::from(last.alt) * 1e-3,
    };
    let enu = planner_core::frames::geodetic_to_enu(&ORIGIN, &place);
    assert!((enu - bench.enu).norm() < 0.45, "{enu:?} {:?}", bench.enu);
    let intent = &intents[4];
    assert_eq!((intent.mission_crc, intent.plan_crc), (0xC0FFEE, 5));
    assert_eq!(intent.flags, crate::intent::FLYING | crate::intent::ON_PLAN);
    assert!((intent.progress_m - (bench.enu.x - START.x)).abs() < 0.45, "{}", intent.progress_m);
    assert_eq!(intent.points.last(), Some(&GOAL));
}

/// What the README says it takes on a board, where pointers are shorter.
#[test]
fn a_companion_fits_twenty_six_kilobytes() {
    let bytes = core::mem::size_of::<Companion<32, 64, 64>>();
    assert!(bytes <= 26 * 1024, "{bytes}");
}
