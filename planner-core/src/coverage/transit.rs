//! Shortest horizontal paths around no-fly zones: the straight line if it is clear, else over
//! corners of the zones.
//!
//! Method: a visibility graph over the zones' convex corners, each moved out by
//! [`LANE_AND_TURN_CLEARANCE_M`]. The shortest paths between all pairs of corners are computed once
//! (Floyd and Warshall, n³ for n corners). A path between two points then uses the cheapest pair of
//! corners that are visible from them: n² sums and two visibility checks per round, and one more
//! round for each corner that turns out to be hidden, at most 2 n. All in metres.

use crate::Length;
use heapless::Vec;
use libm::fminf;

use super::area::{Area, RingKind, signed_area_m2};
use super::{CoverageError, Flat};

/// Distance that lanes keep from no-fly zones, and that transits keep from corners at which they
/// turn, metres: more than rounding, less than any vehicle's margin. A straight transit may pass a
/// zone without distance: a margin for the vehicle has to be part of the zone.
pub const LANE_AND_TURN_CLEARANCE_M: f32 = 0.25;

/// The visibility graph of an area's no-fly zones with the shortest distances between its corners.
/// At most `N` corners; 4 · N² bytes.
pub struct TransitGraph<'a, const N: usize> {
    area: Area<'a>,
    /// Convex corners of the no-fly zones, moved out by the clearance.
    corners: Vec<Flat, N>,
    /// Length of the shortest path between each two corners, metres; infinite if there is none.
    corner_distances_m: [[f32; N]; N],
}

impl<const N: usize> TransitGraph<'_, N> {
    /// Creates an empty graph; [`TransitGraph::set_area`] sets its area.
    pub const fn empty() -> Self {
        Self { area: Area::EMPTY, corners: Vec::new(), corner_distances_m: [[0.0; N]; N] }
    }
}

