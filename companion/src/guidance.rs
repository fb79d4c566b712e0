//! Where to go now: the raw point of each state, made from the path, the neighbours and the autopilot's position. The door
//! makes the setpoint of it.
//!
//! A flight has phases: the climb straight up from where the vehicle stands, the join to the path's start, the path, the
//! descent. The phase is guidance's own state. A pause, a lost position or a pilot interrupts it; afterwards it goes on
//! where it was. A stop slows the door's clock, so the raw point stays where it is. Once the setpoint stands, the raw point
//! is taken back to it, and going on begins with a straight way back to where the phase was left.

mod brakes;
mod door;
mod fence;
pub(crate) mod filter;
mod follower;
mod hold;
mod waypoints;

use planner_core::Point;
use planner_core::deconflict::{self, Advice, DeconflictConfig, Method, Own};
use planner_core::path::{self, Path, Reference, TrackConfig, Tracker};
use planner_core::schedule::VehiclePlan;

use self::door::{Door, Pace, TICK_S};
use self::filter::Filter;
use self::hold::Hold;
use self::waypoints::Waypoints;
use crate::autopilot::Kind;
use crate::config::Config;
use crate::limits::{AutopilotLimits, Limits, Settings};
use crate::mission::State;
use crate::neighbours::Neighbours;
use crate::retreat::{self, Search};
use crate::telemetry::Telemetry;
use crate::time::Instant;

pub use self::door::{SMOOTH_MOST_S, Stats};

/// This near the end of the climb or of the path counts as there, metres.
const ARRIVED_M: f32 = 0.35;
/// So near its reference a vehicle reports no less than this short of it, metres: 0.05 m less than what gates allow
/// (`PROGRESS_ERROR_M`), since it stops short of a gate by a little.
const REPORTED_SHORT_M: f32 = planner_core::schedule::PROGRESS_ERROR_M - 0.05;
/// Slower than this counts as standing at the end of the path, m/s.
const STANDING_MPS: f32 = 0.5;
/// A setpoint slower than this stands, m/s.
const STANDING_SETPOINT_MPS: f32 = 0.05;
/// This near its top the climb is done, metres.
const CLIMBED_M: f32 = 0.12;
/// This near the lower end of the guided descent it is done, metres.
const DESCENDED_M: f32 = 0.2;
/// In a climb, a descent or a join the setpoint is at most this far ahead of the vehicle, metres.
const LEG_LEAD_M: f32 = 1.5;
/// Speed of the join to the path, m/s.
pub(crate) const JOIN_MPS: f32 = 1.0;
/// Before the take-off the setpoint follows the estimate of a vehicle that stands no faster than this, m/s.
const DRIFT_MPS: f32 = 0.2;
/// Stretch of the path searched for the nearest point after the pilot, metres to either side.
pub const REJOIN_WINDOW_M: f32 = 5.0;
/// The same after the position was lost, metres: the vehicle stopped within its braking distance of the reference, so a
/// position further along is not to be believed.
pub const LOST_WINDOW_M: f32 = 2.5;
/// The same once the setpoint stands, metres: the raw point may be as far ahead as a second is flown.
const SETTLE_WINDOW_M: f32 = 3.0;
/// A nearest point this near the end of the window lies beyond it, metres.
const WINDOW_EDGE_M: f32 = 0.01;
/// Less than this is no progress, metres.
const PROGRESS_M: f32 = 0.25;
/// A setpoint that stands this near the end of the path has flown it, metres.
const AT_END_M: f32 = 0.02;
/// While another flies the vehicle, the setpoint follows its estimate no faster than any vehicle flown so flies, m/s.
const FOLLOWS_MPS: f32 = 15.0;
/// Before the geofence the raw point stops this short of it: the setpoint may stray so far from the path, metres.
const FENCE_MARGIN_M: f32 = 0.05;
/// Shorter than this a leg need not be flown, metres.
const LEG_LEAST_M: f32 = 1e-3;

/// Acceleration for each metre off the reference, 1/s²: with what PX4's cascade asks for by itself (`MPC_XY_P` 0.95 ·
/// `MPC_XY_VEL_P_ACC` 1.8) it makes the loop 2.8 times as stiff, and a gust carries the vehicle less than half as far.
const HOLD_PER_S2: f32 = 3.0;
/// Acceleration for each m/s beside the reference's velocity, 1/s: keeps the stiffer loop damped (ratio 0.76).
const DAMP_PER_S: f32 = 1.5;
/// Bound on both together, m/s²: a position that jumps must not throw the vehicle about.
const HOLD_MOST_MPS2: f32 = 1.5;

/// Before the neighbours were asked: wait.
const NOT_ASKED: Advice = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for: 0 };

/// What the autopilot is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// Nothing: the state streams no setpoints.
    None,
    /// Be there, with this velocity and acceleration: ENU metres, m/s, m/s².
    Move(Point, Point, Point),
    /// Brake with this velocity, wherever that is: no position is known to refer to.
    Stop(Point),
}

