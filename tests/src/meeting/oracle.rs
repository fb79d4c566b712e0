//! The judge of a meeting. It computes the sets of the safety filter by their definition, from the
//! messages that a vehicle received and from true motion, without any of the companion's code.
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
use super::scene::{CRUISE_MPS, SAFETY_M};

/// Deceleration of a stop along a path, m/s².
const ACCEL: f32 = 1.5;
/// Jerk of a stop by the safety filter, m/s³.
const JERK: f32 = 8.0;
/// Time by which a vehicle lags behind its setpoint, seconds.
const LAG_S: f32 = 0.35;
/// Greatest age at which a neighbour's reported points are believed, seconds.
const FRESH_S: f32 = 1.0;
/// Age up to which the ball of a silent neighbour grows, seconds.
const GROWS_S: f32 = 3.0;
/// Steps for which sets may be apart within one approach.
const GAP_STEPS: usize = 40;
/// Margin, metres: a stop counts as one that would have kept the safety distance only if it keeps
/// that plus this margin.
const SURE_M: f32 = 0.05;

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
    segments: Vec<(Point, Point)>,
    radius_m: f32,
}

/// Distance that a vehicle covers from this speed: `before_s` at that speed, then a stop, metres.
fn reach(speed: f32, before_s: f32) -> f32 {
    speed * before_s + speed * speed / (2.0 * ACCEL) + speed * ACCEL / (2.0 * JERK)
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
    if age_s > FRESH_S {
        let radius_m = CRUISE_MPS * age_s.min(GROWS_S);
        return Some(ReachableSet { segments: vec![(position, position)], radius_m });
    }
    let intent = heard.intent.as_ref();
    if intent.is_some_and(|i| i.flags & (GROUNDED | LANDED) != 0) {
        return Some(ReachableSet { segments: vec![(position, position)], radius_m: 0.0 });
    }
    let speed = velocity.norm();
    let mut left_m = reach(speed, age_s + 0.1);
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
        set.radius_m = 0.5 * ACCEL * age_s * age_s;
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
        segments.push((position, position + velocity * (reach(speed, 0.1 + LAG_S) / speed)));
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

/// What the judge sees of a vehicle at one step.
#[derive(Clone, Copy, Debug)]
pub struct VehicleState {
    /// True position, ENU metres.
    pub position: Point,
    /// True velocity, ENU m/s.
    pub velocity: Point,
    /// Whether the vehicle is off the ground.
    pub airborne: bool,
    /// Whether its companion controls it, and so could stop it.
    pub own: bool,
    /// Whether it lands by its autopilot, at its companion's command.
    pub lands: bool,
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
    pub least_m: f32,
    /// When the sets of each vehicle first came too near in this approach, seconds; `None`: never.
    pub warned_s: [Option<f32>; 2],
    /// Smallest distance if each vehicle had stopped from its `warned_s` on, metres.
    pub kept_m: f32,
}

impl Violation {
    /// Whether stops would have kept the safety distance, so that the filter failed.
    pub fn is_failure(&self) -> bool {
        self.kept_m >= SAFETY_M + SURE_M
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Approach {
    since: usize,
    last: usize,
}

/// Watches and judges a meeting.
#[derive(Debug)]
pub struct Oracle {
    count: usize,
    tracks: Vec<Vec<VehicleState>>,
    approaches: Vec<Option<Approach>>,
    /// For each pair that is too near: when its sets came too near, the step at which the pair was
    /// nearest, and that distance.
    near: Vec<Option<Near>>,
    /// Approaches below the safety distance that have ended.
    pub violations: Vec<Violation>,
    touching: Vec<bool>,
    /// Touches: time in seconds, index of the vehicle that moved toward the other one, index of the
    /// other one, distance in metres.
    pub touches: Vec<(f32, usize, usize, f32)>,
    /// Touches of a vehicle that was carried off unheard: no message places it there.
    pub unforeseen: usize,
    /// Smallest distance between two vehicles, not both on the ground, metres.
    pub least_m: f32,
}

#[derive(Clone, Copy, Debug)]
struct Near {
    warned: [Option<usize>; 2],
    nearest: usize,
    least_m: f32,
}

/// Distance of centres below which two vehicles touch, metres: twice the hull's radius.
pub const TOUCH_M: f32 = 0.6;
/// Closing speed below which a vehicle does not count as moving toward the other, m/s.
const TOWARD_MPS: f32 = 0.15;
/// Distance beyond the safety distance at which an approach ends, metres.
const APART_M: f32 = 0.1;

impl Oracle {
    /// A judge of `count` vehicles.
    pub fn new(count: usize) -> Self {
        Self {
            count,
            tracks: vec![Vec::new(); count],
            approaches: vec![None; count * count],
            near: vec![None; count * count],
            violations: Vec::new(),
            touching: vec![false; count * count],
            touches: Vec::new(),
            unforeseen: 0,
            least_m: f32::INFINITY,
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
        for a in 0..self.count {
            for b in 0..self.count {
                if a == b {
                    continue;
                }
                if step.is_multiple_of(2) && seen[a].airborne && seen[a].own {
                    self.judge_sets(step, now_s, (a, b), &seen[a], &heard(a, b), &floor_z);
                }
                if a < b {
                    // A vehicle that its pilot or autopilot carries off unheard is outside the ball
                    // in which others assume a silent vehicle.
                    let carried = |from: usize, to: usize| {
                        heard(from, to).position.is_some_and(|(place, _, _, at_s)| {
                            now_s - at_s > GROWS_S
                                && (place - seen[to].position).norm() > CRUISE_MPS * GROWS_S
                        })
                    };
                    self.judge_distance(step, (a, b), seen, carried);
                }
            }
        }
    }

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
        let ours = if own.lands {
            landing_set(own.position, floor_z(&own.position))
        } else {
            stopping_set(own.position, own.velocity)
        };
        if ours.distance(&theirs) < SAFETY_M {
            let approach = &mut self.approaches[a * self.count + b];
            match approach {
                Some(known) if step - known.last <= GAP_STEPS => known.last = step,
                _ => *approach = Some(Approach { since: step, last: step }),
            }
        }
    }

    fn judge_distance(
        &mut self,
        step: usize,
        (a, b): (usize, usize),
        seen: &[VehicleState],
        carried: impl Fn(usize, usize) -> bool,
    ) {
        let at = a * self.count + b;
        if !seen[a].airborne && !seen[b].airborne {
            self.end_near(a, b);
            self.touching[at] = false;
            return;
        }
        let apart = seen[b].position - seen[a].position;
        let apart_m = apart.norm();
        self.least_m = self.least_m.min(apart_m);
        if apart_m < SAFETY_M && self.near[at].is_none() {
            let warned = |from: usize, to: usize| {
                let known = self.approaches[from * self.count + to];
                known.filter(|known| step - known.last <= GAP_STEPS).map(|known| known.since)
            };
            self.near[at] = Some(Near {
                warned: [warned(a, b), warned(b, a)],
                nearest: step,
                least_m: apart_m,
            });
        } else if apart_m > SAFETY_M + APART_M {
            self.end_near(a, b);
        }
        if let Some(near) = &mut self.near[at]
            && apart_m < near.least_m
        {
            (near.nearest, near.least_m) = (step, apart_m);
        }
        let toward = |own: &VehicleState, apart: Point| {
            own.airborne && own.own && own.velocity.dot(&apart) > TOWARD_MPS * apart_m
        };
        if apart_m < TOUCH_M {
            let now_s = step as f32 * STEP_S;
            for (from, to, apart) in [(a, b, apart), (b, a, -apart)] {
                if toward(&seen[from], apart) && !self.touching[at] {
                    match carried(from, to) {
                        true => self.unforeseen += 1,
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
    fn stopped(&self, vehicle: usize, warned: Option<usize>, step: usize) -> Point {
        let track = &self.tracks[vehicle];
        let Some(warned) = warned.filter(|warned| *warned < step) else {
            return track[step].position;
        };
        if track[warned..=step].iter().any(|seen| !seen.own || (seen.deaf && seen.lands)) {
            // A pilot or failsafe flew it, so its companion could not have stopped it. Nor could a
            // vehicle that hears no other any more stay up for good.
            return track[step].position;
        }
        let speed = track[warned].velocity.norm();
        let time_s = (step - warned) as f32 * STEP_S;
        let before_s = 0.1 + LAG_S;
        let braked_s = (time_s - before_s).max(0.0);
        // The jerk of the stop costs half a ramp at full speed.
        let ramp_s = ACCEL / (2.0 * JERK);
        let brakes_s = (braked_s - ramp_s).clamp(0.0, speed / ACCEL);
        let gone_m = speed * (time_s.min(before_s) + braked_s.min(ramp_s)) + speed * brakes_s
            - 0.5 * ACCEL * brakes_s * brakes_s;
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

    fn end_near(&mut self, a: usize, b: usize) {
        let Some(near) = self.near[a * self.count + b].take() else { return };
        let first = near.warned.iter().flatten().min().copied().unwrap_or(near.nearest);
        let mut kept_m = f32::INFINITY;
        for step in first..=near.nearest {
            let apart =
                self.stopped(a, near.warned[0], step) - self.stopped(b, near.warned[1], step);
            kept_m = kept_m.min(apart.norm());
        }
        let seconds = |step: usize| step as f32 * STEP_S;
        self.violations.push(Violation {
            pair: (a, b),
            at_s: seconds(near.nearest),
            least_m: near.least_m,
            warned_s: near.warned.map(|warned| warned.map(seconds)),
            kept_m,
        });
    }

    /// Ends the meeting: approaches that still last are judged.
    pub fn finish(&mut self) {
        for a in 0..self.count {
            for b in a + 1..self.count {
                self.end_near(a, b);
            }
        }
    }
}
