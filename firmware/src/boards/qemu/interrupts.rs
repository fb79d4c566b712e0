//! Numbers of the interrupts in use, and their priorities (a smaller number is more urgent).
#![expect(unsafe_code, reason = "the interrupt controller is shared")]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// Priority of the lock step's timer, the highest.
pub const GRANTS_PRIORITY: u8 = 0x20;
/// Priority of UARTs and clock timers.
pub const DEVICES_PRIORITY: u8 = 0x40;
/// Priority of the executor of links and setpoints, below devices.
pub const LINKS_PRIORITY: u8 = 0x80;
/// Priority of the executor of plans and flash, the lowest.
pub const PLANS_PRIORITY: u8 = 0xC0;

/// Interrupt numbers of AN500 that this board uses.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Irq {
    /// UART 0 has received a byte.
    Uart0Rx = 0,
    /// UART 0 can take a byte to send.
    Uart0Tx = 1,
    /// UART 1 has received a byte.
    Uart1Rx = 2,
    /// UART 1 can take a byte to send.
    Uart1Tx = 3,
    /// Timer 0, the clock, has wrapped round.
    Timer0 = 8,
    /// Timer 1: a sleeping task is due.
    Timer1 = 9,
    /// Dual timer: a record of lock step is due.
    DualTimer = 10,
    /// Used by no device; runs the executor of plans and flash.
    Plans = 30,
    /// Used by no device; runs the executor of links and setpoints.
    Links = 31,
}

// SAFETY: each number is an index of the vector table, which has 32 entries on AN500.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Sets the priority of an interrupt that is not enabled yet.
pub fn set_priority(irq: Irq, priority: u8) {
    // SAFETY: changes only this interrupt's priority, at the start, when nothing else runs.
    unsafe { cortex_m::Peripherals::steal().NVIC.set_priority(irq, priority) }
}

/// Sets an interrupt's priority and enables it.
pub fn enable(irq: Irq, priority: u8) {
    set_priority(irq, priority);
    // SAFETY: the handlers access shared state only by critical sections or atomics.
    unsafe { NVIC::unmask(irq) }
}

/// Makes the interrupt pending, so that its handler runs although no device raised it.
pub fn pend(irq: Irq) {
    NVIC::pend(irq);
}
