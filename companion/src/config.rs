//! Settings of a companion, fixed before it starts: its id, the roster, speeds, sizes and
//! distances.

mod check;
pub(crate) mod limits;
pub mod parameters;

use heapless::Vec;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::track::deconflict::Method;

use crate::margins;

/// Maximum number of ground stations that a mission names.
pub const MAX_GROUND_STATIONS: usize = 4;
/// System ids of the ground stations of a mission that names none: 255, which QGroundControl,
/// MAVProxy and pymavlink use.
pub const DEFAULT_GROUND_STATION_IDS: [u8; MAX_GROUND_STATIONS] = [255, 0, 0, 0];

/// Default safety distance between the centres of two vehicles, metres: two airframes of 0.3 m
/// radius, and 0.9 m of air.
pub const SAFETY_DISTANCE_M: f32 = 1.5;

/// One vehicle of the mission: its id, and where its path begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RosterEntry {
    /// MAVLink system id, 1…255.
    pub system_id: u8,
    /// First point of its path, ENU metres: above its pad, at the altitude to which it climbs.
    pub path_start: Point,
}

/// Settings of one companion, for a roster of at most `V` vehicles.
#[derive(Clone, Debug, PartialEq)]
pub struct Config<const V: usize> {
    /// MAVLink system id of the vehicle, shared by autopilot and companion.
    pub system_id: u8,
    /// Every vehicle of the mission, this one included, sorted by system id.
    pub roster: Vec<RosterEntry, V>,
    /// Origin of the mission frame (ENU), geodetic.
    pub origin: Geodetic,
    /// CRC-32 of the mission file; a neighbour that reports another CRC flies another mission.
    pub mission_crc: u32,
    /// Nominal speed of this vehicle along its path, m/s.
    pub cruise_mps: f32,
    /// Cruise speed of the slowest vehicle of the mission, m/s: an unheard vehicle is assumed to
    /// fly at least at a share of it.
    pub slowest_vehicle_mps: f32,
    /// Cruise speed of the fastest vehicle of the mission, m/s: it bounds how far an unheard
    /// vehicle may have flown.
    pub fastest_vehicle_mps: f32,
    /// Speed of this vehicle's climb from its pad, m/s.
    pub climb_mps: f32,
    /// Speed of this vehicle's guided descent, m/s.
    pub descend_mps: f32,
    /// Maximum acceleration and deceleration along the path, m/s².
    pub accel_mps2: f32,
    /// Radius of this vehicle's hull, metres.
    pub radius_m: f32,
    /// Radius plus safety margin to walls, metres: the clearance for which every edge of the
    /// roadmap was checked.
    pub required_clearance_m: f32,
    /// Least distance that is kept between two vehicles' centres, metres.
    pub safety_distance_m: f32,
    /// Method by which the advice on speed and stops (`planner_core::track::deconflict`) keeps
    /// vehicles apart.
    pub method: Method,
    /// Least bound of the position estimate's error that is assumed, whatever accuracy the
    /// autopilot reports, metres (`FLK_EST_M`). By this value the operator vouches for the
    /// receiver.
    pub min_estimate_error_m: f32,
    /// Range within which the swarm's radio surely works, metres (`FLK_RADIO_M`). A neighbour that
    /// was last heard beyond 0.7 of this range is taken to be out of range, not failed. With
    /// [`REACHES_ALL_M`] the radio reaches every vehicle, so any silence is a failure.
    pub radio_range_m: f32,
    /// Greatest horizontal distance between this vehicle and its pad with which it takes off,
    /// metres.
    pub start_tolerance_m: f32,
    /// Battery charge, percent: below it this vehicle lands where no neighbour is below, and below
    /// half of it anywhere; 0 turns both off.
    pub battery_low_percent: i8,
    /// Rate at which this vehicle sends its position and its intent to the swarm, Hz.
    pub swarm_hz: u8,
    /// Geofence: minimum and maximum corner of the box that this vehicle may be in, ENU metres.
    /// `None` without one.
    pub geofence: Option<(Point, Point)>,
    /// In a coverage mission, whose area is divided again after the loss of a vehicle: the longest
    /// time from when a vehicle was last heard until it is down, seconds. `None` in a mission with
    /// goals.
    pub lost_vehicle_down_after_s: Option<f32>,
    /// Height range of the ground below a coverage mission whose ground is not level. `None` over
    /// level ground, and in other missions.
    pub ground: Option<UnevenGround>,
    /// Whether a coverage mission that starts again leaves out the waypoints that are photographed
    /// already.
    pub skips_photographed: bool,
    /// System ids of the senders whose commands, parameter changes and file transfers are accepted;
    /// 0 fills an unused entry.
    pub ground_stations: [u8; MAX_GROUND_STATIONS],
}

