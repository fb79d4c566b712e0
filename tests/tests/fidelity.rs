//! Simulated autopilots fly what the recorded ones flew: `cargo xtask bench --only fidelity` prints the whole table.

use flockmate_tests::fidelity::{Estimator, RUNS, allowed_m, recordings};
use host_sim::autopilot::Personality;

#[test]
fn plain_flights_are_flown_again_as_they_were_recorded() {
    for recording in RUNS.iter().flat_map(|run| recordings(run)) {
        let Some(allowed_m) = allowed_m(&recording) else { continue };
        let c = recording.compare(Estimator::Recorded);
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(c.whole.rms <= allowed_m, "{name}");
        // NaN where the flight has no such part.
        assert!(!(c.lift_off.rms > 0.3 || c.landing.rms > 0.3), "{name}");
        let in_follow_m = if recording.autopilot == Personality::Ardupilot { 0.08 } else { 0.25 };
        assert!(c.follow.rms.is_nan() || c.follow.rms <= in_follow_m, "{name}");
    }
}

#[test]
fn the_mission_s_own_autopilots_do_not_need_the_recorded_errors_to_come_near() {
    for recording in ["a_demo", "a_lobby", "f_ppa"].iter().flat_map(|run| recordings(run)) {
        let c = recording.compare(Estimator::Perfect);
        // Two recorded flights of one mission differ by 0.24 to 0.51 m.
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(recording.vehicle == 2 || c.whole.rms <= 0.55, "{name}");
    }
}
