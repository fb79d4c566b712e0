//! A companion's report of the state of all vehicles of a coverage mission: TUNNEL's payload under
//! a private payload type.
//!
//! Little-endian, at most 128 bytes; more than 22 vehicles take two messages:
//!
//! | byte | type | field |
//! |---|---|---|
//! | 0 | u8 | version, 2 |
//! | 1 | u8 | system id |
//! | 2 | u8 | bits 0–3: number of committed divisions, those on whose hash all that take part agreed; 6: whether the sender hears a vehicle that sets bit 7; 7: whether the sender was started and takes part |
//! | 3 | u8 | rank of the first vehicle below |
//! | 4 | u8 | number of vehicles n, 1…22 |
//! | 5 | u8 | plan of the sender's flight, before any division: the four bytes of its CRC-32 combined by exclusive or, 1 for 0; 0 while it has none |
//! | 6 | u32 | CRC-32 of the mission file |
//! | 10 | u32 | hash of the last committed division; 0 for none |
//! | 14 | u32 | hash of the division under way, as the sender computed it; 0 for none |
//! | 18 | 5 × n | the vehicles by rank: flags (bits 0–1 status, 2 whether its commitment is stated, 3 whether it holds there, 4 whether it computed the sender's hash too, 5–7 incarnation), u16 progress and u16 commitment, dm along its path |
//!
//! A receiver rejects another version, and a system id that is not the sender's.

use heapless::Vec;

/// Private payload type of TUNNEL, in the range 32768…65535 that MAVLink leaves free.
pub const PAYLOAD_TYPE: u16 = 0xF10E;
/// Version of the payload's layout.
pub const VERSION: u8 = 2;
/// Most vehicles in one message.
pub const MAX_ENTRIES_PER_MESSAGE: usize = 22;
/// Bytes of TUNNEL's own fields before the payload: type, target, length.
const TUNNEL_HEADER_LEN: usize = 5;
/// Bytes of the payload before its vehicles.
const HEADER_LEN: usize = 18;
/// Length of a vehicle's entry in the report, bytes.
const ENTRY_LEN: usize = 5;
/// Bits of byte 2 with the number of committed divisions.
const DIVISIONS_MASK: u8 = 15;
/// Bit of byte 2: the sender hears a vehicle that sets [`HAS_STARTED`].
const HEARS_STARTED_VEHICLE: u8 = 1 << 6;
/// Bit of byte 2: the sender was started and takes part; it may still be on its pad.
const HAS_STARTED: u8 = 1 << 7;
/// Longest payload of TUNNEL, bytes, with TUNNEL's own five bytes.
pub const MAX_LEN: usize = TUNNEL_HEADER_LEN + HEADER_LEN + MAX_ENTRIES_PER_MESSAGE * ENTRY_LEN;

/// Whether a vehicle takes part in the coverage mission. Of two reports about a vehicle, the status
/// that is later in this list counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum ShareStatus {
    /// The vehicle flies its share of the area, or will.
    #[default]
    Alive,
    /// The other vehicles have not heard it for so long that they divide its share among them.
    Lost,
    /// The vehicle reports that it flies its share no further: the others divide what is left of
    /// it.
    Left,
    /// The vehicle reports that it flies no further and that its whole share is photographed.
    Finished,
}

impl ShareStatus {
    /// Every status, in the order of its number in the report.
    const ALL: [Self; 4] = [Self::Alive, Self::Lost, Self::Left, Self::Finished];

    /// The status that counts in another plan or division than the one that it was reported of. A
    /// vehicle that had finished its part may have another part there: it counts as having left.
    pub(crate) fn seen_from_another_division(self) -> Self {
        if self == Self::Finished { Self::Left } else { self }
    }
}

/// State of one vehicle of the roster, as the sender of the report knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RosterReportEntry {
    /// Number of this vehicle's flight, 0…7, then 0 again: reports of an earlier flight do not
    /// count.
    pub incarnation: u8,
    /// Whether the vehicle takes part.
    pub status: ShareStatus,
    /// Progress of the vehicle along its own path, decimetres.
    pub progress_dm: u16,
    /// The vehicle's commitment: place along its path up to which it flies before it holds for the
    /// division, decimetres, 0 on its pad. `None` while it has not stated one.
    pub commitment_dm: Option<u16>,
    /// Whether the vehicle holds at its commitment.
    pub holds: bool,
    /// Whether the vehicle computed the same hash of the division under way as the sender.
    pub agrees: bool,
}

impl RosterReportEntry {
    /// The entry without what depends on the plan and division: places along the path, hold and
    /// agreement.
    pub(crate) fn without_places(&self) -> Self {
        Self { incarnation: self.incarnation, status: self.status, ..Self::default() }
    }

