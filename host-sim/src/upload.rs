//! A MAVLink FTP client: uploads a file to a companion and compares the CRC-32 of both sides.
//!
//! Source: MAVLink guide, "File Transfer Protocol". Several WRITE requests are under way at once. A
//! request without an answer is sent again with the same sequence number. The timeout and the
//! number of requests under way adapt to the link (`retransmission`).

mod retransmission;

use std::collections::BTreeMap;
use std::time::{Duration, Instant as Clock};

use anyhow::{Context, bail};
use companion::link::frame::{self, Frame, Framer, Header};
use companion::services::ftp::{MAX_DATA, MESSAGE_ID, PAYLOAD_LEN};
use companion::storage::store::File;
use companion::{COMPANION_COMPONENT, Instant};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, MavType};

use self::retransmission::Retransmission;
use crate::link::ByteLink;

/// MAVLink system id of the client, unless [`FtpClient::with_own_system`] sets another one.
const DEFAULT_SYSTEM_ID: u8 = 255;
/// MAVLink component id of the client: MAV_COMP_ID_MISSIONPLANNER.
const COMPONENT_ID: u8 = 190;
/// Longest wait for an answer: the companion may have to erase its flash first, eight sectors of
/// two seconds each.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// Period of HEARTBEAT, by which autopilots know that they have to forward messages to the client.
const CLIENT_HEARTBEAT_EVERY: Duration = Duration::from_secs(1);

/// FTP opcode TerminateSession, which ends the upload.
const TERMINATE: u8 = 1;
/// FTP opcode ResetSessions.
const RESET: u8 = 2;
/// FTP opcode CreateFile.
const CREATE: u8 = 6;
/// FTP opcode WriteFile.
const WRITE: u8 = 7;
/// FTP opcode CalcFileCRC32.
const CRC32: u8 = 14;
/// FTP opcode of an answer that is no NAK.
const ACK: u8 = 128;

/// An FTP client on a link to a companion.
pub struct FtpClient {
    link: Box<dyn ByteLink>,
    framer: Framer,
    /// When the client was made.
    began: Clock,
    /// When the next HEARTBEAT is due.
    next_heartbeat_at: Clock,
    /// Sequence number of the next MAVLink frame.
    frame_sequence: u8,
    /// MAVLink system id of the client.
    own_system: u8,
    /// System id of the companion; `None` until one was heard.
    target_system: Option<u8>,
    /// FTP sequence number of the next request, and of the answer to the last one.
    sequence: u16,
    /// FTP session of the upload.
    session: u8,
    /// Timeout and number of requests under way.
    retransmission: Retransmission,
}

/// A WRITE request that is not answered yet.
struct PendingWrite {
    /// Payload of the request, kept to send it again.
    request: [u8; PAYLOAD_LEN],
    /// Number of bytes that the request writes.
    data_len: usize,
    /// When the request was last sent.
    sent_at: Clock,
    /// Whether the request was sent more than once.
    repeated: bool,
}

/// An answer of the companion: ACK or NAK.
struct FtpReply {
    /// FTP sequence number of the reply.
    sequence: u16,
    /// FTP session.
    session: u8,
    /// Whether it is an ACK.
    is_ack: bool,
    /// Opcode of the request that is answered.
    request_opcode: u8,
    /// Data of the reply.
    data: Vec<u8>,
}

