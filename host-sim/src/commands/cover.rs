//! `host-sim cover`: plans how a fleet photographs an area, and exports the flights. It simulates
//! none.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;

use crate::coverage::check::{self, CoverageFindings};
use crate::coverage::result::{CoverResult, cover_result};
use crate::coverage::{CoveragePlan, SortieFlight, export, page};
use crate::files::ResultFiles;
use crate::output;
use crate::quote::printable_path;
use crate::report;
use crate::result::{self, CoverageResult, Timing};
use crate::say;
use crate::scenario::coverage::CoverageMethod;
use crate::scenario::{self, DEFAULT_ORIGIN, Scenario};

/// Arguments of `host-sim cover`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scenario, which has an `[area]`
    scenario: PathBuf,
    /// Directory for `result.json`, `timing.json`, `report.html`, `waypoints.csv`, `area.geojson`,
    /// and for each vehicle `vehicle-N.plan` and `vehicle-N.waypoints` (`vehicle-N-sortie-K` if it
    /// takes more than one battery)
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Method of dividing the area, instead of the scenario's: simple-binpat, binpat, powell-binpat
    /// or exact
    #[arg(long, value_name = "METHOD", value_parser = CoverageMethod::named)]
    method: Option<CoverageMethod>,
}

/// Plans the area and writes all files. Exit code 0 if the check finds no fault.
///
/// # Errors
/// The input is bad or there is no plan; the error names the place in the scenario.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let began = Instant::now();
    let scenario = scenario::load(&args.scenario)?;
    scenario.check_supported()?;
    output::print_slow_vehicles(&scenario);
    let files = extra_file_names(&scenario);
    let names: Vec<&str> =
        output::RESULT_FILES.into_iter().chain(files.iter().map(String::as_str)).collect();
    let mut results = ResultFiles::open(&args.out, &names)?;
    let usual = scenario.area.as_ref().map(|area| area.method).unwrap_or_default();
    let planned = CoveragePlan::new(&scenario, args.method.unwrap_or(usual))?;
    let flights = planned.flights();
    let findings = check::check_flights(&planned, &check::flights_to_check(&planned, &flights));
    let result = cover_result(&planned, &findings);
    let written = add_flight_files(&planned, &flights, &mut results)?;
    results.add(output::RESULT_FILES[0], result::json(&result)?.as_bytes())?;
    let timing = Timing {
        search_s: planned.computing_s[0] + planned.computing_s[1],
        assignment_s: planned.computing_s[2],
        plan_s: planned.computing_s.iter().sum(),
        wall_s: began.elapsed().as_secs_f64(),
        ..Timing::default()
    };
    results.add(output::RESULT_FILES[1], result::json(&timing)?.as_bytes())?;
    let mut page = page::report_data(&planned, &flights, &findings, serde_json::to_value(&result)?);
    page.timing = Some(serde_json::to_value(&timing)?);
    results.add(output::RESULT_FILES[2], report::page(&page)?.as_bytes())?;
    results.commit()?;
    remove_stale_plan_files(&args.out, &written)?;
    print(&result, &findings, &args.out);
    print_origin(&planned);
    print_unchecked_batteries(&planned);
    Ok(if result.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Names of the files that are written in addition to [`output::RESULT_FILES`] if each vehicle
/// flies one sortie.
fn extra_file_names(scenario: &Scenario) -> Vec<String> {
    let own = |id: u8| [format!("vehicle-{id}.plan"), format!("vehicle-{id}.waypoints")];
    let shared = ["waypoints.csv", "area.geojson"].map(str::to_owned);
    scenario.vehicles.iter().flat_map(|vehicle| own(vehicle.id)).chain(shared).collect()
}

/// Adds each flight's plan files (`.plan` and `.waypoints`), `waypoints.csv` and `area.geojson` to
/// the results. Returns the names of the plan files.
fn add_flight_files(
    planned: &CoveragePlan<'_>,
    flights: &[SortieFlight],
    results: &mut ResultFiles,
) -> anyhow::Result<Vec<String>> {
    let mut written = Vec::new();
    for (sortie, points, _) in flights {
        let route = &sortie.route;
        let id = planned.scenario.vehicles[usize::from(route.vehicle_index)].id;
        let name = match sortie.sorties_of_vehicle {
            1 => format!("vehicle-{id}"),
            _ => format!("vehicle-{id}-sortie-{}", sortie.number),
        };
        let items = export::flight_items(planned, sortie, points);
        let plan = result::json(&export::qgc_plan(planned, route, &items))?;
        let waypoints = export::waypoints_file(planned, route, &items);
        for (kind, text) in [("plan", plan), ("waypoints", waypoints)] {
            written.push(format!("{name}.{kind}"));
            results.add(&format!("{name}.{kind}"), text.as_bytes())?;
        }
    }
    results.add("waypoints.csv", export::flights_csv(planned, flights).as_bytes())?;
    results
        .add("area.geojson", result::json(&export::area_geojson(planned, flights))?.as_bytes())?;
    Ok(written)
}

/// Removes the files in the directory that have the name of a plan file and are not among
/// `written`, so that no plan of an earlier run is uploaded together with the new ones.
fn remove_stale_plan_files(dir: &Path, written: &[String]) -> anyhow::Result<()> {
    let number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_plan = |name: &str| {
        let stem = name.strip_suffix(".plan").or_else(|| name.strip_suffix(".waypoints"));
        stem.and_then(|stem| stem.strip_prefix("vehicle-")).is_some_and(|ids| {
            ids.split_once("-sortie-")
                .map_or(number(ids), |(id, sortie)| number(id) && number(sortie))
        })
    };
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        let name = entry.file_name();
        let stale = |name: &str| is_plan(name) && !written.iter().any(|own| own == name);
        if entry.file_type()?.is_file() && name.to_str().is_some_and(stale) {
            let path = entry.path();
            fs::remove_file(&path)
                .with_context(|| format!("cannot remove: {}", printable_path(&path)))?;
            say!("removed    {}: of another plan", printable_path(&path));
        }
    }
    Ok(())
}

