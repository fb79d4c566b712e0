//! Gives forged frames to a companion in flight: right checksums, any sender but a ground station,
//! the autopilot's own ids among them, fields random and at their bounds.
//!
//! What must hold: no panic; every setpoint finite, inside the fence and near the last one; no
//! arming without a start; the pilot's mode left alone; a bounded number of answers. One target
//! ([`attack_with_bytes`]) serves the fuzzer and the bench.

use core::ops::Range;

use companion::autopilot::AutopilotKind;
use companion::link::frame::{self, Framer, Header, MAX_FRAME_LEN};
use companion::link::intent::Intent;
use companion::{
    COMPANION_COMPONENT, Companion, Config, Duration, Event, Instant, Link, RosterEntry, State,
};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use planner_core::Point;
use planner_core::flight::{self, HeadingMode, Path, PicturePlan, Task, Trigger};
use planner_core::geo::frames::{self, Geodetic};

use crate::meeting::autopilot::Autopilot;
use crate::meeting::dice::Dice;
use crate::setpoints::{SetpointCheck, SetpointLimits, SetpointStats, rounding_m};

mod entropy;
mod forge;

pub use self::entropy::{Entropy, FuzzBytes};

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
const VICTIM_ID: u8 = 42;
const NEIGHBOUR_ID: u8 = 77;
const FENCE: (Point, Point) = (Point::new(-40.0, -40.0, -5.0), Point::new(70.0, 70.0, 60.0));
const STEP: Duration = Duration::from_millis(25);
/// Most frames that a companion may send in a second of simulated time, to the autopilot and by
/// radio.
const MAX_FRAMES_PER_S: [u32; 2] = [200, 60];
/// Ids of the messages that a companion reads, and of one that it does not.
const READ_MESSAGE_IDS: [u32; 20] = [
    0,
    1,
    20,
    21,
    22,
    23,
    32,
    33,
    49,
    66,
    75,
    76,
    77,
    110,
    111,
    193,
    230,
    245,
    253,
    TUNNEL_DATA::ID,
];
/// Speed limit of setpoints, m/s.
const MAX_SETPOINT_SPEED_MPS: f32 = 2.2;

type Victim = Companion<4, 16, 8>;

/// What an attack found.
#[derive(Clone, Debug, Default)]
pub struct AttackReport {
    /// Number of forged frames given to the companion.
    pub frames: u64,
    /// Statistics of the setpoints sent during the attack.
    pub setpoints: SetpointStats,
    /// Most frames sent in a second, to the autopilot and by radio.
    pub max_sent_per_s: [u32; 2],
    /// Rules that the companion broke: time, state and what it did.
    pub broken_rules: Vec<String>,
    /// Setpoints that were not fit to be flown: time and why.
    pub unfit_setpoints: Vec<String>,
    /// Number of steps that ended in each state, by the state's number.
    pub steps_in_state: Vec<u64>,
}

impl AttackReport {
    /// Adds the findings of another attack.
    pub fn merge(&mut self, other: Self) {
        self.frames += other.frames;
        self.setpoints.merge(&other.setpoints);
        for (most, sent) in self.max_sent_per_s.iter_mut().zip(other.max_sent_per_s) {
            *most = (*most).max(sent);
        }
        self.broken_rules.extend(other.broken_rules);
        self.unfit_setpoints.extend(other.unfit_setpoints);
        self.steps_in_state.resize(self.steps_in_state.len().max(other.steps_in_state.len()), 0);
        self.steps_in_state.iter_mut().zip(&other.steps_in_state).for_each(|(sum, n)| *sum += n);
    }
}

/// A companion under attack with its simulated autopilot, at some time of its mission.
#[derive(Clone, Debug)]
pub struct AttackedFlight {
    companion: Victim,
    autopilot: Autopilot,
    now: Instant,
    started: bool,
    framer: Framer,
    setpoint_check: SetpointCheck,
    /// Bytes that the autopilot sends to the companion in the next step.
    bytes: Vec<u8>,
    /// Sequence number of the ground station's next command.
    command_sequence: u8,
    /// Sequence number of the honest neighbour's next frame.
    sequence: u8,
    sent_in_second: [u32; 2],
    second_began: Instant,
    report: AttackReport,
    mission: Mission,
}

/// What the vehicle under attack has to do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mission {
    /// It flies to a goal.
    Goal,
    /// It photographs an area, so that the fleet divides the work of a lost vehicle.
    Area,
}

