//! Above terrain, [`Heights::max_picture_height_m`] is the highest height of pictures: a vehicle
//! comes down further to its first waypoint, and goes up from its last one.

use libm::fmaxf;

#[cfg(doc)]
use super::Heights;
use super::route_ends::RouteEnds;
use super::{CoverageProblem, Vehicle};
use crate::coverage::Flat;
use crate::map::field::follow::TerrainFollowing;

impl<const L: usize, const N: usize> CoverageProblem<'_, L, N> {
    /// How far below [`Heights::max_picture_height_m`] pictures are taken at `place`, metres: 0
    /// above level ground.
    #[inline(never)]
    pub(super) fn extra_descent_m(&self, place: &Flat) -> f32 {
        let lowest_m = |following: &TerrainFollowing<'_>| following.min_path_z_m(place);
        fmaxf(
            self.following
                .as_ref()
                .map_or(0.0, |f| self.heights.max_picture_height_m - lowest_m(f)),
            0.0,
        )
    }

    /// Time in which a vehicle descends from [`Heights::max_picture_height_m`] to the first
    /// waypoint of a route, plus that in which it climbs from the last one, seconds: for the route
    /// flown forward, and flown backward.
    pub(super) fn extra_vertical_times_s(&self, vehicle: &Vehicle, ends: &RouteEnds) -> (f32, f32) {
        let (first_m, last_m) =
            (self.extra_descent_m(&ends.lowest), self.extra_descent_m(&ends.highest));
        let time_s =
            |down_m: f32, up_m: f32| down_m / vehicle.descend_mps + up_m / vehicle.climb_mps;
        (time_s(first_m, last_m), time_s(last_m, first_m))
    }

    /// As [`Self::extra_vertical_times_s`], for vehicle `index` along waypoints `first` to `end` −
    /// 1.
    pub(in crate::coverage) fn route_extra_vertical_times_s(
        &self,
        index: usize,
        first: u32,
        end: u32,
    ) -> (f32, f32) {
        match self.following {
            Some(_) => {
                self.extra_vertical_times_s(&self.vehicles[index], &self.route_ends(first, end))
            }
            None => (0.0, 0.0),
        }
    }
}
