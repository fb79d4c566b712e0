//! The two links, to the autopilot and to the swarm: framing and what uses it.

pub mod budget;
pub mod commands;
pub mod echo;
pub mod frame;
pub mod intent;
pub mod outbox;
pub(crate) mod senders;
mod transmit;
