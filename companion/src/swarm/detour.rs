//! Living with vehicles that left the plan: which count as out, what blocks the path, and flying
//! around it.
//!
//! A vehicle that is out (landed elsewhere, with its pilot for good, or silent for so long that it
//! counts as dead) opens every gate that waits for it, and is an obstacle where it rests. A vehicle
//! whose path that blocks, or which was out itself and may fly again, stops and waits until all
//! others are out or stand and wait themselves. Then the one with the lowest system id asks its
//! shell for a detour around everybody and flies it to its goal. All the while it reports the
//! progress at which it left the plan: a vehicle that waits for it continues waiting, so it flies
//! alone. On the ground it is out, and the next may go.
//!
//! Two must not begin at once, each before it hears of the other. So a turn is claimed first: the
//! vehicle reports that its path is blocked and no longer that it waits, for [`TURN_CLAIM`], longer
//! than a word takes to be heard. It begins only if all others wait then; a vehicle that hears a
//! lower system id claim waits again.
//!
//! A vehicle that is out is checked along the whole path before its gates open, and from then on
//! twice a second: [`MAX_STRETCHES_PER_STEP`] of the path a step, so a look among many takes
//! several steps.
//!
//! Over a field there is no roadmap and no turn: a stopped vehicle flies around the obstacle and
//! back to its path ([`beside`]), or home ([`homeward`]).
//!
//! ENU metres.

pub(crate) mod asking;
mod beside;
pub(crate) mod flown;
mod homeward;
mod reported;
mod returning;

use planner_core::detour;
use planner_core::frames::Geodetic;
use planner_core::{Length, Point};

use self::beside::{DETOUR_MARGIN_M, FieldSearches, LOOK_AHEAD_M};
use self::flown::{DetourPurpose, FlownPath};
use self::homeward::HomewardFlight;
use crate::link::commands::{ACCEPTED, Command};
use crate::mission::State;
use crate::swarm::neighbours::MAX_HOVER_MPS;
use crate::swarm::obstacles::Obstacles;
use crate::swarm::sweep::IncrementalScan;
use crate::swarm::view::DetourView;
use crate::time::{Duration, Instant};

/// Time between two checks whether the path is blocked.
const BLOCKED_CHECK_EVERY: Duration = Duration::from_millis(500);
/// Stretches of the path that are checked in one step, each against one keep-out zone; a step
/// checks the whole path at least once.
const MAX_STRETCHES_PER_STEP: usize = 160;
/// Cost of gathering one keep-out zone, as a number of those stretches.
const ZONE_COST: usize = 12;
/// Time for which all other vehicles have to stand before a detour begins, seconds: longer than a
/// gate that opened takes to be seen and obeyed.
const ALL_STAND_S: u64 = 3;
/// Time for which a vehicle claims its turn before it takes the turn.
const TURN_CLAIM: Duration = Duration::from_secs(1);
/// Time that each blocked vehicle with a lower id has to begin its detour, seconds.
const TURN_S: u64 = 2;
/// Time from a search that found no detour to the next search, seconds.
const DETOUR_RETRY_S: u64 = 10;
/// If a vehicle waits this long while all others stand, it is in a dead end: the vehicle that it
/// waits for found no detour.
const DEAD_END_AFTER: Duration = Duration::from_secs(30);
/// Searches without a detour after which a vehicle gives up, or one fewer within
/// [`GIVE_UP_AFTER_S`].
const MAX_DETOUR_SEARCHES: u8 = 4;
/// Time after which one search fewer is enough, seconds.
const GIVE_UP_AFTER_S: u64 = 60;
/// Time without progress after which a detour is blocked too.
const STUCK_AFTER: Duration = Duration::from_secs(20);
/// Progress after which a vehicle that was blocked is blocked again, not still, metres.
const BLOCKED_AGAIN_M: f32 = 2.0;
/// Time for which whatever kept the vehicle from continuing still does; once the vehicle counts as
/// blocked it is [`BLOCKED_HINDERED_WITHIN`]: a neighbour that sways at the edge of the path must
/// not make the block begin again and again.
const HINDERED_WITHIN: Duration = Duration::from_millis(500);
/// Time without a hindrance after which a blocked vehicle is free.
const BLOCKED_HINDERED_WITHIN: Duration = Duration::from_secs(3);
/// Time under a pilot's control after which the pilot keeps the vehicle for good: others fly around
/// it.
const PILOT_KEEPS_AFTER: Duration = Duration::from_secs(20);
/// Time after which an abort is over whose end the autopilot does not report.
const ABORT_OVER_AFTER: Duration = Duration::from_secs(5);
/// Time after which a vehicle on its pad that no other vehicle hears waits like one that waits for
/// others.
const UNHEARD_ON_PAD_AFTER: Duration = Duration::from_secs(10);
/// Distance from the end of a path aside within which a blocked vehicle stands aside, metres.
const SWAY_ASIDE_M: f32 = 0.5;
/// Greatest deviation from the path, metres: a path that much nearer to a keep-out zone is blocked.
const BLOCKED_WITHIN_M: f32 = 0.25;

