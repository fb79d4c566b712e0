//! One test for each observed behaviour of PX4: its flight here, its messages in `protocol`;
//! ArduCopter's in `ardupilot`.

mod ardupilot;
mod camera;
mod failsafes;
mod missions;
mod protocol;

use companion::link::frame::{self, Frame, Framer, Header};
use companion::time::Instant;

use crate::*;

const DT: f32 = 0.004;
// Modes of PX4, by `custom_mode`.
const HOLD: u32 = 0x0304_0000;
const TAKEOFF: u32 = 0x0204_0000;
const RETURN: u32 = 0x0504_0000;
const LAND: u32 = 0x0604_0000;
const OFFBOARD: u32 = 0x0006_0000;
// Type masks of setpoints with only a position or only a velocity.
const POSITION: u16 = 0xDF8;
const VELOCITY: u16 = 0xDC7;

/// A test bench: sends messages to the autopilot and keeps every frame that it answers, with the
/// time of its reception.
struct Bench {
    autopilot: Autopilot,
    framer: Framer,
    sequence: u8,
    received: Vec<(f64, Frame)>,
    /// Height of the ground, ENU metres.
    ground: f32,
    /// Period in steps, and payload, of the setpoint message that is sent repeatedly.
    stream: Option<(usize, Vec<u8>)>,
    steps: usize,
}

impl Bench {
    fn new() -> Self {
        Self::with(&AutopilotConfig::default())
    }

    fn with(config: &AutopilotConfig) -> Self {
        Self {
            autopilot: Autopilot::new(config).unwrap(),
            framer: Framer::new(),
            sequence: 0,
            received: Vec::new(),
            ground: config.start.z - config.vehicle.radius_m,
            stream: None,
            steps: 0,
        }
    }

    fn send(&mut self, id: u32, payload: &[u8]) {
        let header = Header { system: 1, component: 191, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut out = [0; frame::MAX_FRAME_LEN];
        let len = frame::encode_raw(header, id, frame::extra_crc(id).unwrap(), payload, &mut out);
        self.autopilot.handle_bytes(&out[..len]);
        self.collect();
    }

    fn collect(&mut self) {
        let mut buffer = [0; 1024];
        loop {
            let len = self.autopilot.poll_transmit(&mut buffer);
            if len == 0 {
                break;
            }
            let now = Instant::from_micros(self.autopilot.time_us());
            let mut bytes = &buffer[..len];
            while let Some(frame) = self.framer.next(now, &mut bytes) {
                self.received.push((self.now(), frame));
            }
        }
    }

    fn now(&self) -> f64 {
        self.autopilot.time_us() as f64 * 1e-6
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / 0.004).round() as usize {
            if let Some((period, payload)) = self.stream.clone()
                && self.steps.is_multiple_of(period)
            {
                self.send(84, &payload);
            }
            self.steps += 1;
            self.autopilot.step(DT, self.ground);
            self.collect();
        }
    }

    /// Runs until the condition holds; returns the time it took, seconds. Fails after `limit`
    /// seconds.
    fn until(&mut self, limit: f64, mut done: impl FnMut(&Autopilot) -> bool) -> f64 {
        let start = self.now();
        while !done(&self.autopilot) {
            assert!(
                self.now() - start < limit,
                "not within {limit} s: {:?}",
                self.autopilot.true_state()
            );
            self.run(0.004);
        }
        self.now() - start
    }

    /// The received messages with this id, each with its time, seconds since boot.
    fn of(&self, id: u32) -> impl Iterator<Item = &(f64, Frame)> {
        self.received.iter().filter(move |(_, frame)| frame.message_id == id)
    }

    /// Sends a COMMAND_LONG; returns the results of its COMMAND_ACKs within 16 ms.
    fn command(&mut self, id: u16, params: [f32; 7]) -> Vec<u8> {
        let before = self.received.len();
        let mut payload = [0; 33];
        for (k, p) in params.iter().enumerate() {
            payload[4 * k..4 * k + 4].copy_from_slice(&p.to_le_bytes());
        }
        payload[28..30].copy_from_slice(&id.to_le_bytes());
        payload[30..32].copy_from_slice(&[self.autopilot.platform.config.system_id, 1]);
        self.send(76, &payload);
        self.run(0.016);
        self.received[before..]
            .iter()
            .filter(|(_, f)| f.message_id == 77 && f.padded_payload()[..2] == id.to_le_bytes())
            .map(|(_, f)| f.padded_payload()[2])
            .collect()
    }

