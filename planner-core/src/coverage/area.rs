//! The area: checked polygons to photograph, with holes and no-fly zones.
//!
//! The vertices of all rings are in one slice, ring after ring; the first vertex of a ring is not
//! repeated at its end. Rings may turn either way: a point is in the area if it is inside an odd
//! number of outer rings and holes. Cost: O(n²) in the edges for the check, O(n) for a query.

use crate::Length;
use libm::{fabs, sqrt};

use super::Flat;

/// Largest magnitude of a coordinate, metres: up to there f32 resolves 16 mm.
pub const MAX_VERTEX_COORDINATE_M: f32 = 150_000.0;
/// Vertices nearer than this count as one, metres.
pub const SAME_VERTEX_M: f32 = 1e-3;
/// Two edges count as crossing only if each reaches at least this far beyond the other, metres:
/// neighbouring fields share borders, and coordinates are rounded.
const MIN_EDGE_OVERSHOOT_M: f64 = 0.01;

/// Kind of the region that a ring encloses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingKind {
    /// Region to photograph.
    Outer,
    /// Region inside an outer ring that is not photographed, but may be flown over.
    Hole,
    /// Region that is not photographed, and that no vehicle may fly over, not even in transit.
    NoFly,
}

/// One ring. Its vertices are those from the `end` of the ring before it up to its own `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ring {
    /// Index of the ring's last vertex among the vertices of all rings, plus one.
    pub end: u16,
    /// Kind of the region that the ring encloses.
    pub kind: RingKind,
}

/// Reason why rings do not form an area. Numbers are indices of rings or vertices, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaError {
    /// There is no outer ring.
    NoOuter,
    /// The `end`s of the rings do not ascend, or the last one is not the number of vertices.
    Shape,
    /// A ring has fewer than three vertices.
    TooFewVertices {
        /// The ring.
        ring: u16,
    },
    /// A coordinate is NaN or infinite.
    NotFinite {
        /// The vertex.
        vertex: u16,
    },
    /// A coordinate of a vertex is greater than [`MAX_VERTEX_COORDINATE_M`] in magnitude.
    TooFar {
        /// The vertex.
        vertex: u16,
    },
    /// A vertex is at the same place as the one before it.
    Duplicate {
        /// The vertex.
        vertex: u16,
    },
    /// A ring encloses nothing, or hardly anything: its vertices lie on one line.
    NoArea {
        /// The ring.
        ring: u16,
    },
    /// Two edges of one ring cross.
    SelfCrossing {
        /// The vertex at which the first edge begins.
        vertex: u16,
        /// The vertex at which the second edge begins.
        other: u16,
    },
    /// Edges of two rings cross, both of them outer rings or holes.
    RingsCross {
        /// The first of the two rings.
        ring: u16,
        /// The second of the two rings.
        other: u16,
    },
    /// A hole lies outside all outer rings.
    HoleOutside {
        /// The hole.
        ring: u16,
    },
    /// An outer ring lies inside another outer ring.
    OuterInside {
        /// The inner ring.
        ring: u16,
    },
    /// The area has more vertices than the memory holds.
    AreaFull,
}

/// Checked rings over borrowed vertices.
#[derive(Clone, Copy, Debug)]
pub struct Area<'a> {
    /// Vertices of all rings, ring by ring.
    vertices: &'a [Flat],
    /// The rings, by the ends of their vertices.
    rings: &'a [Ring],
}

impl<'a> Area<'a> {
    /// An area without rings: it contains no point.
    pub(super) const EMPTY: Self = Self { vertices: &[], rings: &[] };

    /// Checks the rings and returns the area.
    ///
    /// # Errors
    /// The first error found, with the ring or vertex where it is.
    pub fn new(vertices: &'a [Flat], rings: &'a [Ring]) -> Result<Self, AreaError> {
        let area = Self { vertices, rings };
        area.check_shape()?;
        area.check_duplicates()?;
        area.check_crossings()?;
        area.check_ring_areas()?;
        area.check_nesting()?;
        Ok(area)
    }

