//! Driver of the CMSDK watchdog, which resets the board unless it is fed.
#![expect(unsafe_code, reason = "the handler of the interrupt that nothing masks")]

use core::cell::Cell;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use critical_section::{CriticalSection, Mutex};

use super::clock::CLOCK_NOW;
use super::registers::Register;
use crate::boards::limits::WATCHDOG_TIMEOUT_US;

/// Address of the device, and offsets of its registers.
const WATCHDOG: usize = 0x4000_8000;
const LOAD: usize = 0;
const CTRL: usize = 8;
const INTCLR: usize = 12;
const LOCK: usize = 0xC00;
/// Value of LOCK with which the other registers can be written.
const UNLOCK: u32 = 0x1ACC_E551;
/// Reload value of the watchdog's timer, which runs down twice at 25 MHz before the reset: half the
/// timeout.
const RELOAD_COUNTS: u32 = WATCHDOG_TIMEOUT_US / 2 * 25;
/// Value of CTRL: NMI when the timer has run down once, reset when twice.
const INTERRUPT_AND_RESET: u32 = 0b11;

/// NMI handler: half of the timeout is over. Does nothing; the reset comes after the other half.
#[exception]
unsafe fn NonMaskableInt() {}

/// Time at which the watchdog was last fed, counts since the start.
static LAST_FED: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Time up to which lock step may skip the clock, counts since the start: `due`, or the watchdog's
/// reset time if that is earlier. Resets the board if the reset time is past. The device's timer
/// does not count skipped time, so this function does.
pub fn limit_skip_or_reset(cs: CriticalSection<'_>, now: u64, due: u64) -> u64 {
    let reset_time = LAST_FED.borrow(cs).get() + u64::from(2 * RELOAD_COUNTS);
    if now >= reset_time {
        SCB::sys_reset();
    }
    due.min(reset_time)
}

/// Stores the present time as that of the last feeding.
fn note_fed() {
    critical_section::with(|cs| LAST_FED.borrow(cs).set(CLOCK_NOW(cs)));
}

/// The watchdog; there is one instance.
pub struct Watchdog(pub(super) ());

impl Watchdog {
    /// Starts the watchdog.
    pub(super) fn start(&mut self) {
        Register::new(WATCHDOG, LOCK).write(UNLOCK);
        Register::new(WATCHDOG, LOAD).write(RELOAD_COUNTS);
        Register::new(WATCHDOG, CTRL).write(INTERRUPT_AND_RESET);
        note_fed();
    }

    /// Feeds the watchdog.
    pub fn feed(&mut self) {
        Register::new(WATCHDOG, INTCLR).write(1);
        note_fed();
    }
}
