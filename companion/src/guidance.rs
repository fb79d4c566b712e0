//! Guidance makes the setpoint: from the path, the neighbours and the autopilot's position it makes
//! the raw point of each state, and its smoother makes the setpoint of the raw point.
//!
//! A flight has phases: the climb straight up from where the vehicle stands, the join to the path's
//! start, the path, the descent. The phase is guidance's own state. A pause, a lost position or a
//! pilot interrupts it; afterwards it continues where it was. A stop slows the smoother's clock, so
//! the raw point stays where it is. Once the setpoint stands, the raw point is taken back to it,
//! and continuing begins with a straight way back to where the phase was left.

mod brakes;
pub(crate) mod evade;
mod fence;
pub(crate) mod filter;
mod follower;
mod hold;
mod known_way;
mod lag;
pub(crate) mod limits;
mod motion;
mod nearest;
mod orders;
mod output;
mod phase;
mod progress;
mod raw;
mod scene;
mod setpoint;
mod smoother;
mod waypoints;

use planner_core::deconflict::{self, Advice, DeconflictConfig, Method, OwnVehicle};
use planner_core::flight::Path;
use planner_core::track::{TrackConfig, Tracker};
use planner_core::{Length, Point};

use self::filter::SafetyFilter;
use self::hold::Hold;
use self::limits::{MotionLimits, Settings};
use self::nearest::nearest_arc_length_m;
use self::phase::Phase;
use self::setpoint::position_correction;
use self::smoother::{ClockPace, SetpointSmoother, TICK_S};
use self::waypoints::Algorithm2Waypoints;
use crate::autopilot::limits::AutopilotLimits;
use crate::config::Config;
use crate::guidance::evade::EvadeSearch;
use crate::mission::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};

pub use self::scene::GuidanceInputs;
pub use self::setpoint::Setpoint;
pub use self::smoother::SetpointStats;

/// The end of a climb or of a path is reached within this distance, metres.
const ARRIVED_M: f32 = 0.35;
/// A vehicle near its reference reports its progress at most this far short of the reference,
/// metres: 0.05 m less than gates allow (`PROGRESS_ERROR_M`), since a vehicle stops a little short
/// of a gate.
const REPORTED_SHORT_M: f32 = planner_core::flight::PROGRESS_ERROR_M - 0.05;
/// A vehicle slower than this stands at the end of the path, m/s.
const AT_REST_MPS: f32 = 0.5;
/// A setpoint slower than this stands, m/s.
const STANDING_SETPOINT_MPS: f32 = 0.05;
/// A climb is done within this distance of its top, metres.
const CLIMBED_M: f32 = 0.12;
/// A guided descent is done within this distance of its lower end, metres.
const DESCENDED_M: f32 = 0.2;
/// Time after which a guided descent that has reached its end hands over to the autopilot's
/// landing, wherever the vehicle is.
const LAND_AFTER: Duration = Duration::from_secs(2);
/// Time without progress after which the autopilot takes over a landing that guidance leads from
/// the path.
const LEADS_FOR: Duration = Duration::from_secs(4);
/// Greatest lead of the setpoint ahead of the vehicle in a climb, a descent or a join, metres.
const LEG_LEAD_M: f32 = 1.5;
/// Greatest speed of the estimate of a vehicle on its pad, m/s: up to it the setpoint follows the
/// estimate before the take-off.
const MAX_PAD_DRIFT_MPS: f32 = 0.2;
/// Stretch of the path searched for the nearest point after the pilot, metres to either side.
pub const REJOIN_WINDOW_M: f32 = 5.0;
/// Stretch of the path searched after the position was lost, metres to either side: the vehicle
/// stopped within its braking distance of the reference, so a position further along is not to be
/// believed.
pub const LOST_WINDOW_M: f32 = 2.5;
/// Stretch of the path searched once the setpoint stands, metres to either side: the raw point may
/// be a second of flight ahead.
const SETTLE_WINDOW_M: f32 = 3.0;
/// A nearest point this near the end of the searched stretch lies beyond the stretch, metres.
const WINDOW_EDGE_M: f32 = 0.01;
/// Least movement along the path that counts as progress, metres.
const MIN_PROGRESS_M: f32 = 0.25;
/// Distance that the raw point keeps from the geofence, metres: the setpoint may deviate by this
/// much from the path.
const FENCE_MARGIN_M: f32 = 0.05;
/// Greatest height over the ground, however wide the margin, at which a guided descent becomes
/// slow, or at which an autopilot that is not led to the ground takes over the landing, metres.
const MAX_LAND_HANDOVER_M: f32 = 1.2;
/// Fastest guided descent near the ground, m/s: as slow as ArduCopter lands.
const TOUCHDOWN_MPS: f32 = 0.5;
/// Shortest leg that is flown, metres.
const MIN_LEG_M: f32 = 1e-3;

