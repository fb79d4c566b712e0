//! The companion of one UAV, sans-IO: bytes and time in, bytes and events out.
//!
//! **Contract.** The shell, the program around the companion, owns links, clock and planner. It
//! calls [`Companion::handle_bytes`] with the bytes that a link received,
//! [`Companion::handle_timeout`] when [`Companion::poll_timeout`] is due, and
//! [`Companion::handle_plan`] with the answer to [`Event::PlanRequested`], which
//! [`planner::answer_plan_request`] makes. After *each* `handle_*` call it calls
//! [`Companion::poll_transmit`] for both links until it returns 0, and [`Companion::poll_event`]
//! until it returns `None`. With a flash ([`Companion::attach_store`]) it also calls
//! [`Companion::poll_flash`] and passes the outcome of each operation to
//! [`Companion::handle_flash`], whenever the operation is done. Times never go back. Every call
//! does bounded work.
//!
//! ```
//! use companion::link::frame::MAX_FRAME_LEN;
//! use companion::{Companion, Config, Instant, Link};
//! use planner_core::Point;
//! use planner_core::geo::frames::Geodetic;
//!
//! let origin = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
//! let config = Config::new(1, Point::new(0.0, 0.0, 2.0), origin);
//! let mut companion: Companion<8, 64, 64> = Companion::new(config)?; // vehicles, waypoints, gates
//! let now = Instant::from_millis(200);
//! let mut sent = 0;
//! companion.handle_bytes(Link::Swarm, now, b"noise is skipped");
//! companion.handle_timeout(now);
//! let mut buffer = [0; MAX_FRAME_LEN];
//! for link in [Link::Autopilot, Link::Swarm] {
//!     while let length @ 1.. = companion.poll_transmit(link, &mut buffer) {
//!         sent += length; // the shell writes `buffer[..length]` to the port
//!     }
//! }
//! while let Some(event) = companion.poll_event() {
//!     panic!("nothing has happened yet: {event:?}");
//! }
//! assert!(sent > 0, "a heartbeat on each link");
//! # Ok::<(), companion::ConfigError>(())
//! ```
//!
//! `examples/run_loop.rs` is a whole run loop.
//!
//! Setpoints, heartbeats, positions and intents are made when the shell polls a link, from the
//! newest state; for a link that is not polled old ones are dropped, not queued. Commands, acks and
//! texts wait in a queue of [`link::outbox::QUEUE_DEPTH`] entries; when it is full the newest is
//! dropped and counted ([`Companion::dropped_messages`]).
//!
//! The mission is the transition table of [`mission`], the same for every autopilot. Mode numbers,
//! type masks and stream rates of PX4 and ArduPilot are in [`autopilot::px4`] and
//! [`autopilot::ardupilot`]; [`autopilot::AutopilotKind`], known from the autopilot's first
//! HEARTBEAT, chooses between them.
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
pub mod planner;
mod replanning;
pub mod services;
mod state;
pub mod storage;
pub mod swarm;
#[cfg(test)]
mod testing;
pub mod time;
mod timers;

pub use companion::Companion;
pub use config::{Config, ConfigError, PlanFailure, RosterEntry};
pub use events::{Event, Link, PlanKind, PlanRequests};
pub use link::frame::{AUTOPILOT_COMPONENT, COMPANION_COMPONENT};
pub use mission::photographed::MAX_PHOTOGRAPHED_RANGES;
pub use state::State;
pub use time::{Duration, Instant};
