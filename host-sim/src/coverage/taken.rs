//! Counts waypoints of a plan that have no picture after a flight, and waypoints that were flown
//! more than once.
//!
//! Pictures are not taken exactly at waypoints. With trigger by distance each picture waits for the
//! autopilot's next check of the distance, so all further ones are later too: on a long lane they
//! lie anywhere between waypoints, which does no harm. So waypoints are judged by the gaps between
//! pictures. A waypoint has its picture
//!
//! - if a picture was taken within half a spacing of it along its lane, or within
//!   [`PictureTolerance::max_along_m`] where that is more;
//! - or if the last picture before it and the first one after it on its lane are no further apart
//!   than the spacing plus `max_along_m`: no picture is then missing between them.
//!
//! A picture belongs to a lane if it is within half a lane spacing of it, or within
//! [`PictureTolerance::cross_track_m`] where that is more. A missing picture leaves a gap of two
//! spacings, so it is found while a spacing is more than `max_along_m`. On a short lane whose
//! waypoints are nearer than the spacing it may not be found; the check of cells then decides
//! whether the area is photographed.
//!
//! A waypoint is flown twice if vehicles reached it twice: each picture counts for its nearest
//! waypoint, and consecutive pictures of one vehicle there count as one pass. Metres, ENU in the
//! mission frame.

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::tracks::Lane;
use planner_core::flight::Trigger;

use super::CoveragePlan;
use crate::margins;

/// A picture: time, position and heading of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// MAVLink system id of the vehicle that took the picture; `None` for a picture of an earlier
    /// flight.
    pub vehicle: Option<u8>,
    /// Time of the picture, seconds after the mission's start.
    pub t_s: f32,
    /// Position of the camera, metres ENU; it looks straight down.
    pub position: Point,
    /// Direction from the picture's centre to its upper edge, radians counterclockwise from east.
    pub yaw_enu_rad: f32,
}

/// Greatest distances of pictures from their waypoints in a flight with errors no greater than
/// planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureTolerance {
    /// Distance beside the path that errors of tracking and position estimate, and gusts cause,
    /// metres.
    pub cross_track_m: f32,
    /// Distance along the path from where a picture is due to where it is taken, at cruise speed,
    /// metres.
    pub trigger_delay_m: f32,
}

impl PictureTolerance {
    /// The tolerance from the margins of the plan's scenario.
    pub fn of_plan(planned: &CoveragePlan<'_>) -> Self {
        let scenario = planned.scenario;
        let distances = margins::required_distances(&scenario.simulation, 0.0, &scenario.vehicles);
        Self {
            cross_track_m: distances.wall_margin_m,
            trigger_delay_m: margins::TRIGGER_DELAY_S * scenario.mission.cruise_mps,
        }
    }

    /// Greatest distance along the lane between a waypoint and its picture, metres;
    /// [`margins::with_usable_footprint`] plans with as much, or with less if all vehicles are
    /// slower than the mission's cruise speed.
    pub fn max_along_m(&self) -> f32 {
        self.cross_track_m + self.trigger_delay_m
    }
}

/// Number of waypoints without a picture, and number of waypoints flown more than once.
pub fn count_missed_and_repeated(planned: &CoveragePlan<'_>, pictures: &[Picture]) -> (u64, u64) {
    let tolerance = PictureTolerance::of_plan(planned);
    let lanes = planned.tracks.lanes();
    let left: u64 =
        lanes.iter().map(|lane| count_missed_on_lane(planned, lane, pictures, &tolerance)).sum();
    let passes = match planned.area_settings.trigger {
        Trigger::None => track_points_at_waypoints(planned, pictures),
        _ => pictures.to_vec(),
    };
    (left, count_repeated(lanes, planned.tracks.waypoint_count(), &passes))
}

/// Greatest distance of two points of a track, metres: those of another flight are further away.
const MAX_TRACK_STEP_M: f32 = 10.0;

