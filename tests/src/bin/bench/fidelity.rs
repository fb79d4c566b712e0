//! Compares simulated autopilots with recorded ones: replays recorded setpoints, compares
//! estimates.
//!
//! In these rows "ours" is the difference of the positions from arming to disarming (RMS, metres),
//! for the setpoints as they were sent and under the recorded errors of the estimate; "theirs" is
//! what is allowed. Flights in which a person or a failsafe took the vehicle are printed and not
//! rated: a difference at such a moment adds up in what follows.

use flockmate_tests::fidelity::{
    Comparison, Correction, Difference, EstimateErrors, RECORDED_RUNS, Recording, allowed_rms_m,
    recordings,
};
use sim_autopilot::SimulatedKind;

use crate::row::Row;

const HEADER: &str = "RMS / greatest difference, metres. Setpoints as they were sent, under the recorded errors of the estimate; \
\n\"closed\": accelerations as the recorded companion would have sent them beside the simulated vehicle; \"without\" errors; \
\nand by how much the errors move a replay of the setpoints as they were sent";

/// Pairs of recorded flights of the same mission, by run and index of the vehicle.
const TWIN_FLIGHTS: [[(&str, usize); 2]; 3] = [
    [("a_demo", 0), ("f_ppa", 0)],
    [("a_lobby", 0), ("x_rearm_lobby", 0)],
    [("ap_b_lobby", 0), ("apx_rearm_lobby", 0)],
];

/// One row for each rated flight; prints the differences of every recorded flight.
pub fn rows() -> Vec<Row> {
    println!("{HEADER}");
    println!(
        "{:20} {:>13} {:>13} {:>13} {:>13} {:>14} {:>14} {:>13} {:>14}",
        "recorded flight",
        "whole",
        "in Follow",
        "height up",
        "height down",
        "closed",
        "without, closed",
        "without",
        "errors move"
    );
    let mut rows = Vec::new();
    for recording in RECORDED_RUNS.iter().flat_map(|run| recordings(run)) {
        let c = recording.compare(EstimateErrors::Recorded, Correction::Recorded);
        print_differences(&recording, &c);
        let Some(allowed_m) = allowed_rms_m(&recording) else { continue };
        rows.push(Row {
            name: format!("{} {}", recording.run, recording.vehicle),
            ours: c.whole.rms_m,
            theirs: allowed_m,
            ratio: allowed_m / c.whole.rms_m,
            required: 1.0,
            unit: "m ",
            n: 1,
        });
    }
    for [a, b] in TWIN_FLIGHTS {
        let (first, second) = (recordings(a.0), recordings(b.0));
        if let (Some(one), Some(other)) = (first.get(a.1), second.get(b.1)) {
            println!(
                "recorded flights {} and {} kept to their setpoints {:.2} differently",
                a.0,
                b.0,
                one.tracking_difference_m(other)
            );
        }
    }
    print_under_other_errors();
    rows
}

/// Replays each of PX4's rated flights under the estimate errors of every other flight that lasts
/// as long; prints the correlation of both flights' errors, how far the replay is off the
/// recording, and how far these errors move it.
fn print_under_other_errors() {
    println!(
        "under the errors of another flight: correlation of the errors; off the recording; moved by them"
    );
    let all: Vec<Recording> = RECORDED_RUNS.iter().flat_map(|run| recordings(run)).collect();
    let px4 = || all.iter().filter(|r| r.autopilot == SimulatedKind::Px4);
    for recording in px4().filter(|r| allowed_rms_m(r).is_some()) {
        print!("{:20}", format!("{} {}", recording.run, recording.vehicle));
        let lasts = |r: &&Recording| r.armed_span_s.1 >= recording.armed_span_s.1 - 3.0;
        for other in px4().filter(lasts).filter(|r| !core::ptr::eq(*r, recording)) {
            let errors = EstimateErrors::Of(other);
            print!(
                "  {} {}: {:.2}; {:.2}; {:.2}",
                other.run,
                other.vehicle,
                recording.error_correlation(other),
                recording.compare(errors, Correction::Recorded).whole.rms_m,
                recording.moved_by_errors_m(errors, Correction::Recorded)
            );
        }
        println!();
    }
}

fn print_differences(recording: &Recording, c: &Comparison) {
    print!("{:20}", format!("{} {}", recording.run, recording.vehicle));
    let of = |errors, correction| recording.compare(errors, correction).whole;
    let closed = of(EstimateErrors::Recorded, Correction::Simulated);
    let [without_closed, without] =
        [Correction::Simulated, Correction::Recorded].map(|k| of(EstimateErrors::Perfect, k));
    for part in [&c.whole, &c.follow, &c.lift_off, &c.landing, &closed, &without_closed, &without] {
        let Difference { rms_m: rms, max_m: max } = part;
        print!("   {rms:>4.2} / {max:>4.2}");
    }
    println!(
        "   {:>4.2}",
        recording.moved_by_errors_m(EstimateErrors::Recorded, Correction::Recorded)
    );
}
