//! A vehicle's companion on a board or in another process: the simulation's ends of its two serial
//! ports, and the state, progress and texts that it reports.
//!
//! The simulation knows what the companion does from its messages only: its state from HEARTBEAT,
//! its progress from TUNNEL, its texts from STATUSTEXT, all received on the port of its radio. A
//! board whose radio is not simulated is received on the port for the autopilot, which carries no
//! TUNNEL.
//!
//! A board in QEMU is in lock step with the simulation ([`crate::boards`]): it runs through a step
//! while the host computes the other vehicles, and the simulation takes its bytes at the step's
//! end.

use std::path::Path;

use companion::link::frame::{Frame, Framer, MAX_FRAME_LEN};
use companion::link::intent::Intent;
use companion::{COMPANION_COMPONENT, Instant, Link as Port, State};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, STATUSTEXT_DATA, TUNNEL_DATA};
use planner_core::Point;

use super::radio::Radio;
use super::serial::SerialLink;
use super::step::STEP_US;
use crate::boards::{self, EmulatedBoard, PortBytes};
use crate::link::{ByteLink, LinkUrl};

/// One companion on a board or in another process.
pub struct RemoteCompanion {
    /// Serial ports of the board, or links to the process.
    connection: BoardConnection,
    /// Framer of the companion's bytes.
    framer: Framer,
    /// State that the companion last reported.
    state: State,
    /// Progress that the companion last reported, metres; `None` before its first intent.
    progress_m: Option<f32>,
}

/// The simulated links that a board is connected to during a step.
pub struct BoardLinks<'a> {
    /// Bytes on their way from the simulated autopilot to the board.
    pub to_board: &'a mut SerialLink,
    /// Bytes on their way from the board to the simulated autopilot.
    pub to_autopilot: &'a mut SerialLink,
    /// The swarm's simulated radio.
    pub radio: &'a mut Radio,
    /// Index of the board's vehicle among the radio's stations.
    pub station: usize,
    /// True positions of all stations, ENU metres.
    pub true_positions: &'a [Point],
    /// Called with each STATUSTEXT of the board.
    pub on_text: &'a mut dyn FnMut(&str),
}

/// How the simulation is connected to a board.
enum BoardConnection {
    /// Opened links to a board that runs by its own clock; `radio` is `None` if its radio is not
    /// simulated.
    Links { autopilot: Box<dyn ByteLink>, radio: Option<Box<dyn ByteLink>> },
    /// An emulated board that runs only while the simulation grants it time.
    LockStep(LockStep),
}

/// An emulated board in lock step with the simulation.
struct LockStep {
    board: EmulatedBoard,
    /// Simulation time at which the board last started, microseconds.
    started_us: u64,
    /// Whether the board was granted a step that it has not finished yet.
    grant_running: bool,
}

impl RemoteCompanion {
    /// Starts a board in QEMU whose flash holds this roadmap or field file and this mission file.
    ///
    /// # Errors
    /// QEMU or the program does not start; the board's store would refuse a file.
    pub fn emulate(
        program: &Path,
        log: &Path,
        roadmap: &[u8],
        mission: &[u8],
    ) -> anyhow::Result<Self> {
        let mut board = EmulatedBoard::start(program, log)?;
        board.load_flash(&boards::flash_bank_image(roadmap, mission)?)?;
        Ok(Self::new(BoardConnection::LockStep(LockStep {
            board,
            started_us: 0,
            grant_running: false,
        })))
    }

    fn new(connection: BoardConnection) -> Self {
        Self { connection, framer: Framer::new(), state: State::default(), progress_m: None }
    }

    /// Opens the link to the board's port for the autopilot and, if `radio` is given, to the port
    /// for its radio.
    ///
    /// # Errors
    /// A link cannot be opened.
    pub fn open(autopilot: &LinkUrl, radio: Option<&LinkUrl>) -> anyhow::Result<Self> {
        let radio = radio.map(LinkUrl::open).transpose()?;
        Ok(Self::new(BoardConnection::Links { autopilot: autopilot.open()?, radio }))
    }

    /// State of the board's companion, as last reported.
    pub fn state(&self) -> State {
        self.state
    }

    /// Progress of the vehicle along its own path, as last reported, metres; `None` before the
    /// first report.
    pub fn progress_m(&self) -> Option<f32> {
        self.progress_m
    }

    /// Whether the board's radio traffic passes through the simulated radio.
    pub fn has_radio(&self) -> bool {
        !matches!(self.connection, BoardConnection::Links { radio: None, .. })
    }

    /// Greatest stack use of the board since its start, bytes; `None` for a board that is not in
    /// lock step.
    ///
    /// # Errors
    /// The board is gone.
    pub fn max_stack_used(&mut self) -> anyhow::Result<Option<usize>> {
        let BoardConnection::LockStep(LockStep { board, grant_running: runs, .. }) =
            &mut self.connection
        else {
            return Ok(None);
        };
        if core::mem::take(runs) {
            board.wait_for_grant_end()?;
        }
        board.max_stack_used().map(Some)
    }