    fn set_mode(&mut self, main: f32, sub: f32) -> Vec<u8> {
        self.command(176, [1.0, main, sub, 0.0, 0.0, 0.0, 0.0])
    }

    fn arm(&mut self) -> Vec<u8> {
        self.command(400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn set_param(&mut self, name: &str, value: f32, kind: u8) {
        let mut payload = [0; 23];
        payload[..4].copy_from_slice(&value.to_le_bytes());
        payload[4..6].copy_from_slice(&[1, 1]);
        payload[6..6 + name.len()].copy_from_slice(name.as_bytes());
        payload[22] = kind;
        self.send(23, &payload);
    }

    fn stream(&mut self, rate_hz: f64, payload: Vec<u8>) {
        self.stream = Some(((250.0 / rate_hz).round() as usize, payload));
    }

    /// Last HEARTBEAT: custom mode, base mode, system status.
    fn heartbeat(&self) -> (u32, u8, u8) {
        let (_, frame) = self.of(0).last().unwrap();
        let b = frame.padded_payload();
        (u32::from_le_bytes([b[0], b[1], b[2], b[3]]), b[6], b[7])
    }

    fn landed_state(&self) -> u8 {
        self.of(245).last().unwrap().1.padded_payload()[1]
    }

    /// A bench whose vehicle is armed in Offboard and hovers `up` metres over the start.
    fn hovering(up: f32) -> Self {
        let mut bench = Self::new();
        bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -up], [0.0; 3], 0.0));
        bench.run(1.0);
        assert_eq!(bench.set_mode(6.0, 0.0), [0, 0]);
        assert_eq!(bench.arm(), [0]);
        bench.until(20.0, |a| a.true_state().position.z > up - 0.3);
        bench.run(4.0);
        bench
    }
}

fn setpoint(mask: u16, frame: u8, position: [f32; 3], velocity: [f32; 3], yaw: f32) -> Vec<u8> {
    let mut payload = vec![0; 53];
    for k in 0..3 {
        payload[4 + 4 * k..8 + 4 * k].copy_from_slice(&position[k].to_le_bytes());
        payload[16 + 4 * k..20 + 4 * k].copy_from_slice(&velocity[k].to_le_bytes());
    }
    payload[40..44].copy_from_slice(&yaw.to_le_bytes());
    payload[48..50].copy_from_slice(&mask.to_le_bytes());
    payload[50..].copy_from_slice(&[1, 1, frame]);
    payload
}

#[test]
fn it_arms_goes_offboard_follows_setpoints_and_lands() {
    let mut bench = Bench::hovering(5.0);
    assert_eq!(bench.heartbeat(), (OFFBOARD, 145, 4));
    bench.stream(20.0, setpoint(POSITION, 1, [10.0, 4.0, -5.0], [0.0; 3], 0.0));
    bench.run(12.0);
    let at = bench.autopilot.true_state().position;
    // 10 m north and 4 m east of the EKF origin, which is the mission's origin here. The ground is
    // at 0; at rest the body's centre is 0.3 m above it.
    assert!((at - Point::new(4.0, 10.0, 5.0)).norm() < 0.2, "at {at}");
    assert_eq!(bench.set_mode(4.0, 6.0), [0, 0]);
    bench.run(1.5);
    assert_eq!(bench.landed_state(), 4);
    assert_eq!(bench.heartbeat(), (LAND, 157, 4));
    bench.until(30.0, |a| a.true_state().landed);
    let to_disarm = bench.until(5.0, |a| !a.true_state().armed);
    assert!((2.2..=2.4).contains(&to_disarm), "disarmed {to_disarm} s after ON_GROUND");
    assert!((bench.autopilot.true_state().position - Point::new(4.0, 10.0, 0.3)).norm() < 0.3);
}

#[test]
fn offboard_is_accepted_disarmed_without_a_stream_but_arming_is_not() {
    let mut bench = Bench::new();
    bench.run(1.0);
    assert_eq!(bench.heartbeat(), (HOLD, 29, 3));
    assert_eq!(bench.set_mode(6.0, 0.0), [0, 0]);
    bench.run(1.1);
    assert_eq!(bench.heartbeat(), (OFFBOARD, 1, 0));
    assert_eq!(bench.arm(), [1]);
}