/// Part of the flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Before the climb.
    Hold,
    /// Straight up to the height of the path's start.
    Climb,
    /// Straight to where the path goes on.
    Join,
    /// Along the path.
    Path,
    /// Straight down from its end.
    Descent,
}

/// The raw point's course, and the door that makes setpoints of it.
#[derive(Clone, Debug)]
pub struct Guidance {
    track: TrackConfig,
    /// The same for climb, join and descent.
    leg_track: TrackConfig,
    deconflict: DeconflictConfig,
    /// Share of the speed that the estimate allows: 0 stops.
    pub pace: f32,
    /// The door for setpoints.
    pub door: Door,
    phase: Phase,
    tracker: Tracker,
    /// The straight way of a climb, a join or a descent; none while it is to be made from where the setpoint stands.
    leg: Option<Path<2>>,
    leg_tracker: Tracker,
    /// Which waypoint it flies to, by Algorithm 2.
    waypoints: Waypoints,
    /// Whether the raw point is where the setpoint stands.
    settled: bool,
    /// The position was unknown: no place was sent.
    lost: bool,
    /// The autopilot flew by itself or by its pilot: setpoints followed the vehicle.
    taken: bool,
    /// Time since a place was sent, seconds.
    unsent_s: f32,
    /// Last advice of the neighbours.
    pub advice: Advice,
    on_path: bool,
    lead_m: f32,
    /// Where along the path the setpoint is, metres.
    pub(crate) setpoint_m: f32,
    /// Where along the path it will stop for now, whatever the safety filter does, metres.
    pub(crate) stops_at_m: f32,
    /// The safety filter.
    pub(crate) filter: Filter,
    /// Whether it holds its place for others to pass.
    pub(crate) hold: Hold,
    /// Whether that has changed, and nobody was told yet.
    pub(crate) turned: bool,
    /// Whether a descent goes back up its column.
    up: bool,
    /// Its path leads out of the geofence from here.
    fenced: bool,
    progress_m: f32,
    progress_at: Instant,
    reported_m: f32,
    /// Whether it flies back the way it came.
    pub returning: bool,
    /// Where others at least heard it to be, metres along the path; ∞ where nobody has.
    linked_m: f32,
    shelter: Search,
    /// Whether it keeps out from under a vehicle that comes down.
    pub retreating: bool,
    /// How far ahead it waits, for the neighbours' sake, metres.
    waits_m: f32,
    /// Where it goes back to.
    back_to_m: Option<f32>,
    /// No place along its path is better.
    nowhere: bool,
    /// Since when it waits under a vehicle that comes down, and its path leads nowhere better.
    pub trapped_since: Option<Instant>,
    /// Whether its path leads aside only: it does not land at its end.
    pub aside: bool,
    /// Height over the ground at which the autopilot lands by itself, metres.
    low_m: f32,
    /// Acceleration sent last, with what holds the vehicle on the reference.
    sent_acceleration: Point,
}

/// What guidance reads beside its own state.
pub struct Scene<'a, const W: usize, const G: usize> {
    /// The plan, if there is one with a path.
    pub plan: Option<&'a VehiclePlan<W, G>>,
    /// The autopilot.
    pub telemetry: &'a Telemetry,
    /// Rank in the roster.
    pub rank: u16,
    /// MAVLink system id.
    pub id: u8,
    /// Whether the path is one of its own around something.
    pub detours: bool,
}

