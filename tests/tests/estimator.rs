//! Position estimates with errors as in recorded flights (`estimator = "recorded"`): the margin
//! and separation that they require, and that these suffice by true motion.

use host_sim::margins;
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario::{self, PositionErrors, Scenario, ScenarioError};
use host_sim::swarm;

const DEMO: &str = include_str!("../../host-sim/scenarios/demo.toml");
/// Number of seeds of the demo unless `FLOCKMATE_ESTIMATOR_SEEDS` sets another.
const SEEDS: u64 = 3;

fn demo(seed: u64, margin_m: f32, separation_m: f32) -> Result<Scenario, ScenarioError> {
    let text = DEMO
        .replace("seed = 1", &format!("seed = {seed}\n[simulation]\nestimator = \"recorded\""))
        .replace("safety_margin_m = 0.5 ", &format!("safety_margin_m = {margin_m} "))
        .replace(
            "safety_distance_m = 1.5",
            &format!("safety_distance_m = 1.5\nseparation_m = {separation_m}"),
        );
    scenario::parse(&text, "recorded")
}

#[test]
fn the_default_margin_and_separation_are_refused_with_the_metres_that_are_missing() {
    let refused = demo(1, 0.5, 2.0).unwrap_err().to_string();
    assert!(
        refused.contains("safety_margin_m is 0.50 m, 0.40 m less than the 0.90 m it takes"),
        "{refused}"
    );
    assert!(
        refused.contains("separation_m is 2.00 m, 1.30 m less than the 3.30 m it takes"),
        "{refused}"
    );
    // A larger margin or a larger separation alone is not enough.
    assert!(demo(1, 0.9, 3.2).is_err() && demo(1, 0.85, 3.3).is_err());
    let scenario = demo(1, 0.9, 3.3).unwrap();
    assert_eq!(scenario.simulation.estimator, PositionErrors::Recorded);
    let needed = margins::required_distances(&scenario.simulation, 1.5, &scenario.vehicles);
    assert!((needed.wall_margin_m - 0.9).abs() < 1e-4 && (needed.separation_m - 3.3).abs() < 1e-4);
}

#[test]
fn the_demo_flies_clean_by_the_truth_at_the_margins_for_recorded_errors() {
    let seeds = std::env::var("FLOCKMATE_ESTIMATOR_SEEDS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(SEEDS);
    for seed in 1..=seeds {
        let mut mission =
            PreparedMission::prepare(demo(seed, 0.9, 3.3).unwrap(), &Progress::hidden()).unwrap();
        let plan = mission.plan().unwrap();
        let flight =
            swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden()).unwrap();
        let safety = &flight.result.safety;
        println!(
            "seed {seed}: complete {}, walls {:?} m, vehicles {:?} m, makespan {} s",
            flight.result.complete,
            safety.min_clearance_m,
            safety.min_separation_m,
            flight.result.totals.makespan_s
        );
        assert_eq!(
            (safety.wall_contacts, safety.violations, safety.deadlocks),
            (0, 0, 0),
            "seed {seed}"
        );
        assert!(flight.result.vehicles.iter().all(|v| v.landed), "seed {seed}");
    }
}
