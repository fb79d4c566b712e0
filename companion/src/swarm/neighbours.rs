//! The neighbours as last heard on the swarm link, one entry for each system id. Places are
//! in the mission frame. A vehicle is *unheard* while no other vehicle hears it.
//!
//! Data flow from received bytes to the speed scale: GLOBAL_POSITION_INT →
//! [`Neighbours::handle_position`] → ENU in [`Neighbour::position`]; TUNNEL →
//! [`Neighbours::handle_numbered_intent`] → [`Neighbour::progress_m`];
//! [`Neighbours::states_with_age`] computes the ages, and `planner_core::track::deconflict::advise`
//! computes the speed scale from the result.

mod bounds;
mod dead_reckoning;
mod division;
mod echoes;
mod entry;
pub(crate) mod filter_neighbour;
mod places;
mod range;
mod reach;
pub(crate) mod relay;
mod rest_places;
mod silence;
mod standing;
mod states;
mod strangers;

use heapless::Vec;
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use nalgebra::Vector3;
use planner_core::geo::frames::{self, Geodetic};
use planner_core::track::deconflict::Neighbour;
use planner_core::{Length, Point};

pub(crate) use self::bounds::MAX_HOVER_MPS;
use self::bounds::*;
use self::entry::NeighbourEntry;
use crate::config::{RosterEntry, UnevenGround};
use crate::link::intent::{GROUNDED, Intent, LANDED, ON_PLAN, OUT_OF_PLAN};
use crate::swarm::fleet::Fleet;
use crate::time::{Duration, Instant};

/// Table of the other vehicles. Those of the roster have their entry from the start. Others, the
/// strangers, are known by their positions only: their other messages change nothing. A few are
/// kept, in entries that the roster leaves free, until they are silent for a minute.
#[derive(Clone, Debug)]
pub struct Neighbours<const V: usize> {
    /// The roster's other vehicles, sorted by id; behind them the strangers.
    entries: Vec<NeighbourEntry, V>,
    /// Result of the last call of [`Self::states_with_age`].
    states: Vec<Neighbour, V>,
    /// Number of roster vehicles in `entries`.
    roster_count: usize,
    /// Number of positions dropped because the table had no room for their sender.
    dropped_positions: u16,
    /// When a vehicle of the roster last reported that it hears this one; `None` before.
    reported_heard_at: Option<Instant>,
    /// When the last scan began that found no vehicle out of the plan on the path.
    path_clear_at: Instant,
    /// Greatest speed at which a reported progress is believed to grow, m/s.
    max_progress_mps: f32,
    /// Least speed at which a vehicle that none hears is assumed to make progress, m/s.
    min_unheard_progress_mps: f32,
    /// Distance from which on the radio may not reach, metres; ∞ where it reaches every vehicle.
    range_edge_m: f32,
    /// Speed of the mission's fastest vehicle, m/s.
    fastest_vehicle_mps: f32,
    /// Position of this vehicle, ENU.
    own_position: Point,
    /// Rank of the vehicle with which the next relay message begins.
    next_relayed_rank: u16,
    /// Rank of this vehicle in the roster.
    own_rank: u16,
    /// State by which the vehicles of a coverage mission agree how to divide what a vehicle leaves;
    /// `None` in other missions.
    fleet: Option<Fleet<V>>,
    /// Heights of the ground of an area that is not level; `None` if it is level.
    ground: Option<UnevenGround>,
    /// Silence after which a lost vehicle is assumed to be on the ground.
    down_after: Duration,
    /// Distance by which two vehicles in the air in a coverage mission may be nearer than their
    /// estimates say, metres; 0 in other missions.
    pair_position_error_m: f32,
    /// Rank of the vehicle with which the next roster report begins.
    next_reported_rank: u16,
}

