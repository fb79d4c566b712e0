//! Living with vehicles that left the plan: which count as out, what blocks the path, and flying around it.
//!
//! A vehicle that is out (landed elsewhere, with its pilot for good, or silent for so long that it counts as dead) opens every
//! gate that waits for it, and is an obstacle where it rests. A vehicle whose path that blocks, or which was out itself and
//! may fly again, stops and waits until all others are out or stand and wait themselves. Then the one with the lowest
//! system id asks its shell for a way around everybody and flies it to its goal. All the while it reports the progress at which it
//! left the plan: a vehicle that waits for it goes on waiting, so it flies alone. On the ground it is out, and the next may go.
//!
//! Two must not begin at once, each before it hears of the other. So a turn is claimed first: the vehicle reports that its path is
//! blocked and no longer that it waits, for [`TURN_CLAIM`], longer than a word takes to be heard. It begins only if all others
//! wait then; a vehicle that hears a lower system id claim waits again.
//!
//! A vehicle that is out is looked at along the whole path before its gates open, and from then on twice a second: [`MAX_STRETCHES_PER_STEP`] of the path a
//! step, so a look among many takes several steps.
//!
//! Over a field there is no roadmap, and nobody waits for a turn: who is stopped flies around what stops it and back to its path
//! ([`beside`]), or home ([`homeward`]).
//!
//! ENU metres.

pub(crate) mod asking;
mod beside;
mod homeward;

use planner_core::Point;
use planner_core::detour;
use planner_core::frames::Geodetic;

use self::beside::{Beside, LOOK_AHEAD_M};
use self::homeward::Homeward;
use crate::autopilot::telemetry::Telemetry;
use crate::link::commands::{ACCEPTED, Command};
use crate::mission::State;
use crate::swarm::neighbours::MAX_HOVER_MPS;
use crate::swarm::obstacles::Obstacles;
use crate::swarm::sweep::Sweep;
use crate::swarm::view::{Reported, View};
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
/// Searches without a detour after which a vehicle gives up, or one fewer within [`GIVE_UP_AFTER_S`].
const MAX_DETOUR_SEARCHES: u8 = 4;
/// Time after which one search fewer is enough, seconds.
const GIVE_UP_AFTER_S: u64 = 60;
/// Time without progress after which a detour is blocked too.
const STUCK_AFTER: Duration = Duration::from_secs(20);
/// Progress after which a vehicle that was blocked is blocked again, not still, metres.
const BLOCKED_AGAIN_M: f32 = 2.0;
/// Time for which whatever kept the vehicle from going on still does; once the vehicle counts as
/// blocked it is [`BLOCKED_HINDERED_WITHIN`]: a neighbour that sways at the edge of the path must not make the block
/// begin again and again.
const HINDERED_WITHIN: Duration = Duration::from_millis(500);
/// Time without a hindrance after which a blocked vehicle is free.
const BLOCKED_HINDERED_WITHIN: Duration = Duration::from_secs(3);
/// Time under a pilot's control after which the pilot keeps the vehicle for good: others fly around it.
const PILOT_KEEPS_AFTER: Duration = Duration::from_secs(20);
/// Time after which an abort is over whose end the autopilot does not report.
const ABORT_OVER_AFTER: Duration = Duration::from_secs(5);
/// Time after which a vehicle on its pad that no other vehicle hears waits like one that waits for others.
const UNHEARD_ON_PAD_AFTER: Duration = Duration::from_secs(10);
/// Age from which a neighbour's position is vague.
const MAX_POSITION_AGE: Duration = Duration::from_secs(2);
/// Greatest stray from the path, metres: a path that much nearer to a keep-out zone is blocked.
const BLOCKED_WITHIN_M: f32 = 0.25;

/// Purpose of a requested detour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// To fly to the goal.
    Goal,
    /// To leave the column under a vehicle that lands.
    Aside,
    /// To land where no vehicle lies.
    Landing,
    /// To fly home over a field.
    Home,
    /// To fly on along the own path over a field, beyond what blocks the path.
    Beyond,
}

