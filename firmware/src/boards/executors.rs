//! The two executors that run in interrupts.
#![expect(unsafe_code, reason = "executors in interrupts")]

use cortex_m::interrupt::InterruptNumber;
use embassy_executor::{InterruptExecutor, SendSpawner};

static LINKS: InterruptExecutor = InterruptExecutor::new();
static PLANS: InterruptExecutor = InterruptExecutor::new();

/// Starts the executor of links and setpoints in an interrupt that no device has, its priority set.
/// To be called once.
pub(super) fn start_links(irq: impl InterruptNumber) -> SendSpawner {
    LINKS.start(irq)
}

/// Starts the executor of plans and flash.
pub(super) fn start_plans(irq: impl InterruptNumber) -> SendSpawner {
    PLANS.start(irq)
}

/// The handler of the interrupt given to [`start_links`].
///
/// # Safety
/// Only that handler may call it: the executor is there once its interrupt is enabled.
pub(super) unsafe fn poll_links_executor() {
    // SAFETY: as the caller says.
    unsafe { LINKS.on_interrupt() }
}

/// The handler of the interrupt given to [`start_plans`].
///
/// # Safety
/// As [`poll_links_executor`].
pub(super) unsafe fn poll_plans_executor() {
    // SAFETY: as the caller says.
    unsafe { PLANS.on_interrupt() }
}
