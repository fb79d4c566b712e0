//! CMSDK watchdog: resets the board unless it is fed.

use super::registers::Register;

const WATCHDOG: usize = 0x4000_8000;
const LOAD: usize = 0;
const CTRL: usize = 8;
const INTCLR: usize = 12;
const LOCK: usize = 0xC00;
const UNLOCK: u32 = 0x1ACC_E551;
/// Counts down twice before the reset; at 25 MHz half a second each.
const COUNTS: u32 = 12_500_000;
/// Interrupt at the first end, reset at the second.
const ENABLED: u32 = 0b11;

/// The watchdog, awake.
pub struct Watchdog(());

impl Watchdog {
    /// Wakes it.
    pub(super) fn new() -> Self {
        Register::new(WATCHDOG, LOCK).write(UNLOCK);
        Register::new(WATCHDOG, LOAD).write(COUNTS);
        Register::new(WATCHDOG, CTRL).write(ENABLED);
        Self(())
    }

    /// Puts the reset off by a second.
    pub fn feed(&mut self) {
        Register::new(WATCHDOG, INTCLR).write(1);
    }
}
