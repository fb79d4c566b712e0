//! Sets of photographed waypoints of an area, as ranges of waypoint numbers. Waypoints are numbered
//! along the path over all lanes.

use heapless::{Vec, VecView};

/// The area's waypoints (places to photograph) with numbers `first` to `end` − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaypointRange {
    /// Number of the first waypoint.
    pub first: u32,
    /// Number of the last waypoint plus one.
    pub end: u32,
}

/// A set of waypoints, kept as at most `N` ranges in ascending order, which neither overlap nor
/// touch. No single waypoint is ever removed: the set only grows until it is cleared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WaypointSet<const N: usize> {
    /// The ranges, in ascending order.
    ranges: Vec<WaypointRange, N>,
}

impl<const N: usize> WaypointSet<N> {
    /// A set without waypoints.
    pub const fn new() -> Self {
        Self { ranges: Vec::new() }
    }

    /// The ranges in ascending order; none is empty, and none touches the next.
    pub fn ranges(&self) -> &[WaypointRange] {
        &self.ranges
    }

    /// Number of waypoints in the set.
    pub fn count(&self) -> u32 {
        self.ranges.iter().map(|range| range.end - range.first).fold(0, u32::saturating_add)
    }

    /// Whether the set has no waypoints.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Removes all waypoints.
    pub fn clear(&mut self) {
        self.ranges.clear();
    }

    /// Adds a range. Returns whether at least one of its waypoints was not in the set.
    ///
    /// # Errors
    /// Returns `range` if it neither overlaps nor touches a range of the set, and the set has `N`
    /// ranges already; the set is then unchanged.
    pub fn insert(&mut self, range: WaypointRange) -> Result<bool, WaypointRange> {
        insert(&mut self.ranges, range)
    }
}

/// [`WaypointSet::insert`] without the parameter `N`, so that the program has one copy of this
/// code.
fn insert(
    ranges: &mut VecView<WaypointRange>,
    range: WaypointRange,
) -> Result<bool, WaypointRange> {
    if range.first >= range.end {
        return Ok(false);
    }
    let from = ranges.iter().take_while(|held| held.end < range.first).count();
    let touched = ranges.iter().skip(from).take_while(|held| held.first <= range.end).count();
    let mut whole = range;
    for held in &ranges[from..from + touched] {
        if held.first <= range.first && range.end <= held.end {
            return Ok(false);
        }
        whole = WaypointRange { first: whole.first.min(held.first), end: whole.end.max(held.end) };
    }
    // The later ranges move: by one place towards the end to make room, or towards the front to
    // follow the range that now holds all touched ones.
    if touched == 0 {
        ranges.push(whole)?;
        ranges[from..].rotate_right(1);
    } else {
        ranges[from] = whole;
        ranges[from + 1..].rotate_left(touched - 1);
        ranges.truncate(ranges.len() + 1 - touched);
    }
    Ok(true)
}

#[cfg(test)]
mod tests;
