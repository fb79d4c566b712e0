//! One test for each thing PX4 was seen to do, in memory.

use companion::frame::{self, Frame, Framer, Header};
use companion::time::Instant;

use super::*;

const DT: f32 = 0.004;
const HOLD: u32 = 0x0304_0000;
const TAKEOFF: u32 = 0x0204_0000;
const RETURN: u32 = 0x0504_0000;
const LAND: u32 = 0x0604_0000;
const OFFBOARD: u32 = 0x0006_0000;
const POSITION: u16 = 0xDF8;
const VELOCITY: u16 = 0xDC7;

/// A ground station on a bench: sends by field, keeps every frame that comes back with the time it came.
struct Bench {
    autopilot: Autopilot,
    framer: Framer,
    sequence: u8,
    received: Vec<(f64, Frame)>,
    ground: f32,
    /// A setpoint repeated at this period in steps: mask, frame, position, velocity.
    stream: Option<(usize, Vec<u8>)>,
    steps: usize,
}

impl Bench {
    fn new() -> Self {
        Self::with(&Config::default())
    }

    fn with(config: &Config) -> Self {
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
        let mut out = [0; frame::MAX_SENT];
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

    /// Runs until the condition holds; the time it took. Fails after `limit` seconds.
    fn until(&mut self, limit: f64, mut done: impl FnMut(&Autopilot) -> bool) -> f64 {
        let start = self.now();
        while !done(&self.autopilot) {
            assert!(self.now() - start < limit, "not within {limit} s: {:?}", self.autopilot.truth());
            self.run(0.004);
        }
        self.now() - start
    }

    fn of(&self, id: u32) -> impl Iterator<Item = &(f64, Frame)> {
        self.received.iter().filter(move |(_, frame)| frame.message_id == id)
    }

    fn command(&mut self, id: u16, params: [f32; 7]) -> Vec<u8> {
        let before = self.received.len();
        let mut payload = [0; 33];
        for (k, p) in params.iter().enumerate() {
            payload[4 * k..4 * k + 4].copy_from_slice(&p.to_le_bytes());
        }
        payload[28..30].copy_from_slice(&id.to_le_bytes());
        payload[30..32].copy_from_slice(&[self.autopilot.config.system_id, 1]);
        self.send(76, &payload);
        self.run(0.016);
        self.received[before..]
            .iter()
            .filter(|(_, f)| f.message_id == 77 && f.padded()[..2] == id.to_le_bytes())
            .map(|(_, f)| f.padded()[2])
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
        let b = frame.padded();
        (u32::from_le_bytes([b[0], b[1], b[2], b[3]]), b[6], b[7])
    }

    fn landed_state(&self) -> u8 {
        self.of(245).last().unwrap().1.padded()[1]
    }

    /// Armed in Offboard, hovering over the start at `up` metres.
    fn hovering(up: f32) -> Self {
        let mut bench = Self::new();
        bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -up], [0.0; 3], 0.0));
        bench.run(1.0);
        assert_eq!(bench.set_mode(6.0, 0.0), [0, 0]);
        assert_eq!(bench.arm(), [0]);
        bench.until(20.0, |a| a.truth().position.z > up - 0.3);
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
    let at = bench.autopilot.truth().position;
    // 10 m north and 4 m east of the EKF origin, which is the mission origin here; ground is 0 and rest 0.3.
    assert!((at - Point::new(4.0, 10.0, 5.0)).norm() < 0.2, "at {at}");
    assert_eq!(bench.set_mode(4.0, 6.0), [0, 0]);
    bench.run(1.5);
    assert_eq!(bench.landed_state(), 4);
    assert_eq!(bench.heartbeat(), (LAND, 157, 4));
    bench.until(30.0, |a| a.truth().landed);
    let to_disarm = bench.until(5.0, |a| !a.truth().armed);
    assert!((2.2..=2.4).contains(&to_disarm), "disarmed {to_disarm} s after ON_GROUND");
    assert!((bench.autopilot.truth().position - Point::new(4.0, 10.0, 0.3)).norm() < 0.3);
}
