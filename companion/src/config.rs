//! What a companion is given before it starts: its id, the vehicles that fly with it, and how fast
//! and how close.

mod check;

use heapless::Vec;
use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::frames::Geodetic;

use crate::margins;

/// Most ground stations a mission names.
pub const GROUND_STATIONS: usize = 4;
/// The ground stations of a mission that names none: the id that QGroundControl, MAVProxy and
/// pymavlink use.
pub const USUAL_GROUND_STATIONS: [u8; GROUND_STATIONS] = [255, 0, 0, 0];

/// Default safety distance between the centres of two vehicles, metres: two airframes of 0.3 m
/// radius, and 0.9 m of air.
pub const SAFETY_DISTANCE_M: f32 = 1.5;

/// One vehicle of the mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RosterEntry {
    /// MAVLink system id, 1…255.
    pub system_id: u8,
    /// First point of its path, ENU metres; its height is the altitude climbed to.
    pub start: Point,
}

/// Settings of one companion. `V` vehicles at most.
#[derive(Clone, Debug, PartialEq)]
pub struct Config<const V: usize> {
    /// MAVLink system id of the vehicle, shared by autopilot and companion.
    pub system_id: u8,
    /// Every vehicle of the mission, this one included, sorted by system id.
    pub roster: Vec<RosterEntry, V>,
    /// Origin of the mission frame.
    pub origin: Geodetic,
    /// CRC-32 of the mission file; neighbours with another one fly another mission.
    pub mission_crc: u32,
    /// Nominal speed along the path, m/s.
    pub cruise_mps: f32,
    /// Speed of the climb, m/s.
    pub climb_mps: f32,
    /// Speed of the descent, m/s.
    pub descend_mps: f32,
    /// Acceleration and braking, m/s².
    pub accel_mps2: f32,
    /// Radius of the vehicle, metres.
    pub radius_m: f32,
    /// Radius and safety margin, metres: the clearance every edge was tested at.
    pub required_clearance_m: f32,
    /// Smallest distance between two vehicles' centres, metres.
    pub safety_distance_m: f32,
    /// How vehicles keep apart.
    pub method: Method,
    /// The least error of the position estimate that is reckoned with, by which the operator
    /// vouches for the receiver, metres.
    pub estimate_m: f32,
    /// Range of the swarm's radio for sure, metres: a vehicle that falls silent further away than
    /// most of that is out of range. With [`REACHES_ALL_M`] the radio reaches every vehicle, so any
    /// silence is a failure.
    pub radio_range_m: f32,
    /// A vehicle further than this from its start, horizontally, does not take off, metres.
    pub start_tolerance_m: f32,
    /// Battery charge below which it lands where no neighbour is below, and below half of which it
    /// lands anywhere, percent; 0 never.
    pub battery_low_percent: i8,
    /// Rate at which position and intent go to the swarm, Hz.
    pub swarm_hz: u8,
    /// Minimum and maximum corner of the volume it may be in, ENU metres.
    pub geofence: Option<(Point, Point)>,
    /// Whether its mission is an area, which is divided again where a vehicle is lost: how long a
    /// lost vehicle may take until it is down, seconds.
    pub division: Option<f32>,
    /// The ground of an area that is not level: between pads nobody knows more.
    pub ground: Option<Ground>,
    /// Whether a new start leaves out what of an area is photographed already.
    pub resumes: bool,
    /// System ids whose commands, parameters and files count; 0 is no id.
    pub ground_stations: [u8; GROUND_STATIONS],
}

/// Radio range that reaches every vehicle, metres.
pub const REACHES_ALL_M: f32 = 10_000.0;

/// Settings that can be flown, and where the vehicle's own path starts.
#[derive(Clone, Debug)]
pub struct CheckedConfig<const V: usize> {
    pub(crate) config: Config<V>,
    pub(crate) start: Point,
}

/// Reason why a configuration was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// The vehicle's own system id is not in the roster, or 0.
    NotInRoster,
    /// The roster is not sorted by system id, or names one twice.
    RosterOrder,
    /// A number is NaN or infinite, or a speed, acceleration or distance is not positive.
    NotPositive,
    /// The mission origin is not a place on earth.
    Origin,
    /// The geofence is no box.
    Geofence,
    /// The vehicle with this system id starts outside the geofence.
    StartOutside(u8),
    /// The planner's setting of this name that follows from the numbers above is not what it may
    /// be.
    Setting(&'static str),
}

/// Whether a place is inside a box; its faces are.
pub(crate) fn box_contains((low, high): &(Point, Point), place: &Point) -> bool {
    (0..3).all(|axis| (low[axis]..=high[axis]).contains(&place[axis]))
}