/// Knowledge of the path ahead, and of detours.
#[derive(Clone, Debug, Default)]
pub(crate) struct Detours {
    obstacles: Obstacles,
    /// The path is blocked, or the plan was left.
    blocked: bool,
    /// This vehicle was out of the plan once: the others do not count on it any more.
    left: bool,
    /// The path is one around.
    flying: bool,
    /// The detour, or the one requested, leads aside only, out of the column under a vehicle that lands.
    aside: bool,
    /// The vehicle lands at the end of that detour.
    lands: bool,
    /// The vehicle's way home over a field.
    pub(crate) home: Homeward,
    /// The vehicle's detour beside its path over a field, and back.
    pub(crate) beside: Beside,
    /// Progress on the plan when it was left for a way around, metres.
    left_at_m: f32,
    /// The way around asked for has come.
    ready: bool,
    /// Ways around not found since somebody moved.
    failed: u8,
    /// The last one was not found although all others lie or rest for good, or for a while from here, whichever moved.
    hopeless: bool,
    /// Ways around not found from here, whichever moved between; how far along the path that is, and since when.
    failed_here: u8,
    failed_at_m: f32,
    failed_since: Instant,
    /// Ways around on which it did not move, in a row.
    fruitless: u8,
    /// When no way aside was found.
    no_way_aside_at: Option<Instant>,
    /// Place and time of the vehicle before its position jumped.
    lost_at: Option<(Point, Instant)>,
    quiet_since: Option<Instant>,
    /// Since when it claims its turn.
    claimed_since: Option<Instant>,
    /// When a look was last due, and when the one that goes on began.
    looked_at: Instant,
    look_began: Option<Instant>,
    /// Progress of the scan along the path, and the result of the last one.
    sweep: Sweep,
    in_the_way: bool,
    /// Place along the path where the vehicle was blocked, metres, and since when: the vehicle has
    /// come no further, though its path was clear in between.
    blocked_here: Option<(f32, Instant)>,
}

/// Result of a check of the path.
struct Looked {
    /// When one that found nothing began.
    clear_at: Option<Instant>,
}

impl Detours {
    /// The way ahead is as the plan has it again.
    pub(crate) fn forget_plan(&mut self) {
        let obstacles = core::mem::take(&mut self.obstacles);
        *self = Self { left: self.left, obstacles, ..Self::default() };
        self.obstacles.forget_avoided();
    }

    /// Takes the path as blocked until the next scan has checked it.
    pub(crate) fn assume_blocked(&mut self) {
        (self.blocked, self.in_the_way) = (true, true);
    }

    /// Takes an obstacle of a command.
    pub(crate) fn exclude(&mut self, command: &Command, origin: &Geodetic, clearance_m: f32) -> u8 {
        let result = self.obstacles.take(command, origin, clearance_m);
        if command.param1 <= 0.0 && result == ACCEPTED {
            // A look that is under way counts them by index.
            self.sweep.restart();
            self.look_began = None;
        }
        result
    }

    /// Obstacles that were reported.
    pub(crate) fn obstacles(&self) -> usize {
        self.obstacles.count()
    }

    /// Whether the path is blocked, or the plan was left.
    pub(crate) fn is_blocked(&self) -> bool {
        self.blocked || self.home.seeks()
    }

    /// Time for which the vehicle has come no further because its path was blocked, now and again.
    pub(crate) fn blocked_for(&self, now: Instant) -> Duration {
        self.blocked_here.map_or(Duration::default(), |(_, since)| now - since)
    }

    /// Whether it was out once: the others do not count on it any more.
    pub(crate) fn has_left(&self) -> bool {
        self.left
    }

    /// Whether the path is one around.
    pub(crate) fn is_flying(&self) -> bool {
        self.flying
    }

    /// Whether that path does not lead to where it lands: aside only, or back to its own.
    pub(crate) fn is_aside(&self) -> bool {
        self.aside || self.beside.flies()
    }

    /// Place where the vehicle could come back to its path over a field, metres, beyond what blocks the path.
    pub(crate) fn returns_m<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> Option<f32> {
        beside::returns_m(view, self.obstacles.known())
    }

    /// Whether it may fly around what is on its path over a field now: where it has not left that.
    pub(crate) fn may_fly_beside<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> bool {
        let on_path = (!self.flying || self.beside.flies())
            && !self.left
            && !self.home.is_on()
            && view.guidance.along_m() >= 0.0;
        let over_field = view.config.division.is_some();
        let flies = view.mission.plan().is_some_and(|plan| plan.task.flies());
        (self.in_the_way || self.is_stopped(view, BLOCKED_HINDERED_WITHIN))
            && over_field
            && on_path
            && flies
            && !view.guidance.returning
            && self.beside.may_seek(view.now)
    }

    /// The vehicle's own plan has come, or will not: the vehicle is on its path again, or has to do without.
    pub(crate) fn come_back(&mut self, came: bool) {
        self.beside.answered(came);
        if came {
            let beside = self.beside;
            self.forget_plan();
            self.beside = beside;
        }
    }

    /// Whether it lands at the end of that.
    pub(crate) fn lands(&self) -> bool {
        self.lands
    }

    /// Whether the way around asked for has come.
    pub(crate) fn is_ready(&self) -> bool {
        self.ready
    }

    /// Progress on the plan when it was left for a way around, metres.
    pub(crate) fn left_at_m(&self) -> f32 {
        self.left_at_m
    }

