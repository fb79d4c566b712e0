//! Paths other than the plan's: detours, and the obstacles reported by ground stations.

pub(crate) mod detour;
pub(crate) mod obstacles;
pub(crate) mod view;
