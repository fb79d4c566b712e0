//! What a fault was, by the registers of a Cortex-M (ARMv7-M ARM, B3.2.15 "CFSR"; ARMv8-M ARM,
//! "UFSR.STKOF").

use core::ops::Range;

/// An access to what the MPU guards, its address in MMFAR; or one while an exception was entered,
/// which has none.
const DACCVIOL: u32 = 1 << 1;
const MSTKERR: u32 = 1 << 4;
/// The same access while the floating-point registers were saved; and the bit that MMFAR holds an
/// address.
const MLSPERR: u32 = 1 << 5;
const MMARVALID: u32 = 1 << 7;
/// ARMv8-M alone: the stack pointer went below MSPLIM.
const STKOF: u32 = 1 << 20;

/// Whether the stack overflowed: it went below MSPLIM, or into the guard.
pub fn is_overflow(cfsr: u32, mmfar: u32, guard: &Range<u32>) -> bool {
    let in_guard = cfsr & DACCVIOL != 0 && cfsr & MMARVALID != 0 && guard.contains(&mmfar);
    cfsr & (STKOF | MSTKERR | MLSPERR) != 0 || in_guard
}
