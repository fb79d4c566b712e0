//! Time as an argument: microseconds since the shell's start. No clock is read in this crate.

use core::num::NonZero;
use core::ops::{Add, Sub};

/// A point in time, microseconds since the shell's start. It never goes back; 2⁶⁴ µs are 584 000
/// years.
///
/// The value stored is the number of microseconds plus 1, so that an `Option` of it takes 8 bytes,
/// not 16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(NonZero<u64>);

/// A span of time in microseconds, never negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Duration(u64);

impl Instant {
    /// The shell's start, 0 µs.
    pub const ZERO: Self = Self(NonZero::<u64>::MIN);

    /// From microseconds since the shell's start; saturates.
    pub const fn from_micros(micros: u64) -> Self {
        Self(Self::ZERO.0.saturating_add(micros))
    }

    /// From milliseconds since the shell's start; saturates.
    pub const fn from_millis(millis: u64) -> Self {
        Self::from_micros(millis.saturating_mul(1000))
    }

    /// Microseconds since the shell's start.
    pub const fn as_micros(self) -> u64 {
        self.0.get() - 1
    }

    /// Milliseconds since the shell's start, wrapped to the 32 bits of MAVLink's `time_boot_ms`.
    pub const fn as_boot_ms(self) -> u32 {
        (self.as_micros() / 1000) as u32
    }

    /// Time from `earlier` until `self`; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration(self.0.get().saturating_sub(earlier.0.get()))
    }
}

impl Default for Instant {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Duration {
    /// From microseconds.
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// From milliseconds; saturates.
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1000))
    }

    /// From whole seconds; saturates.
    pub const fn from_secs(secs: u64) -> Self {
        Self(secs.saturating_mul(1_000_000))
    }

    /// In microseconds.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// Time by which this duration is longer than `other`; zero where it is shorter.
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// In seconds.
    pub const fn as_secs_f32(self) -> f32 {
        // A board's FPU converts 32 bits to a float in one instruction; 64 bits need a software
        // routine.
        let (high, low) = ((self.0 >> 32) as u32, self.0 as u32);
        (high as f32 * 4_294_967_296.0 + low as f32) * 1e-6
    }
}

impl Add<Duration> for Instant {
    type Output = Self;
    fn add(self, span: Duration) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub<Instant> for Instant {
    type Output = Duration;
    fn sub(self, earlier: Instant) -> Duration {
        self.since(earlier)
    }
}
