//! A companion's report of photographed waypoints of an area: TUNNEL's payload under a private
//! payload type.
//!
//! Little-endian, at most 128 bytes; more than 19 ranges take several messages, sent in turn:
//!
//! | byte | type | field |
//! |---|---|---|
//! | 0 | u8 | version, 1 |
//! | 1 | u8 | system id |
//! | 2 | u8 | round: how often the area was begun again from its first waypoint |
//! | 3 | u8 | bit 0: the sender flies, so that it may photograph more; bit 1: the ranges are all that the sender's plan leaves out, and not what it knows to be photographed |
//! | 4 | u8 | number of ranges n, 0…19 |
//! | 5 | u8 | 0 |
//! | 6 | u32 | CRC-32 of the mission file |
//! | 10 | 6 × n | ranges: u24 first waypoint, by its number on the path along all lanes of the area; u24 number of waypoints |
//!
//! A receiver rejects another version, and a system id that is not the sender's.

use heapless::Vec;
use planner_core::flight::WaypointRange;

use crate::time::Duration;

/// Private payload type of TUNNEL, in the range 32768…65535 that MAVLink leaves free.
pub const PAYLOAD_TYPE: u16 = 0xF10F;
/// Version of the payload's layout.
pub const VERSION: u8 = 1;
/// Most ranges in one message.
pub const MAX_RANGES: usize = 19;
/// Bytes of an encoded range.
pub(crate) const RANGE_LEN: usize = 6;
/// Period of the report while the vehicle is on the ground.
pub(crate) const PERIOD_ON_GROUND: Duration = Duration::from_millis(1000);
/// Period of the report while the vehicle flies.
pub(crate) const PERIOD_IN_FLIGHT: Duration = Duration::from_millis(5000);
/// Bytes of TUNNEL's own fields before the payload: type, target, length.
const TUNNEL_HEADER_LEN: usize = 5;
/// Bytes of the payload before its ranges.
const HEADER_LEN: usize = 10;
/// Longest payload of TUNNEL, bytes, with TUNNEL's own five bytes.
pub const MAX_LEN: usize = TUNNEL_HEADER_LEN + HEADER_LEN + MAX_RANGES * RANGE_LEN;

/// The report of photographed waypoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotographedReport {
    /// MAVLink system id of the sender.
    pub system_id: u8,
    /// CRC-32 of the mission file.
    pub mission_crc: u32,
    /// How often the area was begun again from its first waypoint.
    pub round: u8,
    /// Whether the sender flies, so that it may photograph more.
    pub flies: bool,
    /// Whether the ranges are all the waypoints that the sender's plan leaves out. If false, they
    /// are waypoints that it knows to be photographed, or a part of them.
    pub are_ranges_left_out_by_plan: bool,
    /// Photographed waypoints, as ranges of their numbers along all lanes of the area.
    pub ranges: Vec<WaypointRange, MAX_RANGES>,
}

/// Encodes a range as it is sent and stored: u24 first waypoint, u24 number. A range too large for
/// that becomes empty, so its waypoints are photographed again.
pub(crate) fn encode_range(range: &WaypointRange) -> [u8; RANGE_LEN] {
    let [a, b, c, over] = range.first.to_le_bytes();
    let [d, e, f, many] = range.end.saturating_sub(range.first).to_le_bytes();
    if over == 0 && many == 0 { [a, b, c, d, e, f] } else { [0; RANGE_LEN] }
}

/// Decodes what [`encode_range`] wrote.
pub(crate) fn decode_range(bytes: &[u8; RANGE_LEN]) -> WaypointRange {
    let [a, b, c, d, e, f] = *bytes;
    let first = u32::from_le_bytes([a, b, c, 0]);
    WaypointRange { first, end: first + u32::from_le_bytes([d, e, f, 0]) }
}

impl PhotographedReport {
    /// Writes TUNNEL's whole payload, addressed to all. Returns its length.
    pub fn encode(&self, out: &mut [u8; MAX_LEN]) -> usize {
        let len = HEADER_LEN + RANGE_LEN * self.ranges.len();
        out[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        (out[2], out[3], out[4]) = (0, 0, len as u8);
        let body = &mut out[TUNNEL_HEADER_LEN..];
        let count = self.ranges.len() as u8;
        body[..6].copy_from_slice(&[
            VERSION,
            self.system_id,
            self.round,
            u8::from(self.flies) | u8::from(self.are_ranges_left_out_by_plan) << 1,
            count,
            0,
        ]);
        body[6..HEADER_LEN].copy_from_slice(&self.mission_crc.to_le_bytes());
        for (to, range) in body[HEADER_LEN..].chunks_exact_mut(RANGE_LEN).zip(&self.ranges) {
            to.copy_from_slice(&encode_range(range));
        }
        TUNNEL_HEADER_LEN + len
    }

    /// Decodes TUNNEL's payload, zero-padded, from the system id `sender`. `None` if it is no
    /// report of photographed waypoints, or an invalid one.
    pub fn decode(padded: &[u8; 255], sender: u8) -> Option<Self> {
        let payload_type = u16::from_le_bytes([padded[0], padded[1]]);
        let len = usize::from(padded[4]);
        let body = padded[TUNNEL_HEADER_LEN..].get(..len.min(128))?;
        if payload_type != PAYLOAD_TYPE
            || len < HEADER_LEN
            || body[0] != VERSION
            || body[1] != sender
        {
            return None;
        }
        let count = usize::from(body[4]);
        if count > MAX_RANGES || len != HEADER_LEN + RANGE_LEN * count {
            return None;
        }
        let (ranges, _) = body[HEADER_LEN..].as_chunks();
        Some(Self {
            system_id: sender,
            mission_crc: u32::from_le_bytes([body[6], body[7], body[8], body[9]]),
            round: body[2],
            flies: body[3] & 1 != 0,
            are_ranges_left_out_by_plan: body[3] & 2 != 0,
            ranges: ranges.iter().map(decode_range).collect(),
        })
    }
}

#[cfg(test)]
mod tests;