impl<'a, const N: usize> TransitGraph<'a, N> {
    /// Builds the graph for the area's no-fly zones, replacing the one before.
    ///
    /// # Errors
    /// [`CoverageError::NoFlyFull`] if the zones have more than `N` convex corners.
    pub fn set_area(&mut self, area: Area<'a>) -> Result<(), CoverageError> {
        self.area = area;
        self.corners.clear();
        for (_, ring) in area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            let left = signed_area_m2(ring) > 0.0;
            for (i, corner) in ring.iter().enumerate() {
                let (before, after) =
                    (ring[(i + ring.len() - 1) % ring.len()], ring[(i + 1) % ring.len()]);
                let (into, out) = ((corner - before).normalize(), (after - corner).normalize());
                let turn = into.perp(&out);
                if (turn > 0.0) != left {
                    continue;
                }
                // Moved away from both edges along their bisector, by as much as keeps the
                // clearance to both.
                let outward = (into - out).try_normalize(1e-6);
                let Some(outward) = outward else { continue };
                let half = fpu::sqrtf(libm::fmaxf((1.0 - into.dot(&out)) / 2.0, 0.0));
                let far = LANE_AND_TURN_CLEARANCE_M
                    * fminf(1.0 / libm::fmaxf(cos_from_sin(half), 0.25), 4.0);
                let place = corner + outward * far;
                if !area.is_in_no_fly_zone(&place) {
                    self.corners.push(place).map_err(|_| CoverageError::NoFlyFull)?;
                }
            }
        }
        self.compute_distances();
        Ok(())
    }

    /// Computes `corner_distances_m`.
    fn compute_distances(&mut self) {
        let n = self.corners.len();
        for i in 0..n {
            for j in 0..n {
                let (a, b) = (self.corners[i], self.corners[j]);
                self.corner_distances_m[i][j] =
                    if self.is_line_clear(&a, &b) { (b - a).length() } else { f32::INFINITY };
            }
            self.corner_distances_m[i][i] = 0.0;
        }
        for over in 0..n {
            for i in 0..n {
                let first = self.corner_distances_m[i][over];
                if first.is_infinite() {
                    continue;
                }
                for j in 0..n {
                    let whole = first + self.corner_distances_m[over][j];
                    self.corner_distances_m[i][j] = fminf(self.corner_distances_m[i][j], whole);
                }
            }
        }
    }

    /// The zones' convex corners, moved out by the clearance: the points at which transits turn.
    pub fn corners(&self) -> &[Flat] {
        &self.corners
    }

    /// Whether a point is inside a no-fly zone.
    pub fn is_in_no_fly_zone(&self, place: &Flat) -> bool {
        self.area.is_in_no_fly_zone(place)
    }

    /// Whether the straight line between two points, both outside all no-fly zones, enters or
    /// touches none of them.
    #[inline(never)]
    pub fn is_line_clear(&self, from: &Flat, to: &Flat) -> bool {
        if !self.area.has_no_fly() {
            return true;
        }
        let sorted = |a: f32, b: f32| if a < b { (a, b) } else { (b, a) };
        let (across, up) = (sorted(from.x, to.x), sorted(from.y, to.y));
        // Whether an edge lies entirely beyond one end of the line along one axis.
        let beyond = |a: f32, b: f32, (low, high): (f32, f32)| {
            (a > high && b > high) || (a < low && b < low)
        };
        let along = to - from;
        let zones = self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly);
        zones.map(|(_, ring)| ring).all(|ring| {
            // Only an edge whose ends are on different sides of the line is checked further: few
            // are.
            let mut a = ring[ring.len() - 1];
            let mut p = along.perp(&(a - from));
            ring.iter().all(|&b| {
                let q = along.perp(&(b - from));
                let meets = p * q <= 0.0 && !beyond(a.x, b.x, across) && !beyond(a.y, b.y, up) && {
                    let edge = b - a;
                    edge.perp(&(from - a)) * edge.perp(&(to - a)) <= 0.0
                };
                (a, p) = (b, q);
                !meets
            })
        })
    }

    /// Length of the shortest path between two points, metres; infinite if there is none.
    pub fn distance_m(&self, from: &Flat, to: &Flat) -> f32 {
        if self.is_line_clear(from, to) {
            return (to - from).length();
        }
        let far_m =
            |place: &Flat| self.corners.iter().map(|corner| (corner - place).length()).collect();
        let (mut first_m, mut last_m): (Vec<f32, N>, Vec<f32, N>) = (far_m(from), far_m(to));
        // The shortest path over corners that may still prove hidden. A visibility check costs more
        // than the sums, so only the corners at the ends of that path are checked.
        loop {
            let mut best = (f32::INFINITY, 0, 0);
            for (i, first) in first_m.iter().enumerate().filter(|(_, first)| first.is_finite()) {
                // No path over a corner is shorter than the straight line from it.
                if first + (to - self.corners[i]).length() >= best.0 {
                    continue;
                }
                for (j, last) in last_m.iter().enumerate() {
                    let whole = first + self.corner_distances_m[i][j] + last;
                    if whole < best.0 {
                        best = (whole, i, j);
                    }
                }
            }
            let (least, i, j) = best;
            if least.is_infinite() {
                return least;
            }
            let seen = [
                self.is_line_clear(from, &self.corners[i]),
                self.is_line_clear(&self.corners[j], to),
            ];
            match seen {
                [true, true] => return least,
                [false, _] => first_m[i] = f32::INFINITY,
                [true, false] => last_m[j] = f32::INFINITY,
            }
        }
    }

    /// Writes the corners of the shortest path between two points to `corners`, in order, without
    /// the points themselves.
    ///
    /// # Errors
    /// [`CoverageError::Unreachable`] if there is no path.
    pub fn shortest_path(
        &self,
        from: &Flat,
        to: &Flat,
        corners: &mut Vec<Flat, N>,
    ) -> Result<(), CoverageError> {
        corners.clear();
        let mut here = *from;
        // Each step leads to a corner from which the rest is shorter, so there are at most as many
        // steps as corners.
        while !self.is_line_clear(&here, to) {
            let mut best = (f32::INFINITY, None);
            for corner in self.corners.iter().filter(|corner| **corner != here) {
                let whole = (corner - here).length() + self.distance_m(corner, to);
                if whole < best.0 && self.is_line_clear(&here, corner) {
                    best = (whole, Some(*corner));
                }
            }
            here = best.1.ok_or(CoverageError::Unreachable)?;
            corners.push(here).map_err(|_| CoverageError::Unreachable)?;
        }
        Ok(())
    }
}

impl<const N: usize> Default for TransitGraph<'_, N> {
    fn default() -> Self {
        Self::empty()
    }
}

/// The cosine from the sine of an angle of at most 90°.
fn cos_from_sin(sine: f32) -> f32 {
    fpu::sqrtf(libm::fmaxf(1.0 - sine * sine, 0.0))
}

#[cfg(test)]
mod tests;
