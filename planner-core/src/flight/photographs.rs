//! Where along its path a vehicle takes pictures, and how they are triggered.

use super::done::WaypointRange;
use super::path::{Path, PathError, Waypoint};
use crate::Length;

/// Tolerance of arc lengths: a picture no more than this far ahead of the vehicle counts as
/// reached, metres.
const REACHED_TOLERANCE_M: f32 = 1e-2;

/// Heading of a vehicle along its path while it photographs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HeadingMode {
    /// One heading for the whole flight: radians from east, counter-clockwise.
    FixedEnuRad(f32),
    /// In the direction of flight.
    Ahead,
}

/// How the camera is triggered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// By the autopilot, each time it has flown a given distance; switched on and off at the ends
    /// of a stretch.
    Distance,
    /// By one command of the companion for each picture.
    Waypoint,
    /// By other means: the companion commands nothing.
    None,
}

/// Order of the area's waypoint numbers along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaypointOrder {
    /// The numbers rise.
    Rising,
    /// The numbers fall: the path follows the lanes backwards.
    Falling,
}

/// A stretch of a path along which pictures are taken: one at each end, and between them more at
/// equal distances over ground. Arc lengths in metres. Where one picture is enough, both ends are
/// the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureStretch<'p> {
    /// Arc length of the first picture.
    pub from_m: f32,
    /// Arc length of the last picture.
    pub to_m: f32,
    /// Distance over ground between neighbouring pictures, metres; the length of the stretch over
    /// ground is a multiple of it. 0 for a single picture.
    pub ground_spacing_m: f32,
    /// Number of pictures, at least one.
    pub count: u32,
    /// The waypoints of the path from one end of the stretch to the other.
    corners: &'p [Waypoint],
}

/// A straight part of a stretch: arc length of its beginning, and its length along the path and
/// over ground, metres.
#[derive(Clone, Copy)]
struct StraightSegment {
    /// Arc length of the beginning, metres.
    begin_m: f32,
    /// Length along the path, metres.
    length_m: f32,
    /// Length over ground, metres.
    ground_length_m: f32,
}

/// The straight parts between these waypoints.
fn straight_segments(corners: &[Waypoint]) -> impl Iterator<Item = StraightSegment> {
    corners.windows(2).map(|ends| {
        let (begin_m, length_m) = (ends[0].along_m, ends[1].along_m - ends[0].along_m);
        let step = ends[1].position - ends[0].position;
        // A level part is as long over ground as along the path, to the bit.
        let ground_m = if step.z == 0.0 { length_m } else { step.xy().length() };
        StraightSegment { begin_m, length_m, ground_length_m: ground_m }
    })
}

impl<'p> PictureStretch<'p> {
    fn new(corners: &'p [Waypoint], count: u32) -> Option<Self> {
        let (from_m, to_m) = (corners.first()?.along_m, corners.last()?.along_m);
        let ground_m: f32 = straight_segments(corners).map(|segment| segment.ground_length_m).sum();
        let step_m = if count > 1 { ground_m / (count - 1) as f32 } else { 0.0 };
        Some(Self { from_m, to_m, ground_spacing_m: step_m, count, corners })
    }

    /// Number of pictures, of the `count` on the stretch with these corners, at an arc length of up
    /// to `along_m`: those taken once the vehicle is there.
    fn taken_count(corners: &'p [Waypoint], count: u32, along_m: f32) -> u32 {
        let Some([first, last]) = corners.first().zip(corners.last()).map(<[_; 2]>::from) else {
            return 0;
        };
        if along_m < first.along_m || along_m.is_nan() {
            0
        } else if along_m >= last.along_m {
            count
        } else {
            Self::new(corners, count).map_or(0, |stretch| stretch.taken_within(along_m))
        }
    }

    /// As [`Self::taken_count`], for an `along_m` between the ends of the stretch.
    fn taken_within(&self, along_m: f32) -> u32 {
        if self.ground_spacing_m <= 0.0 {
            return self.count;
        }
        // The cast saturates, so a quotient too large for a u32 gives the largest number.
        ((self.ground_distance_m(along_m) / self.ground_spacing_m) as u32)
            .saturating_add(1)
            .min(self.count)
    }

    /// Distance over ground from the beginning of the stretch to arc length `along_m`, metres.
    fn ground_distance_m(&self, along_m: f32) -> f32 {
        let mut ground_m = 0.0;
        for segment in straight_segments(self.corners) {
            let left_m = along_m - segment.begin_m;
            if left_m < segment.length_m {
                return ground_m + left_m * (segment.ground_length_m / segment.length_m);
            }
            ground_m += segment.ground_length_m;
        }
        ground_m
    }

