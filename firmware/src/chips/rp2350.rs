//! RP2350: its data sheet, and `rp-pac` 7.0 for the places of bits.

use super::ResetCause;

/// PSM_WDSEL: the parts that the watchdog resets (data sheet, "Power-on State Machine", registers):
/// all 25 but the two oscillators, bits 2 and 3. embassy-rp 0.10 sets the RP2040's mask, 0x1fffc:
/// it would leave both processors, SIO and the flash interface as they are.
pub const WATCHDOG_RESETS: u32 = 0x01FF_FFFF & !(1 << 2 | 1 << 3);

/// `CCR.STKOFHFNMIGN`: the handler of hard faults may go below MSPLIM, else it could not say that
/// the stack overflowed (ARMv8-M ARM, "CCR").
pub const STKOFHFNMIGN: u32 = 1 << 10;

/// UARTIFLS.RXIFLSEL: an interrupt for each 8 bytes. embassy-rp 0.10 sets 28, which leaves room for
/// 4 of 32 bytes, 43 µs at 921 600 baud; 24 bytes are 260 µs.
pub const RX_QUARTER: u8 = 0b001;

/// Reason why it started: POWMAN_CHIP_RESET and WATCHDOG_REASON (data sheet, "Chip level resets"
/// and "Watchdog", registers).
pub const fn reset_cause(chip_reset: u32, watchdog_reason: u32) -> ResetCause {
    const POWER: u32 = 1 << 16;
    const BROWN_OUT: u32 = 1 << 17;
    const RUN_PIN: u32 = 1 << 18;
    const GLITCH: u32 = 1 << 26;
    /// Debugger: its own request, a rescue, the hazard debugger's.
    const DEBUGGER: u32 = 1 << 19 | 1 << 21 | 1 << 27;
    const TIMED_OUT: u32 = 1 << 0;
    const FORCED: u32 = 1 << 1;
    // The chip's register shows its last reset as a whole, the watchdog's a later one.
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
