use proptest::prelude::*;

use super::*;

fn at(lat_deg: f64, lon_deg: f64, alt_m: f64) -> Geodetic {
    Geodetic { lat_deg, lon_deg, alt_m }
}

/// A position from MAVLink's integers: 1e-7 degrees, millimetres.
fn from_int(lat: f64, lon: f64, alt_mm: i32) -> Geodetic {
    at(lat * 1e-7, lon * 1e-7, f64::from(alt_mm) / 1000.0)
}

/// Checks that two positions are the same place to within `metres`, with longitudes in range.
fn check_same_place(a: &Geodetic, b: &Geodetic, metres: f64) {
    assert!(a.is_valid() && b.is_valid(), "{a:?} {b:?}");
    assert!((a.ecef() - b.ecef()).norm() <= metres, "{a:?} {b:?}");
}

#[test]
fn ecef_matches_the_parametric_latitude_formula() {
    // Computed with the reduced latitude, tan β = (1 − f) tan φ, instead of the prime vertical
    // radius.
    let known = [
        (at(0.0, 0.0, 0.0), [6378137.0, 0.0, 0.0]),
        (at(90.0, 0.0, 0.0), [0.0, 0.0, 6356752.3142]),
        (at(40.3507, -3.7424, 760.0), [4857783.9194, -317748.8563, 4108231.4115]),
        (at(-35.3, 149.1, 0.0), [-4471603.7889, 2676199.6594, -3665080.6415]),
        (at(78.21, 15.9, 300.0), [1257453.3473, 358195.0085, 6222062.7607]),
    ];
    for (place, ecef) in known {
        assert!((place.ecef() - Vector3::from(ecef)).norm() < 2e-4, "{place:?}");
    }
}

#[test]
fn enu_matches_independent_figures() {
    let known = [
        (at(40.3327, -3.7659, 700.0), at(40.3507, -3.7424, 760.0), [1996.6893, 1999.2455, 59.3739]),
        (
            at(-35.363262, 149.165237, 584.09),
            at(-35.3, 149.1, 0.0),
            [-5933.5476, 7016.751, -590.7195],
        ),
        (at(78.2, 15.6, 10.0), at(78.21, 15.9, 300.0), [6845.895, 1134.0643, 286.2375]),
        (at(-17.8, 179.99, 0.0), at(-17.81, -179.98, 25.0), [3180.547, -1107.0406, 24.1106]),
    ];
    for (origin, place, enu) in known {
        let enu = Point::from(enu);
        assert!((geodetic_to_enu(&origin, &place) - enu).norm() < 1e-3, "{place:?}");
        check_same_place(&enu_to_geodetic(&origin, &enu), &place, 1e-3);
    }
}

/// Latitude and longitude of a GLOBAL_POSITION_INT (33), 1e-7 degrees; seconds from a
/// LOCAL_POSITION_NED (32) to it; position, metres, and velocity, m/s, of the LOCAL_POSITION_NED.
type Sample = (f64, f64, f64, [f64; 3], [f64; 3]);

fn check_recording(projection: Projection, origin: &Geodetic, samples: &[Sample]) {
    for &(lat, lon, age_s, local, velocity) in samples {
        let ned = geodetic_to_ned(projection, origin, &from_int(lat, lon, 0));
        for axis in 0..2 {
            let reported = local[axis] + velocity[axis] * age_s;
            // 1e-7 degrees are 1.1 cm, in the origin and in the sample.
            assert!(
                (ned[axis] - reported).abs() < 0.02,
                "{projection:?} axis {axis}: {} {reported}",
                ned[axis]
            );
        }
        let back = ned_to_geodetic(projection, origin, &ned);
        check_same_place(&back, &from_int(lat, lon, 0), 1e-6);
    }
}

#[test]
fn px4_projection_agrees_with_the_recording() {
    // data/mavlink/px4-1.17-offboard.tlog. It holds no GPS_GLOBAL_ORIGIN: the origin is that of its
    // HOME_POSITION (242) messages, which give the same place globally and locally,
    // (473977414, 85455962) = (−0.0143 m, −0.0065 m) and (473977427, 85455941) = (0.1287 m, −0.1666
    // m), rounded to whole units.
    let origin = from_int(473_977_415.35, 85_455_963.3, 489_824);
    check_recording(
        Projection::Px4,
        &origin,
        &[
            (473_978_476.0, 85_458_681.0, -0.008, [11.7969, 20.4466, 0.0], [-0.0835, -0.1101, 0.0]),
            (473_978_475.0, 85_458_726.0, -0.016, [11.7831, 20.7814, 0.0], [-0.0648, -0.1156, 0.0]),
            (473_978_455.0, 85_458_794.0, -0.016, [11.5677, 21.2992, 0.0], [0.1498, -0.2352, 0.0]),
            (473_978_447.0, 85_458_808.0, -0.016, [11.4696, 21.4130, 0.0], [0.128, -0.2245, 0.0]),
            (473_977_433.0, 85_455_939.0, 0.0, [0.1949, -0.1800, 0.0], [0.0, 0.0, 0.0]),
        ],
    );
}

#[test]
fn ardupilot_projection_agrees_with_the_recording() {
    // data/mavlink/arducopter-4.6-guided.tlog; its GPS_GLOBAL_ORIGIN (49) is (−353632620,
    // 1491652370, 584090).
    let origin = from_int(-353_632_620.0, 1_491_652_370.0, 584_090);
    check_recording(
        Projection::ArduPilot,
        &origin,
        &[
            (
                -353_630_502.0,
                1_491_652_189.0,
                0.013,
                [23.5856, -1.6388, 0.0],
                [-0.0155, -0.0018, 0.0],
            ),
            (
                -353_630_504.0,
                1_491_652_189.0,
                0.012,
                [23.5504, -1.6505, 0.0],
                [-0.0811, 0.0009, 0.0],
            ),
            (-353_630_828.0, 1_491_654_600.0, 0.012, [19.9487, 20.2481, 0.0], [0.0, 0.0, 0.0]),
        ],
    );
}

