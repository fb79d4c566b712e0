//! Back-and-forth lanes over an area: concave, with holes and no-fly zones.
//!
//! Source: CPP §3.2.1, Fig. 4. The area is cut into strips as wide as the lane spacing or a little less, all alike. In
//! each strip the lane runs along the middle. It reaches from border to border along that line, and further where the
//! strip's area would else lie beyond the last picture. "Simple" and "sampled" patterns are the same lanes: the first
//! packs whole lanes, the second waypoints ([`super::pack::Unit`]).
//!
//! Frame: `u` along the lanes, `v` across them, metres from the first vertex. O(lanes · vertices), and the order of the
//! lanes ([`super::order`]).

use super::CoverageError;
use super::area::{Area, AreaError};
use super::order;
use super::patches;
use super::strips::Strips;
use super::sweep::{Direction, least_width};
use super::transit::Transit;

pub use super::lanes::{Lane, Pattern, Tracks};
pub use super::strips::Workspace;

/// Lanes over an area, in the order in which they are flown.
///
/// # Errors
/// Settings that are wrong, memory that is too small, [`CoverageError::NothingToCover`].
pub fn build<const L: usize, const V: usize, const N: usize>(
    area: &Area<'_>,
    pattern: &Pattern,
    transit: &Transit<'_, N>,
    ws: &mut Workspace<V>,
    out: &mut Tracks<L>,
) -> Result<(), CoverageError> {
    pattern.spacing.check()?;
    if !(pattern.margin_m >= 0.0 && pattern.margin_m.is_finite()) {
        return Err(CoverageError::Setting("margin_m"));
    }
    if area.vertices().len() > V {
        return Err(AreaError::AreaFull.into());
    }
    let direction = match pattern.angle_deg {
        Some(angle) if angle.is_finite() => Direction::at_deg(angle),
        Some(_) => return Err(CoverageError::Setting("angle_deg")),
        None => least_width(area, &mut ws.hull)?,
    };
    let strips = Strips::new(area, pattern, direction)?;
    out.lanes.clear();
    out.along = direction.along;
    for strip in 0..strips.count {
        let span = strips.span(strip);
        strips.need(span, ws)?;
        strips.lay(strip as u16, strips.middle(span), ws, out)?;
    }
    if area.has_no_fly() {
        patches::lay(&strips, ws, out)?;
    }
    if out.lanes.is_empty() {
        return Err(CoverageError::NothingToCover);
    }
    order::sort(&mut out.lanes, transit, pattern.looks);
    out.number(&pattern.spacing, transit)
}
