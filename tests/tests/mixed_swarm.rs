//! The demo's building flown by PX4 and ArduCopter together: with the same companions and the same
//! plan, no vehicle touches anything.

use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario::{self, AutopilotKind};
use host_sim::swarm;

const DEMO: &str = include_str!("../../host-sim/scenarios/demo.toml");

#[test]
fn half_the_demo_by_ardupilot_is_complete_and_clean() {
    let mut scenario = scenario::parse(DEMO, "demo.toml").unwrap();
    for vehicle in scenario.vehicles.iter_mut().filter(|vehicle| vehicle.id % 2 == 0) {
        vehicle.autopilot = AutopilotKind::ArduPilot;
    }
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).unwrap();
    let plan = mission.plan().unwrap();
    let flight =
        swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden()).unwrap();
    let result = &flight.result;
    let log: Vec<_> =
        flight.log.iter().map(|e| format!("{:.1} s {:?}: {}", e.t_s, e.vehicle, e.text)).collect();
    assert!(result.complete, "{:#?}\n{}", result.vehicles, log.join("\n"));
    let safety = &result.safety;
    assert_eq!((safety.wall_contacts, safety.violations, safety.deadlocks), (0, 0, 0));
    for vehicle in &result.vehicles {
        assert!(vehicle.reached && vehicle.landed && vehicle.end == "Done", "{vehicle:?}");
        assert!(vehicle.flown_m < 1.3 * vehicle.path_m + 6.0, "{vehicle:?} wanders");
    }
}