    /// The vertices of all rings, ring after ring.
    pub fn vertices(&self) -> &'a [Flat] {
        self.vertices
    }

    /// The rings.
    pub fn rings(&self) -> &'a [Ring] {
        self.rings
    }

    /// Whether there is at least one no-fly zone.
    pub fn has_no_fly(&self) -> bool {
        self.rings.iter().any(|ring| ring.kind == RingKind::NoFly)
    }

    /// Vertices of the ring with this index; empty beyond the last ring.
    pub fn ring(&self, index: usize) -> &'a [Flat] {
        let Some(ring) = self.rings.get(index) else { return &[] };
        let start = index.checked_sub(1).map_or(0, |before| usize::from(self.rings[before].end));
        &self.vertices[start..usize::from(ring.end)]
    }

    /// Kind and vertices of each ring.
    pub(super) fn rings_with_kind(
        &self,
    ) -> impl Iterator<Item = (RingKind, &'a [Flat])> + Clone + use<'a> {
        let area = *self;
        area.rings.iter().enumerate().map(move |(i, ring)| (ring.kind, area.ring(i)))
    }

    /// Edges of all outer rings and holes, each as its two ends.
    pub(super) fn boundary_edges(&self) -> impl Iterator<Item = (Flat, Flat)> + Clone + use<'a> {
        self.rings_with_kind()
            .filter(|(kind, _)| *kind != RingKind::NoFly)
            .flat_map(|(_, ring)| edges_of(ring))
    }

    /// The same rings with these vertices: the area in another coordinate frame.
    pub(super) fn with_vertices<'b>(&self, vertices: &'b [Flat]) -> Area<'b>
    where
        'a: 'b,
    {
        Area { vertices, rings: self.rings }
    }

    /// Whether a point is to be photographed: inside an odd number of outer rings and holes. No-fly
    /// zones are ignored.
    pub fn contains(&self, place: &Flat) -> bool {
        let rings = self.rings_with_kind().filter(|(kind, _)| *kind != RingKind::NoFly);
        rings.filter(|(_, ring)| is_inside(ring, place)).count() % 2 == 1
    }

    /// Whether a point is inside a no-fly zone.
    pub fn is_in_no_fly_zone(&self, place: &Flat) -> bool {
        self.rings_with_kind().any(|(kind, ring)| kind == RingKind::NoFly && is_inside(ring, place))
    }

    /// Checks that there is an outer ring, that the `end`s fit the vertices, and all coordinates.
    fn check_shape(&self) -> Result<(), AreaError> {
        if !self.rings.iter().any(|ring| ring.kind == RingKind::Outer) {
            return Err(AreaError::NoOuter);
        }
        let mut start = 0;
        for (i, ring) in self.rings.iter().enumerate() {
            let end = usize::from(ring.end);
            if end < start || end > self.vertices.len() {
                return Err(AreaError::Shape);
            }
            if end - start < 3 {
                return Err(AreaError::TooFewVertices { ring: i as u16 });
            }
            start = end;
        }
        if start != self.vertices.len() || self.rings.len() > usize::from(u16::MAX) {
            return Err(AreaError::Shape);
        }
        for (i, vertex) in self.vertices.iter().enumerate() {
            if !(vertex.x.is_finite() && vertex.y.is_finite()) {
                return Err(AreaError::NotFinite { vertex: i as u16 });
            }
            if vertex.amax() > MAX_VERTEX_COORDINATE_M {
                return Err(AreaError::TooFar { vertex: i as u16 });
            }
        }
        Ok(())
    }

    /// Checks that no vertex is at the same place as the one before it.
    fn check_duplicates(&self) -> Result<(), AreaError> {
        let mut start = 0;
        for (_, ring) in self.rings_with_kind() {
            if let Some(k) = edges_of(ring).position(|(a, b)| (b - a).amax() < SAME_VERTEX_M) {
                return Err(AreaError::Duplicate { vertex: (start + (k + 1) % ring.len()) as u16 });
            }
            start += ring.len();
        }
        Ok(())
    }

    /// Checks that each ring encloses more than rounding explains.
    fn check_ring_areas(&self) -> Result<(), AreaError> {
        // A ring is flat if its area is less than that of a strip half as long as its perimeter and
        // a millimetre wide.
        let is_flat = |(_, ring): (_, &[Flat])| {
            fabs(signed_area_m2(ring)) < perimeter(ring) * f64::from(SAME_VERTEX_M) / 2.0
        };
        match self.rings_with_kind().position(is_flat) {
            Some(ring) => Err(AreaError::NoArea { ring: ring as u16 }),
            None => Ok(()),
        }
    }

    /// Checks that no ring crosses itself, and that no two of the outer rings and holes cross.
    fn check_crossings(&self) -> Result<(), AreaError> {
        let mut start = 0;
        for (i, (kind, ring)) in self.rings_with_kind().enumerate() {
            for (k, (a, b)) in edges_of(ring).enumerate() {
                let crosses = |(c, d): (Flat, Flat)| segments_cross(&a, &b, &c, &d);
                if let Some(further) = edges_of(ring).skip(k + 1).position(crosses) {
                    let [vertex, other] = [start + k, start + k + 1 + further].map(|v| v as u16);
                    return Err(AreaError::SelfCrossing { vertex, other });
                }
            }
            start += ring.len();
            if kind == RingKind::NoFly {
                continue;
            }
            for (j, (other, far)) in self.rings_with_kind().enumerate().skip(i + 1) {
                let meets = |(a, b): (Flat, Flat)| {
                    edges_of(far).any(|(c, d)| segments_cross(&a, &b, &c, &d))
                };
                if other != RingKind::NoFly && edges_of(ring).any(meets) {
                    return Err(AreaError::RingsCross { ring: i as u16, other: j as u16 });
                }
            }
        }
        Ok(())
    }

    /// Checks that each hole is inside an outer ring, and no outer ring inside another. Rings do
    /// not cross, so one interior point of a ring decides for the whole ring.
    fn check_nesting(&self) -> Result<(), AreaError> {
        for (i, (kind, ring)) in self.rings_with_kind().enumerate() {
            if kind == RingKind::NoFly {
                continue;
            }
            let inner = interior_point(ring);
            let around = |(j, (other, far)): (usize, (RingKind, &[Flat]))| {
                j != i && other == RingKind::Outer && is_inside(far, &inner)
            };
            let inside = self.rings_with_kind().enumerate().any(around);
            match kind {
                RingKind::Outer if inside => return Err(AreaError::OuterInside { ring: i as u16 }),
                RingKind::Hole if !inside => return Err(AreaError::HoleOutside { ring: i as u16 }),
                _ => {}
            }
        }
        Ok(())
    }
}

