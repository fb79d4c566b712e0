//! One test for each observed behaviour of ArduCopter 4.6: its flight here, its messages and
//! answers in `protocol`.

mod protocol;

use super::super::ardupilot::CopterMode as Copter;
use super::*;

const GUIDED: f32 = 4.0;
const LOITER: f32 = 5.0;
const RTL: f32 = 6.0;
const LAND: f32 = 9.0;
const BRAKE: f32 = 17.0;
const READY_S: f32 = 8.0;

fn config() -> AutopilotConfig {
    AutopilotConfig {
        autopilot: SimulatedKind::Ardupilot,
        estimator_ready_s: READY_S,
        ..AutopilotConfig::default()
    }
}

impl Bench {
    fn copter() -> Self {
        Self::with(&config())
    }

    fn ask(&mut self, id: u16, a: f32, b: f32) -> Vec<u8> {
        self.command(id, [a, b, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    pub(super) fn mode(&mut self, number: f32) -> Vec<u8> {
        self.ask(176, 1.0, number)
    }

    fn take_off(&mut self, height: f32) -> Vec<u8> {
        self.command(22, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height])
    }

    fn want(&mut self, id: u32) {
        assert_eq!(self.ask(511, id as f32, 1e5), [0]);
    }

    pub(super) fn texts(&self) -> Vec<String> {
        let text = |f: &Frame| {
            String::from_utf8_lossy(&f.padded_payload()[1..51]).trim_end_matches('\0').to_owned()
        };
        self.of(253).map(|(_, frame)| text(frame)).collect()
    }

    /// A bench whose vehicle is armed in Guided.
    pub(super) fn armed() -> Self {
        let mut bench = Self::copter();
        bench.want(245);
        bench.run(f64::from(READY_S));
        assert_eq!(bench.mode(GUIDED), [0]);
        assert_eq!(bench.arm(), [0]);
        bench
    }

    /// A bench whose vehicle hovers `up` metres high in Guided.
    pub(super) fn in_guided(up: f32) -> Self {
        let mut bench = Self::armed();
        assert_eq!(bench.take_off(up), [0]);
        bench.until(20.0, |a| a.true_state().position.z > up);
        bench.run(3.0);
        bench
    }

    fn at(&self) -> Point {
        self.autopilot.true_state().position
    }
}

#[test]
fn it_flies_the_sequence_that_was_seen_to_fly() {
    let mut bench = Bench::armed();
    bench.run(1.1);
    assert_eq!(bench.heartbeat(), (4, 0xD9, 3), "armed on the ground is STANDBY");
    assert_eq!(bench.take_off(10.0), [0]);
    let start = bench.now();
    bench.until(5.0, |a| !a.true_state().landed);
    let lifted = bench.now() - start;
    assert!((2.0..2.5).contains(&lifted), "in the air after {lifted} s");
    bench.run(0.2);
    assert_eq!(bench.landed_state(), 3);
    bench.until(15.0, |a| a.true_state().position.z - 0.3 > 9.5);
    let there = bench.now() - start;
    assert!((8.0..8.8).contains(&there), "9.5 m after {there} s");
    assert_eq!(bench.landed_state(), 3);
    while bench.landed_state() == 3 {
        bench.run(0.05);
    }
    let done = bench.now() - start;
    assert!(
        bench.landed_state() == 2 && (8.9..9.8).contains(&done),
        "landed_state 2 after {done} s"
    );
    bench.run(1.0);
    assert_eq!(bench.heartbeat(), (4, 0xD9, 4));
    assert!((bench.at().z - 10.3).abs() < 0.15, "at {}", bench.at());
}

#[test]
fn the_armed_bit_lags_the_ack() {
    let mut latest = 0.0_f64;
    for k in 0..8 {
        let mut bench = Bench::copter();
        bench.run(f64::from(READY_S) + 0.12 * f64::from(k));
        bench.mode(GUIDED);
        assert_eq!(bench.arm(), [0]);
        let acked = bench.of(77).last().unwrap().0;
        while bench.heartbeat().1 & 0x80 == 0 {
            bench.run(0.02);
        }
        latest = latest.max(bench.of(0).last().unwrap().0 - acked);
    }
    assert!((0.45..=1.0).contains(&latest), "{latest} s at most: HEARTBEAT comes at 1 Hz");
}

#[test]
fn acks_take_milliseconds() {
    let mut bench = Bench::copter();
    bench.run(1.0);
    let asked = bench.now();
    bench.mode(GUIDED);
    let took = bench.of(77).last().unwrap().0 - asked;
    assert!((0.0025..=0.007).contains(&took), "{took} s");
}

#[test]
fn guided_is_accepted_before_the_estimator_is_ready_and_arming_refused() {
    let mut bench = Bench::copter();
    bench.run(3.0);
    assert_eq!(bench.mode(GUIDED), [0]);
    assert_eq!(bench.arm(), [4]);
    assert!(
        bench.texts().iter().any(|text| text.contains("Need Position Estimate")),
        "{:?}",
        bench.texts()
    );
    bench.run(1.0);
    assert_eq!(bench.heartbeat(), (4, 0x59, 3));
}

#[test]
fn setpoints_before_take_off_do_not_lift_and_it_disarms_itself() {
    let mut bench = Bench::armed();
    bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
    let took = bench.until(12.0, |a| !a.true_state().armed);
    assert!((9.8..=10.0).contains(&took), "disarmed after {took} s");
    assert!(bench.at().z < 0.31);
}

#[test]
fn a_setpoint_before_the_lift_off_ends_the_take_off() {
    let mut bench = Bench::armed();
    bench.take_off(5.0);
    bench.run(1.0);
    bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
    bench.run(8.0);
    assert!(bench.at().z < 0.31);
    // Once in the air setpoints take over.
    let mut bench = Bench::armed();
    bench.take_off(5.0);
    bench.until(5.0, |a| !a.true_state().landed);
    bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -3.0], [0.0; 3], 0.0));
    bench.run(8.0);
    assert!((bench.at().z - 3.0).abs() < 0.15, "at {}", bench.at());
    assert_eq!(bench.landed_state(), 2);
}

