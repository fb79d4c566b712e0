//! Relays: a vehicle sends the progress of vehicles that it hears on to neighbours that do not.
//!
//! The order of the schedule needs the progress of vehicles that may be out of radio range by then.
//! So each vehicle relays, once a second at most, the progress of those that one of its neighbours
//! does not hear: nothing at all while everybody hears everybody. Relayed progress opens gates; it
//! may be old, as progress never falls. A vehicle that is not heard, but follows the shared plan by
//! a recent relay, counts neither as lost nor as possibly nearby: gates keep it apart. A vehicle's
//! own reports go before what others relay of it.
//! The payload of TUNNEL under a private payload type, little-endian, at most 122 bytes:
//!
//! | byte | type | field |
//! |---|---|---|
//! | 0 | u8 | version, 3 |
//! | 1 | u8 | system id, the sender's |
//! | 2 | u8 | number n of vehicles, 0…10 |
//! | 3 | u8 | 0 |
//! | 4 | u32 | CRC-32 of the mission file |
//! | 8 | u32 | CRC-32 of the swarm's plan |
//! | 12 + 11 i | u8 | rank in the roster sorted by system id |
//! | 13 + 11 i | u8 | age of the vehicle's report, 0.1 s; 255: 25.5 s or older |
//! | 14 + 11 i | f32 | the vehicle's progress along its path of the plan, metres |
//! | 18 + 11 i | f32 | place up to which its gates are open or will be, metres, as it reported it |
//! | 22 + 11 i | u8 | seconds by which gates and climb delay its flight |

use heapless::Vec;

use super::Neighbours;
use super::bounds::{HEARD_DIRECTLY_WITHIN, HEARD_WITHIN};
use super::entry::NeighbourEntry;
use crate::time::{Duration, Instant};

/// Our payload type, in the range that MAVLink leaves to private use (32768…65535).
pub(crate) const PAYLOAD_TYPE: u16 = 0xF10D;
/// Maximum number of vehicles relayed in one message.
const MAX_RELAYED: usize = 10;
/// Version of the payload's layout.
const VERSION: u8 = 3;
/// Bytes of TUNNEL before its payload.
const TUNNEL_HEADER_LEN: usize = 5;
/// Bytes of the payload before the first vehicle's report.
const HEADER_LEN: usize = 12;
/// Bytes of one vehicle's report.
const ITEM_LEN: usize = 11;
/// Longest TUNNEL payload, bytes.
pub(crate) const MAX_LEN: usize = TUNNEL_HEADER_LEN + HEADER_LEN + MAX_RELAYED * ITEM_LEN;
/// Silence after which a vehicle that others still hear is out of range; shorter silence may be
/// lost messages.
const OUT_OF_RANGE_AFTER: Duration = Duration::from_secs(3);
/// Age up to which a relayed report that a vehicle follows the plan counts: three hops, and the
/// loss of a message.
const RELAYED_LIFETIME: Duration = Duration::from_secs(6);
/// Least age that each relay adds to a report, microseconds: longer than most messages take. Where
/// the messages' measured delay is longer, that is added: otherwise a report relayed in a circle
/// stays young.
const MIN_HOP_AGE_US: u64 = 500_000;
/// Time that each relay adds to the reported delay of a vehicle's flight, seconds: a relay adds
/// more age to a report than the message took, so the progress reckoned from that age would be too
/// far.
const HOP_DELAY_S: u8 = 1;
/// Unit of an age in the message, microseconds.
const AGE_TICK_US: u64 = 100_000;

/// Relayed report of the vehicle of one rank: its progress, and how far and how late the vehicle
/// flies on though no other vehicle hears it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RelayedProgress {
    /// Rank of the vehicle.
    rank: u8,
    /// Age of the report, in units of 0.1 s.
    age_ticks: u8,
    /// Progress along the vehicle's path of the plan, metres.
    progress_m: f32,
    /// Place along that path up to which the vehicle's gates are open or will be, metres.
    gates_open_up_to_m: f32,
    /// Delay of the flight to that place by gates and climb, seconds.
    unheard_flight_delay_s: u8,
}

