//! Living with vehicles that left the plan: which count as out, what blocks the path, and flying around it.
//!
//! A vehicle that is out (landed elsewhere, with its pilot for good, or silent for so long that it counts as dead) opens every
//! gate that waits for it, and is an obstacle where it rests. A vehicle whose path that blocks, or which was out itself and
//! may fly again, stops and waits until all others are out or stand and wait themselves. Then the one with the lowest
//! system id asks its shell for a way around everybody and flies it to its goal. All the while it tells the progress at which it
//! left the plan: whoever waits for it goes on waiting, so it flies alone. On the ground it is out, and the next may go.
//!
//! Two must not begin at once, each before it hears of the other. So a turn is claimed first: the vehicle tells that its path is
//! blocked and no longer that it waits, for [`CLAIM`], longer than a word takes to be heard. It begins only if all others
//! wait then; who hears a lower system id claim waits again.
//!
//! Who is out is looked at along the whole path before its gates open, and from then on twice a second: [`STRETCHES`] of the path a
//! step, so a look among many takes several steps.
//!
//! ENU metres.

use heapless::Vec;
use planner_core::Point;
use planner_core::detour::{self, DetourRequest, KeepOff, Nature};
use planner_core::flight::VehiclePlan;
use planner_core::frames::{self, Geodetic};

use crate::companion::{Companion, STANDING_MPS};
use crate::config::PlanFailure;
use crate::events::Event;
use crate::guidance::retreat;
use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};
use crate::mission::State;
use crate::swarm::sweep::Sweep;
use crate::time::{Duration, Instant};

/// Time from one look along the path to the next.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Stretches of the path that are looked at in one step, each against one thing; a step looks at the whole path at least once.
const STRETCHES: usize = 160;
/// A thing to look at costs as much as so many stretches beside those.
const THING_COST: usize = 12;
/// All others have to stand for this long: longer than a gate that opened takes to be seen and obeyed.
const QUIET_S: u64 = 3;
/// A turn is claimed for this long before it is taken.
const CLAIM: Duration = Duration::from_secs(1);
/// Each blocked vehicle with a lower id is given this time to begin.
const TURN_S: u64 = 2;
/// After a way around was not found the next is sought so much later.
const RETRY_S: u64 = 10;
/// Standing and waiting while all others stand for this long is a dead end: whoever is waited for has found no way around.
const DEAD_END: Duration = Duration::from_secs(30);
/// After no place to land was found aside, the next is sought so much later.
const ASIDE_AGAIN_S: u64 = 70;
/// A vehicle that hears nobody seeks it once its landing has waited for so long.
const DEAF_ASIDE: Duration = Duration::from_secs(60);
/// So many ways around that are not found are enough, or one less in this time, seconds.
const DETOURS_TRIED: u8 = 4;
const GIVES_UP_S: u64 = 100;
/// What is sought this near to where it was sought before is sought from the same place, metres.
const HERE_M: f32 = 1.0;
/// A way around on which there is no progress for this long is blocked too.
const STUCK: Duration = Duration::from_secs(20);
/// A pilot who keeps a vehicle for this long keeps it for good: others fly around it.
const KEPT: Duration = Duration::from_secs(20);
/// An abort whose end the autopilot does not tell is over by then.
const SETTLED: Duration = Duration::from_secs(5);
/// On its pad a vehicle that nobody hears for so long waits like one that waits for others.
const UNHEARD: Duration = Duration::from_secs(10);
/// A position older than this is vague.
const FRESH: Duration = Duration::from_secs(2);
/// What a vehicle may stray from its path, metres: a path that comes nearer to what lies there by that much is blocked.
const STRAY_M: f32 = 0.25;
/// Beyond the safety distance, so that what strays a little does not block the way again, metres.
const MARGIN_M: f32 = 0.5;

/// Obstacles that were not on the map.
const OBSTACLES: usize = 16;
/// The greatest radius of one, metres: a wrong digit must not close a whole building.
const OBSTACLE_MAX_M: f32 = 20.0;
/// Two nearer than this are one that was sent twice, metres; a revocation this near means it.
const SAME_M: f32 = 0.1;