#[test]
fn the_masks_that_work_move_it() {
    let mut bench = Bench::in_guided(5.0);
    bench.stream(20.0, setpoint(0xDF8, 1, [10.0, 4.0, -5.0], [0.0; 3], 0.0));
    bench.run(12.0);
    assert!((bench.at() - Point::new(4.0, 10.0, 5.0)).norm() < 0.2, "0xDF8 at {}", bench.at());
    bench.stream(20.0, setpoint(0xDC7, 1, [0.0; 3], [0.0, 2.0, 0.0], 0.0));
    bench.run(4.0);
    let v = bench.autopilot.true_state().velocity;
    assert!((1.85..2.15).contains(&v.x) && v.y.abs() < 0.1, "0xDC7 flies {v}");
    bench.stream(20.0, setpoint(0xDC0, 1, [3.0, 1.0, -6.0], [0.0; 3], 0.0));
    bench.run(14.0);
    assert!((bench.at() - Point::new(1.0, 3.0, 6.0)).norm() < 0.2, "0xDC0 at {}", bench.at());
    bench.stream(20.0, setpoint(0x9F8, 1, [3.0, 1.0, -6.0], [0.0; 3], 1.57));
    bench.run(5.0);
    assert!((bench.autopilot.true_state().heading_rad - 1.57).abs() < 0.02, "0x9F8 turns");
    let mut turning = setpoint(0x5C7, 1, [0.0; 3], [1.0, 0.0, 0.0], 0.0);
    turning[44..48].copy_from_slice(&0.5_f32.to_le_bytes());
    bench.stream(20.0, turning);
    bench.run(3.0);
    let truth = bench.autopilot.true_state();
    assert!(truth.velocity.y > 0.8 && (truth.heading_rate - 0.5).abs() < 0.05, "0x5C7 {truth:?}");
}

