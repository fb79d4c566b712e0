//! Tests of the camera's trigger, on both autopilots.

use super::*;
use crate::camera::Photo;

const DIGICAM: u16 = 203;
const DISTANCE: u16 = 206;

/// Id of the message that announces a picture, offsets of latitude, longitude and index in its
/// payload, and the first index.
fn layout(autopilot: SimulatedKind) -> (u32, [usize; 3], u32) {
    match autopilot {
        SimulatedKind::Px4 => (263, [12, 16, 44], 0),
        SimulatedKind::Ardupilot => (180, [8, 12, 40], 1),
    }
}

/// A bench whose vehicle hovers at 10 m, ready for setpoints.
fn hovering(autopilot: SimulatedKind) -> Bench {
    match autopilot {
        SimulatedKind::Px4 => Bench::hovering(10.0),
        SimulatedKind::Ardupilot => Bench::in_guided(10.0),
    }
}

/// Index and place (mission frame, metres east and north) of each announced picture.
fn said(bench: &Bench, autopilot: SimulatedKind) -> Vec<(u32, [f64; 2])> {
    let (id, [lat, lon, index], _) = layout(autopilot);
    let long =
        |b: &[u8; 255], at: usize| i32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
    let world = AutopilotConfig::default().world_origin;
    bench
        .of(id)
        .map(|(_, frame)| {
            let b = frame.padded_payload();
            let place = Geodetic {
                lat_deg: f64::from(long(b, lat)) * 1e-7,
                lon_deg: f64::from(long(b, lon)) * 1e-7,
                alt_m: world.alt_m,
            };
            let enu = frames::geodetic_to_enu(&world, &place);
            (u32::from(u16::from_le_bytes([b[index], b[index + 1]])), [enu.x, enu.y].map(f64::from))
        })
        .collect()
}

fn across(a: &Photo, b: &Photo) -> f32 {
    (a.position - b.position).xy().norm()
}

/// Flies to `metres` north of the origin for `seconds` and returns the photos.
fn fly_north(bench: &mut Bench, metres: f32, seconds: f64) -> Vec<Photo> {
    bench.stream(20.0, setpoint(POSITION, 1, [metres, 0.0, -10.0], [0.0; 3], 0.0));
    bench.run(seconds);
    bench.autopilot.drain_photos()
}

