//! Tests of the messages and answers of the simulated PX4.

use super::*;

#[test]
fn it_floods_at_once_at_px4s_rates() {
    let mut bench = Bench::new();
    bench.run(0.1);
    assert!(bench.of(30).count() >= 9, "ATTITUDE before anything was asked");
    let known = bench.received.len();
    assert!(known > 20);
    bench.run(9.9);
    for (id, rate) in [
        (30, 100.0),
        (105, 50.0),
        (331, 30.0),
        (111, 10.0),
        (4, 1.0),
        (0, 1.0),
        (33, 50.0),
        (245, 5.0),
    ] {
        let seen = bench.of(id).count() as f64 / 10.0;
        assert!((seen - rate).abs() <= 0.05 * rate + 0.1, "message {id}: {seen} Hz, not {rate}");
    }
    let counters = bench.framer.counters();
    assert_eq!((counters.bad_crc, counters.noise_bytes), (0, 0));
    assert!(counters.unknown_id >= 9, "GNSS_INTEGRITY is in no dialect here: {counters:?}");
    assert!(
        [8, 380, 410, 411, 436].iter().all(|&id| bench.of(id).count() >= 2),
        "newer than many dialects"
    );
    assert!(bench.of(253).next().is_none(), "no STATUSTEXT on this link");
}

#[test]
fn sequence_numbers_have_no_gap() {
    let mut bench = Bench::new();
    bench.run(5.0);
    // Frames of unknown id are skipped.
    let gap =
        |pair: &[(f64, Frame)]| u32::from(pair[1].1.sequence.wrapping_sub(pair[0].1.sequence)) - 1;
    let gaps: u32 = bench.received.windows(2).map(gap).sum();
    assert!(gaps <= bench.framer.counters().unknown_id, "{gaps} numbers are missing");
}

#[test]
fn ned_is_about_its_own_ekf_origin() {
    let world = AutopilotConfig::default().world_origin;
    let ekf = frames::enu_to_geodetic(&world, &Point::new(1200.0, -700.0, 12.0));
    let mut bench = Bench::with(&AutopilotConfig { ekf_origin: ekf, ..AutopilotConfig::default() });
    bench.run(0.5);
    let b = *bench.of(32).last().unwrap().1.padded_payload();
    let said = |at: usize| f64::from(f32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]));
    let truth = frames::enu_to_geodetic(&world, &bench.autopilot.true_state().position);
    let expected = frames::geodetic_to_ned(SimulatedKind::Px4.projection(), &ekf, &truth);
    for (k, at) in [4, 8, 12].into_iter().enumerate() {
        assert!(
            (said(at) - expected[k]).abs() < 0.01,
            "axis {k}: {} for {}",
            said(at),
            expected[k]
        );
    }
    assert!(expected.x > 600.0 && expected.y < -1100.0);
}

