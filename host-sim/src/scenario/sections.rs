//! The tables of a scenario, one function each, and what must hold between them.

use std::path::Path;

use companion::config::{GROUND_STATIONS, USUAL_GROUND_STATIONS};
use planner_core::Point;
use planner_core::frames::{Geodetic, geodetic_to_enu};
use planner_core::roadmap::{MAX_COORDINATE_M, MAX_EDGE_M};
use toml::de::DeTable;

use super::error::ScenarioError;
use super::reader::{Result, Span, Table, Text, Value};
use super::{
    Companion, Deconfliction, Estimator, FAULT_KINDS, FAULT_OBSTACLE, Fault, Geofence, Map, Method, Mission,
    Mode, Objective, Personality, Roadmap, Sampling, Scenario, Simulation, Terminals, Unbuilt, Vehicle,
};
use crate::capacity::VEHICLES;
use crate::files;
use crate::link::LinkUrl;
use crate::map::{RESOLUTIONS_M, Source, Unknown};
use crate::margins;
use crate::quote::{quoted, quoted_path};

/// Most vehicles of a swarm: the system ids there are.
const MAX_ID: u64 = 250;
/// Most faults of a scenario.
const MAX_FAULTS: usize = 1000;
/// Mission origin where none is given: a test field.
const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };

pub(super) fn parse(text: &str, file: &str, folder: &Path) -> Result<Scenario> {
    let text = Text { file, text };
    let root = DeTable::parse(text.text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        let what = quoted(error.message().lines().next().unwrap_or_default());
        let hint = syntax_hint(&text.text[span.start.min(text.text.len())..], &what);
        let error = text.error(&span, format!("not TOML: {what}"));
        ScenarioError { hint: hint.map(str::to_owned), ..error }
    })?;
    let root = Table::new(text, "", 0..0, root.get_ref());
    root.expect(&[
        "seed",
        "map",
        "roadmap",
        "mission",
        "vehicles",
        "deconfliction",
        "simulation",
        "faults",
        "area",
        "formation",
    ]);
    root.finish()?;
    let mut unsupported = Vec::new();
    let seed = root.whole("seed", 1, 0..=i64::MAX as u64)?;
    let map_table = root.need("map", "add `[map]` with `file = \"builtin:building\"`")?.table()?;
    let (map, has_origin) = map(&map_table, folder)?;
    let roadmap = root.get("roadmap").map(|v| v.table()).transpose()?;
    let roadmap = self::roadmap(&roadmap.unwrap_or_else(|| empty(text, "roadmap")))?;
    let origin = has_origin.then_some(map.origin);
    let mission_value = root.get("mission");
    let vehicles = vehicles(
        &root.need("vehicles", "add a `[[vehicles]]` with `id` and `start` for each")?,
        origin.as_ref(),
        &mut unsupported,
    )?;
    let mission_table = mission_value.as_ref().map(Value::table).transpose()?;
    let mission_table = mission_table.unwrap_or_else(|| empty(text, "mission"));
    let (mission, mode_span) = mission(&mission_table, folder, origin.as_ref(), &vehicles)?;
    let deconfliction = root.get("deconfliction").map(|v| v.table()).transpose()?;
    let deconfliction = self::deconfliction(&deconfliction.unwrap_or_else(|| empty(text, "deconfliction")))?;
    let simulation = root.get("simulation").map(|v| v.table()).transpose()?;
    let estimator_span = simulation.as_ref().and_then(|t| t.get("estimator")).map(|v| v.span);
    let simulation = self::simulation(&simulation.unwrap_or_else(|| empty(text, "simulation")))?;
    let ids: Vec<u8> = vehicles.iter().map(|(v, _)| v.id).collect();
    let faults_value = root.get("faults");
    let faults = match &faults_value {
        Some(value) => {
            let items = value.items()?;
            at_most(value, items.len(), MAX_FAULTS, "faults")?;
            items.iter().map(|v| fault(&v.table()?, &ids)).collect::<Result<Vec<_>>>()?
        }
        None => Vec::new(),
    };
    let area = unbuilt(&root, "area", &mut unsupported)?;
    let formation = unbuilt(&root, "formation", &mut unsupported)?;
    if let (Mode::Coverage | Mode::Formation, Some(span)) = (mission.mode, &mode_span) {
        unsupported.push(not_yet(text, span, "this mission.mode"));
    }
    check_apart(text, &vehicles, deconfliction.safety_distance_m)?;
    check_goals(text, &vehicles, &mission)?;
    check_inside(&mission_table, &vehicles, &mission)?;
    let vehicle_places = vehicles.iter().map(|(_, spans)| text.line(&spans.start)).collect();
    let vehicles: Vec<Vehicle> = vehicles.into_iter().map(|(vehicle, _)| vehicle).collect();
    check_goals_apart(&mission_table, &mission, deconfliction.safety_distance_m, &simulation, &vehicles)?;
    if let Some(span) = &estimator_span {
        check_margins(text, span, &roadmap, &deconfliction, &simulation, &vehicles)?;
    }
    let path = file.to_owned();
    Ok(Scenario {
        path,
        text: text.text.to_owned(),
        seed,
        map,
        roadmap,
        mission,
        vehicles,
        vehicle_places,
        deconfliction,
        simulation,
        faults,
        area,
        formation,
        unsupported,
    })
}

