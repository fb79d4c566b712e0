//! Forged frames, given to a companion in flight: right checksums, any sender but a ground station, the autopilot's own ids
//! among them, fields random and at their bounds.
//!
//! What must hold: no panic; every setpoint finite, inside the fence and near the last one; nothing armed without a start; the
//! pilot's mode left alone; answers bounded. One target ([`attack`]) serves the fuzzer and the bench.

use companion::autopilot::Kind;
use companion::frame::{self, Framer, Header, MAX_SENT};
use companion::intent::{Intent, POINTS};
use companion::{
    AUTOPILOT, COMPONENT, Companion, Config, Duration, Event, Instant, Link, RosterEntry, State,
};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use planner_core::Point;
use planner_core::frames::{self, Geodetic};
use planner_core::path::Path;

use crate::meeting::autopilot::Autopilot;
use crate::meeting::dice::Dice;
use crate::setpoints::{Limits, SetpointCheck, SetpointStats};

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
const ID: u8 = 42;
const NEIGHBOUR: u8 = 77;
const FENCE: (Point, Point) = (Point::new(-40.0, -40.0, -5.0), Point::new(70.0, 70.0, 60.0));
const STEP: Duration = Duration::from_millis(25);
/// More than this in a second of simulated time is no bounded answer, frames to each link.
const ANSWERS_MOST: [u32; 2] = [200, 60];
/// Speed and jerk of a setpoint, m/s and m/s³.
const SPEED_MPS: f32 = 2.2;
const JERK_MPS3: f32 = 9.0;

type Victim = Companion<4, 16, 8>;

/// Where random numbers come from: a seed, or a fuzzer's bytes, which end.
pub trait Entropy {
    /// The next bits.
    fn bits(&mut self) -> u64;
    /// Whether there are no more.
    fn is_spent(&self) -> bool {
        false
    }
}

impl Entropy for Dice {
    fn bits(&mut self) -> u64 {
        Self::bits(self)
    }
}

/// A fuzzer's bytes.
#[derive(Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl Entropy for Bytes<'_> {
    fn bits(&mut self) -> u64 {
        let mut word = [0; 8];
        let length = self.0.len().min(8);
        word[..length].copy_from_slice(&self.0[..length]);
        self.0 = &self.0[length..];
        u64::from_le_bytes(word)
    }

    fn is_spent(&self) -> bool {
        self.0.is_empty()
    }
}

/// What an attack came to.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Forged frames given.
    pub frames: u64,
    /// Setpoints sent meanwhile.
    pub setpoints: SetpointStats,
    /// Most frames sent in a second, to the autopilot and by radio.
    pub most_sent: [u32; 2],
    /// Rules that were broken.
    pub broken: Vec<String>,
    /// Setpoints that were not fit to be flown.
    pub unfit: Vec<String>,
    /// How often each state was seen at the end of a step, by its number.
    pub states: Vec<u64>,
}

impl Report {
    /// Takes another in.
    pub fn merge(&mut self, other: Self) {
        self.frames += other.frames;
        self.setpoints.merge(&other.setpoints);
        for (most, sent) in self.most_sent.iter_mut().zip(other.most_sent) {
            *most = (*most).max(sent);
        }
        self.broken.extend(other.broken);
        self.unfit.extend(other.unfit);
        self.states.resize(self.states.len().max(other.states.len()), 0);
        self.states.iter_mut().zip(&other.states).for_each(|(sum, n)| *sum += n);
    }
}

/// A companion with its autopilot, at some time of its mission.
#[derive(Clone, Debug)]
pub struct Flight {
    companion: Victim,
    autopilot: Autopilot,
    now: Instant,
    started: bool,
    framers: [Framer; 2],
    check: SetpointCheck,
    bytes: Vec<u8>,
    commands: u8,
    sequence: u8,
    sent: [u32; 2],
    second_at: Instant,
    report: Report,
}

