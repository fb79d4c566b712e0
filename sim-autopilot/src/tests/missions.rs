//! Tests of uploaded missions, flown by both autopilots.

use super::*;
use crate::camera::Photo;

/// An item: command, frame, parameters 1 to 4, metres east and north of the mission origin (or
/// parameters 5 and 6), height.
type Plan<'a> = &'a [(u16, u8, [f32; 4], [f32; 2], f32)];

const RELATIVE: u8 = 3;
const NONE: u8 = 2;

/// Take-off, a lane with a picture every 10 m, one more picture at a waypoint, and the return.
const SURVEY: Plan<'static> = &[
    (93, NONE, [1.0, -1.0, -1.0, -1.0], [0.0; 2], 0.0),
    (22, RELATIVE, [0.0, 0.0, 0.0, f32::NAN], [0.0; 2], 8.0),
    (178, NONE, [1.0, 4.0, -1.0, 0.0], [0.0; 2], 0.0),
    (16, RELATIVE, [0.0, 0.0, 0.0, 90.0], [0.0, 20.0], 8.0),
    (206, NONE, [10.0, 0.0, 1.0, 0.0], [0.0; 2], 0.0),
    (16, RELATIVE, [0.0, 0.0, 0.0, 90.0], [43.0, 20.0], 8.0),
    (206, NONE, [0.0; 4], [0.0; 2], 0.0),
    (16, RELATIVE, [2.0, 0.0, 0.0, 90.0], [43.0, 30.0], 10.0),
    (203, NONE, [0.0; 4], [1.0, 0.0], 0.0),
    (16, RELATIVE, [0.0, 0.0, 0.0, 90.0], [0.0, 0.0], 10.0),
    (20, NONE, [0.0; 4], [0.0; 2], 0.0),
];

impl Bench {
    fn upload(&mut self, plan: Plan<'_>) {
        let autopilot = self.autopilot.platform.config.autopilot;
        let home = (16, 0, [0.0; 4], [0.0; 2], 488.0);
        let home: Plan<'_> = if autopilot == SimulatedKind::Ardupilot { &[home] } else { &[] };
        let items: Vec<_> = home.iter().chain(plan).collect();
        let [low, high] = (items.len() as u16).to_le_bytes();
        self.send(44, &[low, high, 1, 1, 0]);
        for (k, (command, frame, params, place, height)) in items.iter().enumerate() {
            let mut payload = [0; 38];
            for (at, param) in params.iter().enumerate() {
                payload[4 * at..4 * at + 4].copy_from_slice(&param.to_le_bytes());
            }
            let world = AutopilotConfig::default().world_origin;
            let geodetic = frames::enu_to_geodetic(&world, &Point::new(place[0], place[1], 0.0));
            let scaled =
                [geodetic.lat_deg, geodetic.lon_deg].map(|degrees| (degrees * 1e7).round() as i32);
            let whole = if *frame == NONE { place.map(|value| value as i32) } else { scaled };
            payload[16..20].copy_from_slice(&whole[0].to_le_bytes());
            payload[20..24].copy_from_slice(&whole[1].to_le_bytes());
            payload[24..28].copy_from_slice(&height.to_le_bytes());
            payload[28..30].copy_from_slice(&(k as u16).to_le_bytes());
            payload[30..32].copy_from_slice(&command.to_le_bytes());
            payload[32..37].copy_from_slice(&[1, 1, *frame, 0, 1]);
            self.send(73, &payload);
            self.run(0.004);
        }
        assert_eq!(self.of(47).last().map(|(_, f)| f.padded_payload()[2]), Some(0), "accepted");
    }

    /// A bench with an uploaded mission; armed if MISSION_START does not arm (ArduCopter).
    fn with_mission(autopilot: SimulatedKind, plan: Plan<'_>) -> Self {
        let mut bench = match autopilot {
            SimulatedKind::Px4 => Self::new(),
            SimulatedKind::Ardupilot => Self::armed(),
        };
        bench.upload(plan);
        bench
    }

    fn start(&mut self) -> Vec<u8> {
        self.command(300, [0.0; 7])
    }

    fn reached(&self) -> Vec<u16> {
        self.of(46)
            .map(|(_, f)| u16::from_le_bytes([f.padded_payload()[0], f.padded_payload()[1]]))
            .collect()
    }
}

const BOTH: [SimulatedKind; 2] = [SimulatedKind::Px4, SimulatedKind::Ardupilot];

#[test]
fn a_survey_is_flown_photographed_and_ends_at_home() {
    for autopilot in BOTH {
        let mut bench = Bench::with_mission(autopilot, SURVEY);
        assert_eq!(bench.start(), [0], "{autopilot:?}");
        let mode = bench.autopilot.custom_mode();
        assert_eq!(mode, if autopilot == SimulatedKind::Px4 { 0x0404_0000 } else { 3 });
        bench.until(10.0, |a| !a.true_state().landed);
        bench.until(120.0, |a| !a.true_state().armed);
        let at = bench.autopilot.true_state().position;
        assert!(at.xy().norm() < 1.0, "{autopilot:?} came down at {at}");
        let photos = bench.autopilot.drain_photos();
        assert_eq!(
            photos.len(),
            6,
            "{autopilot:?}: at 0, 10, 20, 30, 40 m and one more: {photos:?}"
        );
        let (lane, last): (&[Photo], Photo) = (&photos[..5], photos[5]);
        for (k, photo) in lane.iter().enumerate() {
            // As near to the lane as waypoints are passed; late by the distance flown between two
            // checks.
            let off = photo.position - Point::new(0.0, 20.0, 8.3);
            assert!(off.y.abs() < 2.1 && off.z.abs() < 0.9, "{autopilot:?}: {off}");
            let along = off.x - 10.0 * k as f32;
            assert!((-2.1..2.3).contains(&along), "{autopilot:?}: {along}");
        }
        assert!(
            (last.position - Point::new(43.0, 30.0, 10.3)).norm() < 2.2,
            "{autopilot:?} {last:?}"
        );
        if autopilot == SimulatedKind::Px4 {
            assert!(
                photos.iter().all(|p| (p.heading_rad - 1.57).abs() < 0.22),
                "PX4 looks as asked: {photos:?}"
            );
        }
        let home = u16::from(autopilot == SimulatedKind::Ardupilot);
        let all: Vec<u16> = (0..SURVEY.len() as u16).map(|k| k + home).collect();
        assert_eq!(bench.reached(), all, "{autopilot:?}");
        // The next flight begins with the first item.
        bench.autopilot.drain_photos();
        if autopilot == SimulatedKind::Ardupilot {
            assert_eq!((bench.mode(4.0), bench.arm()), (vec![0], vec![0]));
        }
        assert_eq!(bench.start(), [0]);
        bench.until(10.0, |a| !a.true_state().landed);
        bench.until(120.0, |a| !a.true_state().armed);
        assert_eq!(bench.autopilot.drain_photos().len(), 6);
    }
}

