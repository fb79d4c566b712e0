//! Gives forged frames to companions in flight; `cargo xtask bench --only hostile --n N` gives N of
//! them.

use std::time::Instant;

use clap::Parser;
use flockmate_tests::hostile;

#[derive(Parser)]
#[command(about = "Forged frames for companions in flight")]
struct Args {
    /// Number of forged frames.
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    n: u64,
    /// The first seed.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
}

fn main() {
    let args = Args::parse();
    let began = Instant::now();
    let report = hostile::attacks(args.seed, args.n);
    report.broken_rules.iter().chain(&report.unfit_setpoints).for_each(|what| println!("{what}"));
    println!("{}", report.setpoints);
    println!("steps in each state: {:?}", report.steps_in_state);
    println!(
        "{} frames in {:.1} s on {} cores; most sent in a second: {:?}; {} rules broken",
        report.frames,
        began.elapsed().as_secs_f64(),
        rayon::current_num_threads(),
        report.max_sent_per_s,
        report.broken_rules.len()
    );
    if !report.broken_rules.is_empty() || !report.unfit_setpoints.is_empty() {
        std::process::exit(1);
    }
}
