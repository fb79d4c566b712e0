//! The bound on the work of every public call of planner-core and companion, beside the
//! instructions that an emulated board counted.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use board_bench::calls::{Meter, coverage, coverage_missions};
use host_sim::map::{UnknownSpace, building};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;

use crate::{board, workspace};

/// Path of the page with the table of worst cases, relative to the checkout.
pub const PAGE: &str = "docs/worst-case.md";

/// Each call by its name in the board's program `calls`, and the bound on its work: n nodes, h
/// half-edges, w = 64 waypoints, g = 128 gates, v = 32 vehicles, p = 2048 timed segments of
/// flights, d metres of segment, c cells of a map.
pub const BOUNDS: &[(&str, &str)] = &[
    ("frames::enu_to_geodetic", "constant: 5 rounds"),
    ("frames::geodetic_to_enu", "constant"),
    ("frames::haversine_m", "constant"),
    ("frames::geodetic_to_ned", "constant"),
    ("frames::ned_to_geodetic", "constant"),
    ("voxel::VoxelGrid::new", "words of the map"),
    ("voxel::VoxelGrid::is_blocked_at", "constant"),
    ("segment::segment_is_clear, 0 m", "cells along d"),
    ("segment::segment_is_clear, 0.8 m", "cells within the clearance of d"),
    ("segment::snapped_segment_touches", "cells along d"),
    ("segment::segment_clearance, to 2 m", "cells within what is returned of d, twice"),
    ("segment::point_clearance, to 2 m", "the same, d = 0"),
    ("prm::edge_clearance, to 2 m", "one `segment_clearance`"),
    ("prm::sample_nodes, 2300", "10 000 draws a node"),
    ("prm::sample_nodes, 2300, 0.8 m", "10 000 draws a node"),
    ("prm::NodeGrid::sort_nodes, 2300", "n + cubes"),
    ("prm::connect_range, 2300", "pairs within Dmax × one segment check"),
    ("prm::connect_range, 2300, 0.8 m", "the same"),
    ("prm::connect, 300", "`index` and `connect_range`"),
    ("prm::connect_all_pairs, 300", "n² / 2 × one segment check"),
    ("roadmap::RoadmapView::parse", "n + h, and the CRC of the file"),
    ("roadmap::RoadmapView::edge_between", "log of a node's degree"),
    ("roadmap::write, 300", "n + h · log of the degree"),
    ("roadmap::write_with_landmarks, 300", "the same and two searches"),
    ("search::astar", "n · log n + h: each node settled once"),
    ("search::dijkstra_all", "n · log n + h"),
    ("search::path_lengths_to, 32 targets", "n · log n + h, and n a target"),
    ("search::cost_matrix, 32 × 32", "v rows"),
    ("search::SearchWorkspace::path_to", "w"),
    ("search::RoadmapWithLengths::new, 300", "h"),
    ("assignment::assign, 32 × 32", "v³"),
    ("assignment::assign_bottleneck, 32 × 32", "v³"),
    ("plan::compute_costs, 10 × 10", "one cost matrix, or v rows"),
    ("plan::assign_goals, 10 × 10", "one assignment"),
    (
        "plan::schedule_flights, 10",
        "155 rounds, twice for more than 12 vehicles of v vehicles, each 3 A* and `sipp::find_route` a few times; 150 000 comparisons; v `gates`",
    ),
    ("plan::plan_swarm, 10", "the three above"),
    ("plan::vehicle_plan, past 31", "one `gates`"),
    ("schedule::sipp::find_route, past 9", "n states, each with its half-edges × the pieces near"),
    ("schedule::earliest_departure, past 31", "the pieces of a flight × p"),
    ("schedule::gates, past 31", "the pieces of a flight × p"),
    ("detour::plan_detour, 128 things", "two A*, each half-edge × things; things × n"),
    ("detour::plan_detour_for_vehicle, 128 things", "the same"),
    ("detour::is_path_blocked", "w"),
    ("detour::KeepOutZone::contains", "constant"),
    ("deconflict::advise, priority", "g, v a gate in reach, 16 places a neighbour without plan"),
    ("deconflict::advise, algorithm2", "v"),
    ("deconflict::has_late_neighbour", "g times log v and log w"),
    ("flight::Path::push", "constant"),
    ("flight::Path::set_times_at_speed", "w"),
    ("flight::Path::point_at", "log w"),
    ("flight::Path::points_from, 16", "w and the points"),
    ("flight::Path::project", "w"),
    ("track::advance", "w"),
    ("track::braking_distance_m", "log w"),
    ("footprint::Camera::footprint", "constant"),
    ("footprint::Camera::height_for_gsd", "constant"),
    ("area::Area::new, 256", "edges²"),
    ("area::Area::is_in_no_fly_zone", "edges"),
    ("sweep::direction_of_least_width, 256", "n · log n of n vertices"),
    ("transit::TransitGraph::set_area, 32 corners", "corners² · edges, and corners³"),
    ("transit::TransitGraph::is_line_clear", "edges of no-fly zones"),
    ("transit::TransitGraph::distance_m", "corners² · edges"),
    ("transit::TransitGraph::shortest_path", "the same"),
    ("transit::TransitGraph::corners", "constant"),
    ("transit::TransitGraph::is_in_no_fly_zone", "edges of no-fly zones"),
    (
        "around::plan_detour, 128 things",
        "320² looks at most, each at edges of zones, all things, half nodes of a field",
    ),
    ("around::plan_detour_for_vehicle, 128 things", "the same"),
    (
        "tracks::build_lanes, 256 vertices",
        "lanes · vertices, and 2000 changes of the lanes' order tried, few of which take a way",
    ),
    ("tracks::build_lanes, 512 lanes", "the same"),
    ("lanes::Tracks::waypoint", "log of the lanes"),
    ("lanes::Tracks::distance_to_waypoint_m", "log of the lanes"),
    ("pack::binpat, 3", "v · log of the lanes, v² ways, one assignment"),
    ("pack::binpat, 3 around zones", "the same"),
    ("pack::binpat, 32", "the same"),
    ("powell::powell, 3", "4000 `binpat`"),
    ("bound::lower_bound_s, 3", "waypoints · v"),
    ("divide::number_on_whole_path, 32", "v"),
    ("a coverage plan, 3", "`build` and `powell`"),
    ("left and binpat, 3", "`divide::remaining_lanes`, lanes · v, and one `binpat`"),
    ("left and binpat, 32", "the same"),
    (
        "planner::coverage::plan_flights, 3",
        "`set_area`, `build`, one `binpat`, `flights::plan_flights`, one `gates`",
    ),
    ("planner::coverage::plan_flights, 3, zones", "the same"),
    ("planner::coverage::plan_flights, 32", "the same"),
    ("a division, 3", "`set_area`, `losses::redivide_work` for the further loss, one `gates`"),
    ("a division, 3, zones", "the same"),
    (
        "a division, 3, nothing known",
        "the plan, `losses::redivide_work` for each of two losses, one `gates`",
    ),
    ("a division, 3, zones, nothing known", "the same"),
    ("a division, 32", "as for 3"),
    ("a division, 32, nothing known", "as for 3"),
    (
        "flights::plan_flights, 3",
        "at most v times v² / 2 pairs of flights, each w parts × 40 blocks of 8 timed segments; where gates are many 5 times v² pairs",
    ),
    ("flights::plan_flights, 32", "the same"),
    (
        "losses::redivide_work, 3",
        "`divide::remaining_lanes`, lanes · v, one `binpat`, `flights::plan_flights`",
    ),
    ("losses::redivide_work, 32", "the same"),
    ("frame::Framer::next, 256 hostile bytes", "the bytes × a frame's length"),
    ("frame::encode_raw, 255 bytes", "the bytes"),
    ("intent::Intent::encode", "constant"),
    ("intent::Intent::decode", "constant"),
    ("roster::RosterReport::encode", "22 entries"),
    ("roster::RosterReport::decode", "22 entries"),
    ("fleet::Fleet::step, 32", "v, and a CRC of divisions · v"),
    ("fleet::Fleet::is_division_to_be_computed", "v"),
    ("fleet::Fleet::set_hash_from_plan", "a CRC of divisions · v"),
    ("fleet::Fleet::division_inputs_hash", "a CRC of divisions · v"),
    ("fleet::Fleet::handle_roster_report, 32", "22 entries, and v"),
    ("fleet::Fleet::roster_report", "22 entries"),
    ("mission_file::write_mission, 32", "v, and the CRC of the file"),
    ("mission_file::MissionView::parse, 32", "v, and the CRC of the file"),
    ("mission_file::MissionView::companion_config, 32", "v²"),
    ("mission_file::MissionView::plan_request, 32", "v"),
    ("mission_file::MissionView::can_be_planned_with", "constant"),
    ("config::Config::check, 32", "v"),
    ("parameters::Parameters::index_of", "parameters"),
    ("parameters::Parameters::set", "constant"),
    ("parameters::Parameters::apply", "constant"),
    ("parameters::Parameters::to_bytes", "parameters"),
    ("parameters::Parameters::restore", "parameters"),
    ("store::Store::mount", "the bank read once: CRC of the roadmap, heads of the journal"),
    ("Companion::new", "v"),
    ("Companion::attach_store", "constant: the store is moved in"),
    ("Companion::handle_bytes, a frame", "its length, one row of the table · 4, 8 parameters"),
    ("Companion::handle_bytes, 256 hostile bytes", "the bytes × a frame's length"),
    ("Companion::handle_timeout, 32 speak", "advice, w, v, 4 rows of the table"),
    (
        "Companion::handle_timeout, most gone",
        "the same; 160 legs against what is out, 96 columns of what comes down",
    ),
    ("Companion::handle_timeout, else", "the same"),
    ("a control step, 32 near", "the same as `Companion::handle_timeout`"),
    ("a control step, coverage, 32 near", "the same, and v entries of the fleet"),
    ("Companion::query_filter_blocker, 32 near", "v, and 4 neighbours × 9 × 9 legs"),
    ("Companion::handle_plan", "w and g copied"),
    ("Companion::detour_request", "v × 16 places"),
    ("Companion::poll_transmit", "one frame"),
    ("Companion::poll_event", "constant"),
    ("Companion::poll_flash", "1 kB"),
    ("Companion::handle_flash", "1 kB"),
];