/// What usually is behind text that is no TOML.
fn syntax_hint(rest: &str, what: &str) -> Option<&'static str> {
    match rest.chars().next() {
        Some('“' | '”' | '„' | '‘' | '’' | '«') => Some("quotes of TOML are straight: \""),
        _ if what.contains("escape") => Some("a path is written with /, or between single quotes"),
        Some('[') if what.contains("duplicate") => {
            Some("each vehicle is a `[[vehicles]]`, each fault a `[[faults]]`")
        }
        _ => None,
    }
}

/// A table that the file leaves out: all defaults.
fn empty<'a>(text: Text<'a>, name: &str) -> Table<'a> {
    static EMPTY: std::sync::LazyLock<DeTable<'static>> = std::sync::LazyLock::new(DeTable::new);
    Table::new(text, name, 0..0, &EMPTY)
}

fn not_yet(text: Text<'_>, span: &Span, what: &str) -> ScenarioError {
    text.error(span, format!("not available yet: {what}"))
}

fn unbuilt(
    root: &Table<'_>,
    key: &'static str,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<Option<Unbuilt>> {
    let Some(value) = root.get(key) else { return Ok(None) };
    value.table()?;
    unsupported.push(not_yet(root.text, &value.span, &format!("[{key}]")));
    let whole: toml::Table = toml::from_str(root.text.text)
        .map_err(|error| root.text.error(&value.span, format!("not TOML: {}", error.message())))?;
    let table = whole.get(key).and_then(toml::Value::as_table).cloned().unwrap_or_default();
    Ok(Some(Unbuilt { table }))
}

fn point(value: &Value<'_>) -> Result<Point> {
    value.triple().map(|[x, y, z]| Point::new(x as f32, y as f32, z as f32))
}

fn geodetic(value: &Value<'_>) -> Result<Geodetic> {
    let table = value.table()?;
    let hint = "a position is { lat_deg = …, lon_deg = …, alt_m = … }";
    let lat_deg = table.need("lat_deg", hint)?.f64(&(-90.0..=90.0))?;
    let lon_deg = table.need("lon_deg", hint)?.f64(&(-180.0..=180.0))?;
    let alt_m = table.need("alt_m", hint)?.f64(&(-1000.0..=20_000.0))?;
    table.finish()?;
    Ok(Geodetic { lat_deg, lon_deg, alt_m })
}

/// The map, and whether its origin was given.
fn map(table: &Table<'_>, folder: &Path) -> Result<(Map, bool)> {
    let file_value = table.need("file", "a path to an OctoMap `.bt` file, or \"builtin:building\"")?;
    let name = file_value.str()?;
    if let Err(error) = Source::parse(name) {
        return Err(file_value.error(&format!("is not a map that can be read: {error}")));
    }
    let file =
        if name.starts_with("builtin:") { name.to_owned() } else { folder.join(name).display().to_string() };
    let origin = table.get("origin").map(|v| geodetic(&v)).transpose()?;
    let map = Map {
        file,
        resolution_m: table.f32("resolution_m", 0.25, RESOLUTIONS_M)?,
        unknown: table.word(
            "unknown",
            Unknown::Blocked,
            &[("blocked", Unknown::Blocked), ("free", Unknown::Free)],
        )?,
        origin: origin.unwrap_or(ORIGIN),
    };
    table.finish()?;
    Ok((map, origin.is_some()))
}