/// Obstacles that were not on the map, and for how many of them a way around was planned.
#[derive(Clone, Debug, Default)]
pub(crate) struct Obstacles {
    known: Vec<KeepOff, OBSTACLES>,
    pub(crate) avoided: usize,
    /// How many were known when a way around was last requested: those that came later it does not avoid.
    requested: usize,
}

impl Obstacles {
    pub(crate) fn count(&self) -> usize {
        self.known.len()
    }

    /// Forgets the obstacle at this place.
    fn revoke(&mut self, centre: &Point) {
        while let Some(at) = self.known.iter().position(|o| (o.from - centre).norm() < SAME_M) {
            self.known.remove(at);
            self.avoided -= usize::from(at < self.avoided);
            self.requested -= usize::from(at < self.requested);
        }
    }
}

/// What a way around is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// To fly to the goal.
    Goal,
    /// To be out from under a vehicle that lands.
    Aside,
    /// To land where nobody lies.
    Landing,
}

/// What is known of the way ahead.
#[derive(Clone, Debug, Default)]
pub(crate) struct Around {
    /// The path is blocked, or the plan was left.
    pub(crate) blocked: bool,
    /// It was out once: the others do not count on it any more.
    pub(crate) left: bool,
    /// The path is one around.
    pub(crate) flying: bool,
    /// That path, or the one asked for, leads aside only, out from under a vehicle that lands.
    pub(crate) aside: bool,
    /// And it lands at the end of that.
    pub(crate) lands: bool,
    /// Progress on the plan when it was left for a way around, metres.
    pub(crate) left_at_m: f32,
    /// The way around asked for has come.
    pub(crate) ready: bool,
    /// Ways around not found since somebody moved.
    pub(crate) failed: u8,
    /// The last one was not found although all others lie or rest for good, or for a while from here, whoever moved.
    pub(crate) hopeless: bool,
    /// Ways around not found from here, whoever moved between; how far along the path that is, and since when.
    pub(crate) failed_here: u8,
    pub(crate) failed_at_m: f32,
    pub(crate) failed_since: Instant,
    /// Ways around on which it did not move, in a row.
    pub(crate) fruitless: u8,
    /// When no way aside was found.
    pub(crate) no_way_aside_at: Option<Instant>,
    /// Where and when it was before its position jumped.
    pub(crate) lost_at: Option<(Point, Instant)>,
    pub(crate) quiet_since: Option<Instant>,
    /// Since when it claims its turn.
    pub(crate) claimed_since: Option<Instant>,
    /// When a look was last due, and when the one that goes on began.
    pub(crate) looked_at: Instant,
    pub(crate) look_began: Option<Instant>,
    /// How far that is, and what the last one found.
    pub(crate) sweep: Sweep,
    pub(crate) in_the_way: bool,
}

/// What it reports to the others of where it is.
pub(crate) struct Told {
    pub(crate) position: Point,
    pub(crate) velocity: Point,
    /// When that was known.
    pub(crate) at: Instant,
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Whether it has left the plan for good, and rests or is a pilot's.
    pub(crate) fn is_out(&self) -> bool {
        let lasted = self.mission.in_state(self.now);
        match self.mission.state() {
            State::Done => !self.guidance.at_goal(&self.scene()) || self.around.left,
            State::Aborted => self.telemetry.on_ground == Some(true) || lasted >= SETTLED,
            State::PilotControl | State::PilotReturned => self.mission.with_pilot(self.now) >= KEPT,
            _ => false,
        }
    }

    /// Whether it stands until somebody else moves: it does not claim the turn to move itself.
    pub(crate) fn waits(&self) -> bool {
        self.is_held() && self.around.claimed_since.is_none()
    }

    fn is_held(&self) -> bool {
        let now = self.now;
        let held = self.guidance.advice.waiting_for != 0 || self.guidance.filter.is_stopped();
        let stands = self.guidance.stands() && self.telemetry.velocity.norm() < STANDING_MPS;
        match self.mission.state() {
            State::Scheduled | State::PadReplanning => {
                self.around.blocked
                    || !self.guidance.filter.column_clear()
                    || self.neighbours.silence(now, self.mission.started_at()) >= UNHEARD
                    || (held && self.guidance.advice.stop_within_m <= 0.05)
            }
            State::Follow => held && stands,
            State::Climb => {
                self.guidance.filter.is_stopped() && self.telemetry.velocity.norm() < STANDING_MPS
            }
            State::Blocked => stands,
            // It goes on by itself only once its column is free.
            State::LandingHeld => self.telemetry.velocity.norm() < STANDING_MPS,
            _ => false,
        }
    }

