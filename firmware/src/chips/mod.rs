//! What is written to and read from registers of the chips before anything runs: values that the
//! manuals give, worked out where the desk can test them. `boards/` writes and reads them;
//! `docs/firmware.md` names section and evidence of each.

pub mod fault;
pub mod h743;
pub mod mpu;
pub mod rp2350;

/// Reason why a chip started, by its own registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// The power came.
    Power,
    /// The supply was too low for a while.
    BrownOut,
    /// A person pressed reset.
    Key,
    /// The watchdog was not fed.
    Watchdog,
    /// The program or a debugger asked for it.
    Request,
    /// The chip does not say.
    Unknown,
}

#[cfg(test)]
mod tests;
