//! Where to be now: the setpoint of each state, made from the path, the neighbours and the autopilot's position.

mod brakes;
mod filter;

use nalgebra::Vector3;
use planner_core::Point;
use planner_core::deconflict::{self, Advice, DeconflictConfig, Own};
use planner_core::path::{self, Path, Reference, TrackConfig, Tracker};
use planner_core::schedule::VehiclePlan;

use crate::config::Config;
use crate::guidance::filter::Filter;
use crate::mission::State;
use crate::neighbours::Neighbours;
use crate::retreat::Search;
use crate::telemetry::Telemetry;
use crate::time::Instant;

/// This near the end of the climb or of the path counts as there, metres.
const ARRIVED_M: f32 = 0.35;
/// Slower than this counts as standing at the end of the path, m/s.
const STANDING_MPS: f32 = 0.5;
/// A reference slower than this stands, m/s.
const STANDING_REFERENCE_MPS: f32 = 0.05;
/// This near its top the climb is done, metres.
const CLIMBED_M: f32 = 0.12;
/// This near the lower end of the guided descent it is done, metres.
const DESCENDED_M: f32 = 0.2;
/// The climb ends no slower than this, m/s.
const CREEP_MPS: f32 = 0.05;
/// The climb's reference is at most this far above the vehicle, metres.
const CLIMB_LEAD_M: f32 = 1.5;
/// Stretch of the path searched for the nearest point after the pilot, metres to either side.
pub const REJOIN_WINDOW_M: f32 = 5.0;
/// The same after the position was lost, metres: the vehicle stopped within its braking distance of the reference, so a
/// position further along is not to be believed.
pub const LOST_WINDOW_M: f32 = 2.5;
/// A nearest point this near the end of the window lies beyond it, metres.
const WINDOW_EDGE_M: f32 = 0.01;
/// Less than this is no progress, metres.
const PROGRESS_M: f32 = 0.25;

/// Acceleration for each metre off the reference, 1/s²: with what PX4's cascade asks for by itself (`MPC_XY_P` 0.95 ·
/// `MPC_XY_VEL_P_ACC` 1.8) it makes the loop 2.8 times as stiff, and a gust carries the vehicle less than half as far.
const HOLD_PER_S2: f32 = 3.0;
/// Acceleration for each m/s beside the reference's velocity, 1/s: keeps the stiffer loop damped (ratio 0.76).
const DAMP_PER_S: f32 = 1.5;
/// Bound on both together, m/s²: a position that jumps must not throw the vehicle about.
const HOLD_MOST_MPS2: f32 = 1.5;

/// Before anyone was asked: wait.
const NOT_ASKED: Advice = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for: 0 };

/// What the autopilot is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// Nothing: the state streams no setpoints.
    None,
    /// Be there, with this velocity and acceleration: ENU metres, m/s, m/s².
    Move(Point, Point, Point),
    /// Stand still wherever that is: no position is known to refer to.
    Stop,
}

/// The reference and what moves it.
#[derive(Clone, Debug)]
pub struct Guidance {
    track: TrackConfig,
    deconflict: DeconflictConfig,
    /// Share of the speed that the estimate allows: 0 stops.
    pub pace: f32,
    climb_mps: f32,
    tracker: Tracker,
    /// Last advice of the neighbours.
    pub advice: Advice,
    reference: Option<Reference>,
    on_path: bool,
    brake_at_m: f32,
    hold: Point,
    climb_z: f32,
    progress_m: f32,
    progress_at: Instant,
    /// Whether it flies back the way it came.
    pub returning: bool,
    /// Where others at least heard it to be, metres along the path; ∞ where nobody has.
    linked_m: f32,
    shelter: Search,
    /// Whether it is to fly back along its path from under a vehicle that comes down.
    steps_back: bool,
    /// Whether it keeps out from under a vehicle that comes down.
    pub retreating: bool,
    /// Since when it waits under a vehicle that comes down, and its path leads nowhere better.
    pub trapped_since: Option<Instant>,
    /// Whether its path leads aside only: it does not land at its end.
    pub aside: bool,
    /// How far the reference has gone down below the end of the path, metres; none before the descent.
    descended_m: Option<f32>,
    /// Height over the ground at which the autopilot lands by itself, metres.
    low_m: f32,
    /// Where along the path it will stop for now, whatever the safety filter does, metres.
    pub(crate) stops_at_m: f32,
    /// The safety filter.
    pub(crate) filter: Filter,
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
    pub fn new<const V: usize>(config: &Config<V>) -> Self {
        Self {
            track: TrackConfig {
                cruise_mps: config.cruise_mps,
                accel_mps2: config.accel_mps2,
                radius_m: config.radius_m,
                ..TrackConfig::default()
            },
            deconflict: DeconflictConfig {
                method: config.method,
                safety_distance_m: config.safety_distance_m,
                cruise_mps: config.cruise_mps,
                accel_mps2: config.accel_mps2,
            },
            pace: 1.0,
            climb_mps: config.climb_mps,
            tracker: Tracker::default(),
            advice: NOT_ASKED,
            reference: None,
            on_path: false,
            brake_at_m: f32::INFINITY,
            hold: Point::zeros(),
            climb_z: 0.0,
            progress_m: 0.0,
            progress_at: Instant::ZERO,
            returning: false,
            linked_m: f32::INFINITY,
            shelter: Search::default(),
            steps_back: false,
            retreating: false,
            trapped_since: None,
            aside: false,
            descended_m: None,
            low_m: config.required_clearance_m - config.radius_m,
            stops_at_m: f32::NEG_INFINITY,
            filter: Filter::default(),
        }
    }

