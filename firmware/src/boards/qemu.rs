//! Board support for QEMU's `mps2-an500`: a Cortex-M7 with FPU, linked against the STM32H743's
//! memory sizes.

use defmt_semihosting as _;

pub mod clock;
pub mod flash;
mod grants;
pub mod interrupts;
pub mod memory;
mod registers;
mod sleep;
pub mod uart;
mod vectors;
mod watchdog;

pub use flash::{Flash, LAYOUT};
pub use interrupts::LINKS_PRIORITY;
pub use sleep::sleep;
pub use uart::{Receiver, Transmitter};
pub use watchdog::Watchdog;

pub use super::sections::zero_sections;

use heapless::Vec;

use super::{mpu, resources};
use crate::chips::ResetCause;

/// Why the board was reset: QEMU does not report it.
pub fn reset_cause() -> ResetCause {
    ResetCause::Unknown
}

/// Restarts the board.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// What [`start`] returns on this board.
pub type Parts = resources::BoardResources<Receiver, Transmitter, Flash, Watchdog>;

/// Starts MPU, clock, watchdog, executors, UARTs and flash, then lock step if QEMU was started for
/// it. To be called once.
pub fn start() -> Parts {
    mpu::enable_regions(&[Some(mpu::stack_guard_region())]);
    clock::start();
    let mut watchdog = Watchdog(());
    watchdog.start();
    let parts = Parts {
        links: vectors::start_links_executor(),
        plans: vectors::start_plans_executor(),
        autopilot: uart::AUTOPILOT.start(interrupts::Irq::Uart0Rx),
        swarm: uart::SWARM.start(interrupts::Irq::Uart1Rx),
        flash: Flash::new(),
        watchdog,
        warnings: Vec::new(),
    };
    grants::start(|port, bytes| uart::of_port(port).receive_in_lock_step(bytes));
    parts
}
