use super::*;

#[test]
fn names_are_sorted_and_fit_the_wire() {
    assert!(DEFAULTS.windows(2).all(|pair| pair[0].0 < pair[1].0));
    assert!(DEFAULTS.iter().all(|(name, _)| name.len() <= 16));
}

#[test]
fn every_parameter_that_acts_is_in_the_table() {
    // A misspelt name would read as 0; of these only the battery's and the GCS failsafe are 0
    // by default.
    let t = CopterTuning::new(&default_params(3, &AirframeParameters::default()));
    let positive = [
        t.speed_max,
        t.climb_max,
        t.descend_max,
        t.land_speed,
        t.land_slow_below,
        t.low_stick_descent_rate,
    ];
    assert!(positive.iter().all(|v| *v > 0.1));
    let positive = [
        t.disarm_delay_s,
        t.return_height,
        t.return_cone_slope,
        t.return_loiter_s,
        t.gcs_timeout_s,
    ];
    assert!(positive.iter().all(|v| *v > 1.0) && t.guided_timeout_s == 3.0);
    assert!(
        (t.acceleration_max, t.acceleration_max_z, t.jerk_max, t.jerk_max_z)
            == (2.5, 1.0, 5.0, 5.0)
    );
    assert!(
        t.gcs_system == 255 && t.estimator_failsafe && t.arming_checks_enabled && !t.gcs_failsafe
    );
    assert!(t.gains.position == [1.0, 1.0] && t.gains.heading_rate_max > 1.0);
}
