//! The other vehicles: what they report over the radio, and the division of an area among them.

pub mod fleet;
pub(crate) mod incremental_scan;
pub mod neighbours;
