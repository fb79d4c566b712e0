//! Register values of the RP2350, by its data sheet; bit positions by `rp-pac` 7.0.

use super::ResetCause;

/// Value of PSM_WDSEL: the parts of the chip that the watchdog resets (data sheet, "Power-on State
/// Machine", registers). All 25 but the two oscillators, bits 2 and 3. embassy-rp 0.10 sets the
/// RP2040's mask, 0x1fffc, which would not reset both processors, SIO and the flash interface.
pub const WATCHDOG_RESETS: u32 = 0x01FF_FFFF & !(1 << 2 | 1 << 3);

/// `CCR.STKOFHFNMIGN`: the hard fault handler may use the stack below MSPLIM; else it could not
/// record a stack overflow (ARMv8-M ARM, "CCR").
pub const STKOFHFNMIGN: u32 = 1 << 10;

/// UARTIFLS.RXIFLSEL: a receive interrupt when the FIFO of 32 bytes holds 8. Then 24 bytes are
/// free, 260 µs at 921 600 baud. embassy-rp 0.10 sets 28, which leaves 4 bytes, 43 µs.
pub const RX_QUARTER: u8 = 0b001;

/// Reset cause by POWMAN_CHIP_RESET and WATCHDOG_REASON (data sheet, "Chip level resets" and
/// "Watchdog", registers).
pub const fn reset_cause(chip_reset: u32, watchdog_reason: u32) -> ResetCause {
    // Bits of CHIP_RESET.
    const POWER: u32 = 1 << 16;
    const BROWN_OUT: u32 = 1 << 17;
    const RUN_PIN: u32 = 1 << 18;
    const GLITCH: u32 = 1 << 26;
    /// Three reset sources of a debugger: its request, its rescue reset, its hazard reset.
    const DEBUGGER: u32 = 1 << 19 | 1 << 21 | 1 << 27;
    // Bits of WATCHDOG_REASON: not fed in time; triggered by the program.
    const TIMED_OUT: u32 = 1 << 0;
    const FORCED: u32 = 1 << 1;
    // CHIP_RESET holds the cause of the last reset of the whole chip; a watchdog reset may have
    // followed, so WATCHDOG_REASON is checked first.
    match chip_reset {
        _ if watchdog_reason & FORCED != 0 => ResetCause::Request,
        _ if watchdog_reason & TIMED_OUT != 0 => ResetCause::Watchdog,
        _ if chip_reset & (BROWN_OUT | GLITCH) != 0 && chip_reset & POWER == 0 => {
            ResetCause::BrownOut
        }
        _ if chip_reset & POWER != 0 => ResetCause::Power,
        _ if chip_reset & RUN_PIN != 0 => ResetCause::Key,
        _ if chip_reset & DEBUGGER != 0 => ResetCause::Request,
        _ => ResetCause::Unknown,
    }
}