    pub(crate) fn told_place(&self) -> Told {
        let t = &self.telemetry;
        let vague = self.around.lost_at.is_some() || t.position_age(self.now) > FRESH;
        let (position, at) = self.around.lost_at.unwrap_or((t.position, t.position_at.unwrap_or_default()));
        Told { position, velocity: if vague { Point::zeros() } else { t.velocity }, at }
    }

    /// Remembers, on entering a state, where it was before its position jumped: where that jumped to may be wrong.
    pub(crate) fn mark_place(&mut self, to: State) {
        match to {
            State::PositionLost if self.around.lost_at.is_none() && self.telemetry.is_settling(self.now) => {
                let path = self.mission.plan().map(|plan| &plan.path);
                let on_path = path.and_then(|path| path.point_at(self.guidance.along_m()));
                self.around.lost_at = Some((on_path.unwrap_or(self.telemetry.position), self.now));
            }
            State::Follow | State::WaitPosition => self.around.lost_at = None,
            _ => {}
        }
    }

    /// Looks for what blocks the path, and whether the others stand.
    pub(crate) fn look_around(&mut self) {
        let now = self.now;
        self.around.left |= self.config.roster.len() > 1 && self.is_out() && self.mission.plan().is_some();
        let on_ground = matches!(self.mission.state(), State::Scheduled | State::PadReplanning);
        let stopped = matches!(self.mission.state(), State::Blocked | State::Replanning);
        if !on_ground && !stopped && self.mission.state() != State::Follow {
            (self.around.blocked, self.around.in_the_way) = (false, false);
            (self.around.quiet_since, self.around.claimed_since) = (None, None);
            self.around.sweep.restart();
            self.around.look_began = None;
            return;
        }
        let due = now - self.around.looked_at >= LOOK_EVERY;
        if due {
            self.around.looked_at = now;
            self.around.look_began.get_or_insert(now);
        }
        if self.go_on_looking(on_ground) || due {
            self.weigh();
        }
    }

    /// Returns whether a look has ended.
    fn go_on_looking(&mut self, on_ground: bool) -> bool {
        let Some(began) = self.around.look_began else { return false };
        let Some(in_the_way) = self.is_in_the_way(on_ground) else { return false };
        self.around.look_began = None;
        self.around.in_the_way = in_the_way;
        if !in_the_way {
            self.neighbours.found_clear(began);
        }
        true
    }

    /// What follows from what is known: whether it is blocked, for how long all have stood, and whether it claims its turn.
    fn weigh(&mut self) {
        let now = self.now;
        let stuck = self.around.flying
            && self.mission.state() != State::Scheduled
            && now - self.guidance.progress_at() > STUCK;
        let aside = self.around.aside && self.guidance.is_at_end(&self.scene());
        let astray = self.around.left && (!self.around.flying || aside) && !self.around.lands;
        let dead_end = self.is_held() && self.around.quiet_since.is_some_and(|at| now - at > DEAD_END);
        let stopped = self.guidance.filter.blocked_for(now) > STUCK;
        self.around.blocked =
            !self.guidance.returning && (stuck || astray || dead_end || stopped || self.around.in_the_way);
        if !self.neighbours.all_stand(now) {
            // Somebody moved: what blocked the path may have gone.
            (self.around.quiet_since, self.around.failed, self.around.hopeless) = (None, 0, false);
        } else if self.around.quiet_since.is_none() {
            self.around.quiet_since = Some(now);
        }
        let claims = self.is_due() && !self.neighbours.claimed_before(self.config.system_id, now);
        self.around.claimed_since = self.around.claimed_since.or(Some(now)).filter(|_| claims);
    }

