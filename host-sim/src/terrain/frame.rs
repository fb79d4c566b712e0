//! Where heights are asked for.

use planner_core::coverage::Flat;
use planner_core::frames::Geodetic;

/// Box in which heights are requested.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Origin of the mission frame. Heights stay above sea level whatever its altitude.
    pub origin: &'a Geodetic,
    /// Whether numbers that name no coordinate system are metres about the origin.
    pub metres: bool,
    /// The box that is wanted, metres: its least and its greatest corner; some cells around it are
    /// read too. All of the file where absent.
    pub window: Option<[Flat; 2]>,
}

/// Cells read around a window.
const WINDOW_BORDER_CELLS: f32 = 5.0;

/// A window and the cells around it.
pub(super) fn widened_window([low, high]: [Flat; 2], cell_m: f32) -> [Flat; 2] {
    let beyond = Flat::repeat(WINDOW_BORDER_CELLS * cell_m);
    [low - beyond, high + beyond]
}
