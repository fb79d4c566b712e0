//! How nearly a simulated autopilot flies what a real one flew: recorded setpoints and commands are replayed into it, and where it
//! believes to be is compared with the recorded *estimate*, from arming to disarming.
//!
//! The wandering of a recorded estimate is its estimator's noise, which moves the vehicle: a replay either imposes the recorded
//! errors (estimate minus truth) on the simulated estimate, or flies without any.
//!
//! The recordings are `data/flights/*.csv` of the shared data, described by the README beside them. Positions are NED
//! metres about the vehicle's EKF origin, times are seconds of the wall clock.

use std::path::Path;

use companion::frame::{self, Header};
use host_sim::autopilot::{Autopilot, Config, Personality};
use mavlink::dialects::ardupilotmega::{
    MavFrame, MavParamType, PARAM_SET_DATA, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::frames::Geodetic;

use crate::shared_data;

/// The recorded runs.
pub const RUNS: [&str; 15] = [
    "a_demo",
    "a_lobby",
    "px4_c1_demo",
    "px4_d4_lobby",
    "x_drift_demo",
    "x_drift_demo_1",
    "x_rearm_lobby",
    "ap_b_demo",
    "ap_b_lobby",
    "ap_c1_demo",
    "ap_d1_demo",
    "apx_drift_demo",
    "apx_landearly_lobby",
    "apx_rearm_lobby",
    "f_ppa",
];
/// Simulated seconds for each second of the wall clock: PX4's SIH was recorded 0.4 to 1.1 % slow.
const PX4_CLOCK: f64 = 0.9925;
const STEP_S: f64 = 0.004;
/// Simulated time before the first record, seconds: ArduCopter has booted and has its position by then.
const WARM_UP_S: f64 = 8.0;
const COMMAND_LONG: (u32, u8) = (76, 152);

/// What is wrong with the simulated estimate in a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// Nothing.
    Perfect,
    /// What was wrong with the recorded one.
    Recorded,
}

/// One recorded row that says where something was or shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds.
    pub t_s: f64,
    /// NED about the EKF origin, metres.
    pub position: Vector3<f64>,
    /// NED, m/s.
    pub velocity: Vector3<f64>,
}

#[derive(Clone, Debug)]
struct Setpoint {
    t_s: f64,
    mask: u16,
    position: [f32; 3],
    velocity: [f32; 3],
    acceleration: [f32; 3],
    yaw: f32,
}

#[derive(Clone, Debug, PartialEq)]
enum Message {
    /// System, component, command and its parameters.
    Command(u8, u8, u16, [f32; 7]),
    /// GUID_TIMEOUT.
    GuidedTimeout(f32),
}

/// One vehicle's recorded flight.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the run.
    pub run: String,
    /// System id.
    pub vehicle: u8,
    /// What flew it.
    pub autopilot: Personality,
    /// Its EKF origin.
    pub origin: Geodetic,
    /// What it believed.
    pub estimate: Vec<Sample>,
    /// Where it was.
    pub truth: Vec<Sample>,
    /// First arming that held, and disarming, seconds.
    pub armed_s: (f64, f64),
    /// From where the mission followed its path, and from where it landed, seconds.
    pub follow_s: (f64, f64),
    setpoints: Vec<Setpoint>,
    messages: Vec<(f64, Message)>,
}

/// What a plain flight may differ by, RMS metres under the recorded errors; `None` where a person or a failsafe took the vehicle.
pub fn allowed_m(recording: &Recording) -> Option<f64> {
    match recording.run.as_str() {
        "a_demo" => Some(0.45),
        "a_lobby" | "x_rearm_lobby" => Some(0.30),
        // Vehicle 2 landed from 24 m, past the speed at which its estimator said it sank.
        "f_ppa" => match recording.vehicle {
            1 => Some(0.45),
            2 => None,
            _ => Some(0.15),
        },
        "ap_b_demo" | "ap_b_lobby" | "ap_c1_demo" | "apx_rearm_lobby" | "apx_landearly_lobby" => Some(0.15),
        _ => None,
    }
}