#[test]
fn by_distance_it_photographs_where_it_says_and_at_that_distance() {
    for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
        let mut bench = hovering(autopilot);
        let (id, _, first) = layout(autopilot);
        assert_eq!(bench.of(id).count(), 0);
        // A picture at once, then every 5 m.
        bench.command(DISTANCE, [5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        bench.run(0.06);
        assert!(
            bench.of(77).any(|(_, f)| f.padded_payload()[..3] == [206, 0, 0]),
            "206 is accepted"
        );
        let photos = fly_north(&mut bench, 42.0, 20.0);
        assert_eq!(photos.len(), 9, "{autopilot:?}: at 0, 5 … 40 m");
        for pair in photos.windows(2) {
            let apart = across(&pair[0], &pair[1]);
            // At up to 10 m/s a picture is at most 50 ms late.
            assert!((4.99..5.6).contains(&apart), "{autopilot:?}: {apart} m apart");
        }
        let said = said(&bench, autopilot);
        assert_eq!(said.len(), photos.len());
        for (k, ((index, place), photo)) in said.iter().zip(&photos).enumerate() {
            assert_eq!(*index, first + k as u32);
            let off = (place[0] - f64::from(photo.position.x))
                .hypot(place[1] - f64::from(photo.position.y));
            assert!(off < 0.02, "{autopilot:?}: {off} m off");
        }
        assert_eq!(bench.autopilot.drain_photos(), [], "they are handed over once");
        // Switched off: no more.
        bench.command(DISTANCE, [0.0; 7]);
        assert_eq!(fly_north(&mut bench, 0.0, 15.0), []);
    }
}

#[test]
fn without_a_picture_at_once_px4_begins_with_one_and_ardupilot_does_not() {
    for (autopilot, count) in [(SimulatedKind::Px4, 3), (SimulatedKind::Ardupilot, 2)] {
        let mut bench = hovering(autopilot);
        bench.command(DISTANCE, [5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(fly_north(&mut bench, 13.0, 12.0).len(), count, "{autopilot:?}");
        // Switched off and on again, the distance is measured from there.
        bench.command(DISTANCE, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        bench.run(0.1);
        bench.command(DISTANCE, [20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(
            fly_north(&mut bench, 0.0, 12.0).len(),
            count - 2,
            "{autopilot:?}: 13 m are not 20"
        );
    }
}

#[test]
fn at_once_it_photographs_at_once_and_knows_how_it_was_turned() {
    for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
        let mut bench = hovering(autopilot);
        bench.stream(20.0, setpoint(0x9F8, 1, [0.0, 0.0, -10.0], [0.0; 3], 1.0));
        bench.run(5.0);
        for (parameter, photos) in [(1.0, 1), (0.0, 0), (2.0, 0)] {
            bench.command(DIGICAM, [0.0, 0.0, 0.0, 0.0, parameter, 0.0, 0.0]);
            bench.run(0.1);
            assert!(
                bench.of(77).any(|(_, f)| f.padded_payload()[..3] == [203, 0, 0]),
                "203 is accepted"
            );
            let taken = bench.autopilot.drain_photos();
            assert_eq!(taken.len(), photos, "{autopilot:?}, parameter 5 is {parameter}");
            for photo in taken {
                assert!((photo.heading_rad - 1.0).abs() < 0.02, "{photo:?}");
            }
        }
        // The command that switches triggering off can request a picture too: the last one of a
        // lane.
        bench.command(DISTANCE, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        bench.run(0.1);
        assert_eq!(bench.autopilot.drain_photos().len(), 1);
    }
}

#[test]
fn numbers_that_are_none_photograph_nothing() {
    for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
        let mut bench = hovering(autopilot);
        for value in [f32::NAN, f32::NEG_INFINITY, -1.0] {
            bench.command(DISTANCE, [value, value, f32::NAN, 0.0, value, 0.0, 0.0]);
            bench.command(DIGICAM, [0.0, 0.0, 0.0, 0.0, value, 0.0, 0.0]);
        }
        assert_eq!(fly_north(&mut bench, 10.0, 8.0), [], "{autopilot:?}");
    }
}

#[test]
fn a_reboot_forgets_the_distance_and_keeps_what_was_photographed() {
    let mut bench = hovering(SimulatedKind::Px4);
    bench.command(DISTANCE, [5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    bench.run(0.1);
    bench.autopilot.reboot();
    assert_eq!(bench.autopilot.drain_photos().len(), 1);
    bench.run(1.0);
    assert_eq!(bench.autopilot.drain_photos(), []);
}

#[test]
fn it_turns_to_a_commanded_yaw_the_short_way_at_a_bounded_rate() {
    for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
        let mut bench = hovering(autopilot);
        let most = bench.autopilot.software.gains().heading_rate_max;
        for yaw in [3.0_f32, -3.0, 0.5, -0.5] {
            // Position and yaw; position, velocity and yaw.
            for mask in [0x9F8, 0x9C0] {
                bench.stream(20.0, setpoint(mask, 1, [0.0, 0.0, -10.0], [0.0; 3], yaw));
                let from = bench.autopilot.true_state().heading_rad;
                let way = crate::physics::vehicle::wrap_pi_once(yaw - from).abs();
                let (mut turned, mut fastest) = (0.0, 0.0_f32);
                for _ in 0..1500 {
                    let before = bench.autopilot.true_state().heading_rad;
                    bench.run(0.004);
                    let truth = bench.autopilot.true_state();
                    turned +=
                        crate::physics::vehicle::wrap_pi_once(truth.heading_rad - before).abs();
                    fastest = fastest.max(truth.heading_rate.abs());
                }
                let truth = bench.autopilot.true_state();
                assert!(
                    crate::physics::vehicle::wrap_pi_once(truth.heading_rad - yaw).abs() < 0.02,
                    "{autopilot:?} {yaw}"
                );
                assert!(fastest <= 1.001 * most, "{autopilot:?}: {fastest} rad/s of {most}");
                assert!(turned < way + 0.1, "{autopilot:?}: turned {turned} for {way}");
            }
        }
    }
}
