//! Deconfliction in flight: how fast and how far the own vehicle may fly, given its neighbours.
//!
//! [`Method::Algorithm2`] is paper P3D §3.4 as printed, for comparison. [`Method::Priority`] keeps
//! the order of the swarm's schedule: the vehicle stops at each gate ([`crate::schedule`]) until
//! the other vehicle has left the part of its path that conflicts with the own path just beyond the
//! gate. A vehicle that is out of the plan opens all gates that wait for it, and others fly around
//! it ([`crate::detour`]). The own vehicle stops before a neighbour that does not fly the shared
//! plan. If that neighbour hovers beside the own path, the own vehicle flies past slowly, where a
//! stop from the lower speed still ends far enough away.

use fpu::sqrtf;
use heapless::Vec;
use libm::{fmaxf, fminf};

use crate::flight::{Gate, Path};
use crate::{Length, Point, SettingError, check_positive};

/// Rule by which vehicles are kept apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// No rule: neighbours are ignored.
    Off,
    /// Algorithm 2 of paper P3D.
    Algorithm2,
    /// Right of way in the order of the schedule, by gates.
    Priority,
}

/// Settings of [`advise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeconflictConfig {
    /// Rule by which vehicles are kept apart.
    pub method: Method,
    /// Smallest allowed distance between the centres of two vehicles, metres.
    pub safety_distance_m: f32,
    /// Nominal speed along the path, m/s.
    pub cruise_mps: f32,
    /// Deceleration that the advice counts on, m/s².
    pub accel_mps2: f32,
}

impl DeconflictConfig {
    /// Checks that all numbers are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_positive(&[
            ("safety_distance_m", self.safety_distance_m),
            ("cruise_mps", self.cruise_mps),
            ("accel_mps2", self.accel_mps2),
        ])
    }
}

/// Another vehicle of the swarm, as last heard over the radio.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Neighbour {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// Index of the neighbour in the roster sorted by id, from 0: the `h` of paper P3D Algorithm 2.
    pub rank: u16,
    /// Position of the neighbour when it was last heard, ENU metres in the mission frame.
    pub position: Point,
    /// Velocity of the neighbour when it was last heard, ENU m/s.
    pub velocity: Point,
    /// Seconds since position and velocity were heard.
    pub age_s: f32,
    /// Progress of the neighbour along its path of the shared plan, metres (negative in the climb);
    /// `None` if it does not fly that plan.
    pub progress_m: Option<f32>,
    /// Whether the neighbour is on the ground, or has to be assumed there.
    pub grounded: bool,
    /// Whether the neighbour has left the plan for good: gates that wait for it are open, and it is
    /// an obstacle.
    pub out_of_plan: bool,
    /// Whether the neighbour flies a detour, off its path of the plan.
    pub on_detour: bool,
}

/// The own vehicle, for which [`advise`] is called.
#[derive(Clone, Copy, Debug)]
pub struct OwnVehicle<'a, const W: usize> {
    /// Index of the own vehicle in the roster sorted by id, from 0.
    pub rank: u16,
    /// Position of the own vehicle, ENU metres in the mission frame.
    pub position: Point,
    /// Arc length of the reference on `path`, metres; before take-off the negative of the climb's
    /// height.
    pub along_m: f32,
    /// The path that the vehicle flies.
    pub path: &'a Path<W>,
    /// Whether `path` is a detour, not the path of the plan.
    pub on_detour: bool,
}

/// Limits of the own vehicle's speed and distance that keep it clear of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advice {
    /// Factor on the nominal speed, 0…1.
    pub speed_scale: f32,
    /// Distance along the path within which the vehicle has to stop, metres; infinite if it need
    /// not.
    pub stop_within_m: f32,
    /// System id of the neighbour that the own vehicle stops for, or by [`Method::Algorithm2`]
    /// slows for; 0 for none.
    pub waiting_for_id: u8,
}

impl Advice {
    /// No limits: no gate and no neighbour asks for a stop.
    pub const FREE: Self =
        Self { speed_scale: 1.0, stop_within_m: f32::INFINITY, waiting_for_id: 0 };
}

