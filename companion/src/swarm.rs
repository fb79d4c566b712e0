//! The other vehicles: what they report over the radio, detours around them, and the division of an
//! area among them.

pub(crate) mod detour;
pub mod fleet;
pub mod neighbours;
pub(crate) mod obstacles;
pub(crate) mod sweep;
pub(crate) mod view;