impl Guidance {
    pub fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let door = Door::new(Limits::new(config, autopilot), config.geofence);
        let Settings { track, leg_track, deconflict } = Settings::new(config, autopilot);
        Self {
            track,
            leg_track,
            deconflict,
            pace: 1.0,
            door,
            phase: Phase::Hold,
            tracker: Tracker::default(),
            leg: None,
            leg_tracker: Tracker::default(),
            waypoints: Waypoints::default(),
            settled: true,
            lost: false,
            taken: false,
            unsent_s: 0.0,
            advice: NOT_ASKED,
            on_path: false,
            lead_m: LEG_LEAD_M,
            setpoint_m: 0.0,
            stops_at_m: f32::NEG_INFINITY,
            filter: Filter::default(),
            hold: Hold::default(),
            turned: false,
            up: false,
            fenced: false,
            progress_m: 0.0,
            progress_at: Instant::ZERO,
            reported_m: f32::NEG_INFINITY,
            returning: false,
            linked_m: f32::INFINITY,
            shelter: Search::default(),
            retreating: false,
            waits_m: f32::INFINITY,
            back_to_m: None,
            nowhere: false,
            trapped_since: None,
            aside: false,
            low_m: config.required_clearance_m - config.radius_m,
            sent_acceleration: Point::zeros(),
        }
    }

    /// Takes other limits.
    pub fn tune<const V: usize>(&mut self, config: &Config<V>, autopilot: &AutopilotLimits) {
        let Self { track, leg_track, deconflict, .. } = Self::new(config, autopilot);
        (self.track, self.leg_track, self.deconflict) = (track, leg_track, deconflict);
        self.door.tune(Limits::new(config, autopilot), config.geofence);
    }

    /// Forgets a former flight.
    pub fn reset(&mut self) {
        self.tracker = Tracker::default();
        self.phase = Phase::Hold;
        self.leg = None;
        self.waypoints = Waypoints::default();
        self.on_path = false;
        self.returning = false;
        self.aside = false;
        self.reported_m = f32::NEG_INFINITY;
        self.advice = NOT_ASKED;
        self.filter.reset();
    }

    /// Holds from now on: where the setpoint comes to a stop, or at `point` where no place was sent.
    pub fn hold_at(&mut self, point: Point) {
        // Where places are sent again it brakes from the last one.
        let lost = core::mem::take(&mut self.lost) && self.unsent_s > 0.0;
        if lost || !self.door.is_live() {
            self.door.begin_at(point, FOLLOWS_MPS * self.unsent_s);
            self.settle();
        }
    }

    /// Holds where the setpoint followed the pilot's vehicle to, until that is resumed; where the flight was interrupted is kept.
    pub fn hold_after_pilot(&mut self, point: Point) {
        self.hold_at(point);
        self.settle();
    }

    /// Begins the climb, straight up from where the setpoint is, or from `position` where nothing was sent.
    pub fn begin_climb(&mut self, position: &Point) {
        self.reset();
        self.phase = Phase::Climb;
        if !self.door.is_live() {
            self.door.begin_at(*position, FOLLOWS_MPS * self.unsent_s);
        }
    }

    /// Goes on where the flight was interrupted.
    pub fn run(&mut self, now: Instant) {
        self.on_path = true;
        self.shelter.reset();
        self.linked_m = f32::INFINITY;
        self.progress_m = self.tracker.along_m;
        self.progress_at = now;
    }

    /// Where on the path the reference is; −∞ before it runs.
    pub fn along_m(&self) -> f32 {
        if self.on_path { self.tracker.along_m } else { f32::NEG_INFINITY }
    }

    /// Whether the setpoint stands, and is not on its way down.
    pub fn stands(&self) -> bool {
        let limit = STANDING_SETPOINT_MPS * STANDING_SETPOINT_MPS;
        self.door.velocity().norm_squared() < limit && self.phase != Phase::Descent
    }

    /// Whether it stands where its path leaves the geofence.
    pub fn stands_at_fence(&self) -> bool {
        self.fenced && self.stands()
    }

    /// Begins another path, from where the setpoint stands.
    pub fn begin_path(&mut self, now: Instant) {
        self.tracker = Tracker::default();
        self.phase = Phase::Path;
        self.leg = None;
        self.waypoints = Waypoints::default();
        self.aside = false;
        self.reported_m = f32::NEG_INFINITY;
        // Whatever kept it from going on did so on the other path.
        self.filter.reset();
        self.run(now);
    }

    /// Goes on after an interruption, from where the setpoint is, or the vehicle where no place was sent: up its climb, down
    /// its descent, or by the nearest point of the path.
    pub fn go_on<const W: usize, const G: usize>(
        &mut self,
        plan: &VehiclePlan<W, G>,
        climbs: bool,
        position: &Point,
        now: Instant,
    ) {
        self.hold_at(*position);
        if climbs {
            self.phase = Phase::Climb;
            return;
        }
        let (path, place) = (&plan.path, self.door.position());
        let below = path
            .point_at(path.length_m())
            .is_some_and(|end| end.z > place.z && (end - place).xy().norm_squared() < ARRIVED_M * ARRIVED_M);
        if self.settled && self.phase != Phase::Climb && !(self.phase == Phase::Descent && below) {
            self.phase = Phase::Path;
            self.tracker.along_m = nearest_m(path, &place, self.tracker.along_m, REJOIN_WINDOW_M);
        }
        self.run(now);
    }

    /// Replaces the path by the way back to its first point. The clearance of each leg goes with it. The raw point may still
    /// move on: the new path begins where it can have braked, and it begins on it backwards.
    pub fn turn_back<const W: usize>(&mut self, path: &mut Path<W>, now: Instant) {
        let speed = self.tracker.speed_mps.max(0.0);
        let accel = self.track.accel_mps2.min(self.track.accel_z_mps2);
        let braking_m = speed * speed / (2.0 * accel) + speed * TICK_S;
        let from_m = (self.tracker.along_m + braking_m).min(path.length_m());
        let mut back = Path::new();
        let ahead = path.waypoints().iter().find(|w| w.along_m >= from_m);
        let mut clearance_m = ahead.map_or(0.0, |w| w.clearance_m);
        if let Some(turn) = path.point_at(from_m) {
            // No more points than the path has: those behind, and this one for at least one ahead.
            let _ = back.push(turn, clearance_m);
        }
        for waypoint in path.waypoints().iter().rev().filter(|w| w.along_m < from_m) {
            let _ = back.push(waypoint.position, clearance_m);
            clearance_m = waypoint.clearance_m;
        }
        let tracker = Tracker { along_m: from_m - self.tracker.along_m, speed_mps: -self.tracker.speed_mps };
        let (phase, leg) = (self.phase, self.leg.take());
        *path = back;
        self.begin_path(now);
        self.tracker = tracker;
        self.returning = true;
        match phase {
            Phase::Climb | Phase::Join => (self.phase, self.leg) = (phase, leg),
            Phase::Descent => {
                // Back up: what is still sunk while it brakes is flown backwards.
                if let (Some(leg), false) = (leg, self.settled) {
                    let mut up = Path::new();
                    let ends = (leg.waypoints().last(), leg.waypoints().first());
                    for end in [ends.0, ends.1].into_iter().flatten() {
                        let _ = up.push(end.position, end.clearance_m);
                    }
                    self.leg_tracker.along_m = leg.length_m() - self.leg_tracker.along_m;
                    self.leg_tracker.speed_mps = -self.leg_tracker.speed_mps;
                    (self.phase, self.leg) = (Phase::Join, Some(up));
                }
            }
            Phase::Hold | Phase::Path => {}
        }
    }

    /// Arc length reported to neighbours and gates: negative before and in the climb, beyond the path's length in the
    /// descent. It never falls on one path.
    pub fn progress_m<const W: usize, const G: usize>(&self, state: State, scene: &Scene<'_, W, G>) -> f32 {
        self.flown_m(state, scene).max(self.reported_m)
    }

    fn flown_m<const W: usize, const G: usize>(&self, state: State, scene: &Scene<'_, W, G>) -> f32 {
        let Some(plan) = scene.plan else { return 0.0 };
        let (path, z) = (&plan.path, scene.telemetry.position.z);
        let length_m = path.length_m();
        let end_z = path.point_at(length_m).map_or(0.0, |p| p.z);
        let start_z = path.point_at(0.0).map_or(0.0, |p| p.z);
        if matches!(state, State::Disarm | State::Done) && self.reached_end(path) {
            // A metre beyond the ground, so that every gate on this flight opens.
            return length_m + plan.descent_m + 1.0;
        }
        match self.phase {
            Phase::Climb => -(start_z - z).clamp(0.0, plan.climb_m),
            Phase::Path | Phase::Descent
                if self.reached_end(path) && (state == State::Land || self.phase == Phase::Descent) =>
            {
                length_m + (end_z - z).clamp(0.0, plan.descent_m)
            }
            _ if self.on_path => {
                let behind = self.track.lead_max_m * 2.0;
                let seen =
                    path.project(&scene.telemetry.position, self.tracker.along_m - behind * 0.5, behind);
                // Off its reference by less than counts as arrived, it has come as far as gates ask of one that waits.
                let at = path.point_at(self.tracker.along_m);
                let arrived = at.is_some_and(|at| (at - scene.telemetry.position).norm() < ARRIVED_M);
                let least = if arrived { self.tracker.along_m - REPORTED_SHORT_M } else { f32::NEG_INFINITY };
                seen.max(least).min(self.tracker.along_m)
            }
            _ => -plan.climb_m,
        }
    }

    /// Whether the shared plan's path was flown to its end.
    pub fn at_goal<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        !self.returning && !self.aside && scene.plan.is_some_and(|plan| self.reached_end(&plan.path))
    }

    /// Whether the reference has come to the end of the path.
    pub fn is_at_end<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        scene.plan.is_some_and(|plan| self.reached_end(&plan.path))
    }

    fn reached_end<const W: usize>(&self, path: &Path<W>) -> bool {
        self.on_path && self.tracker.along_m >= path.length_m()
    }

    /// One step of `dt_s`: new advice, new setpoint. Returns whether the setpoint is the one asked for; if not, the door held
    /// the last one.
    pub fn step<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        dt_s: f32,
    ) -> bool {
        let position = scene.telemetry.position;
        self.unsent_s += dt_s;
        let advised_at_m = self.tracker.along_m;
        let asks = matches!(state, State::Scheduled | State::Follow | State::Blocked | State::Replanning);
        if let Some(plan) = scene.plan.filter(|_| asks) {
            let along_m = if self.on_path { self.tracker.along_m } else { -plan.climb_m };
            let own = Own { rank: scene.rank, position, along_m, path: &plan.path, detours: scene.detours };
            self.advice = deconflict::advise(&self.deconflict, &own, &plan.gates, neighbours.at(now));
        }
        if let Some(plan) = scene.plan {
            let place = self.door.position();
            let along_m = self.tracker.along_m;
            self.setpoint_m = plan.path.project(&place, along_m, SETTLE_WINDOW_M).min(along_m);
            let along_m = if self.on_path { along_m } else { -plan.climb_m };
            self.stops_at_m = match state {
                // What stopped it is looked at on.
                State::Follow | State::Blocked | State::Replanning => {
                    along_m + self.advice.stop_within_m.max(0.0)
                }
                _ => self.setpoint_m + self.door.braking_m(false),
            };
        }
        self.filter(state, scene, neighbours, now);
        let urgent = self.filter.stops(now);
        let known = scene.telemetry.position_at.is_some();
        if !setpoints_flow(state) {
            self.door.close();
            return true;
        }
        let kind = scene.telemetry.kind.unwrap_or_default();
        let taken = matches!(state, State::PilotControl | State::Land | State::LandingHeld | State::Disarm)
            && scene.telemetry.custom_mode != kind.setpoint_mode();
        self.lost |= !known || state == State::PositionLost;
        let flies = scene.telemetry.on_ground == Some(false);
        let taken_before = core::mem::replace(&mut self.taken, taken);
        if known && (taken || taken_before || !self.door.is_live()) {
            // The autopilot does not follow, or nothing was sent: begin where the vehicle is, and as it moves.
            if taken || !self.door.is_live() {
                self.door.go_with(position, FOLLOWS_MPS * self.unsent_s, self.unsent_s);
            }
            if flies && !taken {
                self.door.move_on(&scene.telemetry.velocity);
            }
            self.settle();
            self.lost = false;
        }
        if self.door.is_live() && known && state != State::PositionLost {
            self.unsent_s = 0.0;
        }
        if !self.door.is_live() || taken {
            self.sent_acceleration = Point::zeros();
            return true;
        }
        let up = state == State::Follow && self.phase == Phase::Descent && self.filter.backs_up(now);
        let turns = self.phase == Phase::Descent && self.leg.is_some() && up != self.up;
        let goes = known && !turns && matches!(state, State::Climb | State::Follow) && (!urgent || up);
        let mut advice = if state == State::Follow { self.advice } else { Advice::FREE };
        advice.speed_scale = advice.speed_scale.min(self.filter.speed_share(now));
        let path = scene.plan.map(|plan| &plan.path);
        if let (Some(path), true) = (path, known && self.on_path && !self.is_algorithm2()) {
            self.retreat(state, path, &mut advice, neighbours, now);
        }
        if self.leg.is_none() {
            self.up = up;
        }
        let wanted = goes || (self.back_to_m.is_some() && !urgent);
        let back_up = up && self.leg_done();
        let holds = (!wanted || back_up)
            && self.on_path
            && matches!(self.phase, Phase::Path | Phase::Join | Phase::Descent)
            && setpoints_hold(state)
            && self.door.stands();
        let yields = self.filter.yields() || state != State::Follow;
        let late_s = if holds { neighbours.latest_s() } else { 0.0 };
        self.turned |= self.hold.step(holds, yields, late_s, now);
        let moves = wanted && !self.hold.binds(now);
        if !moves && self.door.stands() && !self.settled {
            if let (Some(path), Phase::Path) = (path, self.phase) {
                let near_m = self.tracker.along_m;
                self.tracker.along_m = nearest_m(path, &self.door.position(), near_m, SETTLE_WINDOW_M);
            }
            self.door.rest();
            self.settle();
        }
        let lead_m = (position - self.door.position()).norm();
        let share = ((self.lead_m - lead_m) / (0.5 * self.lead_m)).clamp(0.0, 1.0);
        let share = match moves {
            true if flies || state == State::Climb => share.min(self.pace),
            true => self.pace,
            // Settled it holds; before the take-off it follows the estimate.
            false if self.settled => 1.0,
            false => 0.0,
        };
        let mut blocked = false;
        // Where it stops stays where it is, however many raw points this step takes.
        let stops_at_m = advised_at_m + advice.stop_within_m;
        self.fenced &= !moves;
        for _ in 0..self.door.begin(Pace { share, urgent }, dt_s) {
            if self.phase == Phase::Path && !self.is_algorithm2() {
                advice.stop_within_m = (stops_at_m - self.tracker.along_m).max(0.0);
            }
            let raw = match scene.plan {
                Some(plan) if moves => {
                    self.next_raw(state, scene, plan, &advice, neighbours, now, &mut blocked)
                }
                _ if matches!(state, State::Streaming | State::Engaging | State::Arming) && known => {
                    let away = position - self.door.raw();
                    let most = DRIFT_MPS * TICK_S;
                    let share = most / away.norm().max(most);
                    self.door.raw() + away * share
                }
                _ => self.door.raw(),
            };
            self.door.push(raw);
        }
        self.mark_trapped(blocked, now);
        let sound = self.door.finish();
        let correction = if flies && state != State::PilotControl && known {
            correction(&self.door.position(), &self.door.velocity(), scene.telemetry)
        } else {
            Point::zeros()
        };
        let change = self.door.acceleration() + correction - self.sent_acceleration;
        let most = self.door.jerk_mps3(urgent) * dt_s;
        self.sent_acceleration += change * (most / change.norm().max(most).max(1e-6));
        if self.tracker.along_m > self.progress_m + PROGRESS_M {
            self.progress_m = self.tracker.along_m;
            self.progress_at = now;
        }
        if scene.plan.is_some() && (self.on_path || self.phase == Phase::Climb) && known {
            self.reported_m = self.progress_m(state, scene);
        }
        sound
    }

    /// What the safety filter finds at this moment: the vehicle that it stops for, 0 for none. Nothing changes by it.
    pub fn ask_filter<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) -> u8 {
        let before = self.filter;
        self.filter(state, scene, neighbours, now);
        core::mem::replace(&mut self.filter, before).blocker()
    }

    /// The raw point is where the setpoint stands: going on begins with a way from there.
    fn settle(&mut self) {
        self.settled = true;
        self.leg = None;
        self.leg_tracker = Tracker::default();
        self.tracker.speed_mps = 0.0;
    }

    /// The next raw point.
    #[expect(clippy::too_many_arguments, reason = "what a step knows")]
    fn next_raw<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        plan: &VehiclePlan<W, G>,
        advice: &Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        blocked: &mut bool,
    ) -> Point {
        let path = &plan.path;
        let raw = self.door.raw();
        if core::mem::replace(&mut self.settled, false) && self.phase == Phase::Path {
            (self.phase, self.leg) = (Phase::Join, None);
        }
        if self.phase == Phase::Climb && state != State::Climb && self.leg_done() {
            (self.phase, self.leg) = (Phase::Join, None);
        }
        if self.phase == Phase::Path && state == State::Follow && self.stands_at_end(scene) {
            (self.phase, self.leg) = (Phase::Descent, None);
            self.progress_at = now;
        }
        let target = match self.phase {
            Phase::Hold => return raw,
            Phase::Climb => path.point_at(0.0).map(|start| Point::new(raw.x, raw.y, start.z)),
            Phase::Join => path.point_at(self.tracker.along_m),
            Phase::Descent => path.point_at(path.length_m()).map(|end| {
                Point::new(raw.x, raw.y, if self.up { end.z } else { end.z - self.guided_m(plan.descent_m) })
            }),
            Phase::Path if self.is_algorithm2() => {
                return self.next_to_waypoint(path, &scene.telemetry.position, advice).unwrap_or(raw);
            }
            Phase::Path => return self.next_on_path(path, advice, neighbours, now, blocked).unwrap_or(raw),
        };
        let Some(target) = target else { return raw };
        if self.leg.is_none() {
            let mut leg = Path::new();
            // Room for both.
            let _ = leg.push(raw, f32::INFINITY.min(self.track.lead_max_m));
            let _ = leg.push(target, f32::INFINITY.min(self.track.lead_max_m));
            (self.leg, self.leg_tracker) = (Some(leg), Tracker::default());
        }
        let Some(leg) = &self.leg else { return raw };
        let advice = Advice::FREE;
        let reference = path::advance(&self.leg_track, leg, &mut self.leg_tracker, &advice, TICK_S);
        self.lead_m = LEG_LEAD_M;
        if self.phase == Phase::Descent && self.leg_tracker.speed_mps > 0.0 {
            self.progress_at = now;
        }
        if self.phase == Phase::Join && (leg.length_m() < LEG_LEAST_M || self.leg_done()) {
            // Back up a descent it ends where that began: beside the path yet.
            let beside_m = (target - raw).norm();
            let joined = beside_m < LEG_LEAST_M + JOIN_MPS * TICK_S;
            (self.phase, self.leg) = (if joined { Phase::Path } else { Phase::Join }, None);
        }
        reference.map_or(raw, |reference| reference.position)
    }

    /// The next raw point on the path, back from below a vehicle that comes down where it has to.
    fn next_on_path<const V: usize, const W: usize>(
        &mut self,
        path: &Path<W>,
        advice: &Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        blocked: &mut bool,
    ) -> Option<Point> {
        let mut advice = *advice;
        if let Some(to_m) = self.back_to_m {
            let safety_m = self.deconflict.safety_distance_m;
            let near = neighbours.at(now);
            // The filter has looked that way since the step before.
            let free = self.filter.looks_back() && !self.filter.is_stopped();
            if !free {
                advice.stop_within_m = 0.0;
            } else if let Some(place) = retreat::step(path, &mut self.tracker, to_m, near, safety_m, TICK_S) {
                return Some(place);
            } else {
                *blocked = true;
                advice.stop_within_m = 0.0;
            }
        }
        // Where the path leaves the geofence, it stops before it.
        let speed = self.tracker.speed_mps.max(0.0);
        let accel = self.track.accel_mps2.min(self.track.accel_z_mps2);
        let braking_m = speed * speed / (2.0 * accel) + 2.0 * speed * TICK_S + FENCE_MARGIN_M;
        if path.point_at(self.tracker.along_m + braking_m).is_some_and(|ahead| !self.door.allows(&ahead)) {
            advice.stop_within_m = advice.stop_within_m.min(braking_m);
            self.fenced = true;
        }
        let Reference { position, lead_m, .. } =
            path::advance(&self.track, path, &mut self.tracker, &advice, TICK_S)?;
        self.lead_m = lead_m;
        Some(position)
    }

    /// The next raw point by Algorithm 2: straight to the current waypoint, at the speed advised.
    fn next_to_waypoint<const W: usize>(
        &mut self,
        path: &Path<W>,
        position: &Point,
        advice: &Advice,
    ) -> Option<Point> {
        let (raw, before) = (self.door.raw(), self.waypoints);
        let target = self.waypoints.next(path, position);
        let mut advice = *advice;
        match target {
            None => advice.speed_scale = 0.0,
            Some(target) if self.leg.is_none() || self.waypoints != before => {
                let mut leg = Path::new();
                // Room for both.
                let _ = leg.push(raw, self.track.lead_max_m);
                let _ = leg.push(target, self.track.lead_max_m);
                let course = |leg: &Path<2>| match leg.waypoints() {
                    [from, to] => (to.position - from.position) / (to.along_m - from.along_m),
                    _ => Point::zeros(),
                };
                // Of its speed it keeps what leads to the new waypoint.
                let kept = self.leg.as_ref().map_or(0.0, |old| course(old).dot(&course(&leg)).max(0.0));
                let speed_mps = self.leg_tracker.speed_mps * kept;
                (self.leg, self.leg_tracker) = (Some(leg), Tracker { along_m: 0.0, speed_mps });
            }
            Some(_) => {}
        }
        let leg = self.leg.as_ref()?;
        let speed = self.leg_tracker.speed_mps.max(0.0);
        let braking_m = speed * speed / (2.0 * self.track.accel_z_mps2.min(self.track.accel_mps2));
        let ahead_m = self.leg_tracker.along_m + braking_m + 2.0 * speed * TICK_S + LEG_LEAST_M;
        if leg.point_at(ahead_m).is_some_and(|ahead| !self.door.allows(&ahead)) {
            advice.stop_within_m = braking_m;
            self.fenced = true;
        }
        let reference = path::advance(&self.track, leg, &mut self.leg_tracker, &advice, TICK_S)?;
        self.lead_m = LEG_LEAD_M;
        self.tracker.speed_mps = self.leg_tracker.speed_mps;
        let length_m = path.length_m();
        self.tracker.along_m = if self.waypoints.completed() {
            length_m
        } else {
            let seen_m = path.project(&reference.position, self.tracker.along_m, SETTLE_WINDOW_M);
            seen_m.max(self.tracker.along_m).min((length_m - LEG_LEAST_M).max(0.0))
        };
        Some(reference.position)
    }

    /// Whether waypoints and the end of the path are those of the paper.
    fn is_algorithm2(&self) -> bool {
        self.deconflict.method == Method::Algorithm2
    }

    /// Whether the straight way is flown by the raw point.
    fn leg_done(&self) -> bool {
        self.leg.as_ref().is_some_and(|leg| self.leg_tracker.along_m >= leg.length_m())
    }

    /// Whether it leads the vehicle down.
    pub(crate) fn descends(&self) -> bool {
        self.phase == Phase::Descent
    }

    /// Height of the ground below the vehicle, as far as the plan says, metres.
    pub(crate) fn ground_m<const W: usize, const G: usize>(&self, plan: &VehiclePlan<W, G>) -> f32 {
        let pad_m = plan.path.point_at(0.0).map_or(0.0, |p| p.z - plan.climb_m);
        let end_m = plan.path.point_at(plan.path.length_m()).map_or(pad_m, |p| p.z - plan.descent_m);
        match self.on_path {
            true if self.reached_end(&plan.path) => end_m,
            true => pad_m.min(end_m),
            false => pad_m,
        }
    }

    /// Time since the reference last moved on.
    pub fn progress_at(&self) -> Instant {
        self.progress_at
    }

    /// How far down the setpoint leads, metres. At the end of the path and free to land it goes straight down, not lower than
    /// the margin kept to obstacles: only from there the autopilot lands by itself, which the wind may carry off.
    fn guided_m(&self, descent_m: f32) -> f32 {
        libm::fmaxf(descent_m - self.low_m, 0.0)
    }

    pub fn climb_done<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        let top = self.leg.as_ref().and_then(|leg| leg.waypoints().last());
        self.phase == Phase::Climb
            && self.leg_done()
            && top.is_some_and(|top| {
                let apart = self.door.position() - scene.telemetry.position;
                // Both setpoint and vehicle at the top: a low climb must not count as done on the pad.
                (self.door.position().z - top.position.z).abs() < CLIMBED_M
                    && self.stands()
                    && apart.norm() < 2.0 * ARRIVED_M
                    && apart.z.abs() < CLIMBED_M
            })
    }

    /// Whether the path and the guided descent are flown.
    pub fn path_done<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        if self.is_algorithm2() {
            let stands = self.stands() && scene.telemetry.velocity.norm() < STANDING_MPS;
            return stands && self.on_path && self.waypoints.completed() && !self.aside;
        }
        let (Some(plan), Some(leg)) = (scene.plan, self.leg.as_ref()) else { return false };
        let Some(low) = leg.waypoints().last() else { return false };
        self.phase == Phase::Descent
            && !self.up
            && self.leg_done()
            && (scene.telemetry.position.z - low.position.z < DESCENDED_M
                || self.guided_m(plan.descent_m) == 0.0)
    }

    /// Whether it stands at the end of the path and nobody keeps it from landing.
    fn stands_at_end<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        let Some(plan) = scene.plan else { return false };
        self.reached_end(&plan.path)
            && !self.is_algorithm2()
            && !self.aside
            && self.stands()
            && plan.path.point_at(plan.path.length_m()).is_some_and(|end| {
                (end - scene.telemetry.position).norm() < ARRIVED_M
                    && (end - self.door.position()).norm() < ARRIVED_M
            })
            && scene.telemetry.velocity.norm() < STANDING_MPS
            && (self.advice.stop_within_m > plan.descent_m || self.returning)
    }

    /// Whether the vehicle is within `window_m` of its place along the path, and the straight way to the nearest point of
    /// the path stays inside the leg's clearance.
    pub fn near_path<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>, window_m: f32) -> bool {
        let Some(plan) = scene.plan else { return false };
        let position = &scene.telemetry.position;
        let along_m = plan.path.project(position, self.tracker.along_m, window_m);
        if let (true, Some(first)) = (self.tracker.along_m <= 0.0, plan.path.waypoints().first()) {
            // Over its pad, on the way up.
            let away = position - first.position;
            if (-plan.climb_m - ARRIVED_M..0.0).contains(&away.z) && away.xy().norm() < ARRIVED_M {
                return true;
            }
        }
        if let (Phase::Descent, Some(last)) = (self.phase, plan.path.waypoints().last()) {
            let away = position - last.position;
            if (-plan.descent_m - ARRIVED_M..ARRIVED_M).contains(&away.z) && away.xy().norm() < ARRIVED_M {
                return true;
            }
        }
        if (along_m - self.tracker.along_m).abs() > window_m - WINDOW_EDGE_M {
            return false;
        }
        let leg = plan.path.waypoints().iter().find(|w| w.along_m >= along_m && w.along_m > 0.0);
        let (Some(leg), Some(nearest)) = (leg, plan.path.point_at(along_m)) else { return false };
        // The hull is free where it is, and within the leg's clearance of the nearest point: the straight way between is if it
        // leaves that ball nowhere else.
        let free_m2 = leg.clearance_m * leg.clearance_m - self.track.radius_m * self.track.radius_m;
        (nearest - position).norm_squared() <= free_m2
    }

    /// The setpoint of this moment.
    pub fn setpoint<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &Scene<'_, W, G>,
    ) -> Setpoint {
        if !setpoints_flow(state) {
            return Setpoint::None;
        }
        let door = &self.door;
        let still = Point::zeros();
        if scene.telemetry.position_at.is_none() || state == State::PositionLost {
            return Setpoint::Stop(if door.is_live() { door.velocity() } else { still });
        }
        if !door.is_live() {
            // The state is newer than the step: the next one begins where the vehicle is.
            return Setpoint::None;
        }
        // Guided is not sent the acceleration: the velocity looks ahead instead, no faster than the setpoint will be.
        let lead_s = scene.telemetry.kind.map_or(0.0, Kind::velocity_lead_s);
        let velocity = door.velocity() + door.acceleration() * lead_s;
        let most = door.velocity().norm().max(door.raw_speed_mps());
        let velocity = velocity * (most / velocity.norm().max(most).max(1e-6));
        Setpoint::Move(door.position(), velocity, self.sent_acceleration)
    }
}

