//! What every board hands over at its start.

use embassy_executor::SendSpawner;
use heapless::Vec;

/// Most warnings.
pub const MAX_WARNINGS: usize = 2;

/// A board, ready: with its receivers, transmitters, flash and watchdog.
pub struct BoardResources<R, T, F, W> {
    /// Runs links and setpoints, by interrupt.
    pub links: SendSpawner,
    /// Runs what takes long, by an interrupt below that.
    pub plans: SendSpawner,
    /// UART to the autopilot.
    pub autopilot: (R, T),
    /// UART to the swarm's radio.
    pub swarm: (R, T),
    /// Flash for files and parameters.
    pub flash: F,
    /// Awake.
    pub watchdog: W,
    /// Warnings about the board for a person.
    pub warnings: Vec<&'static str, MAX_WARNINGS>,
}