    /// Arc length along the path of picture `k` of this stretch (from 0), metres; that of the last
    /// picture if `k` is too large.
    pub fn picture_arc_length_m(&self, k: u32) -> f32 {
        let mut left_m = self.ground_spacing_m * k as f32;
        for segment in straight_segments(self.corners) {
            if left_m < segment.ground_length_m {
                return segment.begin_m + left_m * (segment.length_m / segment.ground_length_m);
            }
            left_m -= segment.ground_length_m;
        }
        self.to_m
    }
}

/// Which parts of a path are photographed, and how. The path has at most
/// [`PicturePlan::MAX_PATH_WAYPOINTS`] waypoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PicturePlan {
    /// Bit `i`: a stretch begins at waypoint `i` of the path.
    stretch_begin_bits: u64,
    /// Bit `i`: a stretch ends at waypoint `i` of the path.
    stretch_end_bits: u64,
    /// For each stretch, in order, the lowest number of the area's waypoints that it photographs.
    lowest_waypoints: [u16; Self::MAX_STRETCHES],
    /// For each stretch, in order, the number of its pictures.
    picture_counts: [u16; Self::MAX_STRETCHES],
    /// Order of the area's waypoint numbers along the path.
    order: WaypointOrder,
    /// Number of waypoints of the whole area; 0 if not set by [`Self::with_area_waypoints`].
    area_waypoint_count: u32,
    /// Greatest allowed distance over ground between neighbouring pictures, metres.
    pub max_spacing_m: f32,
    /// Heading of the vehicle along its path.
    pub heading_mode: HeadingMode,
    /// How the camera is triggered.
    pub trigger: Trigger,
    /// Whether the path holds only the first lanes of the vehicle's route: at its end the fleet
    /// divides all remaining lanes again.
    pub is_first_part: bool,
}

impl PicturePlan {
    /// Most waypoints of a path along which a vehicle photographs: a bit each.
    pub const MAX_PATH_WAYPOINTS: usize = 64;
    /// Most stretches of a path along which pictures are taken.
    pub const MAX_STRETCHES: usize = 32;
    /// Most waypoints of an area, whose numbers are stored in 16 bits.
    pub const MAX_AREA_WAYPOINTS: u32 = u16::MAX as u32 + 1;

    /// A plan without stretches; pictures are to be at most `spacing_m` apart over ground.
    pub const fn new(spacing_m: f32, heading_mode: HeadingMode, trigger: Trigger) -> Self {
        let (numbers, counts) = ([0; Self::MAX_STRETCHES], [0; Self::MAX_STRETCHES]);
        Self {
            stretch_begin_bits: 0,
            stretch_end_bits: 0,
            lowest_waypoints: numbers,
            picture_counts: counts,
            order: WaypointOrder::Rising,
            area_waypoint_count: 0,
            max_spacing_m: spacing_m,
            heading_mode,
            trigger,
            is_first_part: false,
        }
    }

    /// The same plan, for an area with `area` waypoints, whose numbers rise or fall along the path
    /// as `order` says.
    pub const fn with_area_waypoints(self, area: u32, order: WaypointOrder) -> Self {
        Self { area_waypoint_count: area, order, ..self }
    }

    /// Number of waypoints of the whole area; 0 if not set by [`Self::with_area_waypoints`].
    pub fn area_waypoint_count(&self) -> u32 {
        self.area_waypoint_count
    }

    /// Adds a stretch from waypoint `from` to waypoint `to` of the path, both after the waypoints
    /// of the stretches added before. It has one picture for each of the area's `waypoints`, spread
    /// evenly from end to end.
    ///
    /// # Errors
    /// [`PathError::PathFull`] beyond [`Self::MAX_PATH_WAYPOINTS`], [`Self::MAX_STRETCHES`] or
    /// [`Self::MAX_AREA_WAYPOINTS`], if `waypoints` is empty, and if `from` is after `to`.
    pub fn add_stretch(
        &mut self,
        from: usize,
        to: usize,
        waypoints: WaypointRange,
    ) -> Result<(), PathError> {
        let number = u16::try_from(waypoints.first).map_err(|_| PathError::PathFull)?;
        let count =
            waypoints.end.checked_sub(waypoints.first).and_then(|count| u16::try_from(count).ok());
        let count = count.filter(|count| *count > 0).ok_or(PathError::PathFull)?;
        let stretch = self.stretch_begin_bits.count_ones() as usize;
        if from > to || to >= Self::MAX_PATH_WAYPOINTS || stretch >= Self::MAX_STRETCHES {
            return Err(PathError::PathFull);
        }
        (self.lowest_waypoints[stretch], self.picture_counts[stretch]) = (number, count);
        self.stretch_begin_bits |= 1 << from;
        self.stretch_end_bits |= 1 << to;
        Ok(())
    }

