//! QEMU's `mps2-an500`: a Cortex-M7 with FPU, linked against the memory of the STM32H743.

use defmt_semihosting as _;

pub mod clock;
pub mod flash;
mod grants;
pub mod interrupts;
pub mod memory;
mod registers;
pub mod uart;
mod watchdog;

pub use flash::{Flash, LAYOUT};
pub use interrupts::LINKS as LINKS_PRIORITY;
pub use uart::{Receiver, Transmitter};
pub use watchdog::Watchdog;

use heapless::Vec;

use super::mpu;
use super::parts::Parts;
use crate::chips::ResetCause;

/// This board does not say.
pub fn reset_cause() -> ResetCause {
    ResetCause::Unknown
}

/// Restarts.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Sleeps until an interrupt comes.
pub fn sleep() {
    if grants::are_needed() {
        clock::skip();
    } else {
        cortex_m::asm::wfi();
    }
}

/// Starts the board. To be called once.
pub fn start() -> Parts {
    mpu::enable(&[Some(mpu::guard())]);
    clock::start();
    let mut watchdog = Watchdog(());
    watchdog.wake();
    let parts = Parts {
        links: interrupts::start_links(),
        plans: interrupts::start_plans(),
        autopilot: uart::AUTOPILOT.start(interrupts::Irq::Uart0Rx),
        swarm: uart::SWARM.start(interrupts::Irq::Uart1Rx),
        flash: Flash::new(),
        watchdog,
        warnings: Vec::new(),
    };
    grants::start();
    parts
}
