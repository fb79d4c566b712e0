//! The box and frame in which heights are requested from a file.

use planner_core::coverage::Flat;
use planner_core::frames::Geodetic;

/// Mission frame and box in which heights are requested.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Origin of the mission frame. Its altitude is not subtracted: heights stay above sea level.
    pub origin: &'a Geodetic,
    /// Whether coordinates without a coordinate system are metres from the origin.
    pub metres: bool,
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
