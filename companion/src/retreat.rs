//! Out from under a vehicle that comes down: who waits below it flies back along its path until it is beside the column.
//!
//! A vehicle that left the plan and is still in the air will land, by its autopilot and without looking. Nobody waits within
//! [`BESIDE_M`] beyond the safety distance of the column it may come down in (`neighbours.rs`): a place to wait that is there
//! is exchanged for the nearest one before it on the path. Back is where this vehicle came from, so the way is free of walls;
//! who follows behind is not come nearer to than [`FOLLOWER_M`] beyond the safety distance.
//!
//! ENU metres. Cost: [`STEPS`] places against each neighbour, only while one comes down near the place to wait.

use planner_core::Point;
use planner_core::deconflict::Neighbour;
use planner_core::path::{Path, Reference, Tracker};

/// What the one that comes down may drift, and the one below sways, metres.
pub const BESIDE_M: f32 = 0.6;
/// What two may stray together, metres.
const FOLLOWER_M: f32 = 0.6;
/// Spacing and number of the places looked at.
const STEP_M: f32 = 0.25;
const STEPS: u16 = 48;
/// Fastest on a straight leg, and through its ends, m/s: a right angle is strayed from by 0.47 m then.
const FAST_MPS: f32 = 1.5;
const CORNER_MPS: f32 = 0.6;
/// Acceleration, m/s².
const ACCEL_MPS2: f32 = 1.0;

/// The nearest place before `wait_m`, metres along the path, that is not `unsafe_at`; `None` if there is none within reach.
pub fn elsewhere(wait_m: f32, unsafe_at: impl Fn(f32) -> bool) -> Option<f32> {
    let places = (1..=STEPS).map(|i| wait_m - f32::from(i) * STEP_M);
    places.take_while(|m| *m >= 0.0).find(|m| !unsafe_at(*m))
}

/// One step of `dt_s` back towards `to_m`; `None` if somebody is behind.
pub fn step<const W: usize>(
    path: &Path<W>,
    tracker: &mut Tracker,
    to_m: f32,
    neighbours: &[Neighbour],
    safety_m: f32,
    dt_s: f32,
) -> Option<Reference> {
    let here = path.point_at(tracker.along_m)?;
    let back = path.point_at(tracker.along_m - STEP_M)?;
    let follows = |n: &&Neighbour| {
        let apart = |p: &Point| (n.position - p).norm();
        !n.grounded && n.progress_m.is_some() && apart(&back) < (safety_m + FOLLOWER_M).min(apart(&here))
    };
    if neighbours.iter().find(follows).is_some() {
        return None;
    }
    let corner_m = path.waypoints().iter().rev().map(|w| tracker.along_m - w.along_m).find(|m| *m > 0.0);
    let allowed = |end: f32, left_m: f32| libm::sqrtf(end * end + 2.0 * ACCEL_MPS2 * left_m);
    let ahead = allowed(CORNER_MPS, corner_m.unwrap_or(0.0)).min(allowed(0.0, tracker.along_m - to_m));
    // The tracker's speed is that of flying on; back is below zero.
    let speed = ahead.min(FAST_MPS).min(ACCEL_MPS2 * dt_s - tracker.speed_mps.min(0.0));
    tracker.speed_mps = -speed;
    tracker.along_m = (tracker.along_m - speed * dt_s).max(to_m);
    let position = path.point_at(tracker.along_m)?;
    let velocity = (back - here).try_normalize(1e-6).unwrap_or_else(Point::zeros) * speed;
    let acceleration = Point::zeros();
    Some(Reference { position, velocity, acceleration, along_m: tracker.along_m, finished: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path() -> Path<4> {
        let mut path = Path::new();
        for (x, y) in [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0)] {
            path.push(Point::new(x, y, 1.0), 0.8).unwrap();
        }
        path
    }

    fn above(x: f32, y: f32, z: f32) -> Neighbour {
        Neighbour {
            id: 9,
            rank: 1,
            position: Point::new(x, y, z),
            velocity: Point::zeros(),
            age_s: 0.0,
            progress_m: None,
            grounded: false,
            out: false,
            detours: false,
        }
    }

    #[test]
    fn a_place_below_one_that_comes_down_is_exchanged_for_one_before_it() {
        let path = path();
        let unsafe_at = |along_m: f32| {
            let place = path.point_at(along_m).unwrap();
            (place.xy() - Point::new(6.0, 3.0, 8.0).xy()).norm() < 2.1
        };
        let to_m = elsewhere(9.0, unsafe_at).unwrap();
        assert!((5.0..7.0).contains(&to_m), "{to_m}");
        assert_eq!(elsewhere(9.0, |_| true), None, "nowhere is better");
    }

    #[test]
    fn it_goes_back_slowly_round_the_corner_and_not_into_who_follows() {
        let path = path();
        let mut tracker = Tracker { along_m: 9.0, speed_mps: 0.0 };
        let mut follower = above(0.0, 0.0, 1.0);
        follower.progress_m = Some(0.0);
        let mut steps = 0;
        while tracker.along_m > 4.0 && steps < 400 {
            step(&path, &mut tracker, 4.0, &[follower], 1.5, 0.05).unwrap();
            let corner_m = (tracker.along_m - 6.0).abs();
            assert!(corner_m > 0.05 || tracker.speed_mps.abs() < CORNER_MPS + 0.15, "{tracker:?}");
            steps += 1;
        }
        assert!(tracker.along_m < 4.05 && steps < 200, "{tracker:?} after {steps}");
        let mut near = Tracker { along_m: 2.0, speed_mps: 0.0 };
        while step(&path, &mut near, 0.0, &[follower], 1.5, 0.05).is_some() {}
        assert!(near.along_m > 1.5, "{near:?}");
    }
}