/// Advice before the neighbours are evaluated: wait.
const NO_ADVICE_YET: Advice = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for: 0 };

/// State of guidance: flight phase, raw point, smoother and safety filter.
#[derive(Clone, Debug)]
pub struct Guidance {
    track: TrackConfig,
    /// Limits of the reference in climb, join and descent.
    leg_track: TrackConfig,
    deconflict: DeconflictConfig,
    /// Share of the speed that the estimate allows: 0 stops.
    pub pace: f32,
    /// The smoother, which makes setpoints of raw points.
    pub smoother: SetpointSmoother,
    phase: Phase,
    tracker: Tracker,
    /// The straight way of a climb, a join or a descent; none while it is to be made from where the
    /// setpoint stands.
    leg: Option<Path<2>>,
    leg_tracker: Tracker,
    /// Which waypoint it flies to, by Algorithm 2.
    waypoints: Algorithm2Waypoints,
    /// Whether the raw point is where the setpoint stands.
    raw_point_at_rest: bool,
    /// The position was unknown: no place was sent.
    position_unknown: bool,
    /// The autopilot flew by itself or by its pilot: setpoints followed the vehicle.
    autopilot_took_over: bool,
    /// Time since a place was sent, seconds.
    unsent_s: f32,
    /// Last advice of the neighbours.
    pub advice: Advice,
    /// Number of gates, from the first on, that are open for good.
    gates_open: usize,
    on_path: bool,
    lead_m: f32,
    /// Place of the setpoint along the path, metres.
    pub(crate) setpoint_m: f32,
    /// Place along the path where the vehicle will stop for now, whatever the safety filter does,
    /// metres.
    pub(crate) stops_at_m: f32,
    /// The safety filter.
    pub(crate) filter: SafetyFilter,
    /// Whether it holds its place for others to pass.
    pub(crate) hold: Hold,
    /// Whether that has changed since the last intent that was sent.
    pub(crate) hold_changed: bool,
    /// Whether a descent goes back up its column.
    climbing_back: bool,
    /// Whether it leads a landing down from the path, before the autopilot lands.
    guides_landing: bool,
    /// The path leads out of the geofence from here.
    stopped_at_fence: bool,
    progress_m: f32,
    progress_at: Instant,
    /// When the vehicle last was at its setpoint or the setpoint went on, and where that was then.
    followed_at: Instant,
    followed_place: Point,
    reported_m: f32,
    /// Whether it flies back the way it came.
    pub returning: bool,
    /// What others know of its way.
    known_way: known_way::KnownWay,
    evade_search: EvadeSearch,
    /// Whether it keeps out from under a vehicle that comes down.
    pub evading: bool,
    /// Distance ahead at which the vehicle waits for neighbours, metres.
    wait_distance_m: f32,
    /// Place along the path beyond which the vehicle does not fly for now, metres.
    halt_m: f32,
    /// Place along the path to which the vehicle flies back.
    back_to_m: Option<f32>,
    /// No place along its path is better.
    no_better_place: bool,
    /// Since when it waits under a vehicle that comes down, and its path leads nowhere better.
    trapped_since: Option<Instant>,
    /// Whether its path leads aside only: it does not land at its end.
    pub ends_aside: bool,
    /// Height over the ground from which a descent is slow, or an autopilot that is not led to the
    /// ground lands by itself, metres.
    low_height_m: f32,
    /// The lowest ground between pads, metres; infinite where those say how low.
    lowest_ground_m: f32,
    /// Acceleration sent last, with what holds the vehicle on the reference.
    sent_acceleration: Point,
}

