//! Recomputes Tables 2 to 6 and A1 to A12 of paper CPP (Luna 2022) with our planner, prints them
//! beside the paper's values, and draws the paper's Figs. 8 to 10, 12 and 13 in the report.
//!
//! The paper states neither areas nor places of the vehicles, camera, V_a (climb speed), V_d
//! (descent speed) or Δh (layer spacing). Ours are in `SHORT_TRACK_POLYGON`, `LONG_TRACK_POLYGON`,
//! `TABLE_2_AREA`, `FIG_9_AREAS` and `TABLE_4_AREA`; V_a 3 m/s, V_d 1 m/s, Δh 5 m, waypoints as far
//! apart as lanes. The paper's times in Tables A1 to A12 were flown in Gazebo; ours are the planned
//! costs C_k, without turns. CV is 100 · SD / Av in both, with SD the sample standard deviation.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::cpp_data::{
    FLIGHT_TIMES_TABLES, LONG_TRACK_COLUMNS, MEAN_LARGEST_TIME_S, PAPER_PLANNING_TIMES_S,
    REAL_FLIGHT_TIMES_S, SHORT_TRACK_COLUMNS, TABLE_2_COSTS_M, TABLE_4_COSTS_M,
};
use super::cpp_figures;
use super::cpp_rows::{TableRow, ValueSummary};
use crate::coverage::check::check_plan;
use crate::coverage::result::cover_result;
use crate::coverage::{CoveragePlan, page};
use crate::files::ResultFiles;
use crate::report::Figure;
use crate::result::{self, Timing, rounded};
use crate::say;
use crate::scenario::coverage::CoverageMethod;
use crate::scenario::{self, Scenario};
use crate::{output, report};

/// Polygon of the short track, east and north in metres: lanes of up to 150 m.
const SHORT_TRACK_POLYGON: &str = "[[0, 0], [150, 0], [150, 180], [0, 180]]";
/// Polygon of the long track, east and north in metres: lanes of up to 320 m.
const LONG_TRACK_POLYGON: &str = "[[0, 0], [320, 0], [320, 420], [0, 420]]";
/// Polygon of Table 2, east and north in metres: convex, five vertices.
const TABLE_2_AREA: &str = "[[0, 0], [140, -20], [170, 70], [100, 130], [10, 110]]";
/// Polygons of the two further areas of Fig. 9, east and north in metres: both convex.
const FIG_9_AREAS: [&str; 2] = [
    "[[0, 0], [300, 0], [340, 110], [160, 190], [0, 150]]",
    "[[0, 0], [200, -15], [260, 120], [90, 200]]",
];
/// Polygon of Table 4, east and north in metres: so small that the flight to it matters.
const TABLE_4_AREA: &str = "[[0, 0], [60, 0], [60, 60], [0, 60]]";
/// Starts of the three UAVs of Table 4, east and north in metres: the first is far away.
const TABLE_4_STARTS: [[f64; 2]; 3] = [[-110.0, -60.0], [20.0, -20.0], [40.0, -20.0]];
/// The paper's methods, in the order of its tables.
const METHODS: [CoverageMethod; 3] =
    [CoverageMethod::SimpleBinpat, CoverageMethod::Binpat, CoverageMethod::PowellBinpat];
/// Number of plans timed for each method and fleet size; Table 3 gets the median time.
const TIMED_RUNS: usize = 51;
/// Unit of the rows of Table 3: milliseconds to compute a plan, for 2 to 7 vehicles.
const PLANNING_UNIT: &str = "ms";

/// A coverage scenario: the area, one vehicle (ids from 1) on each of `places` (east and north in
/// metres), lanes and waypoints `lane_m` apart, flown at `height_m`.
fn paper_scenario(
    polygon: &str,
    places: &[[f64; 2]],
    lane_m: f64,
    height_m: f64,
) -> anyhow::Result<Scenario> {
    let mut text = format!(
        "[area]\npolygon = {polygon}\nlane_m = {lane_m:?}\nwaypoint_m = {lane_m:?}\nheight_m = {height_m:?}\n\
         layer_m = 5.0\n[mission]\ncruise_mps = 5.0\n"
    );
    for (i, [x, y]) in places.iter().enumerate() {
        text += &format!(
            "[[vehicles]]\nid = {}\nstart = [{x:?}, {y:?}, 0.0]\nclimb_mps = 3.0\ndescend_mps = 1.0\n",
            i + 1
        );
    }
    Ok(scenario::parse(&text, "paper cpp")?)
}

