//! MAVLink framing of the simulated autopilots. It shares no code with the companion's, so that a
//! bug in one is not hidden by the same bug in the other.
//!
//! Source: MAVLink guide, "Packet Serialization". The `mavlink` crate provides message types,
//! CRC_EXTRA and the checksum; its reader is not used, because it blocks on a stream, and bytes
//! here arrive whenever the simulation has some.
//!
//! Of overlapping candidate frames the first with a correct checksum counts; after a wrong checksum
//! the search continues behind the candidate's start byte. An incomplete frame is dropped
//! `PARTIAL_LIFETIME_US` after its first byte.

use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message, MessageData, calculate_crc};

/// Time from its first byte until an incomplete frame is dropped, microseconds.
const PARTIAL_LIFETIME_US: u64 = 100_000;
/// Longest frame without signature, bytes: header 10, payload 255, CRC 2.
pub const MAX_FRAME_LEN: usize = 267;

const V1_START: u8 = 0xFE;
const V2_START: u8 = 0xFD;
/// Length of a MAVLink 1 header, bytes.
const V1_HEADER: usize = 6;
/// Length of a MAVLink 2 header, bytes.
const V2_HEADER: usize = 10;
/// Incompatibility flag of a MAVLink 2 frame: a signature follows. A frame with any other flag is
/// not read.
const FLAG_SIGNED: u8 = 1;
/// COMPONENT_INFORMATION, the only message whose CRC_EXTRA is 0; the crate returns 0 for unknown
/// ids too.
const ZERO_CRC_EXTRA_ID: u32 = 395;

/// A received frame whose checksum is correct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckedFrame {
    /// System id of the sender.
    pub system: u8,
    /// Component id of the sender.
    pub component: u8,
    /// Sequence number of the frame, counted by its sender.
    pub sequence: u8,
    /// Message id.
    pub message_id: u32,
    /// Length of the received payload, bytes.
    len: usize,
    /// The payload, padded with zeros beyond `len`.
    payload: [u8; 255],
}

impl CheckedFrame {
    /// The payload, padded with the zeros that MAVLink 2 cuts from its end.
    pub fn padded_payload(&self) -> &[u8; 255] {
        &self.payload
    }

    /// Decodes a frame from its bytes, which include the CRC but no signature.
    fn from_bytes(bytes: &[u8]) -> Self {
        let header = header_len(bytes);
        // In the header sequence number, system and component precede the message id.
        let at = if header == V1_HEADER { 2 } else { 4 };
        let received = &bytes[header..bytes.len() - 2];
        let mut payload = [0; 255];
        payload[..received.len()].copy_from_slice(received);
        Self {
            sequence: bytes[at],
            system: bytes[at + 1],
            component: bytes[at + 2],
            message_id: message_id(bytes),
            len: received.len(),
            payload,
        }
    }

    /// Appends this frame to `out` as a MAVLink 2 frame with the same sender and sequence number.
    pub fn write(&self, out: &mut Vec<u8>) {
        if let Some(seed) = crc_extra(self.message_id) {
            let sender = (self.system, self.component, self.sequence);
            write_raw(sender, self.message_id, seed, &self.payload[..self.len], out);
        }
    }
}

/// CRC_EXTRA of a message id; `None` if the dialect does not know the id.
pub fn crc_extra(message_id: u32) -> Option<u8> {
    let seed = MavMessage::extra_crc(message_id);
    (seed != 0 || message_id == ZERO_CRC_EXTRA_ID).then_some(seed)
}

/// Appends a message to `out` as a MAVLink 2 frame. `sender` is system id, component id and
/// sequence number.
pub fn write_message<M: MessageData>(sender: (u8, u8, u8), message: &M, out: &mut Vec<u8>) {
    let mut payload = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut payload);
    write_raw(sender, M::ID, M::EXTRA_CRC, &payload[..len], out);
}

