//! Extreme arguments for the calls, and the checksum of the calls' results.

use planner_core::Point;
use planner_core::coverage::pack::Heights;

/// Extreme and invalid arguments, which make code fail that does not check them.
pub(super) const EXTREME_NUMBERS: [f32; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.25,
    7.5,
    f32::MIN_POSITIVE,
    -1e-40,
    1e7,
    -1e19,
    f32::MAX,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// Receives the name of each call before the call is made, so that a panic can be attributed to it.
pub trait CallListener {
    /// Called before each call; `name` is the callee's file, type (if any) and function.
    fn before_call(&mut self, name: &'static str);
}

/// Makes calls and keeps a checksum of their results.
pub struct Results<'a, L> {
    listener: &'a mut L,
    sum: u32,
}

impl<'a, L: CallListener> Results<'a, L> {
    /// A checksum of no results.
    pub fn new(listener: &'a mut L) -> Self {
        Self { listener, sum: 0 }
    }

    /// Reports `name` to the listener, then calls `work`.
    pub(super) fn call<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        self.listener.before_call(name);
        work()
    }

    /// Adds a number to the checksum; all NaNs count as the same.
    pub(super) fn add(&mut self, answer: f32) {
        let bits = if answer.is_nan() { 0x7fc0_0000 } else { answer.to_bits() };
        self.add_count(bits as usize);
    }

    pub(super) fn add_point(&mut self, answer: &Point) {
        answer.iter().for_each(|&c| self.add(c));
    }

    /// Adds a whole number to the checksum: a count, an index, a CRC, or 1 for success.
    pub(super) fn add_count(&mut self, answer: usize) {
        self.sum = self.sum.rotate_left(5).wrapping_mul(0x9e37_79b1) ^ answer as u32;
    }

    /// The checksum of all results so far.
    pub fn sum(&self) -> u32 {
        self.sum
    }
}

/// Points whose coordinates are [`EXTREME_NUMBERS`].
pub(super) fn extreme_points() -> impl Iterator<Item = Point> {
    let at = |i: usize| EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()];
    (0..EXTREME_NUMBERS.len() * 3)
        .map(move |i| Point::new(at(i), at(i * 5 + i / 14), at(i * 9 + i / 7)))
}

/// These heights, each with one of the two replaced by `extreme`.
pub(super) fn heights_with_extreme_number(heights: Heights, extreme: f32) -> [Heights; 2] {
    [
        Heights { max_picture_height_m: extreme, ..heights },
        Heights { layer_spacing_m: extreme, ..heights },
    ]
}

pub(super) fn is_positive_and_finite(number: f32) -> bool {
    number > 0.0 && number.is_finite()
}