impl<const V: usize> Neighbours<V> {
    /// A table of the vehicles of `roster`, which is sorted by id, without this one; none of them
    /// was heard yet. Their progress is believed to grow no faster than `fastest_vehicle_mps` or
    /// the speed of a landing, whichever is greater, and, while none hears them, no slower than a
    /// share of `slowest_vehicle_mps`.
    /// Both are speeds of the whole mission, so that all vehicles judge a report alike.
    pub fn new(
        roster: &[RosterEntry],
        own_id: u8,
        slowest_vehicle_mps: f32,
        fastest_vehicle_mps: f32,
    ) -> Self {
        let mut table = Self {
            entries: Vec::new(),
            states: Vec::new(),
            roster_count: 0,
            dropped_positions: 0,
            reported_heard_at: None,
            path_clear_at: Instant::ZERO,
            max_progress_mps: libm::fmaxf(fastest_vehicle_mps, MAX_LANDING_MPS),
            min_unheard_progress_mps: slowest_vehicle_mps * MIN_UNHEARD_SPEED_SHARE,
            range_edge_m: f32::INFINITY,
            fastest_vehicle_mps,
            own_position: Point::zeros(),
            next_relayed_rank: 0,
            own_rank: 0,
            fleet: None,
            ground: None,
            down_after: DOWN_AFTER,
            pair_position_error_m: 0.0,
            next_reported_rank: 0,
        };
        for (rank, entry) in roster.iter().enumerate() {
            if entry.system_id == own_id {
                table.own_rank = rank as u16;
            } else {
                // A roster of at most V entries fits.
                let _ = table.add_entry(entry.system_id, rank as u16);
            }
        }
        table.roster_count = table.entries.len();
        table
    }

    /// Number of positions dropped because the table had no room for their sender.
    pub fn dropped_position_count(&self) -> u16 {
        self.dropped_positions
    }

    /// Adds the entry of a vehicle not heard yet. Returns its index; `None` if the table is full.
    fn add_entry(&mut self, id: u8, rank: u16) -> Option<usize> {
        let entry = NeighbourEntry::new_not_heard_yet(
            id,
            rank,
            self.min_unheard_progress_mps,
            [self.max_unheard_travel_for_range_m(), self.fastest_vehicle_mps],
        );
        self.entries.push(entry).ok()?;
        Some(self.entries.len() - 1)
    }

    /// Index into `entries` of the roster's vehicle `id`, if an intent of our mission was heard
    /// from it within [`MEMBERSHIP_LIFETIME`].
    fn active_roster_index(&self, id: u8, now: Instant) -> Option<usize> {
        let at = self.roster_index(id)?;
        self.entries[at]
            .intent_at
            .is_some_and(|heard| now - heard < MEMBERSHIP_LIFETIME)
            .then_some(at)
    }

    /// Index into `entries` of another vehicle of the roster; `None` for any other id.
    fn roster_index(&self, id: u8) -> Option<usize> {
        self.entries[..self.roster_count].binary_search_by_key(&id, |c| c.id).ok()
    }

    /// Handles a neighbour's intent with the sequence number of its frame: only one newer than the
    /// last counts. To be called only for an intent of our mission: a message that anybody can send
    /// must not make the next genuine one look late. Positions are ordered by `time_boot_ms`
    /// instead.
    pub fn handle_numbered_intent(
        &mut self,
        now: Instant,
        sequence: u8,
        intent: &Intent,
        mission_crc: u32,
        plan_crc: Option<u32>,
    ) {
        let Some(at) = self.roster_index(intent.system_id) else { return };
        let entry = &mut self.entries[at];
        if entry.sequence.accept_if_new(sequence, now) {
            entry.intent_sequence = sequence;
            self.handle_intent(now, self.own_rank, intent, mission_crc, plan_crc);
        }
    }

