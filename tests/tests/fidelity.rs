//! Simulated autopilots fly what the recorded ones flew: `cargo xtask bench --only fidelity` prints
//! the whole table.

use flockmate_tests::fidelity::{
    Correction, EstimateErrors, RECORDED_RUNS, Recording, allowed_rms_m, recordings,
};
use sim_autopilot::SimulatedKind;

/// The recorded flights that [`allowed_rms_m`] judges, with their allowed difference, metres.
fn plain() -> impl Iterator<Item = (Recording, f64)> {
    RECORDED_RUNS
        .iter()
        .flat_map(|run| recordings(run))
        .filter_map(|r| allowed_rms_m(&r).map(|allowed_m| (r, allowed_m)))
}

#[test]
fn plain_flights_are_flown_again_as_they_were_recorded() {
    for (recording, allowed_m) in plain() {
        let c = recording.compare(EstimateErrors::Recorded, Correction::Simulated);
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(c.whole.rms_m <= allowed_m.min(0.2), "{name}");
        // NaN where the flight has no such part.
        assert!(!(c.lift_off.rms_m > 0.3 || c.landing.rms_m > 0.3), "{name}");
        let in_follow_m = if recording.autopilot == SimulatedKind::Ardupilot { 0.08 } else { 0.12 };
        assert!(c.follow.rms_m.is_nan() || c.follow.rms_m <= in_follow_m, "{name}");
    }
}

#[test]
fn plain_flights_do_not_need_the_recorded_errors_to_come_near() {
    for (recording, allowed_m) in plain() {
        let c = recording.compare(EstimateErrors::Perfect, Correction::Simulated);
        // Two recorded flights of one mission differ by 0.24 to 0.51 m with PX4.
        let px4 = recording.autopilot == SimulatedKind::Px4;
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(c.whole.rms_m <= if px4 { 0.45 } else { allowed_m }, "{name}");
        assert!(!(c.lift_off.rms_m > 0.3 || c.landing.rms_m > 0.3), "{name}");
    }
}

#[test]
fn setpoints_as_they_were_sent_are_flown_as_recorded_under_the_recorded_errors() {
    for (recording, allowed_m) in plain() {
        let c = recording.compare(EstimateErrors::Recorded, Correction::Recorded);
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(c.whole.rms_m <= allowed_m.min(0.25), "{name}");
        assert!(!(c.lift_off.rms_m > 0.3 || c.landing.rms_m > 0.3), "{name}");
        let in_follow_m = if recording.autopilot == SimulatedKind::Ardupilot { 0.08 } else { 0.2 };
        assert!(c.follow.rms_m.is_nan() || c.follow.rms_m <= in_follow_m, "{name}");
    }
}

#[test]
fn interrupted_px4s_stop_as_far_on_as_they_did() {
    // A failsafe lands the first at 1.85 m/s; a pilot switches the others to Hold at 1.4 and 1.9.
    let runs = ["px4_c1_demo", "x_drift_demo", "x_drift_demo_1"];
    for recording in runs.iter().flat_map(|run| recordings(run)) {
        let c = recording.compare(EstimateErrors::Recorded, Correction::Recorded);
        println!("{}: {c:.2?}", recording.run);
        assert!(c.whole.rms_m <= 0.35 && c.whole.max_m <= 0.8, "{}: {c:?}", recording.run);
    }
}

#[test]
fn errors_of_another_flight_with_the_same_noise_do_as_well() {
    // The replay has only the setpoints of its own flight, yet it is far nearer to the recording
    // than without errors.
    let pairs = [
        ("a_demo", "px4_d4_lobby"),
        ("a_lobby", "px4_d4_lobby"),
        ("a_lobby", "a_demo"),
        ("a_lobby", "x_drift_demo"),
    ];
    for (run, other) in pairs {
        let (Some(recording), Some(other)) = (recordings(run).pop(), recordings(other).pop())
        else {
            return;
        };
        let alike = recording.error_correlation(&other);
        let c = recording.compare(EstimateErrors::Of(&other), Correction::Recorded);
        println!("{run} under the errors of {}: {alike:.2} {c:.2?}", other.run);
        let allowed_m = allowed_rms_m(&recording).expect("a plain flight");
        assert!(alike >= 0.8 && c.whole.rms_m <= allowed_m, "{run}, {}: {alike} {c:?}", other.run);
    }
}

#[test]
fn setpoints_as_they_were_sent_bring_it_as_near_as_real_flights_repeat() {
    for (recording, _) in plain() {
        let c = recording.compare(EstimateErrors::Perfect, Correction::Recorded);
        let name = format!("{} {}: {c:.2?}", recording.run, recording.vehicle);
        println!("{name}");
        assert!(c.whole.rms_m <= 0.55, "{name}");
    }
}