    /// Whether it has left the plan for good, and rests or is a pilot's.
    pub(crate) fn is_out<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> bool {
        let lasted = view.mission.in_state(view.now);
        match view.mission.state() {
            State::Done => !view.guidance.at_goal(&view.scene) || self.left,
            State::Aborted => view.telemetry.on_ground == Some(true) || lasted >= ABORT_OVER_AFTER,
            State::PilotControl | State::PilotReturned => {
                view.mission.with_pilot(view.now) >= PILOT_KEEPS_AFTER
            }
            _ => false,
        }
    }

    /// Whether it stands until somebody else moves: it does not claim the turn to move itself.
    pub(crate) fn waits<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> bool {
        self.is_held(view) && self.claimed_since.is_none()
    }

    fn is_held<const V: usize, const W: usize, const G: usize>(&self, view: &View<'_, V, W, G>) -> bool {
        let now = view.now;
        let held = view.guidance.advice.waiting_for != 0 || view.guidance.filter.is_stopped();
        let rests = view.telemetry.velocity.norm() < MAX_HOVER_MPS;
        let stands = view.guidance.stands() && rests;
        match view.mission.state() {
            State::Scheduled | State::PadReplanning => {
                self.blocked
                    || !view.guidance.filter.column_clear()
                    || view.neighbours.silence(now, view.mission.started_at()) >= UNHEARD_ON_PAD_AFTER
                    || (held && view.guidance.advice.stop_within_m <= 0.05)
            }
            State::Follow => held && stands,
            State::Climb => {
                view.guidance.filter.is_stopped() && view.telemetry.velocity.norm() < MAX_HOVER_MPS
            }
            // Blocked on its way down it stays there.
            State::Blocked => view.guidance.pauses() && rests,
            // The vehicle goes on by itself only once its column is free.
            State::LandingHeld => view.telemetry.velocity.norm() < MAX_HOVER_MPS,
            _ => false,
        }
    }

    /// The place that the vehicle reports.
    pub(crate) fn reported_place(&self, telemetry: &Telemetry, now: Instant) -> Reported {
        let t = telemetry;
        let vague = self.lost_at.is_some() || t.position_age(now) > MAX_POSITION_AGE;
        let (position, at) = self.lost_at.unwrap_or((t.position, t.position_at.unwrap_or_default()));
        Reported { position, velocity: if vague { Point::zeros() } else { t.velocity }, at }
    }

    /// Remembers, on entering a state, where it was before its position jumped: where that jumped to may be wrong.
    pub(crate) fn mark_place<const V: usize, const W: usize, const G: usize>(
        &mut self,
        to: State,
        view: &View<'_, V, W, G>,
    ) {
        match to {
            State::PositionLost if self.lost_at.is_none() && view.telemetry.is_settling(view.now) => {
                let path = view.mission.plan().map(|plan| &plan.path);
                let on_path = path.and_then(|path| path.point_at(view.guidance.along_m()));
                self.lost_at = Some((on_path.unwrap_or(view.telemetry.position), view.now));
            }
            State::Follow | State::WaitPosition => self.lost_at = None,
            _ => {}
        }
    }

    /// Looks for what blocks the path, and whether the others stand.
    pub(crate) fn look_around<const V: usize, const W: usize, const G: usize>(
        &mut self,
        view: &View<'_, V, W, G>,
    ) -> Option<Instant> {
        let now = view.now;
        self.left |= view.config.roster.len() > 1 && self.is_out(view) && view.mission.plan().is_some();
        let on_ground = matches!(view.mission.state(), State::Scheduled | State::PadReplanning);
        let stopped = matches!(view.mission.state(), State::Blocked | State::Replanning);
        if !on_ground && !stopped && view.mission.state() != State::Follow {
            (self.blocked, self.in_the_way) = (false, false);
            (self.quiet_since, self.claimed_since, self.blocked_here) = (None, None, None);
            self.sweep.restart();
            self.look_began = None;
            return None;
        }
        let due = now - self.looked_at >= BLOCKED_CHECK_EVERY;
        if due {
            self.looked_at = now;
            self.look_began.get_or_insert(now);
        }
        let looked = self.go_on_looking(on_ground, view);
        if looked.is_some() || due {
            self.weigh(view);
        }
        looked.and_then(|looked| looked.clear_at)
    }

    /// Takes the result of a check of the path that has ended.
    fn go_on_looking<const V: usize, const W: usize, const G: usize>(
        &mut self,
        on_ground: bool,
        view: &View<'_, V, W, G>,
    ) -> Option<Looked> {
        let began = self.look_began?;
        let in_the_way = self.is_in_the_way(on_ground, view)?;
        self.look_began = None;
        self.in_the_way = in_the_way;
        Some(Looked { clear_at: (!in_the_way).then_some(began) })
    }