fn victim_plan(mission: Mission) -> Plan16 {
    let mut path = Path::new();
    for point in
        [Point::new(8.0, 12.0, 3.0), Point::new(20.0, 12.0, 3.0), Point::new(20.0, 30.0, 6.0)]
    {
        path.push(point, 1.5).expect("a short path");
    }
    let gates = heapless::Vec::new();
    let mut photographs = PicturePlan::new(3.0, HeadingMode::Ahead, Trigger::Distance);
    photographs
        .add_stretch(1, 1, flight::WaypointRange { first: 0, end: 1 })
        .expect("room for one");
    let task = match mission {
        Mission::Goal => Task::Goto(0),
        Mission::Area => Task::Photograph(photographs),
    };
    Plan16 { task, path, climb_m: 3.0, descent_m: 6.0, depart_s: 0.0, gates, swarm_plan_crc: 5 }
}

type Plan16 = planner_core::flight::VehiclePlan<16, 8>;

/// Number of phases of a mission in which the companion is attacked: on the pad, 6 s after the
/// start, 14 s after it, and under the pilot, each with PX4 and with ArduPilot.
pub const PHASE_COUNT: usize = 8;

impl AttackedFlight {
    /// A vehicle on its pad, just switched on.
    fn new(kind: AutopilotKind, mission: Mission) -> Self {
        let start = Point::new(8.0, 12.0, 3.0);
        let mut config: Config<4> = Config::new(VICTIM_ID, start, ORIGIN);
        config.mission_crc = 0xC0FFEE;
        config.geofence = Some(FENCE);
        config.lost_vehicle_down_after_s = (mission == Mission::Area).then_some(60.0);
        let other = RosterEntry { system_id: NEIGHBOUR_ID, path_start: Point::new(8.0, 30.0, 3.0) };
        config.roster.push(other).expect("room for two");
        let limits = SetpointLimits { max_speed_mps: MAX_SETPOINT_SPEED_MPS, fence: Some(FENCE) };
        let ekf_origin = Geodetic { lat_deg: 40.3328, lon_deg: -3.7657, alt_m: 702.0 };
        let pad = Point::new(8.0, 12.0, 0.0);
        let none = SetpointLimits { fence: None, ..limits };
        Self {
            companion: Victim::new(config).expect("a sound configuration"),
            autopilot: Autopilot::new(
                kind,
                VICTIM_ID,
                (ORIGIN, ekf_origin),
                pad,
                0,
                SetpointCheck::new(none),
            ),
            now: Instant::ZERO,
            started: false,
            framer: Framer::new(),
            setpoint_check: SetpointCheck::new(limits),
            bytes: Vec::new(),
            command_sequence: 0,
            sequence: 0,
            sent_in_second: [0; 2],
            second_began: Instant::ZERO,
            report: AttackReport::default(),
            mission,
        }
    }

