//! Register values of the chips that are set or read before the companion runs: computed from the
//! manuals' definitions, without hardware access, so that the host can test them. `boards/` reads
//! and writes the registers; `docs/firmware.md` lists manual section and evidence for each.

pub mod fault;
pub mod h743;
pub mod mpu;
pub mod rp2350;

/// Why a chip was reset, by its own registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power-on.
    Power,
    /// The supply voltage was too low for a while.
    BrownOut,
    /// The reset pin was pulled, by the reset key.
    Key,
    /// The watchdog was not fed in time.
    Watchdog,
    /// Requested by the program or a debugger.
    Request,
    /// The chip's registers show no cause.
    Unknown,
}

#[cfg(test)]
mod tests;
