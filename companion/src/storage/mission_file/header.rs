//! The settings of a mission file that all vehicles of the mission share.

use planner_core::Point;
use planner_core::file::FileError;
use planner_core::geo::frames::Geodetic;
use planner_core::plan::GoalMode;
use planner_core::roadmap::MAX_COORDINATE_M;
use planner_core::schedule::ScheduleConfig;
use planner_core::track::deconflict::Method;

use super::error::MissionError;
use super::numbers::{MAX_SPEED_MPS, in_range, is_positive_up_to};
use crate::config::MAX_GROUND_STATIONS;

/// Settings of a mission that all its vehicles share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionHeader {
    /// CRC-32 of the roadmap file that the mission was made for; in a coverage mission over uneven
    /// ground, of its field of heights.
    pub roadmap_crc: u32,
    /// Rule by which goals are assigned to vehicles.
    pub mode: GoalMode,
    /// Method by which vehicles keep apart in flight.
    pub method: Method,
    /// Origin of the mission frame: latitude, longitude, altitude.
    pub origin: Geodetic,
    /// Cruise speed along paths, m/s.
    pub cruise_mps: f32,
    /// Separations and speeds that the schedule is planned with; its cruise speed is lower than the
    /// flown one.
    pub schedule: ScheduleConfig,
    /// Least distance between the centres of two vehicles, metres.
    pub safety_distance_m: f32,
    /// Geofence: lowest and highest corner of the box, in the mission frame, in which vehicles must
    /// stay; `None` for no geofence.
    pub geofence: Option<(Point, Point)>,
    /// System ids of the ground stations whose commands count; 0 for an unused entry.
    pub ground_stations: [u8; MAX_GROUND_STATIONS],
}

impl MissionHeader {
    /// Checks all values; the error names the first that is wrong.
    pub(super) fn check(&self) -> Result<(), MissionError> {
        let refuse = |name| Err(FileError::Header(name).into());
        if !self.origin.is_valid() {
            return refuse("origin");
        }
        let schedule = &self.schedule;
        if !is_positive_up_to(self.cruise_mps, MAX_SPEED_MPS) {
            return refuse("cruise_mps");
        }
        if !is_positive_up_to(schedule.cruise_mps, MAX_SPEED_MPS) {
            return refuse("schedule_mps");
        }
        if !is_positive_up_to(schedule.vertical_mps, MAX_SPEED_MPS) {
            return refuse("vertical_mps");
        }
        if !is_positive_up_to(self.safety_distance_m, MAX_COORDINATE_M) {
            return refuse("safety_distance_m");
        }
        if !is_positive_up_to(schedule.separation_m, MAX_COORDINATE_M) {
            return refuse("separation_m");
        }
        if !is_positive_up_to(schedule.parked_separation_m, MAX_COORDINATE_M) {
            return refuse("parked_separation_m");
        }
        let sound = |(low, high): &(Point, Point)| {
            in_range(low) && in_range(high) && (0..3).all(|axis| low[axis] <= high[axis])
        };
        if !self.geofence.as_ref().is_none_or(sound) {
            return refuse("geofence");
        }
        if self.ground_stations == [0; MAX_GROUND_STATIONS] {
            return refuse("ground_stations");
        }
        Ok(())
    }
}
