//! One vehicle for tests: a board in QEMU in lock step with a simulated autopilot, and a ground
//! station on the board's radio.

use std::path::{self, PathBuf};
use std::time::Duration;

use companion::Link as Port;
use companion::link::frame::{self, Frame, Framer, Header};
use companion::{COMPANION_COMPONENT, Instant, State};
use host_sim::boards::{self, EmulatedBoard, PortBytes};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;
use host_sim::swarm::board::reported_state;
use host_sim::swarm::vehicles::simulated_kind;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavCmd, SET_POSITION_TARGET_LOCAL_NED_DATA, STATUSTEXT_DATA,
};
use planner_core::Point;
use planner_core::flight::Path;
use planner_core::geo::frames::geodetic_to_enu;
use sim_autopilot::{Autopilot, AutopilotConfig};

use crate::board_failure::{self, BoardFailure};

/// Time of a step.
const STEP: Duration = Duration::from_millis(4);
/// Longest wait for an event, vehicle's time: a megabyte of garbage takes 100 s.
const PATIENCE: Duration = Duration::from_secs(400);
/// Time between two commands to start the mission.
const START_COMMAND_PERIOD: Duration = Duration::from_secs(1);
/// States of a companion whose vehicle has not left its pad.
const ON_PAD: [State; 6] = [
    State::WaitAutopilot,
    State::WaitPosition,
    State::Planning,
    State::Ready,
    State::Scheduled,
    State::PadReplanning,
];
/// Time until the simulated estimator is ready, seconds: sooner than ArduCopter's real one.
const ESTIMATOR_READY_S: f32 = 2.0;

/// Messages received from the board.
#[derive(Debug, Default)]
pub struct BoardMessages {
    /// STATUSTEXT messages received by radio.
    pub texts: Vec<String>,
    /// Setpoints that the board sent to the autopilot.
    pub setpoints: Vec<SET_POSITION_TARGET_LOCAL_NED_DATA>,
    /// When the board sent each setpoint, microseconds of the board's time.
    pub setpoints_us: Vec<u64>,
    /// Commands that the board sent to the autopilot: number and first parameter.
    pub commands: Vec<(u32, f32)>,
    /// State of the companion, as last reported by radio.
    pub state: State,
    /// Number of frames missing on each port, by their sequence numbers. A companion that restarts
    /// counts from zero, which shows here too.
    pub missing_frames: [u32; 2],
    /// Sequence number of the last frame on each port; `None` before the first.
    last_sequence: [Option<u8>; 2],
}

/// A vehicle whose companion runs on an emulated board.
pub struct Vehicle {
    /// The board that runs its companion.
    pub board: EmulatedBoard,
    /// Its simulated autopilot and airframe.
    pub autopilot: Autopilot,
    /// Messages received from the board since the caller last emptied this.
    pub heard: BoardMessages,
    /// Bytes received from the board's radio, for an upload client to read.
    pub radio_bytes: Vec<u8>,
    /// Simulated time so far.
    pub time: Duration,
    /// The firmware.
    program: PathBuf,
    folder: tempfile::TempDir,
    /// Simulated time at which the board last started.
    board_started: Duration,
    /// Whether each port is connected.
    is_plugged_in: [bool; 2],
    /// Bytes that the board receives with the next step.
    pending_bytes: Vec<PortBytes>,
    framers: [Framer; 2],
    /// Height of the ground, ENU metres.
    ground_m: f32,
    sequence: u8,
}

/// Prepares a scenario's mission for flight.
///
/// # Panics
/// The scenario is invalid, or the mission cannot be prepared.
pub fn prepare_mission(text: &str) -> PreparedMission {
    let scenario = scenario::parse(text, "vehicle.toml").expect("the scenario is good");
    PreparedMission::prepare(scenario, &Progress::on_terminal()).expect("it can be prepared")
}

/// The middle of the widest leg among those in the second half of a path.
///
/// # Panics
/// The path has no legs.
pub fn widest_late_leg_middle<const W: usize>(path: &Path<W>) -> Point {
    let late = path.waypoints().windows(2).filter(|leg| leg[0].along_m > 0.5 * path.length_m());
    let widest = late
        .max_by(|a, b| a[1].leg_clearance_m.total_cmp(&b[1].leg_clearance_m))
        .expect("a path has legs");
    (widest[0].position + widest[1].position) * 0.5
}