    /// The photographed stretches, in order along `path`, which must be the one that they were
    /// added for.
    pub fn stretches<'p, const W: usize>(
        &self,
        path: &'p Path<W>,
    ) -> impl Iterator<Item = PictureStretch<'p>> {
        self.corners_and_counts(path)
            .filter_map(|(corners, count)| PictureStretch::new(corners, count))
    }

    /// The waypoints of each stretch and the number of its pictures.
    fn corners_and_counts<'p, const W: usize>(
        &self,
        path: &'p Path<W>,
    ) -> impl Iterator<Item = (&'p [Waypoint], u32)> {
        let (mut begins, mut ends) = (self.stretch_begin_bits, self.stretch_end_bits);
        let waypoints = path.waypoints();
        self.picture_counts.into_iter().map_while(move |count| {
            let (from, to) = (begins.trailing_zeros() as usize, ends.trailing_zeros() as usize);
            let corners = waypoints.get(from..=to)?;
            begins &= begins - 1;
            ends &= ends - 1;
            Some((corners, u32::from(count)))
        })
    }

    /// Number of pictures taken once the vehicle is at arc length `along_m`.
    pub fn taken_count<const W: usize>(&self, path: &Path<W>, along_m: f32) -> u32 {
        let reached_m = along_m + REACHED_TOLERANCE_M;
        self.corners_and_counts(path)
            .map(|(corners, count)| PictureStretch::taken_count(corners, count, reached_m))
            .fold(0, u32::saturating_add)
    }

    /// Number of pictures certainly taken at arc length `along_m`: those at least
    /// [`Self::max_spacing_m`] before that arc length. A later one may still be missing.
    pub fn certainly_taken_count<const W: usize>(&self, path: &Path<W>, along_m: f32) -> u32 {
        self.taken_count(path, along_m - self.max_spacing_m)
    }

    /// Arc length of the last picture of the path, metres; `None` if there are no pictures.
    pub fn last_picture_m<const W: usize>(&self, path: &Path<W>) -> Option<f32> {
        let last = Self::MAX_PATH_WAYPOINTS
            .checked_sub(1 + self.stretch_end_bits.leading_zeros() as usize)?;
        path.waypoints().get(last).map(|waypoint| waypoint.along_m)
    }

    /// Arc length of the last picture at or before `along_m`, metres; `None` before the first
    /// picture.
    pub fn last_picture_before_m<const W: usize>(
        &self,
        path: &Path<W>,
        along_m: f32,
    ) -> Option<f32> {
        let (corners, count, taken) = self
            .corners_and_counts(path)
            .map(|(corners, count)| {
                (corners, count, PictureStretch::taken_count(corners, count, along_m))
            })
            .filter(|(.., taken)| *taken > 0)
            .last()?;
        PictureStretch::new(corners, count).map(|stretch| stretch.picture_arc_length_m(taken - 1))
    }

    /// The waypoints of the area that the path's pictures `pictures.first` to `pictures.end` − 1
    /// show. These picture numbers count along the path from 0; they are not waypoint numbers.
    pub fn waypoints_of_pictures<const W: usize>(
        &self,
        path: &Path<W>,
        pictures: WaypointRange,
    ) -> impl Iterator<Item = WaypointRange> {
        let (mut before, order) = (0u32, self.order);
        self.corners_and_counts(path).zip(self.lowest_waypoints).filter_map(
            move |((_, count), number)| {
                let within = |picture: u32| picture.saturating_sub(before).min(count);
                let (from, to) = (within(pictures.first), within(pictures.end));
                before = before.saturating_add(count);
                let skipped = match order {
                    WaypointOrder::Rising => from,
                    WaypointOrder::Falling => count - to,
                };
                let first = u32::from(number).saturating_add(skipped);
                (from < to).then(|| WaypointRange { first, end: first.saturating_add(to - from) })
            },
        )
    }

    /// Number of pictures along the whole path.
    pub fn planned_count<const W: usize>(&self, path: &Path<W>) -> u32 {
        self.corners_and_counts(path).map(|(_, count)| count).fold(0, u32::saturating_add)
    }
}

#[cfg(test)]
mod tests;