/// Value of `radio_range_m` for a radio that reaches every vehicle, metres.
pub const REACHES_ALL_M: f32 = 10_000.0;

/// Settings that passed [`Config::check`], and the first point of the vehicle's own path.
#[derive(Clone, Debug)]
pub struct CheckedConfig<const V: usize> {
    pub(crate) config: Config<V>,
    /// First point of the vehicle's own path, ENU metres: above its pad.
    pub(crate) path_start: Point,
}

/// Reason why a configuration was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// The vehicle's own system id is not in the roster, or 0.
    NotInRoster,
    /// The roster is not sorted by system id, or names an id twice.
    RosterOrder,
    /// A number is NaN or infinite, a speed, acceleration or distance is not positive, or
    /// `swarm_hz` is 0.
    NotPositive,
    /// The mission origin is not a place on earth.
    Origin,
    /// A corner of the geofence is not finite, or the minimum is greater than the maximum.
    Geofence,
    /// The vehicle with this system id starts outside the geofence.
    StartOutside(u8),
    /// The setting of this name, which the planner derives from these numbers, is out of its range.
    Setting(&'static str),
}

/// Whether a place is inside a box or on one of its faces.
pub(crate) fn box_contains((low, high): &(Point, Point), place: &Point) -> bool {
    (0..3).all(|axis| (low[axis]..=high[axis]).contains(&place[axis]))
}

impl<const V: usize> Config<V> {
    /// Default settings, those of a small indoor vehicle; the roster holds only this vehicle.
    pub fn new(system_id: u8, start: Point, origin: Geodetic) -> Self {
        let mut roster = Vec::new();
        // With `V` = 0 this vehicle does not fit into the roster: `check` then refuses the
        // settings.
        let _ = roster.push(RosterEntry { system_id, path_start: start });
        Self {
            system_id,
            roster,
            origin,
            mission_crc: 0,
            cruise_mps: 2.0,
            slowest_vehicle_mps: 2.0,
            fastest_vehicle_mps: 2.0,
            climb_mps: 1.0,
            descend_mps: 1.0,
            accel_mps2: 1.5,
            radius_m: 0.3,
            required_clearance_m: 0.8,
            safety_distance_m: SAFETY_DISTANCE_M,
            method: Method::Priority,
            min_estimate_error_m: margins::MIN_ESTIMATE_ERROR_BOUND_M,
            radio_range_m: REACHES_ALL_M,
            start_tolerance_m: 2.0,
            battery_low_percent: 15,
            swarm_hz: 5,
            geofence: None,
            lost_vehicle_down_after_s: None,
            ground: None,
            skips_photographed: true,
            ground_stations: DEFAULT_GROUND_STATION_IDS,
        }
    }

    /// The roster entry of this vehicle, and its index in the roster, which is sorted by system id.
    pub fn own_roster_entry(&self) -> Option<(u16, &RosterEntry)> {
        let at = self.roster.iter().position(|e| e.system_id == self.system_id)?;
        Some((at as u16, &self.roster[at]))
    }
}

/// Where the ground below a coverage mission is not level: the range of heights above it in which
/// paths lie, and the heights of its lowest and highest points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnevenGround {
    /// Least height above the ground from which pictures are taken, metres.
    pub min_height_above_ground_m: f32,
    /// Height of the band in which paths lie, metres: paths lie between `min_height_above_ground_m`
    /// and that height plus this one above the ground.
    pub height_tolerance_m: f32,
    /// Height of the lowest ground, ENU up in the mission frame, metres.
    pub low_m: f32,
    /// Height of the highest ground, ENU up in the mission frame, metres.
    pub high_m: f32,
}

/// Reason why the shell's planner computed no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanFailure {
    /// The mission, or the roadmap or field of heights that it needs, is absent, damaged or not the
    /// mission's.
    RoadmapUnusable,
    /// No route leads to the goal, or no detour was found.
    Unreachable,
    /// No departure time keeps this vehicle clear of the other vehicles' flights.
    Blocked,
    /// The planner did not answer in time.
    Late,
    /// The plan, or the list of a detour's keep-out zones, is larger than this board's memory.
    Capacity,
    /// The plan does not begin at this vehicle's start or holds a number that is not finite, or the
    /// mission cannot be planned as it is.
    Invalid,
}

#[cfg(test)]
mod tests;