impl Vehicle {
    /// The first vehicle of a mission on its pad, its autopilot and its board just switched on; the
    /// board's flash holds the files of the mission `known`.
    ///
    /// # Panics
    /// The board does not start.
    pub fn new(
        program: &path::Path,
        mission: &PreparedMission,
        known: &PreparedMission,
        seed: u64,
    ) -> Self {
        let folder = tempfile::tempdir().expect("a temporary directory");
        let mut board = EmulatedBoard::start(program, &folder.path().join("log")).expect("a board");
        let bank = boards::flash_bank_image(&known.roadmap_or_field_file, &known.mission_file)
            .expect("it holds them");
        board.load_flash(&bank).expect("a board");
        let mut config = config(mission);
        config.seed = seed;
        let mut autopilot = Autopilot::new(&config).expect("the scenario is good");
        autopilot.set_land_on_offboard_loss();
        Self {
            board,
            autopilot,
            heard: BoardMessages::default(),
            radio_bytes: Vec::new(),
            time: Duration::ZERO,
            program: program.to_owned(),
            folder,
            board_started: Duration::ZERO,
            is_plugged_in: [true; 2],
            pending_bytes: Vec::new(),
            framers: [Framer::new(), Framer::new()],
            ground_m: config.start.z - config.vehicle.radius_m,
            sequence: 0,
        }
    }

    /// File with the board's log, in defmt's encoding.
    pub fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    /// Plugs in the cable of a port.
    pub fn plug_in(&mut self, port: Port) {
        self.is_plugged_in[port as usize] = true;
        self.begin_stream(port);
    }

    /// Pulls out the cable of a port: without it no byte passes.
    pub fn pull_out(&mut self, port: Port) {
        self.is_plugged_in[port as usize] = false;
        self.begin_stream(port);
    }

    /// The next byte from this port begins a frame.
    fn begin_stream(&mut self, port: Port) {
        self.framers[port as usize] = Framer::new();
        self.heard.last_sequence[port as usize] = None;
    }

    /// Makes the board fail now; it restarts by itself.
    pub fn fail_board(&mut self, how: BoardFailure) {
        how.inflict(&mut self.board, &self.program);
        self.note_restart();
        // Until the board has restarted, nothing is received from it.
        for _ in 0..how.hang_time().as_micros() / STEP.as_micros() {
            self.step_autopilot();
            self.pending_bytes.clear();
            self.time += STEP;
        }
        self.board_started = self.time;
        self.heard = BoardMessages::default();
    }

    /// Makes the board's planner raise a fault whenever it plans, until the next restart.
    pub fn break_planner(&mut self) {
        board_failure::break_planner(&mut self.board, &self.program);
    }

    /// Makes the board's planner take `time` longer for each plan, until the next restart.
    pub fn slow_planner(&mut self, time: Duration) {
        board_failure::slow_planner(&mut self.board, &self.program, time);
    }

    /// The board has restarted: its time begins at 0.
    fn note_restart(&mut self) {
        self.board_started = self.time;
        self.pending_bytes.clear();
        self.framers = [Framer::new(), Framer::new()];
        self.heard.last_sequence = [None; 2];
    }

    /// Sends the companion a command by its radio, as a ground station.
    pub fn send_command(&mut self, command: MavCmd, param1: f32) {
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: 1,
            target_component: COMPANION_COMPONENT,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        self.send_message(&data);
    }