    /// Whether anything is; `None` while the look goes on.
    fn is_in_the_way(&mut self, on_ground: bool) -> Option<bool> {
        let Some(plan) = self.mission.plan() else { return Some(false) };
        let here = if on_ground { self.mission.pad() } else { self.telemetry.position };
        let along_m = self.guidance.along_m();
        let cost = detour::stretches_ahead(&plan.path, along_m) + THING_COST;
        let apart_m = self.config.safety_distance_m + STRAY_M;
        let (now, neighbours) = (self.now, &self.neighbours);
        let new = &self.obstacles.known[self.obstacles.avoided..];
        self.around.sweep.go_on(
            new.len() + neighbours.len(),
            &mut (cost.max(STRETCHES) as u16),
            cost as u16,
            |source, tell| match new.get(source) {
                Some(obstacle) => tell(*obstacle),
                None => neighbours.obstacle(source - new.len(), now, apart_m, tell),
            },
            |obstacle| detour::is_blocked(&plan.path, along_m, plan.climb_m, plan.descent_m, &here, obstacle),
        )
    }

    /// Takes an obstacle that is not on the map: its centre, and its radius; a radius that is not above zero revokes the one at
    /// that place. It stays until revoked, or until the companion starts again: a wall does not go away by itself.
    pub(crate) fn exclude(&mut self, command: &Command) -> u8 {
        let Some((lat, lon, alt_m)) = command.place else { return DENIED };
        let (lat_deg, lon_deg) = (f64::from(lat) * 1e-7, f64::from(lon) * 1e-7);
        let place = Geodetic { lat_deg, lon_deg, alt_m: f64::from(alt_m) };
        if !(place.is_valid() && command.param1 <= OBSTACLE_MAX_M) {
            return DENIED;
        }
        let centre = frames::geodetic_to_enu(&self.config.origin, &place);
        if command.param1 <= 0.0 {
            self.obstacles.revoke(&centre);
            // A look that is under way counts them by index.
            self.around.sweep.restart();
            self.around.look_began = None;
            return ACCEPTED;
        }
        let radius_m = command.param1 + self.config.required_clearance_m;
        let told = |o: &KeepOff| (o.from - centre).norm() < SAME_M && o.radius_m >= radius_m;
        if self.obstacles.known.iter().any(told) {
            return ACCEPTED;
        }
        match self.obstacles.known.push(KeepOff { from: centre, to: centre, radius_m, nature: Nature::Solid })
        {
            Ok(()) => ACCEPTED,
            Err(_) => TEMPORARILY_REJECTED,
        }
    }

    /// Whether it may claim its turn to fly around.
    fn is_due(&self) -> bool {
        let wait_s = QUIET_S
            + TURN_S * self.neighbours.blocked_before(self.config.system_id)
            + RETRY_S * u64::from(self.around.failed);
        self.around.blocked
            && self.neighbours.all_stand(self.now)
            && self.around.quiet_since.is_some_and(|at| self.now - at >= Duration::from_secs(wait_s))
    }

    /// Whether it may fly around now.
    pub(crate) fn is_our_turn(&self) -> bool {
        self.is_due()
            && self.around.claimed_since.is_some_and(|at| self.now - at >= CLAIM)
            && self.neighbours.all_wait(self.now)
    }

    /// Asks the shell for a way around, or just aside.
    pub(crate) fn request_detour(&mut self, aim: Aim) {
        self.around.aside = aim != Aim::Goal;
        self.around.lands = aim == Aim::Landing;
        self.obstacles.requested = self.obstacles.known.len();
        self.guidance.trapped_since = None;
        self.mission.forget_failure();
        self.around.ready = false;
        // Full only if the shell does not drain; then the way around is late.
        let _ = self.events.push_back(Event::PlanRequested);
    }

