//! Forged frames for companions in flight; `cargo xtask bench --only hostile --n 1000000000` gives
//! more.

use flockmate_tests::hostile;

/// Number of forged frames.
const FRAMES: u64 = 1_000_000;

#[test]
fn forged_frames_break_no_rule() {
    let report = hostile::attacks(1, FRAMES);
    println!("{}", report.setpoints);
    println!("{} frames, most sent in a second: {:?}", report.frames, report.max_sent_per_s);
    assert!(report.frames >= FRAMES);
    assert!(report.broken_rules.is_empty(), "{:#?}", report.broken_rules);
    let setpoints = report.setpoints;
    let unfit = (
        setpoints.too_far_apart,
        setpoints.too_jerky,
        setpoints.outside_fence,
        setpoints.not_finite,
    );
    assert_eq!(unfit, (0, 0, 0, 0), "{:#?}", report.unfit_setpoints);
    let seen = report.steps_in_state.iter().filter(|steps| **steps > 0).count();
    assert!(seen >= 12, "only {seen} states were attacked");
}

#[test]
fn forged_rosters_break_no_rule() {
    let report = hostile::attacks_over_area(1, FRAMES / 4);
    assert!(report.broken_rules.is_empty() && report.unfit_setpoints.is_empty(), "{report:#?}");
    let seen = report.steps_in_state.iter().filter(|steps| **steps > 0).count();
    println!("{} frames in {seen} states", report.frames);
    assert!(seen >= 10, "only {seen} states were attacked");
}

/// Seeds of attacks that once broke a rule: floods of requests after positions that jump, and
/// setpoints that followed such positions; EKF origins a thousand kilometres away, whose rounding
/// moves a setpoint out of the fence; a position that moved 12 m while no setpoint was sent.
const ONCE_BROKEN: [u64; 29] = [
    309, 979, 1069, 1079, 1141, 1301, 1458, 1603, 1644, 1731, 1987, 105_762, 106_380, 110_700,
    112_885, 373_325, 392_626, 214_779, 113_333, 116_978, 117_203, 101_349, 12_140, 15_858, 65_229,
    87_555, 92_621, 98_829, 90_771,
];

#[test]
fn attacks_that_once_broke_a_rule_break_none() {
    for seed in ONCE_BROKEN {
        let report = hostile::attacks(seed, 1);
        assert!(report.broken_rules.is_empty() && report.unfit_setpoints.is_empty(), "{report:#?}");
    }
}
