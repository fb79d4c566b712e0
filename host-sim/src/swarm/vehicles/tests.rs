use sim_autopilot::power_ratio_at_speed;

use crate::coverage::sorties;

#[test]
fn plans_count_on_the_power_that_the_simulated_vehicle_draws() {
    for speed_mps in (0..=240).map(|step| 0.125 * step as f32) {
        assert_eq!(sorties::power_ratio_at_speed(speed_mps), power_ratio_at_speed(speed_mps));
    }
}