    /// Takes other speeds.
    pub fn tune<const V: usize>(&mut self, config: &Config<V>) {
        let Self { track, deconflict, climb_mps, .. } = Self::new(config);
        (self.track, self.deconflict, self.climb_mps) = (track, deconflict, climb_mps);
    }

    /// Forgets a former flight.
    pub fn reset(&mut self) {
        self.tracker = Tracker::default();
        self.reference = None;
        self.on_path = false;
        self.returning = false;
        self.aside = false;
        self.descended_m = None;
        self.advice = NOT_ASKED;
        self.filter.reset();
    }

    pub fn hold_at(&mut self, point: Point) {
        self.hold = point;
        self.on_path = false;
    }

    pub fn begin_climb(&mut self, position: &Point) {
        self.reset();
        self.climb_z = position.z;
    }

    pub fn run(&mut self, now: Instant) {
        self.on_path = true;
        self.shelter.reset();
        self.brake_at_m = f32::INFINITY;
        self.linked_m = f32::INFINITY;
        self.progress_m = self.tracker.along_m;
        self.progress_at = now;
    }

    /// Where on the path the reference is; −∞ before it runs.
    pub fn along_m(&self) -> f32 {
        if self.on_path { self.tracker.along_m } else { f32::NEG_INFINITY }
    }

    /// Whether the reference stands, and is not on its way down.
    pub fn stands(&self) -> bool {
        self.tracker.speed_mps < STANDING_REFERENCE_MPS && self.descended_m.is_none()
    }

    /// Begins another path.
    pub fn begin_path(&mut self, now: Instant) {
        self.tracker = Tracker::default();
        self.descended_m = None;
        self.aside = false;
        self.run(now);
    }

    /// Holds a point until the pilot's vehicle is resumed; where the flight was interrupted is kept.
    pub fn hold_after_pilot(&mut self, point: Point) {
        self.hold = point;
    }

    /// Goes on after an interruption: a climb from here upwards, a descent from here downwards, a path from its nearest point.
    pub fn go_on<const W: usize, const G: usize>(
        &mut self,
        plan: &VehiclePlan<W, G>,
        climbs: bool,
        position: &Point,
        now: Instant,
    ) {
        let end_z = plan.path.point_at(plan.path.length_m()).map_or(0.0, |p| p.z);
        if climbs {
            self.climb_z = position.z;
        } else if let Some(descended_m) = &mut self.descended_m {
            *descended_m = (end_z - position.z).max(0.0).min(*descended_m);
            self.progress_at = now;
        } else {
            self.rejoin(&plan.path, position, now);
        }
    }

    /// Goes on from the nearest point of the path.
    pub fn rejoin<const W: usize>(&mut self, path: &Path<W>, position: &Point, now: Instant) {
        let along_m =
            path.project(position, self.tracker.along_m, REJOIN_WINDOW_M).clamp(0.0, path.length_m());
        self.tracker = Tracker { along_m, speed_mps: 0.0 };
        self.descended_m = None;
        self.run(now);
    }

    /// Replaces the path by the way back to its first point. The clearance of each leg goes with it.
    pub fn turn_back<const W: usize>(&mut self, path: &mut Path<W>, now: Instant) {
        let along_m = self.tracker.along_m;
        let mut back = Path::new();
        let ahead = path.waypoints().iter().find(|w| w.along_m >= along_m);
        let mut clearance_m = ahead.map_or(0.0, |w| w.clearance_m);
        if let Some(here) = path.point_at(along_m) {
            // No more points than the path has: those behind, and this one for at least one ahead.
            let _ = back.push(here, clearance_m);
        }
        for waypoint in path.waypoints().iter().rev().filter(|w| w.along_m < along_m) {
            let _ = back.push(waypoint.position, clearance_m);
            clearance_m = waypoint.clearance_m;
        }
        *path = back;
        self.returning = true;
        self.begin_path(now);
    }

