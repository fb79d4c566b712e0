//! Texts about the faults of an area's rings.

use planner_core::coverage::area::{self as core_area, MAX_VERTEX_COORDINATE_M, Ring, RingKind};

use crate::area::AreaFileError;
use crate::area::overlap::{self, RingFault};

/// Reason why rings that do not cross still form no area, and a remedy; `None` if they form one.
pub(super) fn ring_fault_text_and_hint(
    area: &core_area::Area<'_>,
) -> Option<(String, &'static str)> {
    let of = |kind: RingKind| {
        let indices = 0..area.rings().len();
        indices.filter(|i| area.rings()[*i].kind == kind).map(|i| area.ring(i)).collect::<Vec<_>>()
    };
    Some(match overlap::find_ring_fault(&of(RingKind::Outer), &of(RingKind::Hole))? {
        RingFault::OutersOverlap(i, j) => {
            (format!("polygon {i} and polygon {j} overlap"), "draw them as one")
        }
        RingFault::HolesOverlap(i, j) => {
            (format!("hole {i} and hole {j} overlap"), "draw them as one")
        }
        RingFault::HoleNotInsideOuter(i) => {
            (format!("hole {i} reaches out of its polygon"), "draw it inside the border")
        }
        RingFault::OuterTooThin(i) => (
            format!("polygon {i} is too thin or too small"),
            "check its corners and `coordinates`: a polygon is wider than a few centimetres",
        ),
        RingFault::OuterFilledByHoles(i) => {
            (format!("holes leave nothing of polygon {i}"), "leave a hole out, or the polygon")
        }
    })
}

/// Text about an area's fault, which names the ring or vertex.
pub(super) fn describe_area_error(error: core_area::AreaError, rings: &[Ring]) -> String {
    use core_area::AreaError as E;
    let ring = |index: u16| {
        let kind = rings[usize::from(index)].kind;
        let before = rings[..usize::from(index)].iter().filter(|ring| ring.kind == kind).count();
        let name = match kind {
            RingKind::Outer => "polygon",
            RingKind::Hole => "hole",
            RingKind::NoFly => "no-fly zone",
        };
        format!("{name} {before}")
    };
    let vertex = |index: u16| {
        let of = rings.iter().position(|ring| index < ring.end).unwrap_or(0);
        let start = if of == 0 { 0 } else { rings[of - 1].end };
        format!("vertex {} of {}", index - start, ring(of as u16))
    };
    match error {
        E::NoOuter => "there is no polygon".to_owned(),
        E::Shape => "its rings are out of order".to_owned(),
        E::TooFewVertices { ring: r } => {
            format!("{} has fewer than three vertices that differ", ring(r))
        }
        E::NotFinite { vertex: v } => format!("{} is not a finite number", vertex(v)),
        E::TooFar { vertex: v } => {
            format!(
                "{} is more than {} km from the origin",
                vertex(v),
                MAX_VERTEX_COORDINATE_M / 1e3
            )
        }
        E::Duplicate { vertex: v } => format!("{} repeats the one before it", vertex(v)),
        E::NoArea { ring: r } => {
            format!("{} encloses nothing: its vertices lie on one line", ring(r))
        }
        E::SelfCrossing { vertex: v, other } => {
            format!("the edges from {} and from {} cross", vertex(v), vertex(other))
        }
        E::RingsCross { ring: r, other } => format!("{} and {} cross", ring(r), ring(other)),
        E::HoleOutside { ring: r } => format!("{} lies outside every polygon", ring(r)),
        E::OuterInside { ring: r } => format!("{} lies inside another polygon", ring(r)),
        E::AreaFull => "it has too many vertices".to_owned(),
    }
}

/// Remedy for an area's fault.
pub(super) fn area_hint(error: core_area::AreaError) -> &'static str {
    use core_area::AreaError as E;
    match error {
        E::TooFewVertices { .. } | E::NoArea { .. } => {
            "a polygon has three corners or more that are not on one line"
        }
        E::TooFar { .. } => {
            "`coordinates` says whether numbers are degrees, longitude first, or metres about area.origin, which must \
             be near the area"
        }
        E::SelfCrossing { .. } => "give the corners in their order around the polygon",
        E::RingsCross { .. } => {
            "holes lie inside the border and apart from each other; draw two that cross as one"
        }
        E::HoleOutside { .. } => "draw it inside the border, or leave it out",
        E::OuterInside { .. } => "draw the two as one, or give the inner one as a hole",
        E::Duplicate { .. } => "leave one of the two out",
        E::NotFinite { .. } => "give numbers",
        E::NoOuter | E::Shape | E::AreaFull => "draw a border of fewer and simpler polygons",
    }
}

/// Remedy for a file that is no area.
pub(super) fn file_hint(error: &AreaFileError) -> &'static str {
    match error {
        AreaFileError::Read(_) => "paths are relative to the scenario's folder",
        AreaFileError::UnknownFormat => {
            "export the area as GeoJSON, WKT, KML or a QGroundControl plan"
        }
        AreaFileError::Malformed { .. } => {
            "export it again; the ending of its name has to be that of its format"
        }
        AreaFileError::NoPolygon(_) => {
            "draw the area as a closed polygon: points and lines are none"
        }
        AreaFileError::TooManyVertices(_) => "simplify the border, or photograph it in parts",
    }
}

/// Index of the ring that is at fault; `None` if no single one is.
pub(super) fn faulty_ring(error: core_area::AreaError, rings: &[Ring]) -> Option<usize> {
    use core_area::AreaError as E;
    match error {
        E::TooFewVertices { ring }
        | E::NoArea { ring }
        | E::HoleOutside { ring }
        | E::OuterInside { ring } => Some(usize::from(ring)),
        // The later one: a hole or zone comes after the polygon that it crosses.
        E::RingsCross { ring, other } => Some(usize::from(ring.max(other))),
        E::NotFinite { vertex }
        | E::TooFar { vertex }
        | E::Duplicate { vertex }
        | E::SelfCrossing { vertex, .. } => rings.iter().position(|ring| vertex < ring.end),
        E::NoOuter | E::Shape | E::AreaFull => None,
    }
}
