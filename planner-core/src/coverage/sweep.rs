//! The direction of the lanes: that across which the area's convex hull is least wide, so that
//! lanes and turns are fewest. This direction is parallel to a side of the hull.
//!
//! Source: paper CPP §3.2.1 (after Huang 2001); rotating calipers: Shamos 1978; hull: Andrew's
//! monotone chain. O(n log n).

use heapless::Vec;

use super::area::{Area, AreaError, RingKind};
use super::{CoverageError, Flat};
use crate::sort;

/// Unit vectors along the lanes and across them. `across` is `along` turned left by 90°; strips are
/// numbered along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneDirection {
    /// Unit vector along the lanes, east and north.
    pub along: Flat,
    /// Unit vector from one strip to the next, east and north.
    pub across: Flat,
}

impl LaneDirection {
    /// Lanes at an angle, degrees counter-clockwise from east.
    pub fn at_deg(angle_deg: f32) -> Self {
        let (sin, cos) = libm::sincosf(angle_deg.to_radians());
        Self::along_vector(Flat::new(cos, sin))
    }

    /// Lanes along a vector of length 1.
    pub(super) fn along_vector(along: Flat) -> Self {
        Self { along, across: Flat::new(-along.y, along.x) }
    }
}

/// The lane direction across which the area's outer rings are least wide. `hull` is scratch memory;
/// `V` must be at least the number of vertices of the outer rings.
///
/// # Errors
/// [`AreaError::AreaFull`] if `hull` is too small.
pub fn direction_of_least_width<const V: usize>(
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
        // Around the hull the corner furthest from the side only advances: n steps in all for all
        // sides.
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

/// Computes the corners of the convex hull of the outer rings, counter-clockwise.
fn convex_hull<const V: usize>(
    area: &Area<'_>,
    hull: &mut Vec<Flat, V>,
) -> Result<(), CoverageError> {
    hull.clear();
    let mut sorted: Vec<Flat, V> = Vec::new();
    for (_, ring) in area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::Outer) {
        sorted.extend_from_slice(ring).map_err(|_| AreaError::AreaFull)?;
    }
    sort::heapsort_by(&mut sorted, |a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let count = sorted.len();
    // The lower chain from left to right, then the upper chain from right to left.
    let mut side = 0;
    for step in 0..2 * count {
        let place = sorted[if step < count { step } else { 2 * count - 1 - step }];
        // A vertex above the line from the leftmost to the rightmost vertex is no corner of the
        // lower chain; a vertex on or below that line is none of the upper chain.
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
