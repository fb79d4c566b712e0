//! A path with few corners that keeps a least height above the field and is at most a tolerance
//! higher, no steeper than the vehicle can climb and descend.
//!
//! Method: at each sample the path's height must be in the tunnel, from `min_height_m` to
//! `min_height_m + tolerance_m` above the field. The slopes from the last corner that keep the path
//! in the tunnel at all samples so far form a cone. Where the next sample would empty the cone, the
//! path gets a corner at the sample before: as high as possible where the ground rises, as low as
//! possible where it falls. Each corner lies in the tunnel and the field is nowhere steeper than
//! the path may be, so the next sample can always be reached. Samples are half a node spacing
//! apart. Cost: one lookup of the field per sample.

use libm::{ceilf, fmaxf, fminf};

use super::FieldView;
use crate::geo::Flat;
use crate::{Length, Point};

/// Most height samples of one leg; where a leg would need more, its samples are further apart.
const MAX_LEG_SAMPLES: f32 = 65_536.0;

/// The height band above a field in which a path has to stay, and its steepest slope.
#[derive(Clone, Copy, Debug)]
pub struct TerrainFollowing<'a> {
    /// The height field.
    pub field: FieldView<'a>,
    /// Least height of the path above the field, metres.
    pub min_height_m: f32,
    /// Most metres by which the path may be higher than this least height.
    pub tolerance_m: f32,
    /// Greatest slope of the path: metres up or down per metre over ground.
    pub max_slope: f32,
}

impl TerrainFollowing<'_> {
    /// The least height that a path may have at `place`, metres up in the mission frame.
    pub fn min_path_z_m(&self, place: &Flat) -> f32 {
        self.field.height_at(place) + self.min_height_m
    }

    /// The highest point of the field plus height and tolerance: z in the mission frame, metres.
    pub fn max_path_z_m(&self) -> f32 {
        self.field.highest_m() + self.min_height_m + self.tolerance_m
    }

    /// Start, above `from`, of a path to `to`. Of three start heights in the tunnel (bottom,
    /// middle, top) the one whose path has the fewest corners; among equals the lowest.
    pub fn start_point(&self, from: &Flat, to: &Flat) -> Point {
        let low_m = self.min_path_z_m(from);
        let mut best = (usize::MAX, low_m);
        for share in [0.0, 0.5, 1.0] {
            let height_m = low_m + share * self.tolerance_m;
            let mut count = 0;
            let counted: Result<(), ()> =
                self.corners_to(&Point::new(from.x, from.y, height_m), to, |_| {
                    count += 1;
                    Ok(())
                });
            if counted.is_ok() && count < best.0 {
                best = (count, height_m);
            }
        }
        Point::new(from.x, from.y, best.1)
    }

    /// Calls `corner` with each corner of a path from `from`, which is in the tunnel, to a point
    /// above `to`: in order, without the start; the last corner is above `to`.
    ///
    /// # Errors
    /// The first error that `corner` returns; the path ends there.
    pub fn corners_to<E>(
        &self,
        from: &Point,
        to: &Flat,
        mut corner: impl FnMut(Point) -> Result<(), E>,
    ) -> Result<(), E> {
        let (start, way) = (from.xy(), to - from.xy());
        let length_m = way.length();
        let wanted = ceilf(length_m * 2.0 / self.field.shape().cell_m);
        let count = fmaxf(fminf(wanted, MAX_LEG_SAMPLES), 1.0) as u32;
        let step_m = length_m / count as f32;
        if step_m < 1e-3 {
            return corner(Point::new(to.x, to.y, from.z));
        }
        let place = |sample: u32| {
            if sample == count { *to } else { start + way * (sample as f32 / count as f32) }
        };
        let steep = self.max_slope;
        let (mut last, mut z_m) = (0, from.z);
        let (mut cone, mut floor_m) = ((-steep, steep), from.z);
        let mut sample = 1;
        while sample <= count {
            let low_m = self.min_path_z_m(&place(sample));
            let far_m = (sample - last) as f32 * step_m;
            let own = ((low_m - z_m) / far_m, (low_m + self.tolerance_m - z_m) / far_m);
            let next = (fmaxf(cone.0, own.0), fminf(cone.1, own.1));
            if next.0 <= next.1 || sample == last + 1 {
                // A step for which rounding leaves no slope is taken at the slope to the lower
                // bound.
                cone = if next.0 <= next.1 { next } else { (own.0, own.0) };
                floor_m = low_m;
                sample += 1;
                continue;
            }
            let slope = if own.0 > cone.1 { cone.1 } else { cone.0 };
            let at = sample - 1;
            z_m = self.clamp_to_tunnel(z_m + slope * (at - last) as f32 * step_m, floor_m);
            let place = place(at);
            corner(Point::new(place.x, place.y, z_m))?;
            (last, cone) = (at, (-steep, steep));
        }
        // The path ends as low as the cone allows.
        z_m = self.clamp_to_tunnel(z_m + cone.0 * (count - last) as f32 * step_m, floor_m);
        corner(Point::new(to.x, to.y, z_m))
    }

    /// `z_m` limited to the tunnel above `low_m`: rounding may move it slightly out of the tunnel.
    fn clamp_to_tunnel(&self, z_m: f32, low_m: f32) -> f32 {
        fminf(fmaxf(z_m, low_m), low_m + self.tolerance_m)
    }
}