    /// What the shell is asked for by [`Event::PlanRequested`] where it is a way around; `None` if it is the mission's plan.
    /// `tell` is given all that is to be kept off.
    pub fn detour(&self, mut tell: impl FnMut(KeepOff)) -> Option<DetourRequest> {
        if !matches!(self.mission.state(), State::Replanning | State::PadReplanning) {
            return None;
        }
        let plan = self.mission.plan()?;
        let points = plan.path.waypoints();
        let along_m = self.guidance.along_m();
        let next = points.iter().position(|w| w.along_m > along_m).unwrap_or(points.len().saturating_sub(1));
        let ahead = points.get(next)?;
        let behind = points.get(next.saturating_sub(1))?;
        let apart_m = self.config.safety_distance_m;
        self.obstacles.known.iter().for_each(|obstacle| tell(*obstacle));
        self.neighbours.places(self.now, apart_m + MARGIN_M, &mut tell);
        if self.around.aside {
            self.neighbours.landing_columns(self.now, apart_m + retreat::BESIDE_M, &mut tell);
        }
        if self.around.lands {
            self.neighbours.lands_on(apart_m + MARGIN_M, tell);
        }
        Some(DetourRequest {
            aside: self.around.aside,
            here: plan.path.point_at(along_m)?,
            leg: [ahead.position, behind.position],
            leg_clearance_m: ahead.clearance_m,
            goal: plan.goal?,
            descent_m: plan.descent_m,
            required_clearance_m: self.config.required_clearance_m,
        })
    }

    /// Takes the way around.
    pub(crate) fn take_detour(&mut self, detour: &VehiclePlan<W, G>) {
        let along_m = self.guidance.along_m();
        let here = self.mission.plan().and_then(|plan| plan.path.point_at(along_m));
        if !here.is_some_and(|here| self.mission.begins_at(detour, &here)) {
            self.miss_detour(PlanFailure::Invalid);
            return;
        }
        if !self.around.flying {
            self.around.left_at_m = self.guidance.progress_m(self.mission.state(), &self.scene());
        }
        self.mission.leave_plan(&detour.path);
        let stuck = self.around.flying && self.now - self.guidance.progress_at() > STUCK;
        let fruitless = if stuck { self.around.fruitless.saturating_add(1) } else { 0 };
        let Around { aside, lands, left_at_m, .. } = self.around;
        let flying = Around { left: true, flying: true, ready: true, ..Around::default() };
        self.around = Around { aside, lands, left_at_m, fruitless, ..flying };
        self.neighbours.avoid(self.now);
        self.obstacles.avoided = self.obstacles.requested;
    }

    pub(crate) fn miss_detour(&mut self, failure: PlanFailure) {
        self.mission.fail(failure);
        // Where no way aside is found there may yet be one around.
        if self.around.aside {
            self.around.no_way_aside_at = Some(self.now);
        } else {
            let along_m = self.guidance.along_m();
            if (along_m - self.around.failed_at_m).abs() > HERE_M {
                (self.around.failed_here, self.around.failed_at_m) = (0, along_m);
            }
            if self.around.failed_here == 0 {
                self.around.failed_since = self.now;
            }
            self.around.failed = self.around.failed.saturating_add(1);
            self.around.failed_here = self.around.failed_here.saturating_add(1);
            let long = self.now - self.around.failed_since >= Duration::from_secs(GIVES_UP_S);
            let often = long && self.around.failed_here >= DETOURS_TRIED - 1;
            let for_good = failure != PlanFailure::Late && self.neighbours.all_down(self.now);
            self.around.hopeless = often || for_good;
        }
    }

    /// Whether it may seek a place aside to land at: from its path, with somebody heard, and not soon after there was none.
    pub(crate) fn can_land_aside(&self) -> bool {
        let retries = |at: Instant| self.now - at >= Duration::from_secs(ASIDE_AGAIN_S);
        self.mission.plan().is_some_and(|plan| plan.goal.is_some())
            && (!self.neighbours.is_deaf(self.now)
                || self.neighbours.all_rest()
                || self.guidance.filter.column_blocked_for(self.now) >= DEAF_ASIDE)
            && self.around.no_way_aside_at.is_none_or(retries)
    }

    /// Whether enough ways around were not found, or led nowhere.
    pub(crate) fn gives_up(&self) -> bool {
        self.around.hopeless || self.around.failed.saturating_add(self.around.fruitless) >= DETOURS_TRIED
    }

    /// How long it waits under a vehicle that lands, unable to go elsewhere; zero for a while after no way aside was found.
    pub(crate) fn underneath(&self) -> Duration {
        let retries = |at: Instant| self.now - at >= Duration::from_secs(RETRY_S);
        let trapped = self.guidance.trapped_since.filter(|_| self.around.no_way_aside_at.is_none_or(retries));
        trapped.map_or(Duration::default(), |at| self.now - at)
    }
}

#[cfg(test)]
mod tests;