/// A relay message: the reports of several vehicles, as one vehicle sends them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Relay {
    /// CRC-32 of the sender's mission file.
    pub(crate) mission_crc: u32,
    /// CRC-32 of the swarm's plan that the sender has.
    pub(crate) plan_crc: u32,
    /// The reports.
    items: Vec<RelayedProgress, MAX_RELAYED>,
}

impl Relay {
    /// Whether the message has no report.
    pub(crate) fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Writes the whole TUNNEL payload, addressed to all. Returns its length, bytes.
    pub(crate) fn encode(&self, system_id: u8, out: &mut [u8; MAX_LEN]) -> usize {
        let len = HEADER_LEN + ITEM_LEN * self.items.len();
        out[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        (out[2], out[3], out[4]) = (0, 0, len as u8);
        let body = &mut out[TUNNEL_HEADER_LEN..];
        body[..4].copy_from_slice(&[VERSION, system_id, self.items.len() as u8, 0]);
        body[4..8].copy_from_slice(&self.mission_crc.to_le_bytes());
        body[8..12].copy_from_slice(&self.plan_crc.to_le_bytes());
        for (to, item) in body[HEADER_LEN..].chunks_exact_mut(ITEM_LEN).zip(&self.items) {
            (to[0], to[1]) = (item.rank, item.age_ticks);
            to[2..6].copy_from_slice(&item.progress_m.to_le_bytes());
            to[6..10].copy_from_slice(&item.gates_open_up_to_m.to_le_bytes());
            to[10] = item.unheard_flight_delay_s;
        }
        TUNNEL_HEADER_LEN + len
    }

    /// Reads a TUNNEL payload, zero-padded, from system `sender`; `None` if it is not a valid relay
    /// message.
    pub(crate) fn decode(padded: &[u8; 255], sender: u8) -> Option<Self> {
        let body = padded[TUNNEL_HEADER_LEN..].get(..usize::from(padded[4]))?;
        let is_ours = u16::from_le_bytes([padded[0], padded[1]]) == PAYLOAD_TYPE;
        if !is_ours || body.len() < HEADER_LEN || body[0] != VERSION || body[1] != sender {
            return None;
        }
        let word =
            |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
        let mut relay = Self { mission_crc: word(4), plan_crc: word(8), items: Vec::new() };
        for item in
            body[HEADER_LEN..].get(..ITEM_LEN * usize::from(body[2]))?.chunks_exact(ITEM_LEN)
        {
            let float = |at: usize| {
                f32::from_le_bytes([item[at], item[at + 1], item[at + 2], item[at + 3]])
            };
            let item = RelayedProgress {
                rank: item[0],
                age_ticks: item[1],
                progress_m: float(2),
                gates_open_up_to_m: float(6),
                unheard_flight_delay_s: item[10],
            };
            // All reports that a payload holds fit into the list.
            let finite = item.progress_m.is_finite() && item.gates_open_up_to_m.is_finite();
            relay.items.push(item).ok().filter(|()| finite)?;
        }
        Some(relay)
    }
}

impl NeighbourEntry {
    /// Whether the neighbour is silent, but vehicles that heard it longer than this one lately
    /// relayed that it follows the plan: then it is out of range. A vehicle that all heard up to
    /// the same moment has failed.
    #[inline(never)]
    pub(super) fn is_reported_out_of_range(&self, now: Instant) -> bool {
        let longer =
            |at: Instant| self.heard_at.is_none_or(|heard| at > heard + HEARD_DIRECTLY_WITHIN);
        self.relayed_report_at.is_some_and(|at| now - at < RELAYED_LIFETIME && longer(at))
            && !self.heard_within(now, OUT_OF_RANGE_AFTER)
            && self.heard_progress_m(now).is_some()
    }

