//! More lanes where a no-fly zone covers the middle of a strip and not all of it.
//!
//! A strip that a zone reaches into is halved three times. Of each part, what no lane shows yet gets a lane along the
//! part's own middle, as far as that is free. What then is left of an eighth, because its middle is not free, gets a lane
//! beside it, else single pictures: a footprint reaches at least half a lane to both sides. O(strips at zones · 14 · (vertices + lanes)), and
//! 16 lines more for each eighth that has something left.

use libm::{fmaxf, fminf};

use super::CoverageError;
use super::area::RingKind;
use super::intervals::Span;
use super::lanes::Tracks;
use super::strips::{Strips, Workspace};
use super::transit::ZONE_CLEARANCE_M;

/// Number of times that a strip is halved.
const STRIP_HALVINGS: u32 = 3;
/// Parts into which a strip is cut.
const STRIP_PARTS: u32 = 1 << STRIP_HALVINGS;

/// Adds lanes for the parts that no lane covers yet.
pub(super) fn lay_missing_lanes<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    ws: &mut Workspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for strip in (0..strips.count).filter(|strip| overlaps_no_fly_zone(strips, strips.strip_borders(*strip)))
    {
        let [low, high] = strips.strip_borders(strip);
        for parts in (1..=STRIP_HALVINGS).map(|halving| 1 << halving) {
            let wide = (high - low) / parts as f32;
            for part in 0..parts {
                let from = low + part as f32 * wide;
                let span = [from, from + wide];
                compute_uncovered(strips, span, out, ws)?;
                strips.lay_lanes(strip as u16, strips.centre_line(span), ws, out)?;
            }
        }
        let wide = (high - low) / STRIP_PARTS as f32;
        for part in 0..STRIP_PARTS {
            let from = low + part as f32 * wide;
            lay_lanes_beside(strips, strip as u16, [from, from + wide], ws, out)?;
            lay_single_pictures(strips, strip as u16, [from, from + wide], ws, out)?;
        }
    }
    Ok(())
}

/// Lays lanes on both sides of an eighth, the nearest first, until nothing is left of it.
fn lay_lanes_beside<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    strip: u16,
    span: Span,
    ws: &mut Workspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for v in candidate_lines(strips, span, 1) {
        compute_uncovered(strips, span, out, ws)?;
        if ws.needed.spans().is_empty() {
            break;
        }
        strips.lay_lanes(strip, v, ws, out)?;
    }
    Ok(())
}

/// Takes single pictures of what no line through it or beside it reaches: a wedge between two zones.
fn lay_single_pictures<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    strip: u16,
    span: Span,
    ws: &mut Workspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for v in candidate_lines(strips, span, 0) {
        compute_uncovered(strips, span, out, ws)?;
        let Some(&need) = ws.needed.spans().first() else { break };
        strips.lay_picture(strip, v, need, ws, out)?;
    }
    Ok(())
}

/// Lines beside the middle of an eighth, half an eighth apart, from number `first` on; as far as pictures along them
/// show all of it.
fn candidate_lines(strips: &Strips<'_>, span: Span, first: u32) -> impl Iterator<Item = f32> {
    let (middle, half) = (strips.centre_line(span), (span[1] - span[0]) / 2.0);
    let both = move |step: u32| [-1.0, 1.0].map(|side| middle + side * half * step as f32);
    (first..=STRIP_PARTS).flat_map(both).take_while(move |v| covers_band(strips, *v, span))
}

/// Whether pictures along the line `v` show all between two other `v`, and a little more.
fn covers_band(strips: &Strips<'_>, v: f32, [low, high]: Span) -> bool {
    let spacing = strips.pattern.spacing;
    let across = spacing.footprint.across_m;
    let spare = fmaxf(across - strips.strip_width_m, 0.0) / 2.0;
    let reach = across / 2.0 - fminf(spacing.lane_m / 19.0, spare * 0.99);
    v - low <= reach && high - v <= reach
}

/// Whether a no-fly zone comes between two `v`.
fn overlaps_no_fly_zone(strips: &Strips<'_>, [low, high]: Span) -> bool {
    strips.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly).any(|(_, ring)| {
        let across = ring.iter().map(|corner| strips.to_lane_frame(corner).1);
        let (first, last) = across
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(first, last), v| (fminf(first, v), fmaxf(last, v)));
        first <= high + ZONE_CLEARANCE_M && last >= low - ZONE_CLEARANCE_M
    })
}

/// `ws.need` becomes what no lane shows yet of the strip's part between two `v`, and no zone holds.
fn compute_uncovered<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    span: Span,
    tracks: &Tracks<L>,
    ws: &mut Workspace<V>,
) -> Result<(), CoverageError> {
    strips.compute_needed(span, ws)?;
    strips.subtract_no_fly_zones(span, ws)?;
    let along = strips.picture_half_width();
    for lane in tracks.lanes() {
        let ((from, v), (to, _)) = (strips.to_lane_frame(&lane.from), strips.to_lane_frame(&lane.to));
        if covers_band(strips, v, span) {
            ws.needed.remove([fminf(from, to) - along, fmaxf(from, to) + along])?;
        }
    }
    // Intervals that rounding left over are dropped.
    ws.needed.drop_shorter(strips.strip_width_m / 100.0);
    Ok(())
}
