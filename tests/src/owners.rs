//! Which vehicle owns which waypoint of an area, after the plan and after each division in flight,
//! and which waypoints two vehicles photographed that should not have.

use std::collections::{BTreeMap, BTreeSet};

use companion::swarm::fleet::DivisionInput;
use host_sim::coverage::CoveragePlan;
use host_sim::coverage::check::Picture;
use host_sim::mission::{Mission, SwarmPlan};
use host_sim::swarm::Flight;
use planner_core::flight::{Task, WaypointRange};

/// Waypoints by the id of their owner.
type Owned = BTreeMap<u8, BTreeSet<u32>>;

/// Who owns what in a mission that was flown, by its division records.
pub struct Owners {
    /// After the plan, and after each division.
    plans: Vec<Owned>,
    /// Vehicles that a division counts as lost, or as gone before the end of their parts.
    gone: BTreeSet<u8>,
    /// Waypoints that a plan gives to two vehicles.
    faults: Vec<String>,
    /// Two vehicles that disagree on a division, and its two sets of inputs.
    disagreed: Vec<([u8; 2], String)>,
}

impl Owners {
    /// Computes each division again from what the vehicles reported of it.
    ///
    /// # Errors
    /// A division that cannot be planned here.
    pub fn of(mission: &Mission, plan: &SwarmPlan, flight: &Flight) -> anyhow::Result<Self> {
        let mut owners = Self {
            plans: Vec::new(),
            gone: BTreeSet::new(),
            faults: Vec::new(),
            disagreed: Vec::new(),
        };
        match flight.done.is_empty() {
            true => owners.add(plan),
            false => {
                let none = std::iter::empty::<&[DivisionInput]>();
                owners.add(&*mission.plan_remaining(&flight.done, none)?);
            }
        }
        let mut ids: Vec<u8> = plan.flights.iter().map(|flight| flight.id).collect();
        ids.sort_unstable();
        let (mut losses, mut begun) = (Vec::<&[DivisionInput]>::new(), Vec::<u8>::new());
        for division in flight.divisions.iter().filter(|division| !division.inputs.is_empty()) {
            let number = usize::from(division.number);
            let inputs = &division.inputs[..];
            if let Some(known) = number.checked_sub(1).and_then(|index| losses.get(index)) {
                if *known != inputs {
                    let said = format!("division {number}: {known:?} and {inputs:?}");
                    owners.disagreed.push(([begun[number - 1], division.vehicle], said));
                }
                continue;
            }
            if number != losses.len() + 1 {
                continue;
            }
            losses.push(inputs);
            begun.push(division.vehicle);
            let left =
                |input: &DivisionInput| !input.alive && input.along_dm != DivisionInput::WHOLE_PATH;
            let gone = ids.iter().zip(inputs).filter(|(_, input)| left(input)).map(|(id, _)| *id);
            owners.gone.extend(gone);
            owners.add(&*mission.plan_remaining(&flight.done, losses.iter().copied())?);
        }
        Ok(owners)
    }

    fn add(&mut self, plan: &SwarmPlan) {
        let mut owned = Owned::new();
        let mut all = BTreeMap::new();
        for flight in &plan.flights {
            let Task::Photograph(photographs) = &flight.task else { continue };
            let every = WaypointRange { first: 0, end: u32::MAX };
            for range in photographs.waypoints_of_pictures(&flight.path, every) {
                for number in range.first..range.end {
                    owned.entry(flight.id).or_default().insert(number);
                    if let Some(other) = all.insert(number, flight.id) {
                        let at = self.plans.len();
                        self.faults.push(format!(
                            "after {at} divisions {other} and {} own {number}",
                            flight.id
                        ));
                    }
                }
            }
        }
        self.plans.push(owned);
    }

    fn has_owned(&self, vehicle: u8, number: u32) -> bool {
        self.plans.iter().any(|owned| owned.get(&vehicle).is_some_and(|own| own.contains(&number)))
    }

    /// Whether a waypoint is, or is next to, the first or last one of what a plan gives a vehicle
    /// without a break: where a part begins a picture may be taken once more.
    fn is_at_seam(&self, number: u32) -> bool {
        let near = number.saturating_sub(1)..=number + 1;
        let ends = |own: &BTreeSet<u32>, k: u32| {
            own.contains(&k) && (!own.contains(&(k + 1)) || k == 0 || !own.contains(&(k - 1)))
        };
        near.into_iter()
            .any(|k| self.plans.iter().any(|owned| owned.values().any(|own| ends(own, k))))
    }

    /// What is wrong: a waypoint with two owners at once, a division that vehicles disagree on, and
    /// a waypoint that two of its owners photographed, unless one of them is a vehicle that was
    /// lost, by its stroke (`struck`) or for the others, or it is where a part begins.
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
        // What one that was then lost flew by itself is over before others take its part.
        let split = self.disagreed.iter().filter(|(who, _)| !who.iter().any(lost));
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
