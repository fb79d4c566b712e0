//! Little-endian numbers in a mission file, and their ranges.

use planner_core::Point;
use planner_core::roadmap::MAX_COORDINATE_M;

/// Greatest speed that a mission file may have, m/s.
pub(super) const MAX_SPEED_MPS: f32 = 1000.0;

/// The f32 at offset `at`.
pub(super) fn f32_at(b: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]])
}

/// The u16 at offset `at`.
pub(super) fn u16_at(b: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([b[at], b[at + 1]])
}

/// The u32 at offset `at`.
pub(super) fn u32_at(b: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]])
}

/// The point whose three f32 begin at offset `at`.
pub(super) fn point_at(b: &[u8], at: usize) -> Point {
    Point::new(f32_at(b, at), f32_at(b, at + 4), f32_at(b, at + 8))
}

/// Writes f32 one after the other from offset `at` on.
pub(super) fn put_numbers(b: &mut [u8], at: usize, numbers: impl Iterator<Item = f32>) {
    for (to, number) in b[at..].chunks_exact_mut(4).zip(numbers) {
        to.copy_from_slice(&number.to_le_bytes());
    }
}

/// Whether the value is more than 0 and at most `most`; false for NaN.
pub(super) fn is_positive_up_to(value: f32, most: f32) -> bool {
    value > 0.0 && value <= most
}

/// Whether all coordinates of a point are within the range of a mission file.
pub(super) fn in_range(point: &Point) -> bool {
    point.iter().all(|c| libm::fabsf(*c) <= MAX_COORDINATE_M)
}