/// Knowledge of the path ahead, and of detours.
#[derive(Clone, Debug, Default)]
pub(crate) struct Detours {
    obstacles: Obstacles,
    /// The path is blocked, or the plan was left.
    blocked: bool,
    /// This vehicle was out of the plan once: the others do not count on it any more.
    left_plan: bool,
    flown: FlownPath,
    /// What the shell is asked for, and whether it has read that.
    sought: Option<DetourPurpose>,
    request_read: bool,
    /// The vehicle's way home over a field.
    pub(crate) home: HomewardFlight,
    /// The vehicle's searches beside its path over a field.
    field_searches: FieldSearches,
    /// Progress on the plan when it was left for a detour, metres.
    left_at_m: f32,
    /// The detour asked for has come.
    detour_ready: bool,
    /// Number of detours that were not found since another vehicle last moved.
    failures: u8,
    /// The last one was not found although all others lie or rest for good, or for a while from
    /// here, whichever moved.
    no_retry: bool,
    /// Detours not found from here, whichever moved between; how far along the path that is, and
    /// since when.
    failures_here: u8,
    failed_at_m: f32,
    failed_since: Instant,
    /// Detours on which it did not move, in a row.
    detours_without_progress: u8,
    /// When no way aside was found.
    no_way_aside_at: Option<Instant>,
    /// Place and time of the vehicle before its position jumped.
    before_jump: Option<(Point, Instant)>,
    quiet_since: Option<Instant>,
    /// Since when it claims its turn.
    claimed_since: Option<Instant>,
    /// When a look was last due, and when the one that continues began.
    scanned_at: Instant,
    scan_began: Option<Instant>,
    /// Progress of the scan along the path, and the result of the last one.
    scan: IncrementalScan,
    obstructed: bool,
    /// Place along the path where the vehicle was blocked, metres, and since when: the vehicle has
    /// come no further, though its path was clear in between.
    blocked_here: Option<(f32, Instant)>,
}

/// Result of a scan of the path.
struct ScanResult {
    /// When one that found nothing began.
    clear_at: Option<Instant>,
}

impl Detours {
    /// The way ahead is as the plan has it again.
    pub(crate) fn forget_plan(&mut self) {
        let obstacles = core::mem::take(&mut self.obstacles);
        *self = Self { left_plan: self.left_plan, obstacles, ..Self::default() };
        self.obstacles.forget_avoided();
    }

    /// A new flight over an area begins: the others count this vehicle as a new one.
    pub(crate) fn begin_flight(&mut self) {
        self.left_plan = false;
    }

    /// Treats the path as blocked until the next scan has checked it.
    pub(crate) fn assume_blocked(&mut self) {
        (self.blocked, self.obstructed) = (true, true);
    }

    /// Takes an obstacle of a command.
    pub(crate) fn handle_obstacle_command(
        &mut self,
        command: &Command,
        origin: &Geodetic,
        clearance_m: f32,
    ) -> u8 {
        let result = self.obstacles.handle_command(command, origin, clearance_m);
        if command.param1 <= 0.0 && result == ACCEPTED {
            // A look that is under way counts them by index.
            self.scan.restart();
            self.scan_began = None;
        }
        result
    }

    /// Obstacles that were reported.
    pub(crate) fn obstacle_count(&self) -> usize {
        self.obstacles.count()
    }

    /// Whether the path is blocked, or the plan was left.
    pub(crate) fn is_blocked(&self) -> bool {
        self.blocked || self.home.is_seeking()
    }

    /// Time for which the vehicle has come no further because its path was blocked, now and again.
    pub(crate) fn blocked_for(&self, now: Instant) -> Duration {
        self.blocked_here.map_or(Duration::default(), |(_, since)| now - since)
    }

    /// Whether it has left the plan once: the others do not count on it any more.
    pub(crate) fn has_left_plan(&self) -> bool {
        self.left_plan
    }

    /// Place where the vehicle could come back to its path over a field, metres, beyond what blocks
    /// the path.
    pub(crate) fn rejoin_m<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<f32> {
        beside::first_rejoin_m(view, self.obstacles.all())
    }