fn roadmap(table: &Table<'_>) -> Result<Roadmap> {
    let edge_max = table.get("edge_max_m");
    let shares = [("edge_min_share", "edge_min_m"), ("edge_max_share", "edge_max_m")];
    for (share, metres) in shares {
        if let (Some(value), true) = (table.get(share), table.get(metres).is_some()) {
            return Err(value.error(&format!("cannot stand beside roadmap.{metres}: give one of them")));
        }
    }
    let roadmap = Roadmap {
        nodes: table.whole("nodes", 2300, 0..=1_000_000)? as u32,
        edge_min_m: table.f32("edge_min_m", 0.5, 0.0..=MAX_EDGE_M.into())?,
        edge_max_m: table.f32("edge_max_m", 8.0, 0.001..=MAX_EDGE_M.into())?,
        edge_min_share: table.optional_f32("edge_min_share", 0.0..=1.0)?,
        edge_max_share: table.optional_f32("edge_max_share", 0.0001..=1.0)?,
        terminals: table.word(
            "terminals",
            Terminals::Joined,
            &[("joined", Terminals::Joined), ("apart", Terminals::Apart)],
        )?,
        safety_margin_m: table.f32("safety_margin_m", 0.5, 0.0..=100.0)?,
        sampling: table.word(
            "sampling",
            Sampling::Uniform,
            &[("uniform", Sampling::Uniform), ("halton", Sampling::Halton)],
        )?,
    };
    table.finish()?;
    let in_metres = roadmap.edge_min_share.is_none() && roadmap.edge_max_share.is_none();
    if in_metres && roadmap.edge_min_m >= roadmap.edge_max_m {
        let (min, max) = (roadmap.edge_min_m, roadmap.edge_max_m);
        let span = edge_max.map_or(table.span.clone(), |v| v.span);
        let why = format!("roadmap.edge_max_m ({max} m) must be above roadmap.edge_min_m ({min} m)");
        return Err(table.text.error(&span, why));
    }
    Ok(roadmap)
}

/// The mission, and where its mode stands.
fn mission(
    table: &Table<'_>,
    folder: &Path,
    origin: Option<&Geodetic>,
    vehicles: &[(Vehicle, VehicleSpans)],
) -> Result<(Mission, Option<Span>)> {
    let mode_span = table.get("mode").map(|v| v.span);
    let mode = table.word(
        "mode",
        Mode::Unlabelled,
        &[
            ("unlabelled", Mode::Unlabelled),
            ("labelled", Mode::Labelled),
            ("single-goal", Mode::SingleGoal),
            ("coverage", Mode::Coverage),
            ("formation", Mode::Formation),
            ("unlabeled", Mode::Unlabelled),
            ("labeled", Mode::Labelled),
        ],
    )?;
    let objective = table.word(
        "objective",
        Objective::Total,
        &[("total", Objective::Total), ("makespan", Objective::Makespan)],
    )?;
    let cruise_mps = table.f32("cruise_mps", 2.0, 0.01..=100.0)?;
    let (given, file) = (table.get("goals"), table.get("goals_file"));
    let goals = match (&given, &file) {
        (Some(_), Some(file)) => {
            return Err(file.error("cannot stand beside mission.goals: give one of them"));
        }
        (Some(list), None) => {
            let goals = list.items()?;
            at_most(list, goals.len(), VEHICLES, "goals")?;
            goals.iter().map(|v| Ok((place(v, origin)?, table.text.line(&v.span)))).collect::<Result<_>>()?
        }
        (None, Some(file)) => goals_file(file, folder)?,
        (None, None) => Vec::new(),
    };
    let (goals, goal_places): (Vec<Point>, Vec<String>) = goals.into_iter().unzip();
    let takes_goals = !matches!(mode, Mode::Coverage | Mode::Formation);
    if takes_goals && goals.is_empty() {
        let span = given.or(file).map_or(table.span.clone(), |v| v.span);
        let hint = "add `goals = [[east, north, up], …]` in metres, or `goals_file = \"FILE\"`, to [mission]";
        return Err(table.text.with_hint(&span, "mission.goals is missing or empty", hint));
    }
    if mode == Mode::SingleGoal && goals.len() != 1 {
        let span = given.or(file).map_or(table.span.clone(), |v| v.span);
        let why = format!("mission.mode \"single-goal\" takes one goal, not {}", goals.len());
        return Err(table.text.error(&span, why));
    }
    let geofence = table.get("geofence").map(|v| geofence(&v)).transpose()?;
    let ground_stations = table.get("ground_stations").map(|v| ground_stations(&v, vehicles)).transpose()?;
    let ground_stations = ground_stations.unwrap_or(USUAL_GROUND_STATIONS);
    table.finish()?;
    let mission = Mission { mode, objective, cruise_mps, goals, goal_places, geofence, ground_stations };
    Ok((mission, mode_span))
}