#[test]
fn offboard_in_the_air_without_a_stream_is_acknowledged_0_then_1_and_does_not_change_the_mode() {
    let mut bench = Bench::hovering(5.0);
    assert_eq!(bench.set_mode(4.0, 3.0), [0, 0]);
    bench.stream = None;
    bench.run(3.0);
    assert_eq!(bench.set_mode(6.0, 0.0), [0, 1]);
    bench.run(1.1);
    assert_eq!(bench.heartbeat().0, HOLD);
    // One setpoint later it is accepted.
    bench.send(84, &setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
    assert_eq!(bench.set_mode(6.0, 0.0), [0, 0]);
}

#[test]
fn position_setpoints_alone_lift_it_off_in_px4s_time() {
    let mut bench = Bench::new();
    bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
    bench.run(1.0);
    bench.set_mode(6.0, 0.0);
    bench.arm();
    // PX4 took 6.3 s to come within 5 % of the height.
    let took = bench.until(10.0, |a| a.true_state().position.z - 0.3 > 4.6);
    assert!((5.0..7.5).contains(&took), "{took} s");
}

#[test]
fn velocity_position_with_feed_forward_and_yaw_masks_fly() {
    let mut bench = Bench::hovering(5.0);
    bench.stream(20.0, setpoint(VELOCITY, 1, [0.0; 3], [0.0, 2.0, 0.0], 0.0));
    bench.run(4.0);
    let v = bench.autopilot.true_state().velocity;
    assert!((1.6..1.95).contains(&v.x) && v.y.abs() < 0.1, "east 2 m/s asked, {v} flown");
    // Position and velocity together, mask 0xDC0.
    bench.stream(20.0, setpoint(0xDC0, 1, [3.0, 1.0, -6.0], [0.0; 3], 0.0));
    bench.run(12.0);
    let at = bench.autopilot.true_state().position;
    assert!((at - Point::new(1.0, 3.0, 6.0)).norm() < 0.3, "at {at}");
    // Position and yaw, mask 0x9F8.
    bench.stream(20.0, setpoint(0x9F8, 1, [3.0, 1.0, -6.0], [0.0; 3], 1.57));
    bench.run(5.0);
    assert!((bench.autopilot.true_state().heading_rad - 1.57).abs() < 0.02);
    // Velocity forward in the body frame, mask 0x5C7 with a yaw rate of zero: forward is east now.
    bench.stream(20.0, setpoint(0x5C7, 8, [0.0; 3], [1.5, 0.0, 0.0], 0.0));
    bench.run(4.0);
    let v = bench.autopilot.true_state().velocity;
    assert!(v.x > 1.1 && v.y.abs() < 0.15, "ahead asked, {v} flown");
}

#[test]
fn global_setpoints_fly_to_the_same_place() {
    let mut bench = Bench::hovering(5.0);
    bench.stream = None;
    let goal = Point::new(6.0, -4.0, 7.0);
    let place = frames::enu_to_geodetic(&bench.autopilot.platform.config.world_origin, &goal);
    let mut payload = setpoint(POSITION, 5, [0.0; 3], [0.0; 3], 0.0);
    payload[4..8].copy_from_slice(&((place.lat_deg * 1e7).round() as i32).to_le_bytes());
    payload[8..12].copy_from_slice(&((place.lon_deg * 1e7).round() as i32).to_le_bytes());
    payload[12..16].copy_from_slice(&(place.alt_m as f32).to_le_bytes());
    for _ in 0..200 {
        bench.send(86, &payload);
        bench.run(0.05);
    }
    assert!(
        (bench.autopilot.true_state().position - goal).norm() < 0.3,
        "at {}",
        bench.autopilot.true_state().position
    );
}

#[test]
fn takeoff_is_to_an_altitude_above_the_sea_and_ends_in_hold() {
    let mut bench = Bench::new();
    bench.run(0.5);
    let up = bench.autopilot.platform.config.world_origin.alt_m as f32 + 8.0;
    assert_eq!(bench.command(22, [0.0, 0.0, 0.0, f32::NAN, f32::NAN, f32::NAN, up]), [0]);
    bench.run(1.0);
    assert_eq!(bench.heartbeat().0, TAKEOFF);
    assert_eq!(bench.arm(), [0]);
    bench.until(10.0, |a| a.true_state().position.z > 2.0);
    bench.run(0.3);
    assert_eq!(bench.landed_state(), 3);
    bench.run(15.0);
    assert_eq!(bench.heartbeat(), (HOLD, 157, 4));
    assert!(
        (bench.autopilot.true_state().position.z - 8.0).abs() < 0.1,
        "{}",
        bench.autopilot.true_state().position
    );
}

#[test]
fn armed_and_left_alone_it_disarms_after_ten_seconds() {
    let mut bench = Bench::new();
    bench.run(0.5);
    assert_eq!(bench.arm(), [0]);
    let took = bench.until(12.0, |a| !a.true_state().armed);
    assert!((9.9..=11.2).contains(&took), "{took} s");
}

#[test]
fn disarming_in_the_air_is_refused_unless_forced() {
    let mut bench = Bench::hovering(5.0);
    assert_eq!(bench.command(400, [0.0; 7]), [1]);
    assert!(bench.autopilot.true_state().armed);
    assert_eq!(bench.command(400, [0.0, 21_196.0, 0.0, 0.0, 0.0, 0.0, 0.0]), [0]);
    bench.run(2.0);
    assert!(
        !bench.autopilot.true_state().armed && bench.autopilot.true_state().position.z < 0.31,
        "it fell"
    );
}

#[test]
fn after_landing_and_disarming_it_shows_offboard_again() {
    let mut bench = Bench::hovering(3.0);
    bench.set_mode(4.0, 6.0);
    bench.until(30.0, |a| !a.true_state().armed);
    bench.stream = None;
    bench.run(3.0);
    assert_eq!(bench.heartbeat(), (OFFBOARD, 17, 0));
}

#[test]
fn return_climbs_comes_home_and_lands() {
    let mut bench = Bench::hovering(3.0);
    bench.stream(20.0, setpoint(POSITION, 1, [25.0, 0.0, -3.0], [0.0; 3], 0.0));
    bench.run(12.0);
    bench.set_param("RTL_RETURN_ALT", 12.0, 9);
    bench.set_param("RTL_DESCEND_ALT", 6.0, 9);
    assert_eq!(bench.set_mode(4.0, 5.0), [0, 0]);
    let mut highest = 0.0_f32;
    bench.until(90.0, |a| {
        highest = highest.max(a.true_state().position.z);
        !a.true_state().armed
    });
    let at = bench.autopilot.true_state().position;
    assert!(at.xy().norm() < 0.7 && highest > 11.5, "landed at {at}, {highest} m at most");
}

#[test]
fn mpc_xy_vel_max_acts() {
    let mut bench = Bench::hovering(5.0);
    bench.set_param("MPC_XY_VEL_MAX", 2.0, 9);
    bench.stream(20.0, setpoint(POSITION, 1, [40.0, 0.0, -5.0], [0.0; 3], 0.0));
    bench.run(8.0);
    let speed = bench.autopilot.true_state().velocity.norm();
    assert!((1.6..2.2).contains(&speed), "{speed} m/s");
}

#[test]
fn the_pilots_switch_wins_and_needs_no_stream() {
    let mut bench = Bench::hovering(5.0);
    bench.autopilot.set_pilot_mode(Px4Mode::Position);
    bench.run(3.0);
    assert_eq!(bench.heartbeat(), (0x0003_0000, 209, 4));
    assert!((bench.autopilot.true_state().position.z - 5.0).abs() < 0.2);
}

#[test]
fn the_same_seed_flies_the_same_flight_bit_for_bit() {
    let fly = |seed| {
        let config = AutopilotConfig {
            gust_peak_mps: 1.0,
            wind: Point::new(3.0, 0.0, 0.0),
            position_noise_m: 0.2,
            seed,
            ..AutopilotConfig::default()
        };
        let mut bench = Bench::with(&config);
        bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
        bench.run(1.0);
        bench.set_mode(6.0, 0.0);
        bench.arm();
        bench.run(15.0);
        (*bench.autopilot.true_state(), bench.received.len())
    };
    let once = fly(1);
    assert_eq!(once, fly(1));
    assert_ne!(once.0.position, fly(2).0.position);
    assert!((once.0.position - Point::new(0.0, 0.0, 5.0)).norm() < 1.5, "{}", once.0.position);
}

#[test]
fn a_jump_of_the_estimate_moves_the_vehicle_the_other_way() {
    let mut bench = Bench::hovering(5.0);
    bench.autopilot.jump_estimated_position(&Point::new(3.0, 0.0, 0.0));
    bench.run(12.0);
    assert!(
        (bench.autopilot.true_state().position.x + 3.0).abs() < 0.2,
        "{}",
        bench.autopilot.true_state().position
    );
}