    /// The entry as it counts in another plan or division than the one that it was reported of.
    pub(crate) fn seen_from_another_division(&self) -> Self {
        Self { status: self.status.seen_from_another_division(), ..self.without_places() }
    }
}

/// The roster report, with at most [`MAX_ENTRIES_PER_MESSAGE`] vehicles.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct RosterReport {
    /// MAVLink system id of the sender.
    pub system_id: u8,
    /// Number of committed divisions, on whose hash all that take part agreed, as the sender knows;
    /// at most 15.
    pub division_count: u8,
    /// Whether the sender was started and takes part; it may still be on its pad.
    pub has_started: bool,
    /// Whether the sender hears another vehicle that was started and takes part.
    pub hears_started_vehicle: bool,
    /// Rank of the vehicle of the first entry.
    pub first_rank: u8,
    /// 8 bits of the CRC of the plan of the sender's flight, before any division; 0 while it has
    /// none. Places along paths and divisions are of that plan.
    pub plan_crc8: u8,
    /// CRC-32 of the mission file.
    pub mission_crc: u32,
    /// Hash of the last committed division; 0 for none.
    pub committed_hash: u32,
    /// Hash of the division under way, as the sender computed it; 0 for none.
    pub pending_hash: u32,
    /// States of consecutive vehicles of the roster, by rank.
    pub entries: Vec<RosterReportEntry, MAX_ENTRIES_PER_MESSAGE>,
}

impl RosterReport {
    /// Writes TUNNEL's whole payload, addressed to all. Returns its length.
    pub fn encode(&self, out: &mut [u8; MAX_LEN]) -> usize {
        let len = HEADER_LEN + ENTRY_LEN * self.entries.len();
        out[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        (out[2], out[3], out[4]) = (0, 0, len as u8);
        let body = &mut out[TUNNEL_HEADER_LEN..];
        let count = self.entries.len() as u8;
        let Self { system_id, first_rank, plan_crc8, .. } = *self;
        let divisions = self.division_count & DIVISIONS_MASK
            | if self.hears_started_vehicle { HEARS_STARTED_VEHICLE } else { 0 }
            | if self.has_started { HAS_STARTED } else { 0 };
        body[..6].copy_from_slice(&[VERSION, system_id, divisions, first_rank, count, plan_crc8]);
        body[6..10].copy_from_slice(&self.mission_crc.to_le_bytes());
        body[10..14].copy_from_slice(&self.committed_hash.to_le_bytes());
        body[14..18].copy_from_slice(&self.pending_hash.to_le_bytes());
        for (to, entry) in body[HEADER_LEN..].chunks_exact_mut(ENTRY_LEN).zip(&self.entries) {
            let bit = |set: bool, at: u8| u8::from(set) << at;
            to[0] = entry.status as u8
                | bit(entry.commitment_dm.is_some(), 2)
                | bit(entry.holds, 3)
                | bit(entry.agrees, 4)
                | entry.incarnation << 5;
            to[1..3].copy_from_slice(&entry.progress_dm.to_le_bytes());
            to[3..5].copy_from_slice(&entry.commitment_dm.unwrap_or(0).to_le_bytes());
        }
        TUNNEL_HEADER_LEN + len
    }

    /// Decodes TUNNEL's payload, zero-padded, from the system id `sender`. `None` if it is no
    /// roster report, or an invalid one.
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
        if count == 0 || count > MAX_ENTRIES_PER_MESSAGE || len != HEADER_LEN + ENTRY_LEN * count {
            return None;
        }
        let word =
            |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
        let entry = |b: &[u8]| {
            let set = |at: u8| b[0] >> at & 1 != 0;
            RosterReportEntry {
                incarnation: b[0] >> 5,
                status: ShareStatus::ALL[usize::from(b[0] & 3)],
                progress_dm: u16::from_le_bytes([b[1], b[2]]),
                commitment_dm: set(2).then(|| u16::from_le_bytes([b[3], b[4]])),
                holds: set(3),
                agrees: set(4),
            }
        };
        Some(Self {
            system_id: sender,
            division_count: body[2] & DIVISIONS_MASK,
            has_started: body[2] & HAS_STARTED != 0,
            hears_started_vehicle: body[2] & HEARS_STARTED_VEHICLE != 0,
            first_rank: body[3],
            plan_crc8: body[5],
            mission_crc: word(6),
            committed_hash: word(10),
            pending_hash: word(14),
            entries: body[HEADER_LEN..].chunks_exact(ENTRY_LEN).map(entry).collect(),
        })
    }
}

#[cfg(test)]
mod tests;
