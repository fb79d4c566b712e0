use super::super::params;
use super::*;
use crate::physics::vehicle::AirframeParameters;

#[test]
fn it_arrives_within_every_limit_and_does_not_overshoot() {
    let tuning = CopterTuning::new(&params::default_params(1, &AirframeParameters::default()));
    let mut reference = CopterReference::new(Point::zeros(), Point::zeros());
    let goal = GuidedGoal::hold(Point::new(12.0, 16.0, 10.0));
    let dt = 0.004;
    let mut fastest = 0.0_f32;
    for _ in 0..5000 {
        let before = reference;
        reference.advance(&goal, &tuning, dt);
        fastest = fastest.max(reference.velocity.xy().norm());
        assert!(
            reference.acceleration.xy().norm() < 2.5 * 1.01
                && reference.acceleration.z.abs() < 1.01
        );
        assert!((reference.acceleration - before.acceleration).xy().norm() < 5.01 * dt);
        assert!(reference.velocity.z < 2.51);
    }
    // The recording: 20 m flown at 5.4 m/s at most.
    assert!((4.8..6.2).contains(&fastest), "fastest {fastest}");
    assert!(
        (reference.position - Point::new(12.0, 16.0, 10.0)).norm() < 0.02,
        "{}",
        reference.position
    );
}
