//! The box and frame in which heights are requested from a file.

use planner_core::coverage::Flat;
use planner_core::geo::frames::Geodetic;

/// What a file's coordinates mean if it states no coordinate system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithoutCrs {
    /// Nothing: the file is refused.
    Refused,
    /// Metres from the origin, as the mission's own coordinates are.
    Metres,
}

/// Mission frame and box in which heights are requested.
#[derive(Clone, Copy, Debug)]
pub struct TerrainFrame<'a> {
    /// Origin of the mission frame. Its altitude is not subtracted: heights stay above sea level.
    pub origin: &'a Geodetic,
    /// What the file's coordinates mean if it states no coordinate system.
    pub without_crs: WithoutCrs,
    /// The requested box, metres: its least and its greatest corner; some cells around it are read
    /// too. `None` requests the whole file.
    pub window: Option<[Flat; 2]>,
}

/// Number of cells read around a window.
const WINDOW_BORDER_CELLS: f32 = 5.0;

/// The window, enlarged by [`WINDOW_BORDER_CELLS`] cells on each side.
pub(super) fn widened_window([low, high]: [Flat; 2], cell_m: f32) -> [Flat; 2] {
    let beyond = Flat::repeat(WINDOW_BORDER_CELLS * cell_m);
    [low - beyond, high + beyond]
}
