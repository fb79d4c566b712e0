//! News of vehicles that a neighbour does not hear: who hears them passes them on.
//!
//! The order of the schedule needs the progress of vehicles that may be out of radio range by then. So each vehicle tells, once
//! a second at most, what it last knew of those that some neighbour of it did not report to hear: nothing at all while
//! everybody hears everybody. News never count as heard: they open gates, tell who waits or is out, and move the ball in which
//! an unheard vehicle may be (`docs/safety.md`) to where it was later. They are nobody's link.
//!
//! The payload of TUNNEL under a private payload type, little-endian, at most 124 bytes:
//!
//! | byte | type | field |
//! |---|---|---|
//! | 0 | u8 | version, 1 |
//! | 1 | u8 | system id, the sender's |
//! | 2 | u8 | number n of vehicles told of, 0…7 |
//! | 3 | u8 | 0 |
//! | 4 | u32 | CRC-32 of the mission file |
//! | 8 | u32 | CRC-32 of the swarm's plan |
//! | 12 + 16 i | u8 | rank in the roster sorted by system id; + 128: it may come down from where it is |
//! | 13 + 16 i | u8 | flags of its intent |
//! | 14 + 16 i | u16 | age of this, rounded up, 0.1 s |
//! | 16 + 16 i | f32 | its progress on the plan, metres |
//! | 20 + 16 i | 3 × i16 | its place: east, north, up in the mission frame, 0.1 m |
//! | 26 + 16 i | i16 | height of the ground below it, rounded down, 0.1 m |

use heapless::Vec;
use planner_core::Point;

use super::{Contact, LATELY, Neighbours};
use crate::intent::{GROUNDED, LANDED, ON_PLAN, OUT};
use crate::time::{Duration, Instant};

/// Our payload type, in the range that MAVLink leaves to private use (32768…65535).
pub(crate) const PAYLOAD_TYPE: u16 = 0xF10D;
/// Most vehicles told of at once.
const MOST: usize = 7;
const VERSION: u8 = 1;
const TUNNEL_HEAD: usize = 5;
const HEAD: usize = 12;
const ITEM: usize = 16;
const COLUMN: u8 = 128;
/// Longest payload with its head.
pub(crate) const LENGTH: usize = TUNNEL_HEAD + HEAD + MOST * ITEM;
/// What each hop adds to the age: longer than a message takes, so that no echo is newer than what it repeats.
const HOP: Duration = Duration::from_secs(1);
/// News of this age still tell that a vehicle stands, or is not silent: a few hops, and the loss of one message.
const RECENT: Duration = Duration::from_secs(10);
/// What is this old is not passed on, unless it stays true.
const STALE: Duration = Duration::from_secs(60);
/// Heard within this time a vehicle speaks for itself.
const SPEAKS: Duration = Duration::from_secs(1);
/// Steps of a decimetre in a metre.
const PER_M: f32 = 10.0;

/// What is passed on of one vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Item {
    rank: u8,
    column: bool,
    flags: u8,
    age_ds: u16,
    progress_m: f32,
    place_dm: [i16; 3],
    floor_dm: i16,
}

/// What a vehicle passes on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct News {
    pub(crate) mission_crc: u32,
    pub(crate) plan_crc: u32,
    items: Vec<Item, MOST>,
}

impl News {
    pub(crate) fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Writes the whole TUNNEL payload, to everyone; the bytes written.
    pub(crate) fn encode(&self, system_id: u8, out: &mut [u8; LENGTH]) -> usize {
        let len = HEAD + ITEM * self.items.len();
        out[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        (out[2], out[3], out[4]) = (0, 0, len as u8);
        let body = &mut out[TUNNEL_HEAD..];
        body[..4].copy_from_slice(&[VERSION, system_id, self.items.len() as u8, 0]);
        body[4..8].copy_from_slice(&self.mission_crc.to_le_bytes());
        body[8..12].copy_from_slice(&self.plan_crc.to_le_bytes());
        for (to, item) in body[HEAD..].chunks_exact_mut(ITEM).zip(&self.items) {
            to[0] = item.rank | if item.column { COLUMN } else { 0 };
            to[1] = item.flags;
            to[2..4].copy_from_slice(&item.age_ds.to_le_bytes());
            to[4..8].copy_from_slice(&item.progress_m.to_le_bytes());
            let heights = item.place_dm.iter().chain([&item.floor_dm]);
            for (to, value) in to[8..].chunks_exact_mut(2).zip(heights) {
                to.copy_from_slice(&value.to_le_bytes());
            }
        }
        TUNNEL_HEAD + len
    }

    /// Reads a TUNNEL payload, zero-padded, from system `sender`; `None` if it is no such news.
    pub(crate) fn decode(padded: &[u8; 255], sender: u8) -> Option<Self> {
        let body = padded[TUNNEL_HEAD..].get(..usize::from(padded[4]))?;
        let is_ours = u16::from_le_bytes([padded[0], padded[1]]) == PAYLOAD_TYPE;
        if !is_ours || body.len() < HEAD || body[0] != VERSION || body[1] != sender {
            return None;
        }
        let items = body[HEAD..].get(..ITEM * usize::from(body[2]))?;
        let word = |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
        let mut news = Self { mission_crc: word(4), plan_crc: word(8), items: Vec::new() };
        for item in items.chunks_exact(ITEM) {
            let short = |at: usize| u16::from_le_bytes([item[at], item[at + 1]]);
            let signed = |at: usize| i16::from_le_bytes([item[at], item[at + 1]]);
            let item = Item {
                rank: item[0] & !COLUMN,
                column: item[0] & COLUMN != 0,
                flags: item[1],
                age_ds: short(2),
                progress_m: f32::from_le_bytes([item[4], item[5], item[6], item[7]]),
                place_dm: [signed(8), signed(10), signed(12)],
                floor_dm: signed(14),
            };
            // Room for all that fits into a payload; a number that is none is refused.
            news.items.push(item).ok().filter(|()| item.progress_m.is_finite())?;
        }
        Some(news)
    }
}

impl Contact {
    /// When it was last known how it is: heard from itself or from others.
    pub(super) fn known_at(&self) -> Option<Instant> {
        self.heard_at.max(self.relayed_at)
    }

