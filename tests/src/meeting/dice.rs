//! Random numbers of a scene: SplitMix64, so that a seed gives the same scene for ever.

use planner_core::Point;

/// A seeded SplitMix64 generator.
#[derive(Clone, Debug)]
pub struct Dice(u64);

impl Dice {
    /// A generator that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A uniformly distributed random number from `low` to below `high`.
    pub fn real(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.bits() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// A random whole number from 0 to below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() >> 33) as usize % count.max(1)
    }

    /// Whether a random event of this probability occurs.
    pub fn chance(&mut self, share: f32) -> bool {
        self.real(0.0, 1.0) < share
    }

    /// A random point in the box from `low` to `high`.
    pub fn point(&mut self, low: Point, high: Point) -> Point {
        Point::new(self.real(low.x, high.x), self.real(low.y, high.y), self.real(low.z, high.z))
    }

    /// A random unit vector, uniformly distributed.
    pub fn direction(&mut self) -> Point {
        loop {
            let at = self.point(Point::new(-1.0, -1.0, -1.0), Point::new(1.0, 1.0, 1.0));
            if (0.01..1.0).contains(&at.norm_squared()) {
                return at.normalize();
            }
        }
    }
}
