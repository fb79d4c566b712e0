//! Additional lanes where a no-fly zone covers the middle of a strip but not all of the strip.
//!
//! A strip that a zone reaches into, and of which the lanes leave ground unphotographed, is cut
//! into eighths. Each eighth with such ground gets lanes along the strip border next to it, which
//! is furthest from the blocked middle, then along its own middle, then along lines beside that: an
//! image reaches at least half a lane spacing to both sides. Ground that fits into one image gets a
//! single image, as near to the ground's middle as zones allow. O(strips at zones · 8 · (vertices +
//! lanes)), and 18 lines for each eighth of which some ground remains.

use libm::{fmaxf, fminf};

use super::CoverageError;
use super::area::RingKind;
use super::intervals::Interval;
use super::lanes::Tracks;
use super::strips::{LaneIntervalSets, Strips, WIDTH_ROUNDING_SHARE};
use super::transit::LANE_AND_TURN_CLEARANCE_M;

/// Number of parts into which a strip is cut.
const STRIP_PARTS: u32 = 8;

/// Adds lanes for ground that no lane shows yet, in all strips that a no-fly zone reaches into.
pub(super) fn lay_missing_lanes<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    ws: &mut LaneIntervalSets<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for strip in
        (0..strips.count).filter(|strip| overlaps_no_fly_zone(strips, strips.strip_borders(*strip)))
    {
        // The whole strip is checked first: if its lanes show all of it, no eighth of it is
        // missing.
        let [low, high] = strips.strip_borders(strip);
        compute_uncovered(strips, [low, high], out, ws)?;
        if ws.needed.spans().is_empty() {
            continue;
        }
        // From both borders inwards: beside a slanted zone most ground is left at the borders.
        let wide = (high - low) / STRIP_PARTS as f32;
        for step in 0..STRIP_PARTS / 2 {
            let (lower, upper) = (low + step as f32 * wide, high - step as f32 * wide);
            lay_missing_lanes_in_part(strips, (strip as u16, low), [lower, lower + wide], ws, out)?;
            lay_missing_lanes_in_part(
                strips,
                (strip as u16, high),
                [upper - wide, upper],
                ws,
                out,
            )?;
        }
    }
    Ok(())
}

/// Adds lanes for an eighth of a strip, from `span[0]` to `span[1]` across the lanes, until no
/// ground of it is left or all lines are tried: first `border`, the strip's border nearer to the
/// eighth.
fn lay_missing_lanes_in_part<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    (strip, border): (u16, f32),
    span: Interval,
    ws: &mut LaneIntervalSets<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    compute_uncovered(strips, span, out, ws)?;
    let lines = core::iter::once(border).chain(lines_beside(strips, span));
    for v in lines.filter(|v| covers_band(strips, *v, span)) {
        if ws.needed.spans().is_empty() {
            break;
        }
        let count = out.lanes.len();
        strips.lay_shortest_lanes(strip, v, ws, out)?;
        if out.lanes.len() > count {
            compute_uncovered(strips, span, out, ws)?;
        }
    }
    Ok(())
}

/// Lines along the middle of an eighth and beside it, half an eighth apart, nearest first.
fn lines_beside(strips: &Strips<'_>, span: Interval) -> impl Iterator<Item = f32> {
    let (middle, half) = (strips.centre_line(span), (span[1] - span[0]) / 2.0);
    let side = move |k: u32| if k.is_multiple_of(2) { half } else { -half };
    (0..=2 * STRIP_PARTS).map(move |k| middle + side(k) * k.div_ceil(2) as f32)
}

/// Whether images along the line `v` show the whole band from `low` to `high` across the lanes,
/// with a margin on both sides if an image is wider than a strip.
fn covers_band(strips: &Strips<'_>, v: f32, [low, high]: Interval) -> bool {
    let spacing = strips.pattern.spacing;
    let across = spacing.footprint.across_m;
    let spare = fmaxf(across - strips.strip_width_m, 0.0) / 2.0;
    let reach = across / 2.0 - fminf(spacing.max_lane_spacing_m / 19.0, spare * 0.99);
    // A strip as wide as an image leaves no overlap, so a rounding error is tolerated.
    let most = reach + strips.strip_width_m * WIDTH_ROUNDING_SHARE;
    v - low <= most && high - v <= most
}

/// Whether a no-fly zone, or its clearance, reaches into the band from `low` to `high` across the
/// lanes.
fn overlaps_no_fly_zone(strips: &Strips<'_>, [low, high]: Interval) -> bool {
    strips.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly).any(|(_, ring)| {
        let (first, last) =
            ring.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(first, last), corner| {
                (fminf(first, corner.y), fmaxf(last, corner.y))
            });
        first <= high + LANE_AND_TURN_CLEARANCE_M && last >= low - LANE_AND_TURN_CLEARANCE_M
    })
}

/// Sets `ws.needed` to the ground of the band `span` that no lane shows yet, as intervals along the
/// lanes, without what a no-fly zone covers.
fn compute_uncovered<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    span: Interval,
    tracks: &Tracks<L>,
    ws: &mut LaneIntervalSets<V>,
) -> Result<(), CoverageError> {
    strips.compute_needed(span, ws)?;
    strips.subtract_no_fly_zones(span, ws)?;
    let along = strips.half_picture_along_m();
    for lane in tracks.lanes().iter().filter(|lane| covers_band(strips, lane.from.y, span)) {
        ws.needed.remove([lane.from.x - along, lane.to.x + along])?;
    }
    // Intervals left over by rounding are dropped: those shorter than the margin by which `along`
    // is less than half an image, or than 1 % of a strip's width if that is less.
    let kept_back_m = strips.pattern.spacing.footprint.along_m / 2.0 - along;
    ws.needed.drop_shorter(fminf(strips.strip_width_m / 100.0, kept_back_m));
    Ok(())
}
