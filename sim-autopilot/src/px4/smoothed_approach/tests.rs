use super::*;

#[test]
fn it_arrives_where_it_shall_from_any_speed_and_stays() {
    for (speed, cruise) in [(0.0, 5.0), (0.3, 5.0), (1.85, 5.0), (4.0, 5.0), (8.0, 5.0), (0.5, 0.3)]
    {
        let velocity = Point::new(0.6 * speed, -0.8 * speed, 0.0);
        let target = stopping_offset(&velocity) + Point::new(1.0, 2.0, 0.0);
        let mut approach = SmoothedApproach::new(0, &Point::zeros(), &velocity);
        for step in 1..=5000_u64 {
            let before = approach.ramps.map(|ramp| ramp.derivative);
            approach.advance(step * 4000, &target, cruise, 4.0);
            for (ramp, before) in approach.ramps.iter().zip(before) {
                assert!(
                    (ramp.derivative - before).abs() <= 4.0 * 0.004 + 1e-5,
                    "{speed}: {approach:?}"
                );
                assert!(ramp.derivative.abs() <= 3.0 + 1e-5, "{speed}: {approach:?}");
            }
        }
        assert!(
            (approach.position - target).xy().norm() < 0.02,
            "{speed}: {approach:?}, to {target}"
        );
    }
}
