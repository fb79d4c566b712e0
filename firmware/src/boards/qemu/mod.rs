//! QEMU's `mps2-an500`: a Cortex-M7 with FPU, linked against the memory of the STM32H743.

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
pub use interrupts::LINKS as LINKS_PRIORITY;
pub use sleep::sleep;
pub use uart::{Receiver, Transmitter};
pub use watchdog::Watchdog;

use heapless::Vec;

use super::{mpu, parts};
use crate::chips::ResetCause;

/// This board does not report a cause.
pub fn reset_cause() -> ResetCause {
    ResetCause::Unknown
}

/// Restarts.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// The parts of this board, ready.
pub type Parts = parts::BoardResources<Receiver, Transmitter, Flash, Watchdog>;

/// Starts the board. To be called once.
pub fn start() -> Parts {
    mpu::enable_regions(&[Some(mpu::stack_guard_region())]);
    clock::start();
    let mut watchdog = Watchdog(());
    watchdog.start();
    let parts = Parts {
        links: vectors::start_links(),
        plans: vectors::start_plans(),
        autopilot: uart::AUTOPILOT.start(interrupts::Irq::Uart0Rx),
        swarm: uart::SWARM.start(interrupts::Irq::Uart1Rx),
        flash: Flash::new(),
        watchdog,
        warnings: Vec::new(),
    };
    grants::start(|port, bytes| uart::of_port(port).receive_in_lock_step(bytes));
    parts
}
