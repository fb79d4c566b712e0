//! The interrupts that are used, and their priorities.
#![expect(unsafe_code, reason = "the interrupt controller is shared")]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// Priority of the desk's grants, above all.
pub const GRANTS: u8 = 0x20;
/// Priority of devices.
pub const DEVICES: u8 = 0x40;
/// Priority of links and setpoints, below devices.
pub const LINKS: u8 = 0x80;
/// Priority of plans and flash, below all.
pub const PLANS: u8 = 0xC0;

/// The interrupts that are used.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Irq {
    /// UART 0 has a byte.
    Uart0Rx = 0,
    /// UART 0 has room.
    Uart0Tx = 1,
    /// UART 1 has a byte.
    Uart1Rx = 2,
    /// UART 1 has room.
    Uart1Tx = 3,
    /// Timer 0 has gone round.
    Timer0 = 8,
    /// An alarm is due.
    Timer1 = 9,
    /// Alarms in lock step.
    DualTimer = 10,
    /// No device has it: it runs the executor of plans and flash.
    Plans = 30,
    /// No device has it: it runs the executor of links and setpoints.
    Links = 31,
}

// SAFETY: the numbers are places in the vector table, and AN500 has 32.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Sets the priority of one that is not enabled yet.
pub fn set_priority(irq: Irq, priority: u8) {
    // SAFETY: only priorities are set, before the interrupt is enabled, at the start when nothing
    // else runs.
    unsafe { cortex_m::Peripherals::steal().NVIC.set_priority(irq, priority) }
}

/// Lets a device interrupt.
pub fn enable(irq: Irq, priority: u8) {
    set_priority(irq, priority);
    // SAFETY: the handler takes its state by critical sections or atomics alone.
    unsafe { NVIC::unmask(irq) }
}

/// Has the handler run as if the device had asked.
pub fn pend(irq: Irq) {
    NVIC::pend(irq);
}
