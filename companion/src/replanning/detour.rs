//! Detours around vehicles that left the plan, and around reported obstacles: which vehicles count
//! as out of the plan, whether something blocks the path, and whose turn it is to fly a detour.
//!
//! A vehicle that is out of the plan (landed elsewhere, with its pilot for good, or silent for so
//! long that it counts as dead) opens every gate that waits for it, and is an obstacle where it
//! rests. A vehicle whose path is blocked by it, or which was out itself and may fly again, stops
//! and waits until all others are out of the plan, or stand and wait too. Then the blocked vehicle
//! with the lowest system id requests a detour from its shell and flies it to its goal. Meanwhile
//! it reports the progress at which it left the plan: vehicles that wait for it go on waiting, so
//! it flies alone. Once it has landed it is out of the plan, and the next may go.
//! Two vehicles must not begin a detour at once, each before it hears of the other. So a turn is
//! claimed first: for [`TURN_CLAIM`], longer than messages take, the vehicle reports that its path
//! is blocked and no longer that it waits. It begins only if all others wait then; a vehicle that
//! hears a lower system id claim waits again.
//!
//! The place of a vehicle out of the plan is compared with the whole path before its gates open,
//! and from then on twice a second; with many vehicles such a scan takes several steps.
//!
//! In a coverage mission there is no roadmap and no turn: a stopped vehicle flies around the
//! obstacle and back to its path ([`beside`]), or home ([`homeward`]). ENU metres.

mod beside;
mod homeward;
pub(crate) mod path_kind;
mod rejoining;
mod reported;
pub(crate) mod searches;

use core::cell::OnceCell;

use planner_core::detour;
use planner_core::geo::frames::Geodetic;
use planner_core::{Length, Point};

use self::beside::AreaDetourSearches;
use self::homeward::HomewardSearch;
use self::path_kind::{DetourPurpose, PathKind};
use crate::link::commands::{ACCEPTED, Command};
use crate::replanning::obstacles::Obstacles;
use crate::replanning::view::DetourView;
use crate::state::State;
use crate::swarm::incremental_scan::IncrementalScan;
use crate::swarm::neighbours::MAX_HOVER_MPS;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Period of the scans that check whether the path is blocked.
const BLOCKED_CHECK_EVERY: Duration = Duration::from_millis(500);
/// Maximum number of comparisons of a path segment with a keep-out zone in one step, or those of
/// the whole path with one zone if they are more.
const MAX_SEGMENT_CHECKS_PER_STEP: usize = 160;
/// Cost of computing one keep-out zone, as a number of comparisons of it with a path segment.
const ZONE_COST: usize = 12;
/// Time for which all other vehicles have to stand before this one claims the turn, seconds: longer
/// than a vehicle takes to see and obey a gate that opened.
const ALL_STAND_BEFORE_CLAIM_S: u64 = 3;
/// Time for which a vehicle claims the turn to fly a detour before it takes the turn.
const TURN_CLAIM: Duration = Duration::from_secs(1);
/// Time by which each blocked vehicle with a lower system id delays this one's claim, seconds.
const TURN_DELAY_PER_VEHICLE_S: u64 = 2;
/// Maximum pause from a search that found no detour to the next, seconds.
const MAX_SEARCH_PAUSE_S: u64 = 10;
/// Time for which a vehicle waits while all others stand, after which it counts as blocked: the
/// vehicle that it waits for has found no detour.
const DEAD_END_AFTER: Duration = Duration::from_secs(15);
/// Number of failed searches and detours without progress, together, after which a vehicle seeks no
/// detour; one fewer is enough if searches failed in one place over [`EARLY_GIVE_UP_AFTER_S`].
const MAX_FAILED_SEARCHES: u8 = 3;
/// Time since the first failed search in one place after which one search fewer is enough, s.
const EARLY_GIVE_UP_AFTER_S: u64 = 50;
/// Time without progress on a detour, or under a stop by the safety filter, that counts as a block.
const STUCK_AFTER: Duration = Duration::from_secs(20);
/// Progress since the last block after which a further block counts as a new one, metres.
const BLOCKED_AGAIN_M: f32 = 2.0;
/// Time since the safety filter last stopped the vehicle within which it counts as stopped.
const STOP_COUNTS_FOR: Duration = Duration::from_millis(500);
/// Time since the last stop by the safety filter within which a blocked vehicle counts as stopped:
/// a neighbour that sways at the edge of the path must not make the block begin again and again.
const STOP_COUNTS_FOR_WHILE_BLOCKED: Duration = Duration::from_secs(3);
/// Time after which a vehicle on its pad that hears no other one, or that no other one hears,
/// reports that it waits.
const WAITS_UNHEARD_ON_PAD_AFTER: Duration = Duration::from_secs(10);
/// A stopped vehicle this near to the end of a path aside is at that end, though it sways, metres.
const ASIDE_END_TOLERANCE_M: f32 = 0.5;

