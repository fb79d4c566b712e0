//! Tests of what the simulated ArduCopter sends without a request, answers and refuses.

use planner_core::geo::frames::Projection;

use super::*;

#[test]
fn unsolicited_it_says_heartbeat_and_next_to_nothing() {
    let mut bench = Bench::copter();
    bench.run(30.0);
    let count = |id| bench.of(id).count();
    assert!((30..=31).contains(&count(0)));
    assert_eq!((count(1), count(111)), (1, 3), "one SYS_STATUS, TIMESYNC every 10 s");
    for (_, frame) in &bench.received {
        assert!(
            [0, 1, 22, 111, 253, 49, 242].contains(&frame.message_id),
            "{} unsolicited",
            frame.message_id
        );
    }
    let beat = bench.of(0).last().unwrap().1.padded_payload();
    assert_eq!((beat[4], beat[5], beat[6]), (2, 3, 0x51), "quadrotor, ArduPilot, STABILIZE");
    bench.run(0.1);
    let stray = bench.of(22).next().expect("a stray PARAM_VALUE").1.padded_payload();
    assert_eq!(
        (&stray[8..20], f32::from_le_bytes([stray[0], stray[1], stray[2], stray[3]])),
        (&b"STAT_RUNTIME"[..], 30.0)
    );
}

#[test]
fn streams_come_when_asked_for_and_positions_when_the_estimator_is_ready() {
    let mut bench = Bench::copter();
    for id in [32, 33, 193, 245] {
        bench.want(id);
    }
    let flags = |bench: &Bench| {
        let (_, frame) = bench.of(193).last().unwrap();
        u16::from_le_bytes([frame.padded_payload()[20], frame.padded_payload()[21]])
    };
    bench.run(2.0);
    assert_eq!(flags(&bench), 0x400);
    bench.run(5.0);
    assert_eq!(flags(&bench), 0xA7);
    assert_eq!(bench.of(32).count(), 0, "no LOCAL_POSITION_NED without a position");
    bench.run(3.0);
    assert_eq!(flags(&bench), 0x33F);
    assert!(bench.of(32).count() > 10);
    assert_eq!(bench.of(49).count(), 1, "the origin comes when it is set");
    let before = bench.of(32).count();
    assert_eq!(bench.ask(511, 32.0, -1.0), [0]);
    bench.run(2.0);
    assert!(bench.of(32).count() <= before + 1, "switched off");
}

#[test]
fn ground_stations_may_ask_by_data_stream() {
    let mut bench = Bench::copter();
    bench.send(66, &[4, 0, 1, 1, 10, 1]);
    bench.run(2.0);
    assert!((7..=9).contains(&bench.of(30).count()), "ATTITUDE at 4 Hz");
}

#[test]
fn refusals_are_as_seen() {
    let mut bench = Bench::copter();
    bench.run(f64::from(READY_S));
    assert_eq!(bench.mode(99.0), [4], "unknown mode");
    assert_eq!(bench.mode(GUIDED), [0]);
    assert_eq!(bench.take_off(5.0), [4], "take-off while disarmed");
    assert_eq!(bench.ask(511, 9999.0, 1e5), [2], "bad message id");
    assert_eq!(bench.ask(12_345, 0.0, 0.0), [3], "unknown command");
    bench.mode(LAND);
    assert_eq!(bench.arm(), [4], "LAND does not arm");
    let mut bench = Bench::in_guided(5.0);
    assert_eq!(bench.ask(400, 0.0, 0.0), [4], "disarm in the air");
    assert_eq!(bench.take_off(10.0), [4], "take-off in the air");
    assert_eq!(bench.ask(246, 1.0, 0.0), [4], "reboot in the air");
    assert_eq!(bench.ask(400, 0.0, 21_196.0), [0]);
    bench.run(2.0);
    assert!(!bench.autopilot.true_state().armed && bench.at().z < 0.31, "forced, it fell");
}

#[test]
fn integers_are_cast_and_answers_to_names_carry_no_index() {
    let mut bench = Bench::copter();
    bench.set_param("FS_GCS_ENABLE", 1.0, 2);
    let b = *bench.of(22).last().unwrap().1.padded_payload();
    let wire = f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    assert_eq!((wire, u16::from_le_bytes([b[6], b[7]]), b[24]), (1.0, u16::MAX, 2));
    bench.send(21, &[1, 1]);
    bench.run(2.0);
    let total = usize::from(u16::from_le_bytes([b[4], b[5]]));
    let bench_total = bench.of(22).count() - 1;
    assert_eq!(bench_total, total);
    for (k, (_, frame)) in bench.of(22).skip(1).enumerate() {
        assert_eq!(
            usize::from(u16::from_le_bytes([frame.padded_payload()[6], frame.padded_payload()[7]])),
            k
        );
    }
}

#[test]
fn a_reboot_forgets_streams_and_keeps_parameters_and_missions() {
    let mut bench = Bench::copter();
    bench.want(30);
    bench.set_param("RTL_ALT", 900.0, 6);
    bench.run(5.0);
    assert_eq!(bench.ask(246, 1.0, 0.0), [0]);
    bench.framer = Framer::new();
    bench.until(1.0, |a| a.time_us() < 1_000_000);
    bench.run(0.5);
    let before = bench.of(30).count();
    bench.run(2.0);
    assert_eq!(bench.of(30).count(), before, "streams are forgotten");
    bench.send(20, &[255, 255, 1, 1, b'R', b'T', b'L', b'_', b'A', b'L', b'T', 0]);
    let b = bench.of(22).last().unwrap().1.padded_payload();
    assert_eq!(f32::from_le_bytes([b[0], b[1], b[2], b[3]]), 900.0);
}

#[test]
fn ned_is_in_its_own_projection_about_its_own_origin() {
    let world = AutopilotConfig::default().world_origin;
    let ekf = frames::enu_to_geodetic(&world, &Point::new(1200.0, -700.0, 12.0));
    let mut bench = Bench::with(&AutopilotConfig { ekf_origin: ekf, ..config() });
    bench.want(32);
    bench.run(f64::from(READY_S) + 1.0);
    let b = *bench.of(32).last().unwrap().1.padded_payload();
    let said = |at: usize| f64::from(f32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]));
    let truth = frames::enu_to_geodetic(&world, &bench.at());
    let expected = frames::geodetic_to_ned(Projection::ArduPilot, &ekf, &truth);
    for (k, at) in [4, 8, 12].into_iter().enumerate() {
        assert!(
            (said(at) - expected[k]).abs() < 0.01,
            "axis {k}: {} for {}",
            said(at),
            expected[k]
        );
    }
    assert!((expected - frames::geodetic_to_ned(Projection::Px4, &ekf, &truth)).norm() > 0.5);
}

#[test]
fn an_installer_sets_integers_of_either_autopilot() {
    for (config, name) in [(config(), "RTL_ALT"), (AutopilotConfig::default(), "COM_OBL_RC_ACT")] {
        let mut bench = Bench::with(&config);
        bench.autopilot.set_parameter(name, 5).unwrap();
        assert_eq!(bench.autopilot.software.params().i32_value(name), 5);
        assert!(bench.autopilot.set_parameter("NO_SUCH", 5).is_err());
        assert!(bench.autopilot.set_parameter("GUID_TIMEOUT", 5).is_err(), "no integer");
    }
}