/// Refuses a list that is longer than any mission's.
fn at_most(value: &Value<'_>, count: usize, most: usize, what: &str) -> Result<()> {
    if count > most {
        return Err(value.error(&format!("holds more than {most} {what}")));
    }
    Ok(())
}

/// System ids whose commands count.
fn ground_stations(value: &Value<'_>, vehicles: &[(Vehicle, VehicleSpans)]) -> Result<[u8; GROUND_STATIONS]> {
    let given = value.items()?;
    if !(1..=GROUND_STATIONS).contains(&given.len()) {
        return Err(value.error(&format!("takes 1 to {GROUND_STATIONS} MAVLink system ids")));
    }
    let mut ids = [0; GROUND_STATIONS];
    for (id, given) in ids.iter_mut().zip(given) {
        *id = given.whole(1..=255)? as u8;
        if vehicles.iter().any(|(vehicle, _)| vehicle.id == *id) {
            return Err(given.error("is a vehicle's id: a ground station has one of its own"));
        }
    }
    Ok(ids)
}

/// A point of the mission frame, in metres or by latitude and longitude about the origin that was given.
fn place(value: &Value<'_>, origin: Option<&Geodetic>) -> Result<Point> {
    if !value.is_table() {
        return point(value);
    }
    let position = geodetic(value)?;
    let Some(origin) = origin else {
        let hint = "add `origin = { lat_deg = …, lon_deg = …, alt_m = … }` to [map], or give metres";
        let why = format!("{} is given by latitude and longitude, but map.origin is missing", value.name);
        return Err(value.text.with_hint(&value.span, why, hint));
    };
    Ok(geodetic_to_enu(origin, &position))
}

/// One `x y z` a line; empty lines and those that begin with `#` are passed over.
fn goals_file(value: &Value<'_>, folder: &Path) -> Result<Vec<(Point, String)>> {
    let path = folder.join(value.str()?);
    let text = files::read_text(&path)
        .map_err(|error| value.error(&format!("cannot be read: {}: {error}", quoted_path(&path))))?;
    let mut goals = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let numbers: Vec<f32> = line.split_whitespace().map_while(|w| w.parse().ok()).collect();
        match numbers.as_slice() {
            &[x, y, z]
                if line.split_whitespace().count() == 3
                    && numbers.iter().all(|n| n.is_finite() && n.abs() <= MAX_COORDINATE_M) =>
            {
                let place = format!("{}:{}", quoted_path(&path), index + 1);
                goals.push((Point::new(x, y, z), place));
                at_most(value, goals.len(), VEHICLES, "goals")?;
            }
            _ => {
                let place = format!("{}:{}", quoted_path(&path), index + 1);
                return Err(value.error(&format!(
                    "is malformed: {place}: expected `x y z` in metres, found `{}`",
                    quoted(line)
                )));
            }
        }
    }
    Ok(goals)
}

