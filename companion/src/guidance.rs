//! Guidance makes the setpoints. From mission state, path, neighbours and the autopilot's position
//! it moves a raw point; its smoother turns the raw point into a setpoint that can be flown.
//!
//! A flight has phases: the climb straight up from where the vehicle stands, the join to the path's
//! start, the path, the descent. The phase is guidance's own state. A pause, a lost position or a
//! pilot interrupts the flight; afterwards it continues in the same phase. A stop slows the
//! smoother's clock, so the raw point stays where it is. Once the setpoint stands, the raw point is
//! set back to it, and the flight continues by a straight leg to where the phase was left.

mod acknowledged_path;
mod advice;
pub(crate) mod evade;
mod fence;
pub(crate) mod filter;
mod follower;
mod hold;
mod lag;
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
mod stops;
mod waypoints;

use planner_core::flight::Path;
use planner_core::track::deconflict::{Advice, DeconflictConfig};
use planner_core::track::{self, ReferenceState, TrackConfig};
use planner_core::{Length, Point};

use self::filter::SafetyFilter;
use self::hold::{HOLD_AFTER_IF_FIRST, HOLD_AFTER_IF_YIELDING, Hold};
use self::phase::Phase;
use self::setpoint::correction_acceleration;
use self::smoother::{ClockPace, SetpointSmoother, TICK_S};
use self::waypoints::Algorithm2Waypoints;
use crate::autopilot::limits::AutopilotLimits;
use crate::config::Config;
use crate::config::limits::{GuidanceLimits, MotionLimits, Urgency};
use crate::guidance::evade::{EvadeSearch, StepBack};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};

pub use self::scene::{GuidanceInputs, PathSource};
pub use self::setpoint::Setpoint;
pub use self::smoother::SetpointStats;

/// A vehicle this near to its reference, its setpoint or the end of its path counts as there,
/// metres. At the top of a climb it may be up to twice as far from its setpoint.
const ARRIVED_WITHIN_M: f32 = 0.35;
/// Speed below which the vehicle counts as standing at the end of its path, m/s.
const AT_REST_MPS: f32 = 0.5;
/// Speed below which the setpoint counts as standing, m/s.
const STANDING_SETPOINT_MPS: f32 = 0.05;
/// A climb is done within this vertical distance of its top, metres.
const CLIMB_DONE_WITHIN_M: f32 = 0.12;
/// A guided descent is done within this height above its lower end, metres.
const DESCENT_DONE_WITHIN_M: f32 = 0.2;
/// Time for which the setpoint rests at the end of a guided descent before the autopilot's landing
/// mode takes over, even if the vehicle has not reached that point.
const LAND_MODE_AFTER_REST: Duration = Duration::from_secs(2);
/// Time without progress of a guided landing after which the autopilot's own landing takes over.
const GUIDED_LANDING_STALL_TIMEOUT: Duration = Duration::from_secs(4);
/// Greatest distance of the setpoint ahead of the vehicle in a climb, a descent or a join, metres.
const MAX_LEG_LEAD_M: f32 = 1.5;
/// Greatest speed with which the setpoint of a vehicle on its pad follows the position estimate
/// before the take-off, m/s.
const MAX_PAD_DRIFT_MPS: f32 = 0.2;
/// Length of path searched, forward and back from the reference, for the point nearest to a vehicle
/// after a pilot has flown it, metres.
pub const REJOIN_WINDOW_M: f32 = 5.0;
/// Length of path searched, forward and back from the reference, for the point nearest to a vehicle
/// whose position was lost, metres: it stopped within its braking distance of the reference, so a
/// position further along the path is not believed.
pub const REJOIN_WINDOW_AFTER_LOSS_M: f32 = 2.5;
/// Length of path searched ahead of a reference that stepped back for the point nearest to the
/// setpoint, metres: at the 1.5 m/s of a step back the setpoint stands up to 2 m ahead of it. By
/// Algorithm 2 also searched, forward and back, for the point nearest to the raw point.
const REFERENCE_RESET_WINDOW_M: f32 = 3.0;
/// A nearest point this close to an end of the searched path counts as not found, metres.
const WINDOW_EDGE_M: f32 = 0.01;
/// A setpoint within this distance of the reference along the path has reached it, metres: after
/// the averages a setpoint that stands is still millimetres off.
const SETPOINT_AT_REFERENCE_M: f32 = 0.05;
/// Advance of the reference along the path that counts as progress, metres.
const MIN_PROGRESS_M: f32 = 0.25;
/// Distance before the geofence at which the raw point stops, metres: the setpoint may deviate by
/// this much from the path.
const FENCE_MARGIN_M: f32 = 0.05;
/// Bisection steps that find where the path leaves the geofence: to 1 cm in the 3 m of a stop.
const FENCE_HALVINGS: usize = 8;
/// Upper bound of `final_descent_height_m`, the height above the ground from which a guided descent
/// is slow, or an autopilot that is not led to the ground lands by itself, metres; the margin to
/// walls is another upper bound.
const MAX_FINAL_DESCENT_HEIGHT_M: f32 = 1.2;
/// Greatest speed of a guided descent near the ground, m/s: that of ArduCopter's landing.
const TOUCHDOWN_MPS: f32 = 0.5;
/// A leg shorter than this counts as flown, metres.
const MIN_LEG_M: f32 = 1e-3;