#[test]
fn ardupilot_constant_is_the_equatorial_circle() {
    // LATLON_TO_M: 1e-7 degree of the equator, 2π · 6 378 100 m / 360 / 1e7, as an f32.
    let metres = (6_378_100.0 * 1e-7f64).to_radians();
    assert!((ARDUPILOT_M_PER_DEG_E7 - metres).abs() < 1e-9, "{metres}");
    assert_eq!(f64::from(ARDUPILOT_M_PER_DEG_E7 as f32) as f32, 0.011_131_884_5);
}

#[test]
fn two_kilometres_away_the_three_frames_differ_by_metres() {
    let (origin, place) = (at(40.3327, -3.7659, 700.0), at(40.3507, -3.7424, 700.0));
    let enu = geodetic_to_enu(&origin, &place);
    for projection in [Projection::Px4, Projection::ArduPilot] {
        let ned = geodetic_to_ned(projection, &origin, &place);
        let error = libm::hypot(ned.x - f64::from(enu.y), ned.y - f64::from(enu.x));
        assert!((1.0..10.0).contains(&error), "{projection:?}: {error} m");
    }
}

#[test]
fn haversine_errs_by_what_it_says() {
    // One arc minute along a meridian; against the meridian's own radius of curvature a(1 − e²)/(1
    // − e² sin² φ)^1.5.
    let error = |lat: f64| {
        let arc = 1.0 / 60.0;
        let radius = WGS84_A * (1.0 - WGS84_E2)
            / libm::pow(1.0 - WGS84_E2 * libm::pow(sin(lat.to_radians()), 2.0), 1.5);
        haversine_m(&at(lat - arc / 2.0, 7.0, 0.0), &at(lat + arc / 2.0, 7.0, 0.0))
            / (radius * arc.to_radians())
            - 1.0
    };
    assert!((error(0.0) - 0.00561).abs() < 1e-5, "{}", error(0.0));
    assert!((error(89.9) + 0.00447).abs() < 1e-5, "{}", error(89.9));
    for lat in 0..90 {
        assert!((-0.0045..0.0057).contains(&error(f64::from(lat))));
    }
    // A quarter of the sphere's circumference.
    let quarter = haversine_m(&at(0.0, 0.0, 0.0), &at(0.0, 90.0, 50.0));
    assert!((quarter - core::f64::consts::FRAC_PI_2 * PX4_EARTH_RADIUS_M).abs() < 1e-6);
}

#[test]
fn invalid_places_are_known() {
    for place in [
        at(f64::NAN, 0.0, 0.0),
        at(0.0, f64::INFINITY, 0.0),
        at(0.0, 0.0, f64::NAN),
        at(90.1, 0.0, 0.0),
    ] {
        assert!(!place.is_valid());
    }
    assert!(at(-90.0, 180.0, -400.0).is_valid());
}

proptest! {
    #[test]
    fn enu_and_back(lat in -89.9f64..89.9, lon in -180.0f64..180.0, alt in -400.0f64..9000.0,
                    e in -8000.0f32..8000.0, n in -8000.0f32..8000.0, u in -500.0f32..5000.0) {
        let (origin, enu) = (at(lat, lon, alt), Point::new(e, n, u));
        let place = enu_to_geodetic(&origin, &enu);
        prop_assert!(place.is_valid());
        prop_assert!((geodetic_to_enu(&origin, &place) - enu).norm() < 1.5e-3);
    }

    #[test]
    fn ned_and_back(
        lat in -85.0f64..85.0,
        lon in -180.0f64..180.0,
        x in -5000.0f64..5000.0,
        y in -5000.0f64..5000.0,
    ) {
        let origin = at(lat, lon, 100.0);
        for projection in [Projection::Px4, Projection::ArduPilot] {
            let ned = Vector3::new(x, y, -30.0);
            let place = ned_to_geodetic(projection, &origin, &ned);
            prop_assert!(place.is_valid() && place.alt_m == 130.0);
            prop_assert!(
                (geodetic_to_ned(projection, &origin, &place) - ned).norm() < 1e-5,
                "{:?}",
                projection
            );
        }
    }

    /// PX4's projection keeps the distance from the origin: it is that along the great circle.
    #[test]
    fn px4_keeps_distances_from_the_origin(
        lat in -85.0f64..85.0,
        dlat in -2.0f64..2.0,
        dlon in -2.0f64..2.0,
    ) {
        let place = at(lat + dlat, wrap_180_deg(179.5 + dlon), 0.0);
        let origin = at(lat, 179.5, 0.0);
        let ned = geodetic_to_ned(Projection::Px4, &origin, &place);
        let along = haversine_m(&origin, &place);
        prop_assert!((libm::hypot(ned.x, ned.y) - along).abs() < 1e-3 + 1e-9 * along);
    }

    #[test]
    fn enu_and_ned_swap(x in -9.0f64..9.0, y in -9.0f64..9.0, z in -9.0f64..9.0) {
        let enu = Vector3::new(x, y, z);
        prop_assert_eq!(swap_enu_ned(&enu), Vector3::new(y, x, -z));
        prop_assert_eq!(swap_enu_ned(&swap_enu_ned(&enu)), enu);
    }
}
