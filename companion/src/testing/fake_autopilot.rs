//! A scripted autopilot, PX4 or ArduCopter, for the companion's unit tests. It has the modes,
//! COMMAND_ACKs and streams that the companion relies on, and a vehicle that moves to the setpoint
//! at a limited speed. `host-sim` simulates the real closed loop.

extern crate std;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::flight::VehiclePlan;
use planner_core::geo::frames::{self, Geodetic};

use crate::autopilot::AutopilotKind;
use crate::autopilot::px4;
use crate::link::frame::{self, Frame, Framer, Header, MAX_FRAME_LEN};
use crate::link::intent;
use crate::{Companion, Config, Duration, Event, Instant, Link, PlanRequests};

mod commands;
mod flight;
mod ground_station;
mod mission;
mod neighbour;
mod planner;
mod telemetry;

pub(crate) use self::mission::*;

/// The companion under test.
pub type BenchCompanion = Companion<4, WAYPOINTS, GATES>;
/// A plan for the bench's companion.
pub type Plan = VehiclePlan<WAYPOINTS, GATES>;
/// Most waypoints of its plan.
pub const WAYPOINTS: usize = 32;
/// Most gates of its plan.
pub const GATES: usize = 8;

/// Test bench: the companion, its scripted autopilot, and a ground station and a neighbour on the
/// radio.
pub struct Bench {
    /// The autopilot that is played.
    pub kind: AutopilotKind,
    /// ArduCopter: message ids whose streams the companion has requested.
    pub streams: Vec<u16>,
    /// ArduCopter: flags of EKF_STATUS_REPORT.
    pub ekf_flags: u16,
    /// ArduCopter: whether NAV_TAKEOFF was accepted and not cancelled by a setpoint before the
    /// lift-off.
    pub took_off: bool,
    /// ArduCopter: time from NAV_TAKEOFF to the lift-off, while the motors spin up.
    pub spool: Duration,
    /// ArduCopter: when the vehicle lifts off after NAV_TAKEOFF.
    lifts_at: Instant,
    /// TIMESYNC answers of the companion on the autopilot's link: `tc1` and `ts1`.
    pub timesyncs: Vec<(i64, i64)>,
    pub companion: BenchCompanion,
    /// Time on the companion's clock.
    pub now: Instant,
    /// True position of the vehicle in the mission frame, ENU metres.
    pub enu: Point,
    /// The autopilot's `custom_mode`.
    pub mode: u32,
    /// Whether the motors are armed.
    pub armed: bool,
    /// From 5 on HEARTBEAT reports `MAV_STATE_CRITICAL`, below 5 `MAV_STATE_ACTIVE`.
    pub status: u8,
    /// Battery charge, percent.
    pub battery: i8,
    /// Commands that the autopilot refuses: `MAV_CMD` numbers.
    pub refused: Vec<u16>,
    /// Whether the autopilot sends no COMMAND_ACK, neither for accepted nor for refused commands.
    pub mute: bool,
    /// Whether the autopilot does not send SYS_STATUS.
    pub no_battery: bool,
    /// Whether the landing detector reports ground at any height.
    pub false_ground: bool,
    /// Estimated height minus the true one, metres.
    pub height_error_m: f32,
    /// Vertical speed that the autopilot reports, m/s upwards.
    pub climbs_mps: f32,
    /// Whether the autopilot sends nothing and obeys no command.
    pub silent: bool,
    /// Whether HEARTBEAT alone is lost.
    pub no_heartbeat: bool,
    /// Whether EXTENDED_SYS_STATE alone is lost.
    pub no_landed_state: bool,
    /// Whether LOCAL_POSITION_NED alone is lost.
    pub no_position: bool,
    /// Horizontal accuracy that ESTIMATOR_STATUS reports, metres; `None`: the message is not sent.
    pub accuracy_m: Option<f32>,
    /// ArduCopter: `pos_horiz_variance` that EKF_STATUS_REPORT reports.
    pub pos_horiz_variance: f32,
    /// Whether the autopilot does not disarm by itself.
    pub stays_armed: bool,
    /// Whether the autopilot accepts arming, but its pilot disarms before a HEARTBEAT shows the
    /// armed bit.
    pub never_arms: bool,
    /// Whether the vehicle ignores setpoints and stays where it is.
    pub stuck: bool,
    /// Whether the shell answers every request for a division with a failure.
    pub undividable: bool,
    /// Distance that the vehicle moves in one tick of 50 ms, metres.
    pub step_m: f32,
    /// Whether the vehicle does not come down in the landing mode.
    pub never_lands: bool,
    /// Events that the companion gave the shell.
    pub events: Vec<Event>,
    /// Setpoints received: when, place in the true mission frame (ENU metres), `type_mask`.
    pub setpoints: Vec<(Instant, Point, u16)>,
    /// Heading in each setpoint received, radians from east, counter-clockwise; `None` if its mask
    /// ignores the heading.
    pub headings: Vec<Option<f32>>,
    /// Commands to the autopilot: `MAV_CMD`, parameters 1 to 3.
    pub commands: Vec<(u16, f32, f32, f32)>,
    /// STATUSTEXTs of the companion.
    pub texts: Vec<std::string::String>,
    /// Frames sent to the radio.
    pub swarm: Vec<Frame>,
    /// COMMAND_ACKs of the companion: command, result, target system and component.
    pub acks: Vec<(u16, u8, u8, u8)>,
    /// ArduCopter: height above home that NAV_TAKEOFF requested, metres.
    pub takeoff_m: f32,
    /// Where the vehicle flies to in the setpoint mode, by the last setpoint or NAV_TAKEOFF, true
    /// ENU metres; `None`: it stays, as after a setpoint of another type than the usual.
    target: Option<Point>,
    /// Framers of what the companion sends, in the order of `Link`.
    framers: [Framer; 2],
    /// Sequence number of the autopilot's next frame.
    sequence: u8,
    /// Sequence number of the ground station's next frame.
    gcs_sequence: u8,
    /// When the vehicle touched down in the landing mode; `None` in other modes and in the air.
    landed_at: Option<Instant>,
    /// Since when the vehicle has stood armed on the ground without a take-off.
    idle_since: Option<Instant>,
    /// The autopilot's EKF origin.
    pub origin: Geodetic,
    /// Answer of the shell to a request for the mission's plan; `None`: no answer.
    pub answer_plan: Option<Result<Plan, crate::PlanFailure>>,
    /// Answer of the shell to a request for a detour: with `Ok` a fixed path by y = 16 m, or a
    /// planned one if the detour leads home; `None`: no answer.
    pub answer_detour: Option<Result<(), crate::PlanFailure>>,
    /// Whether the shell answers requests for a division.
    pub answer_division: bool,
    /// Times that the shell's planner takes for its answers, in turn and again from the first;
    /// empty: it answers at once.
    pub planner_takes: Vec<Duration>,
    /// Plans that the companion has requested and not got yet.
    plan_requests: PlanRequests,
    /// The answer that the planner works on; `None` without one.
    answer_under_way: Option<planner::Answer>,
    /// Number of answers begun.
    answer_count: usize,
    /// The vehicle's plan before it requested a detour.
    own_plan: Option<Plan>,
    /// The neighbour, vehicle 77 or the first other one of the roster, which reports five times a
    /// second: place, flags of its intent, progress, CRC of its plan.
    pub neighbour: Option<(Point, u8, f32, u32)>,
    /// Time stamp of the neighbour's positions; `None`: the current time.
    pub neighbour_clock: Option<Instant>,
    /// Place along the neighbour's path up to which its gates are open, metres.
    pub neighbour_clear_m: f32,
    /// Ranks of the vehicles that the neighbour reports to hear, as bits.
    pub neighbour_hears: u32,
    /// How many intents of this vehicle are newer than the one that the neighbour echoes; `None`:
    /// the neighbour echoes none.
    pub neighbour_echoes: Option<usize>,
    /// How long ago the neighbour received the intent that it echoes, in units of 10 ms.
    pub neighbour_held: u8,
    /// Sequence number of the neighbour's next frame.
    neighbour_sequence: u8,
}

