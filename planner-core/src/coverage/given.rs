//! Orders lanes that another tool has laid, as one vehicle would fly them.

use libm::roundf;

use super::cells;
use super::footprint::Spacing;
use super::lanes::{Lane, Tracks};
use super::order;
use super::strips::LaneFrame;
use super::sweep::LaneDirection;
use super::transit::TransitGraph;
use super::{CoverageError, Flat};
use crate::{Length, sort};

/// Orders parallel lanes, each given by its two ends, and turns each into the direction in which it
/// is flown, by the same search as the lanes of [`super::tracks::build_lanes`].
///
/// # Errors
/// Spacings that are wrong, memory that is too small, [`CoverageError::NothingToCover`] where no
/// lane has a length, [`CoverageError::Unreachable`] for an end inside a no-fly zone.
pub fn order_given_lanes<const L: usize, const N: usize>(
    given: &[[Flat; 2]],
    spacing: &Spacing,
    search_steps: u32,
    transit: &TransitGraph<'_, N>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    spacing.check()?;
    let longest = given.iter().map(|[from, to]| to - from);
    let longest = longest.max_by(|a, b| a.length().total_cmp(&b.length()));
    let along = longest.and_then(|lane| lane.try_normalize(1e-6));
    let direction = LaneDirection::along_vector(along.ok_or(CoverageError::NothingToCover)?);
    let frame = LaneFrame { origin: given[0][0], direction };
    out.lanes.clear();
    out.lane_direction = direction.along;
    for ends in given {
        let [from, to] = ends.map(|end| frame.to_lane_frame(&end));
        let mut lane =
            Lane { from, to, first_waypoint: 0, waypoint_count: 0, start_along_m: 0.0, strip: 0 };
        if to.x < from.x {
            lane.reverse();
        }
        out.lanes.push(lane).map_err(|_| CoverageError::LanesFull)?;
    }
    sort::heapsort_by(&mut out.lanes, |a, b| {
        a.from.y.total_cmp(&b.from.y).then(a.from.x.total_cmp(&b.from.x))
    });
    let low = out.lanes[0].from.y;
    for lane in &mut out.lanes {
        lane.strip = roundf((lane.from.y - low) / spacing.max_lane_spacing_m) as u16;
    }
    cells::group_into_cells(&mut out.lanes);
    for lane in &mut out.lanes {
        (lane.from, lane.to) =
            (frame.to_mission_frame(&lane.from), frame.to_mission_frame(&lane.to));
    }
    let count = out.lanes.len();
    order::order_lanes(&mut out.lanes, count, transit, search_steps);
    out.space_waypoints(spacing, transit)
}

#[cfg(test)]
mod tests;
