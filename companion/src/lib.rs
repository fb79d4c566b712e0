//! The companion of one UAV, sans-IO: bytes and time in, bytes and events out.
//!
//! **Contract.** The shell owns links, clock and planner. It calls [`Companion::handle_bytes`] with what a link received,
//! [`Companion::handle_timeout`] when [`Companion::poll_timeout`] is due, and [`Companion::handle_plan`] with the answer to
//! [`Event::PlanRequested`]. After *each* `handle_*` call it drains [`Companion::poll_transmit`] for both links until 0
//! and [`Companion::poll_event`] until `None`; with a flash ([`Companion::mount`]) also [`Companion::poll_flash`], and tells
//! [`Companion::handle_flash`] how each went, whenever that is. Times never go back. Every call does bounded work.
//!
//! Setpoints, heartbeats, positions and intents are made when polled, from the newest state; a link that is not polled
//! loses old ones instead of queueing them. Commands, acks and texts wait in a queue of [`link::outbox::DEPTH`]; when it is full
//! the newest is dropped and counted ([`Companion::dropped`]).
//!
//! The mission is the table of [`mission`], the same for every autopilot. The numbers of each are in [`autopilot::px4`] and
//! [`autopilot::ardupilot`]; [`autopilot::Kind`] chooses between them by HEARTBEAT.
#![no_std]
#![forbid(unsafe_code)]

pub mod autopilot;
mod companion;
pub mod config;
mod events;
mod guidance;
pub mod link;
pub mod margins;
pub mod mission;
pub mod services;
pub mod storage;
pub mod swarm;
#[cfg(test)]
mod testing;
pub mod time;
mod timers;

pub use companion::Companion;
pub use config::{Config, ConfigError, PlanFailure, RosterEntry};
pub use events::{Event, Link};
pub use mission::State;
pub use time::{Duration, Instant};

/// Our component id, `MAV_COMP_ID_ONBOARD_COMPUTER`.
pub const COMPONENT: u8 = 191;
/// The autopilot's component id, `MAV_COMP_ID_AUTOPILOT1`.
pub const AUTOPILOT: u8 = 1;
