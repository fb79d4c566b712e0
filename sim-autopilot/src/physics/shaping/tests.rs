use super::*;

#[test]
fn a_ramp_arrives_within_its_limits_and_hardly_overshoots() {
    let mut ramp = JerkLimitedRate { rate: 0.0, derivative: 0.0 };
    let (mut most, mut fastest, mut arrived_s) = (0.0_f32, 0.0_f32, 0.0);
    for step in 0..2000_u16 {
        let before = ramp.derivative;
        ramp.advance(1.5, 3.0, 4.0, 0.004);
        most = most.max(ramp.derivative);
        fastest = fastest.max(ramp.rate);
        assert!((ramp.derivative - before).abs() <= 4.0 * 0.004 + 1e-6);
        if ramp.rate < 1.4 {
            arrived_s = f32::from(step) * 0.004;
        }
    }
    assert!(most <= 3.0 && fastest < 1.6, "{most} {fastest}");
    assert!(
        (0.9..1.8).contains(&arrived_s) && (ramp.rate - 1.5).abs() < 0.01,
        "{arrived_s} {ramp:?}"
    );
}
