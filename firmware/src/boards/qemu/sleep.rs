//! How the processor sleeps.

use super::clock::{self, CLOCK_NOW};
use super::interrupts::{self, Irq};
use super::registers::Register;
use super::{grants, watchdog};

/// Sleeps until an interrupt comes.
pub fn sleep() {
    if grants::is_lock_step() {
        sleep_in_lock_step();
    } else {
        cortex_m::asm::wfi();
    }
}

/// Interrupt control and state, and that an interrupt waits.
const ICSR: usize = 0xE000_ED04;
const ISRPENDING: u32 = 1 << 22;

/// Sleeps in lock step: the time up to what is due next passes at once, unless an interrupt waits.
/// QEMU would have it pass too, where a processor sleeps by WFI; but its main loop reads the clock
/// before the last instructions are counted, if this machine is busy enough.
fn sleep_in_lock_step() {
    critical_section::with(|cs| {
        let now = CLOCK_NOW(cs);
        let alarm = clock::next_alarm(cs, now);
        // Asked after that: it wakes the tasks that are due by now, and their executors' interrupts
        // wait then.
        if Register::new(ICSR, 0).read() & ISRPENDING != 0 {
            return;
        }
        let due = alarm.min(grants::next_due(cs));
        clock::skip_time(cs, watchdog::counts_until_reset(cs, now, due).saturating_sub(now));
        // Both are set again for what is left.
        interrupts::pend(Irq::Timer1);
        interrupts::pend(Irq::DualTimer);
    });
}
