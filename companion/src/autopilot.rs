//! The autopilot: its kind (PX4 or ArduPilot) with that kind's numbers, its telemetry, and the
//! requests sent to it.

pub mod ardupilot;
pub(crate) mod arming;
pub(crate) mod handshake;
mod kind;
mod landed;
pub(crate) mod limits;
pub mod px4;
pub mod telemetry;

pub use self::kind::AutopilotKind;
