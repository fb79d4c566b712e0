//! The time limits of a fleet.

use crate::margins::LEASE_S;
use crate::time::Duration;

/// Time for which a vehicle photographs on after a majority last reported that they hear it.
pub const LEASE: Duration = Duration::from_secs(LEASE_S);
/// Greatest age of a neighbour's report that renews the lease.
pub const LEASE_HEARD_WITHIN: Duration = Duration::from_secs(1);
/// Silence of a vehicle after which it counts as lost, and the others divide its share of the area.
pub const LOST_AFTER_SILENCE: Duration = Duration::from_secs(45);

/// Time limits of a fleet. A vehicle without a lease lands after twice the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FleetTimeouts {
    /// Time for which a renewed lease lasts, as [`LEASE`].
    pub lease: Duration,
    /// Greatest age of a report that renews the lease, as [`LEASE_HEARD_WITHIN`].
    pub heard_within: Duration,
    /// Silence after which a vehicle counts as lost, as [`LOST_AFTER_SILENCE`].
    pub lost_after: Duration,
    /// Silence after which a lost vehicle is down, at whatever height it was lost.
    pub down_after: Duration,
}

impl FleetTimeouts {
    /// The constant limits ([`LEASE`], [`LEASE_HEARD_WITHIN`], [`LOST_AFTER_SILENCE`]), with this
    /// `down_after`.
    pub const fn of_flight(down_after: Duration) -> Self {
        Self {
            lease: LEASE,
            heard_within: LEASE_HEARD_WITHIN,
            lost_after: LOST_AFTER_SILENCE,
            down_after,
        }
    }
}
