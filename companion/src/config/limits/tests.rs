extern crate std;

use planner_core::geo::frames::Geodetic;

use super::*;
use crate::autopilot::AutopilotKind;

fn config() -> Config<1> {
    Config::new(1, Point::zeros(), Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 })
}

#[test]
fn defaults_leave_the_missions_limits_but_brake_vertically_as_arducopter_can() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let limits = MotionLimits::new(&config(), &kind.default_limits());
        assert_eq!((limits.speed_mps, limits.climb_mps, limits.descend_mps), (2.0, 1.0, 1.0));
        // ArduCopter ran 1.03 m wide of vertical corners with 1.5.
        let accel_z_mps2 = if kind == AutopilotKind::Px4 { 1.5 } else { 1.0 };
        assert_eq!(
            (limits.accel_mps2, limits.accel_z_mps2, limits.jerk_mps3),
            (1.5, accel_z_mps2, 4.0)
        );
    }
}

proptest::proptest! {
    /// Limits stay between those of a slow vehicle and those of the mission, whatever is read.
    #[test]
    fn no_value_makes_a_limit_senseless(
        read in proptest::collection::vec(
            (0usize..8, proptest::prelude::any::<u32>(), -5.0f32..600.0),
            0..40,
        ),
        px4 in proptest::prelude::any::<bool>(),
    ) {
        let kind = if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let mut autopilot = kind.default_limits();
        for (index, bits, near) in read {
            let Some(parameter) = kind.limit_parameters().get(index) else { continue };
            // Bits of an integer, NaN and infinities among them.
            autopilot.set(parameter, f32::from_bits(bits));
            autopilot.set(parameter, near);
        }
        let l = MotionLimits::new(&config(), &autopilot);
        proptest::prop_assert_eq!(GuidanceLimits::new(&config(), &autopilot).check(), Ok(()));
        for (value, least, most) in [
            (l.speed_mps, 0.1, 2.0),
            (l.climb_mps, 0.1, 1.0),
            (l.descend_mps, 0.1, 1.0),
            (l.accel_mps2, 0.2 / 1.21, 1.5),
            (l.accel_z_mps2, 0.2, 1.5),
            (l.max_setpoint_accel_mps2[0], 0.2, 2.25),
            (l.max_setpoint_accel_mps2[1], 0.2, 2.25),
            (l.jerk_mps3, 1.0, 4.0),
        ] {
            proptest::prop_assert!((least..=most).contains(&value), "{l:?}");
        }
    }
}

#[test]
fn a_slow_vehicle_expects_its_neighbours_to_be_as_fast_as_the_fastest() {
    let config =
        Config { cruise_mps: 0.5, slowest_vehicle_mps: 0.5, fastest_vehicle_mps: 6.0, ..config() };
    let limits = GuidanceLimits::new(&config, &AutopilotKind::Px4.default_limits());
    assert_eq!(limits.track.cruise_mps, 0.5);
    assert_eq!(
        neighbour_motion_bounds(&limits.track, limits.fastest_vehicle_mps).speed_max_mps,
        6.0
    );
}
