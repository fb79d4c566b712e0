//! The two Embassy executors, which run in interrupt handlers.
#![expect(unsafe_code, reason = "executors in interrupts")]

use cortex_m::interrupt::InterruptNumber;
use embassy_executor::{InterruptExecutor, SendSpawner};

/// Executor of links and setpoints.
static LINKS: InterruptExecutor = InterruptExecutor::new();
/// Executor of plans and flash.
static PLANS: InterruptExecutor = InterruptExecutor::new();

/// Starts the executor of links and setpoints in the interrupt `irq`, which no device uses and
/// whose priority is set. To be called once.
pub(super) fn start_links_executor(irq: impl InterruptNumber) -> SendSpawner {
    LINKS.start(irq)
}

/// Starts the executor of plans and flash in the interrupt `irq`. To be called once.
pub(super) fn start_plans_executor(irq: impl InterruptNumber) -> SendSpawner {
    PLANS.start(irq)
}

/// Body of the handler of the interrupt given to [`start_links_executor`].
///
/// # Safety
/// Only that handler may call it: the executor exists once its interrupt is enabled.
pub(super) unsafe fn poll_links_executor() {
    // SAFETY: the caller is the interrupt's handler.
    unsafe { LINKS.on_interrupt() }
}

/// Body of the handler of the interrupt given to [`start_plans_executor`].
///
/// # Safety
/// Only that handler may call it, as for [`poll_links_executor`].
pub(super) unsafe fn poll_plans_executor() {
    // SAFETY: the caller is the interrupt's handler.
    unsafe { PLANS.on_interrupt() }
}
