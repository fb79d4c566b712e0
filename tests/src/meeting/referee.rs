//! The referee of a meeting. It computes the sets of the safety filter by their definition, from
//! the messages that a vehicle received and from true motion, without any of the companion's code.
//!
//! - *Own set*: 0.1 s at the present velocity, then a stop; the setpoint is ahead by the vehicle's
//!   lag. In a landing the column to the floor.
//! - *A neighbour's set*: if heard within 1 s, the points that it reports from its last position
//!   on, as far as its speed takes it in the message's age + 0.1 s and in a stop after that; if it
//!   is off these points, along its velocity, widened by ½·a·age². If heard longer ago, a ball.
//!   While it climbs, descends or lands, also the column to the floor.
//!
//! A violation of the safety distance is a failure if a stop of each vehicle, begun at the first
//! step at which its sets came too near, would have kept the distance.

use companion::link::intent::{GROUNDED, Intent, LANDED};
use planner_core::Point;

use super::autopilot::STEP_S;
use super::scene::{CRUISE_MPS, SAFETY_DISTANCE_M};

/// Deceleration of a stop along a path, m/s².
const STOP_ACCEL_MPS2: f32 = 1.5;
/// Jerk of a stop by the safety filter, m/s³.
const STOP_JERK_MPS3: f32 = 8.0;
/// Time by which a vehicle lags behind its setpoint, seconds.
const LAG_S: f32 = 0.35;
/// Greatest age at which a neighbour's reported points are believed, seconds.
const MAX_POINTS_AGE_S: f32 = 1.0;
/// Age up to which the ball of a silent neighbour grows, seconds.
const BALL_GROWS_UNTIL_S: f32 = 3.0;
/// Steps for which sets may be apart within one approach.
const MAX_GAP_STEPS: usize = 40;
/// Margin, metres: a stop counts as one that would have kept the safety distance only if it keeps
/// that plus this margin.
const KEPT_MARGIN_M: f32 = 0.05;

/// What a vehicle last received from another one.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// Position, velocity, the sender's clock (ms), and when it was received, seconds.
    pub position: Option<(Point, Point, u32, f32)>,
    /// The last intent received.
    pub intent: Option<Intent>,
}

/// Where a vehicle can be: segments widened by a radius.
#[derive(Clone, Debug, Default)]
pub struct ReachableSet {
    /// Ends of each segment, ENU metres.
    segments: Vec<(Point, Point)>,
    /// Distance by which segments are widened, metres.
    radius_m: f32,
}

/// Distance that a vehicle covers from this speed: `before_s` at that speed, then a stop, metres.
fn stop_distance_m(speed: f32, before_s: f32) -> f32 {
    speed * before_s
        + speed * speed / (2.0 * STOP_ACCEL_MPS2)
        + speed * STOP_ACCEL_MPS2 / (2.0 * STOP_JERK_MPS3)
}

/// Distance between two segments, metres.
pub fn distance(p: (Point, Point), q: (Point, Point)) -> f32 {
    // Alternating projections: the distance is convex, so they converge fast enough on segments.
    let onto = |at: Point, (from, to): (Point, Point)| {
        let along = to - from;
        let length_sq = along.norm_squared();
        let share = if length_sq > 0.0 {
            ((at - from).dot(&along) / length_sq).clamp(0.0, 1.0)
        } else {
            0.0
        };
        from + along * share
    };
    let ends = [p.0, p.1].map(|end| (end - onto(end, q)).norm());
    let others = [q.0, q.1].map(|end| (end - onto(end, p)).norm());
    let mut least = ends[0].min(ends[1]).min(others[0]).min(others[1]);
    let mut at = (p.0 + p.1) * 0.5;
    for _ in 0..12 {
        at = onto(onto(at, q), p);
        least = least.min((at - onto(at, q)).norm());
    }
    least
}