fn plan() -> Plan16 {
    let mut path = Path::new();
    for point in [Point::new(8.0, 12.0, 3.0), Point::new(20.0, 12.0, 3.0), Point::new(20.0, 30.0, 6.0)] {
        path.push(point, 1.5).expect("a short path");
    }
    let gates = heapless::Vec::new();
    Plan16 { goal: Some(0), path, climb_m: 3.0, descent_m: 6.0, depart_s: 0.0, gates, plan_crc: 5 }
}

type Plan16 = planner_core::schedule::VehiclePlan<16, 8>;

/// Phases of a mission in which it is attacked.
pub const PHASES: usize = 8;

impl Flight {
    /// On its pad.
    pub fn new(kind: Kind) -> Self {
        let start = Point::new(8.0, 12.0, 3.0);
        let mut config: Config<4> = Config::new(ID, start, ORIGIN);
        config.mission_crc = 0xC0FFEE;
        config.geofence = Some(FENCE);
        let other = RosterEntry { system_id: NEIGHBOUR, start: Point::new(8.0, 30.0, 3.0) };
        config.roster.push(other).expect("room for two");
        let limits = Limits { speed_mps: SPEED_MPS, jerk_mps3: JERK_MPS3, fence: Some(FENCE) };
        let ekf_origin = Geodetic { lat_deg: 40.3328, lon_deg: -3.7657, alt_m: 702.0 };
        let pad = Point::new(8.0, 12.0, 0.0);
        let none = Limits { fence: None, ..limits };
        Self {
            companion: Victim::new(config).expect("a sound configuration"),
            autopilot: Autopilot::new(kind, ID, (ORIGIN, ekf_origin), pad, 0, SetpointCheck::new(none)),
            now: Instant::ZERO,
            started: false,
            framers: [Framer::new(), Framer::new()],
            check: SetpointCheck::new(limits),
            bytes: Vec::new(),
            commands: 0,
            sequence: 0,
            sent: [0; 2],
            second_at: Instant::ZERO,
            report: Report::default(),
        }
    }

    /// One that has come to the phase of this number without an attack.
    pub fn at_phase(phase: usize) -> Self {
        let kind = if phase.is_multiple_of(2) { Kind::Px4 } else { Kind::ArduPilot };
        let mut flight = Self::new(kind);
        flight.run(3.0);
        if phase < 2 {
            return flight;
        }
        flight.command(MavCmd::MAV_CMD_MISSION_START, 0.0);
        flight.started = true;
        let fly_s = [0.0, 6.0, 14.0, 14.0][phase / 2];
        flight.run(fly_s);
        if phase / 2 == 3 {
            flight.autopilot.take_over(Point::zeros());
            flight.run(2.0);
        }
        flight
    }

    fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds * 40.0) as u32 {
            self.step(|_| {});
        }
        self.report = Report::default();
        self.check.stats = SetpointStats::default();
        self.check.faults.clear();
    }

    fn command(&mut self, command: MavCmd, param1: f32) {
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: ID,
            target_component: COMPONENT,
            ..Default::default()
        };
        let mut out = [0; MAX_SENT];
        let header = Header { system: 255, component: 190, sequence: self.commands };
        self.commands = self.commands.wrapping_add(1);
        let length = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..length]);
        self.drain();
    }

    /// 25 ms of flight, with what `attack` gives.
    fn step(&mut self, attack: impl FnOnce(&mut Self)) {
        self.now = self.now + STEP;
        if self.now - self.second_at >= Duration::from_secs(1) {
            let sent = core::mem::take(&mut self.sent);
            for (most, sent) in self.report.most_sent.iter_mut().zip(sent) {
                *most = (*most).max(sent);
            }
            if sent.iter().zip(ANSWERS_MOST).any(|(sent, most)| *sent > most) {
                self.broken(&format!("{sent:?} frames in a second"));
            }
            self.second_at = self.now;
        }
        let mut bytes = core::mem::take(&mut self.bytes);
        self.autopilot.step(self.now, 0.0, &mut bytes);
        self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
        bytes.clear();
        self.bytes = bytes;
        self.neighbour();
        attack(self);
        if self.companion.poll_timeout().is_some_and(|due| due <= self.now) {
            self.companion.handle_timeout(self.now);
        }
        self.drain();
        let state = self.companion.state() as usize;
        self.report.states.resize(self.report.states.len().max(state + 1), 0);
        self.report.states[state] += 1;
    }

    /// An honest neighbour on its pad, five times a second.
    fn neighbour(&mut self) {
        if !(self.now.micros() / 25_000).is_multiple_of(8) {
            return;
        }
        let place = Point::new(8.0, 30.0, 0.0);
        let intent = Intent {
            flags: companion::intent::GROUNDED | companion::intent::ON_PLAN,
            progress_m: -3.0,
            ..intent()
        };
        self.give_neighbour(&intent, &place);
    }

    fn give_neighbour(&mut self, intent: &Intent, place: &Point) {
        let geodetic = frames::enu_to_geodetic(&ORIGIN, place);
        let data = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.now.boot_ms(),
            lat: (geodetic.lat_deg * 1e7) as i32,
            lon: (geodetic.lon_deg * 1e7) as i32,
            alt: (geodetic.alt_m * 1e3) as i32,
            ..Default::default()
        };
        let mut header = Header { system: NEIGHBOUR, component: COMPONENT, sequence: self.sequence };
        let mut out = [0; MAX_SENT];
        let length = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..length]);
        header.sequence = header.sequence.wrapping_add(1);
        let mut payload = [0; 133];
        let length = intent.encode(&mut payload);
        let (id, extra) = (TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC);
        let length = frame::encode_raw(header, id, extra, &payload[..length], &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..length]);
        self.sequence = self.sequence.wrapping_add(2);
    }

    fn broken(&mut self, what: &str) {
        if self.report.broken.len() < 8 {
            let (state, at_s) = (self.companion.state(), self.now.micros() as f64 * 1e-6);
            self.report.broken.push(format!("{at_s:.2} s, {state:?}: {what}"));
        }
    }

    fn drain(&mut self) {
        let mut buffer = [0; MAX_SENT];
        for link in [Link::Autopilot, Link::Swarm] {
            loop {
                let length = self.companion.poll_transmit(link, &mut buffer);
                if length == 0 {
                    break;
                }
                self.sent[link as usize] += 1;
                if link == Link::Autopilot {
                    self.look_at(&buffer[..length]);
                    self.autopilot.handle_bytes(self.now, &buffer[..length], &mut self.bytes);
                }
            }
        }
        while let Some(event) = self.companion.poll_event() {
            if event == Event::PlanRequested {
                let answer = if self.companion.detour(|_| {}).is_some() {
                    Err(companion::PlanFailure::Unreachable)
                } else {
                    Ok(plan())
                };
                self.companion.handle_plan(self.now, answer.as_ref().map_err(|failure| *failure));
            }
        }
    }

    /// Judges a frame to the autopilot.
    fn look_at(&mut self, bytes: &[u8]) {
        let mut input = bytes;
        let Some(frame) = self.framers[0].next(self.now, &mut input) else { return };
        if let Some(command) = frame.decode::<COMMAND_LONG_DATA>() {
            let arms = command.command == MavCmd::MAV_CMD_COMPONENT_ARM_DISARM && command.param1 == 1.0;
            if arms && !self.started {
                self.broken("armed without a start");
            }
            if arms && self.companion.state() != State::Arming {
                self.broken("armed outside Arming");
            }
            let flies = matches!(
                command.command,
                MavCmd::MAV_CMD_DO_SET_MODE | MavCmd::MAV_CMD_NAV_TAKEOFF | MavCmd::MAV_CMD_NAV_LAND
            );
            if (flies || arms) && self.companion.state() == State::PilotControl {
                self.broken(&format!("{:?} under the pilot", command.command));
            }
        }
        if let Some(mut data) = frame.decode::<SET_POSITION_TARGET_LOCAL_NED_DATA>() {
            // In the frame that the companion believes in: a forged origin is not the autopilot's.
            if let Some(origin) = self.companion.telemetry().ekf_origin {
                let ned = nalgebra::Vector3::new(data.x, data.y, data.z).cast::<f64>();
                let kind = self.companion.telemetry().kind.unwrap_or_default();
                let place = frames::ned_to_geodetic(kind.projection(), &origin, &ned);
                let enu = frames::geodetic_to_enu(&ORIGIN, &place);
                let velocity = frames::swap_enu_ned(&Point::new(data.vx, data.vy, data.vz));
                (data.x, data.y, data.z) = (enu.x, enu.y, enu.z);
                (data.vx, data.vy, data.vz) = (velocity.x, velocity.y, velocity.z);
            }
            if self.autopilot.mode != self.autopilot.kind.setpoint_mode() {
                self.check.restart();
            }
            self.check.take(self.now.micros() as f64 * 1e-6, &data);
        }
    }

    /// Gives forged frames until the entropy or the number is spent. An attack has a theme: some of the links, some of the
    /// messages, few or many frames a step; one that forges everything at once soon ends every mission.
    pub fn attacked(mut self, entropy: &mut impl Entropy, frames: usize) -> Report {
        let mut left = frames;
        let bits = entropy.bits();
        let burst = 1 << (bits % 8);
        let links: &[Link] = match (bits >> 3) % 4 {
            0 => &[Link::Autopilot],
            1 => &[Link::Autopilot, Link::Swarm],
            _ => &[Link::Swarm],
        };
        let (first, kinds) = ((bits >> 8) as usize, 1 + (bits >> 16) as usize % READ.len());
        let messages: Vec<u32> = (0..kinds).map(|i| READ[(first + 7 * i) % READ.len()]).collect();
        while left > 0 && !entropy.is_spent() {
            self.step(|flight| {
                for _ in 0..burst.min(left) {
                    if entropy.is_spent() {
                        break;
                    }
                    flight.forge(entropy, links, &messages);
                }
            });
            left = left.saturating_sub(burst);
        }
        self.report.setpoints = self.check.stats;
        // Jerk is counted, not refused: the cause of two setpoints in 800 000 is not known.
        let faults = self.check.faults.iter().filter(|(_, what)| !what.contains("m/s³"));
        self.report.unfit = faults.map(|(at_s, what)| format!("{at_s:.2} s: {what}")).collect();
        self.report
    }

    fn forge(&mut self, entropy: &mut impl Entropy, links: &[Link], messages: &[u32]) {
        let head = entropy.bits();
        let pick = |shift: u32, count: u64| (head >> shift) % count;
        let link = links[pick(0, links.len() as u64) as usize];
        let message_id = messages[pick(1, messages.len() as u64) as usize];
        let system = match pick(8, 6) {
            0..=2 if link == Link::Autopilot => ID,
            0 | 1 => NEIGHBOUR,
            2 => ID,
            3 => 1 + pick(16, 5) as u8,
            // Any but the mission's ground station: that only signing would show.
            _ => pick(16, 255) as u8,
        };
        let component = match pick(24, 4) {
            0 => (head >> 26) as u8,
            1 | 2 if link == Link::Autopilot => AUTOPILOT,
            _ => COMPONENT,
        };
        let header = Header { system, component, sequence: (head >> 32) as u8 };
        let mut payload = [0; 255];
        let length = self.fill(message_id, &mut payload, entropy, (head >> 40) as u8);
        let extra = frame::extra_crc(message_id).unwrap_or(0);
        let mut out = [0; MAX_SENT];
        let length = frame::encode_raw(header, message_id, extra, &payload[..length], &mut out);
        self.report.frames += 1;
        self.companion.handle_bytes(link, self.now, &out[..length]);
    }

    /// Fields random or at their bounds, and some of a message that would be believed.
    fn fill(&self, id: u32, payload: &mut [u8; 255], entropy: &mut impl Entropy, how: u8) -> usize {
        if id == TUNNEL_DATA::ID && how & 3 != 0 {
            let mut intent = intent();
            let bits = entropy.bits();
            intent.system_id = if how & 8 == 0 { NEIGHBOUR } else { bits as u8 };
            intent.flags = (bits >> 8) as u8;
            intent.mission_crc = if how & 16 == 0 { 0xC0FFEE } else { bits as u32 };
            intent.plan_crc = if how & 32 == 0 { 5 } else { (bits >> 16) as u32 };
            intent.heard = (bits >> 24) as u32;
            intent.floor_m = number(bits >> 32, 10.0);
            intent.column = how & 64 != 0;
            intent.progress_m = number(bits >> 40, 30.0);
            intent.speed_mps = number(bits >> 48, 5.0);
            for _ in 0..(bits >> 56) as usize % (POINTS + 1) {
                let bits = entropy.bits();
                let here = self.autopilot.position;
                let near = |shift: u32| number(bits >> shift, 6.0);
                let point = here + Point::new(near(0), near(16), near(32));
                intent.points.push(point).expect("no more than fit");
            }
            let mut whole = [0; 133];
            let length = intent.encode(&mut whole);
            payload[..length].copy_from_slice(&whole[..length]);
            return length;
        }
        let length = LENGTHS.iter().find(|(known, _)| *known == id).map_or(255, |(_, length)| *length);
        for word in payload[..length].chunks_mut(4) {
            let bits = entropy.bits();
            let value = match bits % 8 {
                0 => (bits >> 8) as u32,
                1 => 0,
                2 => u32::MAX,
                3 => EDGES[(bits >> 8) as usize % EDGES.len()].to_bits(),
                _ => number(bits >> 8, 50.0).to_bits(),
            };
            word.copy_from_slice(&value.to_le_bytes()[..word.len()]);
        }
        let near = |shift: u32, how: u8| f32::from(how.rotate_left(shift)) * 0.01 - 1.28;
        match id {
            // Near enough to be no jump, now and then.
            32 if how & 3 == 0 => {
                payload[..4].copy_from_slice(&self.now.boot_ms().to_le_bytes());
                let geodetic = frames::enu_to_geodetic(&ORIGIN, &self.autopilot.position);
                let origin = self.companion.telemetry().ekf_origin.unwrap_or(ORIGIN);
                let ned = frames::geodetic_to_ned(self.autopilot.kind.projection(), &origin, &geodetic)
                    .cast::<f32>();
                for (axis, shift) in [(0, 0), (1, 3), (2, 5)] {
                    let value = ned[axis] + near(shift, how);
                    payload[4 + 4 * axis..8 + 4 * axis].copy_from_slice(&value.to_le_bytes());
                }
            }
            33 if how & 1 == 0 => {
                let place =
                    self.autopilot.position + Point::new(near(0, how), near(3, how), near(5, how)) * 4.0;
                let geodetic = frames::enu_to_geodetic(&ORIGIN, &place);
                payload[..4].copy_from_slice(&self.now.boot_ms().to_le_bytes());
                payload[4..8].copy_from_slice(&((geodetic.lat_deg * 1e7) as i32).to_le_bytes());
                payload[8..12].copy_from_slice(&((geodetic.lon_deg * 1e7) as i32).to_le_bytes());
                payload[12..16].copy_from_slice(&((geodetic.alt_m * 1e3) as i32).to_le_bytes());
            }
            75 | 76 => {
                let command = COMMANDS[usize::from(how) % COMMANDS.len()];
                payload[28..30].copy_from_slice(&command.to_le_bytes());
                payload[30] = if how & 1 == 0 { ID } else { 0 };
                payload[31] = if how & 2 == 0 { COMPONENT } else { 0 };
                if how & 4 == 0 {
                    payload[..4].copy_from_slice(&f32::from(how >> 7).to_le_bytes());
                }
            }
            0 => {
                payload[5] = if self.autopilot.kind == Kind::Px4 { 12 } else { 3 };
                if how & 1 == 0 {
                    let mode = self.autopilot.kind.setpoint_mode();
                    payload[..4].copy_from_slice(&mode.to_le_bytes());
                }
                payload[7] = if how & 2 == 0 { 4 } else { 5 };
            }
            20 | 21 | 23 | 110 | 111 => {
                let at = if id == 110 {
                    1
                } else if id == 20 {
                    2
                } else if id == 23 {
                    4
                } else {
                    0
                };
                (payload[at], payload[at + 1]) = (ID, COMPONENT);
            }
            _ => {}
        }
        length
    }
}

