//! CMSDK watchdog: resets the board unless it is fed.
#![expect(unsafe_code, reason = "the handler of the interrupt that nothing masks")]

use cortex_m_rt::exception;

use super::registers::Register;

const WATCHDOG: usize = 0x4000_8000;
const LOAD: usize = 0;
const CTRL: usize = 8;
const INTCLR: usize = 12;
const LOCK: usize = 0xC00;
const UNLOCK: u32 = 0x1ACC_E551;
/// Counts down twice at 25 MHz before the reset.
const COUNTS: u32 = super::super::BITES_AFTER_US / 2 * 25;
/// Interrupt at the first end, reset at the second.
const ENABLED: u32 = 0b11;

/// Half of the time is over, which this device says by the interrupt that nothing masks: the other half is left.
#[exception]
unsafe fn NonMaskableInt() {}

/// The watchdog.
pub struct Watchdog(pub(super) ());

impl Watchdog {
    /// Wakes it.
    pub(super) fn wake(&mut self) {
        Register::new(WATCHDOG, LOCK).write(UNLOCK);
        Register::new(WATCHDOG, LOAD).write(COUNTS);
        Register::new(WATCHDOG, CTRL).write(ENABLED);
    }

    /// Puts the reset off.
    pub fn feed(&mut self) {
        Register::new(WATCHDOG, INTCLR).write(1);
    }
}
