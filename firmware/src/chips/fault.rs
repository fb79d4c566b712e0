//! Distinguishes a stack overflow from other faults, by the fault registers of a Cortex-M (ARMv7-M
//! ARM, B3.2.15 "CFSR"; ARMv8-M ARM, "UFSR.STKOF").

use core::ops::Range;

/// CFSR bit: a data access that the MPU refused; its address is in MMFAR if MMARVALID is set.
const DACCVIOL: u32 = 1 << 1;
/// CFSR bit: a refused push of registers at an exception's entry, without an address.
const MSTKERR: u32 = 1 << 4;
/// CFSR bit: a refused access while the floating-point registers were pushed.
const MLSPERR: u32 = 1 << 5;
/// CFSR bit: MMFAR holds an address.
const MMARVALID: u32 = 1 << 7;
/// CFSR bit of ARMv8-M alone: the stack pointer went below MSPLIM.
const STKOF: u32 = 1 << 20;

/// Whether a fault with these CFSR and MMFAR values is a stack overflow: the stack pointer went
/// below MSPLIM, a push of registers was refused, or a data access hit the address range `guard`
/// below the stack.
pub fn is_stack_overflow(cfsr: u32, mmfar: u32, guard: &Range<u32>) -> bool {
    let in_guard = cfsr & DACCVIOL != 0 && cfsr & MMARVALID != 0 && guard.contains(&mmfar);
    cfsr & (STKOF | MSTKERR | MLSPERR) != 0 || in_guard
}
