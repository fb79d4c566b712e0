//! The interrupt vector table: the handler of each interrupt, those of the two executors included.
#![expect(unsafe_code, reason = "the vector table is the linker's")]

use embassy_executor::SendSpawner;

use super::interrupts::{self, Irq};
use super::{clock, grants, uart};
use crate::boards::executors;

/// An interrupt's handler; `None` for an interrupt that is not used.
type Handler = Option<unsafe extern "C" fn()>;

/// One entry for each of AN500's interrupts; cortex-m-rt places the table after the exceptions.
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
    grants::on_record_due();
}

unsafe extern "C" fn links() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_links_executor() }
}

unsafe extern "C" fn plans() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_plans_executor() }
}

/// Starts the executor of links and setpoints. To be called once.
pub fn start_links_executor() -> SendSpawner {
    interrupts::set_priority(Irq::Links, interrupts::LINKS_PRIORITY);
    executors::start_links_executor(Irq::Links)
}

/// Starts the executor of plans and flash. To be called once.
pub fn start_plans_executor() -> SendSpawner {
    interrupts::set_priority(Irq::Plans, interrupts::PLANS_PRIORITY);
    executors::start_plans_executor(Irq::Plans)
}
