//! The neighbours as last heard on the swarm link, one slot for each system id, in the mission
//! frame.
//!
//! From the byte to the speed scale: GLOBAL_POSITION_INT → [`Neighbours::handle_position`] → ENU in
//! [`Neighbour::position`]; TUNNEL → [`Neighbours::handle_intent`] → [`Neighbour::progress_m`];
//! [`Neighbours::states_at`] brings the ages up to date, and `planner_core::deconflict::advise`
//! makes of them a speed scale.

mod bounds;
mod contact;
mod division;
mod met;
mod places;
mod reach;
pub(crate) mod relay;
mod standing;

use heapless::Vec;
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use nalgebra::Vector3;
use planner_core::deconflict::Neighbour;
use planner_core::flight::Gate;
use planner_core::frames::{self, Geodetic};
use planner_core::safety::PlaceOnPoints;
use planner_core::{Length, Point};

pub(crate) use self::bounds::MAX_HOVER_MPS;
use self::bounds::*;
use self::contact::NeighbourEntry;
pub(crate) use self::met::{FilterNeighbour, ReachQuery};
use crate::autopilot::telemetry::SequenceFilter;
use crate::config::{Ground, REACHES_ALL_M, RosterEntry};
use crate::link::echo::{IntentEcho, MessageDelay};
use crate::link::intent::{GROUNDED, Intent, LANDED, ON_DETOUR, ON_PLAN, OUT_OF_PLAN, WAITING};
use crate::swarm::fleet::Fleet;
use crate::time::{Duration, Instant};

/// The table. Vehicles of the roster have their slot from the start. Others, the strangers, are
/// known by their position only: whatever else they send changes nothing. A few are kept, in what
/// the roster leaves free, until they are silent for a minute.
#[derive(Clone, Debug)]
pub struct Neighbours<const V: usize> {
    contacts: Vec<NeighbourEntry, V>,
    heard: Vec<Neighbour, V>,
    /// The first contacts are the roster, sorted by id; the rest are strangers.
    roster: usize,
    dropped: u32,
    /// When it was last found that no vehicle that is out blocks the path.
    clear_at: Instant,
    /// No vehicle's progress grows faster, m/s.
    fastest_mps: f32,
    /// An unheard one makes this much at least, m/s.
    assumed_speed_mps: f32,
    /// Distance from which on the radio may not reach, metres.
    range_edge_m: f32,
    /// Place of the own vehicle.
    place: Point,
    /// With the vehicle of this rank the next relay begins.
    relay_next: u16,
    /// Rank of this vehicle in the roster.
    own_rank: u16,
    /// The fleet: the state that all vehicles of a coverage mission agree on.
    fleet: Option<Fleet<V>>,
    /// The ground of an area that is not level.
    ground: Option<Ground>,
    /// After this silence a vehicle is down.
    down: Duration,
    /// Distance by which two vehicles in the air may be nearer than they believe, metres: over an
    /// area, where it is kept.
    pair_position_error_m: f32,
    /// With the vehicle of this rank the next report of all begins.
    roster_next: usize,
}

impl<const V: usize> Neighbours<V> {
    /// The vehicles of a roster sorted by id, without the own one; no other vehicle heard yet. None
    /// of them flies faster along its path than `nominal_mps`, or than it lands.
    pub fn new(roster: &[RosterEntry], own_id: u8, nominal_mps: f32) -> Self {
        let mut table = Self {
            contacts: Vec::new(),
            heard: Vec::new(),
            roster: 0,
            dropped: 0,
            clear_at: Instant::ZERO,
            fastest_mps: libm::fmaxf(nominal_mps, MAX_LANDING_MPS),
            assumed_speed_mps: nominal_mps * RECKONED_SPEED_SHARE,
            range_edge_m: f32::INFINITY,
            place: Point::zeros(),
            relay_next: 0,
            own_rank: 0,
            fleet: None,
            ground: None,
            down: DOWN_AFTER,
            pair_position_error_m: 0.0,
            roster_next: 0,
        };
        for (rank, entry) in roster.iter().enumerate() {
            if entry.system_id == own_id {
                table.own_rank = rank as u16;
            } else {
                // A roster of at most V entries fits.
                let _ = table.add_contact(entry.system_id, rank as u16);
            }
        }
        table.roster = table.contacts.len();
        table
    }

    /// The own place now, and how far the radio reaches, metres.
    pub(crate) fn set_place(&mut self, place: Point, radio_range_m: f32) {
        let all = radio_range_m >= REACHES_ALL_M;
        self.range_edge_m = if all { f32::INFINITY } else { RANGE_EDGE_SHARE * radio_range_m };
        self.place = place;
    }