    /// Whether others told lately how it is.
    pub(super) fn is_relayed(&self, now: Instant) -> bool {
        self.relayed_at.is_some_and(|at| now - at < RECENT)
    }

    /// What is passed on of it; none where nothing is known, or its place does not fit.
    fn item(&self, now: Instant) -> Option<Item> {
        // Whoever has landed or is out stays so.
        let lasts = self.tells(LANDED | OUT);
        let known_at = self.known_at().filter(|at| lasts || now - *at < STALE)?.min(self.position_at?);
        let decimetres = |metres: f32| {
            let value = libm::roundf(metres * PER_M);
            (value.abs() < f32::from(i16::MAX)).then_some(value as i16)
        };
        let place = self.state.position;
        let floor_m = if self.floor_m.is_nan() { place.z } else { self.floor_m };
        let shared = self.state.progress_m.is_some();
        Some(Item {
            rank: self.rank as u8,
            column: self.column,
            flags: if shared { self.flags } else { self.flags & !ON_PLAN },
            age_ds: (now - known_at).micros().div_ceil(100_000).min(u64::from(u16::MAX)) as u16,
            progress_m: self.state.progress_m.unwrap_or(0.0),
            place_dm: [decimetres(place.x)?, decimetres(place.y)?, decimetres(place.z)?],
            floor_dm: decimetres(floor_m - 0.5 / PER_M)?,
        })
    }

    /// `fastest_mps` bounds what is believed of its progress, as where it is heard itself; none where the plan is another.
    fn take(&mut self, item: &Item, at: Instant, now: Instant, fastest_mps: Option<f32>) {
        let metres = |value: i16| f32::from(value) / PER_M;
        self.relayed_at = Some(at);
        self.flags = item.flags;
        self.column = item.column;
        self.floor_m = metres(item.floor_dm);
        self.state.grounded = self.tells(GROUNDED | LANDED);
        self.state.progress_m = fastest_mps
            .filter(|_| item.flags & ON_PLAN != 0)
            .map(|fastest_mps| self.believed_m(item.progress_m, fastest_mps, now));
        if self.position_at.is_none_or(|known| known < at) {
            let [x, y, z] = item.place_dm.map(metres);
            self.state.position = Point::new(x, y, z);
            self.state.velocity = Point::zeros();
            (self.speed_mps, self.position_at) = (0.0, Some(at));
            self.points.clear();
        }
        let out = self.tells(OUT);
        self.out_at = self.out_at.or(Some(now)).filter(|_| out);
    }
}

impl<const V: usize> Neighbours<V> {
    /// News for neighbours that do not hear somebody. They begin with the vehicle of rank `next` and tell with which to go on.
    pub(crate) fn news(&self, now: Instant, next: &mut u16, mission_crc: u32, plan_crc: u32) -> News {
        let mut news = News { mission_crc, plan_crc, items: Vec::new() };
        let roster = &self.contacts[..self.roster];
        let speaking = || roster.iter().filter(|c| c.heard_within(now, LATELY));
        // One that is missed by one neighbour is told to all.
        let missed = |c: &Contact| speaking().any(|by| by.rank != c.rank && by.hears & (1 << c.rank) == 0);
        let first = roster.partition_point(|c| c.rank < *next);
        let turn = roster[first..].iter().chain(&roster[..first]);
        for contact in turn.filter(|c| c.rank < 32 && missed(c)) {
            let Some(item) = contact.item(now) else { continue };
            if news.items.push(item).is_err() {
                *next = contact.rank;
                break;
            }
        }
        news
    }

    /// Takes news from a vehicle of the roster.
    pub(crate) fn handle_news(&mut self, now: Instant, from: u8, news: &News, plan_crc: Option<u32>) {
        if self.member(from, now).is_none() {
            return;
        }
        for item in &news.items {
            let Some(at) = self.in_ranks(item.rank) else { continue };
            let contact = &mut self.contacts[at];
            let age_us = u64::from(item.age_ds) * 100_000 + HOP.micros();
            let told_at = Instant::from_micros(now.micros().saturating_sub(age_us));
            let newer = contact.known_at().is_none_or(|known| known < told_at);
            if newer && !contact.heard_within(now, SPEAKS) {
                let fastest_mps = plan_crc.filter(|crc| *crc == news.plan_crc).map(|_| self.fastest_mps);
                contact.take(item, told_at, now, fastest_mps);
            }
        }
    }

    fn in_ranks(&self, rank: u8) -> Option<usize> {
        self.contacts[..self.roster].binary_search_by_key(&u16::from(rank), |c| c.rank).ok()
    }

    /// Whether others lately told of a vehicle of the roster that flies and is not heard: a claim takes longer to reach it.
    pub(crate) fn any_relayed(&self, now: Instant) -> bool {
        let far = |c: &Contact| c.is_relayed(now) && !c.heard_within(now, LATELY) && !c.tells(LANDED | OUT);
        self.contacts[..self.roster].iter().any(far)
    }
}

#[cfg(test)]
#[path = "relay_tests.rs"]
mod tests;
