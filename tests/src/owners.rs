//! Which vehicle owns which waypoint of an area, after the plan and after each division in flight,
//! and which waypoints two vehicles photographed although only one should have.

use std::collections::{BTreeMap, BTreeSet};

use companion::swarm::fleet::VehicleDivisionInput;
use host_sim::coverage::CoveragePlan;
use host_sim::coverage::check::Picture;
use host_sim::mission::{HostPlan, PreparedMission};
use host_sim::progress::Progress;
use host_sim::report::LogEvent;
use host_sim::result::MissionResult;
use host_sim::scenario;
use host_sim::swarm::SwarmFlight;
use planner_core::flight::{Task, WaypointRange};

use crate::covered;

/// Waypoints by the id of their owner.
type Owned = BTreeMap<u8, BTreeSet<u32>>;

/// A mission that was flown.
pub struct FlownMission {
    /// Its result.
    pub result: MissionResult,
    /// Its log, by [`covered::log_lines`].
    pub log: String,
    /// What is wrong with the ownership of waypoints: two owners at once, a division that vehicles
    /// disagree on, a waypoint that two of its owners photographed ([`Owners::faults`]).
    pub ownership_faults: Vec<String>,
    /// How long the vehicles took to agree on each division, seconds; `None` where not all that
    /// took part at first reported it.
    pub agreements_s: Vec<Option<f32>>,
}

/// Flies a scenario in which the vehicles `struck` are lost.
///
/// # Errors
/// Reason why it cannot be planned, flown or judged.
pub fn fly(text: &str, struck: &[u8]) -> Result<FlownMission, String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).map_err(said)?;
    let mut pictures = Vec::new();
    let flight = covered::fly_with_record(&mut mission, &mut pictures).map_err(said)?;
    let plan = mission.plan().map_err(said)?;
    let owners = Owners::of(&mission, &plan, &flight).map_err(said)?;
    // On a detour around an obstacle pictures are taken beside the lane, also of waypoints that
    // other vehicles own.
    pictures.retain(|picture| !is_beside_path(&flight.log, picture));
    let planned = CoveragePlan::plan_as_companions(&mission.scenario).map_err(said)?;
    let owned = owners.faults(&planned, &pictures, struck);
    let agreements: BTreeMap<u8, Option<f32>> =
        flight.divisions.iter().map(|division| (division.number, division.agreement_s)).collect();
    Ok(FlownMission {
        result: flight.result,
        agreements_s: agreements.into_values().collect(),
        log: covered::log_lines(&flight.log),
        ownership_faults: owned,
    })
}

/// Whether a picture was taken while its vehicle flew around an obstacle, by the vehicle's log.
fn is_beside_path(log: &[LogEvent], picture: &Picture) -> bool {
    let own = |event: &&LogEvent| {
        event.vehicle.is_some() && event.vehicle == picture.vehicle && event.t_s <= picture.t_s
    };
    let mut around = log.iter().filter(own).filter_map(|event| {
        let begins = event.text.contains("→ Follow: Flying around");
        (begins || event.text.contains("Flown around: on its path again")).then_some(begins)
    });
    around.next_back().unwrap_or(false)
}

/// Inputs of successive divisions, from the first one on.
type Chain<'a> = Vec<&'a [VehicleDivisionInput]>;

/// Which vehicle owns which waypoint in a mission that was flown, by its division records.
pub struct Owners {
    /// After the plan, and after each chain of divisions that a vehicle reported.
    plans: Vec<Owned>,
    /// Indices in `plans` of the plans that each vehicle reported to fly, besides the first plan.
    reported_plans: BTreeMap<u8, BTreeSet<usize>>,
    /// Vehicles that a division counts as lost, or as gone before the end of their parts.
    gone: BTreeSet<u8>,
    /// Waypoints that a plan gives to two vehicles.
    faults: Vec<String>,
    /// Two vehicles that disagree on a division, and its two sets of inputs.
    disagreements: Vec<([u8; 2], String)>,
}

impl Owners {
    /// Computes each division again from what the vehicles reported of it.
    ///
    /// # Errors
    /// A division that cannot be planned here.
    pub fn of(
        mission: &PreparedMission,
        plan: &HostPlan,
        flight: &SwarmFlight,
    ) -> anyhow::Result<Self> {
        let mut owners = Self {
            plans: Vec::new(),
            reported_plans: BTreeMap::new(),
            gone: BTreeSet::new(),
            faults: Vec::new(),
            disagreements: Vec::new(),
        };
        match flight.photographed_before.is_empty() {
            true => owners.add(plan),
            false => {
                let none = std::iter::empty::<&[VehicleDivisionInput]>();
                owners.add(&*mission.plan_remaining(&flight.photographed_before, none)?);
            }
        }
        let mut ids: Vec<u8> = plan.flights.iter().map(|flight| flight.vehicle_id).collect();
        ids.sort_unstable();
        // The first report of each division, and its reporter; the divisions that each vehicle
        // reported; the chains of divisions whose plan is known.
        let (mut first, mut begun) = (Chain::new(), Vec::<u8>::new());
        let mut chains: BTreeMap<u8, Chain<'_>> = BTreeMap::new();
        let mut planned = vec![Chain::new()];
        for division in flight.divisions.iter().filter(|division| !division.inputs.is_empty()) {
            let (number, vehicle) = (usize::from(division.number), division.vehicle);
            let inputs = &division.inputs[..];
            let Some(before) = number.checked_sub(1).filter(|before| *before <= first.len()) else {
                continue;
            };
            match first.get(before) {
                Some(known) if *known != inputs => {
                    let said = format!("division {number}: {known:?} and {inputs:?}");
                    owners.disagreements.push(([begun[before], vehicle], said));
                }
                Some(_) => {}
                None => {
                    first.push(inputs);
                    begun.push(vehicle);
                }
            }
            owners.note_gone(&ids, inputs);
            // A division that a vehicle did not report itself is taken from another vehicle's
            // report.
            let chain = chains.entry(vehicle).or_default();
            chain.truncate(before);
            chain.extend(&first[chain.len()..before]);
            chain.push(inputs);
            let known = planned.iter().position(|known| known == chain);
            let at = known.unwrap_or(planned.len());
            if known.is_none() {
                owners.add(
                    &*mission.plan_remaining(&flight.photographed_before, chain.iter().copied())?,
                );
                planned.push(chain.clone());
            }
            owners.reported_plans.entry(vehicle).or_default().insert(at);
        }
        Ok(owners)
    }

