//! What every board hands over at its start.

use embassy_executor::SendSpawner;
use heapless::Vec;

/// Most warnings.
pub const WARNINGS: usize = 2;

/// A board, ready: with its receivers, transmitters, flash and watchdog.
pub struct Parts<R, T, F, W> {
    /// Runs links and setpoints, by interrupt.
    pub links: SendSpawner,
    /// Runs what takes long, by an interrupt below that.
    pub plans: SendSpawner,
    /// To the autopilot.
    pub autopilot: (R, T),
    /// To the swarm's radio.
    pub swarm: (R, T),
    /// For files and parameters.
    pub flash: F,
    /// Awake.
    pub watchdog: W,
    /// What a person should know of the board.
    pub warnings: Vec<&'static str, WARNINGS>,
}
