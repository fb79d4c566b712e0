//! The MAVLink services for ground tools, beside commands: FTP, parameters, TIMESYNC,
//! AUTOPILOT_VERSION. On both links they answer frames addressed to this system and component:
//! those of a ground station may come by the radio or through the autopilot's routing. Only a
//! ground station of the mission sets parameters and transfers files; what other senders may
//! request is in `answer_limits`.

pub mod ftp;

use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, MavParamError, MavProtocolCapability, TIMESYNC_DATA,
};

use self::ftp::Ftp;
use crate::config::Config;
use crate::config::parameters::{self, ParameterError, Parameters};
use crate::events::Link;
use crate::link::Links;
use crate::link::answer_limits::{AnswerKind, SenderKind};
use crate::link::frame::{COMPANION_COMPONENT, Frame};
use crate::link::outbox::Outgoing;
use crate::storage::store::{self, ErasePermission, FlashFault, FlashRequest, Store};
use crate::time::Instant;

/// `MAV_PARAM_TYPE_REAL32`.
const PARAM_TYPE_REAL32: u8 = 9;

/// A received frame with its link, its sender and its time of arrival.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReceivedFrame<'a> {
    pub(crate) link: Link,
    /// What kind of station sent the frame.
    pub(crate) sender: SenderKind,
    pub(crate) frame: &'a Frame,
    /// When the frame was received.
    pub(crate) now: Instant,
    /// System id of this vehicle.
    pub(crate) own_system_id: u8,
}

impl ReceivedFrame<'_> {
    /// System id and component id of the sender.
    pub(crate) fn sender_ids(&self) -> (u8, u8) {
        (self.frame.system, self.frame.component)
    }

    /// Whether another component sent the frame.
    pub(crate) fn is_from_another_component(&self) -> bool {
        self.sender_ids() != (self.own_system_id, COMPANION_COMPONENT)
    }

    /// Whether another component sent the frame to this companion. Bytes `at` and `at + 1` of the
    /// payload are the target's system and component id.
    pub(crate) fn is_for_companion(&self, at: usize) -> bool {
        let p = self.frame.padded_payload();
        self.is_from_another_component()
            && (p[at], p[at + 1]) == (self.own_system_id, COMPANION_COMPONENT)
    }

    /// As [`Self::is_for_companion`], or to all components of this vehicle.
    pub(crate) fn is_for_vehicle(&self, at: usize) -> bool {
        let p = self.frame.padded_payload();
        self.is_for_companion(at)
            || (self.is_from_another_component() && (p[at], p[at + 1]) == (self.own_system_id, 0))
    }

    /// Queues an answer, or drops it where its rate limit or the link's queue has no room.
    fn queue_answer(&self, links: &mut Links, kind: AnswerKind, answer: Outgoing) {
        links.queue_answer(self.now, self.link, self.sender, kind, answer);
    }
}

/// The MAVLink services, with the flash that keeps files and parameters.
#[derive(Clone, Debug)]
pub(crate) struct Services {
    /// The flash store; `None` without a flash.
    store: Option<Store>,
    /// The parameters, where there is no flash to keep them.
    parameters: Parameters,
    /// The FTP server.
    ftp: Ftp,
    /// Cruise, climb and descent speed of the mission, m/s; the parameters may lower the speeds in
    /// use.
    mission_speeds_mps: [f32; 3],
    /// Whether a parameter was set since [`Self::apply_parameters`].
    parameters_unapplied: bool,
}

impl Services {
    /// Without a flash: no files, and parameters are lost at a restart.
    pub(crate) fn new<const V: usize>(config: &Config<V>) -> Self {
        let mission_speeds_mps = [config.cruise_mps, config.climb_mps, config.descend_mps];
        let (parameters, ftp) = (Parameters::default(), Ftp::default());
        Self { store: None, parameters, ftp, mission_speeds_mps, parameters_unapplied: false }
    }

    /// Keeps files and parameters in this flash from now on.
    pub(crate) fn attach_store(&mut self, store: Store) {
        self.store = Some(store);
    }