/// Advice before the neighbours are first evaluated: stand.
const NO_ADVICE_YET: Advice = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for_id: 0 };

/// State of guidance: flight phase, raw point, smoother and safety filter.
#[derive(Clone, Debug)]
pub struct Guidance {
    /// Limits of the reference along the path.
    track: TrackConfig,
    /// Limits of the reference along the legs of climb, join and descent.
    leg_track: TrackConfig,
    deconflict: DeconflictConfig,
    /// Speed of the mission's fastest vehicle, m/s.
    fastest_vehicle_mps: f32,
    /// Greatest horizontal distance from its start at which the vehicle takes off, metres.
    start_tolerance_m: f32,
    /// Share of the nominal speed that the error bound of the position estimate allows; 0 stops.
    pub estimate_speed_share: f32,
    /// The smoother, which makes setpoints of raw points.
    pub smoother: SetpointSmoother,
    phase: Phase,
    /// The reference on the path: its arc length and speed.
    reference: ReferenceState,
    /// The straight leg of a climb, a join or a descent; `None` until the next step makes it, from
    /// where the setpoint stands.
    leg: Option<Path<2>>,
    /// The reference on `leg`.
    leg_reference: ReferenceState,
    /// The waypoint that the vehicle flies to by Algorithm 2 of the paper.
    waypoints: Algorithm2Waypoints,
    /// Whether the raw point was set back to where the setpoint stands.
    raw_point_at_setpoint: bool,
    /// Whether the position was lost, so that setpoints carried no place.
    position_was_lost: bool,
    /// Whether setpoints lead to a place: the position was known in the last step.
    setpoint_has_position: bool,
    /// Whether in the last step a pilot or the autopilot flew, and setpoints followed the vehicle.
    setpoint_followed_vehicle: bool,
    /// Time since a setpoint with a place was sent, seconds.
    since_sent_s: f32,
    /// The advice of the last step: speed scale, distance to the stop, vehicle waited for.
    pub advice: Advice,
    /// How much later than by its schedule the vehicle departs.
    departs_later_by: Duration,
    /// Number of gates of the plan, from the first on, that have opened; they stay open.
    open_gate_count: usize,
    /// Whether the path was begun ([`Self::start_following`]): only then `reference` counts.
    has_begun_path: bool,
    /// Whether its path begins above its pad, so that it may join it from where it took off.
    path_begins_above_pad: bool,
    /// Whether it lands where a pilot, the autopilot or a lost position left it, off its path.
    lands_off_path: bool,
    /// Lead of the setpoint over the vehicle at which the setpoint waits, metres.
    max_lead_m: f32,
    /// Arc length of the setpoint along the path, metres.
    pub(crate) setpoint_along_m: f32,
    /// Arc length where the vehicle will stop by advice or braking, without the filter, metres.
    pub(crate) stops_at_m: f32,
    /// Where along the path the reference could have stopped in the last step, metres.
    brakes_to_m: f32,
    pub(crate) filter: SafetyFilter,
    /// Whether the vehicle reports that it holds its place, so that others may pass.
    pub(crate) hold: Hold,
    /// Whether the hold has begun or ended, so that an intent is to be sent at once.
    hold_changed: bool,
    /// Whether the leg of the descent leads back up.
    climbing_back: bool,
    /// Whether setpoints lead a landing straight down, before the autopilot's landing.
    guides_landing: bool,
    /// Whether the raw point stops because the path ahead leaves the geofence.
    stopped_at_fence: bool,
    /// Arc length at which the reference last made progress along the path, metres.
    last_progress_m: f32,
    /// When the reference last made progress, along the path or in a descent.
    last_progress_at: Instant,
    /// When the vehicle was last at its setpoint, or the setpoint last advanced.
    followed_or_advanced_at: Instant,
    /// Place of the setpoint at `followed_or_advanced_at`.
    setpoint_when_followed: Point,
    /// Progress last reported to neighbours on this path, metres; −∞ for none.
    last_reported_progress_m: f32,
    /// Whether the vehicle flies back along its path, to the path's start.
    pub returning: bool,
    /// The part of its path that the other vehicles have acknowledged.
    acknowledged_path: acknowledged_path::AcknowledgedPath,
    evade_search: EvadeSearch,
    /// Whether the vehicle waits at an earlier place of its path than advised, or flies back to
    /// one: out of the column below a vehicle that descends; in `SwarmLinkLost` also from above
    /// vehicles that may lie below, or back to where others expect it.
    pub evading: bool,
    /// Distance ahead on the path at which the vehicle stops, by the deconfliction's advice or to
    /// evade, metres.
    stop_ahead_m: f32,
    /// Place along the path where the vehicle holds for a division, metres; ∞ for none.
    division_hold_m: f32,
    /// Place along the path to which the vehicle steps back to evade, metres; `None` for none.
    step_back_to_m: Option<f32>,
    /// Whether no place back along the path is outside the columns of vehicles that descend.
    no_evade_place: bool,
    /// Since when the vehicle has been below one that descends, unable to leave along its path.
    trapped_below_since: Option<Instant>,
    /// Whether the path ends aside or back on the plan's path: then no descent begins at its end.
    pub ends_away_from_goal: bool,
    /// Height above the ground from which a guided descent is slow, or an autopilot that is not led
    /// to the ground lands by itself, metres.
    final_descent_height_m: f32,
    /// Height of the lowest ground between pads, ENU up, metres; ∞ if only that of pads is known.
    lowest_ground_m: f32,
    /// Acceleration sent last: the setpoint's plus the correction towards it, with limited jerk.
    sent_acceleration: Point,
}