/// The edges of a ring, each as its two ends; the closing edge is the last.
pub(super) fn edges_of(ring: &[Flat]) -> impl Iterator<Item = (Flat, Flat)> + Clone + '_ {
    let next = ring.iter().skip(1).chain(ring.first());
    ring.iter().copied().zip(next.copied())
}

/// Signed area of a ring, m²: positive if its vertices run counter-clockwise. In f64, since large
/// terms cancel.
pub(super) fn signed_area_m2(ring: &[Flat]) -> f64 {
    let base = ring[0];
    let twice: f64 = edges_of(ring).map(|(a, b)| cross_product(&(a - base), &(b - base))).sum();
    twice / 2.0
}

/// Length of a ring, metres.
fn perimeter(ring: &[Flat]) -> f64 {
    edges_of(ring).map(|(a, b)| f64::from((b - a).length())).sum()
}

/// Cross product of two vectors, positive if `b` points to the left of `a`.
fn cross_product(a: &Flat, b: &Flat) -> f64 {
    f64::from(a.x) * f64::from(b.y) - f64::from(a.y) * f64::from(b.x)
}

/// Whether a point is inside a ring, by the number of edges that a ray to the east crosses.
pub(super) fn is_inside(ring: &[Flat], place: &Flat) -> bool {
    let crossed = |(a, b): &(Flat, Flat)| {
        (a.y <= place.y) != (b.y <= place.y)
            && place.x < a.x + (place.y - a.y) * (b.x - a.x) / (b.y - a.y)
    };
    edges_of(ring).filter(crossed).count() % 2 == 1
}

/// A point inside a ring: the midpoint of the longest inner part of a horizontal line that misses
/// every vertex.
fn interior_point(ring: &[Flat]) -> Flat {
    let (low, high) = ring.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
        (libm::fminf(low, v.y), libm::fmaxf(high, v.y))
    });
    // Near the middle of the ring, the line is half way between two neighbouring `y` of vertices.
    let middle = (low + high) / 2.0;
    let below = ring.iter().map(|v| v.y).filter(|y| *y <= middle).fold(low, libm::fmaxf);
    let above = ring.iter().map(|v| v.y).filter(|y| *y > middle).fold(high, libm::fminf);
    let y = (below + above) / 2.0;
    let mut best = (0.0, ring[0]);
    for (a, b) in edges_of(ring).filter(|(a, b)| (a.y <= y) != (b.y <= y)) {
        let x = a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y);
        let crossing = |(c, d): (Flat, Flat)| c.x + (y - c.y) * (d.x - c.x) / (d.y - c.y);
        let crossings = edges_of(ring).filter(|(c, d)| (c.y <= y) != (d.y <= y)).map(crossing);
        let next = crossings.filter(|other| *other > x).fold(f32::INFINITY, libm::fminf);
        let place = Flat::new((x + next) / 2.0, y);
        if next.is_finite() && next - x > best.0 && is_inside(ring, &place) {
            best = (next - x, place);
        }
    }
    best.1
}

/// Whether the segments `a b` and `c d` cross, each reaching at least [`MIN_EDGE_OVERSHOOT_M`]
/// beyond the other.
fn segments_cross(a: &Flat, b: &Flat, c: &Flat, d: &Flat) -> bool {
    let apart = |p: f32, q: f32, r: f32, s: f32| {
        libm::fmaxf(p, q) < libm::fminf(r, s) || libm::fmaxf(r, s) < libm::fminf(p, q)
    };
    if apart(a.x, b.x, c.x, d.x) || apart(a.y, b.y, c.y, d.y) {
        return false;
    }
    let beyond = |from: &Flat, to: &Flat, p: &Flat, q: &Flat| {
        let along = to - from;
        let length = sqrt(cross_product(&along, &Flat::new(-along.y, along.x)));
        let (p, q) = (cross_product(&along, &(p - from)), cross_product(&along, &(q - from)));
        p * q < 0.0 && libm::fmin(fabs(p), fabs(q)) > MIN_EDGE_OVERSHOOT_M * length
    };
    beyond(a, b, c, d) && beyond(c, d, a, b)
}