/// Starts of `count` vehicles 5 m apart in a row 20 m south of the origin, east and north in
/// metres.
fn starts_in_a_row(count: usize) -> Vec<[f64; 2]> {
    (0..count).map(|i| [5.0 * i as f64, -20.0]).collect()
}

/// Rows of all tables, and whether every plan so far passed its check.
struct Tables {
    rows: Vec<TableRow>,
    all_checks_passed: bool,
    /// Cost in seconds and `result.json` of the plan with the greatest cost so far; a plan in which
    /// the check found a fault ranks above all others.
    worst: Option<(f64, serde_json::Value)>,
}

impl Tables {
    /// Plans and checks; returns each vehicle's cost in `unit` (`m`, else seconds): 0 for a vehicle
    /// that stays on the ground.
    fn plan_costs(
        &mut self,
        scenario: &Scenario,
        method: CoverageMethod,
        unit: &str,
    ) -> anyhow::Result<Vec<f64>> {
        let planned = CoveragePlan::new(scenario, method)?;
        let findings = check_plan(&planned);
        let result = cover_result(&planned, &findings);
        self.all_checks_passed &= findings.is_clean();
        let rank =
            f64::from(planned.plan.max_cost_s()) + if findings.is_clean() { 0.0 } else { 1e9 };
        if self.worst.as_ref().is_none_or(|(worst, _)| rank > *worst) {
            self.worst = Some((rank, serde_json::to_value(&result)?));
        }
        let mut costs = vec![0.0; scenario.vehicles.len()];
        for route in &planned.plan.routes {
            let cost = if unit == "m" { route.cost_m } else { route.cost_s };
            costs[usize::from(route.vehicle_index)] = rounded(cost);
        }
        Ok(costs)
    }

    /// Adds a row. `spacing` is lane spacing and height, metres; `both` has our values, then
    /// theirs.
    fn add_row(
        &mut self,
        table: &str,
        method: CoverageMethod,
        spacing: (f64, f64),
        unit: &'static str,
        both: [Vec<f64>; 2],
    ) {
        let [ours, theirs] = both;
        // A row of planning times has one value for each fleet size, not one for each vehicle.
        let of_a_fleet = ours.len() > 1 && unit != PLANNING_UNIT;
        let summary = |values: &[f64]| of_a_fleet.then(|| ValueSummary::of(values));
        self.rows.push(TableRow {
            table: table.to_owned(),
            track: None,
            method: method.name(),
            lane_m: spacing.0,
            height_m: spacing.1,
            unit,
            ours_summary: summary(&ours),
            theirs_summary: summary(&theirs),
            ours,
            theirs,
        });
    }
}