/// What blocks the path ahead, and the detour that is requested or flown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Detours {
    obstacles: Obstacles,
    /// Whether the vehicle has to wait for a detour: its path is blocked, or it left the plan.
    blocked: bool,
    /// Whether this vehicle was out of the plan once, or got a path that does not lead back to it.
    left_plan: bool,
    path_kind: PathKind,
    /// Purpose of the path requested from the shell, and whether the shell has read the request.
    requested_purpose: Option<DetourPurpose>,
    request_read: bool,
    /// The search for a path straight home in a coverage mission.
    pub(crate) home: HomewardSearch,
    /// Searches for a detour in a coverage mission that leads back to the plan's path.
    area_searches: AreaDetourSearches,
    /// Progress along the plan's path at which the vehicle left it for a detour, metres.
    left_at_m: f32,
    /// Whether the requested detour has come and is not flown yet.
    detour_ready: bool,
    /// Number of failed searches for a detour to the goal since another vehicle last moved.
    failed_searches: u8,
    /// Whether a further search is useless: no other vehicle will move any more, or searches from
    /// this place have failed for [`EARLY_GIVE_UP_AFTER_S`].
    no_retry: bool,
    /// Number of failed searches from about the same place.
    failed_searches_here: u8,
    /// Place along the path of `failed_searches_here`, metres.
    failed_at_m: f32,
    /// Where along the path, metres, the last search for a detour to the goal found none, if no
    /// other vehicle has moved since.
    no_path_found_at_m: Option<f32>,
    /// When the first of `failed_searches_here` failed, and the last search for a detour anywhere.
    failed_since: Instant,
    failed_at: Instant,
    /// Number of detours in a row on which the vehicle made no progress.
    detours_without_progress: u8,
    /// When a search for a path aside last failed; `None` before.
    aside_search_failed_at: Option<Instant>,
    /// Place from before a jump of the position, and the time of the jump; `None` without a jump.
    place_before_jump: Option<(Point, Instant)>,
    /// Since when all other vehicles have been standing, by `Neighbours::are_all_standing`.
    all_standing_since: Option<Instant>,
    /// Since when this vehicle claims the turn to fly a detour; `None` while it does not.
    claimed_since: Option<Instant>,
    /// When the scan under way began; `None` without one.
    scan_began: Option<Instant>,
    /// Progress of the scan under way, and whether the last one found an obstacle on the path.
    scan: IncrementalScan,
    obstructed: bool,
    /// Place along the path where the vehicle was first blocked, metres, and when; kept until it is
    /// blocked [`BLOCKED_AGAIN_M`] further on, though the path may be clear in between.
    blocked_here: Option<(f32, Instant)>,
}

/// Result of a finished scan of the path.
struct ScanResult {
    /// When the scan began, if it found the path clear.
    began_if_clear: Option<Instant>,
}

impl Detours {
    /// Forgets what concerns an older path; keeps the reported obstacles and `left_plan`.
    pub(crate) fn forget_plan(&mut self, timers: &mut Timers) {
        timers.set(Timer::PathScan, Instant::ZERO);
        timers.set(Timer::RejoinSearch, Instant::ZERO);
        let obstacles = core::mem::take(&mut self.obstacles);
        *self = Self { left_plan: self.left_plan, obstacles, ..Self::default() };
        self.obstacles.forget_avoided();
    }

    /// Begins a new flight in a coverage mission: the vehicle counts as on its plan again.
    pub(crate) fn begin_flight(&mut self) {
        self.left_plan = false;
    }

    /// Makes the path count as blocked until the next scan has checked it.
    pub(crate) fn assume_blocked(&mut self) {
        (self.blocked, self.obstructed) = (true, true);
    }