/// Reads the vehicles of a run; empty, with a line that says so, where the shared data are absent.
///
/// # Panics
/// A recording that is there and cannot be read.
pub fn recordings(run: &str) -> Vec<Recording> {
    let Some(path) = shared_data(&format!("flights/{run}.csv")) else { return Vec::new() };
    let vehicles = if run == "f_ppa" { 3 } else { 1 };
    (1..=vehicles).map(|vehicle| read(&path, run, vehicle)).collect()
}

/// The numbers between a command's brackets, and what follows them.
fn bracketed(text: &str) -> Option<([f32; 7], &str)> {
    let (inside, after) = text.split_once('[')?.1.split_once(']')?;
    let mut params = [0.0; 7];
    for (param, word) in params.iter_mut().zip(inside.split_whitespace()) {
        *param = word.parse().ok()?;
    }
    Some((params, after))
}

fn message(text: &str) -> Option<Message> {
    if let Some(rest) = text.strip_prefix("companion param set GUID_TIMEOUT ") {
        return Some(Message::GuidedTimeout(rest.split_whitespace().next()?.parse().ok()?));
    }
    let (from, rest) = text.split_once(" command ")?;
    let (params, after) = bracketed(rest)?;
    let command: u16 = rest.split_whitespace().next()?.parse().ok()?;
    // What asks for streams changes no flight.
    let flies = matches!(command, 20 | 21 | 22 | 176 | 400);
    match from {
        "companion" if flies && !after.contains("/0") => Some(Message::Command(1, 191, command, params)),
        "gcs" if flies && after.contains("component 1") => Some(Message::Command(255, 190, command, params)),
        _ => None,
    }
}

fn read(path: &Path, run: &str, vehicle: u8) -> Recording {
    let text = std::fs::read_to_string(path).expect("a recording can be read");
    let mut recording = Recording {
        run: run.into(),
        vehicle,
        autopilot: Personality::Px4,
        origin: Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 },
        estimate: Vec::new(),
        truth: Vec::new(),
        armed_s: (f64::INFINITY, f64::INFINITY),
        follow_s: (f64::INFINITY, f64::INFINITY),
        setpoints: Vec::new(),
        messages: Vec::new(),
    };
    // Commands wait for their acks: what was refused is not replayed.
    let mut asked: Vec<(f64, Message)> = Vec::new();
    let mut armed = false;
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.splitn(16, ',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap_or(0.0);
        let vector = |k: usize| Vector3::new(number(k), number(k + 1), number(k + 2));
        let t_s = number(0);
        if cells[1] != vehicle.to_string() {
            continue;
        }
        match cells[2] {
            "estimate" => {
                recording.estimate.push(Sample { t_s, position: vector(3), velocity: vector(6) });
            }
            "truth" => recording.truth.push(Sample { t_s, position: vector(3), velocity: vector(6) }),
            "setpoint" => {
                let f32s = |k: usize| [0, 1, 2].map(|axis| number(k + axis) as f32);
                recording.setpoints.push(Setpoint {
                    t_s,
                    mask: number(12) as u16,
                    position: f32s(3),
                    velocity: f32s(6),
                    acceleration: f32s(9),
                    yaw: number(14) as f32,
                });
            }
            _ => {
                let text = cells[15].trim_matches('"');
                if let Some(place) = text.strip_prefix("autopilot origin ") {
                    let numbers: Vec<f64> = place.split(' ').filter_map(|n| n.parse().ok()).collect();
                    recording.origin =
                        Geodetic { lat_deg: numbers[0], lon_deg: numbers[1], alt_m: numbers[2] };
                }
                if text.contains("Stabilize") {
                    recording.autopilot = Personality::Ardupilot;
                }
                if let Some(message) = message(text) {
                    asked.push((t_s, message));
                }
                if let Some(ack) = text.strip_prefix("autopilot ack ") {
                    let mut words = ack.split(' ');
                    let command: u16 = words.next().and_then(|w| w.parse().ok()).expect("an ack's command");
                    let result: u8 = words.nth(1).and_then(|w| w.parse().ok()).expect("an ack's result");
                    let first = asked.iter().position(
                        |(_, message)| matches!(message, Message::Command(_, _, id, _) if *id == command),
                    );
                    if let Some(first) = first {
                        let (at_s, message) = asked.remove(first);
                        if result == 0 {
                            if let Message::Command(.., 400, params) = message {
                                armed = params[0] == 1.0;
                                if armed {
                                    recording.armed_s.0 = t_s;
                                }
                            }
                            recording.messages.push((at_s, message));
                        }
                    }
                }
                if text.starts_with("autopilot disarmed") && armed && t_s > recording.armed_s.0 + 3.0 {
                    recording.armed_s.1 = t_s;
                    armed = false;
                }
                if text.contains("-> Follow") && recording.follow_s.0.is_infinite() {
                    recording.follow_s.0 = t_s;
                }
                if text.contains("-> Land") && recording.follow_s.1.is_infinite() {
                    recording.follow_s.1 = t_s;
                }
            }
        }
    }
    recording.messages.extend(asked.into_iter().filter(|(_, m)| matches!(m, Message::GuidedTimeout(_))));
    recording.messages.sort_by(|a, b| a.0.total_cmp(&b.0));
    recording
}

