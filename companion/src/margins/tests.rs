use super::*;

#[test]
fn a_vehicle_slows_as_its_estimate_gets_worse_and_stops() {
    let of = |bound_m| speed_share_for_error_bound(bound_m, 0.8, 0.3);
    assert_eq!(
        (of(0.1), of(0.25), of(0.41), of(f32::INFINITY), of(f32::NAN)),
        (1.0, 1.0, 0.0, 0.0, 0.0)
    );
    assert!(of(0.3) < 1.0 && of(0.35) < of(0.3) && of(0.4) >= MIN_SPEED_SHARE);
}

proptest::proptest! {
    #[test]
    fn pace_never_grows_with_the_bound(
        a in 0f32..3.0,
        b in 0f32..3.0,
        clearance_m in 0.1f32..4.0,
        radius_m in 0.05f32..2.0,
    ) {
        let (good, bad) = (a.min(b), a.max(b));
        let [fast, slow] =
            [good, bad].map(|bound_m| speed_share_for_error_bound(bound_m, clearance_m, radius_m));
        proptest::prop_assert!(fast >= slow && (0.0..=1.0).contains(&fast));
        // A moving vehicle keeps its hull inside the clearance.
        let tracking_m =
            |pace: f32| if pace == 1.0 { CRUISE_TRACKING_ERROR_M } else { CRAWL_TRACKING_ERROR_M };
        for (pace, bound_m) in [(fast, good), (slow, bad)] {
            proptest::prop_assert!(
                pace == 0.0 || radius_m + tracking_m(pace) + bound_m <= clearance_m + 1e-3
            );
        }
    }
}