/// What one call took at most.
#[derive(Clone, Copy, Debug)]
pub struct CallCost {
    /// Greatest number of instructions counted.
    pub instructions: u64,
    /// Bytes of state or workspace that the call was lent.
    pub lent_bytes: u64,
}

/// Makes the calls on the host without counting their instructions.
struct UncountedCalls;

impl Meter for UncountedCalls {
    fn call<T>(&mut self, _: &'static str, _: usize, work: impl FnOnce() -> T) -> T {
        work()
    }
}

/// Runs the board's program `calls` on the demo's roadmap and a map of the building; returns what
/// it counted, by the calls' names.
///
/// # Errors
/// The demo cannot be prepared, the program prints something else, or its coverage plans differ in
/// any bit from those computed on the host.
pub fn count_calls(program: &Path) -> Result<HashMap<String, CallCost>> {
    let scenario = scenario::load(&workspace().join("host-sim/scenarios/demo.toml"))?;
    let mission = PreparedMission::prepare(scenario, &Progress::on_terminal())?;
    let map =
        building::building_map(building::DEFAULT_SEED, 0.5)?.to_voxel_map(UnknownSpace::Blocked);
    let lines = board::run_measuring_program(
        program,
        &mission.roadmap_or_field_file,
        &board::map_image(&map.grid()),
    );
    let calls = coverage::measure_coverage_calls(&mut UncountedCalls, &mut Box::default());
    let flights = coverage_missions::measure_coverage_flights(
        &mut UncountedCalls,
        &mut Box::default(),
        &mut Box::default(),
        &mut Box::default(),
    );
    let host = format!("coverage {calls:08x} {flights:08x}");
    ensure!(
        lines.contains(&host),
        "the host's coverage plans have {host:?}, the board's\n{}",
        lines.join("\n")
    );
    lines.iter().filter_map(|line| line.strip_prefix("call ")).map(parse_call_line).collect()
}