    /// Adds, or removes, the obstacle that a command reports; returns the MAV_RESULT.
    pub(crate) fn handle_obstacle_command(
        &mut self,
        command: &Command,
        origin: &Geodetic,
        clearance_m: f32,
    ) -> u8 {
        let result = self.obstacles.handle_command(command, origin, clearance_m);
        if command.param1 <= 0.0 && result == ACCEPTED {
            // Obstacles were removed: a scan under way knows them by index, so it begins again.
            self.scan.restart();
            self.scan_began = None;
        }
        result
    }

    /// Number of obstacles reported by commands.
    pub(crate) fn obstacle_count(&self) -> usize {
        self.obstacles.count()
    }

    /// Whether the vehicle has to wait for a detour, or for its path home.
    pub(crate) fn is_blocked(&self) -> bool {
        self.blocked || self.home.is_seeking()
    }

    /// Time since the vehicle was first blocked about here, free times in between included, or 0.
    pub(crate) fn blocked_for(&self, now: Instant) -> Duration {
        self.blocked_here.map_or(Duration::default(), |(_, since)| now - since)
    }

    /// Whether this vehicle was out of the plan once, or got a path that does not lead back to it.
    pub(crate) fn has_left_plan(&self) -> bool {
        self.left_plan
    }

    /// First free place along the path beyond the block in a coverage mission, metres, where a
    /// detour can end; `None` if there is none.
    pub(crate) fn first_rejoin_m<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<f32> {
        beside::first_rejoin_m(view, self.obstacles.all())
    }

