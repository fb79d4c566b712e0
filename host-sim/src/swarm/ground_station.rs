//! The operator: starts the whole swarm by radio once every companion is ready, as QGroundControl or a script would.

use companion::State;
use companion::frame::{self, Header};
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};
use planner_core::Point;

use super::member::Member;
use super::radio::Radio;

/// System id of ground stations.
const SYSTEM_ID: u8 = 255;
/// MAV_COMP_ID_MISSIONPLANNER.
const COMPONENT_ID: u8 = 190;
/// The command is repeated this often until everybody has started, microseconds.
const REPEAT_US: u64 = 1_000_000;

/// Sends MISSION_START to system 0.
#[derive(Debug, Default)]
pub struct GroundStation {
    sequence: u8,
    first_us: Option<u64>,
    last_us: u64,
}

impl GroundStation {
    /// Nothing sent yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether the start was commanded.
    pub fn started(&self) -> bool {
        self.first_us.is_some()
    }

    /// When it was first commanded, seconds; 0 before.
    pub fn started_s(&self) -> f64 {
        self.first_us.map_or(0.0, |us| us as f64 * 1e-6)
    }

    /// Commands the start once all are ready, and again while one of them has not heard it.
    pub fn step(&mut self, now_us: u64, members: &[Member], radio: &mut Radio, places: &[Point]) {
        let due = self.first_us.is_none() || now_us >= self.last_us + REPEAT_US;
        let ready = |m: &Member| m.companion.state() == State::Ready;
        let wanted = match self.first_us {
            None => members.iter().all(ready),
            Some(_) => members.iter().any(ready),
        };
        if !(due && wanted) {
            return;
        }
        self.first_us.get_or_insert(now_us);
        self.last_us = now_us;
        let mut buffer = [0; frame::MAX_SENT];
        let length = mission_start(EVERYBODY, self.sequence, &mut buffer);
        self.sequence = self.sequence.wrapping_add(1);
        radio.broadcast(now_us, None, places, &buffer[..length]);
    }
}

/// Target system that means all.
const EVERYBODY: u8 = 0;

/// A frame that commands the start; returns its length.
pub fn mission_start(target_system: u8, sequence: u8, out: &mut [u8; frame::MAX_SENT]) -> usize {
    let command = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_MISSION_START,
        target_system,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    frame::encode(Header { system: SYSTEM_ID, component: COMPONENT_ID, sequence }, &command, out)
}
