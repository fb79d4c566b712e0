//! The neighbours as last heard on the swarm link, one slot for each system id, in the mission frame.
//!
//! From the byte to the speed scale: GLOBAL_POSITION_INT → [`Neighbours::handle_position`] → ENU in
//! [`Neighbour::position`]; TUNNEL → [`Neighbours::handle_intent`] → [`Neighbour::progress_m`];
//! [`Neighbours::at`] brings the ages up to date, and `planner_core::deconflict::advise` makes of them a speed scale.

use heapless::Vec;
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::deconflict::Neighbour;
use planner_core::frames::{self, Geodetic};

use crate::config::RosterEntry;
use crate::intent::{GROUNDED, Intent, LANDED, ON_PLAN};
use crate::telemetry::SequenceFilter;
use crate::time::{Duration, Instant};

/// A position older than the one held by less than this is late; by more, the sender was started anew.
const RESTART_MS: u32 = 10_000;

#[derive(Clone, Copy, Debug)]
struct Contact {
    id: u8,
    rank: u16,
    sequence: SequenceFilter,
    heard_at: Option<Instant>,
    position_at: Option<Instant>,
    boot_ms: u32,
    landed: bool,
    state: Neighbour,
}

/// The table. Vehicles of the roster have their slot from the start; others get one while there is room.
#[derive(Clone, Debug)]
pub struct Neighbours<const V: usize> {
    contacts: Vec<Contact, V>,
    heard: Vec<Neighbour, V>,
    dropped: u32,
}

impl<const V: usize> Neighbours<V> {
    /// The vehicles of a roster sorted by id, without the own one; nobody heard yet.
    pub fn new(roster: &[RosterEntry], own_id: u8) -> Self {
        let mut table = Self { contacts: Vec::new(), heard: Vec::new(), dropped: 0 };
        for (rank, entry) in roster.iter().enumerate() {
            if entry.system_id != own_id {
                table.add(entry.system_id, rank as u16);
            }
        }
        table
    }

    /// Vehicles that found no slot, by frames.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    fn add(&mut self, id: u8, rank: u16) -> Option<usize> {
        let state = Neighbour {
            id,
            rank,
            position: Point::zeros(),
            velocity: Point::zeros(),
            age_s: 0.0,
            progress_m: None,
            grounded: false,
        };
        let contact = Contact {
            id,
            rank,
            sequence: SequenceFilter::default(),
            heard_at: None,
            position_at: None,
            boot_ms: 0,
            landed: false,
            state,
        };
        self.contacts.push(contact).ok()?;
        Some(self.contacts.len() - 1)
    }

    /// The slot of `id`, made if need be; an intruder ranks behind everyone.
    fn slot(&mut self, id: u8) -> Option<&mut Contact> {
        let at = match self.contacts.iter().position(|c| c.id == id) {
            Some(at) => at,
            None => match self.add(id, u16::MAX) {
                Some(at) => at,
                None => {
                    self.dropped = self.dropped.wrapping_add(1);
                    return None;
                }
            },
        };
        Some(&mut self.contacts[at])
    }

    /// Whether a frame of `id` is new: not repeated, not overtaken.
    pub fn accept(&mut self, id: u8, sequence: u8, now: Instant) -> bool {
        self.slot(id).is_some_and(|c| c.sequence.accept(sequence, now))
    }

    /// A neighbour's position.
    pub fn handle_position(
        &mut self,
        now: Instant,
        origin: &Geodetic,
        id: u8,
        data: &GLOBAL_POSITION_INT_DATA,
    ) {
        let place = Geodetic {
            lat_deg: f64::from(data.lat) * 1e-7,
            lon_deg: f64::from(data.lon) * 1e-7,
            alt_m: f64::from(data.alt) * 1e-3,
        };
        let Some(contact) = self.slot(id) else { return };
        let behind = contact.boot_ms.wrapping_sub(data.time_boot_ms);
        if !place.is_valid() || (contact.position_at.is_some() && behind < RESTART_MS) {
            return;
        }
        contact.boot_ms = data.time_boot_ms;
        contact.heard_at = Some(now);
        contact.position_at = Some(now);
        contact.state.position = frames::geodetic_to_enu(origin, &place);
        let cm_per_s = Vector3::new(f32::from(data.vx), f32::from(data.vy), f32::from(data.vz));
        contact.state.velocity = frames::swap_enu_ned(&(cm_per_s * 0.01));
    }

    /// A neighbour's intent. Its progress counts only where mission and plan are ours.
    pub fn handle_intent(&mut self, now: Instant, intent: &Intent, mission_crc: u32, plan_crc: Option<u32>) {
        let Some(contact) = self.slot(intent.system_id) else { return };
        let shared = intent.flags & ON_PLAN != 0
            && intent.mission_crc == mission_crc
            && plan_crc.is_some_and(|crc| crc == intent.plan_crc);
        contact.heard_at = Some(now);
        contact.landed = intent.flags & LANDED != 0;
        contact.state.grounded = intent.flags & (GROUNDED | LANDED) != 0;
        contact.state.progress_m = shared.then_some(intent.progress_m);
    }

    /// Every neighbour whose position was ever heard, with its age at `now`.
    pub fn at(&mut self, now: Instant) -> &[Neighbour] {
        self.heard.clear();
        for contact in &self.contacts {
            if let Some(at) = contact.position_at {
                let state = Neighbour { age_s: (now - at).secs_f32(), rank: contact.rank, ..contact.state };
                // As many slots as contacts.
                let _ = self.heard.push(state);
            }
        }
        &self.heard
    }

    /// Whether a neighbour of the roster was heard within `span`.
    pub fn heard_within(&self, now: Instant, span: Duration) -> bool {
        let roster = self.contacts.iter().filter(|c| c.rank != u16::MAX);
        roster.filter_map(|c| c.heard_at).any(|at| now - at < span)
    }

    /// Time since any neighbour of the roster was heard; zero when all of them have landed, or there are none. Where
    /// none was ever heard, the time since `since`.
    pub fn silence(&self, now: Instant, since: Instant) -> Duration {
        let others = || self.contacts.iter().filter(|c| c.rank != u16::MAX);
        if others().all(|c| c.landed) {
            return Duration::default();
        }
        let newest = others().filter_map(|c| c.heard_at).max().unwrap_or(since);
        now - newest.max(since)
    }
}
