//! The autopilot: which it is and its numbers, what it reports, and what is requested of it.

pub mod ardupilot;
pub(crate) mod handshake;
mod kind;
pub(crate) mod limits;
pub mod px4;
pub(crate) mod requests;
pub mod telemetry;

pub use self::kind::AutopilotKind;
