//! Finds rings that overlap although their edges do not cross: one inside another, the same ring
//! twice, or two whose edges lie on each other. A point inside an odd number of rings is
//! photographed (even-odd rule), so ground that lies in two holes at once would be photographed.
//!
//! Each edge is split where the other ring meets it. The midpoint of each part lies inside the
//! other ring, outside it or on its border. Computed in f64, metres. Cost: n · m for two rings of n
//! and m edges whose bounding boxes intersect.

use planner_core::coverage::Flat;

/// A point within this distance of a border is on the border, metres: neighbouring fields share
/// borders, and coordinates are rounded.
const BORDER_TOLERANCE_M: f64 = 0.01;

/// Pair of rings, or one ring, that makes an area invalid; fields are indices among outer rings or
/// among holes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingFault {
    /// Two outer rings that overlap.
    OutersOverlap(usize, usize),
    /// Two holes that overlap.
    HolesOverlap(usize, usize),
    /// A hole that does not lie wholly inside one outer ring.
    HoleNotInsideOuter(usize),
    /// An outer ring that encloses next to nothing, whatever its holes.
    OuterTooThin(usize),
    /// An outer ring whose holes leave nothing of it to photograph.
    OuterFilledByHoles(usize),
}

/// The first overlap of an area's rings, or hole that is not inside an outer ring, or outer ring
/// that is too thin or that its holes fill; `None` if the rings are a valid area. Edges must not
/// cross: [`planner_core::coverage::area::Area::new`] checks that.
pub fn find_ring_fault(outers: &[&[Flat]], holes: &[&[Flat]]) -> Option<RingFault> {
    let (outers, holes) = (rings_to_f64(outers), rings_to_f64(holes));
    if let Some((i, j)) = first_overlapping_pair(&outers) {
        return Some(RingFault::OutersOverlap(i, j));
    }
    if let Some((i, j)) = first_overlapping_pair(&holes) {
        return Some(RingFault::HolesOverlap(i, j));
    }
    let mut left_m2: Vec<f64> = outers.iter().map(RingF64::area_m2).collect();
    for (index, hole) in holes.iter().enumerate() {
        let around = |outer: &RingF64| !hole.relation_to(outer).has_part_outside;
        let Some(own) = outers.iter().position(around) else {
            return Some(RingFault::HoleNotInsideOuter(index));
        };
        left_m2[own] -= hole.area_m2();
    }
    let is_nothing =
        |area_m2: f64, ring: &RingF64| area_m2 < BORDER_TOLERANCE_M * ring.perimeter_m();
    let empty = outers.iter().zip(&left_m2).position(|(ring, left)| is_nothing(*left, ring))?;
    let outer = &outers[empty];
    Some(match is_nothing(outer.area_m2(), outer) {
        true => RingFault::OuterTooThin(empty),
        false => RingFault::OuterFilledByHoles(empty),
    })
}