/// Runs `host-sim paper cpp`.
///
/// # Errors
/// Results that cannot be written.
pub fn run(out: &Path) -> anyhow::Result<ExitCode> {
    let began = Instant::now();
    let mut results =
        ResultFiles::open(out, &[&output::RESULT_FILES[..], &["tables.json"]].concat())?;
    let mut tables = Tables { rows: Vec::new(), all_checks_passed: true, worst: None };
    table_2(&mut tables)?;
    let planning = table_3(&mut tables)?;
    table_4(&mut tables)?;
    flight_times_tables(&mut tables)?;
    table_6(&mut tables)?;
    print_costs(&tables);
    print_planning(&planning);
    results.add("tables.json", result::json(&tables.rows)?.as_bytes())?;
    let (_, mut worst) = tables.worst.clone().unwrap_or_default();
    worst["command"] = "paper cpp".into();
    worst["complete"] = tables.all_checks_passed.into();
    results.add(output::RESULT_FILES[0], result::json(&worst)?.as_bytes())?;
    let plan_s = planning.iter().flatten().sum();
    let timing = Timing { plan_s, wall_s: began.elapsed().as_secs_f64(), ..Timing::default() };
    results.add(output::RESULT_FILES[1], result::json(&timing)?.as_bytes())?;
    // The page's 3D scene shows Fig. 8 d: the plan of Table 2 by POWELL-BINPAT.
    let scenario = paper_scenario(TABLE_2_AREA, &starts_in_a_row(3), 10.0, 35.0)?;
    let planned = CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)?;
    let findings = check_plan(&planned);
    let result = serde_json::to_value(cover_result(&planned, &findings))?;
    let mut page = page::report_data(&planned, &planned.flights(), &findings, result);
    page.figures = paper_figures(&tables)?;
    results.add(output::RESULT_FILES[2], report::page(&page)?.as_bytes())?;
    results.commit()?;
    say!();
    say!(
        "{}",
        if tables.all_checks_passed {
            "complete"
        } else {
            "NOT COMPLETE: a plan leaves something out"
        }
    );
    Ok(if tables.all_checks_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The paper's Figs. 8 to 10, 12 and 13, drawn with our plans and costs; Figs. 12 and 13 with the
/// paper's values beside them.
fn paper_figures(tables: &Tables) -> anyhow::Result<Vec<Figure>> {
    let convex = paper_scenario(TABLE_2_AREA, &starts_in_a_row(3), 10.0, 35.0)?;
    let compared = [
        paper_scenario(FIG_9_AREAS[0], &starts_in_a_row(3), 10.0, 35.0)?,
        paper_scenario(FIG_9_AREAS[1], &starts_in_a_row(3), 10.0, 35.0)?,
    ];
    let small = paper_scenario(TABLE_4_AREA, &TABLE_4_STARTS, 10.0, 35.0)?;
    let [fig_8, fig_9, fig_10] = cpp_figures::route_figures(&convex, &compared, &small)?;
    let [fig_12, fig_13] = cpp_figures::spread_figures(&tables.rows);
    Ok(vec![fig_8, fig_9, fig_10, fig_12, fig_13])
}

/// Table 2: distance costs of three vehicles, by method.
fn table_2(tables: &mut Tables) -> anyhow::Result<()> {
    let scenario = paper_scenario(TABLE_2_AREA, &starts_in_a_row(3), 10.0, 35.0)?;
    for (method, theirs) in METHODS.into_iter().zip(TABLE_2_COSTS_M) {
        let ours = tables.plan_costs(&scenario, method, "m")?;
        tables.add_row("2", method, (10.0, 35.0), "m", [ours, theirs.to_vec()]);
    }
    Ok(())
}

/// Our part of Table 3: median seconds to compute a whole plan, one row for each method, one column
/// for each of 2 to 7 vehicles. These times depend on the machine and its load; the values of all
/// other tables do not.
fn table_3(tables: &mut Tables) -> anyhow::Result<[[f64; 6]; 3]> {
    let mut all = [[0.0; 6]; 3];
    for (row, method) in all.iter_mut().zip(METHODS) {
        for (slot, count) in row.iter_mut().zip(2..) {
            let scenario = paper_scenario(TABLE_2_AREA, &starts_in_a_row(count), 10.0, 35.0)?;
            let mut times = Vec::with_capacity(TIMED_RUNS);
            for _ in 0..TIMED_RUNS {
                times.push(CoveragePlan::new(&scenario, method)?.computing_s.iter().sum::<f64>());
            }
            times.sort_by(f64::total_cmp);
            *slot = times[TIMED_RUNS / 2];
        }
    }
    for ((method, ours), theirs) in METHODS.into_iter().zip(all).zip(PAPER_PLANNING_TIMES_S) {
        let ms = |times: [f64; 6]| times.map(|s| rounded((s * 1e3) as f32)).to_vec();
        tables.add_row("3", method, (10.0, 35.0), PLANNING_UNIT, [ms(ours), ms(theirs)]);
    }
    Ok(all)
}

/// Table 4: one vehicle stands so far away that the fleet finishes sooner if it stays on the
/// ground.
fn table_4(tables: &mut Tables) -> anyhow::Result<()> {
    let scenario = paper_scenario(TABLE_4_AREA, &TABLE_4_STARTS, 10.0, 35.0)?;
    for (method, theirs) in METHODS[1..].iter().zip(TABLE_4_COSTS_M) {
        let ours = tables.plan_costs(&scenario, *method, "m")?;
        tables.add_row("4", *method, (10.0, 35.0), "m", [ours, theirs.to_vec()]);
    }
    Ok(())
}

/// Tables A1 to A12; also Table 5, the means of the largest times in them.
fn flight_times_tables(tables: &mut Tables) -> anyhow::Result<()> {
    let mut mean_max = [[0.0; 3]; 2];
    for table in &FLIGHT_TIMES_TABLES {
        let method = CoverageMethod::named(table.method).map_err(anyhow::Error::msg)?;
        let (polygon, columns) = if table.is_long_track {
            (LONG_TRACK_POLYGON, LONG_TRACK_COLUMNS)
        } else {
            (SHORT_TRACK_POLYGON, SHORT_TRACK_COLUMNS)
        };
        for (spacing, theirs) in columns.into_iter().zip(table.times_s) {
            let scenario =
                paper_scenario(polygon, &starts_in_a_row(theirs.len()), spacing.0, spacing.1)?;
            let ours = tables.plan_costs(&scenario, method, "s")?;
            let index = METHODS.iter().position(|m| *m == method).unwrap_or(0);
            mean_max[usize::from(table.is_long_track)][index] +=
                ours.iter().copied().fold(0.0, f64::max) / 12.0;
            tables.add_row(table.name, method, spacing, "s", [ours, theirs.to_vec()]);
            if let Some(row) = tables.rows.last_mut() {
                row.track = Some(if table.is_long_track { "long" } else { "short" });
            }
        }
    }
    for ((track, ours), theirs) in
        ["5, short", "5, long"].into_iter().zip(mean_max).zip(MEAN_LARGEST_TIME_S)
    {
        for (i, method) in METHODS.into_iter().enumerate() {
            let both = [vec![rounded(ours[i] as f32)], vec![theirs[i]]];
            tables.add_row(track, method, (0.0, 0.0), "s", both);
        }
    }
    Ok(())
}

/// Table 6: times of three vehicles, by method; the paper's were flown by real vehicles.
fn table_6(tables: &mut Tables) -> anyhow::Result<()> {
    let scenario = paper_scenario(SHORT_TRACK_POLYGON, &starts_in_a_row(3), 10.0, 20.0)?;
    for (method, theirs) in METHODS.into_iter().zip(REAL_FLIGHT_TIMES_S) {
        let ours = tables.plan_costs(&scenario, method, "s")?;
        tables.add_row("6", method, (10.0, 20.0), "s", [ours, theirs.to_vec()]);
    }
    Ok(())
}

/// Prints the costs of all tables.
fn print_costs(tables: &Tables) {
    say!(
        "Costs; areas and places are ours. Theirs in A1 to A12 were flown in Gazebo, in 6 in the field; ours are planned."
    );
    say!("table     method         lanes  height  ours: max    CV %  theirs: max    CV %");
    for row in tables.rows.iter().filter(|row| row.unit != PLANNING_UNIT) {
        let max = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let cv = |summary: &Option<ValueSummary>| {
            summary.map_or("-".to_owned(), |s| format!("{:.2}", s.cv_percent))
        };
        say!(
            "{:<8}  {:<13}  {:>5}  {:>6}  {:>7.1} {}  {:>6}  {:>10.1} {}  {:>6}",
            row.table,
            row.method,
            row.lane_m,
            row.height_m,
            max(&row.ours),
            row.unit,
            cv(&row.ours_summary),
            max(&row.theirs),
            row.unit,
            cv(&row.theirs_summary)
        );
    }
}

/// Prints planning times: ours by method and number of vehicles, beside Table 3.
fn print_planning(ours: &[[f64; 6]; 3]) {
    say!();
    say!(
        "Table 3, planning time in ms for 2 to 7 UAVs: ours (this machine), theirs (Ryzen 7 3750H, Python)"
    );
    let line = |times: &[f64; 6]| times.map(|s| format!("{:>9.3}", s * 1e3)).join(" ");
    for ((method, ours), theirs) in METHODS.into_iter().zip(ours).zip(PAPER_PLANNING_TIMES_S) {
        say!("{:<13}  ours   {}", method.name(), line(ours));
        say!("{:<13}  theirs {}", "", line(&theirs));
    }
}

#[cfg(test)]
mod tests;