impl Recording {
    /// The estimates between arming and disarming.
    pub fn flown(&self) -> impl Iterator<Item = &Sample> {
        self.estimate.iter().filter(|s| (self.armed_s.0..=self.armed_s.1).contains(&s.t_s))
    }

    /// Where it stood before it armed, by its estimate, NED.
    fn start(&self) -> Vector3<f64> {
        let before =
            || self.estimate.iter().filter(|s| s.t_s < self.armed_s.0 && s.t_s > self.armed_s.0 - 1.0);
        before().map(|s| s.position).sum::<Vector3<f64>>() / before().count().max(1) as f64
    }

    fn config(&self) -> Config {
        let ned = self.start();
        Config {
            personality: self.autopilot,
            world_origin: self.origin,
            ekf_origin: self.origin,
            start: Point::new(ned.y as f32, ned.x as f32, -ned.z as f32),
            estimator_ready_s: 1.0,
            ..Config::default()
        }
    }

    /// What the estimator had wrong, estimated minus true: ENU metres and m/s at the times of the truth.
    pub fn errors(&self) -> Vec<(f64, Point, Point)> {
        let enu = |v: Vector3<f64>| Point::new(v.y as f32, v.x as f32, -v.z as f32);
        let mut errors = Vec::new();
        let mut later = self.estimate.as_slice();
        for truth in &self.truth {
            while later.len() > 1 && later[1].t_s <= truth.t_s {
                later = &later[1..];
            }
            let [a, b, ..] = later else { break };
            if a.t_s > truth.t_s || b.t_s - a.t_s > 0.3 {
                continue;
            }
            let share = (truth.t_s - a.t_s) / (b.t_s - a.t_s);
            let position = a.position.lerp(&b.position, share) - truth.position;
            let velocity = a.velocity.lerp(&b.velocity, share) - truth.velocity;
            errors.push((truth.t_s, enu(position), enu(velocity)));
        }
        errors
    }

