use super::*;

/// The formula against small steps of the same profile.
#[test]
fn a_stop_is_as_long_as_flown() {
    let brake = BrakingLimits { accel_mps2: 1.4, jerk_mps3: 1.9 };
    for i in 0..200 {
        let (speed, accel) = (-1.0 + 0.02 * i as f32, -1.4 + 0.037 * (i * 7 % 100) as f32);
        let (mut v, mut a, mut s, mut furthest) = (speed, accel, 0.0f32, 0.0f32);
        let dt = 5e-4;
        for _ in 0..20_000 {
            // As late as it may be, the motion takes the acceleration back.
            let ends = v + a * fabsf(a) / (2.0 * brake.jerk_mps3) <= 0.0;
            let next = if ends {
                fminf(a + brake.jerk_mps3 * dt, fmaxf(a, 0.0))
            } else {
                a - brake.jerk_mps3 * dt
            };
            a = fmaxf(next, -brake.accel_mps2);
            v += a * dt;
            s += v * dt;
            furthest = fmaxf(furthest, s);
            if v <= 0.0 && a <= 0.0 {
                break;
            }
        }
        let formula = stop_distance_m(speed, accel, brake);
        assert!(fabsf(formula - furthest) < 0.01, "{speed} {accel}: {formula} {furthest}");
    }
}
