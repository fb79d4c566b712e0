//! More lanes where a no-fly zone covers the middle of a strip and not all of it.
//!
//! A strip that a zone reaches into, and of which something is left, is cut into eighths. What no
//! lane shows of one yet gets lanes along the strip's border next to it, which is furthest from the
//! middle that is not free, then along the eighth's own middle and lines beside that: a footprint
//! reaches at least half a lane to both sides. What one picture shows gets one, as near to the
//! middle of it as is free. O(strips at zones · 8 · (vertices + lanes)), and 18 lines for each
//! eighth of which something stays left.

use libm::{fmaxf, fminf};

use super::CoverageError;
use super::area::RingKind;
use super::intervals::Span;
use super::lanes::Tracks;
use super::strips::{Sets, Strips, WIDTH_ROUNDING};
use super::transit::ZONE_CLEARANCE_M;

/// Parts into which a strip is cut.
const STRIP_PARTS: u32 = 8;

/// Adds lanes for the parts that no lane covers yet.
pub(super) fn lay_missing_lanes<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    ws: &mut Sets<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for strip in
        (0..strips.count).filter(|strip| overlaps_no_fly_zone(strips, strips.strip_borders(*strip)))
    {
        // Where lanes show all of a strip, they show all of its parts.
        let [low, high] = strips.strip_borders(strip);
        compute_uncovered(strips, [low, high], out, ws)?;
        if ws.needed.spans().is_empty() {
            continue;
        }
        // From both borders inwards: beside a slanted zone most is left there.
        let wide = (high - low) / STRIP_PARTS as f32;
        for step in 0..STRIP_PARTS / 2 {
            let (lower, upper) = (low + step as f32 * wide, high - step as f32 * wide);
            lay_missing_lanes_of(strips, (strip as u16, low), [lower, lower + wide], ws, out)?;
            lay_missing_lanes_of(strips, (strip as u16, high), [upper - wide, upper], ws, out)?;
        }
    }
    Ok(())
}

/// Lays lanes for an eighth of a strip, the nearer border of which is given, until nothing is left
/// of it.
fn lay_missing_lanes_of<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    (strip, border): (u16, f32),
    span: Span,
    ws: &mut Sets<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    compute_uncovered(strips, span, out, ws)?;
    let lines = core::iter::once(border).chain(lines_beside(strips, span));
    for v in lines.filter(|v| covers_band(strips, *v, span)) {
        if ws.needed.spans().is_empty() {
            break;
        }
        let count = out.lanes.len();
        strips.lay_missing(strip, v, ws, out)?;
        if out.lanes.len() > count {
            compute_uncovered(strips, span, out, ws)?;
        }
    }
    Ok(())
}

/// Lines along the middle of an eighth and beside it, half an eighth apart, the nearest first.
fn lines_beside(strips: &Strips<'_>, span: Span) -> impl Iterator<Item = f32> {
    let (middle, half) = (strips.centre_line(span), (span[1] - span[0]) / 2.0);
    let side = move |k: u32| if k.is_multiple_of(2) { half } else { -half };
    (0..=2 * STRIP_PARTS).map(move |k| middle + side(k) * k.div_ceil(2) as f32)
}

/// Whether pictures along the line `v` show all between two other `v`, and a little more.
fn covers_band(strips: &Strips<'_>, v: f32, [low, high]: Span) -> bool {
    let spacing = strips.pattern.spacing;
    let across = spacing.footprint.across_m;
    let spare = fmaxf(across - strips.strip_width_m, 0.0) / 2.0;
    let reach = across / 2.0 - fminf(spacing.lane_m / 19.0, spare * 0.99);
    // Strips as wide as a footprint have no spare: a rounding is none.
    let most = reach + strips.strip_width_m * WIDTH_ROUNDING;
    v - low <= most && high - v <= most
}

/// Whether a no-fly zone comes between two `v`.
fn overlaps_no_fly_zone(strips: &Strips<'_>, [low, high]: Span) -> bool {
    strips.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly).any(|(_, ring)| {
        let (first, last) =
            ring.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(first, last), corner| {
                (fminf(first, corner.y), fmaxf(last, corner.y))
            });
        first <= high + ZONE_CLEARANCE_M && last >= low - ZONE_CLEARANCE_M
    })
}

/// `ws.needed` becomes what no lane shows yet of the strip's part between two `v`, and no zone
/// holds.
fn compute_uncovered<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    span: Span,
    tracks: &Tracks<L>,
    ws: &mut Sets<V>,
) -> Result<(), CoverageError> {
    strips.compute_needed(span, ws)?;
    strips.subtract_no_fly_zones(span, ws)?;
    let along = strips.picture_half_width();
    for lane in tracks.lanes().iter().filter(|lane| covers_band(strips, lane.from.y, span)) {
        ws.needed.remove([lane.from.x - along, lane.to.x + along])?;
    }
    // Intervals that rounding left over are dropped: shorter than what two pictures that meet keep
    // back.
    let kept_back_m = strips.pattern.spacing.footprint.along_m / 2.0 - along;
    ws.needed.drop_shorter(fminf(strips.strip_width_m / 100.0, kept_back_m));
    Ok(())
}