fn parse_call_line(line: &str) -> Result<(String, CallCost)> {
    let mut words = line.splitn(3, ' ');
    let mut word = || words.next().context("a line of `calls` is cut");
    let (instructions, bytes) = (word()?.parse()?, word()?.parse()?);
    Ok((word()?.to_owned(), CallCost { instructions, lent_bytes: bytes }))
}

/// The text of the page before its table, the table, and the text behind it.
///
/// # Errors
/// A marker line around the table is missing from the page.
pub fn split_page(page: &str) -> Result<[&str; 3]> {
    const BEFORE: &str = "<!-- written by `cargo xtask bench --only worst-case` -->\n";
    const BEHIND: &str = "<!-- end -->";
    let from = page.find(BEFORE).context("no line where the table begins")? + BEFORE.len();
    let len = page[from..].find(BEHIND).context("no line where the table ends")?;
    Ok([&page[..from], &page[from..from + len], &page[from + len..]])
}

/// The table of all calls: bound, instructions counted and bytes lent, as Markdown.
///
/// # Errors
/// A call of [`BOUNDS`] was not counted.
pub fn table_text(calls: &HashMap<String, CallCost>) -> Result<String> {
    let mut table =
        "| call | bound | instructions seen | bytes lent |\n|---|---|---:|---:|\n".to_owned();
    for (name, bound) in BOUNDS {
        let call = calls.get(*name).with_context(|| format!("{name} was not counted"))?;
        writeln!(
            table,
            "| `{name}` | {bound} | {} | {} |",
            rounded_text(call.instructions),
            call.lent_bytes
        )?;
    }
    Ok(table)
}

/// A count as the table prints it: two significant digits, rounded up.
pub fn rounded_text(count: u64) -> String {
    let mut unit = 1;
    while count / unit > 99 {
        unit *= 10;
    }
    let count = count.div_ceil(unit) * unit;
    let short = |one: u64, name| {
        format!("{:.*} {name}", usize::from(count < 10 * one), count as f64 / one as f64)
    };
    match count {
        0..1000 => count.to_string(),
        1000..1_000_000 => short(1000, "k"),
        _ => short(1_000_000, "M"),
    }
}

/// The number that [`rounded_text`] printed as `text`; `None` if it did not.
pub fn parse_rounded(text: &str) -> Option<f64> {
    let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
    let unit = match unit {
        "" => 1.0,
        "k" => 1e3,
        "M" => 1e6,
        _ => return None,
    };
    Some(number.parse::<f64>().ok()? * unit)
}