    /// The neighbour's report as it is to be relayed; `None` if the neighbour is off the plan, or
    /// was never heard.
    fn progress_to_relay(&self, now: Instant) -> Option<RelayedProgress> {
        let progress_m = self.heard_progress_m(now)?;
        let age_ticks =
            (now - self.intent_at.max(self.relayed_report_at)?).as_micros().div_ceil(AGE_TICK_US);
        let age_ticks = age_ticks.min(u64::from(u8::MAX)) as u8;
        Some(RelayedProgress {
            rank: self.rank as u8,
            age_ticks,
            progress_m,
            gates_open_up_to_m: libm::fmaxf(self.gates_open_up_to_m, progress_m),
            unheard_flight_delay_s: self.unheard_flight_delay_s,
        })
    }
}

impl<const V: usize> Neighbours<V> {
    /// The next relay message: the reports of vehicles that some neighbour does not hear, from the
    /// rank on that no longer fitted into the last message.
    pub(crate) fn next_relay(&mut self, now: Instant, mission_crc: u32, plan_crc: u32) -> Relay {
        let mut relay = Relay { mission_crc, plan_crc, items: Vec::new() };
        let roster = &self.entries[..self.roster_count];
        let speaking = || roster.iter().filter(|c| c.heard_within(now, HEARD_WITHIN));
        // A relay goes to all, even if one neighbour alone does not hear the vehicle.
        let missed = |c: &NeighbourEntry| {
            speaking().any(|by| by.rank != c.rank && by.heard_bits & (1 << c.rank) == 0)
        };
        let first = roster.partition_point(|c| c.rank < self.next_relayed_rank);
        let mut next = self.next_relayed_rank;
        let turn = roster[first..].iter().chain(&roster[..first]);
        for entry in turn.filter(|c| c.rank < 32 && missed(c)) {
            let Some(item) = entry.progress_to_relay(now) else { continue };
            if relay.items.push(item).is_err() {
                next = entry.rank;
                break;
            }
        }
        self.next_relayed_rank = next;
        relay
    }

    /// Handles a relay of our plan from the vehicle `from` (system id) of the roster.
    pub(crate) fn handle_relay(&mut self, now: Instant, from: u8, relay: &Relay) {
        let Some(by) = self.active_roster_index(from, now) else { return };
        let hop_us = (self.entries[by].message_delay.delay_s * 1e6) as u64;
        for item in &relay.items {
            let Some(at) = self.index_of_rank(item.rank) else { continue };
            let (fastest_mps, entry) = (self.max_progress_mps, &mut self.entries[at]);
            if entry.heard_within(now, HEARD_DIRECTLY_WITHIN) {
                continue;
            }
            let known_m = entry.relayed_progress_m.unwrap_or(f32::NEG_INFINITY);
            let newest_m =
                libm::fmaxf(known_m, entry.state.progress_m.unwrap_or(f32::NEG_INFINITY));
            if item.progress_m > newest_m {
                // Relayed progress is believed to grow no faster than progress that the vehicle
                // reports itself.
                let believed_m = entry.plausible_progress_m(item.progress_m, fastest_mps, now);
                entry.relayed_progress_m = Some(libm::fmaxf(believed_m, known_m));
                // Gates and delay belong to this progress.
                entry.gates_open_up_to_m = item.gates_open_up_to_m;
                entry.unheard_flight_delay_s =
                    item.unheard_flight_delay_s.saturating_add(HOP_DELAY_S);
            }
            let age_us = u64::from(item.age_ticks) * AGE_TICK_US + MIN_HOP_AGE_US.max(hop_us);
            let then = Instant::from_micros(now.as_micros().saturating_sub(age_us));
            entry.relayed_report_at =
                entry.relayed_report_at.max(Some(then).filter(|_| item.age_ticks < u8::MAX));
        }
    }

    /// Index into `entries` of the roster's vehicle of this rank; `None` for this vehicle.
    fn index_of_rank(&self, rank: u8) -> Option<usize> {
        self.entries[..self.roster_count].binary_search_by_key(&u16::from(rank), |c| c.rank).ok()
    }
}

#[cfg(test)]
mod tests;
