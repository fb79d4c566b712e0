//! What every board's `start` returns.

use embassy_executor::SendSpawner;
use heapless::Vec;

/// Most warnings of a board's start.
pub const MAX_WARNINGS: usize = 2;

/// The started board: executors' spawners, UARTs, flash, watchdog, warnings.
pub struct BoardResources<R, T, F, W> {
    /// Spawns tasks of links and setpoints, on the executor of higher priority.
    pub links: SendSpawner,
    /// Spawns tasks that take long, on the executor of lower priority.
    pub plans: SendSpawner,
    /// UART to the autopilot: receiver and transmitter.
    pub autopilot: (R, T),
    /// UART to the swarm's radio: receiver and transmitter.
    pub swarm: (R, T),
    /// Flash for files and parameters.
    pub flash: F,
    /// The watchdog, which already runs.
    pub watchdog: W,
    /// Warnings about the board's setup, sent to the operator by STATUSTEXT.
    pub warnings: Vec<&'static str, MAX_WARNINGS>,
}
