//! Back-and-forth lanes over an area that may be concave and have holes and no-fly zones.
//!
//! Source: paper CPP §3.2.1, Fig. 4. The area is cut into strips of equal width, at most the lane
//! spacing. In each strip a lane runs along the middle, from border to border of the area along
//! that line, and further where the strip's area would otherwise extend beyond the last image. The
//! "simple" and "sampled" patterns of the paper have the same lanes: the first packs whole lanes,
//! the second single waypoints ([`super::pack::TrackUnit`]).
//!
//! Lane frame: `u` along the lanes, `v` across them, metres from the area's first vertex. O(lanes ·
//! vertices), and the ordering of the lanes ([`super::order`]).

use super::CoverageError;
use super::area::{Area, AreaError};
use super::cells;
use super::order;
use super::patches;
use super::strips::{LaneFrame, Strips};
use super::sweep::{LaneDirection, direction_of_least_width};
use super::transit::TransitGraph;

pub use super::lanes::{Lane, LanePattern, Tracks};
pub use super::strips::LaneWorkspace;

/// Computes the lanes over an area, in the order in which one vehicle would fly them.
///
/// # Errors
/// Settings out of range, memory too small, [`CoverageError::NothingToCover`].
pub fn build_lanes<const L: usize, const V: usize, const N: usize>(
    area: &Area<'_>,
    pattern: &LanePattern,
    transit: &TransitGraph<'_, N>,
    ws: &mut LaneWorkspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    pattern.spacing.check()?;
    if !(pattern.border_overshoot_m >= 0.0 && pattern.border_overshoot_m.is_finite()) {
        return Err(CoverageError::SettingOutOfRange("margin_m"));
    }
    if area.vertices().len() > V {
        return Err(AreaError::AreaFull.into());
    }
    let LaneWorkspace { vertices, sets } = ws;
    let direction = match pattern.angle_from_east_deg {
        Some(angle) if angle.is_finite() => LaneDirection::at_deg(angle),
        Some(_) => return Err(CoverageError::SettingOutOfRange("angle_deg")),
        None => direction_of_least_width(area, vertices)?,
    };
    out.lanes.clear();
    out.lane_direction = direction.along;
    let frame = LaneFrame::new(area, direction);
    vertices.clear();
    vertices.extend_from_slice(area.vertices()).map_err(|_| AreaError::AreaFull)?;
    vertices.iter_mut().for_each(|vertex| *vertex = frame.to_lane_frame(vertex));
    let strips = Strips::new(&area.with_vertices(vertices), pattern)?;
    for strip in 0..strips.count {
        let span = strips.strip_borders(strip);
        strips.compute_needed(span, sets)?;
        strips.lay_lanes(strip as u16, strips.centre_line(span), sets, out)?;
    }
    let count = out.lanes.len();
    if area.has_no_fly() {
        patches::lay_missing_lanes(&strips, sets, out)?;
    }
    cells::group_into_cells(&mut out.lanes[..count]);
    for lane in &mut out.lanes {
        (lane.from, lane.to) =
            (frame.to_mission_frame(&lane.from), frame.to_mission_frame(&lane.to));
    }
    if out.lanes.is_empty() {
        return Err(CoverageError::NothingToCover);
    }
    order::order_lanes(&mut out.lanes, count, transit, pattern.max_search_steps);
    out.space_waypoints(&pattern.spacing, transit)
}