#[test]
fn frames_1_8_and_9_move_it_and_12_stops_it() {
    for (frame, moves) in [(1, true), (8, true), (9, true), (12, false)] {
        let mut bench = Bench::in_guided(5.0);
        let texts = bench.texts().len();
        bench.stream(20.0, setpoint(VELOCITY, frame, [0.0; 3], [2.0, 0.0, 0.0], 0.0));
        bench.run(3.0);
        let speed = bench.autopilot.true_state().velocity.y;
        assert_eq!(speed > 1.8, moves, "frame {frame}: {speed} m/s");
        assert_eq!(bench.texts().len(), texts, "without a word");
    }
    // In the body frames forward is where the nose points, and positions are offsets.
    let mut bench =
        Bench::with(&AutopilotConfig { heading_rad: core::f32::consts::FRAC_PI_2, ..config() });
    bench.run(f64::from(READY_S));
    bench.mode(GUIDED);
    bench.arm();
    bench.take_off(5.0);
    bench.run(12.0);
    bench.send(84, &setpoint(POSITION, 9, [4.0, 0.0, 0.0], [0.0; 3], 0.0));
    bench.run(8.0);
    assert!((bench.at() - Point::new(4.0, 0.0, 5.3)).norm() < 0.3, "at {}", bench.at());
}

#[test]
fn a_velocity_is_held_three_seconds_then_it_brakes() {
    let mut bench = Bench::in_guided(5.0);
    bench.stream(20.0, setpoint(VELOCITY, 1, [0.0; 3], [2.0, 0.0, 0.0], 0.0));
    bench.run(4.0);
    let texts = bench.texts().len();
    bench.stream = None;
    let slower = bench.until(5.0, |a| a.true_state().velocity.norm() < 1.8);
    assert!((3.1..3.7).contains(&slower), "below 1.8 m/s after {slower} s");
    let stopped = slower + bench.until(3.0, |a| a.true_state().velocity.norm() < 0.2);
    assert!((4.0..4.8).contains(&stopped), "below 0.2 m/s after {stopped} s");
    bench.run(2.0);
    assert_eq!(
        (bench.heartbeat().0, bench.texts().len()),
        (4, texts),
        "still Guided, without a word"
    );
}

#[test]
fn guid_timeout_acts_on_position_with_velocity_too() {
    let mut bench = Bench::in_guided(5.0);
    bench.set_param("GUID_TIMEOUT", 0.5, 9);
    for k in 0..80 {
        bench.send(84, &setpoint(0xDC0, 1, [0.1 * k as f32, 0.0, -5.0], [2.0, 0.0, 0.0], 0.0));
        bench.run(0.05);
    }
    bench.run(6.0);
    // The last target, 7.9 m, moved on for half a second.
    assert!((8.5..9.4).contains(&bench.at().y), "at {}", bench.at());
}

#[test]
fn a_position_is_held_for_ever() {
    let mut bench = Bench::in_guided(5.0);
    bench.send(84, &setpoint(POSITION, 1, [8.0, 0.0, -5.0], [0.0; 3], 0.0));
    bench.run(60.0);
    assert!((bench.at() - Point::new(0.0, 8.0, 5.0)).norm() < 0.2, "at {}", bench.at());
}

#[test]
fn outside_guided_setpoints_are_ignored_and_a_running_stream_takes_effect_at_once() {
    let mut bench = Bench::in_guided(5.0);
    assert_eq!(bench.mode(BRAKE), [0]);
    bench.stream(20.0, setpoint(POSITION, 1, [8.0, 0.0, -5.0], [0.0; 3], 0.0));
    bench.run(4.0);
    assert!(bench.at().y.abs() < 0.1 && bench.heartbeat() == (17, 0xD9, 4));
    bench.autopilot.set_pilot_mode(Copter::Guided);
    bench.run(8.0);
    assert!((bench.at().y - 8.0).abs() < 0.2, "at {}", bench.at());
}

#[test]
fn loiter_with_a_low_stick_sinks_and_brake_holds() {
    let mut bench = Bench::in_guided(20.0);
    assert_eq!(bench.mode(LOITER), [0]);
    bench.run(4.0);
    let sink = bench.autopilot.true_state().velocity.z;
    assert!((-2.7..-2.2).contains(&sink), "{sink} m/s");
    bench.autopilot.take_over_by_pilot();
    bench.run(5.0);
    let up = bench.at().z;
    bench.run(5.0);
    assert!((bench.at().z - up).abs() < 0.1);
    bench.autopilot.return_from_pilot();
    bench.run(1.1);
    assert_eq!(bench.heartbeat().0, 4);
}