    /// Decides whether the vehicle is blocked, since when all have stood, and whether it claims its turn.
    fn weigh<const V: usize, const W: usize, const G: usize>(&mut self, view: &View<'_, V, W, G>) {
        let now = view.now;
        let stuck = self.flying
            && view.mission.state() != State::Scheduled
            && now - view.guidance.progress_at() > STUCK_AFTER;
        let aside = self.aside && view.guidance.is_at_end(&view.scene);
        let astray = self.left && (!self.flying || aside) && !self.lands;
        let dead_end = self.is_held(view) && self.quiet_since.is_some_and(|at| now - at > DEAD_END_AFTER);
        let free =
            if view.mission.state() == State::Blocked { BLOCKED_HINDERED_WITHIN } else { HINDERED_WITHIN };
        let stopped = self.is_stopped(view, free);
        self.blocked =
            !view.guidance.returning && (stuck || astray || dead_end || stopped || self.in_the_way);
        let along_m = view.guidance.along_m();
        if self.blocked && self.blocked_here.is_none_or(|(at_m, _)| along_m > at_m + BLOCKED_AGAIN_M) {
            self.blocked_here = Some((along_m, now));
        }
        if !view.neighbours.all_stand(now) {
            // Another vehicle moved: the block of the path may have gone.
            (self.quiet_since, self.failed, self.hopeless) = (None, 0, false);
        } else if self.quiet_since.is_none() {
            self.quiet_since = Some(now);
        }
        let claims = self.is_due(view) && !view.neighbours.claimed_before(view.config.system_id, now);
        self.claimed_since = self.claimed_since.or(Some(now)).filter(|_| claims);
    }

    /// Whether another vehicle has stopped it for long: one that lets it go first, or over a field one off the plan.
    fn is_stopped<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
        free: Duration,
    ) -> bool {
        let (now, filter) = (view.now, &view.guidance.filter);
        let for_good = view.config.division.is_some() && !view.neighbours.follows_plan(filter.last_blocker());
        filter.blocked_for(now, free) > STUCK_AFTER || (for_good && filter.hindered_for(now) > STUCK_AFTER)
    }

    /// Whether anything is; `None` while the look goes on.
    fn is_in_the_way<const V: usize, const W: usize, const G: usize>(
        &mut self,
        on_ground: bool,
        view: &View<'_, V, W, G>,
    ) -> Option<bool> {
        let Some(plan) = view.mission.plan() else { return Some(false) };
        let here = if on_ground { view.mission.pad() } else { view.telemetry.position };
        let along_m = view.guidance.along_m();
        let cost = detour::stretches_ahead(&plan.path, along_m) + ZONE_COST;
        let apart_m = view.config.safety_distance_m + BLOCKED_WITHIN_M;
        let (now, neighbours) = (view.now, view.neighbours);
        let new = self.obstacles.new_ones();
        self.sweep.go_on(
            new.len() + neighbours.len(),
            &mut (cost.max(MAX_STRETCHES_PER_STEP) as u16),
            cost as u16,
            |source, tell| match new.get(source) {
                Some(obstacle) => tell(*obstacle),
                None => neighbours.obstacle(source - new.len(), now, apart_m, tell),
            },
            // Over a field it photographs what comes before, and flies around what blocks the way when it comes there.
            |obstacle| {
                let until_m = match view.config.division {
                    Some(_) => along_m.max(0.0) + LOOK_AHEAD_M,
                    None => f32::INFINITY,
                };
                let (climb_m, descent_m) = (plan.climb_m, plan.descent_m);
                detour::is_blocked(&plan.path, along_m..until_m, climb_m, descent_m, &here, obstacle)
            },
        )
    }

    /// Whether it may claim its turn to fly around.
    fn is_due<const V: usize, const W: usize, const G: usize>(&self, view: &View<'_, V, W, G>) -> bool {
        let wait_s = ALL_STAND_S
            + TURN_S * view.neighbours.blocked_before(view.config.system_id)
            + DETOUR_RETRY_S * u64::from(self.failed);
        // Over a field nobody flies around.
        self.blocked
            && view.config.division.is_none()
            && view.neighbours.all_stand(view.now)
            && self.quiet_since.is_some_and(|at| view.now - at >= Duration::from_secs(wait_s))
    }

    /// Whether it may fly around now.
    pub(crate) fn is_our_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> bool {
        self.is_due(view)
            && self.claimed_since.is_some_and(|at| view.now - at >= TURN_CLAIM)
            && view.neighbours.all_wait(view.now)
    }
}

#[cfg(test)]
mod tests;
