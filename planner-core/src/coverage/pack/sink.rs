//! Above terrain, [`Heights::mission_m`] is the highest height of pictures: a vehicle comes down
//! further to its first waypoint, and goes up from its last one.

use libm::fmaxf;

#[cfg(doc)]
use super::Heights;
use super::{RouteEnds, Vehicle, Work};
use crate::coverage::Flat;
use crate::map::field::follow::TerrainFollowing;

impl<const L: usize, const N: usize> Work<'_, L, N> {
    /// How far below [`Heights::mission_m`] pictures are taken at `place`, metres: 0 above level
    /// ground.
    #[inline(never)]
    pub(super) fn sink_m(&self, place: &Flat) -> f32 {
        let lowest_m = |following: &TerrainFollowing<'_>| following.lowest_m(place);
        fmaxf(self.following.as_ref().map_or(0.0, |f| self.heights.mission_m - lowest_m(f)), 0.0)
    }

    /// Seconds that a vehicle sinks from [`Heights::mission_m`] to the first waypoint of a route,
    /// and rises from the last one: forward, and backward.
    pub(super) fn sink_times_s(&self, vehicle: &Vehicle, ends: &RouteEnds) -> (f32, f32) {
        let (first_m, last_m) = (self.sink_m(&ends.first), self.sink_m(&ends.last));
        let time_s =
            |down_m: f32, up_m: f32| down_m / vehicle.descend_mps + up_m / vehicle.climb_mps;
        (time_s(first_m, last_m), time_s(last_m, first_m))
    }

    /// As [`Self::sink_times_s`], for vehicle `index` along waypoints `first` to `end` − 1.
    pub(in crate::coverage) fn route_sink_times_s(
        &self,
        index: usize,
        first: u32,
        end: u32,
    ) -> (f32, f32) {
        match self.following {
            Some(_) => self.sink_times_s(&self.vehicles[index], &self.route_ends(first, end)),
            None => (0.0, 0.0),
        }
    }
}
