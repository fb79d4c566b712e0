//! The time limits of a fleet.

use crate::time::Duration;

/// Time for which a vehicle continues photographing after a majority last reported that they hear
/// it.
pub const LEASE: Duration = Duration::from_secs(20);
/// Greatest age of a report that renews the lease.
pub const LEASE_HEARD_WITHIN: Duration = Duration::from_secs(1);
/// Silence after which a vehicle's share is divided among the others.
pub const SILENT_AFTER: Duration = Duration::from_secs(45);

/// Time limits of a fleet. A vehicle that has no lease lands after twice the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FleetTimeouts {
    /// As [`LEASE`].
    pub lease: Duration,
    /// As [`LEASE_HEARD_WITHIN`].
    pub heard: Duration,
    /// As [`SILENT_AFTER`].
    pub silent: Duration,
    /// A lost vehicle is down once it has been silent for so long.
    pub down: Duration,
}

impl FleetTimeouts {
    /// Time limits of a flight in which a vehicle that no other vehicle hears any more is down
    /// after `down`.
    pub const fn of_flight(down: Duration) -> Self {
        Self { lease: LEASE, heard: LEASE_HEARD_WITHIN, silent: SILENT_AFTER, down }
    }
}
