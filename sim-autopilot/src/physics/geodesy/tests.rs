use super::*;

const WORLD: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
const EKF: Geodetic = Geodetic { lat_deg: 40.3401, lon_deg: -3.7511, alt_m: 688.5 };

#[test]
fn the_linear_map_keeps_within_two_millimetres_of_the_exact_one() {
    for at in [Vector3::new(0.0, 0.0, 0.0), Vector3::new(1500.0, -900.0, 60.0)] {
        let frame = LocalFrame::new(Projection::Px4, WORLD, EKF, at);
        for offset in [
            Vector3::new(49.0, 3.0, 12.0),
            Vector3::new(-40.0, 80.0, -10.0),
            Vector3::new(0.5, 0.25, 0.0),
        ] {
            let enu = at + offset;
            let error = (frame.ned_from_enu(&enu) - frame.exact_ned(&enu)).norm();
            assert!(error < 2e-3, "{error} m at {enu}");
            assert!((frame.enu_from_ned(&frame.ned_from_enu(&enu)) - enu).norm() < 1e-6);
            let exact = frames::enu_to_geodetic(&WORLD, &enu.cast::<f32>());
            let linear = frame.geodetic_from_enu(&enu);
            assert!(
                (exact.lat_deg - linear.lat_deg).abs() < 2e-8
                    && (exact.lon_deg - linear.lon_deg).abs() < 2e-8
            );
            assert!((exact.alt_m - linear.alt_m).abs() < 2e-3);
        }
    }
}

#[test]
fn a_far_setpoint_takes_the_exact_way() {
    let frame = LocalFrame::new(Projection::Px4, WORLD, EKF, Vector3::zeros());
    let ned = Vector3::new(2500.0, 1800.0, -40.0);
    let exact =
        frames::geodetic_to_enu(&WORLD, &frames::ned_to_geodetic(Projection::Px4, &EKF, &ned));
    assert!((frame.enu_from_ned(&ned) - exact.cast::<f64>()).norm() < 1e-6);
}

#[test]
fn a_moved_origin_moves_what_the_autopilot_says() {
    let mut frame = LocalFrame::new(Projection::Px4, WORLD, WORLD, Vector3::zeros());
    assert!(frame.ned_from_enu(&Vector3::zeros()).norm() < 1e-3);
    frame.set_ekf_origin(EKF);
    assert!(frame.ned_from_enu(&Vector3::zeros()).norm() > 1000.0);
}