/// Where a neighbour can be, by what was received from it; `None` without a position.
pub fn neighbour_set(heard: &Heard, now_s: f32, floor_z: f32) -> Option<ReachableSet> {
    let (position, velocity, _, at_s) = heard.position?;
    let age_s = now_s - at_s;
    if age_s > MAX_POINTS_AGE_S {
        let radius_m = CRUISE_MPS * age_s.min(BALL_GROWS_UNTIL_S);
        return Some(ReachableSet { segments: vec![(position, position)], radius_m });
    }
    let intent = heard.intent.as_ref();
    if intent.is_some_and(|i| i.flags & (GROUNDED | LANDED) != 0) {
        return Some(ReachableSet { segments: vec![(position, position)], radius_m: 0.0 });
    }
    let speed = velocity.norm();
    let mut left_m = stop_distance_m(speed, age_s + 0.1);
    let mut set = ReachableSet { segments: vec![(position, position)], radius_m: 0.0 };
    let next = intent.and_then(|i| i.points.iter().find(|p| (*p - position).norm() > 0.05));
    let on_points = next.is_some_and(|next| {
        speed < 0.3 || velocity.dot(&(next - position).normalize()) > 0.7 * speed
    });
    if let (true, Some(intent)) = (on_points, intent) {
        let mut from = position;
        for to in &intent.points {
            let leg_m = (to - from).norm();
            if leg_m < 1e-3 {
                continue;
            }
            let end = from + (to - from) * (left_m / leg_m).min(1.0);
            set.segments.push((from, end));
            left_m -= leg_m;
            from = *to;
            if left_m <= 0.0 {
                break;
            }
        }
    } else if speed > 1e-3 {
        set.segments.push((position, position + velocity * (left_m / speed)));
        set.radius_m = 0.5 * STOP_ACCEL_MPS2 * age_s * age_s;
    }
    if velocity.z < -0.2 || intent.is_some_and(|i| i.may_come_down) {
        set.segments.push((position, Point::new(position.x, position.y, floor_z.min(position.z))));
    }
    Some(set)
}

/// Where a vehicle that lands can be.
fn landing_set(position: Point, floor_z: f32) -> ReachableSet {
    let floor = Point::new(position.x, position.y, floor_z.min(position.z));
    ReachableSet { segments: vec![(position, position), (position, floor)], radius_m: 0.0 }
}

/// Where a vehicle that begins to stop now can be.
fn stopping_set(position: Point, velocity: Point) -> ReachableSet {
    let speed = velocity.norm();
    let mut segments = vec![(position, position)];
    if speed > 1e-3 {
        segments
            .push((position, position + velocity * (stop_distance_m(speed, 0.1 + LAG_S) / speed)));
    }
    ReachableSet { segments, radius_m: 0.0 }
}

impl ReachableSet {
    /// Distance to another set, metres.
    pub fn distance(&self, other: &Self) -> f32 {
        let pairs = self.segments.iter().flat_map(|p| other.segments.iter().map(move |q| (*p, *q)));
        pairs.map(|(p, q)| distance(p, q)).fold(f32::INFINITY, f32::min)
            - self.radius_m
            - other.radius_m
    }
}

/// What the referee sees of a vehicle at one step.
#[derive(Clone, Copy, Debug)]
pub struct VehicleState {
    /// True position, ENU metres.
    pub position: Point,
    /// True velocity, ENU m/s.
    pub velocity: Point,
    /// Whether the vehicle is off the ground.
    pub airborne: bool,
    /// Whether its companion controls it, and so could stop it.
    pub companion_controls: bool,
    /// Whether its companion lands it: by the autopilot's landing mode, or by setpoints.
    pub lands_on_command: bool,
    /// Whether it has heard no other vehicle for so long that it has to land where it is.
    pub deaf: bool,
}

/// An approach of two vehicles below the safety distance.
#[derive(Clone, Copy, Debug)]
pub struct Violation {
    /// Indices of both vehicles.
    pub pair: (usize, usize),
    /// When the vehicles were nearest, seconds.
    pub at_s: f32,
    /// Their distance at that time, metres.
    pub min_distance_m: f32,
    /// When each vehicle's own set first came too near the other's, by what it had received, in
    /// this approach, seconds; `None`: never.
    pub sets_near_since_s: [Option<f32>; 2],
    /// Smallest distance if each vehicle had stopped from its `sets_near_since_s` on, metres.
    pub distance_if_stopped_m: f32,
}

impl Violation {
    /// Whether stops would have kept the safety distance, so that the filter failed.
    pub fn is_failure(&self) -> bool {
        self.distance_if_stopped_m >= SAFETY_DISTANCE_M + KEPT_MARGIN_M
    }
}

/// First and last step at which one vehicle's own reachable set was too near that of another one.
#[derive(Clone, Copy, Debug, Default)]
struct Approach {
    first_step: usize,
    last_step: usize,
}

/// Watches and judges a meeting.
#[derive(Debug)]
pub struct MeetingReferee {
    vehicle_count: usize,
    /// State of each vehicle at each step.
    tracks: Vec<Vec<VehicleState>>,
    /// The latest approach of vehicle a to b, at index a · `vehicle_count` + b.
    approaches: Vec<Option<Approach>>,
    /// For each pair a < b (index a · `vehicle_count` + b) that is too near: the step from which
    /// each vehicle's own set was too near the other's, if it was; the step at which the pair was
    /// nearest; and that distance.
    ongoing: Vec<Option<OngoingViolation>>,
    /// Approaches below the safety distance that have ended.
    pub violations: Vec<Violation>,
    /// For each pair a < b, at index a · `vehicle_count` + b: whether they touch.
    touching: Vec<bool>,
    /// Touches: time in seconds, index of the vehicle that moved toward the other one, index of the
    /// other one, distance in metres.
    pub touches: Vec<(f32, usize, usize, f32)>,
    /// Touches of a vehicle that was carried off unheard: no message places it there.
    pub unforeseen_touches: usize,
    /// Smallest distance between two vehicles, not both on the ground, metres.
    pub min_distance_m: f32,
}