/// The line about the area: what is photographed of it, and how.
fn area_line(coverage: &CoverageResult, findings: &CoverageFindings) -> String {
    format!(
        "area       {:.2} % {} ({} of {:.2} m), {} on {} at {:.1}°",
        100.0 * (coverage.covered_share * 1e4).floor() / 1e4,
        if coverage.trigger == "none" { "flown over" } else { "photographed" },
        count_with_noun(findings.cells_to_cover as usize, "cell"),
        findings.cell_m,
        count_with_noun(coverage.waypoint_count as usize, "waypoint"),
        count_with_noun(coverage.lane_count, "lane"),
        ((10.0 * coverage.lane_angle_deg).round() / 10.0).rem_euclid(180.0) + 0.0
    )
}

/// A number with its noun, in the plural unless it is 1.
fn count_with_noun(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Prints the plan: vehicles, area, faults found.
fn print(result: &CoverResult, findings: &CoverageFindings, dir: &std::path::Path) {
    let coverage = &result.coverage;
    say!("vehicle  waypoints         layer m  leaves s   cost s   cost m");
    for route in &coverage.routes {
        let (first, last) = if route.backward {
            (route.highest_waypoint, route.lowest_waypoint)
        } else {
            (route.lowest_waypoint, route.highest_waypoint)
        };
        say!(
            "{:>7}  {:<16}  {:>7.1}  {:>8.1}  {:>7.1}  {:>7.1}",
            route.vehicle,
            format!("{first} to {last}"),
            route.layer_height_m,
            route.depart_s,
            route.cost_s,
            route.cost_m
        );
        for (number, sortie) in (1..).zip(&route.sorties).filter(|_| route.sorties.len() > 1) {
            let (first, last) = if route.backward {
                (sortie.highest_waypoint, sortie.lowest_waypoint)
            } else {
                (sortie.lowest_waypoint, sortie.highest_waypoint)
            };
            say!(
                "  sortie {number:<4}  {:<10}  {:>7}  {:>8.1}  {:>7.1}  {:>7.1}",
                format!("{first} to {last}"),
                "",
                sortie.round_begin_s + sortie.departure_delay_s,
                sortie.cost_s,
                sortie.cost_m
            );
        }
    }
    for vehicle in result.vehicles.iter().filter(|v| v.flight_time_s == 0.0) {
        say!("{:>7}  {}", vehicle.id, vehicle.end);
    }
    say!();
    say!("{}", if result.complete { "complete" } else { "NOT COMPLETE" });
    say!("{}", area_line(coverage, findings));
    if let Some([x, y]) = findings.first_missing_cell_centre {
        say!("left out   the first cell is at [{x:.1}, {y:.1}]");
    }
    print_terrain(coverage);
    if findings.legs_in_no_fly_zones > 0 {
        say!("no-fly     {} legs enter a no-fly zone", findings.legs_in_no_fly_zones);
    }
    say!(
        "cost       {:.1} s, {:.1} % above the bound of {:.1} s ({})",
        coverage.max_cost_s,
        100.0 * coverage.gap_to_lower_bound,
        coverage.lower_bound_s,
        result.method
    );
    say!("report     {}", dir.join("report.html").display());
}

/// Prints the origin for which plan files were written: without `area.origin`, a polygon in metres
/// has no known place on earth.
fn print_origin(planned: &CoveragePlan<'_>) {
    let origin = &planned.area_settings.origin;
    let note = match *origin == DEFAULT_ORIGIN {
        true => ": area.origin is not given, so plans are for this place",
        false => "",
    };
    say!("origin     {:.6}, {:.6}, {:.1} m{note}", origin.lat_deg, origin.lon_deg, origin.alt_m);
}

/// Prints the longest flight of the vehicles without `endurance_s`, for which nothing can check
/// whether a battery lasts; prints nothing if batteries may be swapped.
fn print_unchecked_batteries(planned: &CoveragePlan<'_>) {
    let unknown = planned.sorties.iter().filter(|sortie| {
        planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)]
            .hover_endurance_s
            .is_none()
    });
    let longest_s = unknown.map(|sortie| sortie.flight_duration_s).fold(0.0, f32::max);
    if longest_s > 0.0 && !planned.area_settings.allows_battery_swaps {
        say!("batteries  not checked: vehicles without endurance_s fly up to {longest_s:.0} s");
    }
}

/// Prints how lanes lie above uneven ground.
fn print_terrain(coverage: &CoverageResult) {
    if let Some(terrain) = &coverage.terrain {
        say!(
            "terrain    lanes {:.1} to {:.1} m above the ground, at most {:.0} % steep",
            terrain.min_above_ground_m,
            terrain.max_above_ground_m,
            100.0 * terrain.steepest_slope
        );
        if terrain.legs_too_low + terrain.legs_too_steep > 0 {
            say!(
                "terrain    {} legs too low, {} too steep",
                terrain.legs_too_low,
                terrain.legs_too_steep
            );
        }
    }
}

#[cfg(test)]
mod tests;
