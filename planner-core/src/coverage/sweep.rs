//! The direction of the lanes: along the side of the hull across which it is least wide, so that
//! there are the fewest lanes and turns.
//!
//! Source: CPP §3.2.1 (after Huang 2001); rotating calipers: Shamos 1978. The hull is Andrew's
//! monotone chain. O(n log n).

use heapless::Vec;

use super::area::{Area, AreaError, RingKind};
use super::{CoverageError, Flat};
use crate::sort;

/// Lanes run along `along`; they are counted along `across`, a quarter turn to the left of it. Both
/// have length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneDirection {
    /// Along the lanes.
    pub along: Flat,
    /// Vector from lane to lane.
    pub across: Flat,
}

impl LaneDirection {
    /// Lanes at an angle, degrees from east to the left.
    pub fn at_deg(angle_deg: f32) -> Self {
        let (sin, cos) = libm::sincosf(angle_deg.to_radians());
        Self::along_vector(Flat::new(cos, sin))
    }

    /// Lanes along a vector of length 1.
    pub(super) fn along_vector(along: Flat) -> Self {
        Self { along, across: Flat::new(-along.y, along.x) }
    }
}

/// The direction across which the area's outer rings are least wide. `hull` is memory lent: as many
/// places as the outer rings have vertices.
///
/// # Errors
/// `AreaFull` where `hull` is too small.
pub fn least_width<const V: usize>(
    area: &Area<'_>,
    hull: &mut Vec<Flat, V>,
) -> Result<LaneDirection, CoverageError> {
    convex_hull(area, hull)?;
    let n = hull.len();
    let mut best = (f32::INFINITY, LaneDirection::along_vector(Flat::new(1.0, 0.0)));
    let mut far = 1;
    for i in 0..n {
        let (from, to) = (hull[i], hull[(i + 1) % n]);
        let Some(along) = (to - from).try_normalize(0.0) else { continue };
        let direction = LaneDirection::along_vector(along);
        let height = |k: usize| direction.across.dot(&(hull[k % n] - from));
        // Around the hull the furthest corner only moves on, n steps in all for all sides.
        if i == 0 {
            far = (0..n).max_by(|a, b| height(*a).total_cmp(&height(*b))).unwrap_or(0);
        }
        let mut steps = 0;
        while steps < n && height(far + 1) > height(far) {
            far = (far + 1) % n;
            steps += 1;
        }
        if height(far) < best.0 {
            best = (height(far), direction);
        }
    }
    Ok(best.1)
}

/// The corners of the convex hull of the outer rings, turning left.
fn convex_hull<const V: usize>(
    area: &Area<'_>,
    hull: &mut Vec<Flat, V>,
) -> Result<(), CoverageError> {
    hull.clear();
    let mut sorted: Vec<Flat, V> = Vec::new();
    for (_, ring) in area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::Outer) {
        sorted.extend_from_slice(ring).map_err(|_| AreaError::AreaFull)?;
    }
    sort::sort_by(&mut sorted, |a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let count = sorted.len();
    // The lower side from left to right, then the upper one back.
    let mut side = 0;
    for step in 0..2 * count {
        let place = sorted[if step < count { step } else { 2 * count - 1 - step }];
        // A vertex above the line between both ends is no corner of the lower side, and the other
        // way round.
        let above = (sorted[count - 1] - sorted[0]).perp(&(place - sorted[0]));
        if (step < count && above > 0.0) || (step > count && step + 1 < 2 * count && above <= 0.0) {
            continue;
        }
        if step == count {
            side = hull.len().saturating_sub(1);
        }
        while hull.len() >= side + 2 {
            let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
            if (b - a).perp(&(place - b)) > 0.0 {
                break;
            }
            hull.pop();
        }
        let closes = step > count && hull.first() == Some(&place);
        if hull.last() != Some(&place) && !closes {
            hull.push(place).map_err(|_| AreaError::AreaFull)?;
        }
    }
    Ok(())
}