    /// Notes the vehicles that these inputs count as lost or gone. `ids` and `inputs` are in the
    /// order of ids.
    fn note_gone(&mut self, ids: &[u8], inputs: &[VehicleDivisionInput]) {
        let left = |input: &VehicleDivisionInput| {
            !input.alive && input.along_dm != VehicleDivisionInput::WHOLE_PATH
        };
        self.gone.extend(ids.iter().zip(inputs).filter(|(_, own)| left(own)).map(|(id, _)| *id));
    }

    /// Adds the owners of waypoints by a plan, and the waypoints that it gives to two vehicles.
    fn add(&mut self, plan: &HostPlan) {
        let mut owned = Owned::new();
        let mut all = BTreeMap::new();
        for flight in &plan.flights {
            let Task::Photograph(photographs) = &flight.task else { continue };
            let every = WaypointRange { first: 0, end: u32::MAX };
            for range in photographs.waypoints_of_pictures(&flight.path, every) {
                for number in range.first..range.end {
                    owned.entry(flight.vehicle_id).or_default().insert(number);
                    if let Some(other) = all.insert(number, flight.vehicle_id) {
                        let at = self.plans.len();
                        self.faults.push(format!(
                            "after {at} divisions {other} and {} own {number}",
                            flight.vehicle_id
                        ));
                    }
                }
            }
        }
        self.plans.push(owned);
    }

    /// Whether a plan that the vehicle flew gives it this waypoint.
    fn has_owned(&self, vehicle: u8, number: u32) -> bool {
        let owns = |at: &usize| self.plans[*at].get(&vehicle).is_some_and(|o| o.contains(&number));
        owns(&0) || self.reported_plans.get(&vehicle).is_some_and(|plans| plans.iter().any(owns))
    }

    /// Whether a waypoint is the first or last one of an unbroken range that a plan gives to a
    /// vehicle, or is next to such a waypoint: there a picture may be taken twice.
    fn is_at_seam(&self, number: u32) -> bool {
        let near = number.saturating_sub(1)..=number + 1;
        let ends = |own: &BTreeSet<u32>, k: u32| {
            own.contains(&k) && (!own.contains(&(k + 1)) || k == 0 || !own.contains(&(k - 1)))
        };
        near.into_iter()
            .any(|k| self.plans.iter().any(|owned| owned.values().any(|own| ends(own, k))))
    }

    /// What is wrong: a waypoint with two owners at once, a division that vehicles disagree on, and
    /// a waypoint that two of its owners photographed. A vehicle that was lost (struck by a fault,
    /// `struck`, or given up by the others) and a waypoint at a seam do not count for the last.
    pub fn faults(
        &self,
        planned: &CoveragePlan<'_>,
        pictures: &[Picture],
        struck: &[u8],
    ) -> Vec<String> {
        let mut by: BTreeMap<u32, BTreeSet<u8>> = BTreeMap::new();
        for picture in pictures {
            let Some(vehicle) = picture.vehicle else { continue };
            let number = nearest_waypoint(planned, picture);
            if self.has_owned(vehicle, number) {
                by.entry(number).or_default().insert(vehicle);
            }
        }
        let lost = |vehicle: &u8| struck.contains(vehicle) || self.gone.contains(vehicle);
        let wrong = by.iter().filter(|(number, vehicles)| {
            vehicles.iter().filter(|vehicle| !lost(vehicle)).count() > 1
                && !self.is_at_seam(**number)
        });
        let said = wrong.map(|(number, vehicles)| format!("{number} by {vehicles:?}"));
        // A disagreement with a vehicle that was lost does not count: its own flight is over before
        // others take its part.
        let split = self.disagreements.iter().filter(|(owners, _)| !owners.iter().any(lost));
        let split = split.map(|(_, said)| said.clone());
        self.faults.iter().cloned().chain(split).chain(said).collect()
    }
}

/// Number of the waypoint nearest to where a picture was taken.
fn nearest_waypoint(planned: &CoveragePlan<'_>, picture: &Picture) -> u32 {
    let off_m = |number: &u32| {
        planned
            .tracks
            .waypoint(*number)
            .map_or(f32::INFINITY, |place| (place - picture.position.xy()).norm())
    };
    (0..planned.tracks.waypoint_count())
        .min_by(|a, b| off_m(a).total_cmp(&off_m(b)))
        .unwrap_or_default()
}
