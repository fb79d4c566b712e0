use super::*;

#[test]
fn names_are_sorted_and_fit_the_wire() {
    assert!(DEFAULTS.windows(2).all(|pair| pair[0].0 < pair[1].0));
    assert!(DEFAULTS.iter().all(|(name, _)| name.len() <= 16));
}

#[test]
fn every_parameter_that_acts_is_in_the_table() {
    // A misspelt name would read as 0; none of these defaults is 0 but the two actions.
    let t = Px4Tuning::new(&default_params(3, &AirframeParameters::default()));
    for value in [
        t.speed_max,
        t.cruise_speed,
        t.land_speed,
        t.spool_up_s,
        t.offboard_loss_timeout_s,
        t.return_height,
    ] {
        assert!(value > 0.0);
    }
    for value in [
        t.auto_climb_max,
        t.auto_descend_max,
        t.takeoff_speed,
        t.takeoff_ramp_s,
        t.takeoff_height,
        t.land_trigger_s,
    ] {
        assert!(value > 0.0);
    }
    for value in [t.land_crawl_speed, t.land_crawl_below, t.auto_jerk, t.auto_acceleration_down] {
        assert!(value > 0.0);
    }
    for value in [
        t.disarm_after_landing_s,
        t.disarm_preflight_s,
        t.return_descend_height,
        t.battery_low_charge,
        t.return_cone_tan,
    ] {
        assert!(value > 0.0);
    }
    assert_eq!((t.offboard_loss_action, t.low_battery_action), (0, 0));
}