    /// A flight brought to this phase without an attack; phases from [`PHASE_COUNT`] on are the
    /// same phases in a coverage mission.
    pub fn at_phase(phase: usize) -> Self {
        let kind =
            if phase.is_multiple_of(2) { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let mission = if phase >= PHASE_COUNT { Mission::Area } else { Mission::Goal };
        let mut flight = Self::new(kind, mission);
        let phase = phase % PHASE_COUNT;
        flight.run_without_attack(3.0);
        if phase < 2 {
            return flight;
        }
        flight.command(MavCmd::MAV_CMD_MISSION_START, 0.0);
        flight.started = true;
        let fly_s = [0.0, 6.0, 14.0, 14.0][phase / 2];
        flight.run_without_attack(fly_s);
        if phase / 2 == 3 {
            flight.autopilot.pilot_takes_over(Point::zeros());
            flight.run_without_attack(2.0);
        }
        flight
    }

    fn run_without_attack(&mut self, seconds: f32) {
        for _ in 0..(seconds * 40.0) as u32 {
            self.step(|_| {});
        }
        self.report = AttackReport::default();
        self.setpoint_check.stats = SetpointStats::default();
        self.setpoint_check.faults.clear();
    }

    fn command(&mut self, command: MavCmd, param1: f32) {
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: VICTIM_ID,
            target_component: COMPANION_COMPONENT,
            ..Default::default()
        };
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: 255, component: 190, sequence: self.command_sequence };
        self.command_sequence = self.command_sequence.wrapping_add(1);
        let length = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..length]);
        self.drain();
    }

    /// One step of 25 ms, in which `attack` may give the companion frames.
    fn step(&mut self, attack: impl FnOnce(&mut Self)) {
        self.now = self.now + STEP;
        if self.now - self.second_began >= Duration::from_secs(1) {
            let sent = core::mem::take(&mut self.sent_in_second);
            for (most, sent) in self.report.max_sent_per_s.iter_mut().zip(sent) {
                *most = (*most).max(sent);
            }
            if sent.iter().zip(MAX_FRAMES_PER_S).any(|(sent, most)| *sent > most) {
                self.note_broken_rule(&format!("{sent:?} frames in a second"));
            }
            self.second_began = self.now;
        }
        let mut bytes = core::mem::take(&mut self.bytes);
        self.autopilot.step(self.now, 0.0, &mut bytes);
        self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
        bytes.clear();
        self.bytes = bytes;
        self.report_honest_neighbour();
        attack(self);
        if self.companion.poll_timeout().is_some_and(|due| due <= self.now) {
            self.companion.handle_timeout(self.now);
        }
        self.drain();
        let state = self.companion.state() as usize;
        self.report.steps_in_state.resize(self.report.steps_in_state.len().max(state + 1), 0);
        self.report.steps_in_state[state] += 1;
    }

    /// An honest neighbour that stands on its pad reports its intent and position, five times a
    /// second.
    fn report_honest_neighbour(&mut self) {
        if !(self.now.as_micros() / 25_000).is_multiple_of(8) {
            return;
        }
        let place = Point::new(8.0, 30.0, 0.0);
        let intent = Intent {
            flags: companion::link::intent::GROUNDED | companion::link::intent::ON_PLAN,
            progress_m: -3.0,
            ..neighbour_intent()
        };
        self.deliver_neighbour_report(&intent, &place);
    }

    fn deliver_neighbour_report(&mut self, intent: &Intent, place: &Point) {
        let geodetic = frames::enu_to_geodetic(&ORIGIN, place);
        let data = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.now.as_boot_ms(),
            lat: (geodetic.lat_deg * 1e7) as i32,
            lon: (geodetic.lon_deg * 1e7) as i32,
            alt: (geodetic.alt_m * 1e3) as i32,
            ..Default::default()
        };
        let mut header = Header {
            system: NEIGHBOUR_ID,
            component: COMPANION_COMPONENT,
            sequence: self.sequence,
        };
        let mut out = [0; MAX_FRAME_LEN];
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

    fn note_broken_rule(&mut self, what: &str) {
        if self.report.broken_rules.len() < 8 {
            let (state, at_s) = (self.companion.state(), self.now.as_micros() as f64 * 1e-6);
            self.report.broken_rules.push(format!("{at_s:.2} s, {state:?}: {what}"));
        }
    }

    fn drain(&mut self) {
        let mut buffer = [0; MAX_FRAME_LEN];
        for link in [Link::Autopilot, Link::Swarm] {
            loop {
                let length = self.companion.poll_transmit(link, &mut buffer);
                if length == 0 {
                    break;
                }
                self.sent_in_second[link as usize] += 1;
                if link == Link::Autopilot {
                    self.check_frame(&buffer[..length]);
                    self.autopilot.handle_bytes(self.now, &buffer[..length], &mut self.bytes);
                }
            }
        }
        while let Some(event) = self.companion.poll_event() {
            if let Event::PlanRequested(wanted) = event {
                let answer = if self.companion.detour_request(|_| {}).is_some() {
                    Err(companion::PlanFailure::Unreachable)
                } else {
                    Ok(victim_plan(self.mission))
                };
                self.companion.handle_plan(
                    self.now,
                    wanted,
                    answer.as_ref().map_err(|failure| *failure),
                );
            }
        }
    }

    /// Checks a frame to the autopilot against the rules.
    fn check_frame(&mut self, bytes: &[u8]) {
        let mut input = bytes;
        let Some(frame) = self.framer.next(self.now, &mut input) else { return };
        if let Some(command) = frame.decode::<COMMAND_LONG_DATA>() {
            let arms =
                command.command == MavCmd::MAV_CMD_COMPONENT_ARM_DISARM && command.param1 == 1.0;
            if arms && !self.started {
                self.note_broken_rule("armed without a start");
            }
            if arms && self.companion.state() != State::Arming {
                self.note_broken_rule("armed outside Arming");
            }
            let flies = matches!(
                command.command,
                MavCmd::MAV_CMD_DO_SET_MODE
                    | MavCmd::MAV_CMD_NAV_TAKEOFF
                    | MavCmd::MAV_CMD_NAV_LAND
            );
            if (flies || arms) && self.companion.state() == State::PilotControl {
                self.note_broken_rule(&format!("{:?} under the pilot", command.command));
            }
        }
        if let Some(mut data) = frame.decode::<SET_POSITION_TARGET_LOCAL_NED_DATA>() {
            // Checked by the EKF origin that the companion believes: a forged one is not the
            // autopilot's.
            self.setpoint_check.extra_rounding_m = rounding_m(&data);
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
                self.setpoint_check.begin_stream();
            }
            // While the autopilot's reported mode takes no setpoints, setpoints follow the vehicle.
            let telemetry = self.companion.telemetry();
            self.setpoint_check.follows_vehicle =
                telemetry.custom_mode != telemetry.kind.unwrap_or_default().setpoint_mode();
            self.setpoint_check.in_urgent_stop = self.companion.is_in_urgent_stop();
            self.setpoint_check.check_setpoint(self.now.as_micros() as f64 * 1e-6, &data);
        }
    }

    /// Gives forged frames until `entropy` is spent or `frames` are given. Each attack has a theme:
    /// some of the links, some of the messages, few or many frames a step. An attack that forged
    /// everything at once would soon end every mission.
    pub fn run_attack(mut self, entropy: &mut impl Entropy, frames: usize) -> AttackReport {
        let mut left = frames;
        let bits = entropy.bits();
        let burst = 1 << (bits % 8);
        let links: &[Link] = match (bits >> 3) % 4 {
            0 => &[Link::Autopilot],
            1 => &[Link::Autopilot, Link::Swarm],
            _ => &[Link::Swarm],
        };
        let (first, kinds) =
            ((bits >> 8) as usize, 1 + (bits >> 16) as usize % READ_MESSAGE_IDS.len());
        let messages: Vec<u32> = (0..kinds)
            .map(|i| READ_MESSAGE_IDS[(first + 7 * i) % READ_MESSAGE_IDS.len()])
            .collect();
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
        self.report.setpoints = self.setpoint_check.stats;
        let faults = self.setpoint_check.faults.iter();
        self.report.unfit_setpoints =
            faults.map(|(at_s, what)| format!("{at_s:.2} s: {what}")).collect();
        self.report
    }
}

