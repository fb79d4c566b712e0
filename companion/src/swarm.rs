//! The other vehicles: what is heard of them, and detours around them.

pub(crate) mod detour;
pub mod fleet;
pub mod neighbours;
pub(crate) mod obstacles;
pub(crate) mod sweep;
pub(crate) mod view;