/// Of the tracks whose points are all given as pictures, the places within a quarter of a spacing
/// of a waypoint at which the vehicle flies along the lanes; between two points of a track, places
/// half as far apart as that. The others may be on a transit at the height of the lanes.
fn track_points_at_waypoints(planned: &CoveragePlan<'_>, points: &[Picture]) -> Vec<Picture> {
    let (lanes, along) = (planned.tracks.lanes(), planned.tracks.lane_direction());
    let spacing = planned.area_settings.spacing;
    let near_m = 0.25 * spacing.max_waypoint_spacing_m.min(spacing.max_lane_spacing_m);
    let passes = |ends: &[Picture]| {
        let (begin, flown) = (ends[0], ends[1].position - ends[0].position);
        let across = flown.xy().perp(&along).abs();
        let is_along = across < 0.2 * flown.xy().dot(&along).abs();
        let is_one_track = ends[0].vehicle == ends[1].vehicle && flown.norm() < MAX_TRACK_STEP_M;
        let flies_lane = is_one_track && is_along;
        let places = if flies_lane { (2.0 * flown.xy().norm() / near_m).ceil() as u32 } else { 0 };
        (0..places).filter_map(move |place| {
            let position = begin.position + flown * (place as f32 / places as f32);
            let (_, distance_m) = nearest_waypoint(lanes, &position.xy())?;
            (distance_m < near_m).then_some(Picture { position, ..begin })
        })
    };
    points.windows(2).flat_map(passes).collect()
}

/// Distance of a point along a lane from its first waypoint, and distance beside the lane, metres.
fn along_and_cross_track(lane: &Lane, place: &Flat) -> (f32, f32) {
    let (way, from) = (lane.to - lane.from, place - lane.from);
    let length_m = lane.length_m();
    if length_m > 0.0 {
        (from.dot(&way) / length_m, from.perp(&way).abs() / length_m)
    } else {
        (0.0, from.norm())
    }
}

/// Number of waypoints of a lane that have no picture.
fn count_missed_on_lane(
    planned: &CoveragePlan<'_>,
    lane: &Lane,
    pictures: &[Picture],
    tolerance: &PictureTolerance,
) -> u64 {
    let spacing = planned.area_settings.spacing;
    let cross_track_m = tolerance.cross_track_m.max(spacing.max_lane_spacing_m / 2.0);
    let near_m = tolerance.max_along_m().max(spacing.max_waypoint_spacing_m / 2.0);
    let widest_m = spacing.max_waypoint_spacing_m + tolerance.max_along_m();
    let places = pictures.iter().map(|picture| along_and_cross_track(lane, &picture.position.xy()));
    let mut taken: Vec<f32> =
        places.filter(|(_, off_m)| *off_m <= cross_track_m).map(|(along_m, _)| along_m).collect();
    taken.sort_by(f32::total_cmp);
    let has_picture = |k: &u32| {
        let at_m = along_and_cross_track(lane, &lane.waypoint(*k)).0;
        let next = taken.partition_point(|along_m| *along_m < at_m);
        let before = next.checked_sub(1).map(|index| at_m - taken[index]);
        let behind = taken.get(next).map(|along_m| along_m - at_m);
        before.is_some_and(|m| m <= near_m)
            || behind.is_some_and(|m| m <= near_m)
            || before.zip(behind).is_some_and(|(before, behind)| before + behind <= widest_m)
    };
    (0..lane.waypoint_count).filter(|k| !has_picture(k)).count() as u64
}

/// Number of the waypoint nearest to a picture taken at `place`, and its distance, metres; `None`
/// if there are no lanes.
fn nearest_waypoint(lanes: &[Lane], place: &Flat) -> Option<(u32, f32)> {
    let nearest = |lane: &Lane| {
        let share = along_and_cross_track(lane, place).0 / lane.length_m().max(f32::MIN_POSITIVE);
        let last = lane.waypoint_count.saturating_sub(1);
        let k = (share * last as f32).round().clamp(0.0, last as f32) as u32;
        (lane.first_waypoint + k, (lane.waypoint(k) - place).norm())
    };
    lanes.iter().map(nearest).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Number of waypoints that were flown more than once.
fn count_repeated(lanes: &[Lane], waypoints: u32, pictures: &[Picture]) -> u64 {
    let mut passes = vec![0_u32; waypoints as usize];
    let mut vehicles: Vec<Option<u8>> = pictures.iter().map(|picture| picture.vehicle).collect();
    vehicles.sort_unstable();
    vehicles.dedup();
    for vehicle in vehicles {
        let own = pictures.iter().filter(|picture| picture.vehicle == vehicle);
        let mut flown: Vec<u32> =
            own.filter_map(|p| Some(nearest_waypoint(lanes, &p.position.xy())?.0)).collect();
        // Of pictures of earlier flights neither vehicle nor order is known: all those at one
        // waypoint count as one pass.
        if vehicle.is_none() {
            flown.sort_unstable();
        }
        flown.dedup();
        flown.iter().for_each(|number| passes[*number as usize] += 1);
    }
    passes.iter().filter(|passes| **passes > 1).count() as u64
}

#[cfg(test)]
mod tests;