    /// Carries bytes between the board, its autopilot and the radio up to `now_us`, the end of a
    /// step. A board in lock step is then granted the next step.
    ///
    /// # Errors
    /// A board in lock step hangs or is gone.
    pub fn step(&mut self, now_us: u64, lines: &mut BoardLinks<'_>) -> anyhow::Result<()> {
        match &mut self.connection {
            BoardConnection::Links { .. } => {
                // An error of the link is ignored: a board that is gone is silent, as without
                // power.
                let _: anyhow::Result<()> = self.exchange_bytes(now_us, lines);
                Ok(())
            }
            BoardConnection::LockStep(lock_step) => {
                let sent = lock_step.finish_grant(now_us)?;
                let started_us = lock_step.started_us;
                for PortBytes { port, at_us, bytes } in sent {
                    match port {
                        Port::Autopilot => lines.to_autopilot.write(started_us + at_us, &bytes),
                        Port::Swarm => self.broadcast_frames(now_us, &bytes, lines),
                    }
                }
                let BoardConnection::LockStep(lock_step) = &mut self.connection else {
                    return Ok(());
                };
                lock_step.begin_grant(now_us, lines)
            }
        }
    }

    /// Passes on, in both directions, the bytes that have arrived by `now_us` on opened links.
    fn exchange_bytes(&mut self, now_us: u64, lines: &mut BoardLinks<'_>) -> anyhow::Result<()> {
        let BoardConnection::Links { autopilot, radio } = &mut self.connection else {
            return Ok(());
        };
        while let Some((_, bytes)) = lines.to_board.take_write_by(now_us) {
            autopilot.send(&bytes)?;
        }
        while let Some(packet) = lines.radio.receive(now_us, lines.station) {
            if let Some(radio) = radio {
                radio.send(&packet)?;
            }
        }
        let drain = |link: &mut Box<dyn ByteLink>| -> anyhow::Result<Vec<u8>> {
            let (mut heard, mut buffer) = (Vec::new(), [0; 2048]);
            loop {
                match link.receive(&mut buffer)? {
                    0 => return Ok(heard),
                    length => heard.extend(&buffer[..length]),
                }
            }
        };
        let from_autopilot = drain(autopilot)?;
        let from_radio = radio.as_mut().map(drain).transpose()?;
        if !from_autopilot.is_empty() {
            lines.to_autopilot.write(now_us, &from_autopilot);
        }
        match from_radio {
            Some(bytes) => self.broadcast_frames(now_us, &bytes, lines),
            None => {
                let mut input = &from_autopilot[..];
                while let Some(frame) = self.framer.next(Instant::from_micros(now_us), &mut input) {
                    self.note_report(&frame, &mut lines.on_text);
                }
            }
        }
        Ok(())
    }

    /// The board's radio broadcasts `bytes`, one packet for each whole frame in them.
    fn broadcast_frames(&mut self, now_us: u64, bytes: &[u8], lines: &mut BoardLinks<'_>) {
        let mut input = bytes;
        while let Some(frame) = self.framer.next(Instant::from_micros(now_us), &mut input) {
            let mut packet = [0; MAX_FRAME_LEN];
            let length = frame.encode(&mut packet);
            lines.radio.broadcast(
                now_us,
                Some(lines.station),
                lines.true_positions,
                &packet[..length],
            );
            self.note_report(&frame, &mut lines.on_text);
        }
    }

    /// Keeps state or progress that a frame of the companion reports, or passes on its text.
    fn note_report(&mut self, frame: &Frame, said: &mut dyn FnMut(&str)) {
        if frame.component != COMPANION_COMPONENT {
            return;
        }
        match frame.message_id {
            HEARTBEAT_DATA::ID => self.state = reported_state(frame).unwrap_or(self.state),
            TUNNEL_DATA::ID => {
                let intent = Intent::decode(frame.padded_payload(), frame.system);
                self.progress_m = intent.map(|intent| intent.progress_m).or(self.progress_m);
            }
            STATUSTEXT_DATA::ID => {
                if let Some(text) = frame.decode::<STATUSTEXT_DATA>() {
                    said(text.text.to_str().unwrap_or_default());
                }
            }
            _ => {}
        }
    }
}

impl LockStep {
    /// Ends the grant of the last step; returns the bytes that the board sent in it.
    fn finish_grant(&mut self, now_us: u64) -> anyhow::Result<Vec<PortBytes>> {
        if !core::mem::take(&mut self.grant_running) {
            return Ok(Vec::new());
        }
        let answer = self.board.wait_for_grant_end()?;
        if answer.restarted {
            self.started_us = now_us;
        }
        Ok(answer.sent)
    }

    /// Grants the board the next step, with the bytes that reach it during that step.
    fn begin_grant(&mut self, now_us: u64, lines: &mut BoardLinks<'_>) -> anyhow::Result<()> {
        let until_us = now_us + STEP_US;
        let board_us = |us: u64| us.max(now_us) - self.started_us;
        let mut received = Vec::new();
        while let Some(packet) = lines.radio.receive(now_us, lines.station) {
            received.push(PortBytes {
                port: Port::Swarm,
                at_us: board_us(now_us),
                bytes: packet.to_vec(),
            });
        }
        while let Some((arrives_us, bytes)) = lines.to_board.take_write_by(until_us) {
            received.push(PortBytes { port: Port::Autopilot, at_us: board_us(arrives_us), bytes });
        }
        self.grant_running = true;
        self.board.begin_grant(board_us(until_us), &received)
    }
}

/// The state that a companion's HEARTBEAT reports in `custom_mode`; `None` if it is no known one.
pub fn reported_state(frame: &Frame) -> Option<State> {
    let reported = frame.decode::<HEARTBEAT_DATA>()?.custom_mode;
    State::ALL.iter().copied().find(|state| *state as u32 == reported)
}
