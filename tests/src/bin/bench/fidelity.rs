//! Simulated autopilots beside the recorded ones: recorded setpoints replayed, estimates compared.
//!
//! In these rows "ours" is the difference from arming to disarming (RMS, metres) under the recorded errors of the estimate, "theirs"
//! what is allowed. Flights in which a person or a failsafe took the vehicle are printed and not rated: each error of theirs adds up
//! in what follows.

use flockmate_tests::fidelity::{
    Comparison, Correction, Difference, Estimator, RUNS, Recording, allowed_m, recordings,
};

use crate::row::Row;

/// Flights of the same mission, by run and vehicle.
const TWINS: [[(&str, usize); 2]; 3] = [
    [("a_demo", 0), ("f_ppa", 0)],
    [("a_lobby", 0), ("x_rearm_lobby", 0)],
    [("ap_b_lobby", 0), ("apx_rearm_lobby", 0)],
];

/// A row a plain flight; prints what makes it up.
pub fn rows() -> Vec<Row> {
    println!(
        "RMS / greatest difference, metres: under the recorded errors of the estimate; without errors; without errors and with"
    );
    println!(
        "the accelerations as they were sent, which answer the recorded errors; and by how much the errors move these two"
    );
    println!(
        "{:20} {:>13} {:>13} {:>13} {:>13} {:>14} {:>13} {:>14}",
        "recorded flight",
        "whole",
        "in Follow",
        "height up",
        "height down",
        "without errors",
        "as sent",
        "errors move"
    );
    let mut rows = Vec::new();
    for recording in RUNS.iter().flat_map(|run| recordings(run)) {
        let c = recording.compare(Estimator::Recorded, Correction::Simulated);
        print(&recording, &c);
        let Some(allowed_m) = allowed_m(&recording) else { continue };
        rows.push(Row {
            name: format!("{} {}", recording.run, recording.vehicle),
            ours: c.whole.rms,
            theirs: allowed_m,
            ratio: allowed_m / c.whole.rms,
            required: 1.0,
            unit: "m ",
            n: 1,
        });
    }
    for [a, b] in TWINS {
        let (first, second) = (recordings(a.0), recordings(b.0));
        if let (Some(one), Some(other)) = (first.get(a.1), second.get(b.1)) {
            println!(
                "recorded flights {} and {} kept to their setpoints {:.2} differently",
                a.0,
                b.0,
                one.spread(other)
            );
        }
    }
    rows
}

fn print(recording: &Recording, c: &Comparison) {
    print!("{:20}", format!("{} {}", recording.run, recording.vehicle));
    let without = |correction| recording.compare(Estimator::Perfect, correction).whole;
    let [closed, sent] = [Correction::Simulated, Correction::Recorded].map(without);
    for part in [&c.whole, &c.follow, &c.lift_off, &c.landing, &closed, &sent] {
        let Difference { rms, max } = part;
        print!("   {rms:>4.2} / {max:>4.2}");
    }
    let [closed, sent] = [Correction::Simulated, Correction::Recorded].map(|k| recording.moved(k));
    println!("   {closed:>4.2},  {sent:>4.2}");
}