/// A pair that is too near, as `MeetingReferee::ongoing` has it.
#[derive(Clone, Copy, Debug)]
struct OngoingViolation {
    /// Step from which each vehicle's own reachable set was too near the other's; `None` if it was
    /// not.
    sets_near_since: [Option<usize>; 2],
    /// Step at which the pair was nearest.
    nearest_step: usize,
    /// Distance of the centres then, metres.
    min_distance_m: f32,
}

/// Distance of centres below which two vehicles touch, metres: twice the hull's radius.
pub const TOUCH_M: f32 = 0.6;
/// Closing speed below which a vehicle does not count as moving toward the other, m/s.
const MIN_CLOSING_MPS: f32 = 0.15;
/// Distance beyond the safety distance at which an approach ends, metres.
const APPROACH_ENDS_M: f32 = 0.1;

impl MeetingReferee {
    /// A referee of `count` vehicles.
    pub fn new(count: usize) -> Self {
        Self {
            vehicle_count: count,
            tracks: vec![Vec::new(); count],
            approaches: vec![None; count * count],
            ongoing: vec![None; count * count],
            violations: Vec::new(),
            touching: vec![false; count * count],
            touches: Vec::new(),
            unforeseen_touches: 0,
            min_distance_m: f32::INFINITY,
        }
    }

    /// Judges one step; `heard(a, b)` is what vehicle a received from b. Sets are judged at every
    /// second step.
    pub fn observe(
        &mut self,
        seen: &[VehicleState],
        heard: impl Fn(usize, usize) -> Heard,
        floor_z: impl Fn(&Point) -> f32,
    ) {
        let step = self.tracks[0].len();
        self.tracks.iter_mut().zip(seen).for_each(|(track, seen)| track.push(*seen));
        let now_s = step as f32 * STEP_S;
        for a in 0..self.vehicle_count {
            for b in 0..self.vehicle_count {
                if a == b {
                    continue;
                }
                if step.is_multiple_of(2) && seen[a].airborne && seen[a].companion_controls {
                    self.judge_sets(step, now_s, (a, b), &seen[a], &heard(a, b), &floor_z);
                }
                if a < b {
                    // A vehicle that its pilot or autopilot carries off unheard is outside the ball
                    // in which others assume a silent vehicle.
                    let carried = |from: usize, to: usize| {
                        heard(from, to).position.is_some_and(|(place, _, _, at_s)| {
                            now_s - at_s > BALL_GROWS_UNTIL_S
                                && (place - seen[to].position).norm()
                                    > CRUISE_MPS * BALL_GROWS_UNTIL_S
                        })
                    };
                    self.judge_distance(step, (a, b), seen, carried);
                }
            }
        }
    }

    /// Notes if the own set of vehicle a is too near to the set of b, by what a heard from b.
    fn judge_sets(
        &mut self,
        step: usize,
        now_s: f32,
        (a, b): (usize, usize),
        own: &VehicleState,
        heard: &Heard,
        floor_z: &impl Fn(&Point) -> f32,
    ) {
        let Some((position, ..)) = heard.position else { return };
        // Sets reach less far than this distance.
        if (position - own.position).xy().norm() > 15.0 {
            return;
        }
        let Some(theirs) = neighbour_set(heard, now_s, floor_z(&position)) else { return };
        let ours = if own.lands_on_command {
            landing_set(own.position, floor_z(&own.position))
        } else {
            stopping_set(own.position, own.velocity)
        };
        if ours.distance(&theirs) < SAFETY_DISTANCE_M {
            let approach = &mut self.approaches[a * self.vehicle_count + b];
            match approach {
                Some(known) if step - known.last_step <= MAX_GAP_STEPS => known.last_step = step,
                _ => *approach = Some(Approach { first_step: step, last_step: step }),
            }
        }
    }

