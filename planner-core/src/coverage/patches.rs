//! More lanes where a no-fly zone covers the middle of a strip and not all of it.
//!
//! A strip that a zone reaches into is halved three times. Of each part, what no lane shows yet gets a lane along the
//! part's own middle, as far as that is free. A place beside a zone lies at most a sixteenth of a lane from such a
//! middle, and a footprint reaches half a lane to both sides. O(strips at zones · 14 · (vertices + lanes)).

use libm::{fmaxf, fminf};

use super::CoverageError;
use super::area::RingKind;
use super::intervals::Span;
use super::tracks::{Strips, Tracks, Workspace};
use super::transit::CLEARANCE_M;

/// How often a strip is halved.
const HALVINGS: u32 = 3;

/// Lays the lanes that are missing.
pub(super) fn lay<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    ws: &mut Workspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    for strip in (0..strips.count).filter(|strip| meets_zone(strips, strips.span(*strip))) {
        let [low, high] = strips.span(strip);
        for parts in (1..=HALVINGS).map(|halving| 1 << halving) {
            let wide = (high - low) / parts as f32;
            for part in 0..parts {
                let from = low + part as f32 * wide;
                let span = [from, from + wide];
                strips.need(span, ws)?;
                without_shown(strips, span, out, ws)?;
                strips.lay(strip as u16, strips.middle(span), ws, out)?;
            }
        }
    }
    Ok(())
}

/// Whether a no-fly zone comes between two `v`.
fn meets_zone(strips: &Strips<'_>, [low, high]: Span) -> bool {
    strips.area.each().filter(|(kind, _)| *kind == RingKind::NoFly).any(|(_, ring)| {
        let across = ring.iter().map(|corner| strips.rotated(corner).1);
        let (first, last) = across
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(first, last), v| (fminf(first, v), fmaxf(last, v)));
        first <= high + CLEARANCE_M && last >= low - CLEARANCE_M
    })
}

/// Takes from `ws.need` what lanes already show of the strip's part between two `v`.
fn without_shown<const L: usize, const V: usize>(
    strips: &Strips<'_>,
    [low, high]: Span,
    tracks: &Tracks<L>,
    ws: &mut Workspace<V>,
) -> Result<(), CoverageError> {
    let footprint = strips.pattern.spacing.footprint;
    // A rounding less than what is shown.
    let (along, across) = (footprint.along_m * 0.499, footprint.across_m * 0.499);
    for lane in tracks.lanes() {
        let ((from, v), (to, _)) = (strips.rotated(&lane.from), strips.rotated(&lane.to));
        let reaches = v - low <= across && high - v <= across;
        if reaches {
            ws.need.remove([fminf(from, to) - along, fmaxf(from, to) + along])?;
        }
    }
    // What rounding left over.
    ws.need.drop_shorter(strips.wide / 100.0);
    Ok(())
}