fn neighbour_intent() -> Intent {
    Intent {
        system_id: NEIGHBOUR_ID,
        mission_crc: 0xC0FFEE,
        plan_crc: 5,
        heard_bits: u32::MAX,
        ..Intent::default()
    }
}

/// Number of forged frames of one attack.
const FRAMES_PER_ATTACK: u64 = 10_000;
/// Most findings that are kept, of each kind.
const MAX_KEPT_FINDINGS: usize = 40;

/// Gives at least `frames` forged frames to flights with a goal, in attacks with seeds from `seed`
/// on.
pub fn attacks(seed: u64, frames: u64) -> AttackReport {
    attacks_in(0..PHASE_COUNT, seed, frames)
}

/// As [`attacks`], to vehicles that photograph an area, with roster reports among the frames.
pub fn attacks_over_area(seed: u64, frames: u64) -> AttackReport {
    attacks_in(PHASE_COUNT..2 * PHASE_COUNT, seed, frames)
}

fn attacks_in(phases: Range<usize>, seed: u64, frames: u64) -> AttackReport {
    use rayon::prelude::*;
    let phases: Vec<AttackedFlight> = phases.map(AttackedFlight::at_phase).collect();
    let attack = |seed: u64| {
        let flight = phases[seed as usize % PHASE_COUNT].clone();
        let mut report = flight.run_attack(&mut Dice::new(seed), FRAMES_PER_ATTACK as usize);
        for what in [&mut report.broken_rules, &mut report.unfit_setpoints] {
            what.truncate(1);
            what.iter_mut().for_each(|what| *what = format!("seed {seed}: {what}"));
        }
        report
    };
    let both = |mut a: AttackReport, b: AttackReport| {
        a.merge(b);
        a.broken_rules.truncate(MAX_KEPT_FINDINGS);
        a.unfit_setpoints.truncate(MAX_KEPT_FINDINGS);
        a
    };
    (seed..seed + frames.div_ceil(FRAMES_PER_ATTACK))
        .into_par_iter()
        .map(attack)
        .reduce(AttackReport::default, both)
}

/// The fuzzer's target: the first byte of `data` chooses the phase of a flight with a goal, the
/// rest are frames forged to its companion.
///
/// # Panics
/// The companion breaks a rule, or sends a setpoint that is unfit to be flown.
pub fn attack_with_bytes(data: &[u8]) {
    use std::sync::OnceLock;
    static PHASES_REACHED: OnceLock<Vec<AttackedFlight>> = OnceLock::new();
    let Some((&first, rest)) = data.split_first() else { return };
    let phases =
        PHASES_REACHED.get_or_init(|| (0..PHASE_COUNT).map(AttackedFlight::at_phase).collect());
    let flight = phases[usize::from(first) % PHASE_COUNT].clone();
    let report = flight.run_attack(&mut FuzzBytes(rest), usize::MAX);
    assert!(report.broken_rules.is_empty(), "{:?}", report.broken_rules);
    assert!(report.unfit_setpoints.is_empty(), "{:?}", report.unfit_setpoints);
}
