//! Vehicles that fail just where their radio no longer reaches the others.
//!
//! A flight of the demo with a random short radio range is flown once without a fault. Each moment
//! of it at which a vehicle on its path leaves the range of all others is a candidate. Near one of
//! these, from 3 s before to 12 s after, a random fault strikes that vehicle, and the flight is
//! flown again. The referee, which sees the true motion, judges this second flight.

use host_sim::mission::{HostPlan, PreparedMission};
use host_sim::progress::Progress;
use host_sim::scenario::{self, Fault};
use host_sim::swarm::{self, SwarmFlight};

use crate::swarms::Random;
use crate::vehicle::widest_late_leg_middle;

const DEMO: &str = include_str!("../../host-sim/scenarios/demo.toml");
/// Time limit of a flight, seconds: every flight has ended by then.
const TIME_LIMIT_S: f32 = 600.0;
/// TOML lines of each fault besides `at_s` and `vehicle`; AHEAD becomes a point on the vehicle's
/// path.
pub const FAULT_SCRIPTS: [&str; 9] = [
    "kind = 'pilot-takeover'",
    "kind = 'pilot-takeover'\nduration_s = 30",
    "kind = 'companion-reset'",
    "kind = 'battery-low'",
    "kind = 'gps-loss'",
    "kind = 'serial-stall'\nduration_s = 8",
    "kind = 'radio-cut'",
    "kind = 'kill'",
    "kind = 'obstacle'\nradius_m = 0.4\nposition = AHEAD",
];

/// A mission with a short radio range, its plan, and when each vehicle leaves the range of all
/// others.
pub struct RadioEdgeMission {
    /// Radio range of the mission, metres.
    pub range_m: f32,
    /// The mission, with this range.
    mission: PreparedMission,
    plan: Box<HostPlan>,
    /// Each time, seconds, at which a vehicle leaves the range of all others, and its index.
    range_exits: Vec<(f32, usize)>,
    rng: Random,
}

/// What happened in one flight in which a fault struck a vehicle near the edge of the radio range.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Text: the radio range, the struck vehicle, when, and by which fault.
    pub description: String,
    /// The log of companions, faults and referee, in order.
    pub log: Vec<String>,
    /// Log lines of what must not happen: contacts, and pairs too near of which neither was struck.
    pub forbidden: Vec<String>,
    /// Log lines of vehicles nearer than the safety distance to the struck one, or hit by it.
    pub near_struck: Vec<String>,
    /// Vehicles without a fault that at the end neither had landed nor stood on their pads.
    pub not_landed: Vec<String>,
    /// Number of deadlocks that the referee counted (no progress for 20 s).
    pub deadlocks: u32,
    /// Number of vehicles that landed at their goals.
    pub arrived_count: usize,
}

