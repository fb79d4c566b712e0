//! What every board keeps to.

/// Time after it was last fed at which the watchdog resets the board, microseconds.
pub(crate) const WATCHDOG_TIMEOUT_US: u32 = 1_000_000;

/// Bytes below the stack that no access may touch; frames of the stack are larger than a few bytes.
pub(crate) const GUARD_LEN: u32 = 4096;