    /// Flies the recorded setpoints and commands; estimates at the times of the recorded ones from arming to disarming.
    ///
    /// # Panics
    /// None for a recording that was read.
    pub fn replay(&self, estimator: Estimator) -> Vec<Sample> {
        let errors = if estimator == Estimator::Recorded { self.errors() } else { Vec::new() };
        let mut errors = errors.iter().peekable();
        let (mut first, mut last) = (None, (0.0, Point::zeros()));
        let config = self.config();
        let mut autopilot = Autopilot::new(&config).expect("a recorded place is one");
        autopilot.land_on_stream_loss();
        let ground_m = config.start.z - config.vehicle.radius_m;
        let clock = if self.autopilot == Personality::Px4 { PX4_CLOCK } else { 1.0 };
        let (mut setpoints, mut messages) =
            (self.setpoints.iter().peekable(), self.messages.iter().peekable());
        let (mut sequence, mut buffer) = (0_u8, [0; 512]);
        let begin_s = self.armed_s.0 - 4.0;
        // What was set before the part that is replayed.
        while let Some((_, message)) = messages.next_if(|(t_s, _)| *t_s < begin_s) {
            feed_message(&mut autopilot, message, &mut sequence);
        }
        while setpoints.next_if(|s| s.t_s < begin_s).is_some() {}
        let mut flown = Vec::new();
        for seen in self.flown() {
            let due_us = |t_s: f64| ((WARM_UP_S + (t_s - begin_s) * clock) * 1e6) as u64;
            while autopilot.time_us() < due_us(seen.t_s) {
                let now_us = autopilot.time_us();
                while let Some((_, message)) = messages.next_if(|(t_s, _)| due_us(*t_s) <= now_us) {
                    feed_message(&mut autopilot, message, &mut sequence);
                }
                while let Some(setpoint) = setpoints.next_if(|s| due_us(s.t_s) <= now_us) {
                    feed_setpoint(&mut autopilot, setpoint, &mut sequence);
                }
                while let Some((t_s, position, velocity)) = errors.next_if(|e| due_us(e.0) <= now_us) {
                    let zero: Point = *first.get_or_insert(*position);
                    let (was_s, was) = core::mem::replace(&mut last, (*t_s, *position));
                    let rate = (position.z - was.z) / (t_s - was_s).max(0.02) as f32;
                    let rate = if t_s - was_s < 0.2 { rate } else { 0.0 };
                    autopilot.set_estimate_error(&(position - zero), velocity, rate);
                }
                autopilot.step(STEP_S as f32, ground_m);
                while autopilot.poll_transmit(&mut buffer) > 0 {}
            }
            let truth = autopilot.truth();
            let ned = |p: &Point| Vector3::new(f64::from(p.y), f64::from(p.x), -f64::from(p.z));
            flown.push(Sample {
                t_s: seen.t_s,
                position: ned(&autopilot.estimate()),
                velocity: ned(&truth.velocity),
            });
        }
        flown
    }

    /// Estimate less setpoint, at the times of the estimates in Follow counted from its begin.
    fn tracking(&self) -> Vec<(f64, Vector3<f64>)> {
        let mut later = self.setpoints.as_slice();
        let mut errors = Vec::new();
        for seen in self.estimate.iter().filter(|s| s.t_s >= self.follow_s.0 && s.t_s < self.follow_s.1) {
            while later.len() > 1 && later[1].t_s <= seen.t_s {
                later = &later[1..];
            }
            let asked = Vector3::from(later[0].position.map(f64::from));
            errors.push((seen.t_s - self.follow_s.0, seen.position - asked));
        }
        errors
    }

    /// How differently another recorded flight of the same mission kept to its setpoints: RMS, metres.
    pub fn spread(&self, other: &Self) -> f64 {
        let (own, others) = (self.tracking(), other.tracking());
        let (mut squares, mut n, mut at) = (0.0, 0_u32, 0);
        for (t_s, error) in &own {
            while at + 1 < others.len() && others[at + 1].0 <= *t_s {
                at += 1;
            }
            if at + 1 < others.len() {
                squares += (others[at].1 - error).norm_squared();
                n += 1;
            }
        }
        (squares / f64::from(n)).sqrt()
    }

