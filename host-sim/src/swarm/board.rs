//! A companion on a board or in another process: the far ends of its two serial ports, and what it tells of itself.
//!
//! What it does is known only by what it sends: its state from HEARTBEAT, its progress from TUNNEL, its words from STATUSTEXT, all
//! heard on its radio's port. A board whose radio is not ours is heard on the port for the autopilot, which carries no TUNNEL.

use companion::link::frame::{Frame, Framer, MAX_SENT};
use companion::link::intent::Intent;
use companion::{COMPONENT, Instant, State};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, STATUSTEXT_DATA, TUNNEL_DATA};

use crate::link::{Link, LinkUrl};

/// One board.
pub struct Board {
    autopilot: Box<dyn Link>,
    radio: Option<Box<dyn Link>>,
    framer: Framer,
    state: State,
    progress_m: Option<f32>,
}

impl Board {
    /// Connects to the board's port for the autopilot and, if its radio is ours, the one for the radio.
    ///
    /// # Errors
    /// A link cannot be opened.
    pub fn open(autopilot: &LinkUrl, radio: Option<&LinkUrl>) -> anyhow::Result<Self> {
        Ok(Self {
            autopilot: autopilot.open()?,
            radio: radio.map(LinkUrl::open).transpose()?,
            framer: Framer::new(),
            state: State::default(),
            progress_m: None,
        })
    }

    /// Its state as last told.
    pub fn state(&self) -> State {
        self.state
    }

    /// Its way along its own path as last told, metres; none if it has told of none.
    pub fn progress_m(&self) -> Option<f32> {
        self.progress_m
    }

    /// Whether its radio is ours.
    pub fn has_radio(&self) -> bool {
        self.radio.is_some()
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
        self.radio.as_mut().map_or(Ok(()), |radio| radio.send(packet))
    }

    /// Bytes for its autopilot; 0 if there are none. Its words go to `said` if its radio is not ours.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn hear_autopilot(
        &mut self,
        now: Instant,
        out: &mut [u8],
        mut said: impl FnMut(&str),
    ) -> std::io::Result<usize> {
        let length = self.autopilot.receive(out)?;
        if self.radio.is_none() {
            let mut input = &out[..length];
            while let Some(frame) = self.framer.next(now, &mut input) {
                self.note(&frame, &mut said);
            }
        }
        Ok(length)
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
        let mut buffer = [0; 2048];
        while let Some(radio) = &mut self.radio {
            let length = radio.receive(&mut buffer)?;
            let mut input = &buffer[..length];
            while let Some(frame) = self.framer.next(now, &mut input) {
                let mut packet = [0; MAX_SENT];
                let length = frame.encode(&mut packet);
                sent(&packet[..length]);
                self.note(&frame, &mut said);
            }
            if length == 0 {
                break;
            }
        }
        Ok(())
    }

    /// Keeps what the board tells of itself.
    fn note(&mut self, frame: &Frame, said: &mut impl FnMut(&str)) {
        if frame.component != COMPONENT {
            return;
        }
        match frame.message_id {
            HEARTBEAT_DATA::ID => self.state = told_state(frame).unwrap_or(self.state),
            TUNNEL_DATA::ID => {
                let intent = Intent::decode(frame.padded(), frame.system);
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

/// The state that a companion's HEARTBEAT tells.
pub fn told_state(frame: &Frame) -> Option<State> {
    let told = frame.decode::<HEARTBEAT_DATA>()?.custom_mode;
    State::ALL.iter().copied().find(|state| *state as u32 == told)
}