/// Indices of the first two rings that overlap; rings that only share a border do not.
fn first_overlapping_pair(rings: &[RingF64]) -> Option<(usize, usize)> {
    let pairs = (0..rings.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    pairs.into_iter().find(|&(i, j)| {
        let (a, b) = (&rings[i], &rings[j]);
        if !a.boxes_intersect(b) {
            return false;
        }
        let (a_of_b, b_of_a) = (a.relation_to(b), b.relation_to(a));
        let same = !a_of_b.has_part_outside && !b_of_a.has_part_outside;
        a_of_b.has_part_inside || b_of_a.has_part_inside || same
    })
}

/// A ring in f64, and the least (`low`) and greatest (`high`) corner of its bounding box.
struct RingF64 {
    /// Vertices, metres.
    ring: Vec<[f64; 2]>,
    low: [f64; 2],
    high: [f64; 2],
}

/// Whether a part of some edge of a ring lies strictly inside another ring, and whether a part lies
/// strictly outside that ring.
#[derive(Default)]
struct RingRelation {
    has_part_inside: bool,
    has_part_outside: bool,
}

/// The rings in f64, with their bounding boxes.
fn rings_to_f64(rings: &[&[Flat]]) -> Vec<RingF64> {
    let wide = |ring: &&[Flat]| {
        let ring: Vec<[f64; 2]> = ring.iter().map(|v| [f64::from(v.x), f64::from(v.y)]).collect();
        let side = |from: f64, pick: fn(f64, f64) -> f64| {
            [0, 1].map(|axis| ring.iter().map(|v| v[axis]).fold(from, pick))
        };
        RingF64 {
            low: side(f64::INFINITY, f64::min),
            high: side(f64::NEG_INFINITY, f64::max),
            ring,
        }
    };
    rings.iter().map(wide).collect()
}

impl RingF64 {
    /// Both ends of each edge.
    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        self.ring.iter().copied().zip(self.ring.iter().copied().cycle().skip(1))
    }

    /// Whether the bounding boxes meet, at a border too.
    fn boxes_intersect(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis])
    }

    /// The enclosed area, m².
    fn area_m2(&self) -> f64 {
        let base = self.ring[0];
        let at = |v: [f64; 2]| [v[0] - base[0], v[1] - base[1]];
        let twice: f64 = self.edges().map(|(a, b)| cross_product(at(a), at(b))).sum();
        (twice / 2.0).abs()
    }

    /// Length of the ring, metres.
    fn perimeter_m(&self) -> f64 {
        self.edges().map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum()
    }

    /// Where the edges of this ring lie relative to `other`; parts on the border of `other` count
    /// as neither inside nor outside.
    fn relation_to(&self, other: &Self) -> RingRelation {
        let mut sides = RingRelation::default();
        for (a, b) in self.edges() {
            let cuts = other.split_fractions(a, b);
            for pair in cuts.windows(2) {
                let share = f64::midpoint(pair[0], pair[1]);
                let middle = [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
                if !other.has_on_border(middle) {
                    let inside = other.contains(middle);
                    sides.has_part_inside |= inside;
                    sides.has_part_outside |= !inside;
                }
            }
            if sides.has_part_inside && sides.has_part_outside {
                break;
            }
        }
        sides
    }

    /// Points at which this ring meets the segment from `a` to `b`, as sorted fractions 0 to 1 of
    /// the segment, with 0 and 1 among them.
    fn split_fractions(&self, a: [f64; 2], b: [f64; 2]) -> Vec<f64> {
        let along = [b[0] - a[0], b[1] - a[1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        let mut shares = vec![0.0, 1.0];
        for (c, d) in self.edges() {
            let far = |axis: usize| {
                c[axis].max(d[axis]) < a[axis].min(b[axis]) - BORDER_TOLERANCE_M
                    || c[axis].min(d[axis]) > a[axis].max(b[axis]) + BORDER_TOLERANCE_M
            };
            if far(0) || far(1) {
                continue;
            }
            let to = [c[0] - a[0], c[1] - a[1]];
            let edge = [d[0] - c[0], d[1] - c[1]];
            // The projection of the ring's vertex onto the segment: a split where the vertex lies
            // on the segment.
            shares.push((to[0] * along[0] + to[1] * along[1]) / length2);
            shares.push(cross_product(to, edge) / cross_product(along, edge));
        }
        shares.retain(|share| (0.0..=1.0).contains(share));
        shares.sort_by(f64::total_cmp);
        shares
    }

    /// Whether a point lies on this ring's border, within [`BORDER_TOLERANCE_M`].
    fn has_on_border(&self, place: [f64; 2]) -> bool {
        self.edges().any(|(a, b)| {
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [place[0] - a[0], place[1] - a[1]]);
            let length2 = along[0] * along[0] + along[1] * along[1];
            let share = ((to[0] * along[0] + to[1] * along[1]) / length2).clamp(0.0, 1.0);
            (to[0] - along[0] * share).hypot(to[1] - along[1] * share) <= BORDER_TOLERANCE_M
        })
    }

    /// Whether a place is inside, by the number of edges that a ray from it crosses.
    fn contains(&self, place: [f64; 2]) -> bool {
        let crossed = |(a, b): &([f64; 2], [f64; 2])| {
            (a[1] <= place[1]) != (b[1] <= place[1])
                && place[0] < a[0] + (place[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
        };
        self.edges().filter(crossed).count() % 2 == 1
    }
}

/// Cross product of two vectors, positive if `b` points to the left of `a`.
fn cross_product(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests;