    /// Arc length told to neighbours and gates: negative before and in the climb, beyond the path's length in the
    /// descent.
    pub fn progress_m<const W: usize, const G: usize>(&self, state: State, scene: &Scene<'_, W, G>) -> f32 {
        let Some(plan) = scene.plan else { return 0.0 };
        let (path, z) = (&plan.path, scene.telemetry.position.z);
        let length_m = path.length_m();
        let end_z = path.point_at(length_m).map_or(0.0, |p| p.z);
        let start_z = path.point_at(0.0).map_or(0.0, |p| p.z);
        match state {
            State::Climb => -(start_z - z).clamp(0.0, plan.climb_m),
            State::Follow | State::Land
                if self.reached_end(path) && (state == State::Land || self.descended_m.is_some()) =>
            {
                length_m + (end_z - z).clamp(0.0, plan.descent_m)
            }
            // A metre beyond the ground, so that every gate on this flight opens.
            State::Disarm | State::Done if self.reached_end(path) => length_m + plan.descent_m + 1.0,
            _ if self.on_path => {
                let behind = self.track.lead_max_m * 2.0;
                let seen =
                    path.project(&scene.telemetry.position, self.tracker.along_m - behind * 0.5, behind);
                seen.min(self.tracker.along_m)
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

    /// One step of `dt_s`: new advice, new reference.
    pub fn step<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        dt_s: f32,
    ) {
        let Some(plan) = scene.plan else { return };
        let position = &scene.telemetry.position;
        let along_m = if self.on_path { self.tracker.along_m } else { -plan.climb_m };
        if matches!(state, State::Scheduled | State::Follow) {
            let own = Own {
                rank: scene.rank,
                position: *position,
                along_m,
                path: &plan.path,
                detours: scene.detours,
            };
            self.advice = deconflict::advise(&self.deconflict, &own, &plan.gates, neighbours.at(now));
        }
        let stop_m = match state {
            State::Follow => self.advice.stop_within_m,
            _ => self.brake_at_m - along_m,
        };
        self.stops_at_m = along_m + stop_m.max(0.0);
        self.filter(state, scene, neighbours, now);
        if state == State::Climb && !self.filter.is_stopped() {
            let top = plan.path.point_at(0.0).map_or(self.climb_z, |p| p.z);
            let lead = position.z + CLIMB_LEAD_M;
            let rate = self.climb_rate(top) * self.pace;
            self.climb_z = (self.climb_z + rate * dt_s).min(lead.max(self.climb_z)).min(top);
        }
        if self.on_path
            && setpoints_flow(state)
            && !matches!(state, State::PilotControl | State::PilotReturned)
        {
            let mut advice = if state == State::Follow {
                Advice { speed_scale: self.advice.speed_scale * self.pace, ..self.advice }
            } else {
                Advice { stop_within_m: self.brake_at_m - self.tracker.along_m, ..Advice::FREE }
            };
            advice.stop_within_m = advice.stop_within_m.min(self.filter.leaves_m(self.tracker.along_m));
            advice.speed_scale = advice.speed_scale.min(self.filter.speed_share(now));
            self.reference =
                self.retreat(state, &plan.path, &mut advice, neighbours, now, dt_s).or_else(|| {
                    path::advance(&self.track, &plan.path, &mut self.tracker, position, &advice, dt_s)
                });
            if state == State::Follow {
                self.descend(scene, plan.descent_m, now, dt_s);
            }
            if self.tracker.along_m > self.progress_m + PROGRESS_M {
                self.progress_m = self.tracker.along_m;
                self.progress_at = now;
            }
        }
    }

    /// Whether it leads the vehicle down.
    pub(crate) fn descends(&self) -> bool {
        self.descended_m.is_some()
    }

    /// Height of the ground below the vehicle, as far as the plan tells, metres.
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

    /// At the end of the path and free to land the reference goes straight down, not lower than the margin kept to
    /// obstacles: only from there the autopilot lands by itself, which the wind may carry off.
    fn descend<const W: usize, const G: usize>(
        &mut self,
        scene: &Scene<'_, W, G>,
        descent_m: f32,
        now: Instant,
        dt_s: f32,
    ) {
        let descended_m = match self.descended_m {
            Some(descended_m) => descended_m,
            None if self.stands_at_end(scene) => 0.0,
            None => return,
        };
        if self.filter.is_stopped() {
            // Back up its own column, if it yields.
            let up_m = if self.filter.backs_up(now) { self.climb_mps * dt_s } else { 0.0 };
            self.descended_m = Some(descended_m - up_m).filter(|m| *m > 0.0);
            return;
        }
        let rate = self.vertical_rate(self.guided_m(descent_m) - descended_m);
        self.descended_m = Some(descended_m + rate * dt_s);
        if rate > 0.0 {
            self.progress_at = now;
        }
    }

    /// How far down the reference leads, metres.
    fn guided_m(&self, descent_m: f32) -> f32 {
        libm::fmaxf(descent_m - self.low_m, 0.0)
    }

    /// Speed of the climb's reference.
    fn climb_rate(&self, top: f32) -> f32 {
        self.vertical_rate(top - self.climb_z)
    }

    /// Speed of a vertical reference with this way left: it brakes at half the acceleration, so that a low ceiling is not
    /// overshot into.
    fn vertical_rate(&self, left: f32) -> f32 {
        if left <= 0.0 {
            return 0.0;
        }
        libm::fminf(self.climb_mps, libm::fmaxf(libm::sqrtf(self.track.accel_mps2 * left), CREEP_MPS))
    }

    pub fn climb_done<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        let start = scene.plan.and_then(|plan| plan.path.point_at(0.0));
        start.is_some_and(|start| {
            let apart = start - scene.telemetry.position;
            // Both reference and vehicle at the top: a low climb must not count as done on the pad.
            self.climb_z >= start.z && apart.norm() < 2.0 * ARRIVED_M && apart.z.abs() < CLIMBED_M
        })
    }

    /// Whether the path and the guided descent are flown.
    pub fn path_done<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        let (Some(plan), Some(reference), Some(descended_m)) = (scene.plan, self.reference, self.descended_m)
        else {
            return false;
        };
        let guided_m = self.guided_m(plan.descent_m);
        let low_z = reference.position.z - guided_m;
        descended_m >= guided_m && (scene.telemetry.position.z - low_z < DESCENDED_M || guided_m == 0.0)
    }

