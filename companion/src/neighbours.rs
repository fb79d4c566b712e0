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
    /// The first contacts are the roster, sorted by id; the rest are strangers.
    roster: usize,
    dropped: u32,
}

impl<const V: usize> Neighbours<V> {
    /// The vehicles of a roster sorted by id, without the own one; nobody heard yet.
    pub fn new(roster: &[RosterEntry], own_id: u8) -> Self {
        let mut table = Self { contacts: Vec::new(), heard: Vec::new(), roster: 0, dropped: 0 };
        for (rank, entry) in roster.iter().enumerate() {
            if entry.system_id != own_id {
                // A roster of at most V entries fits.
                let _ = table.add(entry.system_id, rank as u16);
            }
        }
        table.roster = table.contacts.len();
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
        let (roster, strangers) = self.contacts.split_at(self.roster);
        let known = roster.binary_search_by_key(&id, |c| c.id).ok();
        let stranger = || strangers.iter().position(|c| c.id == id).map(|at| at + self.roster);
        let at = match known.or_else(stranger) {
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

    /// Whether a neighbour was last heard lower than `position` and within `within_m` of its vertical.
    pub fn any_below(&self, position: &Point, within_m: f32) -> bool {
        let under = |p: &Point| p.z < position.z && (p - position).xy().norm() < within_m;
        self.contacts.iter().any(|c| c.position_at.is_some() && under(&c.state.position))
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

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 600.0 };

    fn table() -> Neighbours<4> {
        let entry = |system_id| RosterEntry { system_id, start: Point::zeros() };
        Neighbours::new(&[entry(3), entry(5), entry(9)], 5)
    }

    fn place(boot_ms: u32, north_1e7: i32) -> GLOBAL_POSITION_INT_DATA {
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms,
            lat: 400_000_000 + north_1e7,
            lon: -30_000_000,
            alt: 602_500,
            vx: 150,
            vy: -50,
            vz: 20,
            ..Default::default()
        }
    }

    fn intent(flags: u8, mission_crc: u32, plan_crc: u32) -> Intent {
        let points = Vec::new();
        Intent { system_id: 9, flags, mission_crc, plan_crc, progress_m: 4.0, speed_mps: 1.0, points }
    }

    #[test]
    fn a_position_reaches_the_mission_frame_and_ages() {
        let mut table = table();
        assert!(table.at(Instant::ZERO).is_empty());
        table.handle_position(Instant::from_millis(100), &ORIGIN, 9, &place(50, 1000));
        let heard = table.at(Instant::from_millis(600))[0];
        assert_eq!((heard.id, heard.rank), (9, 2));
        // A ten-thousandth of a degree of latitude is 11.1 m.
        assert!((heard.position - Point::new(0.0, 11.1, 2.5)).norm() < 0.02, "{:?}", heard.position);
        assert!((heard.velocity - Point::new(-0.5, 1.5, -0.2)).norm() < 1e-5);
        assert!((heard.age_s - 0.5).abs() < 1e-6);
    }

    #[test]
    fn below_is_lower_and_near_the_vertical() {
        let mut table = table();
        let above = Point::new(0.0, 1.0, 9.0);
        assert!(!table.any_below(&above, 2.0), "nobody was heard");
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 0));
        assert!(table.any_below(&above, 2.0));
        assert!(!table.any_below(&Point::new(0.0, 3.0, 9.0), 2.0) && !table.any_below(&Point::zeros(), 2.0));
    }

    #[test]
    fn late_and_repeated_positions_change_nothing_but_a_restart_does() {
        let mut table = table();
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(20_000, 1000));
        for late in [20_000, 19_900, 10_001] {
            table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(late, 0));
            assert!(table.at(Instant::from_millis(500))[0].age_s > 0.4, "{late}");
        }
        table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(100, 0));
        assert_eq!(table.at(Instant::from_millis(500))[0].age_s, 0.0);
    }

    #[test]
    fn progress_counts_only_on_our_mission_and_plan() {
        let mut table = table();
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(0, 0));
        for (flags, mission, plan, own_plan, progress) in [
            (ON_PLAN, 1, 2, Some(2), Some(4.0)),
            (0, 1, 2, Some(2), None),
            (ON_PLAN, 7, 2, Some(2), None),
            (ON_PLAN, 1, 7, Some(2), None),
            (ON_PLAN, 1, 2, None, None),
        ] {
            table.handle_intent(Instant::ZERO, &intent(flags, mission, plan), 1, own_plan);
            assert_eq!(table.at(Instant::ZERO)[0].progress_m, progress);
        }
    }

    #[test]
    fn strangers_rank_last_and_overflow_is_counted() {
        let mut table = table();
        for id in [200, 201, 202] {
            table.handle_position(Instant::ZERO, &ORIGIN, id, &place(0, 0));
        }
        assert_eq!((table.at(Instant::ZERO).len(), table.dropped()), (2, 1));
        assert!(table.at(Instant::ZERO).iter().all(|n| n.rank == u16::MAX));
    }

    #[test]
    fn silence_is_that_of_those_who_fly() {
        let mut table = table();
        let at = Instant::from_millis;
        assert_eq!(table.silence(at(9000), at(2000)), Duration::from_millis(7000), "never heard");
        table.handle_position(at(5000), &ORIGIN, 9, &place(0, 0));
        assert_eq!(table.silence(at(9000), at(2000)), Duration::from_millis(4000));
        assert!(table.heard_within(at(5500), Duration::from_millis(1000)));
        assert!(!table.heard_within(at(6500), Duration::from_millis(1000)));
        table.handle_intent(at(5000), &intent(LANDED, 1, 2), 1, None);
        table.handle_intent(at(5000), &Intent { system_id: 3, ..intent(LANDED, 1, 2) }, 1, None);
        assert_eq!(table.silence(at(9000), at(2000)), Duration::default(), "all have landed");
    }
}
