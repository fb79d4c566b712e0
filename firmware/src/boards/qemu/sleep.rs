//! How the emulated processor sleeps.

use super::clock::{self, CLOCK_NOW};
use super::interrupts::{self, Irq};
use super::registers::Register;
use super::{grants, watchdog};

/// Halts the processor until an interrupt; in lock step it skips the time instead.
pub fn sleep() {
    if grants::is_lock_step() {
        sleep_in_lock_step();
    } else {
        cortex_m::asm::wfi();
    }
}

/// Address of the interrupt control and state register, and its bit for a pending interrupt.
const ICSR: usize = 0xE000_ED04;
const ISRPENDING: u32 = 1 << 22;

/// Skips the clock to the time at which the next task, record or watchdog reset is due, unless an
/// interrupt is pending. With WFI QEMU would skip the time too, but on a busy host its main loop
/// reads the clock before it has counted the last instructions, so flights would not repeat.
fn sleep_in_lock_step() {
    critical_section::with(|cs| {
        let now = CLOCK_NOW(cs);
        let alarm = clock::next_alarm(cs, now);
        // Checked after `next_alarm`, which wakes the tasks that are due: their executors'
        // interrupts are pending then.
        if Register::new(ICSR, 0).read() & ISRPENDING != 0 {
            return;
        }
        let due = alarm.min(grants::next_record_due(cs));
        clock::skip_time(cs, watchdog::limit_skip_or_reset(cs, now, due).saturating_sub(now));
        // Both handlers set their timers again for the remaining time.
        interrupts::pend(Irq::Timer1);
        interrupts::pend(Irq::DualTimer);
    });
}