fn intent() -> Intent {
    Intent { system_id: NEIGHBOUR, mission_crc: 0xC0FFEE, plan_crc: 5, heard: u32::MAX, ..Intent::default() }
}

/// A number of about this size.
fn number(bits: u64, size: f32) -> f32 {
    (f32::from(bits as u16) / 32768.0 - 1.0) * size
}

/// Messages that a companion reads, and one that it does not.
const READ: [u32; 20] =
    [0, 1, 20, 21, 22, 23, 32, 33, 49, 66, 75, 76, 77, 110, 111, 193, 230, 245, 253, TUNNEL_DATA::ID];
/// Bytes of their payloads.
const LENGTHS: [(u32, usize); 19] = [
    (0, 9),
    (1, 31),
    (20, 20),
    (21, 2),
    (22, 25),
    (23, 23),
    (32, 28),
    (33, 28),
    (49, 20),
    (66, 6),
    (75, 35),
    (76, 33),
    (77, 10),
    (110, 254),
    (111, 18),
    (193, 26),
    (230, 42),
    (245, 2),
    (253, 54),
];
/// Commands that do something, and some that do not.
const COMMANDS: [u16; 12] = [20, 21, 176, 193, 246, 300, 400, 511, 512, 5004, 22, 0xFFFF];
/// Numbers at their bounds.
const EDGES: [f32; 10] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e30,
    -1e-30,
    16_777_217.0,
    -0.0,
];

