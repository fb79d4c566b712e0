//! The vector table, priorities, and the executor that runs in an interrupt.
#![expect(unsafe_code, reason = "the vector table is the linker's, the interrupt controller is shared")]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use embassy_executor::SendSpawner;

use super::{clock, grants, uart};
use crate::boards::parts;

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
    /// What is due in lock step.
    DualTimer = 10,
    /// No device has it: it runs the executor of plans and flash.
    Plans = 30,
    /// No device has it: it runs the executor of links and setpoints.
    Links = 31,
}

// SAFETY: the numbers are places in the table below, and AN500 has 32.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

type Handler = Option<unsafe extern "C" fn()>;

/// One place for each of AN500's interrupts; cortex-m-rt puts it after the exceptions.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [Handler; 32] = {
    let mut table: [Handler; 32] = [None; 32];
    table[Irq::Uart0Rx as usize] = Some(uart0);
    table[Irq::Uart0Tx as usize] = Some(uart0);
    table[Irq::Uart1Rx as usize] = Some(uart1);
    table[Irq::Uart1Tx as usize] = Some(uart1);
    table[Irq::Timer0 as usize] = Some(timer0);
    table[Irq::Timer1 as usize] = Some(timer1);
    table[Irq::DualTimer as usize] = Some(dual_timer);
    table[Irq::Plans as usize] = Some(plans);
    table[Irq::Links as usize] = Some(links);
    table
};

unsafe extern "C" fn uart0() {
    uart::AUTOPILOT.on_interrupt();
}

unsafe extern "C" fn uart1() {
    uart::SWARM.on_interrupt();
}

unsafe extern "C" fn timer0() {
    clock::on_timer0();
}

unsafe extern "C" fn timer1() {
    clock::on_timer1();
}

unsafe extern "C" fn dual_timer() {
    grants::on_alarm();
}

unsafe extern "C" fn links() {
    // SAFETY: this is the handler.
    unsafe { parts::on_links() }
}

unsafe extern "C" fn plans() {
    // SAFETY: as above.
    unsafe { parts::on_plans() }
}

/// Starts the executor of links and setpoints. To be called once.
pub fn start_links() -> SendSpawner {
    set_priority(Irq::Links, LINKS);
    parts::start_links(Irq::Links)
}

/// Starts the executor of plans and flash. To be called once.
pub fn start_plans() -> SendSpawner {
    set_priority(Irq::Plans, PLANS);
    parts::start_plans(Irq::Plans)
}

fn set_priority(irq: Irq, priority: u8) {
    // SAFETY: only priorities are set, before the interrupt is enabled, at the start when nothing else runs.
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
