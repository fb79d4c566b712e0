//! A moving point, and limits of vectors and numbers.

use libm::fmaxf;
use planner_core::{Length, Point};

/// A moving point: place, velocity, acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Place, ENU metres in the mission frame.
    pub(super) position: Point,
    /// Velocity, ENU m/s.
    pub(super) velocity: Point,
    /// Acceleration, ENU m/s².
    pub(super) acceleration: Point,
}

impl Motion {
    /// A point at rest at a place.
    pub(super) fn at_rest(position: Point) -> Self {
        Self { position, velocity: Point::zeros(), acceleration: Point::zeros() }
    }

    /// Whether all nine numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        [self.position, self.velocity, self.acceleration]
            .iter()
            .all(|v| v.iter().all(|c| c.is_finite()))
    }
}

/// The vector, shortened to the length `most` if it is longer than that.
pub(super) fn clamp_length(vector: Point, most: f32) -> Point {
    vector * (most / fmaxf(vector.length(), fmaxf(most, 1e-6)))
}

/// The value limited to `low`…`high`. `f32::clamp` panics where a bound is NaN, and a board would
/// carry 25 kB of code to print it.
pub(super) fn clamp_to(value: f32, low: f32, high: f32) -> f32 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}