    /// Whether it is known how far the radio reaches.
    pub(crate) fn knows_range(&self) -> bool {
        self.range_edge_m.is_finite()
    }

    /// Whether every vehicle of the roster that is still to fly, or flies, was last heard where the
    /// radio may not reach: no radio has failed.
    pub(crate) fn are_all_out_of_range(&self) -> bool {
        let beyond = |c: &NeighbourEntry| {
            c.at_range_edge || c.position_at.is_none() || c.reports(LANDED | OUT_OF_PLAN)
        };
        self.knows_range() && self.contacts[..self.roster].iter().all(beyond)
    }

    /// Rank of this vehicle in the roster.
    pub(crate) fn own_rank(&self) -> u16 {
        self.own_rank
    }

    /// Number of frames from vehicles for which the table had no slot.
    pub fn dropped_count(&self) -> u32 {
        self.dropped
    }

    fn add_contact(&mut self, id: u8, rank: u16) -> Option<usize> {
        let state = Neighbour {
            id,
            rank,
            position: Point::zeros(),
            velocity: Point::zeros(),
            age_s: 0.0,
            progress_m: None,
            grounded: false,
            out_of_plan: false,
            detours: false,
        };
        let contact = NeighbourEntry {
            id,
            rank,
            sequence: SequenceFilter::default(),
            heard_at: None,
            position_at: None,
            boot_ms: 0,
            flags: 0,
            out_since: None,
            hears_us_at: None,
            heard_bits: 0,
            relayed_m: None,
            relayed_at: None,
            intent_sequence: 0,
            message_delay: MessageDelay::default(),
            intent_at: None,
            points: Vec::new(),
            first_unheard_point: 0,
            place_on_points: PlaceOnPoints::Unknown,
            extent_m: 0.0,
            unheard_way_m: -1.0,
            may_come_down: false,
            gates_open_up_to_m: f32::NEG_INFINITY,
            unheard_delay_s: 0,
            at_range_edge: false,
            assumed_speed_mps: self.assumed_speed_mps,
            ground_m: f32::NAN,
            speed_mps: 0.0,
            shares_plan: false,
            other_plan: false,
            moved_at: Instant::ZERO,
            furthest: None,
            pad: None,
            avoided_at: NO_PLACE,
            state,
        };
        self.contacts.push(contact).ok()?;
        Some(self.contacts.len() - 1)
    }

    /// Rank in the roster of a vehicle whose intents are of our mission.
    fn roster_rank(&self, id: u8, now: Instant) -> Option<usize> {
        let at = self.roster_index(id)?;
        self.contacts[at]
            .intent_at
            .is_some_and(|heard| now - heard < MEMBERSHIP_LIFETIME)
            .then_some(at)
    }

    fn roster_index(&self, id: u8) -> Option<usize> {
        self.contacts[..self.roster].binary_search_by_key(&id, |c| c.id).ok()
    }

    fn stranger_index(&self, id: u8) -> Option<usize> {
        let strangers = &self.contacts[self.roster..];
        strangers.iter().position(|c| c.id == id).map(|at| at + self.roster)
    }

    /// Removes the strangers that do not meet the condition.
    fn retain_strangers(&mut self, mut keep: impl FnMut(&NeighbourEntry) -> bool) {
        let mut at = self.roster;
        while let Some(contact) = self.contacts.get(at) {
            if keep(contact) {
                at += 1;
            } else {
                self.contacts.remove(at);
            }
        }
    }

    /// The slot of a position's sender: that of the roster, or a stranger's, made if there is room.
    fn slot_for_position(&mut self, id: u8, now: Instant) -> Option<&mut NeighbourEntry> {
        if let Some(at) = self.roster_rank(id, now).or_else(|| self.stranger_index(id)) {
            return self.contacts.get_mut(at);
        }
        self.retain_strangers(|c| c.heard_within(now, STRANGER_LIFETIME));
        let room = self.contacts.len() - self.roster < MAX_STRANGERS;
        match Some(id).filter(|_| room).and_then(|id| self.add_contact(id, STRANGER_RANK)) {
            Some(at) => self.contacts.get_mut(at),
            None => {
                self.dropped = self.dropped.wrapping_add(1);
                None
            }
        }
    }

    /// Whether an intent of `id` is new: not repeated, not overtaken. To be asked only of one that
    /// decodes and is of our mission: what anybody can send must not make the next true one look
    /// late. Positions carry their time instead.
    pub fn accept_intent(&mut self, id: u8, sequence: u8, now: Instant) -> bool {
        self.roster_index(id).is_some_and(|at| {
            let contact = &mut self.contacts[at];
            let fresh = contact.sequence.accept(sequence, now);
            if fresh {
                contact.intent_sequence = sequence;
            }
            fresh
        })
    }

