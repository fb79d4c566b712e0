//! Points, lengths of vectors (metres), squared distances between segments and points (m²), and
//! clamping.

use nalgebra::{Vector2, Vector3};

/// A point or vector in the mission frame: east, north, up, in metres.
pub type Point = Vector3<f32>;

/// Length of a vector by [`fpu::sqrtf`]: the same bits as nalgebra's `norm`, in a third of its
/// instructions on a board.
pub trait Length {
    /// Euclidean length, in the vector's unit.
    fn length(&self) -> f32;
}

impl Length for Vector3<f32> {
    #[inline(always)]
    fn length(&self) -> f32 {
        fpu::sqrtf(self.norm_squared())
    }
}

impl Length for Vector2<f32> {
    #[inline(always)]
    fn length(&self) -> f32 {
        fpu::sqrtf(self.norm_squared())
    }
}

/// `value` limited to `low..=high`. `f32::clamp` panics where the bounds are invalid, and its panic
/// message takes 25 kB of a board's flash.
pub(crate) fn clamp_to(value: f32, low: f32, high: f32) -> f32 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// `value` limited to 0..=1; 0 if it is NaN. Takes two instructions on a board; `f32::clamp`, which
/// returns NaN for NaN, takes seven.
#[inline]
pub(crate) fn clamp_to_unit(value: f32) -> f32 {
    let value = if value > 0.0 { value } else { 0.0 };
    if value < 1.0 { value } else { 1.0 }
}

/// Squared distance between two segments, m² (Ericson, Real-Time Collision Detection, 5.1.9).
pub(crate) fn segments_distance_sq(p: (&Point, &Point), q: (&Point, &Point)) -> f32 {
    let (d1, d2, r) = (p.1 - p.0, q.1 - q.0, p.0 - q.0);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let share = |n: f32, d: f32| if d > 0.0 { clamp_to_unit(n / d) } else { 0.0 };
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let s = share(b * f - c * e, a * e - b * b);
    let t = share(b * s + f, e);
    // `t` may have been clamped, so `s` is computed again from it, then `t` from `s`.
    let s = share(b * t - c, a);
    let t = share(b * s + f, e);
    (r + d1 * s - d2 * t).norm_squared()
}

/// Squared distance from segment `p` to point `q`, m²: the same bits as [`segments_distance_sq`]
/// for a second segment of length 0. Not inlined: a board has little flash.
#[inline(never)]
pub(crate) fn segment_to_point_distance_sq(p: (&Point, &Point), q: &Point) -> f32 {
    let (d, r) = (p.1 - p.0, p.0 - q);
    let a = d.norm_squared();
    let s = if a > 0.0 { clamp_to_unit(-d.dot(&r) / a) } else { 0.0 };
    (r + d * s).norm_squared()
}