impl Bench {
    pub fn new(config: Config<4>) -> Self {
        Self {
            kind: AutopilotKind::Px4,
            streams: Vec::new(),
            ekf_flags: 0x33F,
            took_off: false,
            spool: Duration::default(),
            lifts_at: Instant::ZERO,
            timesyncs: Vec::new(),
            companion: Companion::new(config).unwrap(),
            now: Instant::ZERO,
            enu: Point::new(START.x, START.y, 0.0),
            mode: px4::HOLD,
            armed: false,
            status: 3,
            battery: 90,
            refused: Vec::new(),
            mute: false,
            no_battery: false,
            false_ground: false,
            height_error_m: 0.0,
            climbs_mps: 0.0,
            silent: false,
            no_heartbeat: false,
            no_landed_state: false,
            no_position: false,
            accuracy_m: Some(0.02),
            pos_horiz_variance: 0.1,
            stays_armed: false,
            never_arms: false,
            stuck: false,
            never_lands: false,
            events: Vec::new(),
            setpoints: Vec::new(),
            headings: Vec::new(),
            commands: Vec::new(),
            texts: Vec::new(),
            swarm: Vec::new(),
            acks: Vec::new(),
            takeoff_m: 0.0,
            target: None,
            framers: [Framer::new(), Framer::new()],
            sequence: 0,
            gcs_sequence: 0,
            landed_at: None,
            idle_since: None,
            origin: EKF_ORIGIN,
            answer_plan: Some(Ok(plan())),
            answer_detour: Some(Ok(())),
            step_m: 0.1,
            undividable: false,
            answer_division: true,
            planner_takes: Vec::new(),
            plan_requests: PlanRequests::new(),
            answer_under_way: None,
            answer_count: 0,
            own_plan: None,
            neighbour: None,
            neighbour_clock: None,
            neighbour_clear_m: -1e6,
            neighbour_hears: u32::MAX,
            neighbour_echoes: None,
            neighbour_held: 0,
            neighbour_sequence: 0,
        }
    }

