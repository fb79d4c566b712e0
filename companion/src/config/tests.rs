use proptest::prelude::*;

use super::*;

fn config() -> Config<4> {
    let origin = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };
    let mut config = Config::new(2, Point::new(3.0, 4.0, 1.5), origin);
    let other = RosterEntry { system_id: 7, path_start: Point::new(9.0, 4.0, 1.5) };
    config.roster.push(other).expect("room for two");
    config
}

type Number = fn(&mut Config<4>) -> &mut f32;
/// Every number that must be positive.
const POSITIVE: [Number; 12] = [
    |c| &mut c.cruise_mps,
    |c| &mut c.slowest_vehicle_mps,
    |c| &mut c.fastest_vehicle_mps,
    |c| &mut c.climb_mps,
    |c| &mut c.descend_mps,
    |c| &mut c.accel_mps2,
    |c| &mut c.radius_m,
    |c| &mut c.required_clearance_m,
    |c| &mut c.safety_distance_m,
    |c| &mut c.start_tolerance_m,
    |c| &mut c.min_estimate_error_m,
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
    /// The first vehicle of the roster that starts outside the geofence is named in the error.
    #[test]
    fn a_vehicle_that_starts_outside_the_geofence_is_named(
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
        let first = config.roster.iter().find(|entry| outside(&entry.path_start));
        let expected =
            first.map_or(Ok(()), |entry| Err(ConfigError::StartOutside(entry.system_id)));
        prop_assert_eq!(config.check(), expected);
    }
}