#[test]
fn speed_and_landing_at_a_place_are_flown() {
    for autopilot in BOTH {
        let mut bench = Bench::with_mission(
            autopilot,
            &[
                (22, RELATIVE, [0.0, 0.0, 0.0, f32::NAN], [0.0; 2], 6.0),
                (178, NONE, [1.0, 2.0, -1.0, 0.0], [0.0; 2], 0.0),
                (16, RELATIVE, [0.0, 0.0, 0.0, f32::NAN], [30.0, 0.0], 6.0),
                (21, RELATIVE, [0.0, 0.0, 0.0, f32::NAN], [30.0, 12.0], 0.0),
            ],
        );
        assert_eq!(bench.start(), [0]);
        bench.until(10.0, |a| !a.true_state().landed);
        let mut fastest = 0.0_f32;
        let seconds = bench.until(90.0, |a| {
            fastest = fastest.max(a.true_state().velocity.xy().norm());
            !a.true_state().armed
        });
        assert!((1.7..2.4).contains(&fastest), "{autopilot:?}: {fastest} m/s of 2");
        let at = bench.autopilot.true_state().position;
        assert!(
            (at.xy() - Point::new(30.0, 12.0, 0.0).xy()).norm() < 0.8,
            "{autopilot:?}: {at}, {seconds} s"
        );
        bench.run(0.1);
        assert_eq!(bench.reached().len(), 4);
    }
}

#[test]
fn a_mission_that_is_left_goes_on_with_the_item_it_was_at() {
    for autopilot in BOTH {
        let mut bench = Bench::with_mission(autopilot, SURVEY);
        bench.start();
        bench.until(90.0, |a| a.true_state().position.x > 15.0);
        let before = bench.reached();
        bench.autopilot.take_over_by_pilot();
        if autopilot == SimulatedKind::Px4 {
            bench.set_mode(4.0, 3.0);
        }
        bench.run(10.0);
        let held = bench.autopilot.true_state().position;
        bench.run(5.0);
        assert!((bench.autopilot.true_state().position - held).norm() < 0.3, "it holds");
        assert_eq!(bench.reached(), before);
        assert_eq!(bench.start(), [0]);
        bench.until(120.0, |a| !a.true_state().armed);
        assert_eq!(bench.reached().len(), SURVEY.len(), "{autopilot:?}");
    }
}

#[test]
fn what_cannot_be_flown_is_refused_and_passed_over() {
    // Nothing stored.
    let mut bench = Bench::new();
    assert_eq!(bench.start(), [2], "PX4: DENIED");
    assert_eq!(bench.set_mode(4.0, 4.0), [0, 0], "disarmed it is only a wish");
    assert_eq!(bench.arm(), [1]);
    let mut bench = Bench::armed();
    assert_eq!((bench.start(), bench.mode(3.0)), (vec![4], vec![4]), "ArduPilot: FAILED");
    // ArduPilot, armed on the ground, requires a take-off first, and stays there without
    // MISSION_START.
    bench.upload(&[(16, RELATIVE, [0.0; 4], [9.0, 9.0], 9.0)]);
    assert_eq!(bench.mode(3.0), [4]);
    assert!(bench.texts().iter().any(|text| text == "Auto: Missing Takeoff Cmd"));
    bench.upload(SURVEY);
    assert_eq!(bench.mode(3.0), [0]);
    bench.run(5.0);
    assert!(bench.autopilot.true_state().landed);
    // Unknown commands and invalid values are skipped.
    for autopilot in BOTH {
        let nan = f32::NAN;
        let mut bench = Bench::with_mission(
            autopilot,
            &[
                (22, RELATIVE, [nan; 4], [0.0; 2], 5.0),
                (4711, RELATIVE, [nan; 4], [9.0; 2], 5.0),
                (178, NONE, [nan; 4], [0.0; 2], 0.0),
                (206, NONE, [nan; 4], [0.0; 2], 0.0),
                (93, NONE, [-3.0; 4], [0.0; 2], 0.0),
                (16, RELATIVE, [nan, nan, nan, nan], [9.0, 0.0], 5.0),
            ],
        );
        assert_eq!(bench.start(), [0]);
        bench.run(60.0);
        assert_eq!(bench.reached().len(), 6, "{autopilot:?}");
        let truth = *bench.autopilot.true_state();
        let off = truth.position - Point::new(9.0, 0.0, 5.3);
        assert!(
            truth.armed && off.norm() < 0.3,
            "{autopilot:?}: after the last item it stays: {off}"
        );
        assert_eq!(bench.autopilot.drain_photos(), []);
    }
}
