//! A companion on a board or in another process: the far ends of its two serial ports, and what it tells of itself.
//!
//! What it does is known only by what it sends: its state from HEARTBEAT, its progress from TUNNEL, its words from STATUSTEXT, all
//! heard on its radio's port.

use companion::frame::{Frame, Framer, MAX_SENT};
use companion::intent::Intent;
use companion::table::TABLE;
use companion::{COMPONENT, Instant, State};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, STATUSTEXT_DATA, TUNNEL_DATA};

use crate::link::{Link, LinkUrl};

/// One board.
pub struct Board {
    autopilot: Box<dyn Link>,
    radio: Box<dyn Link>,
    framer: Framer,
    state: State,
    progress_m: f32,
    buffer: [u8; 2048],
}

impl Board {
    /// Connects to the board's port for the autopilot and the one for the radio.
    ///
    /// # Errors
    /// A link cannot be opened.
    pub fn open(autopilot: &LinkUrl, radio: &LinkUrl) -> anyhow::Result<Self> {
        Ok(Self {
            autopilot: autopilot.open()?,
            radio: radio.open()?,
            framer: Framer::new(),
            state: State::default(),
            progress_m: 0.0,
            buffer: [0; 2048],
        })
    }

    /// Its state as last told.
    pub fn state(&self) -> State {
        self.state
    }

    /// Its way along its own path as last told, metres.
    pub fn progress_m(&self) -> f32 {
        self.progress_m
    }

    /// Gives it bytes of its autopilot.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn tell_autopilot(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.autopilot.send(bytes)
    }

    /// Gives it a packet that its radio heard.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn tell_radio(&mut self, packet: &[u8]) -> std::io::Result<()> {
        self.radio.send(packet)
    }

    /// Bytes for its autopilot; 0 if there are none.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn hear_autopilot(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        self.autopilot.receive(out)
    }

    /// Moves what its radio sends out as whole packets to `sent`, and its words to `said`.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn hear_radio(
        &mut self,
        now: Instant,
        mut sent: impl FnMut(&[u8]),
        mut said: impl FnMut(&str),
    ) -> std::io::Result<()> {
        loop {
            let length = self.radio.receive(&mut self.buffer)?;
            let mut input = &self.buffer[..length];
            while let Some(frame) = self.framer.next(now, &mut input) {
                let mut packet = [0; MAX_SENT];
                let length = frame.encode(&mut packet);
                sent(&packet[..length]);
                if frame.component == COMPONENT {
                    note(&frame, &mut self.state, &mut self.progress_m, &mut said);
                }
            }
            if length == 0 {
                return Ok(());
            }
        }
    }
}

/// The state that a companion's HEARTBEAT tells.
pub fn told_state(frame: &Frame) -> Option<State> {
    let told = frame.decode::<HEARTBEAT_DATA>()?.custom_mode;
    let named = TABLE.iter().flat_map(|row| row.from.iter().chain([&row.to]));
    named.copied().find(|state| *state as u32 == told)
}

fn note(frame: &Frame, state: &mut State, progress_m: &mut f32, said: &mut impl FnMut(&str)) {
    match frame.message_id {
        HEARTBEAT_DATA::ID => *state = told_state(frame).unwrap_or(*state),
        TUNNEL_DATA::ID => {
            if let Some(intent) = Intent::decode(frame.padded(), frame.system) {
                *progress_m = intent.progress_m;
            }
        }
        STATUSTEXT_DATA::ID => {
            if let Some(text) = frame.decode::<STATUSTEXT_DATA>() {
                said(text.text.to_str().unwrap_or_default());
            }
        }
        _ => {}
    }
}
