//! MAVLink as bytes: framing, ports, forwarding, and the numbers of messages and commands.

pub(crate) mod cmd;
pub(crate) mod command;
pub mod frame;
pub(crate) mod msg;
pub mod port;
pub(crate) mod routing;
pub mod wire;