    /// A neighbour's position. It is the roster's only if this vehicle's intents are of our
    /// mission; else it is a stranger's.
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
        let (own, edge_m) = (self.place, self.range_edge_m);
        let Some(contact) = self.slot_for_position(id, now) else { return };
        let behind = contact.boot_ms.wrapping_sub(data.time_boot_ms);
        if !place.is_valid() || (contact.position_at.is_some() && behind < RESTART_MS) {
            return;
        }
        contact.boot_ms = data.time_boot_ms;
        contact.heard_at = Some(now);
        contact.position_at = Some(now);
        contact.state.position = frames::geodetic_to_enu(origin, &place);
        contact.update_place_on_points();
        contact.at_range_edge = (contact.state.position - own).norm_squared() >= edge_m * edge_m;
        let cm_per_s = Vector3::new(f32::from(data.vx), f32::from(data.vy), f32::from(data.vz));
        contact.state.velocity = frames::swap_enu_ned(&(cm_per_s * 0.01));
        contact.speed_mps = contact.state.velocity.length();
        if contact.speed_mps >= MAX_HOVER_MPS {
            contact.moved_at = now;
        }
    }

    /// A neighbour's intent. It counts only from a vehicle of the roster and with our mission's
    /// CRC, its progress only if the plan is ours too. `rank` is our own.
    pub fn handle_intent(
        &mut self,
        now: Instant,
        rank: u16,
        intent: &Intent,
        mission_crc: u32,
        plan_crc: Option<u32>,
    ) {
        let Some(at) =
            self.roster_index(intent.system_id).filter(|_| intent.mission_crc == mission_crc)
        else {
            return;
        };
        // The vehicle is no stranger.
        self.retain_strangers(|c| c.id != intent.system_id);
        let contact = &mut self.contacts[at];
        contact.shares_plan = plan_crc.is_some_and(|crc| crc == intent.plan_crc);
        let on_plan = intent.flags & ON_PLAN != 0;
        let shared = on_plan && contact.shares_plan;
        let follows = on_plan && intent.flags & LANDED == 0 && intent.plan_crc != 0;
        contact.other_plan = follows && plan_crc.is_some_and(|crc| crc != intent.plan_crc);
        (contact.heard_at, contact.intent_at) = (Some(now), Some(now));
        contact.flags = intent.flags;
        if contact.reports(GROUNDED)
            && !contact.reports(LANDED | OUT_OF_PLAN)
            && contact.position_at.is_some()
        {
            contact.pad = Some(contact.state.position);
        }
        let out = contact.reports(OUT_OF_PLAN) && contact.position_at.is_some();
        contact.out_since = contact.out_since.or(Some(now)).filter(|_| out);
        // Ranks beyond the bitmap are not reported.
        if rank >= 32 || intent.heard_bits & (1 << rank) != 0 {
            contact.hears_us_at = Some(now);
        }
        contact.heard_bits = intent.heard_bits;
        contact.points.clone_from(&intent.points);
        let most = intent.points.len().saturating_sub(1) as u8;
        contact.first_unheard_point = intent.first_unheard_point.min(most);
        contact.unheard_way_m = if self.fleet.is_some() { 0.0 } else { -1.0 };
        let from = intent.points.first().copied().unwrap_or_default();
        let most = |most: f32, p: &Point| libm::fmaxf(most, (p - from).norm_squared());
        contact.extent_m = fpu::sqrtf(contact.points_for_now().iter().fold(0.0, most));
        contact.update_place_on_points();
        (contact.may_come_down, contact.ground_m) = (intent.may_come_down, intent.ground_m);
        contact.gates_open_up_to_m =
            if shared { intent.gates_open_up_to_m } else { f32::NEG_INFINITY };
        contact.unheard_delay_s = intent.unheard_delay_s;
        contact.state.grounded = intent.flags & (GROUNDED | LANDED) != 0;
        contact.state.progress_m =
            shared.then(|| contact.plausible_progress_m(intent.progress_m, self.fastest_mps, now));
    }

    /// Every neighbour whose position or progress was ever heard, or which is lost, with its age at
    /// `now`. A vehicle that is out opens no gate before it was checked whether it blocks the path
    /// ([`Self::mark_path_clear`]).
    pub fn states_at(&mut self, now: Instant) -> &[Neighbour] {
        self.heard.clear();
        self.retain_strangers(|c| c.heard_within(now, STRANGER_LIFETIME));
        for contact in &self.contacts {
            let progress_m = contact.passed_m(now);
            let placed_at = contact.position_at;
            let dead = contact.is_dead(self.clear_at);
            if placed_at.is_none() && progress_m.is_none() && !dead {
                continue;
            }
            let state = Neighbour {
                // Of a vehicle that was never heard itself only the progress is known.
                position: placed_at.map_or(FAR_AWAY, |_| contact.state.position),
                age_s: placed_at.map_or(0.0, |at| (now - at).as_secs_f32()),
                rank: contact.rank,
                progress_m,
                grounded: contact.state.grounded || dead,
                out_of_plan: contact.out_since.is_some_and(|since| since <= self.clear_at) || dead,
                detours: contact.reports(ON_DETOUR),
                ..contact.state
            };
            // Cannot overflow: there are as many slots as contacts.
            let _ = self.heard.push(state);
        }
        &self.heard
    }

    /// Whether `gate` is open for good: its vehicle has come past it, or is out of the plan.
    pub(crate) fn has_passed(&self, gate: &Gate, now: Instant) -> bool {
        let contact = self.roster_index(gate.id).map(|at| &self.contacts[at]);
        contact.is_some_and(|c| {
            let passed = c.passed_m(now).is_some_and(|progress_m| progress_m >= gate.until_m);
            passed
                || c.out_since.is_some_and(|since| since <= self.clear_at)
                || c.is_dead(self.clear_at)
        })
    }

    /// Delay estimate of the messages from `id`.
    pub(crate) fn message_delay(&mut self, id: u8) -> Option<&mut MessageDelay> {
        let at = self.roster_index(id)?;
        Some(&mut self.contacts[at].message_delay)
    }

    /// Greatest message delay of all vehicles that are heard, seconds.
    pub(crate) fn max_message_delay_s(&self) -> f32 {
        self.contacts[..self.roster]
            .iter()
            .fold(0.0, |most, c| libm::fmaxf(most, c.message_delay.delay_s))
    }

    /// Whether no vehicle of the roster is heard: then this vehicle's own radio is assumed faulty.
    #[inline(never)]
    pub(crate) fn hears_nobody(&self, now: Instant) -> bool {
        self.roster > 0
            && self.contacts[..self.roster].iter().all(|c| !c.heard_within(now, MAY_LAND_AFTER))
    }

    /// The echo of one neighbour's last intent, of each in turn.
    pub(crate) fn next_echo(&self, turn: usize, now: Instant) -> Option<IntentEcho> {
        let contact = self.contacts[..self.roster].get(turn % self.roster.max(1))?;
        IntentEcho::new(contact.rank, contact.intent_sequence, now - contact.intent_at?)
    }

    /// Vehicles heard lately, one bit for each rank.
    pub fn heard_bits(&self, now: Instant) -> u32 {
        let heard =
            self.contacts.iter().filter(|c| c.rank < 32 && c.heard_within(now, HEARD_WITHIN));
        heard.fold(0, |bits, c| bits | 1 << c.rank)
    }

    /// Whether a vehicle of this id is heard to follow the shared plan, or is none that is known.
    pub(crate) fn follows_plan(&self, id: u8) -> bool {
        self.contacts.iter().find(|c| c.state.id == id).is_none_or(NeighbourEntry::on_plan)
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.contacts.len()
    }

    /// Whether the table has no entry.
    pub fn is_empty(&self) -> bool {
        self.contacts.is_empty()
    }

    /// The plan is another one: results of the scan, and the vehicles flown around, do not count
    /// any more.
    pub fn forget_plan(&mut self) {
        self.clear_at = Instant::ZERO;
        for contact in &mut self.contacts {
            (contact.avoided_at, contact.furthest) = (NO_PLACE, None);
            (contact.relayed_m, contact.relayed_at) = (None, None);
            contact.gates_open_up_to_m = f32::NEG_INFINITY;
        }
    }

    /// Whether a neighbour of the roster was heard within `span`, and one reported that it hears
    /// us.
    pub fn linked_within(&self, now: Instant, span: Duration) -> bool {
        let lately = |at: Option<Instant>| at.is_some_and(|at| now - at < span);
        let roster = &self.contacts[..self.roster];
        roster.iter().any(|c| lately(c.heard_at)) && roster.iter().any(|c| lately(c.hears_us_at))
    }

    /// Time since any neighbour of the roster was heard, or since one reported that it hears us,
    /// whichever is longer; zero when all of them have landed or are out, or there are none. Where
    /// neither ever was, the time since `since`.
    pub fn silence_duration(&self, now: Instant, since: Instant) -> Duration {
        if self.are_all_at_rest() {
            return Duration::default();
        }
        let others = || self.contacts[..self.roster].iter();
        let heard = others().filter_map(|c| c.heard_at).max().unwrap_or(since);
        let hears_us = others().filter_map(|c| c.hears_us_at).max().unwrap_or(since);
        now - heard.min(hears_us).max(since)
    }
}

#[cfg(test)]
mod tests;