impl<const V: usize> Config<V> {
    /// The values of a small indoor vehicle; the roster holds only itself.
    pub fn new(system_id: u8, start: Point, origin: Geodetic) -> Self {
        let mut roster = Vec::new();
        // A roster without room for its own vehicle is refused by `check`.
        let _ = roster.push(RosterEntry { system_id, start });
        Self {
            system_id,
            roster,
            origin,
            mission_crc: 0,
            cruise_mps: 2.0,
            climb_mps: 1.0,
            descend_mps: 1.0,
            accel_mps2: 1.5,
            radius_m: 0.3,
            required_clearance_m: 0.8,
            safety_distance_m: SAFETY_DISTANCE_M,
            method: Method::Priority,
            estimate_m: margins::MIN_ESTIMATE_ERROR_M,
            radio_range_m: REACHES_ALL_M,
            start_tolerance_m: 2.0,
            battery_low_percent: 15,
            swarm_hz: 5,
            geofence: None,
            division: None,
            ground: None,
            resumes: true,
            ground_stations: USUAL_GROUND_STATIONS,
        }
    }

    /// The entry of this vehicle and its rank by system id.
    pub fn own_roster_entry(&self) -> Option<(u16, &RosterEntry)> {
        let at = self.roster.iter().position(|e| e.system_id == self.system_id)?;
        Some((at as u16, &self.roster[at]))
    }
}

/// Ground that is not level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Pictures are taken at least so high above the field, metres.
    pub height_m: f32,
    /// Greatest height of the estimate above that, metres.
    pub tolerance_m: f32,
    /// The lowest ground, metres up in the mission frame.
    pub low_m: f32,
    /// The highest.
    pub high_m: f32,
}

/// Reason why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanFailure {
    /// The roadmap is absent or damaged.
    NoRoadmap,
    /// No route leads to the goal.
    Unreachable,
    /// No departure keeps clear of the other vehicles.
    Blocked,
    /// No answer came in time.
    Late,
    /// The plan is larger than this board's memory.
    Capacity,
    /// The plan does not begin at this vehicle's start, or holds a number that is not finite.
    Invalid,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn config() -> Config<4> {
        let origin = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };
        let mut config = Config::new(2, Point::new(3.0, 4.0, 1.5), origin);
        let other = RosterEntry { system_id: 7, start: Point::new(9.0, 4.0, 1.5) };
        config.roster.push(other).expect("room for two");
        config
    }

    type Number = fn(&mut Config<4>) -> &mut f32;
    /// Every number that must be positive.
    const POSITIVE: [Number; 10] = [
        |c| &mut c.cruise_mps,
        |c| &mut c.climb_mps,
        |c| &mut c.descend_mps,
        |c| &mut c.accel_mps2,
        |c| &mut c.radius_m,
        |c| &mut c.required_clearance_m,
        |c| &mut c.safety_distance_m,
        |c| &mut c.start_tolerance_m,
        |c| &mut c.estimate_m,
        |c| &mut c.radio_range_m,
    ];

    #[test]
    fn numbers_that_are_none_zero_or_negative_are_refused() {
        assert_eq!(config().check(), Ok(()));
        for number in POSITIVE {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, -1.0] {
                let mut config = config();
                *number(&mut config) = bad;
                assert_eq!(config.check(), Err(ConfigError::NotPositive), "{bad}");
            }
        }
    }

    #[test]
    fn ids_that_are_none_or_twice_are_refused() {
        let with = |change: fn(&mut Config<4>)| {
            let mut config = config();
            change(&mut config);
            config.check()
        };
        assert_eq!(with(|c| c.roster[1].system_id = 2), Err(ConfigError::RosterOrder));
        assert_eq!(with(|c| c.system_id = 9), Err(ConfigError::NotInRoster));
        assert_eq!(with(|c| c.system_id = 0), Err(ConfigError::NotInRoster));
    }

    proptest! {
        /// A vehicle that starts outside the geofence is named, whatever the box, the first of the
        /// roster.
        #[test]
        fn who_starts_outside_the_geofence_is_named(
            low in proptest::array::uniform3(-2.0f32..12.0),
            size in proptest::array::uniform3(0.0f32..12.0),
        ) {
            let mut config = config();
            let low = Point::from(low);
            let high = low + Point::from(size);
            config.geofence = Some((low, high));
            let outside = |p: &Point| {
                p.x < low.x
                    || p.x > high.x
                    || p.y < low.y
                    || p.y > high.y
                    || p.z < low.z
                    || p.z > high.z
            };
            let first = config.roster.iter().find(|entry| outside(&entry.start));
            let expected =
                first.map_or(Ok(()), |entry| Err(ConfigError::StartOutside(entry.system_id)));
            prop_assert_eq!(config.check(), expected);
        }
    }
}