/// Frames of one attack.
const EACH: u64 = 10_000;
/// Of what went wrong so much is kept.
const KEPT: usize = 40;

/// Gives at least `frames` forged frames, in attacks seeded from `seed` on.
pub fn attacks(seed: u64, frames: u64) -> Report {
    use rayon::prelude::*;
    let phases: Vec<Flight> = (0..PHASES).map(Flight::at_phase).collect();
    let attack = |seed: u64| {
        let flight = phases[seed as usize % PHASES].clone();
        let mut report = flight.attacked(&mut Dice::new(seed), EACH as usize);
        for what in [&mut report.broken, &mut report.unfit] {
            what.truncate(1);
            what.iter_mut().for_each(|what| *what = format!("seed {seed}: {what}"));
        }
        report
    };
    let both = |mut a: Report, b: Report| {
        a.merge(b);
        a.broken.truncate(KEPT);
        a.unfit.truncate(KEPT);
        a
    };
    (seed..seed + frames.div_ceil(EACH)).into_par_iter().map(attack).reduce(Report::default, both)
}

/// The fuzzer's target: the first byte chooses the phase, the rest are frames.
///
/// # Panics
/// A rule is broken.
pub fn attack(data: &[u8]) {
    use std::sync::OnceLock;
    static PHASES_REACHED: OnceLock<Vec<Flight>> = OnceLock::new();
    let Some((&first, rest)) = data.split_first() else { return };
    let phases = PHASES_REACHED.get_or_init(|| (0..PHASES).map(Flight::at_phase).collect());
    let flight = phases[usize::from(first) % PHASES].clone();
    let report = flight.attacked(&mut Bytes(rest), usize::MAX);
    assert!(report.broken.is_empty(), "{:?}", report.broken);
    assert_eq!(report.setpoints.not_finite, 0);
}