/// Like [`write_message`], for an encoded payload of at most 255 bytes. Zeros at its end are cut,
/// but its first byte stays.
pub fn write_raw(
    sender: (u8, u8, u8),
    message_id: u32,
    seed: u8,
    payload: &[u8],
    out: &mut Vec<u8>,
) {
    let cut = payload.iter().rev().take_while(|&&byte| byte == 0).count();
    let len = (payload.len() - cut).max(payload.len().min(1));
    let (system, component, sequence) = sender;
    let [a, b, c, _] = message_id.to_le_bytes();
    let start = out.len();
    out.extend([V2_START, len as u8, 0, 0, sequence, system, component, a, b, c]);
    out.extend(&payload[..len]);
    let crc = calculate_crc(&out[start + 1..], seed);
    out.extend(crc.to_le_bytes());
}

/// Result of parsing the start of the buffer.
enum ParsedFront {
    /// An incomplete frame.
    Partial,
    /// No frame begins here.
    Noise,
    /// A frame with a correct checksum; its length without signature, bytes.
    Whole(usize),
}

/// Finds frames with a correct checksum in the bytes received at one port.
#[derive(Clone, Debug, Default)]
pub struct PortFramer {
    /// Bytes that belong to no complete frame yet, oldest first.
    bytes: Vec<u8>,
    /// Time at which each byte arrived, microseconds since boot.
    arrival_us: Vec<u64>,
}

impl PortFramer {
    /// Adds all of `input`, received at `now_us`, to the buffer and returns the next whole frame in
    /// it; `None` if there is none.
    pub fn next(&mut self, now_us: u64, input: &mut &[u8]) -> Option<CheckedFrame> {
        self.bytes.extend_from_slice(input);
        self.arrival_us.resize(self.bytes.len(), now_us);
        *input = &[];
        loop {
            let noise = self.bytes.iter().position(|byte| matches!(*byte, V1_START | V2_START));
            self.drop_first(noise.unwrap_or(self.bytes.len()));
            let first_us = *self.arrival_us.first()?;
            match parse_front(&self.bytes) {
                ParsedFront::Whole(total) => {
                    let frame = CheckedFrame::from_bytes(&self.bytes[..total]);
                    self.drop_first(total);
                    return Some(frame);
                }
                ParsedFront::Partial if now_us <= first_us + PARTIAL_LIFETIME_US => return None,
                ParsedFront::Partial | ParsedFront::Noise => self.drop_first(1),
            }
        }
    }

    /// Removes the first `count` bytes.
    fn drop_first(&mut self, count: usize) {
        self.bytes.drain(..count);
        self.arrival_us.drain(..count);
    }
}

/// Parses the frame that begins with the first byte, which is a start byte.
fn parse_front(bytes: &[u8]) -> ParsedFront {
    let header = header_len(bytes);
    if header == V2_HEADER && bytes.get(2).is_some_and(|flags| flags & !FLAG_SIGNED != 0) {
        return ParsedFront::Noise;
    }
    if bytes.len() < header {
        return ParsedFront::Partial;
    }
    let Some(seed) = crc_extra(message_id(bytes)) else { return ParsedFront::Noise };
    let end = header + usize::from(bytes[1]);
    let Some(&[low, high]) = bytes.get(end..end + 2) else { return ParsedFront::Partial };
    if calculate_crc(&bytes[1..end], seed) == u16::from_le_bytes([low, high]) {
        ParsedFront::Whole(end + 2)
    } else {
        ParsedFront::Noise
    }
}

/// Length of the header that begins with these bytes.
fn header_len(bytes: &[u8]) -> usize {
    if bytes[0] == V1_START { V1_HEADER } else { V2_HEADER }
}

/// Message id in a complete header.
fn message_id(bytes: &[u8]) -> u32 {
    match header_len(bytes) {
        V1_HEADER => u32::from(bytes[5]),
        _ => u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
    }
}

#[cfg(test)]
mod tests;