/// Most points of the own path that are compared with a neighbour's predicted positions: four
/// seconds of flight at the nominal speed.
const MAX_PATH_SAMPLES: usize = 16;
/// Time of flight between neighbouring samples of the path, seconds.
const PATH_SAMPLE_S: f32 = 0.25;

/// Margin for the rounding of distances, metres: subtracted from the distance to a conflict, which
/// then decides how many samples are skipped.
const DISTANCE_ROUNDING_M: f32 = 0.05;
/// Distance beyond a gate at which the reference still counts as standing at it, metres: a small
/// overshoot of the stop must not carry the vehicle through.
const MAX_GATE_OVERSHOOT_M: f32 = 0.1;
/// Overshoot of a braking vehicle over its reference, as seconds of flight at the part of the
/// cruise speed above [`BRAKING_OVERSHOOT_ABOVE_MPS`]: from 5.8 m/s an overshoot of 0.5 m was
/// measured.
const BRAKING_OVERSHOOT_S: f32 = 0.2;
/// Cruise speed up to which a braking vehicle does not overshoot its reference, m/s.
const BRAKING_OVERSHOOT_ABOVE_MPS: f32 = 3.0;
/// Time from the decision to depart until the climb begins, seconds: PX4 and ArduCopter arm and
/// spin up the motors meanwhile.
const DEPARTURE_S: f32 = 3.0;
/// Shortest hover at a gate for a late neighbour, in addition to scheduled waits, that a wait on
/// the pad replaces, seconds.
const MIN_AVOIDED_HOVER_S: f32 = 5.0;
/// While all neighbours were heard within this time, a late one is waited for on the pad, seconds.
const HEARD_LATELY_S: f32 = 2.0;
/// Greatest speed past a neighbour that hovers nearer than a stop from cruise speed requires, m/s:
/// a stop from this speed overshoots by 0.4 m, and detours keep 0.5 m beyond the safety distance.
const MAX_PASSING_MPS: f32 = 5.0;
/// Greatest speed of a neighbour that hovers, m/s.
const MAX_HOVERING_MPS: f32 = 1.0;

/// Distance that is kept so that a stop from this speed ends outside the safety distance, metres.
fn stop_separation_m(cfg: &DeconflictConfig, speed_mps: f32) -> f32 {
    cfg.safety_distance_m
        + BRAKING_OVERSHOOT_S * fmaxf(speed_mps - BRAKING_OVERSHOOT_ABOVE_MPS, 0.0)
}

/// Advice to the vehicle `own`; `gates` must be sorted along its path. Work: the gates, a search
/// among the neighbours for each gate within reach, and 16 points (`MAX_PATH_SAMPLES`) of the own
/// path for each airborne neighbour that is off its path of the plan, or for every airborne one
/// while `own` flies a detour; up to twice as many for one that hovers.
pub fn advise<const W: usize>(
    cfg: &DeconflictConfig,
    own: &OwnVehicle<'_, W>,
    gates: &[Gate],
    neighbours: &[Neighbour],
) -> Advice {
    match cfg.method {
        Method::Off => Advice::FREE,
        Method::Algorithm2 => advise_by_algorithm2(cfg, own.rank, &own.position, neighbours),
        Method::Priority => advise_by_priority(cfg, own, gates, neighbours),
    }
}

/// Paper P3D Algorithm 2, lines 12–17: within the safety distance of a vehicle of higher rank `h`
/// the speed is the nominal one divided by `(h + 1) · 1.5`. Of several such vehicles the one with
/// the highest rank counts, since the paper's loop overwrites. The speed is the nominal one again
/// when no such vehicle is near.
fn advise_by_algorithm2(
    cfg: &DeconflictConfig,
    rank: u16,
    position: &Point,
    neighbours: &[Neighbour],
) -> Advice {
    let near =
        |n: &&Neighbour| n.rank > rank && (n.position - position).length() < cfg.safety_distance_m;
    match neighbours.iter().filter(near).max_by_key(|n| n.rank) {
        Some(n) => Advice {
            speed_scale: 1.0 / ((f32::from(n.rank) + 1.0) * 1.5),
            stop_within_m: f32::INFINITY,
            waiting_for_id: n.id,
        },
        None => Advice::FREE,
    }
}