impl FtpClient {
    /// A client for the companion of the vehicle `system`; with `None` of the first one heard.
    pub fn new(link: Box<dyn ByteLink>, system: Option<u8>) -> Self {
        let now = link.now();
        // Sequence numbers begin at the clock's milliseconds, to differ from those of an earlier
        // client: a server takes an equal number for a repeated request.
        let sequence = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0, |since| (since.as_millis() % 65_536) as u16);
        Self {
            link,
            framer: Framer::new(),
            began: now,
            next_heartbeat_at: now,
            frame_sequence: 0,
            own_system: DEFAULT_SYSTEM_ID,
            target_system: system,
            sequence,
            session: 0,
            retransmission: Retransmission::new(now),
        }
    }

    /// The client with `own_system` as its MAVLink system id instead of 255.
    #[must_use]
    pub fn with_own_system(self, own_system: u8) -> Self {
        Self { own_system, ..self }
    }

    /// Sends the bytes of a frame, and counts it.
    fn send_frame(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        self.frame_sequence = self.frame_sequence.wrapping_add(1);
        self.link.send(bytes).context("link lost")
    }

    /// Header of the next frame.
    fn header(&self) -> Header {
        Header { system: self.own_system, component: COMPONENT_ID, sequence: self.frame_sequence }
    }

    /// The frames that have arrived from the companion; waits a moment if no bytes have arrived.
    /// Also sends a HEARTBEAT each second, so that autopilots forward messages to this client.
    fn receive_frames(&mut self) -> anyhow::Result<Vec<Frame>> {
        if self.link.now() >= self.next_heartbeat_at {
            self.next_heartbeat_at += CLIENT_HEARTBEAT_EVERY;
            let beat = HEARTBEAT_DATA {
                mavtype: MavType::MAV_TYPE_GCS,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                mavlink_version: 3,
                ..HEARTBEAT_DATA::DEFAULT
            };
            let mut out = [0; frame::MAX_FRAME_LEN];
            let length = frame::encode(self.header(), &beat, &mut out);
            self.send_frame(&out[..length])?;
        }
        let mut buffer = [0; 2048];
        let length = self.link.receive(&mut buffer).context("link lost")?;
        if length == 0 {
            self.link.wait_briefly();
        }
        let now =
            Instant::from_micros(self.link.now().duration_since(self.began).as_micros() as u64);
        let mut input = &buffer[..length];
        let mut frames = Vec::new();
        while let Some(frame) = self.framer.next(now, &mut input) {
            let ours = self.target_system.is_none_or(|system| system == frame.system);
            frames.extend((ours && frame.component == COMPANION_COMPONENT).then_some(frame));
        }
        Ok(frames)
    }

    /// Waits up to 30 s for any frame of the companion that this client is for, or of the first
    /// companion heard; returns its system id.
    ///
    /// # Errors
    /// No companion is heard.
    pub fn wait_for_companion(&mut self) -> anyhow::Result<u8> {
        let began = self.link.now();
        while self.link.now().duration_since(began) < ANSWER_TIMEOUT {
            if let Some(frame) = self.receive_frames()?.first() {
                self.target_system = Some(frame.system);
                return Ok(frame.system);
            }
        }
        bail!(
            "no companion heard: component {COMPANION_COMPONENT}{} said nothing for {} s\nhint: between two of its ports PX4 passes \
             messages on where MAV_x_FORWARD is set for both",
            self.target_system.map_or(String::new(), |system| format!(" of system {system}")),
            ANSWER_TIMEOUT.as_secs()
        )
    }

    /// Payload of a request with the next sequence number; does not send it.
    fn request_payload(&mut self, opcode: u8, offset: u32, data: &[u8]) -> [u8; PAYLOAD_LEN] {
        let mut payload = [0; PAYLOAD_LEN];
        (payload[1], payload[2]) = (self.target_system.unwrap_or(0), COMPANION_COMPONENT);
        payload[3..5].copy_from_slice(&self.sequence.to_le_bytes());
        payload[5..8].copy_from_slice(&[self.session, opcode, data.len() as u8]);
        payload[11..15].copy_from_slice(&offset.to_le_bytes());
        payload[15..15 + data.len()].copy_from_slice(data);
        self.sequence = self.sequence.wrapping_add(1);
        payload
    }

    /// Sends the payload of a request as a frame.
    fn send_request(&mut self, payload: &[u8; PAYLOAD_LEN]) -> anyhow::Result<()> {
        let mut out = [0; frame::MAX_FRAME_LEN];
        let extra = frame::extra_crc(MESSAGE_ID).context("the dialect has FTP")?;
        let length = frame::encode_raw(self.header(), MESSAGE_ID, extra, payload, &mut out);
        self.send_frame(&out[..length])
    }

    /// The FTP answers to this client that have arrived; waits a moment if no bytes have arrived.
    fn receive_answers(&mut self) -> anyhow::Result<Vec<FtpReply>> {
        let (us, frames) = ((self.own_system, COMPONENT_ID), self.receive_frames()?);
        let for_us = frames
            .iter()
            .map(Frame::padded_payload)
            .zip(&frames)
            .filter(|(p, frame)| frame.message_id == MESSAGE_ID && (p[1], p[2]) == us);
        let read = |p: &[u8; 255]| FtpReply {
            sequence: u16::from_le_bytes([p[3], p[4]]),
            session: p[5],
            is_ack: p[6] == ACK,
            request_opcode: p[8],
            data: p[15..15 + usize::from(p[7]).min(MAX_DATA)].to_vec(),
        };
        Ok(for_us.map(|(p, _)| read(p)).collect())
    }

    /// Sends a request, again and again until it is answered; returns the answer if it is an ACK.
    fn request_until_answered(&mut self, opcode: u8, data: &[u8]) -> anyhow::Result<FtpReply> {
        let request = self.request_payload(opcode, 0, data);
        let began = self.link.now();
        let mut asked_at = began;
        self.send_request(&request)?;
        while self.link.now().duration_since(began) < ANSWER_TIMEOUT {
            if self.retransmission.back_off_if_timed_out(asked_at, self.link.now()) {
                self.send_request(&request)?;
                asked_at = self.link.now();
            }
            let sequence = self.sequence;
            let mine = |a: &FtpReply| a.sequence == sequence && a.request_opcode == opcode;
            if let Some(answer) = self.receive_answers()?.into_iter().find(mine) {
                if !answer.is_ack {
                    bail!("{}", nak_reason(&answer.data));
                }
                return Ok(answer);
            }
        }
        bail!("the companion does not answer")
    }

    /// Uploads a file; calls `progress` with the number of bytes that were acknowledged so far.
    ///
    /// # Errors
    /// The companion refuses the file, does not answer, or has stored a file with another CRC-32.
    pub fn upload(
        &mut self,
        file: File,
        bytes: &[u8],
        progress: impl Fn(u64),
    ) -> anyhow::Result<()> {
        self.request_until_answered(RESET, &[])?;
        self.session = self
            .request_until_answered(CREATE, file.name().as_bytes())
            .context("cannot begin")?
            .session;
        // Erasing the companion's flash took time that says nothing about the link's round trips.
        self.retransmission = Retransmission::new(self.link.now());
        let mut pieces = bytes.chunks(MAX_DATA).enumerate();
        let mut under_way: BTreeMap<u16, PendingWrite> = BTreeMap::new();
        let (mut arrived, mut heard_at) = (0, self.link.now());
        loop {
            while under_way.len() < self.retransmission.window()
                && let Some((i, piece)) = pieces.next()
            {
                let request = self.request_payload(WRITE, (i * MAX_DATA) as u32, piece);
                self.send_request(&request)?;
                let piece = PendingWrite {
                    request,
                    data_len: piece.len(),
                    sent_at: self.link.now(),
                    repeated: false,
                };
                under_way.insert(self.sequence, piece);
            }
            if under_way.is_empty() {
                break;
            }
            for answer in self.receive_answers()? {
                if answer.request_opcode != WRITE {
                    continue;
                }
                if !answer.is_ack {
                    bail!("{}", nak_reason(&answer.data));
                }
                if let Some(piece) = under_way.remove(&answer.sequence) {
                    arrived += piece.data_len;
                    heard_at = self.link.now();
                    // For a piece that was sent twice it is unknown which copy was answered.
                    if !piece.repeated {
                        let took = self.link.now().duration_since(piece.sent_at);
                        self.retransmission.note_round_trip(took);
                    }
                    progress(arrived as u64);
                }
            }
            if self.link.now().duration_since(heard_at) > ANSWER_TIMEOUT {
                bail!("the companion does not answer any more, after {arrived} bytes");
            }
            for piece in under_way.values_mut() {
                if self.retransmission.back_off_if_timed_out(piece.sent_at, self.link.now()) {
                    self.send_request(&piece.request)?;
                    (piece.sent_at, piece.repeated) = (self.link.now(), true);
                }
            }
        }
        self.request_until_answered(TERMINATE, &[]).context("not stored")?;
        if self.remote_crc(file).context("cannot compare")? != ftp_crc32(bytes) {
            bail!("what arrived has another CRC-32");
        }
        Ok(())
    }

    /// The CRC-32 of a file that the companion stores, computed there: [`ftp_crc32`] of the same
    /// bytes.
    ///
    /// # Errors
    /// The companion has no such file, or does not answer.
    pub fn remote_crc(&mut self, file: File) -> anyhow::Result<u32> {
        let answer = self.request_until_answered(CRC32, file.name().as_bytes())?;
        let sum = answer.data.first_chunk().context("no sum in the answer")?;
        Ok(u32::from_le_bytes(*sum))
    }
}

/// The CRC-32 of MAVLink FTP: the polynomial of zip's CRC-32, but with initial value 0 and without
/// the final inversion.
pub fn ftp_crc32(bytes: &[u8]) -> u32 {
    const FTP: crc::Algorithm<u32> = crc::Algorithm {
        init: 0,
        xorout: 0,
        check: 0x2DFD_2D88,
        residue: 0,
        ..crc::CRC_32_ISO_HDLC
    };
    crc::Crc::<u32>::new(&FTP).checksum(bytes)
}

/// Text about the error that the data of a NAK names.
fn nak_reason(data: &[u8]) -> String {
    let known = match data {
        [2, 5, ..] => {
            "the file is no such file, damaged, or the flash failed; the old one was kept"
        }
        [2, 27, ..] => "the file is too large",
        [4, ..] => "the companion was restarted",
        [5, ..] => "another client is uploading",
        [9, ..] => {
            "the companion protects its file: the vehicle is armed, or a roadmap waits for a restart already\n\
             hint: restart the companion (MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN) and upload again"
        }
        _ => return format!("the companion refuses: NAK {data:?}"),
    };
    known.to_owned()
}

#[cfg(test)]
mod tests;