impl RadioEdgeMission {
    /// Draws the mission of a seed, and flies it once without a fault.
    ///
    /// # Errors
    /// The mission cannot be planned or flown.
    pub fn new(seed: u64) -> anyhow::Result<Self> {
        let mut rng = Random::new(seed);
        let mut scenario = scenario::parse(DEMO, "demo.toml")?;
        let range_m = rng.uniform(4.0, 20.0);
        (scenario.seed, scenario.simulation.radio_range_m) = (seed, range_m);
        scenario.simulation.time_limit_s = TIME_LIMIT_S;
        let mut mission = PreparedMission::prepare(scenario, &Progress::hidden())?;
        let plan = mission.plan()?;
        let flight = swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden())?;
        let leaves = range_exits(&flight, range_m);
        Ok(Self { range_m, mission, plan, range_exits: leaves, rng })
    }

    /// Lets every vehicle hear every other one from now on, so that only the faults have an effect.
    pub fn let_all_hear(&mut self) {
        self.mission.scenario.simulation.radio_range_m = 500.0;
    }

    /// Flies the mission with a random fault; `None` if no vehicle leaves the range of the others.
    ///
    /// # Errors
    /// The mission cannot be flown.
    pub fn fly_with_fault(&mut self) -> anyhow::Result<Option<Outcome>> {
        if self.range_exits.is_empty() {
            return Ok(None);
        }
        let (left_s, index) = self.range_exits[self.rng.below(self.range_exits.len())];
        let script = FAULT_SCRIPTS[self.rng.below(FAULT_SCRIPTS.len())];
        let at_s = (left_s + self.rng.uniform(-3.0, 12.0)).max(1.0);
        let id = self.plan.flights[index].vehicle_id;
        self.mission.scenario.faults = self.parse_fault(script, at_s, id, index)?;
        let flight = swarm::fly(
            &self.mission,
            &self.plan,
            "fly",
            swarm::Pace::Fastest,
            &Progress::hidden(),
        )?;
        let what = format!("range {:.1} m, vehicle {id} at {at_s:.1} s, {script:?}", self.range_m);
        Ok(Some(Outcome { description: what, ..judge_flight(&flight, id) }))
    }

    /// The fault of this script that strikes vehicle `id` at `at_s`.
    fn parse_fault(
        &self,
        script: &str,
        at_s: f32,
        id: u8,
        index: usize,
    ) -> anyhow::Result<Vec<Fault>> {
        let [x, y, z] = widest_late_leg_middle(&self.plan.flights[index].path).into();
        let script = script.replace("AHEAD", &format!("[{x}, {y}, {z}]"));
        let text = format!("{DEMO}\n[[faults]]\nat_s = {at_s}\nvehicle = {id}\n{script}\n");
        Ok(scenario::parse(&text, "faults.toml")?.faults)
    }
}

/// Each time at which a vehicle that moves leaves the range of all others, and its index.
fn range_exits(flight: &SwarmFlight, range_m: f32) -> Vec<(f32, usize)> {
    let tracks = &flight.tracks;
    let mut leaves = Vec::new();
    for (i, own) in tracks.iter().enumerate() {
        let mut was_alone = true;
        for (k, (t_s, place)) in own.iter().enumerate() {
            let others = tracks.iter().enumerate().filter(|(j, _)| *j != i);
            let mut others =
                others.filter_map(|(_, track)| track.get(k.min(track.len().saturating_sub(1))));
            let alone = others.all(|(_, other)| (other - place).norm() > range_m);
            let moves = own.get(k + 5).is_some_and(|(_, later)| (later - place).norm() > 0.5);
            if alone && !was_alone && moves {
                leaves.push((*t_s, i));
            }
            was_alone = alone;
        }
    }
    leaves
}

/// Sorts a flight's log by whether the struck vehicle took part in what happened.
fn judge_flight(flight: &SwarmFlight, struck: u8) -> Outcome {
    let mut outcome = Outcome { deadlocks: flight.result.safety.deadlocks, ..Outcome::default() };
    for e in &flight.log {
        let text = format!("{:.1} s vehicle {:?} {}", e.t_s, e.vehicle, e.text);
        outcome.log.push(text.clone());
        let by_struck =
            e.vehicle == Some(struck) || e.text.ends_with(&format!(" vehicle {struck}"));
        let own_wall = e.text.contains("touches an obstacle") && e.vehicle == Some(struck);
        if e.text.contains("nearer than") && by_struck {
            outcome.near_struck.push(text);
        } else if e.text.contains("nearer than") || (e.text.contains("touches") && !own_wall) {
            outcome.forbidden.push(text);
        } else if e.text.contains("is hit by falling") {
            outcome.near_struck.push(text);
        }
    }
    for v in &flight.result.vehicles {
        outcome.arrived_count += usize::from(v.reached && v.landed);
        let stays = v.landed || v.end.starts_with("Ready") || v.end.starts_with("Scheduled");
        if !stays && v.id != struck {
            outcome.not_landed.push(format!("vehicle {} ends in {}", v.id, v.end));
        }
    }
    outcome
}