#[test]
fn the_ground_stations_silence_returns_it_only_if_set_so() {
    let ground = Header { system: 255, component: 190, sequence: 0 };
    let beat = |bench: &mut Bench| {
        let mut out = [0; frame::MAX_FRAME_LEN];
        let extra = frame::extra_crc(0).unwrap();
        let len = frame::encode_raw(ground, 0, extra, &[0, 0, 0, 0, 6, 8, 0, 4, 3], &mut out);
        bench.autopilot.handle_bytes(&out[..len]);
    };
    for enabled in [false, true] {
        let mut bench = Bench::in_guided(5.0);
        bench.set_param("FS_GCS_ENABLE", f32::from(u8::from(enabled)), 2);
        beat(&mut bench);
        let start = bench.now();
        for _ in 0..120 {
            // A companion's heartbeats do not count.
            bench.send(0, &[0, 0, 0, 0, 18, 8, 0, 4, 3]);
            bench.run(0.05);
            if bench.autopilot.in_failsafe() {
                break;
            }
        }
        assert_eq!(bench.autopilot.in_failsafe(), enabled);
        if enabled {
            let took = bench.now() - start;
            assert!((5.0..5.3).contains(&took), "after {took} s");
            bench.run(1.1);
            assert_eq!(bench.heartbeat(), (6, 0xD9, 5));
            assert_eq!(bench.texts().last().unwrap(), "GCS Failsafe");
            beat(&mut bench);
            bench.run(1.1);
            assert_eq!(bench.heartbeat(), (6, 0xD9, 4), "it stays in RTL");
            assert_eq!(bench.texts().last().unwrap(), "GCS Failsafe Cleared");
        }
    }
}

#[test]
fn landing_takes_as_long_as_it_took() {
    let mut bench = Bench::in_guided(10.0);
    assert_eq!(bench.ask(21, 0.0, 0.0), [0]);
    let start = bench.now();
    bench.run(1.1);
    assert_eq!((bench.heartbeat(), bench.landed_state()), ((9, 0xD9, 4), 4));
    bench.until(40.0, |a| a.true_state().landed);
    let took = bench.now() - start;
    assert!((21.0..23.2).contains(&took), "on the ground after {took} s");
    let to_disarm = bench.until(3.0, |a| !a.true_state().armed);
    assert!((0.3..=0.8).contains(&to_disarm), "disarmed after {to_disarm} s");
    bench.run(1.1);
    assert_eq!(bench.heartbeat(), (9, 0x59, 3), "it stays in LAND");
}

#[test]
fn high_above_home_it_lands_fast_though_a_floor_is_near() {
    let mut bench = Bench::in_guided(20.0);
    bench.ground = 15.0;
    bench.mode(LAND);
    let mut fastest = 0.0_f32;
    bench.until(20.0, |a| {
        fastest = fastest.min(a.true_state().velocity.z);
        a.true_state().landed
    });
    assert!(fastest < -1.2, "{fastest} m/s: LAND_ALT_LOW counts from home");
}

#[test]
fn return_climbs_comes_home_and_lands() {
    let mut bench = Bench::in_guided(3.0);
    bench.stream(20.0, setpoint(POSITION, 1, [25.0, 0.0, -3.0], [0.0; 3], 0.0));
    bench.run(12.0);
    assert_eq!(bench.mode(RTL), [0]);
    let mut highest = 0.0_f32;
    bench.until(120.0, |a| {
        highest = highest.max(a.true_state().position.z);
        !a.true_state().armed
    });
    assert!(
        bench.at().xy().norm() < 0.7 && highest > 14.0,
        "landed at {}, {highest} m",
        bench.at()
    );
}

#[test]
fn without_a_position_it_lands_by_failsafe() {
    let mut bench = Bench::in_guided(5.0);
    bench.autopilot.set_gps_fix(GpsFix::Lost);
    bench.run(3.0);
    assert_eq!(bench.heartbeat(), (9, 0xD9, 5));
    bench.until(30.0, |a| !a.true_state().armed);
}

#[test]
fn a_low_battery_acts_as_batt_fs_low_act_says() {
    for (action, mode) in [(0.0, 4), (1.0, 9), (2.0, 6)] {
        let mut bench = Bench::in_guided(5.0);
        bench.set_param("BATT_LOW_MAH", 500.0, 9);
        bench.set_param("BATT_FS_LOW_ACT", action, 2);
        bench.autopilot.set_battery(0.1);
        bench.run(1.2);
        assert_eq!(bench.heartbeat().0, mode, "BATT_FS_LOW_ACT {action}");
    }
}
