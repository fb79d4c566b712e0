//! The clock and embassy-time's driver: CMSDK timer 0 counts time, timer 1 raises an interrupt when
//! the next task is due.
//!
//! Both run at 25 MHz, 40 ns a count. With QEMU's `-icount shift=0` an instruction takes 1 ns, so a
//! count is 40 instructions. In lock step (`shift=1`) an instruction takes 2 ns.

use core::cell::{Cell, RefCell};
use core::task::Waker;

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

use super::interrupts::{self, Irq};
use super::registers::Register;

/// Timer counts in a microsecond.
pub(super) const COUNTS_PER_US: u64 = 25;
/// Instructions in a timer count, with `-icount shift=0`.
const INSTRUCTIONS_PER_COUNT: u64 = 40;
/// Addresses of the timers.
const TIMER0: usize = 0x4000_0000;
const TIMER1: usize = 0x4000_1000;
/// Offsets of a timer's registers.
const CTRL: usize = 0;
const VALUE: usize = 4;
const RELOAD: usize = 8;
const INTSTATUS: usize = 12;
/// Bits of CTRL.
const ENABLE: u32 = 1;
const INTERRUPT: u32 = 8;

/// The clock by timer 0, and the tasks that wait for a time.
struct Clock {
    /// Number of times that timer 0 has wrapped round.
    timer0_wraps: Mutex<Cell<u32>>,
    /// Tasks that wait, by their times.
    queue: Mutex<RefCell<Queue>>,
    /// Counts that lock step has skipped while the processor slept; timer 0 did not count them.
    skipped_counts: Mutex<Cell<u64>>,
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock {
    timer0_wraps: Mutex::new(Cell::new(0)),
    queue: Mutex::new(RefCell::new(Queue::new())),
    skipped_counts: Mutex::new(Cell::new(0)),
});

/// Starts both timers.
pub fn start() {
    Register::new(TIMER0, RELOAD).write(u32::MAX);
    Register::new(TIMER0, CTRL).write(ENABLE | INTERRUPT);
    // Timer 1 runs down from its value once: it has no reload value.
    Register::new(TIMER1, VALUE).write(u32::MAX);
    Register::new(TIMER1, CTRL).write(ENABLE | INTERRUPT);
    interrupts::enable(Irq::Timer0, interrupts::DEVICES_PRIORITY);
    interrupts::enable(Irq::Timer1, interrupts::DEVICES_PRIORITY);
}

/// Interrupt handler of timer 0, which has wrapped round: counts the wrap.
pub fn on_timer0() {
    critical_section::with(CLOCK_NOW);
}

/// Interrupt handler of timer 1: wakes the tasks that are due and sets the timer for the next one.
pub fn on_timer1() {
    critical_section::with(|cs| {
        Register::new(TIMER1, INTSTATUS).write(1);
        CLOCK.arm_timer1(cs);
    });
}

/// Reads the clock: counts since the start. Also counts a wrap of timer 0 whose interrupt has not
/// run yet.
pub(super) const CLOCK_NOW: fn(CriticalSection<'_>) -> u64 = |cs| {
    let wraps = CLOCK.timer0_wraps.borrow(cs);
    let before = Register::new(TIMER0, VALUE).read();
    let wrapped = Register::new(TIMER0, INTSTATUS).read() != 0;
    let mut value = before;
    if wrapped {
        Register::new(TIMER0, INTSTATUS).write(1);
        wraps.set(wraps.get() + 1);
        // Read again: the first value may be from before the wrap.
        value = Register::new(TIMER0, VALUE).read();
    }
    (u64::from(wraps.get()) << 32 | u64::from(u32::MAX - value))
        + CLOCK.skipped_counts.borrow(cs).get()
};

/// Time at which the next sleeping task is due, counts since the start; `u64::MAX` if none sleeps.
/// Wakes the tasks that are due at `now`.
pub(super) fn next_alarm(cs: CriticalSection<'_>, now: u64) -> u64 {
    CLOCK
        .queue
        .borrow(cs)
        .borrow_mut()
        .next_expiration(now / COUNTS_PER_US)
        .saturating_mul(COUNTS_PER_US)
}

/// Advances the clock by `counts` without running, in lock step.
pub(super) fn skip_time(cs: CriticalSection<'_>, counts: u64) {
    let skipped = CLOCK.skipped_counts.borrow(cs);
    skipped.set(skipped.get() + counts);
}

/// Instructions executed since the start, with `-icount shift=0`, in steps of 40.
pub fn instructions() -> u64 {
    critical_section::with(CLOCK_NOW) * INSTRUCTIONS_PER_COUNT
}

impl Clock {
    /// Wakes the tasks that are due, and sets timer 1 for the next one.
    fn arm_timer1(&self, cs: CriticalSection<'_>) {
        let mut queue = self.queue.borrow(cs).borrow_mut();
        loop {
            let now = CLOCK_NOW(cs);
            let next_us = queue.next_expiration(now / COUNTS_PER_US);
            if next_us == u64::MAX {
                return;
            }
            let due = next_us.saturating_mul(COUNTS_PER_US);
            if due > now {
                // If the task is due later than the timer can count, the timer's interrupt comes
                // early and calls this function again.
                let wait = (due - now).min(u64::from(u32::MAX)) as u32;
                Register::new(TIMER1, VALUE).write(wait);
                return;
            }
        }
    }
}

impl Driver for Clock {
    fn now(&self) -> u64 {
        critical_section::with(CLOCK_NOW) / COUNTS_PER_US
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            let changed = self.queue.borrow(cs).borrow_mut().schedule_wake(at, waker);
            if changed {
                self.arm_timer1(cs);
            }
        });
    }
}
