//! QEMU's `mps2-an500`: a Cortex-M7 with FPU, linked against the memory of the STM32H743.

pub mod clock;
pub mod interrupts;
pub mod memory;
mod registers;
pub mod uart;