    /// State of the companion's mission.
    pub fn state(&self) -> crate::State {
        self.companion.state()
    }

    /// Estimated position in NED metres about the autopilot's EKF origin.
    pub fn ned(&self) -> Vector3<f64> {
        let place = frames::enu_to_geodetic(&ORIGIN, &(self.enu + self.height_error()));
        frames::geodetic_to_ned(self.kind.projection(), &self.origin, &place)
    }

    /// The frame of a message from the autopilot.
    pub fn bytes<M: MessageData>(&mut self, message: &M) -> Vec<u8> {
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: SYSTEM, component: 1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let len = frame::encode(header, message, &mut out);
        out[..len].to_vec()
    }

    /// Gives the companion a message from the autopilot.
    pub fn send<M: MessageData>(&mut self, message: &M) {
        let bytes = self.bytes(message);
        self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
        self.drain();
    }

    /// Sends a COMMAND_LONG from ground station 255 on the swarm link.
    pub fn command(&mut self, command: MavCmd, param1: f32, system: u8, component: u8) {
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: system,
            target_component: component,
            ..Default::default()
        };
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: 255, component: 190, sequence: self.gcs_sequence };
        self.gcs_sequence = self.gcs_sequence.wrapping_add(1);
        let len = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..len]);
        self.drain();
    }

    /// Sends MISSION_START from the ground station.
    pub fn start(&mut self) {
        self.command(MavCmd::MAV_CMD_MISSION_START, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
    }

    /// Receives all that the companion sends.
    pub fn drain(&mut self) {
        for link in [Link::Autopilot, Link::Swarm] {
            let mut out = [0; MAX_FRAME_LEN];
            loop {
                let len = self.companion.poll_transmit(link, &mut out);
                if len == 0 {
                    break;
                }
                let mut input = &out[..len];
                let frame =
                    self.framers[link as usize].next(self.now, &mut input).expect("a whole frame");
                assert_eq!((frame.system, frame.component), (SYSTEM, crate::COMPANION_COMPONENT));
                self.receive(link, frame);
            }
        }
        loop {
            while let Some(event) = self.companion.poll_event() {
                self.events.push(event);
                if let Event::PlanRequested(wanted) = event {
                    self.plan_requests.add(wanted);
                }
            }
            if !self.step_planner() {
                return;
            }
        }
    }

    /// A bench with an ArduCopter that has just booted.
    pub fn ardupilot(config: Config<4>) -> Self {
        Self { kind: AutopilotKind::ArduPilot, mode: 0, ..Self::new(config) }
    }

    /// Lets 50 ms pass: the companion's step, the vehicle's flight, and the autopilot's and
    /// neighbour's messages.
    pub fn tick(&mut self) {
        self.report_neighbour();
        self.now = self.now + Duration::from_millis(50);
        self.companion.handle_timeout(self.now);
        self.drain();
        self.fly();
        self.report();
    }

    /// Runs the bench for this time.
    pub fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds * 20.0) as u32 {
            self.tick();
        }
    }

    /// Runs until the companion is in this state; panics with its texts if it is not within
    /// `seconds`.
    #[track_caller]
    pub fn run_until(&mut self, state: crate::State, seconds: f32) {
        for _ in 0..(seconds * 20.0) as u32 {
            if self.state() == state {
                return;
            }
            self.tick();
        }
        assert_eq!(self.state(), state, "{:?} at {:?}", self.texts, self.enu);
    }

    /// Runs until the vehicle has left the ground.
    pub fn run_until_lifted(&mut self) {
        for _ in 0..400 {
            if self.enu.z > 0.5 {
                return;
            }
            self.tick();
        }
        panic!("still on the ground: {:?}", self.texts);
    }

    /// A bench whose mission is started while vehicle 77 stands on its pad, following the plan.
    pub fn started_with_neighbour(config: Config<4>) -> Self {
        let mut bench = Self::new(config);
        bench.neighbour =
            Some((Point::new(8.0, 20.0, 0.0), intent::ON_PLAN | intent::GROUNDED, 0.0, 5));
        bench.run_until(crate::State::Ready, 6.0);
        bench.start();
        bench
    }

    /// A bench whose vehicle follows its path, 2 s after the climb.
    pub fn following(config: Config<4>) -> Self {
        let mut bench = Self::new(config);
        bench.run_until(crate::State::Ready, 6.0);
        bench.start();
        bench.run_until(crate::State::Follow, 20.0);
        bench.run(2.0);
        assert_eq!(bench.state(), crate::State::Follow);
        bench
    }
}
