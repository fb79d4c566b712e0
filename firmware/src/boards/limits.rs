//! Limits that are the same on every board.

/// Time after its last feeding at which the watchdog resets the board, microseconds.
pub(crate) const WATCHDOG_TIMEOUT_US: u32 = 1_000_000;

/// Length of the guard below the stack, bytes, in which every access faults: an overflow hits it
/// unless one stack frame is longer than this.
pub(crate) const GUARD_LEN: u32 = 4096;