    /// Whether it is on the path of its plan over a field, or beside that to come back to it.
    pub(crate) fn keeps_to_plan_over_field<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        view.config.division.is_some()
            && (!self.is_on_detour() || self.is_beside_plan())
            && !self.left_plan
            && !self.is_homeward()
            && !view.guidance.returning
            && view.guidance.along_m() >= 0.0
            && view.mission.plan().is_some_and(|plan| plan.task.leaves_pad())
    }

    /// Whether it may fly around what is on its path over a field now: where it has not left that.
    pub(crate) fn may_detour_over_field<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        // Whatever it stopped for on its way around, it seeks another one.
        (self.obstructed || self.is_beside_plan() || self.is_stopped(view, BLOCKED_HINDERED_WITHIN))
            && self.keeps_to_plan_over_field(view)
            && self.field_searches.may_seek(view.now)
    }

    /// The vehicle's own plan has come, or will not: the vehicle is on its path again, or has to do
    /// without.
    pub(crate) fn end_field_detour(&mut self, came: bool) {
        if came {
            let field_searches = self.field_searches;
            self.forget_plan();
            (self.flown, self.field_searches) = (FlownPath::PlanReturned, field_searches);
        } else {
            self.give_up_plan();
        }
    }

    /// Whether the requested detour has come.
    pub(crate) fn is_ready(&self) -> bool {
        self.detour_ready
    }

    /// Progress on the plan when it was left for a detour, metres.
    pub(crate) fn left_at_m(&self) -> f32 {
        self.left_at_m
    }

    /// Whether it has left the plan for good, and rests or is a pilot's.
    pub(crate) fn is_out_of_plan<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let lasted = view.mission.time_in_state(view.now);
        match view.mission.state() {
            State::Done => !view.guidance.is_at_goal(&view.scene) || self.left_plan,
            State::Aborted => view.telemetry.on_ground == Some(true) || lasted >= ABORT_OVER_AFTER,
            State::PilotControl | State::PilotReturned => {
                view.mission.time_with_pilot(view.now) >= PILOT_KEEPS_AFTER
            }
            _ => false,
        }
    }

    /// Whether it stands until another vehicle moves: it does not claim the turn to move itself.
    pub(crate) fn is_waiting<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        self.is_stopped_by_others(view) && self.claimed_since.is_none()
    }

    fn is_stopped_by_others<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let now = view.now;
        let held = view.guidance.advice.waiting_for != 0 || view.guidance.filter.is_stopped();
        let rests = view.telemetry.velocity.length() < MAX_HOVER_MPS;
        let stands = view.guidance.is_standing() && rests;
        match view.mission.state() {
            State::Scheduled | State::PadReplanning => {
                self.blocked
                    || !view.guidance.filter.column_clear()
                    || view.neighbours.silence_duration(now, view.mission.started_at())
                        >= UNHEARD_ON_PAD_AFTER
                    || (held && view.guidance.advice.stop_within_m <= 0.05)
            }
            State::Follow => held && stands,
            State::Climb => {
                view.guidance.filter.is_stopped()
                    && view.telemetry.velocity.length() < MAX_HOVER_MPS
            }
            // Blocked on its way down it stays there.
            State::Blocked => view.guidance.is_setpoint_still() && rests,
            // The vehicle continues by itself only once its column is free.
            State::LandingHeld => view.telemetry.velocity.length() < MAX_HOVER_MPS,
            _ => false,
        }
    }

    /// Scans for obstacles on the path, and checks whether the others stand.
    pub(crate) fn scan_path<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<Instant> {
        let now = view.now;
        self.left_plan |= view.config.roster.len() > 1
            && self.is_out_of_plan(view)
            && view.mission.plan().is_some();
        let on_ground = matches!(view.mission.state(), State::Scheduled | State::PadReplanning);
        let stopped = matches!(view.mission.state(), State::Blocked | State::Replanning);
        if !on_ground && !stopped && view.mission.state() != State::Follow {
            (self.blocked, self.obstructed) = (false, false);
            (self.quiet_since, self.claimed_since, self.blocked_here) = (None, None, None);
            self.scan.restart();
            self.scan_began = None;
            return None;
        }
        let due = now - self.scanned_at >= BLOCKED_CHECK_EVERY;
        if due {
            self.scanned_at = now;
            self.scan_began.get_or_insert(now);
        }
        let looked = self.take_scan_result(on_ground, view);
        if looked.is_some() || due {
            self.update_blocked(view);
        }
        looked.and_then(|looked| looked.clear_at)
    }

    /// Takes the result of a check of the path that has ended.
    fn take_scan_result<const V: usize, const W: usize, const G: usize>(
        &mut self,
        on_ground: bool,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<ScanResult> {
        let began = self.scan_began?;
        let in_the_way = self.continue_path_scan(on_ground, view)?;
        self.scan_began = None;
        self.obstructed = in_the_way;
        Some(ScanResult { clear_at: (!in_the_way).then_some(began) })
    }

    /// Decides whether the vehicle is blocked, since when all have stood, and whether it claims its
    /// turn.
    fn update_blocked<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &DetourView<'_, V, W, G>,
    ) {
        let now = view.now;
        let stuck = self.is_on_detour()
            && view.mission.state() != State::Scheduled
            && now - view.guidance.last_progress_at() > STUCK_AFTER;
        // Where it stands aside it still makes room.
        let stands = matches!(view.mission.state(), State::Blocked | State::Replanning);
        let near_m = if stands { SWAY_ASIDE_M } else { 0.0 };
        let length_m = view.mission.plan().map_or(0.0, |plan| plan.path.length_m());
        let at_end = view.guidance.along_m() >= length_m - near_m;
        let astray = match self.flown {
            _ if self.seeks_landing() => false,
            FlownPath::Plan | FlownPath::PlanReturned => self.left_plan,
            FlownPath::Detour(DetourPurpose::Aside(_)) => at_end,
            FlownPath::Detour(_) => false,
            FlownPath::Astray => true,
        };
        let dead_end = self.is_stopped_by_others(view)
            && self.quiet_since.is_some_and(|at| now - at > DEAD_END_AFTER);
        let free = if view.mission.state() == State::Blocked {
            BLOCKED_HINDERED_WITHIN
        } else {
            HINDERED_WITHIN
        };
        let stopped = self.is_stopped(view, free);
        self.blocked =
            !view.guidance.returning && (stuck || astray || dead_end || stopped || self.obstructed);
        let along_m = view.guidance.along_m();
        if self.blocked
            && self.blocked_here.is_none_or(|(at_m, _)| along_m > at_m + BLOCKED_AGAIN_M)
        {
            self.blocked_here = Some((along_m, now));
        }
        if !view.neighbours.are_all_standing(now) {
            // Another vehicle moved: the block of the path may have gone.
            (self.quiet_since, self.failures, self.no_retry) = (None, 0, false);
        } else if self.quiet_since.is_none() {
            self.quiet_since = Some(now);
        }
        let claims = self.may_claim_turn(view)
            && !view.neighbours.is_turn_claimed_before(view.config.system_id, now);
        self.claimed_since = self.claimed_since.or(Some(now)).filter(|_| claims);
    }

    /// Whether another vehicle has stopped it for long: one that lets it go first, or over a field
    /// one off the plan.
    fn is_stopped<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
        free: Duration,
    ) -> bool {
        let (now, filter) = (view.now, &view.guidance.filter);
        let for_good =
            view.config.division.is_some() && !view.neighbours.follows_plan(filter.last_blocker());
        filter.blocked_for(now, free) > STUCK_AFTER
            || (for_good && filter.hindered_for(now) > STUCK_AFTER)
    }

    /// Whether an obstacle is on the path; `None` while the scan is not finished.
    fn continue_path_scan<const V: usize, const W: usize, const G: usize>(
        &mut self,
        on_ground: bool,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<bool> {
        let Some(plan) = view.mission.plan() else { return Some(false) };
        let here = if on_ground { view.mission.pad_position() } else { view.telemetry.position };
        let along_m = view.guidance.along_m();
        let cost = detour::count_segments_ahead(&plan.path, along_m) + ZONE_COST;
        // One that hovers sways: what blocked the path over a field blocks it until it is as far
        // away as a detour keeps.
        let waits = view.config.division.is_some()
            && view.mission.state() == State::Blocked
            && self.obstructed;
        let beside_m = if waits { DETOUR_MARGIN_M } else { BLOCKED_WITHIN_M };
        let apart_m = view.config.safety_distance_m + beside_m;
        let (now, neighbours) = (view.now, view.neighbours);
        let new = self.obstacles.new_ones();
        self.scan.continue_scan(
            new.len() + neighbours.len(),
            &mut (cost.max(MAX_STRETCHES_PER_STEP) as u16),
            cost as u16,
            |source, tell| match new.get(source) {
                Some(obstacle) => tell(*obstacle),
                None => neighbours.for_each_zone_of(source - new.len(), now, apart_m, tell),
            },
            // Over a field it photographs what comes before, and flies around what blocks the way
            // when it comes there.
            |obstacle| {
                let until_m = match view.config.division {
                    Some(_) => along_m.max(0.0) + LOOK_AHEAD_M,
                    None => f32::INFINITY,
                };
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

    /// Whether it may claim its turn to fly around.
    fn may_claim_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let wait_s = ALL_STAND_S
            + TURN_S * view.neighbours.blocked_count_before(view.config.system_id)
            + DETOUR_RETRY_S * u64::from(self.failures);
        // Over a field nobody flies around.
        self.blocked
            && view.config.division.is_none()
            && view.neighbours.are_all_standing(view.now)
            && self.quiet_since.is_some_and(|at| view.now - at >= Duration::from_secs(wait_s))
    }

    /// Whether it may fly around now.
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