    /// Handles a position sent by `id`. It counts as that of the roster's vehicle only if that
    /// vehicle has lately sent an intent of our mission; otherwise as that of a stranger.
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
        let (own, edge_m) = (self.own_position, self.range_edge_m);
        let at = self.active_roster_index(id, now).or_else(|| self.stranger_entry(id, now));
        let Some(entry) = at.and_then(|at| self.entries.get_mut(at)) else { return };
        let behind = entry.position_boot_ms.wrapping_sub(data.time_boot_ms);
        if !place.is_valid()
            || (entry.position_at.is_some() && behind < SENDER_RESTARTED_STEP_BACK_MS)
        {
            return;
        }
        entry.position_boot_ms = data.time_boot_ms;
        entry.heard_at = Some(now);
        entry.position_at = Some(now);
        entry.state.position = frames::geodetic_to_enu(origin, &place);
        entry.at_range_edge = (entry.state.position - own).norm_squared() >= edge_m * edge_m;
        let cm_per_s = Vector3::new(f32::from(data.vx), f32::from(data.vy), f32::from(data.vz));
        entry.state.velocity = frames::swap_enu_ned(&(cm_per_s * 0.01));
        entry.speed_mps = entry.state.velocity.length();
        entry.update_place_on_points();
        if entry.speed_mps >= MAX_HOVER_MPS {
            entry.moved_at = now;
        }
    }

    /// Handles a neighbour's intent. It counts only from a vehicle of the roster with our mission's
    /// CRC, its progress only if it follows the plan of our plan's CRC. `rank` is this vehicle's.
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
        // Before its first intent the vehicle may have been taken for a stranger.
        self.retain_strangers(|c| c.id != intent.system_id);
        let entry = &mut self.entries[at];
        entry.shares_plan = plan_crc.is_some_and(|crc| crc == intent.plan_crc);
        let on_plan = intent.flags & ON_PLAN != 0;
        let shared = on_plan && entry.shares_plan;
        let flies_plan = on_plan && intent.flags & (LANDED | OUT_OF_PLAN) == 0;
        let follows = flies_plan && intent.plan_crc != 0;
        entry.follows_other_plan = follows && plan_crc.is_some_and(|crc| crc != intent.plan_crc);
        (entry.heard_at, entry.intent_at) = (Some(now), Some(now));
        entry.flags = intent.flags;
        if entry.reports_any(GROUNDED)
            && !entry.reports_any(LANDED | OUT_OF_PLAN)
            && entry.position_at.is_some()
        {
            entry.pad = Some(entry.state.position);
        }
        let out = entry.reports_any(OUT_OF_PLAN) && entry.position_at.is_some();
        entry.out_of_plan_since = entry.out_of_plan_since.or(Some(now)).filter(|_| out);
        // From rank 32 on there is no bit: this vehicle counts as heard by the neighbour.
        if rank >= 32 || intent.heard_bits & (1 << rank) != 0 {
            entry.hears_us_at = Some(now);
            self.reported_heard_at = Some(now);
        }
        entry.heard_bits = intent.heard_bits;
        entry.points.clone_from(&intent.points);
        let most = intent.points.len().saturating_sub(1) as u8;
        entry.unheard_flight_point_count = intent.unheard_flight_point_count.min(most);
        entry.points_length_m = if self.fleet.is_some() { 0.0 } else { -1.0 };
        let from = intent.points.first().copied().unwrap_or_default();
        let most = |most: f32, p: &Point| libm::fmaxf(most, (p - from).norm_squared());
        entry.points_extent_m = fpu::sqrtf(entry.points_to_stop().iter().fold(0.0, most));
        entry.update_place_on_points();
        (entry.may_come_down, entry.ground_m) = (intent.may_come_down, intent.ground_m);
        entry.gates_open_up_to_m =
            if shared { intent.gates_open_up_to_m } else { f32::NEG_INFINITY };
        entry.unheard_flight_delay_s = intent.unheard_flight_delay_s;
        entry.state.grounded = intent.flags & (GROUNDED | LANDED) != 0;
        entry.state.progress_m = shared
            .then(|| entry.plausible_progress_m(intent.progress_m, self.max_progress_mps, now));
    }

    /// Number of vehicles in the table, strangers included.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether the table has no vehicle.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Forgets what holds only for an older plan: when a scan found the path clear, avoided places,
    /// relayed progress, the bound of believed progress, and open gates.
    pub fn forget_plan(&mut self) {
        self.path_clear_at = Instant::ZERO;
        for entry in &mut self.entries {
            (entry.avoided_place, entry.max_progress) = (NO_PLACE, None);
            (entry.relayed_progress_m, entry.relayed_report_at) = (None, None);
            entry.gates_open_up_to_m = f32::NEG_INFINITY;
        }
    }
}

#[cfg(test)]
mod tests;
