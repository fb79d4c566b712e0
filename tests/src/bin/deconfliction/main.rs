//! The deconfliction suite: hard meetings of vehicles, flown over many seeds with each method.
//! Prints one line per case and method; `cargo xtask bench --only deconfliction` runs it.
//!
//! Every meeting is a map made here, written as OctoMap and read back like any other, and a
//! scenario's text, so that each can be flown again alone. A meeting is planned once a seed; every
//! case of it and both methods fly that plan.

mod cases;
mod ideal;
mod short_landings;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use host_sim::mission::{HostPlan, PreparedMission};
use host_sim::progress::Progress;
use host_sim::report::Level;
use host_sim::result::{MissionResult, VehicleResult};
use host_sim::{scenario, swarm};
use rayon::prelude::*;
use serde::Serialize;

use cases::Meeting;
use short_landings::{Cause, Struck};

const METHODS: [&str; 2] = ["priority", "algorithm2"];
/// A separation so small that no vehicle waits for another one, metres.
const NO_WAIT_SEPARATION_M: f32 = 1e-3;
/// Time from the beginning of a simulation to the first vehicle at the top of its climb, seconds.
const FIRST_CLIMB_DONE_S: f32 = 8.0;

#[derive(Parser)]
#[command(about = "Hard meetings of vehicles, flown over many seeds")]
struct Args {
    /// Number of seeds flown of each case.
    #[arg(long, value_name = "N", default_value_t = 100)]
    seeds: u64,
    /// The first seed; the others follow.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    first: u64,
    /// Only the cases whose name contains this.
    #[arg(long, value_name = "NAME", default_value = "")]
    only: String,
    /// Only the methods whose name contains this.
    #[arg(long, value_name = "NAME", default_value = "")]
    method: String,
    /// Leave out meetings of more than twenty vehicles.
    #[arg(long)]
    small: bool,
    /// Write the rows to this file as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<std::path::PathBuf>,
    /// Keep the maps, and the scenarios of incomplete flights, in this directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<std::path::PathBuf>,
}

/// Results of one method in one case, over all seeds.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// Name of the case.
    name: &'static str,
    /// Name of the method.
    method: &'static str,
    /// Number of seeds flown.
    seeds: u64,
    /// Number of missions that ended complete and clean.
    complete: u64,
    /// Number of missions for which no plan was found.
    unplanned: u64,
    /// Number of approaches below the safety distance.
    violations: u32,
    /// Number of contacts with walls, without those of a vehicle under its pilot.
    wall_contacts: u32,
    /// Number of contacts of a vehicle under its pilot, which no companion can prevent.
    wall_contacts_under_pilot: u32,
    /// Number of missions that were complete and clean but for such contacts.
    complete_but_for_pilot: u64,
    /// Number of deadlocks.
    deadlocks: u32,
    /// Number of vehicles without a fault that did not reach their goals.
    held_up: usize,
    /// Number of these vehicles by cause, in the order of [`Cause::ALL`].
    held_up_by: [usize; Cause::ALL.len()],
    /// Greatest distance of silent vehicles on the ground: beside their path, and along it from
    /// where they were last heard, metres.
    lies_m: [f32; 2],
    /// Smallest distance of two vehicles seen, metres.
    min_separation_m: f64,
    /// Mean excess of the flight time, from take-off to landing, over that of the same flight
    /// alone, as a fraction of the latter.
    extra_flight: f64,
    /// Mean excess of the last landing's time over that if each vehicle flew alone, all at once, as
    /// a fraction of the latter.
    extra_makespan: f64,
    /// As `extra_makespan`, by the times of the plan's schedule.
    #[serde(skip_serializing_if = "Option::is_none")]
    planned_makespan: Option<f64>,
    /// As `extra_makespan`, by the best schedule that a search over orders with straight and square
    /// paths finds.
    #[serde(skip_serializing_if = "Option::is_none")]
    ideal_makespan: Option<f64>,
    /// Errors of the flights: seed, seconds, vehicle and text.
    #[serde(skip)]
    incidents: Vec<String>,
    /// Number of vehicles' flights over which `extra_flight` is summed.
    #[serde(skip)]
    flights: u32,
}