/// Advice by [`Method::Priority`]: a stop at the first gate that is not open; and a stop, or a slow
/// passage, before each airborne neighbour that is off its path of the plan (before every airborne
/// one while `own` flies a detour).
fn advise_by_priority<const W: usize>(
    cfg: &DeconflictConfig,
    own: &OwnVehicle<'_, W>,
    gates: &[Gate],
    neighbours: &[Neighbour],
) -> Advice {
    let mut advice = Advice::FREE;
    let mut stop = |within_m: f32, id: u8| {
        if within_m < advice.stop_within_m {
            advice.stop_within_m = within_m;
            advice.waiting_for_id = id;
        }
    };
    // Gates further ahead than twice the braking distance plus one sample step are ignored for now.
    let horizon_m = own.along_m
        + cfg.cruise_mps * cfg.cruise_mps / cfg.accel_mps2
        + cfg.cruise_mps * PATH_SAMPLE_S;
    let ahead =
        &gates[gates.partition_point(|gate| gate.at_m < own.along_m - MAX_GATE_OVERSHOOT_M)..];
    for gate in ahead.iter().take_while(|gate| gate.at_m <= horizon_m) {
        let passed = find_neighbour(neighbours, gate.wait_for_id).is_some_and(|n| {
            n.out_of_plan
                || n.progress_m.is_some_and(|progress_m| progress_m >= gate.open_from_progress_m)
        });
        if !passed {
            stop(fmaxf(gate.at_m - own.along_m, 0.0), gate.wait_for_id);
            break;
        }
    }
    let unplanned = |n: &&Neighbour| n.progress_m.is_none() || n.on_detour || own.on_detour;
    let ahead = PathSamples::new(cfg, own);
    let mut slow_within_m = f32::INFINITY;
    for n in neighbours.iter().filter(|n| !n.grounded).filter(unplanned) {
        let conflict_m = |speed_mps: f32| {
            ahead.distance_to_conflict_m(stop_separation_m(cfg, speed_mps), own, n)
        };
        let Some(distance_m) = conflict_m(cfg.cruise_mps) else { continue };
        let hovers = n.velocity.norm_squared() <= MAX_HOVERING_MPS * MAX_HOVERING_MPS;
        if hovers && cfg.cruise_mps > MAX_PASSING_MPS && conflict_m(MAX_PASSING_MPS).is_none() {
            slow_within_m = fminf(slow_within_m, distance_m);
        } else {
            stop(distance_m, n.id);
        }
    }
    let braking = |within_m: f32| 2.0 * cfg.accel_mps2 * fmaxf(within_m, 0.0);
    let slow_mps_sq = MAX_PASSING_MPS * MAX_PASSING_MPS + braking(slow_within_m);
    let allowed_mps = sqrtf(fminf(braking(advice.stop_within_m), slow_mps_sq));
    advice.speed_scale = fminf(allowed_mps / cfg.cruise_mps, 1.0);
    advice
}

/// Whether a neighbour flies the plan so late that the own vehicle, if it departed now, would hover
/// at a gate for it for more than 5 s (`MIN_AVOIDED_HOVER_S`) beyond the waits that the schedule
/// has.
///
/// A neighbour needs at least the flight at `fastest_mps`, m/s, to where it opens the gate, and the
/// own vehicle reaches the gate no earlier than by its schedule, 3 s (`DEPARTURE_S`) later. If all
/// keep to the schedule and none is faster than `fastest_mps`, the neighbour is far enough on when
/// the own vehicle is due to depart, and the answer is no. So this wait can lead to a deadlock no
/// more than the gate itself can. False while any neighbour was last heard more than 2 s
/// (`HEARD_LATELY_S`) ago or is off the plan: the late one may wait for that one. Work: the
/// neighbours; the gates, a search among the neighbours and one along the path for each.
pub fn has_late_neighbour<const W: usize>(
    cfg: &DeconflictConfig,
    fastest_mps: f32,
    path: &Path<W>,
    gates: &[Gate],
    neighbours: &[Neighbour],
) -> bool {
    let flies_plan = |n: &Neighbour| {
        n.progress_m.is_some() && !n.out_of_plan && !n.on_detour && n.age_s < HEARD_LATELY_S
    };
    let late = |gate: &Gate| {
        let progress_m = find_neighbour(neighbours, gate.wait_for_id).and_then(|n| n.progress_m);
        progress_m.is_some_and(|progress_m| {
            let least_s = (gate.open_from_progress_m - progress_m) / fastest_mps;
            least_s > path.scheduled_s(gate.at_m) + DEPARTURE_S + MIN_AVOIDED_HOVER_S
        })
    };
    cfg.method == Method::Priority && neighbours.iter().all(flies_plan) && gates.iter().any(late)
}

