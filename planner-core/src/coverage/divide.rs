//! The waypoints of a path that remain after the loss of a vehicle, as a path of their own, which
//! [`super::pack::binpat`] then divides among the remaining vehicles.
//!
//! A pure function of the path and of the waypoints that are photographed or promised (a vehicle
//! will still photograph them before it holds), so that every vehicle computes the same bits.
//! Remaining waypoints keep their order and their lane; the removed parts of the path between them
//! become transits.

use super::CoverageError;
use super::tracks::{Lane, Tracks};
use super::transit::TransitGraph;
use crate::flight::WaypointRange;

/// Writes the lanes without the waypoints `done` to `left`. The ranges must be in ascending order
/// and not overlap. A remaining waypoint gets a new number; [`number_on_whole_path`] returns
/// its number on the whole path.
///
/// # Errors
/// [`CoverageError::SettingOutOfRange`] for ranges out of order or beyond the path,
/// [`CoverageError::LanesFull`], [`CoverageError::NothingToCover`] if no waypoint is left,
/// [`CoverageError::Unreachable`].
pub fn remaining_lanes<const L: usize, const N: usize>(
    tracks: &Tracks<L>,
    done: &[WaypointRange],
    transit: &TransitGraph<'_, N>,
    left: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    if !is_sorted_disjoint(done)
        || done.last().is_some_and(|range| range.end > tracks.waypoint_count())
    {
        return Err(CoverageError::SettingOutOfRange("done"));
    }
    left.lanes.clear();
    left.lane_direction = tracks.lane_direction;
    for lane in tracks.lanes() {
        let end = lane.first_waypoint + lane.waypoint_count;
        let mut from = lane.first_waypoint;
        for range in
            done.iter().filter(|range| range.first < end && range.end > lane.first_waypoint)
        {
            push_lane_part(lane, from, range.first.max(lane.first_waypoint), left)?;
            from = range.end.min(end);
        }
        push_lane_part(lane, from, end, left)?;
    }
    if left.lanes.is_empty() {
        return Err(CoverageError::NothingToCover);
    }
    left.number_and_measure(transit)
}

/// Whether the ranges are in ascending order and do not overlap.
pub(super) fn is_sorted_disjoint(done: &[WaypointRange]) -> bool {
    done.iter().all(|range| range.first <= range.end)
        && done.windows(2).all(|pair| pair[0].end <= pair[1].first)
}

/// Appends the waypoints `from` to `end` − 1 of a lane, by their numbers on the whole path, to
/// `left` as a lane; nothing if there are none.
fn push_lane_part<const L: usize>(
    lane: &Lane,
    from: u32,
    end: u32,
    left: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    if from >= end {
        return Ok(());
    }
    let part = Lane {
        from: lane.waypoint(from - lane.first_waypoint),
        to: lane.waypoint(end - 1 - lane.first_waypoint),
        first_waypoint: 0,
        waypoint_count: end - from,
        start_along_m: 0.0,
        strip: lane.strip,
    };
    left.lanes.push(part).map_err(|_| CoverageError::LanesFull)
}

/// The number on the whole path of the waypoint with `number` on the path without the ranges
/// `done`. `u32::MAX` instead of an overflow.
pub fn number_on_whole_path(done: &[WaypointRange], number: u32) -> u32 {
    let mut whole = number;
    for range in done.iter().filter(|range| range.first < range.end) {
        if whole < range.first {
            break;
        }
        whole = whole.saturating_add(range.end - range.first);
    }
    whole
}