    /// Sends the companion a message by its radio, as a ground station.
    pub fn send_message(&mut self, data: &impl MessageData) {
        let mut out = [0; frame::MAX_FRAME_LEN];
        let header = Header { system: 255, component: 190, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let length = frame::encode(header, data, &mut out);
        self.send(Port::Swarm, &out[..length]);
    }

    /// Sends bytes to a port of the board with the next step, if its cable is plugged in.
    pub fn send(&mut self, port: Port, bytes: &[u8]) {
        if self.is_plugged_in[port as usize] {
            let at_us = (self.time - self.board_started).as_micros() as u64;
            self.pending_bytes.push(PortBytes { port, at_us, bytes: bytes.to_owned() });
        }
    }

    /// One step of 4 ms of the vehicle: autopilot, then board.
    pub fn step(&mut self) {
        self.step_autopilot();
        self.time += STEP;
        let until_us = (self.time - self.board_started).as_micros() as u64;
        let pieces = core::mem::take(&mut self.pending_bytes);
        let answer = self.board.run_grant(until_us, &pieces).expect("a board");
        if answer.restarted {
            self.note_restart();
        }
        answer.sent.iter().for_each(|piece| self.receive(piece));
    }

    fn step_autopilot(&mut self) {
        self.autopilot.step(STEP.as_secs_f32(), self.ground_m);
        let mut buffer = [0; 2048];
        loop {
            let length = self.autopilot.poll_transmit(&mut buffer);
            if length == 0 {
                break;
            }
            self.send(Port::Autopilot, &buffer[..length]);
        }
    }

    /// Steps until `time` has passed in the simulation.
    pub fn step_for(&mut self, time: Duration) {
        (0..time.as_micros() / STEP.as_micros()).for_each(|_| self.step());
    }

    /// Steps until `holds` is true.
    ///
    /// # Panics
    /// That does not happen within 400 s.
    pub fn step_until(&mut self, what: &str, mut holds: impl FnMut(&mut Self) -> bool) {
        let began = self.time;
        while !holds(self) {
            let place = self.autopilot.true_state().position;
            assert!(
                self.time - began < PATIENCE,
                "not {what}: {:?} at {place:?}, {:?}",
                self.heard.state,
                self.heard.texts
            );
            self.step();
        }
    }

    /// Steps until the board sends a STATUSTEXT that begins with `text`.
    ///
    /// # Panics
    /// That does not happen within 400 s.
    pub fn step_until_said(&mut self, text: &str) {
        self.step_until(text, |vehicle| {
            vehicle.heard.texts.iter().any(|said| said.starts_with(text))
        });
    }

    /// Commands the start whenever the companion is ready, and steps until its state is none of
    /// `ON_PAD`. A reported state is up to a second old, and a board that has just lost its
    /// autopilot may still seem ready.
    pub fn start_mission(&mut self) {
        let mut last = None;
        self.step_until("started", |vehicle| {
            let due = last.is_none_or(|last| vehicle.time - last > START_COMMAND_PERIOD);
            if vehicle.heard.state == State::Ready && due {
                last = Some(vehicle.time);
                vehicle.send_command(MavCmd::MAV_CMD_MISSION_START, 0.0);
            }
            !ON_PAD.contains(&vehicle.heard.state)
        });
    }

    /// Whether the vehicle is off the ground, by its true state.
    pub fn is_off_ground(&self) -> bool {
        !self.autopilot.true_state().touching
    }

    /// Receives what the board sent through a port, if its cable is plugged in.
    fn receive(&mut self, PortBytes { port, at_us, bytes }: &PortBytes) {
        let line = *port as usize;
        if !self.is_plugged_in[line] {
            return;
        }
        if *port == Port::Autopilot {
            self.autopilot.handle_bytes(bytes);
        } else {
            self.radio_bytes.extend_from_slice(bytes);
        }
        let mut input = &bytes[..];
        while let Some(frame) = self.framers[line].next(Instant::from_micros(*at_us), &mut input) {
            self.heard.note(line, &frame, *at_us);
        }
    }
}

impl BoardMessages {
    fn note(&mut self, line: usize, frame: &Frame, at_us: u64) {
        if let Some(last) = self.last_sequence[line].replace(frame.sequence) {
            self.missing_frames[line] +=
                u32::from(frame.sequence.wrapping_sub(last).wrapping_sub(1));
        }
        let by_radio = line == Port::Swarm as usize;
        match frame.message_id {
            HEARTBEAT_DATA::ID if by_radio => {
                self.state = reported_state(frame).unwrap_or(self.state);
            }
            STATUSTEXT_DATA::ID if by_radio => {
                let text = frame.decode::<STATUSTEXT_DATA>().map(|data| data.text);
                self.texts
                    .extend(text.iter().map(|text| text.to_str().unwrap_or_default().to_owned()));
            }
            SET_POSITION_TARGET_LOCAL_NED_DATA::ID => {
                self.setpoints.extend(frame.decode());
                self.setpoints_us.push(at_us);
            }
            COMMAND_LONG_DATA::ID => {
                let p = frame.padded_payload();
                let command = u32::from(u16::from_le_bytes([p[28], p[29]]));
                self.commands.push((command, f32::from_le_bytes([p[0], p[1], p[2], p[3]])));
            }
            _ => {}
        }
    }
}

/// Settings of the simulated autopilot of a mission's first vehicle.
fn config(mission: &PreparedMission) -> AutopilotConfig {
    let (vehicle, origin) = (&mission.scenario.vehicles[0], mission.scenario.map.origin);
    let pad = mission.pad_position(0);
    let start: Point = geodetic_to_enu(&origin, &pad);
    AutopilotConfig {
        system_id: vehicle.id,
        autopilot: simulated_kind(vehicle.autopilot),
        world_origin: origin,
        ekf_origin: pad,
        start,
        estimator_ready_s: ESTIMATOR_READY_S,
        ..AutopilotConfig::default()
    }
}