    /// The photographed waypoints of an area as stored in flash; empty where there are none.
    pub(crate) fn photographed_record(&self) -> &[u8] {
        self.store.as_ref().map_or(&[], Store::photographed_record)
    }

    /// Stores the photographed waypoints in flash.
    pub(crate) fn set_photographed_record(&mut self, photographed: store::PhotographedRecord) {
        if let Some(store) = &mut self.store {
            store.set_photographed_record(photographed);
        }
    }

    /// Whether a parameter was set since [`Self::apply_parameters`].
    pub(crate) fn has_unapplied_parameters(&self) -> bool {
        self.parameters_unapplied
    }

    /// Writes the parameters into the companion's settings, from which they take effect.
    pub(crate) fn apply_parameters<const V: usize>(&mut self, config: &mut Config<V>) {
        self.parameters_unapplied = false;
        [config.cruise_mps, config.climb_mps, config.descend_mps] = self.mission_speeds_mps;
        self.parameters().apply(config);
    }

    /// The next operation for the shell's flash; `None` where there is nothing to do. Sectors are
    /// erased only if `erasing` allows.
    pub(crate) fn poll_flash(
        &mut self,
        now: Instant,
        erasing: ErasePermission,
        links: &mut Links,
    ) -> Option<FlashRequest<'_>> {
        let store = self.store.as_mut()?;
        self.ftp.continue_work(store, now, erasing);
        if let Some((severity, text)) = self.ftp.take_text() {
            links.send_text(severity, text);
        }
        store.poll_request(erasing)
    }

    /// Handles the outcome of the flash operation: the bytes read, none for an erasure or a
    /// program.
    pub(crate) fn handle_flash(&mut self, outcome: Result<&[u8], FlashFault>) {
        if let Some(answer) =
            self.store.as_mut().and_then(|store| store.handle_flash_outcome(outcome))
        {
            self.ftp.handle_read_outcome(answer);
        }
    }

    /// The next FTP reply for a link.
    pub(crate) fn poll_ftp(&mut self, link: Link) -> Option<[u8; ftp::PAYLOAD_LEN]> {
        self.ftp.poll_reply(link as usize)
    }

    /// Handles FILE_TRANSFER_PROTOCOL.
    pub(crate) fn handle_ftp(&mut self, heard: &ReceivedFrame<'_>, links: &mut Links) {
        // An FTP request of another sender gets no answer: there is only one session.
        if self.store.is_none() || heard.sender != SenderKind::GroundStation {
            return;
        }
        if ftp::changes_files(heard.frame.padded_payload()) {
            let text = "File request from #/#";
            links.send_text_with_sender(heard.now, heard.sender, text, heard.sender_ids());
        }
        self.ftp.queue_request(heard.link as usize, heard.now, heard.frame);
    }

    /// Answers PARAM_REQUEST_LIST.
    pub(crate) fn send_parameters(&self, heard: &ReceivedFrame<'_>, links: &mut Links) {
        (0..parameters::PARAMETER_COUNT).for_each(|index| self.send_parameter(heard, index, links));
    }

    /// The values of the parameters, as stored in flash if there is one.
    pub(crate) fn parameters(&self) -> &Parameters {
        self.store.as_ref().map_or(&self.parameters, Store::parameters)
    }

    /// Answers PARAM_REQUEST_READ.
    pub(crate) fn handle_parameter_read(&self, heard: &ReceivedFrame<'_>, links: &mut Links) {
        let p = heard.frame.padded_payload();
        let index = i16::from_le_bytes([p[0], p[1]]);
        let found = match usize::try_from(index) {
            Ok(index) => Some(index).filter(|index| *index < parameters::PARAMETER_COUNT),
            Err(_) => Parameters::index_of(parameter_name(&p[4..20])),
        };
        match found {
            Some(index) => self.send_parameter(heard, index, links),
            None if p[3] == COMPANION_COMPONENT => {
                let why = MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST;
                refuse_parameter(heard, index, &p[4..20], why, links);
            }
            None => {}
        }
    }

    /// Answers a frame with the value of the parameter of this index, if there is one.
    fn send_parameter(&self, heard: &ReceivedFrame<'_>, index: usize, links: &mut Links) {
        if let Some((name, value)) = self.parameters().get(index) {
            let count = parameters::PARAMETER_COUNT as u16;
            let answer = Outgoing::ParameterValue { index, count, name, value };
            heard.queue_answer(links, AnswerKind::Parameter, answer);
        }
    }

    /// Sets a parameter; it takes effect at the next [`Self::apply_parameters`].
    pub(crate) fn set_parameter_value(
        &mut self,
        index: usize,
        value: f32,
    ) -> Result<(), ParameterError> {
        match &mut self.store {
            Some(store) => store.set_parameter(index, value),
            None => self.parameters.set(index, value).map(|_| ()),
        }
    }

    /// Handles PARAM_SET.
    pub(crate) fn handle_parameter_set(&mut self, heard: &ReceivedFrame<'_>, links: &mut Links) {
        let p = heard.frame.padded_payload();
        let (value, kind) = (f32::from_le_bytes([p[0], p[1], p[2], p[3]]), p[22]);
        let found = Parameters::index_of(parameter_name(&p[6..22]));
        let result = match found {
            None => Err(MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST),
            Some(_) if heard.sender != SenderKind::GroundStation => {
                Err(MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED)
            }
            Some(_) if kind != PARAM_TYPE_REAL32 => {
                Err(MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH)
            }
            Some(index) => self.set_parameter_value(index, value).map_err(|why| match why {
                ParameterError::Unknown => MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
                ParameterError::Range => MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE,
            }),
        };
        self.parameters_unapplied |= result.is_ok();
        if result.is_ok() {
            links.send_text_with_sender(
                heard.now,
                heard.sender,
                "Parameter set from #/#",
                heard.sender_ids(),
            );
        }
        // Also after a refusal the value in use is sent, for tools that do not know PARAM_ERROR.
        if let Some(index) = found {
            self.send_parameter(heard, index, links);
        }
        if let Err(why) = result
            && p[5] == COMPANION_COMPONENT
        {
            refuse_parameter(heard, -1, &p[6..22], why, links);
        }
    }
}