    /// Whether it stands at the end of the path and nobody keeps it from landing.
    fn stands_at_end<const W: usize, const G: usize>(&self, scene: &Scene<'_, W, G>) -> bool {
        let (Some(plan), Some(reference)) = (scene.plan, self.reference) else { return false };
        self.on_path
            && !self.aside
            && reference.finished
            && (reference.position - scene.telemetry.position).norm() < ARRIVED_M
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
        if let (Some(_), Some(last)) = (self.descended_m, plan.path.waypoints().last()) {
            // Below the end of its path, on the way down.
            let away = position - last.position;
            if (-plan.descent_m..ARRIVED_M).contains(&away.z) && away.xy().norm() < ARRIVED_M {
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
        let still = Vector3::zeros();
        if scene.telemetry.position_at.is_none() || state == State::PositionLost {
            return Setpoint::Stop;
        }
        match state {
            State::PilotControl => Setpoint::Move(scene.telemetry.position, still, still),
            State::PilotReturned => Setpoint::Move(self.hold, still, still),
            State::Climb => {
                let start = scene.plan.and_then(|plan| plan.path.point_at(0.0)).unwrap_or(self.hold);
                let rate = if self.filter.is_stopped() { 0.0 } else { self.climb_rate(start.z) };
                let place = Point::new(start.x, start.y, self.climb_z);
                Setpoint::Move(place, Point::new(0.0, 0.0, rate), still)
            }
            _ => match self.reference {
                Some(r) if self.on_path => {
                    let down_m = self.descended_m.unwrap_or(0.0);
                    let rate = match scene.plan {
                        Some(plan)
                            if state == State::Follow
                                && self.descended_m.is_some()
                                && !self.filter.is_stopped() =>
                        {
                            self.vertical_rate(self.guided_m(plan.descent_m) - down_m)
                        }
                        _ => 0.0,
                    };
                    let down = |length: f32| Point::new(0.0, 0.0, length);
                    Setpoint::Move(r.position - down(down_m), r.velocity - down(rate), r.acceleration)
                }
                _ => Setpoint::Move(self.hold, still, still),
            },
        }
    }
}

/// Horizontal acceleration back to the reference, for an autopilot that adds it to what its own loops ask for. Upwards its
/// loops are stiff enough.
pub fn correction(position: &Point, velocity: &Point, telemetry: &Telemetry) -> Point {
    let off = (position - telemetry.position) * HOLD_PER_S2 + (velocity - telemetry.velocity) * DAMP_PER_S;
    let across = libm::hypotf(off.x, off.y);
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
    )
}