/// Arc length of the nearest point of the path; its end, if that is as near as counts as there.
fn nearest_m<const W: usize>(path: &Path<W>, place: &Point, near_m: f32, window_m: f32) -> f32 {
    let (along_m, length_m) = (path.project(place, near_m, window_m), path.length_m());
    if length_m - along_m < AT_END_M { length_m } else { along_m.max(0.0) }
}

/// Horizontal acceleration back to the reference, for an autopilot that adds it to what its own loops ask for. Upwards its
/// loops are stiff enough.
fn correction(position: &Point, velocity: &Point, telemetry: &Telemetry) -> Point {
    let off = (position - telemetry.position) * HOLD_PER_S2 + (velocity - telemetry.velocity) * DAMP_PER_S;
    let across = libm::hypotf(off.x, off.y);
    // A reported velocity near the largest number overflows: nothing is corrected by it.
    if !across.is_finite() {
        return Point::zeros();
    }
    let share = if across > HOLD_MOST_MPS2 { HOLD_MOST_MPS2 / across } else { 1.0 };
    Point::new(off.x * share, off.y * share, 0.0)
}

/// Whether setpoints go out in this state: from before Offboard until the motors are off, never in a failsafe, nor while an autopilot
/// that has to be told takes off.
pub fn setpoints_flow(state: State) -> bool {
    use State::*;
    matches!(
        state,
        Streaming
            | Engaging
            | Arming
            | Climb
            | Follow
            | Paused
            | Alone
            | Blocked
            | Replanning
            | Stopping
            | AutopilotSilent
            | PositionLost
            | Land
            | PilotControl
            | PilotReturned
            | CancelStart
            | Disarm
            | LandingHeld
    )
}

/// Whether a vehicle that stands in this state stays there until it decides otherwise.
fn setpoints_hold(state: State) -> bool {
    use State::*;
    matches!(state, Follow | Paused | Alone | Blocked | Replanning)
}