    /// Whether the vehicle, in a coverage mission, flies its plan onwards, past the climb: on its
    /// path or on a detour back to it. False on its way home, and once it has left the plan.
    pub(crate) fn keeps_to_plan_over_area<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        view.config.lost_vehicle_down_after_s.is_some()
            && (!self.is_on_detour() || self.is_beside_plan())
            && !self.left_plan
            && !self.is_homeward()
            && !view.guidance.returning
            && view.guidance.reference_along_m() >= 0.0
            && view.mission.plan().is_some_and(|plan| plan.task.leaves_pad())
    }

    /// Whether a stopped vehicle in a coverage mission may now seek a detour that leads back to its
    /// path.
    pub(crate) fn may_detour_over_area<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
        timers: &Timers,
    ) -> bool {
        // Beside its path the vehicle seeks another way back, whatever stopped it.
        (self.obstructed
            || self.is_beside_plan()
            || self.is_stopped_for_long(view, STOP_COUNTS_FOR_WHILE_BLOCKED))
            && self.keeps_to_plan_over_area(view)
            && self.area_searches.may_seek_rejoin(view.now, timers)
    }

    /// Ends a detour in a coverage mission: the shell has returned the vehicle's own plan again,
    /// and the vehicle flies the rest of it next.
    pub(crate) fn end_area_detour(&mut self, timers: &mut Timers) {
        let (searches, next_at) = (self.area_searches, timers.due_at(Timer::RejoinSearch));
        self.forget_plan(timers);
        (self.path_kind, self.area_searches) = (PathKind::PlanReady, searches);
        timers.set(Timer::RejoinSearch, next_at);
    }

    /// Whether the requested detour has come and is not flown yet.
    pub(crate) fn is_detour_ready(&self) -> bool {
        self.detour_ready
    }

    /// Progress along the plan's path at which the vehicle left it for a detour, metres.
    pub(crate) fn left_at_m(&self) -> f32 {
        self.left_at_m
    }

    /// Whether this vehicle stands until another one moves, and does not claim the turn itself.
    pub(crate) fn is_waiting_for_others<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        self.is_stopped_by_others(view) && self.claimed_since.is_none()
    }

    /// Whether this vehicle stands, on its pad or in the air, until another one moves.
    fn is_stopped_by_others<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let now = view.now;
        let held = view.guidance.advice.waiting_for_id != 0 || view.guidance.filter.is_stopped();
        let rests = view.telemetry.velocity.length() < MAX_HOVER_MPS;
        let stands = view.guidance.is_setpoint_still_outside_descent() && rests;
        match view.mission.state() {
            state if state.waits_on_pad_after_start() => {
                self.blocked
                    || !view.guidance.filter.column_clear()
                    || view.neighbours.unlinked_duration(now, view.mission.started_at())
                        >= WAITS_UNHEARD_ON_PAD_AFTER
                    || (held && !view.guidance.advice_allows_departure())
            }
            State::Follow => held && stands,
            State::Climb => {
                view.guidance.filter.is_stopped()
                    && view.telemetry.velocity.length() < MAX_HOVER_MPS
            }
            // `stands` is false in a descent, where a blocked vehicle hovers too.
            State::Blocked => view.guidance.is_setpoint_still() && rests,
            // A held landing goes on by itself once its column is free.
            State::LandingHeld => view.telemetry.velocity.length() < MAX_HOVER_MPS,
            // After a detour the vehicle only waits to be disarmed.
            state if state.lands_or_disarms() => self.is_on_detour() && view.is_on_ground(),
            _ => false,
        }
    }

    /// Continues the scan for obstacles on the path, and decides whether the vehicle is blocked. If
    /// a scan ends in this step and found the path clear, returns when it began; else `None`.
    pub(crate) fn scan_path<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
        timers: &mut Timers,
    ) -> Option<Instant> {
        let now = view.now;
        self.left_plan |= view.config.roster.len() > 1
            && self.is_own_vehicle_out_of_plan(view)
            && view.mission.plan().is_some();
        let on_ground = view.mission.state().waits_on_pad_after_start();
        let stopped = view.mission.state().is_blocked();
        if !on_ground && !stopped && view.mission.state() != State::Follow {
            (self.blocked, self.obstructed) = (false, false);
            (self.all_standing_since, self.claimed_since, self.blocked_here) = (None, None, None);
            self.scan.restart();
            self.scan_began = None;
            return None;
        }
        let due = timers.take_due(Timer::PathScan, now, BLOCKED_CHECK_EVERY);
        if due {
            self.scan_began.get_or_insert(now);
        }
        let looked = self.take_scan_result(view);
        if looked.is_some() || due {
            self.update_blocked(view);
        }
        looked.and_then(|looked| looked.began_if_clear)
    }

    /// Continues the scan under way; `None` while it goes on, or where there is none.
    fn take_scan_result<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<ScanResult> {
        let began = self.scan_began?;
        let obstructed = self.continue_path_scan(view)?;
        self.scan_began = None;
        self.obstructed = obstructed;
        Some(ScanResult { began_if_clear: (!obstructed).then_some(began) })
    }

    /// Decides whether the vehicle is blocked, since when no other one has moved, and whether this
    /// one claims to search for a detour next.
    fn update_blocked<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
    ) {
        let now = view.now;
        let stuck = self.is_on_detour()
            && view.mission.state() != State::Scheduled
            && now - view.guidance.last_progress_at() > STUCK_AFTER;
        // A vehicle that stands at the end of a path aside may have swayed back a little.
        let stands = view.mission.state().is_blocked();
        let near_m = if stands { ASIDE_END_TOLERANCE_M } else { 0.0 };
        let length_m = view.mission.plan().map_or(0.0, |plan| plan.path.length_m());
        let at_end = view.guidance.reference_along_m() >= length_m - near_m;
        let off_plan = match self.path_kind {
            _ if self.seeks_landing_aside() => false,
            PathKind::Plan | PathKind::PlanReady => self.left_plan,
            PathKind::Detour(DetourPurpose::Aside(_)) => at_end,
            PathKind::Detour(_) => false,
            PathKind::OffPlan => true,
        };
        let dead_end = self.is_stopped_by_others(view)
            && !Self::is_freed_over_area(view)
            && self.all_standing_since.is_some_and(|at| now - at > DEAD_END_AFTER);
        let blocked = view.mission.state() == State::Blocked;
        let free = if blocked { STOP_COUNTS_FOR_WHILE_BLOCKED } else { STOP_COUNTS_FOR };
        let stopped = self.is_stopped_for_long(view, free);
        self.blocked = !view.guidance.returning
            && (stuck || off_plan || dead_end || stopped || self.obstructed);
        let along_m = view.guidance.reference_along_m();
        if self.blocked
            && self.blocked_here.is_none_or(|(at_m, _)| along_m > at_m + BLOCKED_AGAIN_M)
        {
            self.blocked_here = Some((along_m, now));
        }
        if !view.neighbours.are_all_standing(now) {
            // Another vehicle moved, which may have freed the path.
            (self.all_standing_since, self.no_path_found_at_m) = (None, None);
            (self.failed_searches, self.no_retry) = (0, false);
        } else if self.all_standing_since.is_none() {
            self.all_standing_since = Some(now);
        }
        let claims = self.may_claim_turn(view)
            && !view.neighbours.is_turn_claimed_by_lower_id(view.config.system_id, now);
        self.claimed_since = self.claimed_since.or(Some(now)).filter(|_| claims);
    }

    /// Whether the safety filter has kept the vehicle from flying on for 20 s although the vehicle
    /// goes first; in a coverage mission also if it yields to a neighbour off the plan. `free`:
    /// time for which a stop counts after its end.
    fn is_stopped_for_long<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
        free: Duration,
    ) -> bool {
        let (now, filter) = (view.now, &view.guidance.filter);
        let for_good = view.config.lost_vehicle_down_after_s.is_some()
            && !view.neighbours.follows_plan(filter.last_blocker_id());
        filter.blocked_with_priority_for(now, free) > STUCK_AFTER
            || (for_good && filter.hindered_for(now) > STUCK_AFTER)
    }

    /// Whether an obstacle is on the path; `None` while the scan is not finished.
    fn continue_path_scan<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<bool> {
        let Some(plan) = view.mission.plan() else { return Some(false) };
        let here = match view.mission.state() {
            state if state.waits_on_pad_after_start() => view.mission.pad_position(),
            _ => view.telemetry.position,
        };
        let along_m = view.guidance.reference_along_m();
        let cost = detour::count_segments_ahead(&plan.path, along_m) + ZONE_COST;
        // A hovering vehicle sways. So in a coverage mission an obstacle that has blocked the path
        // does so until it is as far from the path as a detour keeps.
        let waits = view.config.lost_vehicle_down_after_s.is_some()
            && view.mission.state() == State::Blocked
            && self.obstructed;
        let [beside_m, beyond_m] = if waits {
            beside::STAYS_BLOCKED_BESIDE_AND_BEYOND_STOP_M
        } else {
            beside::BLOCKED_BESIDE_AND_BEYOND_STOP_M
        };
        let apart_m = view.config.safety_distance_m + beside_m;
        let (now, neighbours) = (view.now, view.neighbours);
        // In a coverage mission only the path up to `beyond_m` past where the vehicle can stop
        // counts: it goes on taking pictures until it is near the obstacle. What lies beyond the
        // place where it is to hold for a division does not count yet.
        let known_until_m = OnceCell::new();
        let until_m = || match view.config.lost_vehicle_down_after_s {
            Some(_) => {
                let stops_m = view.guidance.braking_end_m().max(0.0);
                (stops_m + beyond_m).min(view.guidance.division_hold_m().max(along_m))
            }
            None => f32::INFINITY,
        };
        let new = self.obstacles.unavoided();
        self.scan.continue_scan(
            new.len() + neighbours.len(),
            &mut (cost.max(MAX_SEGMENT_CHECKS_PER_STEP) as u16),
            cost as u16,
            |source, visit| match new.get(source) {
                Some(obstacle) => visit(*obstacle),
                None => {
                    neighbours.for_each_unavoided_zone_of(source - new.len(), now, apart_m, visit);
                }
            },
            |obstacle| {
                let until_m = *known_until_m.get_or_init(until_m);
                let (climb_m, descent_m) = (plan.climb_m, plan.descent_m);
                detour::is_path_blocked(
                    &plan.path,
                    along_m..until_m,
                    climb_m,
                    descent_m,
                    &here,
                    obstacle,
                )
            },
        )
    }

    /// Whether this vehicle may claim the turn to fly a detour.
    fn may_claim_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        // In a coverage mission vehicles take no turns.
        if !self.blocked || view.config.lost_vehicle_down_after_s.is_some() {
            return false;
        }
        let Some(at) = self.all_standing_since else { return false };
        let pause_s = Self::search_pause_s(view);
        let wait_s = ALL_STAND_BEFORE_CLAIM_S
            + TURN_DELAY_PER_VEHICLE_S
                * view.neighbours.blocked_count_below_id(view.config.system_id)
            + pause_s * u64::from(self.failed_searches);
        self.may_search_again(pause_s, view.now)
            && view.neighbours.are_all_standing(view.now)
            && view.now - at >= Duration::from_secs(wait_s)
    }

    /// Whether this vehicle may begin its detour: it has claimed the turn, and all others wait.
    pub(crate) fn is_our_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        self.may_claim_turn(view)
            && self.claimed_since.is_some_and(|at| view.now - at >= TURN_CLAIM)
            && view.neighbours.are_all_waiting(view.now)
    }
}

#[cfg(test)]
mod tests;
