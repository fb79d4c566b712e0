//! `host-sim plan`: plans roadmap, assignment, paths and schedule, and writes the files for boards;
//! no flight.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::bail;

use super::load_supported;
use crate::capacity::{BOARDS, BoardCapacity, MAX_WAYPOINTS};
use crate::files::ResultFiles;
use crate::mission::{HostPlan, PreparedMission};
use crate::output;
use crate::progress::Progress;
use crate::result::{MissionResult, Safety, Totals, Unserved, VehicleResult, rounded};
use crate::roadmap::BuildTimes;
use crate::say;
use crate::shortage;

/// Arguments of `host-sim plan`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scenario
    scenario: PathBuf,
    /// Directory for `result.json`, `timing.json`, `report.html`, `starts.txt` and `goals.txt`, and
    /// for the files to upload to a board: `roadmap.bin`, or `field.bin` over terrain, and
    /// `mission.bin`
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Board that the files have to fit: nucleo-h743, qemu or pico2. Some edges of the roadmap are
    /// left out for it, which lengthens paths little
    #[arg(long, value_name = "BOARD", value_parser = BoardCapacity::by_name)]
    board: Option<&'static BoardCapacity>,
}

/// Plans the mission and writes all files. Exit code 0 if as many goals are served as vehicles and
/// goals allow.
///
/// # Errors
/// The input is bad, there is no plan, or it does not fit the board; the error names the place.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let began = Instant::now();
    let scenario = load_supported(&args.scenario, None)?;
    let names = ["starts.txt", "goals.txt", "roadmap.bin", "field.bin", "mission.bin"];
    let mut results = ResultFiles::open(&args.out, &[&output::RESULT_FILES[..], &names].concat())?;
    output::print_slow_vehicles(&scenario);
    let mut mission = PreparedMission::prepare_for(scenario, args.board, &Progress::on_terminal())?;
    let plan = mission.plan()?;
    if let Some((board, why)) =
        args.board.and_then(|board| Some((board, mission.board_limit_exceeded(&plan, board)?)))
    {
        bail!("the mission does not fit {}: {}: {why}", board.name, mission.scenario.path);
    }
    let result = planned_result(&mission, &plan);
    let page = output::planned_page(&mission, &plan, &result)?;
    mission.timing.wall_s = began.elapsed().as_secs_f64();
    output::add(&mut results, &result, &mission.timing, page)?;
    let starts = output::points_to_text(mission.scenario.vehicles.iter().map(|v| v.start));
    let goals = output::points_to_text(mission.goals.iter().copied());
    // A coverage mission has no roadmap, and no field over level ground: empty files are not
    // written.
    let (roadmap, field) = match mission.scenario.area {
        None => (&mission.roadmap_or_field_file[..], &[][..]),
        Some(_) => (&[][..], &mission.roadmap_or_field_file[..]),
    };
    let contents = [starts.as_bytes(), goals.as_bytes(), roadmap, field, &mission.mission_file];
    for (name, bytes) in names.iter().zip(contents).filter(|(_, bytes)| !bytes.is_empty()) {
        results.add(name, bytes)?;
    }
    results.commit()?;
    output::print_summary(&result, &args.out);
    for board in &BOARDS {
        match mission.board_limit_exceeded(&plan, board) {
            None => say!("board      {} holds the files", board.name),
            Some(why) => say!("board      {} does not hold the files: {why}", board.name),
        }
    }
    let BuildTimes { box_tree_s, nodes_s, edges_s, passages_s, edge_cap_s, encoding_s } =
        mission.timing.roadmap_parts;
    say!(
        "times      map {:.1} ms, roadmap {:.1} ms: boxes {:.1}, nodes {:.1}, edges {:.1}, passages {:.1}, capping {:.1}, \
         file {:.1}",
        mission.timing.map_s * 1e3,
        mission.timing.roadmap_s * 1e3,
        box_tree_s * 1e3,
        nodes_s * 1e3,
        edges_s * 1e3,
        passages_s * 1e3,
        edge_cap_s * 1e3,
        encoding_s * 1e3
    );
    say!("pads       where each stands, as `--home` of `host-sim autopilot`");
    for (i, task) in mission.tasks.iter().enumerate() {
        let pad = mission.pad_position(i);
        say!("{:>7}  {:.8},{:.8},{:.3}", task.id, pad.lat_deg, pad.lon_deg, pad.alt_m);
    }
    Ok(if result.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// `result.json` of a plan, with nothing flown.
fn planned_result(mission: &PreparedMission, plan: &HostPlan) -> MissionResult {
    let schedule = mission.schedule();
    let nominal_s = |f: &planner_core::flight::Flight<MAX_WAYPOINTS>| {
        (f.climb_m + f.descent_m) / schedule.vertical_mps + f.path.length_m() / schedule.cruise_mps
    };
    let flying = || plan.flights.iter().filter(|f| f.task.leaves_pad());
    let clearances = flying().flat_map(|f| f.path.waypoints()).map(|w| w.leg_clearance_m);
    let min_clearance_m = clearances.fold(f32::INFINITY, f32::min);
    let vehicles: Vec<_> = plan
        .flights
        .iter()
        .map(|flight| VehicleResult {
            id: flight.vehicle_id,
            goal: flight.task.goal(),
            reached: false,
            landed: false,
            path_m: rounded(flight.path.length_m()),
            flown_m: 0.0,
            flight_time_s: if flight.task.leaves_pad() { rounded(nominal_s(flight)) } else { 0.0 },
            end: if flight.task.leaves_pad() { "planned" } else { "no goal" }.to_owned(),
        })
        .collect();
    let makespan_s = flying().map(|f| f.depart_s + nominal_s(f)).fold(0.0, f32::max);
    MissionResult {
        command: "plan",
        scenario: mission.scenario.path.clone(),
        seed: mission.scenario.seed,
        // The plan of an area always covers all of it; otherwise every goal or every vehicle must
        // be served.
        complete: mission.scenario.covers_area()
            || flying().count() == mission.goals.len().min(vehicles.len()),
        vehicles,
        totals: Totals {
            path_m: rounded(plan.total_path_m() as f32),
            makespan_s: rounded(makespan_s),
        },
        safety: Safety {
            wall_contacts: 0,
            wall_contacts_under_pilot: 0,
            min_clearance_m: min_clearance_m.is_finite().then(|| rounded(min_clearance_m)),
            min_separation_m: None,
            safety_distance_m: rounded(mission.scenario.deconfliction.safety_distance_m),
            violations: 0,
            deadlocks: 0,
        },
        roadmap: mission.roadmap_counts(),
        unserved: Unserved {
            reasons: shortage::shortage_lines(mission, plan),
            ..mission.unserved(plan)
        },
        coverage: None,
    }
}