fn geofence(value: &Value<'_>) -> Result<Geofence> {
    let table = value.table()?;
    let hint = "a geofence is { min = [x, y, z], max = [x, y, z] }";
    let (min, max) = (point(&table.need("min", hint)?)?, point(&table.need("max", hint)?)?);
    table.finish()?;
    if (0..3).any(|axis| min[axis] >= max[axis]) {
        return Err(value.error("must have every coordinate of min below that of max"));
    }
    Ok(Geofence { min, max })
}

/// What errors about a vehicle point at.
struct VehicleSpans {
    start: Span,
    goal: Option<Span>,
    table: Span,
}

fn vehicles(
    value: &Value<'_>,
    origin: Option<&Geodetic>,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<Vec<(Vehicle, VehicleSpans)>> {
    let mut vehicles: Vec<(Vehicle, VehicleSpans)> = Vec::new();
    for item in value.items()? {
        let table = item.table()?;
        let id_value = table.need("id", "each vehicle has its own MAVLink system id, 1 to 250")?;
        let id = id_value.whole(1..=MAX_ID)? as u8;
        if vehicles.iter().any(|(v, _)| v.id == id) {
            return Err(id_value.error(&format!("is {id}, which another vehicle already has")));
        }
        vehicles.push(vehicle(&table, id, origin, unsupported)?);
    }
    if vehicles.is_empty() {
        return Err(value.error("must hold at least one vehicle"));
    }
    Ok(vehicles)
}

fn vehicle(
    table: &Table<'_>,
    id: u8,
    origin: Option<&Geodetic>,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<(Vehicle, VehicleSpans)> {
    let start = table.need(
        "start",
        "where its path begins: [east, north, up] in metres, or { lat_deg, lon_deg, alt_m }",
    )?;
    let goal = table.get("goal");
    let personality = table.word(
        "personality",
        Personality::Px4,
        &[("px4", Personality::Px4), ("ardupilot", Personality::Ardupilot)],
    )?;
    let companion = match table.get("companion") {
        None => Companion::InProcess,
        Some(value) => match value.str()? {
            "in-process" => Companion::InProcess,
            _ => Companion::Url {
                autopilot: link(&value)?,
                radio: table.get("radio").map(|radio| link(&radio)).transpose()?,
            },
        },
    };
    let vehicle = Vehicle {
        id,
        start: place(&start, origin)?,
        goal: goal.as_ref().map(|v| v.whole(0..=1_000_000).map(|g| g as usize)).transpose()?,
        radius_m: table.f32("radius_m", 0.3, 0.001..=100.0)?,
        altitude_m: table.optional_f32("altitude_m", -1000.0..=20_000.0)?,
        speed_max_mps: table.f32("speed_max_mps", 5.0, 0.01..=100.0)?,
        endurance_s: table.optional_f32("endurance_s", 1.0..=1e6)?,
        payload_kg: table.optional_f32("payload_kg", 0.0..=1e4)?,
        personality,
        home: table.get("home").map(|v| geodetic(&v)).transpose()?,
        ekf_origin: table.get("ekf_origin").map(|v| geodetic(&v)).transpose()?,
        companion,
    };
    for key in ["altitude_m", "endurance_s", "payload_kg"] {
        if let Some(value) = table.get(key) {
            unsupported.push(not_yet(table.text, &value.span, key));
        }
    }
    table.finish()?;
    let spans = VehicleSpans { start: start.span, goal: goal.map(|v| v.span), table: table.span.clone() };
    Ok((vehicle, spans))
}

fn link(value: &Value<'_>) -> Result<LinkUrl> {
    let parsed = value.str()?.parse();
    parsed.map_err(|_| value.error("must be \"in-process\" or a URL such as \"tcp:HOST:PORT\""))
}

fn deconfliction(table: &Table<'_>) -> Result<Deconfliction> {
    let methods = [("priority", Method::Priority), ("algorithm2", Method::Algorithm2), ("off", Method::Off)];
    let method = table.word("method", Method::Priority, &methods)?;
    let safety_distance_m = table.f32("safety_distance_m", 1.5, 0.0..=1000.0)?;
    let separation_m = table.f32(
        "separation_m",
        safety_distance_m + margins::STRAY_M,
        f64::from(safety_distance_m)..=1000.0,
    )?;
    let deconfliction = Deconfliction { method, safety_distance_m, separation_m };
    table.finish()?;
    Ok(deconfliction)
}

fn simulation(table: &Table<'_>) -> Result<Simulation> {
    let simulation = Simulation {
        wind_mps: table.f32("wind_mps", 0.0, 0.0..=50.0)?,
        gust_mps: table.f32("gust_mps", 0.0, 0.0..=50.0)?,
        position_noise_m: table.f32("position_noise_m", 0.0, 0.0..=100.0)?,
        estimator: table.word(
            "estimator",
            Estimator::Rtk,
            &[("rtk", Estimator::Rtk), ("recorded", Estimator::Recorded)],
        )?,
        serial_baud: table.whole("serial_baud", 921_600, 1200..=100_000_000)? as u32,
        serial_corruption: table.f32("serial_corruption", 0.0, 0.0..=1.0)?,
        radio_loss: table.f32("radio_loss", 0.0, 0.0..=1.0)?,
        radio_delay_s: table.f32("radio_delay_s", 0.05, 0.0..=60.0)?,
        radio_range_m: table.f32("radio_range_m", 500.0, 0.0..=1e6)?,
        time_limit_s: table.f32("time_limit_s", 600.0, 0.1..=1e6)?,
    };
    table.finish()?;
    Ok(simulation)
}

fn fault(table: &Table<'_>, ids: &[u8]) -> Result<Fault> {
    let words: Vec<(&str, &'static str)> =
        FAULT_KINDS.iter().chain([&FAULT_OBSTACLE]).map(|&kind| (kind, kind)).collect();
    let kind = table.need("kind", "what happens, for example \"kill\"")?.word(&words)?;
    let at_s = table.need("at_s", "when it strikes, in seconds")?.f64(&(0.0..=1e6))? as f32;
    let vehicle = table.get("vehicle");
    if let Some(value) = &vehicle
        && !ids.contains(&(value.whole(1..=MAX_ID)? as u8))
    {
        return Err(value.error("is no vehicle's id"));
    }
    let vehicle = vehicle.map(|v| v.whole(1..=MAX_ID).map(|id| id as u8)).transpose()?;
    let direction = table.get("direction").map(|v| v.word(&[("tx", "tx"), ("rx", "rx"), ("both", "both")]));
    let fault = Fault {
        at_s,
        duration_s: table.optional_f32("duration_s", 0.0..=1e6)?,
        vehicle,
        kind,
        direction: direction.transpose()?.map(str::to_owned),
        offset_m: table.get("offset_m").map(|v| point(&v)).transpose()?,
        position: table.get("position").map(|v| point(&v)).transpose()?,
        radius_m: table.optional_f32("radius_m", 0.001..=1000.0)?,
    };
    table.finish()?;
    if fault.kind == FAULT_OBSTACLE && (fault.position.is_none() || fault.radius_m.is_none()) {
        return Err(table
            .text
            .error(&table.span, "a fault of kind \"obstacle\" needs position and radius_m"));
    }
    Ok(fault)
}

/// Where estimates err as recorded, margin and separation must leave room for it.
fn check_margins(
    text: Text<'_>,
    span: &Span,
    roadmap: &Roadmap,
    deconfliction: &Deconfliction,
    simulation: &Simulation,
    vehicles: &[Vehicle],
) -> Result<()> {
    if simulation.estimator != Estimator::Recorded {
        return Ok(());
    }
    let need = margins::needed(simulation, deconfliction.safety_distance_m, vehicles);
    let missing = [
        ("roadmap.safety_margin_m", roadmap.safety_margin_m, need.margin_m),
        ("deconfliction.separation_m", deconfliction.separation_m, need.separation_m),
    ];
    let short = missing.iter().filter(|(_, has_m, need_m)| *has_m < need_m - 1e-3);
    let lacks: Vec<String> = short
        .map(|(key, has_m, need_m)| {
            format!("{key} is {has_m:.2} m, {:.2} m less than the {need_m:.2} m it takes", need_m - has_m)
        })
        .collect();
    if lacks.is_empty() {
        return Ok(());
    }
    let hint = "docs/simulating.md adds up margin and separation; \"rtk\" errs by 0.1 m";
    let why = format!("estimates as wrong as the recorded ones leave no room: {}", lacks.join("; "));
    Err(text.with_hint(span, why, hint))
}

fn check_apart(text: Text<'_>, vehicles: &[(Vehicle, VehicleSpans)], safety_distance_m: f32) -> Result<()> {
    for (index, (vehicle, spans)) in vehicles.iter().enumerate() {
        for (other, _) in &vehicles[..index] {
            let apart = (vehicle.start - other.start).norm();
            if apart < safety_distance_m {
                let why = format!(
                    "vehicles {} and {} start {apart:.2} m apart, below the safety distance of {safety_distance_m} m",
                    other.id, vehicle.id
                );
                return Err(text.error(&spans.start, why));
            }
        }
    }
    Ok(())
}

/// Vehicles land below their goals: two goals too near would put two vehicles too near for good.
fn check_goals_apart(
    table: &Table<'_>,
    mission: &Mission,
    safety_distance_m: f32,
    simulation: &Simulation,
    vehicles: &[Vehicle],
) -> Result<()> {
    let goals = &mission.goals;
    for (i, goal) in goals.iter().enumerate() {
        for (j, other) in goals[..i].iter().enumerate() {
            let apart = (goal - other).norm();
            if apart < safety_distance_m {
                let span = goal_span(table, i);
                let why = format!(
                    "goals {j} and {i} are {apart:.2} m apart, below the safety distance of {safety_distance_m} m"
                );
                let needed_m = margins::parked_separation_m(simulation, safety_distance_m, vehicles);
                let hint = format!("vehicles that land at both need {needed_m:.2} m between them");
                return Err(table.text.with_hint(&span, why, hint));
            }
        }
    }
    Ok(())
}

/// Nobody starts or lands outside the geofence.
fn check_inside(table: &Table<'_>, vehicles: &[(Vehicle, VehicleSpans)], mission: &Mission) -> Result<()> {
    let Some(fence) = &mission.geofence else { return Ok(()) };
    let outside = |place: &Point| !fence.holds(place);
    if let Some((vehicle, spans)) = vehicles.iter().find(|(vehicle, _)| outside(&vehicle.start)) {
        let why = format!("vehicle {} starts outside mission.geofence", vehicle.id);
        return Err(table.text.error(&spans.start, why));
    }
    match mission.goals.iter().position(outside) {
        Some(goal) => {
            let why = format!("goal {goal} lies outside mission.geofence");
            Err(table.text.error(&goal_span(table, goal), why))
        }
        None => Ok(()),
    }
}

/// Where a goal stands in the scenario.
fn goal_span(table: &Table<'_>, index: usize) -> Span {
    let Some(goals) = table.get("goals") else {
        return table.get("goals_file").map_or(table.span.clone(), |v| v.span);
    };
    let item = goals.items().ok().and_then(|items| items.get(index).map(|item| item.span.clone()));
    item.unwrap_or(goals.span)
}

fn check_goals(text: Text<'_>, vehicles: &[(Vehicle, VehicleSpans)], mission: &Mission) -> Result<()> {
    if mission.mode != Mode::Labelled {
        return Ok(());
    }
    for (index, (vehicle, spans)) in vehicles.iter().enumerate() {
        let Some(goal) = vehicle.goal else {
            let hint = "add `goal = N`, an index into mission.goals from 0";
            let why = format!("vehicle {} has no goal in a labelled mission", vehicle.id);
            return Err(text.with_hint(&spans.table, why, hint));
        };
        let span = spans.goal.as_ref().unwrap_or(&spans.table);
        if goal >= mission.goals.len() {
            let last = mission.goals.len() - 1;
            return Err(
                text.error(span, format!("vehicle {}: goal {goal} is beyond the last, {last}", vehicle.id))
            );
        }
        if let Some((other, _)) = vehicles[..index].iter().find(|(other, _)| other.goal == Some(goal)) {
            return Err(
                text.error(span, format!("vehicles {} and {} have the same goal", other.id, vehicle.id))
            );
        }
    }
    Ok(())
}