/// Answers with PARAM_ERROR; `index` is the one requested, −1 if the request had a name.
fn refuse_parameter(
    heard: &ReceivedFrame<'_>,
    index: i16,
    name: &[u8],
    why: MavParamError,
    links: &mut Links,
) {
    let mut id = [0; 16];
    id.copy_from_slice(name);
    let error = Outgoing::ParameterError { index, id, why: why as u8, to: heard.sender_ids() };
    heard.queue_answer(links, AnswerKind::Parameter, error);
}

/// Answers a TIMESYNC request to this vehicle or to all. Bytes 16 and 17 of its payload are the
/// target's system and component id, 0 for all.
pub(crate) fn answer_timesync(heard: &ReceivedFrame<'_>, links: &mut Links) {
    let p = heard.frame.padded_payload();
    let to_our_system = (p[16] == 0 || p[16] == heard.own_system_id)
        && (p[17] == 0 || p[17] == COMPANION_COMPONENT);
    let request =
        heard.frame.decode::<TIMESYNC_DATA>().filter(|request| request.tc1 == 0 && to_our_system);
    if let Some(request) = request {
        let tc1 = heard.now.as_micros() as i64 * 1000;
        heard.queue_answer(
            links,
            AnswerKind::Timesync,
            Outgoing::Timesync { tc1, ts1: request.ts1, to: heard.sender_ids() },
        );
    }
}

/// A parameter's name in its 16-byte MAVLink field: up to the first zero byte.
fn parameter_name(field: &[u8]) -> &[u8] {
    field.split(|b| *b == 0).next().unwrap_or_default()
}

/// AUTOPILOT_VERSION of the companion: its capabilities, and this crate's version.
pub(crate) fn autopilot_version(system_id: u8) -> AUTOPILOT_VERSION_DATA {
    let [major, minor, patch] = [
        env!("CARGO_PKG_VERSION_MAJOR"),
        env!("CARGO_PKG_VERSION_MINOR"),
        env!("CARGO_PKG_VERSION_PATCH"),
    ]
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