#[test]
fn the_origin_comes_once_on_change_and_on_request() {
    let mut bench = Bench::new();
    bench.run(10.0);
    assert_eq!(bench.of(49).count(), 1);
    assert_eq!(bench.command(512, [49.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), [0]);
    assert_eq!(bench.of(49).count(), 2);
    let moved = Geodetic { lat_deg: 47.4, lon_deg: 8.54, alt_m: 480.0 };
    bench.autopilot.set_ekf_origin(moved);
    bench.run(5.0);
    assert_eq!(bench.of(49).count(), 3);
    let b = bench.of(49).last().unwrap().1.padded_payload();
    assert_eq!(i32::from_le_bytes([b[0], b[1], b[2], b[3]]), 474_000_000);
}

#[test]
fn commands_are_answered_as_px4_answers_them() {
    let mut bench = Bench::new();
    let ask =
        |bench: &mut Bench, id, a: f32, b: f32| bench.command(id, [a, b, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(ask(&mut bench, 12_345, 0.0, 0.0), [3], "unknown command");
    assert_eq!(ask(&mut bench, 511, 9999.0, 1e5), [4], "bad message id");
    assert_eq!(ask(&mut bench, 511, 30.0, 1e5), [0]);
    assert_eq!(ask(&mut bench, 510, 30.0, 0.0), [0]);
    let b = bench.of(244).last().unwrap().1.padded_payload();
    assert_eq!(
        (i32::from_le_bytes([b[0], b[1], b[2], b[3]]), u16::from_le_bytes([b[4], b[5]])),
        (100_000, 30)
    );
    let before = bench.of(30).count();
    bench.run(5.0);
    assert!((45..=55).contains(&(bench.of(30).count() - before)), "ATTITUDE at 10 Hz");
    for (id, param, message) in
        [(512, 148.0, 148), (520, 1.0, 148), (519, 1.0, 300), (512, 242.0, 242)]
    {
        let before = bench.of(message).count();
        assert_eq!(ask(&mut bench, id, param, 0.0), [0], "command {id}");
        assert!(bench.of(message).count() > before, "message {message}");
    }
    // A command for another system is not answered.
    let before = bench.of(77).count();
    let mut payload = [0; 33];
    payload[28..32].copy_from_slice(&[144, 1, 1, 154]);
    bench.send(76, &payload);
    bench.run(0.1);
    assert_eq!(bench.of(77).count(), before);
}

#[test]
fn parameters_are_listed_read_and_set_bytewise() {
    let mut bench = Bench::new();
    bench.send(21, &[1, 1]);
    bench.run(2.0);
    let total = usize::from(u16::from_le_bytes(
        bench.of(22).next().unwrap().1.padded_payload()[4..6].try_into().unwrap(),
    ));
    assert_eq!(bench.of(22).count(), total);
    bench.set_param("COM_OBL_RC_ACT", f32::from_bits(5), 6);
    let b = bench.of(22).last().unwrap().1.padded_payload();
    assert_eq!((u32::from_le_bytes([b[0], b[1], b[2], b[3]]), b[24]), (5, 6));
    // A value of the wrong type is refused, and answered with the current value.
    bench.set_param("COM_OBL_RC_ACT", 4.0, 9);
    let b = bench.of(22).last().unwrap().1.padded_payload();
    assert_eq!(u32::from_le_bytes([b[0], b[1], b[2], b[3]]), 5);
}

#[test]
fn an_empty_mission_is_answered() {
    let mut bench = Bench::new();
    bench.send(43, &[1, 1, 0]);
    let b = bench.of(44).last().unwrap().1.padded_payload();
    assert_eq!(&b[..5], &[0, 0, 1, 191, 0]);
    bench.send(45, &[1, 1, 0]);
    assert_eq!(bench.of(47).last().unwrap().1.padded_payload()[2], 0);
}

#[test]
fn ping_and_timesync_are_answered() {
    let mut bench = Bench::new();
    bench.run(0.5);
    bench.send(4, &telemetry::ping_payload(123, 9, 0, 0));
    let b = bench.of(4).last().unwrap().1.padded_payload();
    assert_eq!((b[0], b[8], b[12], b[13]), (123, 9, 1, 191));
    let mut payload = [0; 16];
    payload[8] = 77;
    bench.send(111, &payload);
    let b = bench.of(111).last().unwrap().1.padded_payload();
    assert_eq!(
        i64::from_le_bytes(b[..8].try_into().unwrap()),
        bench.autopilot.time_us() as i64 * 1000
    );
    assert_eq!(b[8], 77);
}

#[test]
fn every_port_has_its_own_streams() {
    let mut autopilot =
        Autopilot::new(&AutopilotConfig { ports: 2, ..AutopilotConfig::default() }).unwrap();
    let header = Header { system: 1, component: 191, sequence: 0 };
    let mut payload = [0; 33];
    payload[..4].copy_from_slice(&30.0_f32.to_le_bytes());
    payload[4..8].copy_from_slice(&(-1.0_f32).to_le_bytes());
    payload[28..32].copy_from_slice(&[255, 1, 1, 1]);
    let mut out = [0; frame::MAX_FRAME_LEN];
    let len = frame::encode_raw(header, 76, frame::extra_crc(76).unwrap(), &payload, &mut out);
    autopilot.handle_bytes_on(1, &out[..len]);
    let mut attitudes = [0, 0];
    let mut framers = [Framer::new(), Framer::new()];
    for _ in 0..250 {
        autopilot.step(DT, 0.0);
        for port in 0..2 {
            let mut buffer = [0; 4096];
            let len = autopilot.poll_transmit_from(port, &mut buffer);
            let mut bytes = &buffer[..len];
            while let Some(frame) =
                framers[port].next(Instant::from_micros(autopilot.time_us()), &mut bytes)
            {
                attitudes[port] += usize::from(frame.message_id == 30);
            }
        }
    }
    assert!(attitudes[0] > 90 && attitudes[1] == 0, "{attitudes:?}");
}

#[test]
fn hostile_bytes_neither_panic_nor_move_it() {
    let mut bench = Bench::new();
    let mut random = crate::physics::noise::Gaussian::new(5);
    for id in [4, 11, 20, 21, 23, 43, 44, 45, 75, 76, 84, 86, 111] {
        for _ in 0..50 {
            let payload: Vec<u8> = (0..60).map(|_| (random.sample() * 80.0) as i32 as u8).collect();
            bench.send(id, &payload);
        }
    }
    let noise: Vec<u8> = (0..20_000).map(|_| (random.sample() * 90.0) as i32 as u8).collect();
    bench.autopilot.handle_bytes(&noise);
    bench.run(1.0);
    assert!(!bench.autopilot.true_state().armed);
    assert_eq!(bench.autopilot.true_state().position, AutopilotConfig::default().start);
}

#[test]
fn a_port_nobody_drains_does_not_grow() {
    let mut autopilot = Autopilot::new(&AutopilotConfig::default()).unwrap();
    for _ in 0..25_000 {
        autopilot.step(DT, 0.0);
    }
    let mut waiting = 0;
    let mut buffer = [0; 1024];
    while let len @ 1.. = autopilot.poll_transmit(&mut buffer) {
        waiting += len;
    }
    assert!(waiting < 8192, "{waiting} bytes were queued");
}

#[test]
fn what_cannot_be_simulated_is_refused_by_name() {
    let refuse = |config: AutopilotConfig| Autopilot::new(&config).err().unwrap().to_string();
    assert!(
        refuse(AutopilotConfig { system_id: 0, ..AutopilotConfig::default() })
            .contains("system id")
    );
    let nowhere = Geodetic { lat_deg: 91.0, lon_deg: 0.0, alt_m: 0.0 };
    assert!(
        refuse(AutopilotConfig { ekf_origin: nowhere, ..AutopilotConfig::default() })
            .contains("EKF origin")
    );
    assert!(
        refuse(AutopilotConfig { gust_peak_mps: f32::NAN, ..AutopilotConfig::default() })
            .contains("gust")
    );
}