impl Guidance {
    /// Guidance before any plan, with the limits of the settings and of the autopilot.
    pub fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let smoother = SetpointSmoother::new(MotionLimits::new(config, autopilot), config.geofence);
        let GuidanceLimits { track, leg_track, deconflict, fastest_vehicle_mps } =
            GuidanceLimits::new(config, autopilot);
        Self {
            track,
            leg_track,
            deconflict,
            fastest_vehicle_mps,
            start_tolerance_m: config.start_tolerance_m,
            estimate_speed_share: 1.0,
            smoother,
            phase: Phase::Hold,
            reference: ReferenceState::default(),
            leg: None,
            leg_reference: ReferenceState::default(),
            waypoints: Algorithm2Waypoints::default(),
            raw_point_at_setpoint: true,
            position_was_lost: false,
            setpoint_has_position: false,
            setpoint_followed_vehicle: false,
            since_sent_s: 0.0,
            advice: NO_ADVICE_YET,
            departs_later_by: Duration::default(),
            open_gate_count: 0,
            has_begun_path: false,
            path_begins_above_pad: false,
            lands_off_path: false,
            max_lead_m: MAX_LEG_LEAD_M,
            setpoint_along_m: 0.0,
            stops_at_m: f32::NEG_INFINITY,
            brakes_to_m: f32::NEG_INFINITY,
            filter: SafetyFilter::default(),
            hold: Hold::default(),
            hold_changed: false,
            climbing_back: false,
            guides_landing: false,
            stopped_at_fence: false,
            last_progress_m: 0.0,
            last_progress_at: Instant::ZERO,
            followed_or_advanced_at: Instant::ZERO,
            setpoint_when_followed: Point::zeros(),
            last_reported_progress_m: f32::NEG_INFINITY,
            returning: false,
            acknowledged_path: acknowledged_path::AcknowledgedPath::of_new_path(Instant::ZERO),
            evade_search: EvadeSearch::default(),
            evading: false,
            stop_ahead_m: f32::INFINITY,
            division_hold_m: f32::INFINITY,
            step_back_to_m: None,
            no_evade_place: false,
            trapped_below_since: None,
            ends_away_from_goal: false,
            lowest_ground_m: config.ground.map_or(f32::INFINITY, |ground| ground.low_m),
            final_descent_height_m: libm::fminf(
                config.required_clearance_m - config.radius_m,
                MAX_FINAL_DESCENT_HEIGHT_M,
            ),
            sent_acceleration: Point::zeros(),
        }
    }

    /// Computes all limits again, from the settings and the autopilot's limits.
    pub fn set_limits<const V: usize>(&mut self, config: &Config<V>, autopilot: &AutopilotLimits) {
        let Self { track, leg_track, deconflict, fastest_vehicle_mps, .. } =
            Self::new(config, autopilot);
        (self.track, self.leg_track) = (track, leg_track);
        (self.deconflict, self.fastest_vehicle_mps) = (deconflict, fastest_vehicle_mps);
        self.start_tolerance_m = config.start_tolerance_m;
        self.smoother.set_limits(MotionLimits::new(config, autopilot), config.geofence);
    }

    /// Forgets the flight before: phase, leg, path progress, advice and filter. The setpoint stays.
    pub fn reset(&mut self) {
        (self.reference, self.setpoint_along_m) = (ReferenceState::default(), 0.0);
        self.phase = Phase::Hold;
        self.leg = None;
        self.waypoints = Algorithm2Waypoints::default();
        (self.has_begun_path, self.returning, self.ends_away_from_goal) = (false, false, false);
        self.acknowledged_path = acknowledged_path::AcknowledgedPath::of_new_path(Instant::ZERO);
        (self.last_reported_progress_m, self.brakes_to_m) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        self.advice = NO_ADVICE_YET;
        self.open_gate_count = 0;
        self.filter.reset();
    }

    /// Arc length of the reference along the path, metres; −∞ before the path is begun.
    pub fn reference_along_m(&self) -> f32 {
        if self.has_begun_path { self.reference.along_m } else { f32::NEG_INFINITY }
    }

    /// One step of `dt_s` seconds: advice, safety filter, raw points, setpoint. Returns false where
    /// a raw point was not sound, so that the smoother held.
    pub fn step<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        dt_s: f32,
    ) -> bool {
        let position = scene.telemetry.position;
        self.since_sent_s += dt_s;
        let advised_at_m = self.reference.along_m;
        self.update_advice(state, scene, neighbours, now);
        if let Some(plan) = scene.plan {
            let next = plan.gates.get(self.open_gate_count);
            if next.is_some_and(|gate| neighbours.is_open_for_good(gate, now)) {
                self.open_gate_count += 1;
            }
            self.update_setpoint_along_m(&plan.path, dt_s);
            let along_m = if self.has_begun_path { self.reference.along_m } else { -plan.climb_m };
            self.stops_at_m = match state.follows_path_or_is_blocked() {
                // Never less than the braking distance, even if a nearer stop is advised: the
                // filter checks up to where the vehicle really stops.
                true => {
                    let least_m =
                        track::braking_distance_m(&self.track, &plan.path, &self.reference);
                    self.brakes_to_m = along_m + least_m;
                    along_m + self.advice.stop_within_m.max(least_m)
                }
                false => self.setpoint_along_m + self.smoother.stop_distance_m(Urgency::Smooth),
            };
        }
        self.step_filter(state, scene, neighbours, now);
        let urgency = self.filter.urgency(now);
        let known = scene.is_position_usable(state, now);
        let leads = known && state != State::PositionLost;
        let led_before = core::mem::replace(&mut self.setpoint_has_position, leads);
        if !state.streams_setpoints() {
            self.smoother.end_stream();
            self.forget_waiting();
            return true;
        }
        let kind = scene.telemetry.kind();
        let taken = (state.lands_or_disarms() || state == State::PilotControl)
            && scene.telemetry.custom_mode != kind.setpoint_mode();
        self.position_was_lost |= !known || state == State::PositionLost;
        let flies = scene.telemetry.last_reported_flight();
        let taken_before = core::mem::replace(&mut self.setpoint_followed_vehicle, taken);
        if taken && !known {
            // The velocity of the last setpoint is not the vehicle's any more.
            self.smoother.end_stream();
        } else if leads && !led_before && state.needs_fresh_position() {
            // Known again, the position may be far from the last setpoint.
            self.smoother.resume_at(position, self.since_sent_s);
            self.forget_leg();
        }
        if known && (taken || taken_before || !self.smoother.has_setpoint()) {
            // Another autopilot mode flies or just flew, or there is no setpoint yet: the setpoint
            // begins at the vehicle's position, or takes its velocity.
            if taken {
                self.smoother.follow_vehicle(position, self.since_sent_s);
            } else if !self.smoother.has_setpoint() {
                self.smoother.resume_at(position, self.since_sent_s);
            } else if flies {
                self.smoother.brake_from_velocity(&scene.telemetry.velocity);
            }
            self.forget_leg();
            self.position_was_lost = false;
        }
        let sends = leads;
        if !self.smoother.has_setpoint() || taken {
            self.guides_landing = false;
            self.sent_acceleration = Point::zeros();
            self.forget_waiting();
            if sends {
                self.note_place_sent();
            }
            return true;
        }
        let up =
            state == State::Follow && self.phase == Phase::Descent && self.filter.climbs_back(now);
        let turns = self.phase == Phase::Descent && self.leg.is_some() && up != self.climbing_back;
        let leads = self.update_guided_landing(state, scene, now);
        let goes = known
            && !turns
            && (leads || state.setpoint_advances())
            && (urgency == Urgency::Smooth || up);
        let mut advice = if state == State::Follow { self.advice } else { Advice::FREE };
        advice.speed_scale = advice.speed_scale.min(self.filter.speed_scale(now));
        let path = scene.plan.map(|plan| &plan.path);
        if let (Some(path), true) = (path, known && self.has_begun_path && !self.is_algorithm2()) {
            self.update_evasion(state, path, &mut advice, neighbours, now);
        }
        if self.leg.is_none() {
            self.climbing_back = up;
        }
        let wanted = goes || (self.step_back_to_m.is_some() && urgency == Urgency::Smooth);
        let back_up = up && self.is_leg_done();
        let holds = (!wanted || back_up)
            && self.has_begun_path
            && matches!(self.phase, Phase::Path | Phase::Join | Phase::Descent)
            && state.is_on_path()
            && self.smoother.is_standing();
        let yields = self.filter.is_yielding() || state != State::Follow;
        let patience = if yields { HOLD_AFTER_IF_YIELDING } else { HOLD_AFTER_IF_FIRST };
        self.hold_changed |= match holds {
            true => self.hold.note_standing(patience, neighbours.max_message_delay_s(), now),
            false => self.hold.end(),
        };
        let moves = wanted && !self.hold.is_binding(now);
        if !moves && self.smoother.is_standing() && !self.raw_point_at_setpoint {
            if let (Some(path), Phase::Path) = (path, self.phase) {
                self.reset_reference_to_setpoint(path);
            }
            self.smoother.restart_curve_at_setpoint();
            self.forget_leg();
        }
        let lag_speed_share = self.lag_speed_share(scene.telemetry, now);
        let share = if moves { lag_speed_share } else { self.standing_speed_share() };
        let mut back = StepBack::Free;
        let dt_s = if self.smoother.makes_up_for_gap() { self.since_sent_s } else { dt_s };
        // Advice was computed once for this step: its stop stays at one place while the raw points
        // move on.
        let stops_at_m = advised_at_m + advice.stop_within_m;
        self.stopped_at_fence &= !moves;
        for _ in 0..self.smoother.begin_step(ClockPace { speed_share: share, urgency }, dt_s) {
            if self.phase == Phase::Path && !self.is_algorithm2() {
                advice.stop_within_m = (stops_at_m - self.reference.along_m).max(0.0);
            }
            let raw = match scene.plan {
                Some(plan) if moves => {
                    self.next_raw_point(state, scene, plan, &advice, neighbours, now, &mut back)
                }
                _ if state.prepares_take_off() && known => {
                    let away = position - self.smoother.raw_point();
                    let most = MAX_PAD_DRIFT_MPS * TICK_S;
                    let share = most / away.length().max(most);
                    self.smoother.raw_point() + away * share
                }
                Some(plan) if sends && !self.raw_point_at_setpoint => {
                    self.next_braked_raw_point(&plan.path)
                }
                _ => self.smoother.raw_point(),
            };
            self.smoother.push_raw_point(raw);
        }
        self.update_trapped(back, now);
        let sound = self.smoother.make_setpoint();
        let correction = if flies && state != State::PilotControl && known {
            correction_acceleration(
                &self.smoother.position(),
                &self.smoother.velocity(),
                scene.telemetry,
            )
        } else {
            Point::zeros()
        };
        let change = self.smoother.acceleration() + correction - self.sent_acceleration;
        let most = self.smoother.max_jerk_mps3(urgency) * dt_s;
        self.sent_acceleration += change * (most / change.length().max(most).max(1e-6));
        if self.reference.along_m > self.last_progress_m + MIN_PROGRESS_M {
            self.last_progress_m = self.reference.along_m;
            self.last_progress_at = now;
        }
        if scene.plan.is_some() && (self.has_begun_path || self.phase == Phase::Climb) && known {
            self.note_reported_progress(state, scene);
        }
        if sends {
            self.note_place_sent();
        }
        sound
    }

    /// System id of the neighbour that the safety filter stops for now; 0 for none. The filter's
    /// state stays as it was.
    pub fn query_filter_blocker<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) -> u8 {
        let before = self.filter;
        self.step_filter(state, scene, neighbours, now);
        let blocker = self.filter.blocker_id();
        self.filter = before;
        blocker
    }
}