/// The neighbour with this id. Neighbours are usually sorted by id; if not, all are searched.
fn find_neighbour(neighbours: &[Neighbour], id: u8) -> Option<&Neighbour> {
    let sorted = neighbours.binary_search_by_key(&id, |n| n.id).ok();
    sorted.map(|at| &neighbours[at]).or_else(|| neighbours.iter().find(|n| n.id == id))
}

/// Samples of the own path ahead of the reference, at equal distances.
struct PathSamples {
    /// The samples; the first is `step_m` ahead of the reference.
    points: Vec<Point, MAX_PATH_SAMPLES>,
    /// Distance along the path between two samples, metres.
    step_m: f32,
}

impl PathSamples {
    fn new<const W: usize>(cfg: &DeconflictConfig, own: &OwnVehicle<'_, W>) -> Self {
        let step_m = cfg.cruise_mps * PATH_SAMPLE_S;
        let points =
            own.path.points_from(fmaxf(own.along_m, 0.0) + step_m, step_m).take(MAX_PATH_SAMPLES);
        Self { points: points.collect(), step_m }
    }

    /// Distance along the own path at which the vehicle first comes within `apart_m` metres of
    /// neighbour `n`, if `n` flies on straight as last heard. `None` if that is not within the
    /// samples, or if both only move apart. Squares are compared: square roots are slow on a board.
    /// Samples that come too early for both to meet are skipped.
    fn distance_to_conflict_m<const W: usize>(
        &self,
        apart_m: f32,
        own: &OwnVehicle<'_, W>,
        n: &Neighbour,
    ) -> Option<f32> {
        let away = |samples: usize, own: &Point| {
            n.position + n.velocity * (n.age_s + samples as f32 * PATH_SAMPLE_S) - own
        };
        let now = away(0, &own.position);
        let near = fminf(apart_m * apart_m, now.norm_squared());
        // Upper bound of how far both fly between two samples.
        let fastest_mps = n.velocity.x.abs() + n.velocity.y.abs() + n.velocity.z.abs();
        let approach_m = self.step_m + PATH_SAMPLE_S * fastest_mps;
        let samples_per_m = 1.0 / approach_m;
        let (mut i, mut last) = (0, (0, now));
        while let Some(there) = self.points.get(i) {
            let to = away(i + 1, there);
            let least_m = to.x.abs().max(to.y.abs()).max(to.z.abs());
            let room_m = least_m - apart_m - DISTANCE_ROUNDING_M;
            let comes_near = || {
                let from = if last.0 == i { last.1 } else { away(i, &self.points[i - 1]) };
                interior_closest_approach_sq(&from, &to).is_some_and(|square| square < near)
            };
            if to.norm_squared() < near || room_m < approach_m && comes_near() {
                return Some(i as f32 * self.step_m);
            }
            last = (i + 1, to);
            // The cast gives 0 for NaN and for a negative product.
            i = i.saturating_add(1).saturating_add((room_m * samples_per_m) as usize);
        }
        None
    }
}

/// Square of the least distance from the origin to the segment between two points, if that is
/// inside the segment; `None` if the least distance is at one of the segment's ends.
fn interior_closest_approach_sq(from: &Point, to: &Point) -> Option<f32> {
    let step = to - from;
    let ahead = to.dot(&step);
    if ahead <= 0.0 {
        return None;
    }
    let behind = from.dot(&step);
    // Square of a triangle's height: only rounding can make it negative.
    (behind < 0.0).then(|| from.norm_squared() - behind * behind / (ahead - behind))
}

#[cfg(test)]
mod tests;