    /// Notes violations of the safety distance and touches of a pair, by true positions. `carried`
    /// says whether the second vehicle was carried off unheard by the first.
    fn judge_distance(
        &mut self,
        step: usize,
        (a, b): (usize, usize),
        seen: &[VehicleState],
        carried: impl Fn(usize, usize) -> bool,
    ) {
        let at = a * self.vehicle_count + b;
        if !seen[a].airborne && !seen[b].airborne {
            self.end_violation(a, b);
            self.touching[at] = false;
            return;
        }
        let apart = seen[b].position - seen[a].position;
        let apart_m = apart.norm();
        self.min_distance_m = self.min_distance_m.min(apart_m);
        if apart_m < SAFETY_DISTANCE_M && self.ongoing[at].is_none() {
            let warned = |from: usize, to: usize| {
                let known = self.approaches[from * self.vehicle_count + to];
                known
                    .filter(|known| step - known.last_step <= MAX_GAP_STEPS)
                    .map(|known| known.first_step)
            };
            self.ongoing[at] = Some(OngoingViolation {
                sets_near_since: [warned(a, b), warned(b, a)],
                nearest_step: step,
                min_distance_m: apart_m,
            });
        } else if apart_m > SAFETY_DISTANCE_M + APPROACH_ENDS_M {
            self.end_violation(a, b);
        }
        if let Some(near) = &mut self.ongoing[at]
            && apart_m < near.min_distance_m
        {
            (near.nearest_step, near.min_distance_m) = (step, apart_m);
        }
        let toward = |own: &VehicleState, apart: Point| {
            own.airborne
                && own.companion_controls
                && own.velocity.dot(&apart) > MIN_CLOSING_MPS * apart_m
        };
        if apart_m < TOUCH_M {
            let now_s = step as f32 * STEP_S;
            for (from, to, apart) in [(a, b, apart), (b, a, -apart)] {
                if toward(&seen[from], apart) && !self.touching[at] {
                    match carried(from, to) {
                        true => self.unforeseen_touches += 1,
                        false => self.touches.push((now_s, from, to, apart_m)),
                    }
                    self.touching[at] = true;
                }
            }
        } else {
            self.touching[at] = false;
        }
    }

    /// Position of a vehicle at `step` if it had begun to stop at `warned`, on the path that it
    /// flew.
    fn position_if_stopped(&self, vehicle: usize, warned: Option<usize>, step: usize) -> Point {
        let track = &self.tracks[vehicle];
        let Some(warned) = warned.filter(|warned| *warned < step) else {
            return track[step].position;
        };
        if track[warned..=step]
            .iter()
            .any(|seen| !seen.companion_controls || (seen.deaf && seen.lands_on_command))
        {
            // A pilot or failsafe flew it, so its companion could not have stopped it. Nor could a
            // vehicle that hears no other any more stay up for good.
            return track[step].position;
        }
        let speed = track[warned].velocity.norm();
        let time_s = (step - warned) as f32 * STEP_S;
        let before_s = 0.1 + LAG_S;
        let braked_s = (time_s - before_s).max(0.0);
        // The jerk of the stop costs half a ramp at full speed.
        let ramp_s = STOP_ACCEL_MPS2 / (2.0 * STOP_JERK_MPS3);
        let brakes_s = (braked_s - ramp_s).clamp(0.0, speed / STOP_ACCEL_MPS2);
        let gone_m = speed * (time_s.min(before_s) + braked_s.min(ramp_s)) + speed * brakes_s
            - 0.5 * STOP_ACCEL_MPS2 * brakes_s * brakes_s;
        // The stop would have been on the path that it flew.
        let mut left_m = gone_m;
        for pair in track[warned..=step].windows(2) {
            let part = (pair[1].position - pair[0].position).norm();
            if part >= left_m {
                return pair[0].position
                    + (pair[1].position - pair[0].position)
                        * if part > 0.0 { left_m / part } else { 0.0 };
            }
            left_m -= part;
        }
        track[step].position
    }

    /// Judges the pair's violation, which is over; nothing if there is none.
    fn end_violation(&mut self, a: usize, b: usize) {
        let Some(near) = self.ongoing[a * self.vehicle_count + b].take() else { return };
        let first =
            near.sets_near_since.iter().flatten().min().copied().unwrap_or(near.nearest_step);
        let mut kept_m = f32::INFINITY;
        for step in first..=near.nearest_step {
            let apart = self.position_if_stopped(a, near.sets_near_since[0], step)
                - self.position_if_stopped(b, near.sets_near_since[1], step);
            kept_m = kept_m.min(apart.norm());
        }
        let seconds = |step: usize| step as f32 * STEP_S;
        self.violations.push(Violation {
            pair: (a, b),
            at_s: seconds(near.nearest_step),
            min_distance_m: near.min_distance_m,
            sets_near_since_s: near.sets_near_since.map(|warned| warned.map(seconds)),
            distance_if_stopped_m: kept_m,
        });
    }

    /// Ends the meeting: approaches that still last are judged.
    pub fn finish(&mut self) {
        for a in 0..self.vehicle_count {
            for b in a + 1..self.vehicle_count {
                self.end_violation(a, b);
            }
        }
    }
}
