//! The path of a flight, made leg by leg: straight, around no-fly zones, or along the ground at the
//! height of pictures.

use heapless::Vec;

use super::super::Flat;
use super::super::transit::TransitGraph;
use crate::Point;
use crate::flight::{Path, PathError};
use crate::map::field::follow::TerrainFollowing;

/// The point over `place` whose z in the mission frame is `height_m`.
pub(super) fn point_at_height(place: &Flat, height_m: f32) -> Point {
    Point::new(place.x, place.y, height_m)
}

/// A flight path that is extended leg by leg.
pub(super) struct FlightPathBuilder<'a, const N: usize, const W: usize> {
    /// The path so far.
    pub(super) path: Path<W>,
    /// The way around no-fly zones.
    transit: &'a TransitGraph<'a, N>,
    /// Clearance with which every leg is recorded, metres: there are no walls.
    assumed_clearance_m: f32,
    /// How lanes follow the ground; `None` if it is level.
    following: Option<TerrainFollowing<'a>>,
    /// Last point of the path so far.
    pub(super) here: Point,
}

impl<'a, const N: usize, const W: usize> FlightPathBuilder<'a, N, W> {
    /// A path without waypoints; the caller adds the first one, at `here`.
    pub(super) const fn new(
        transit: &'a TransitGraph<'a, N>,
        assumed_clearance_m: f32,
        following: Option<TerrainFollowing<'a>>,
        here: Point,
    ) -> Self {
        Self { path: Path::new(), transit, assumed_clearance_m, following, here }
    }

    /// Appends a straight leg to `place`. Returns the index of the waypoint at the leg's end.
    pub(super) fn add_straight_leg(&mut self, place: Point) -> Result<usize, PathError> {
        self.path.push(place, self.assumed_clearance_m)?;
        self.here = place;
        self.path.last_index().ok_or(PathError::NotFinite)
    }

    /// Writes the corners of the path from `here` to `to` around no-fly zones to `corners`.
    #[inline(never)]
    fn find_corners_around_zones(&self, to: &Flat, corners: &mut Vec<Flat, N>) {
        // The routes have finite lengths, so there is a path between all their points, and no
        // error.
        if self.transit.shortest_path(&self.here.xy(), to, corners).is_err() {
            corners.clear();
        }
    }

    /// Appends level legs at `height_m` to `to`, around no-fly zones.
    pub(super) fn add_legs_around_zones(
        &mut self,
        to: &Flat,
        height_m: f32,
    ) -> Result<(), PathError> {
        let mut corners = Vec::new();
        self.find_corners_around_zones(to, &mut corners);
        for corner in &corners {
            self.add_straight_leg(point_at_height(corner, height_m))?;
        }
        self.add_straight_leg(point_at_height(to, height_m)).map(|_| ())
    }

    /// Appends the vertical descent to the first lane, which begins below the path's last point and
    /// leads to `end`. Returns the index of the waypoint where the lane begins.
    pub(super) fn descend_to_lane(
        &mut self,
        end: &Flat,
        max_picture_height_m: f32,
    ) -> Result<usize, PathError> {
        let here = self.here.xy();
        let begin =
            self.following.map_or(point_at_height(&here, max_picture_height_m), |following| {
                following.start_point(&here, end)
            });
        self.add_straight_leg(begin)
    }

    /// Appends a leg at picture height to the point over `to`: along terrain, or at
    /// `max_picture_height_m` over level ground. Returns the index of its last waypoint.
    pub(super) fn add_picture_leg(
        &mut self,
        to: &Flat,
        max_picture_height_m: f32,
    ) -> Result<usize, PathError> {
        let Some(following) = self.following else {
            return self.add_straight_leg(point_at_height(to, max_picture_height_m));
        };
        let here = self.here;
        following.corners_to(&here, to, |corner| self.add_straight_leg(corner).map(|_| ()))?;
        self.path.last_index().ok_or(PathError::NotFinite)
    }

    /// As `add_picture_leg`, but around no-fly zones.
    pub(super) fn add_picture_legs_around_zones(
        &mut self,
        to: &Flat,
        max_picture_height_m: f32,
    ) -> Result<usize, PathError> {
        let mut corners = Vec::new();
        self.find_corners_around_zones(to, &mut corners);
        for corner in &corners {
            self.add_picture_leg(corner, max_picture_height_m)?;
        }
        self.add_picture_leg(to, max_picture_height_m)
    }
}