impl Row {
    /// Whether this flight was not clean, but would have been without contacts under a pilot.
    fn is_clean_but_for_pilot(&self) -> bool {
        let broken = self.wall_contacts + self.violations + self.deadlocks;
        self.wall_contacts_under_pilot > 0 && broken == 0 && self.held_up == 0
    }
}

fn main() -> Result<()> {
    let args = Args::parse();
    let scratch = tempfile::tempdir()?;
    let dir = args.keep.as_deref().unwrap_or(scratch.path());
    std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
    println!(
        "{:30} {:10} {:>9} {:>9} {:>10} {:>8} {:>9} {:>7} {:>9} {:>7} {:>8}",
        "case",
        "method",
        "complete",
        "unplanned",
        "violations",
        "contacts",
        "deadlocks",
        "held up",
        "nearest",
        "flight",
        "makespan"
    );
    let mut rows = Vec::new();
    for mut meeting in cases::all_meetings(dir)? {
        meeting.keep_cases_named(&args.only);
        if meeting.cases.is_empty() || (args.small && meeting.is_large()) {
            continue;
        }
        let began = Instant::now();
        for row in fly_all(&meeting, &args, dir)?.into_iter().filter(|row| row.seeds > 0) {
            print_row(&row);
            rows.push(row);
        }
        println!("    {:.0} s", began.elapsed().as_secs_f64());
    }
    if let Some(out) = &args.out {
        std::fs::write(out, serde_json::to_string_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", out.display()))?;
    }
    Ok(())
}

fn print_row(row: &Row) {
    println!(
        "{:30} {:10} {:>5}/{:<3} {:>9} {:>10} {:>8} {:>9} {:>7} {:>7.2} m {:>5.0} % {:>6.0} %",
        row.name,
        row.method,
        row.complete,
        row.seeds,
        row.unplanned,
        row.violations,
        row.wall_contacts,
        row.deadlocks,
        row.held_up,
        row.min_separation_m,
        row.extra_flight * 100.0,
        row.extra_makespan * 100.0,
    );
    if let (Some(planned), Some(ideal)) = (row.planned_makespan, row.ideal_makespan) {
        let [planned, ideal] = [planned, ideal].map(|share| share * 100.0);
        println!("    makespan by the schedule: {planned:.0} %, the ideal {ideal:.0} %");
    }
    if row.lies_m != [0.0; 2] {
        let [beside_m, along_m] = row.lies_m;
        println!(
            "    silent, it lies up to {beside_m:.2} m beside its path, {along_m:.2} m further along it"
        );
    }
    if row.wall_contacts_under_pilot > 0 {
        println!(
            "    under its pilot, a vehicle touched a wall {} times; but for that, {} more are complete",
            row.wall_contacts_under_pilot, row.complete_but_for_pilot
        );
    }
    let causes = Cause::ALL.iter().zip(row.held_up_by).filter(|(_, count)| *count > 0);
    causes.for_each(|(cause, count)| println!("    held up: {count} x {cause}"));
    if row.method == METHODS[0] {
        row.incidents.iter().for_each(|incident| println!("    {incident}"));
    }
}

/// Flies all cases of a meeting with both methods over all seeds; one row each.
fn fly_all(meeting: &Meeting, args: &Args, dir: &Path) -> Result<Vec<Row>> {
    let seeds: Vec<u64> = (args.first..args.first + args.seeds.min(meeting.max_seeds)).collect();
    let flown: Vec<Vec<Row>> = seeds
        .into_par_iter()
        .map(|seed| fly_seed(meeting, seed, dir, &args.method))
        .collect::<Result<_>>()?;
    let mut sums = empty_rows(meeting);
    for (sum, row) in flown.into_iter().flat_map(|rows| rows.into_iter().enumerate()) {
        let sum = &mut sums[sum];
        sum.seeds += row.seeds;
        sum.complete += row.complete;
        sum.unplanned += row.unplanned;
        sum.violations += row.violations;
        sum.wall_contacts += row.wall_contacts;
        sum.wall_contacts_under_pilot += row.wall_contacts_under_pilot;
        sum.complete_but_for_pilot += row.complete_but_for_pilot;
        sum.deadlocks += row.deadlocks;
        sum.held_up += row.held_up;
        sum.lies_m.iter_mut().zip(row.lies_m).for_each(|(sum, m)| *sum = sum.max(m));
        sum.held_up_by.iter_mut().zip(row.held_up_by).for_each(|(sum, count)| *sum += count);
        sum.min_separation_m = sum.min_separation_m.min(row.min_separation_m);
        sum.extra_flight += row.extra_flight;
        sum.extra_makespan += row.extra_makespan;
        for (sum, extra) in [
            (&mut sum.planned_makespan, row.planned_makespan),
            (&mut sum.ideal_makespan, row.ideal_makespan),
        ] {
            *sum = extra.map(|extra| sum.unwrap_or(0.0) + extra).or(*sum);
        }
        sum.flights += row.flights;
        sum.incidents.extend(row.incidents);
    }
    for sum in &mut sums {
        sum.extra_flight /= f64::from(sum.flights.max(1));
        let planned = (sum.seeds - sum.unplanned).max(1) as f64;
        sum.extra_makespan /= planned;
        [&mut sum.planned_makespan, &mut sum.ideal_makespan]
            .into_iter()
            .flatten()
            .for_each(|s| *s /= planned);
    }
    Ok(sums)
}

/// Empty rows of a meeting: one for each case and method, without a seed.
fn empty_rows(meeting: &Meeting) -> Vec<Row> {
    let row = |name, method| Row {
        name,
        method,
        seeds: 0,
        complete: 0,
        unplanned: 0,
        violations: 0,
        wall_contacts: 0,
        wall_contacts_under_pilot: 0,
        complete_but_for_pilot: 0,
        deadlocks: 0,
        held_up: 0,
        held_up_by: [0; Cause::ALL.len()],
        lies_m: [0.0; 2],
        min_separation_m: f64::INFINITY,
        extra_flight: 0.0,
        extra_makespan: 0.0,
        planned_makespan: None,
        ideal_makespan: None,
        incidents: Vec::new(),
        flights: 0,
    };
    meeting.cases.iter().flat_map(|&(name, _)| METHODS.map(|method| row(name, method))).collect()
}

/// Flies all cases of a meeting with one seed.
fn fly_seed(meeting: &Meeting, seed: u64, dir: &Path, only: &str) -> Result<Vec<Row>> {
    let mut rows = empty_rows(meeting);
    rows.iter_mut().filter(|row| row.method.contains(only)).for_each(|row| row.seeds = 1);
    let mut mission = PreparedMission::prepare(
        parse_scenario(meeting, "off", cases::GUSTS, seed, dir)?,
        &Progress::hidden(),
    )?;
    let plan = match mission.plan() {
        Ok(plan) => plan,
        Err(error) => {
            for row in &mut rows {
                row.unplanned = 1;
                row.incidents = vec![format!("seed {seed}: {error}")];
            }
            return Ok(rows);
        }
    };
    let apart = *mission.schedule();
    mission.set_separation(NO_WAIT_SEPARATION_M, NO_WAIT_SEPARATION_M)?;
    let shortest = mission.plan()?;
    let alone = fly(&mission, &shortest)?.result;
    mission.set_separation(apart.separation_m, apart.parked_separation_m)?;
    let landings = if meeting.compares_ideal_makespan {
        ideal::last_landings(&mission, &plan, &shortest)
    } else {
        None
    };
    if let (Some(landings), Some(row)) = (landings, rows.first_mut()) {
        let extra = |last_s: f32| Some(f64::from(last_s / landings.alone_s) - 1.0);
        (row.planned_makespan, row.ideal_makespan) =
            (extra(landings.planned_s), extra(landings.ideal_s));
    }
    let (struck, at_s) = struck_vehicle_and_time(meeting, &plan, &alone, seed);
    let cases = meeting.cases.iter().flat_map(|case| METHODS.map(|method| (case, method)));
    for (row, (&(name, simulation), method)) in
        rows.iter_mut().zip(cases).filter(|(row, _)| row.seeds > 0)
    {
        let simulation = simulation.replace("AT_S", &at_s).replace("VEHICLE", &struck.to_string());
        mission.scenario = parse_scenario(meeting, method, &simulation, seed, dir)?;
        let flight = fly(&mission, &plan)?;
        fill_row(row, &flight.result, &alone);
        let is_struck = |v: &VehicleResult| simulation.contains("[[faults]]") && v.id == struck;
        row.held_up = flight.result.vehicles.iter().filter(|v| !v.reached && !is_struck(v)).count();
        row.complete_but_for_pilot = u64::from(row.is_clean_but_for_pilot());
        if simulation.contains("[[faults]]") && method == METHODS[0] {
            // A vehicle that no other hears may lie where it was struck, or further along its path.
            let silent = simulation.contains("radio-cut") && !simulation.contains("\"rx\"");
            let struck = Struck { index: usize::from(struck) - 1, at_s: at_s.parse()?, silent };
            note_causes(row, &mission, &plan, &flight, struck);
        }
        if !flight.result.complete {
            let file = dir.join(format!("{name}, {method}, seed {seed}.toml"));
            std::fs::write(&file, meeting.scenario(method, &simulation, seed))
                .with_context(|| format!("cannot write {}", file.display()))?;
        }
        let errors = flight.log.iter().filter(|event| event.level == Level::Error);
        row.incidents.extend(
            errors.map(|e| format!("seed {seed}, {:.1} s, {:?}: {}", e.t_s, e.vehicle, e.text)),
        );
    }
    Ok(rows)
}

/// Adds to a row why each vehicle landed short of its goal, and where a silent struck vehicle lies.
fn note_causes(
    row: &mut Row,
    mission: &PreparedMission,
    plan: &HostPlan,
    flight: &swarm::SwarmFlight,
    struck: Struck,
) {
    // A silent vehicle that waited on its pad until all others had landed may have flown its
    // mission then.
    let lies = struck.silent && !flight.result.vehicles[struck.index].reached;
    if let Some([beside_m, along_m]) =
        short_landings::rest_offsets_m(plan, flight, struck).filter(|_| lies)
    {
        row.lies_m = [row.lies_m[0].max(beside_m), row.lies_m[1].max(along_m)];
    }
    let held = |(i, v): &(usize, &VehicleResult)| !v.reached && *i != struck.index;
    for (index, vehicle) in flight.result.vehicles.iter().enumerate().filter(held) {
        let cause = short_landings::cause_of_short_landing(mission, plan, flight, struck, index);
        row.held_up_by[cause as usize] += 1;
        let (seed, by) = (flight.result.seed, flight.result.vehicles[struck.index].id);
        row.incidents.push(format!("seed {seed}, vehicle {} held up by {by}: {cause}", vehicle.id));
    }
}

/// Id of the vehicle that faults strike, and when, in seconds as text for the scenario.
fn struck_vehicle_and_time(
    meeting: &Meeting,
    plan: &HostPlan,
    alone: &MissionResult,
    seed: u64,
) -> (u8, String) {
    let (id, share) = meeting.struck_vehicle_and_share(seed);
    let index = usize::from(id) - 1;
    let flying_s = share * (alone.vehicles[index].flight_time_s as f32);
    let at_s = FIRST_CLIMB_DONE_S + plan.flights[index].depart_s + flying_s;
    (id, format!("{at_s:.1}"))
}

fn parse_scenario(
    meeting: &Meeting,
    method: &str,
    simulation: &str,
    seed: u64,
    dir: &Path,
) -> Result<scenario::Scenario> {
    // The scenario names its map by an absolute path, so `name` only serves error messages.
    let name = dir.join("case.toml").display().to_string();
    Ok(scenario::parse(&meeting.scenario(method, simulation, seed), &name)?)
}

fn fly(mission: &PreparedMission, plan: &HostPlan) -> Result<swarm::SwarmFlight> {
    swarm::fly(mission, plan, "fly", swarm::Pace::Fastest, &Progress::hidden())
}

fn fill_row(row: &mut Row, result: &MissionResult, alone: &MissionResult) {
    row.complete = u64::from(result.complete);
    row.violations = result.safety.violations;
    row.wall_contacts_under_pilot = result.safety.wall_contacts_under_pilot;
    row.wall_contacts = result.safety.wall_contacts - row.wall_contacts_under_pilot;
    row.deadlocks = result.safety.deadlocks;
    row.min_separation_m = result.safety.min_separation_m.unwrap_or(f64::INFINITY);
    row.extra_makespan = result.totals.makespan_s / alone.totals.makespan_s - 1.0;
    for (vehicle, alone) in result.vehicles.iter().zip(&alone.vehicles) {
        if vehicle.landed && alone.landed {
            row.extra_flight += vehicle.flight_time_s / alone.flight_time_s - 1.0;
            row.flights += 1;
        }
    }
}
