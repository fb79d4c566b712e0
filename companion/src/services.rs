//! What ground tools use of a companion beside commands: files, parameters, time, a restart. Served on either link, to frames
//! addressed to our own system and component, so a ground station may come by the radio or through the autopilot's routing.
//! Only a ground station of the mission sets parameters and uses files; what others may request is in `senders`.

pub mod ftp;
pub mod parameters;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, MavParamError, MavProtocolCapability, PARAM_REQUEST_LIST_DATA,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, TIMESYNC_DATA,
};

use self::parameters::{Parameters, Refused};
use crate::companion::Companion;
use crate::events::{Event, Link};
use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};
use crate::link::frame::Frame;
use crate::link::outbox::Outgoing;
use crate::link::senders::{Kind, Sender};
use crate::mission::State;
use crate::storage::store::{Erasing, Fault, FlashRequest, Store};
use crate::time::{Duration, Instant};

/// `MAV_PARAM_TYPE_REAL32`.
const REAL32: u8 = 9;
/// Without an autopilot this long after the start, there is none that could be armed.
const ALONE_AFTER: Duration = Duration::from_secs(10);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Gives it a flash to keep its files and parameters in, and uses those; without one there are no files, and parameters are
    /// forgotten.
    pub fn mount(&mut self, store: Store) {
        self.store = Some(store);
        self.tune();
    }

    /// Puts the parameters to use.
    pub(crate) fn tune(&mut self) {
        self.untuned = false;
        [self.config.cruise_mps, self.config.climb_mps] = self.nominal_mps;
        let parameters = *self.parameters();
        parameters.apply(&mut self.config);
        self.guidance.tune(&self.config, &self.autopilot_limits);
    }

    /// What the shell is to do with the flash next; once each, then [`Self::handle_flash`] tells how it went. Drained like the
    /// other `poll_*`, but it may take long: nothing else waits for it.
    pub fn poll_flash(&mut self) -> Option<FlashRequest<'_>> {
        let erasing = self.erasing();
        let store = self.store.as_mut()?;
        self.ftp.advance(store, self.now, erasing);
        if let Some((warning, text)) = self.ftp.text() {
            self.links.say(warning, text);
        }
        store.poll(erasing)
    }

    /// Takes in how the flash did what [`Self::poll_flash`] asked for: the bytes read, none for an erasure or a program.
    pub fn handle_flash(&mut self, now: Instant, outcome: Result<&[u8], Fault>) {
        self.now = now;
        if let Some(answer) = self.store.as_mut().and_then(|store| store.handle(outcome)) {
            self.ftp.answer(answer);
        }
    }

    /// Sectors are erased only on the ground, disarmed, and not while the roadmap is planned on.
    pub(crate) fn erasing(&self) -> Erasing {
        let idle = matches!(
            self.state,
            State::WaitAutopilot | State::WaitPosition | State::Ready | State::Done | State::Aborted
        );
        let known = self.telemetry.kind.is_some() || self.now - Instant::ZERO > ALONE_AFTER;
        match self.state {
            _ if self.telemetry.armed => Erasing::Forbidden,
            _ if idle && known => Erasing::Allowed,
            _ if idle => Erasing::NotYet,
            State::Planning => Erasing::NotYet,
            _ => Erasing::Forbidden,
        }
    }

    /// Serves a frame, if it is one for the services; whether it was.
    pub(crate) fn serve(&mut self, link: Link, sender: Sender, frame: &Frame) -> bool {
        let p = frame.padded();
        let own = (self.config.system_id, crate::COMPONENT);
        if (frame.system, frame.component) == own {
            return false;
        }
        let for_us = |at: usize| p[at] == own.0 && (p[at + 1] == own.1 || p[at + 1] == 0);
        match frame.message_id {
            ftp::MESSAGE if (p[1], p[2]) == own => {
                // From others not even answered: sessions are scarce.
                if self.store.is_some() && sender == Sender::GroundStation {
                    if ftp::changes_files(p) {
                        self.links.log_sender(
                            self.now,
                            sender,
                            "File request from #/#",
                            (frame.system, frame.component),
                        );
                    }
                    self.ftp.handle(link as usize, self.now, frame);
                }
            }
            PARAM_REQUEST_LIST_DATA::ID if for_us(0) => {
                (0..parameters::COUNT).for_each(|index| self.tell_parameter(link, sender, index));
            }
            PARAM_REQUEST_READ_DATA::ID if for_us(2) => {
                let index = i16::from_le_bytes([p[0], p[1]]);
                let found = match usize::try_from(index) {
                    Ok(index) => Some(index).filter(|index| *index < parameters::COUNT),
                    Err(_) => Parameters::index_of(name(&p[4..20])),
                };
                match found {
                    Some(index) => self.tell_parameter(link, sender, index),
                    None if p[3] == own.1 => {
                        let mut id = [0; 16];
                        id.copy_from_slice(&p[4..20]);
                        self.refuse_parameter(
                            link,
                            sender,
                            frame,
                            index,
                            id,
                            MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
                        );
                    }
                    None => {}
                }
            }
            PARAM_SET_DATA::ID if for_us(4) => self.set_parameter(link, sender, frame),
            TIMESYNC_DATA::ID => {
                // Bytes 16 and 17 name an addressee, 0 for all.
                let to_us = (p[16] == 0 || p[16] == own.0) && (p[17] == 0 || p[17] == own.1);
                if let Some(request) = frame.decode::<TIMESYNC_DATA>()
                    && request.tc1 == 0
                    && to_us
                {
                    let to = (frame.system, frame.component);
                    let tc1 = self.now.micros() as i64 * 1000;
                    let answer = Outgoing::Timesync { tc1, ts1: request.ts1, to };
                    self.links.answer(self.now, link, sender, Kind::Time, answer);
                }
            }
            _ => return false,
        }
        true
    }

    pub(crate) fn parameters(&self) -> &Parameters {
        self.store.as_ref().map_or(&self.parameters, Store::parameters)
    }

    fn tell_parameter(&mut self, link: Link, sender: Sender, index: usize) {
        if let Some((name, value)) = self.parameters().get(index) {
            let answer = Outgoing::ParameterValue { index, name, value };
            self.links.answer(self.now, link, sender, Kind::Parameter, answer);
        }
    }

    fn set_parameter(&mut self, link: Link, sender: Sender, frame: &Frame) {
        let p = frame.padded();
        let (value, kind) = (f32::from_le_bytes([p[0], p[1], p[2], p[3]]), p[22]);
        let found = Parameters::index_of(name(&p[6..22]));
        let result = match found {
            None => Err(MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST),
            Some(_) if sender != Sender::GroundStation => {
                Err(MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED)
            }
            Some(_) if kind != REAL32 => Err(MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH),
            Some(index) => {
                let result = match &mut self.store {
                    Some(store) => store.set_parameter(index, value),
                    None => self.parameters.set(index, value).map(|_| ()),
                };
                result.map_err(|why| match why {
                    Refused::Unknown => MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
                    Refused::Range => MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE,
                })
            }
        };
        self.untuned |= result.is_ok();
        if result.is_ok() {
            self.links.log_sender(
                self.now,
                sender,
                "Parameter set from #/#",
                (frame.system, frame.component),
            );
        }
        // Refused or not: the value that stands, for tools that know no PARAM_ERROR.
        if let Some(index) = found {
            self.tell_parameter(link, sender, index);
        }
        if let Err(why) = result
            && p[5] == crate::COMPONENT
        {
            let mut id = [0; 16];
            id.copy_from_slice(&p[6..22]);
            self.refuse_parameter(link, sender, frame, -1, id, why);
        }
    }

    fn refuse_parameter(
        &mut self,
        link: Link,
        sender: Sender,
        frame: &Frame,
        index: i16,
        id: [u8; 16],
        why: MavParamError,
    ) {
        let to = (frame.system, frame.component);
        let error = Outgoing::ParameterError { index, id, why: why as u8, to };
        self.links.answer(self.now, link, sender, Kind::Parameter, error);
    }

    /// PREFLIGHT_REBOOT_SHUTDOWN: this companion restarts, unless the vehicle is armed.
    pub(crate) fn restart(&mut self, command: &Command) -> u8 {
        let asked = command.param2 == 1.0 || (command.to_component && command.param1 == 1.0);
        if !asked {
            return DENIED;
        }
        if self.telemetry.armed {
            return TEMPORARILY_REJECTED;
        }
        // Full only if the shell does not drain: then it is asked again.
        match self.events.push_back(Event::RestartRequested) {
            Ok(()) => ACCEPTED,
            Err(_) => TEMPORARILY_REJECTED,
        }
    }
}

/// A parameter's name as it travels: a zero ends a shorter one.
fn name(field: &[u8]) -> &[u8] {
    field.split(|b| *b == 0).next().unwrap_or_default()
}

/// AUTOPILOT_VERSION: what it can do, and the version of this crate.
pub(crate) fn version(system_id: u8) -> AUTOPILOT_VERSION_DATA {
    let [major, minor, patch] =
        [env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")]
            .map(|part| part.parse::<u8>().unwrap_or(0));
    AUTOPILOT_VERSION_DATA {
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP,
        flight_sw_version: u32::from_be_bytes([major, minor, patch, 0]),
        uid: u64::from(system_id),
        ..AUTOPILOT_VERSION_DATA::default()
    }
}

#[cfg(test)]
mod tests;