    /// Replays and compares.
    pub fn compare(&self, estimator: Estimator) -> Comparison {
        let simulated = self.replay(estimator);
        let pairs: Vec<_> = self.flown().zip(&simulated).collect();
        let apart = |(a, b): &(&Sample, &Sample)| (a.position - b.position).norm();
        let in_follow = |s: &Sample| s.t_s >= self.follow_s.0 && s.t_s < self.follow_s.1;
        let height = |(a, b): &(&Sample, &Sample)| (a.position.z - b.position.z).abs();
        let part = |pick: &dyn Fn(&Sample) -> bool, of: &dyn Fn(&(&Sample, &Sample)) -> f64| {
            Difference::of(pairs.iter().filter(|(a, _)| pick(a)).map(of))
        };
        Comparison {
            whole: part(&|_| true, &apart),
            follow: part(&in_follow, &apart),
            lift_off: part(&|s| s.t_s < self.follow_s.0, &height),
            landing: part(&|s| s.t_s >= self.follow_s.1, &height),
        }
    }
}

/// Root mean square and maximum, metres; NaN where nothing was compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Root of the mean square.
    pub rms: f64,
    /// Greatest.
    pub max: f64,
}

impl Difference {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut squares, mut max, mut n) = (0.0, f64::NAN, 0_u32);
        for value in values {
            squares += value * value;
            max = value.max(max);
            n += 1;
        }
        Self { rms: (squares / f64::from(n)).sqrt(), max }
    }
}

/// Simulated against recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// From arming to disarming.
    pub whole: Difference,
    /// While the mission followed its path.
    pub follow: Difference,
    /// Height alone, from arming to the path.
    pub lift_off: Difference,
    /// Height alone, from the landing's command to disarming.
    pub landing: Difference,
}

fn send(autopilot: &mut Autopilot, bytes: &[u8], sequence: &mut u8) {
    autopilot.handle_bytes(bytes);
    *sequence = sequence.wrapping_add(1);
}

fn feed_message(autopilot: &mut Autopilot, message: &Message, sequence: &mut u8) {
    let mut buffer = [0; 300];
    let length = match message {
        Message::Command(system, component, command, params) => {
            let mut payload = [0; 33];
            for (k, param) in params.iter().enumerate() {
                payload[4 * k..4 * k + 4].copy_from_slice(&param.to_le_bytes());
            }
            payload[28..30].copy_from_slice(&command.to_le_bytes());
            (payload[30], payload[31]) = (1, 1);
            let header = Header { system: *system, component: *component, sequence: *sequence };
            frame::encode_raw(header, COMMAND_LONG.0, COMMAND_LONG.1, &payload, &mut buffer)
        }
        Message::GuidedTimeout(value) => {
            let header = Header { system: 1, component: 191, sequence: *sequence };
            let set = PARAM_SET_DATA {
                param_value: *value,
                target_system: 1,
                target_component: 1,
                param_id: "GUID_TIMEOUT".into(),
                param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            };
            frame::encode(header, &set, &mut buffer)
        }
    };
    send(autopilot, &buffer[..length], sequence);
}

fn feed_setpoint(autopilot: &mut Autopilot, setpoint: &Setpoint, sequence: &mut u8) {
    let message = SET_POSITION_TARGET_LOCAL_NED_DATA {
        time_boot_ms: (autopilot.time_us() / 1000) as u32,
        target_system: 1,
        target_component: 1,
        // The companion knows no other.
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
        type_mask: PositionTargetTypemask::from_bits_truncate(setpoint.mask),
        x: setpoint.position[0],
        y: setpoint.position[1],
        z: setpoint.position[2],
        vx: setpoint.velocity[0],
        vy: setpoint.velocity[1],
        vz: setpoint.velocity[2],
        afx: setpoint.acceleration[0],
        afy: setpoint.acceleration[1],
        afz: setpoint.acceleration[2],
        yaw: setpoint.yaw,
        yaw_rate: 0.0,
    };
    let mut buffer = [0; 300];
    let header = Header { system: 1, component: 191, sequence: *sequence };
    let length = frame::encode(header, &message, &mut buffer);
    send(autopilot, &buffer[..length], sequence);
}