impl Guidance {
    pub fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let smoother = SetpointSmoother::new(MotionLimits::new(config, autopilot), config.geofence);
        let Settings { track, leg_track, deconflict } = Settings::new(config, autopilot);
        Self {
            track,
            leg_track,
            deconflict,
            pace: 1.0,
            smoother,
            phase: Phase::Hold,
            tracker: Tracker::default(),
            leg: None,
            leg_tracker: Tracker::default(),
            waypoints: Algorithm2Waypoints::default(),
            raw_point_at_rest: true,
            position_unknown: false,
            autopilot_took_over: false,
            unsent_s: 0.0,
            advice: NO_ADVICE_YET,
            gates_open: 0,
            on_path: false,
            lead_m: LEG_LEAD_M,
            setpoint_m: 0.0,
            stops_at_m: f32::NEG_INFINITY,
            filter: SafetyFilter::default(),
            hold: Hold::default(),
            hold_changed: false,
            climbing_back: false,
            guides_landing: false,
            stopped_at_fence: false,
            progress_m: 0.0,
            progress_at: Instant::ZERO,
            followed_at: Instant::ZERO,
            followed_place: Point::zeros(),
            reported_m: f32::NEG_INFINITY,
            returning: false,
            known_way: known_way::KnownWay::of_new_path(Instant::ZERO),
            evade_search: EvadeSearch::default(),
            evading: false,
            wait_distance_m: f32::INFINITY,
            halt_m: f32::INFINITY,
            back_to_m: None,
            no_better_place: false,
            trapped_since: None,
            ends_aside: false,
            lowest_ground_m: config.ground.map_or(f32::INFINITY, |ground| ground.low_m),
            low_height_m: libm::fminf(
                config.required_clearance_m - config.radius_m,
                MAX_LAND_HANDOVER_M,
            ),
            sent_acceleration: Point::zeros(),
        }
    }

    /// Sets other limits.
    pub fn set_limits<const V: usize>(&mut self, config: &Config<V>, autopilot: &AutopilotLimits) {
        let Self { track, leg_track, deconflict, .. } = Self::new(config, autopilot);
        (self.track, self.leg_track, self.deconflict) = (track, leg_track, deconflict);
        self.smoother.set_limits(MotionLimits::new(config, autopilot), config.geofence);
    }

    /// Clears the state of an earlier flight.
    pub fn reset(&mut self) {
        self.tracker = Tracker::default();
        self.phase = Phase::Hold;
        self.leg = None;
        self.waypoints = Algorithm2Waypoints::default();
        (self.on_path, self.returning, self.ends_aside) = (false, false, false);
        self.known_way = known_way::KnownWay::of_new_path(Instant::ZERO);
        self.reported_m = f32::NEG_INFINITY;
        self.advice = NO_ADVICE_YET;
        self.gates_open = 0;
        self.filter.reset();
    }

    /// Place of the reference on the path, metres; −∞ before the reference runs.
    pub fn along_m(&self) -> f32 {
        if self.on_path { self.tracker.along_m } else { f32::NEG_INFINITY }
    }

    /// One step of `dt_s`: new advice, new setpoint. Returns whether the setpoint is the one that
    /// the raw point requires; if not, the smoother held the last setpoint.
    pub fn step<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        dt_s: f32,
    ) -> bool {
        let position = scene.telemetry.position;
        self.unsent_s += dt_s;
        let advised_at_m = self.tracker.along_m;
        let asks =
            matches!(state, State::Scheduled | State::Follow | State::Blocked | State::Replanning);
        if let Some(plan) = scene.plan.filter(|_| asks) {
            let along_m = if self.on_path { self.tracker.along_m } else { -plan.climb_m };
            let own = OwnVehicle {
                rank: scene.rank,
                position,
                along_m,
                path: &plan.path,
                detours: scene.detours,
            };
            self.advice =
                deconflict::advise(&self.deconflict, &own, &plan.gates, neighbours.states_at(now));
            if self.on_path {
                self.advice.stop_within_m =
                    self.advice.stop_within_m.min((self.halt_m - along_m).max(0.0));
            }
        }
        if let Some(plan) = scene.plan {
            let next = plan.gates.get(self.gates_open);
            if next.is_some_and(|gate| neighbours.has_passed(gate, now)) {
                self.gates_open += 1;
            }
            let place = self.smoother.position();
            let along_m = self.tracker.along_m;
            self.setpoint_m = plan.path.project(&place, along_m, SETTLE_WINDOW_M).min(along_m);
            let along_m = if self.on_path { along_m } else { -plan.climb_m };
            self.stops_at_m = match state {
                // The safety filter continues checking the neighbour that stopped the vehicle.
                State::Follow | State::Blocked | State::Replanning => {
                    along_m + self.advice.stop_within_m.max(0.0)
                }
                _ => self.setpoint_m + self.smoother.stopping_distance_m(false),
            };
        }
        self.filter(state, scene, neighbours, now);
        let urgent = self.filter.is_stopping(now);
        let known = scene.telemetry.position_at.is_some();
        if !state.streams_setpoints() {
            self.smoother.stop();
            return true;
        }
        let kind = scene.telemetry.kind();
        let taken =
            matches!(state, State::PilotControl | State::Land | State::LandingHeld | State::Disarm)
                && scene.telemetry.custom_mode != kind.setpoint_mode();
        self.position_unknown |= !known || state == State::PositionLost;
        let flies = scene.telemetry.on_ground == Some(false);
        let taken_before = core::mem::replace(&mut self.autopilot_took_over, taken);
        if known && (taken || taken_before || !self.smoother.has_setpoint()) {
            // The autopilot does not follow, or nothing was sent: begin where the vehicle is, and
            // as it moves.
            if taken {
                self.smoother.follow_vehicle(position, self.unsent_s);
            } else if !self.smoother.has_setpoint() {
                self.smoother.resume_at(position, self.unsent_s);
            } else if flies {
                self.smoother.hold_with_velocity(&scene.telemetry.velocity);
            }
            self.forget_leg();
            self.position_unknown = false;
        }
        let sends = known && state != State::PositionLost;
        if !self.smoother.has_setpoint() || taken {
            self.guides_landing = false;
            self.sent_acceleration = Point::zeros();
            self.finish_step(sends);
            return true;
        }
        let up =
            state == State::Follow && self.phase == Phase::Descent && self.filter.climbs_back(now);
        let turns = self.phase == Phase::Descent && self.leg.is_some() && up != self.climbing_back;
        let leads = self.update_guided_landing(state, scene, now);
        let goes = known
            && !turns
            && (leads || matches!(state, State::Climb | State::Follow))
            && (!urgent || up);
        let mut advice = if state == State::Follow { self.advice } else { Advice::FREE };
        advice.speed_scale = advice.speed_scale.min(self.filter.speed_scale(now));
        let path = scene.plan.map(|plan| &plan.path);
        if let (Some(path), true) = (path, known && self.on_path && !self.is_algorithm2()) {
            self.evade(state, path, &mut advice, neighbours, now);
        }
        if self.leg.is_none() {
            self.climbing_back = up;
        }
        let wanted = goes || (self.back_to_m.is_some() && !urgent);
        let back_up = up && self.is_leg_done();
        let holds = (!wanted || back_up)
            && self.on_path
            && matches!(self.phase, Phase::Path | Phase::Join | Phase::Descent)
            && state.holds_place()
            && self.smoother.is_standing();
        let yields = self.filter.is_yielding() || state != State::Follow;
        let late_s = if holds { neighbours.max_message_delay_s() } else { 0.0 };
        self.hold_changed |= self.hold.step(holds, yields, late_s, now);
        let moves = wanted && !self.hold.is_binding(now);
        if !moves && self.smoother.is_standing() && !self.raw_point_at_rest {
            if let (Some(path), Phase::Path) = (path, self.phase) {
                let near_m = self.tracker.along_m;
                self.tracker.along_m =
                    nearest_arc_length_m(path, &self.smoother.position(), near_m, SETTLE_WINDOW_M);
            }
            self.smoother.forget_curve();
            self.forget_leg();
        }
        let share = self.lag_share(scene.telemetry, moves, now);
        let mut blocked = false;
        let dt_s = if self.smoother.resumes_from_last() { self.unsent_s } else { dt_s };
        // The place where the vehicle stops stays the same, however many raw points this step
        // takes.
        let stops_at_m = advised_at_m + advice.stop_within_m;
        self.stopped_at_fence &= !moves;
        for _ in 0..self.smoother.begin_step(ClockPace { speed_share: share, urgent }, dt_s) {
            if self.phase == Phase::Path && !self.is_algorithm2() {
                advice.stop_within_m = (stops_at_m - self.tracker.along_m).max(0.0);
            }
            let raw = match scene.plan {
                Some(plan) if moves => {
                    self.next_raw_point(state, scene, plan, &advice, neighbours, now, &mut blocked)
                }
                _ if matches!(state, State::Streaming | State::Engaging | State::Arming)
                    && known =>
                {
                    let away = position - self.smoother.raw_point();
                    let most = MAX_PAD_DRIFT_MPS * TICK_S;
                    let share = most / away.length().max(most);
                    self.smoother.raw_point() + away * share
                }
                Some(plan) if sends && !self.raw_point_at_rest => {
                    self.next_braked_raw_point(&plan.path)
                }
                _ => self.smoother.raw_point(),
            };
            self.smoother.push_raw_point(raw);
        }
        self.mark_trapped(blocked, now);
        let sound = self.smoother.make_setpoint();
        let correction = if flies && state != State::PilotControl && known {
            position_correction(
                &self.smoother.position(),
                &self.smoother.velocity(),
                scene.telemetry,
            )
        } else {
            Point::zeros()
        };
        let change = self.smoother.acceleration() + correction - self.sent_acceleration;
        let most = self.smoother.jerk_mps3(urgent) * dt_s;
        self.sent_acceleration += change * (most / change.length().max(most).max(1e-6));
        if self.tracker.along_m > self.progress_m + MIN_PROGRESS_M {
            self.progress_m = self.tracker.along_m;
            self.progress_at = now;
        }
        if scene.plan.is_some() && (self.on_path || self.phase == Phase::Climb) && known {
            self.reported_m = self.progress_m(state, scene);
        }
        self.finish_step(sends);
        sound
    }

    /// Ends a step: `sends` says whether its setpoint has a place.
    fn finish_step(&mut self, sends: bool) {
        if sends && self.smoother.has_setpoint() {
            self.smoother.mark_sent();
            self.unsent_s = 0.0;
        }
    }

    /// The vehicle that the safety filter stops for at this moment; 0 for none. Nothing changes by
    /// the call.
    pub fn query_filter<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) -> u8 {
        let before = self.filter;
        self.filter(state, scene, neighbours, now);
        let blocker = self.filter.blocker();
        self.filter = before;
        blocker
    }

    /// Whether waypoints and the end of the path are those of the paper.
    fn is_algorithm2(&self) -> bool {
        self.deconflict.method == Method::Algorithm2
    }

    /// Whether it leads the vehicle down.
    pub(crate) fn is_descending(&self) -> bool {
        self.phase == Phase::Descent
    }

    /// Since when it has been below a vehicle that lands, with no way out.
    pub(crate) fn trapped_since(&self) -> Option<Instant> {
        self.trapped_since
    }

    /// The time in a trap counts from now on.
    pub(crate) fn reset_trap_timer(&mut self) {
        self.trapped_since = None;
    }

    /// Time since the reference last moved on.
    pub fn last_progress_at(&self) -> Instant {
        self.progress_at
    }
}
