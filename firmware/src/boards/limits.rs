//! What every board keeps to.

/// The watchdog resets the board so long after it was last fed, microseconds.
pub(crate) const BITES_AFTER_US: u32 = 1_000_000;

/// Bytes below the stack that nothing may touch; frames of the stack are larger than a few bytes.
pub(crate) const GUARD_LEN: u32 = 4096;
