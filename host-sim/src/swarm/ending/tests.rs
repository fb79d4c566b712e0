use crate::mission::PreparedMission;
use crate::progress::Progress;
use crate::swarm::{self, Pace, SwarmFlight};

/// Flies three vehicles over a field, with these keys of `[simulation]` and these faults.
fn flown(settings: &str, faults: &str) -> SwarmFlight {
    let text = format!(
        "[area]\npolygon = [[0, 0], [150, 10], [170, 90], [80, 120], [-10, 80]]\n\
         camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 35.0\n\
         [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n\
         [[vehicles]]\nid = 2\nstart = [10, -20, 0]\n[[vehicles]]\nid = 3\nstart = [20, -20, 0]\n\
         [simulation]\n{settings}\n{faults}"
    );
    let scenario = crate::scenario::parse(&text, "field.toml").unwrap();
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).unwrap();
    let plan = mission.plan().unwrap();
    swarm::fly(&mission, &plan, "fly", Pace::Fastest, &Progress::hidden()).unwrap()
}

/// When each vehicle landed, as far as it did, for messages.
fn ends(flight: &SwarmFlight) -> Vec<(bool, &str)> {
    flight.result.vehicles.iter().map(|v| (v.landed, &*v.end)).collect()
}

/// Pilots take all vehicles and give them back: whether they fly on or land, the simulation does
/// not end before they are down.
#[test]
fn vehicles_that_their_pilots_gave_back_are_awaited_on_the_ground() {
    for (at_s, lasts_s) in [(100, 40), (100, 3), (60, 30), (40, 90)] {
        for loss in [0.0, 0.4] {
            let settings = format!("radio_loss = {loss:.1}\ntime_limit_s = 1000");
            let fault = format!(
                "[[faults]]\nkind = \"pilot-takeover\"\nat_s = {at_s}\nduration_s = {lasts_s}\n"
            );
            let flight = flown(&settings, &format!("{fault}\n"));
            let named = format!("{at_s} s, {lasts_s} s, loss {loss}: {:?}", ends(&flight));
            assert!(flight.result.vehicles.iter().all(|v| v.landed), "{named}");
            assert!(flight.simulated_s < 900.0, "{named}, {} s", flight.simulated_s);
        }
    }
}

/// Pilots that keep their vehicles are not awaited.
#[test]
fn vehicles_that_their_pilots_keep_are_left_in_the_air() {
    let flight =
        flown("time_limit_s = 1000", "[[faults]]\nkind = \"pilot-takeover\"\nat_s = 100\n");
    assert!(ends(&flight).iter().all(|(landed, _)| !landed), "{:?}", ends(&flight));
    assert!(flight.simulated_s < 110.0, "{} s", flight.simulated_s);
}
