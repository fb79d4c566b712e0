//! Reads the tables of a scenario, one function each.

pub(super) mod area;
mod checks;
pub(super) mod goals;
mod obstacles;
mod simulation;
mod terrain;
mod values;

use std::path::Path;

use companion::autopilot::AutopilotKind;
use companion::config::{DEFAULT_GROUND_STATION_IDS, MAX_GROUND_STATIONS};
use planner_core::Point;
use planner_core::geo::frames::{Geodetic, geodetic_to_enu};
use planner_core::roadmap::prm::Sampling;
use planner_core::roadmap::{MAX_COORDINATE_M, MAX_EDGE_M};
use toml::de::DeTable;

use self::checks::VehicleSpans;
use self::simulation::{check_obstacle_count, read_deconfliction, read_fault, read_simulation};
use self::values::{MAX_VEHICLE_ID, read_point};
use super::error::ScenarioError;
use super::reader::{Result, Table, TomlSpan, TomlText, TomlValue};
use super::types::{
    CompanionHost, Deconfliction, Fault, Geofence, MapSection, RoadmapSection, Simulation,
    TerminalEdges, UnsupportedTable, VehicleSection,
};
use crate::link::LinkUrl;
use crate::map::{MapSource, RESOLUTION_RANGE_M, UnknownSpace};
use crate::quote::printable;

/// Time limit of a simulated flight if the scenario gives none, seconds.
const DEFAULT_TIME_LIMIT_S: f32 = 600.0;
/// Most `[[faults]]` of a scenario.
const MAX_FAULTS: usize = 1000;
/// Mission origin if the scenario gives none: a test field.
pub(crate) const DEFAULT_ORIGIN: Geodetic =
    Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };

/// Parses the text as TOML, refuses unknown root keys, and calls `read` with the root table.
pub(super) fn read_root<T>(
    text: TomlText<'_>,
    read: impl FnOnce(&Table<'_>) -> Result<T>,
) -> Result<T> {
    let root = DeTable::parse(text.text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        let what = printable(error.message().lines().next().unwrap_or_default());
        let hint = syntax_hint(&text.text[span.start.min(text.text.len())..], &what);
        let error = text.error(&span, format!("not TOML: {what}"));
        ScenarioError { hint: hint.map(str::to_owned), ..error }
    })?;
    let root = Table::new(text, "", 0..0, root.get_ref());
    root.declare_keys(&[
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
    root.refuse_unknown_keys()?;
    read(&root)
}

/// Settings that scenarios of every kind of mission have.
struct CommonSettings {
    /// Seed of all random numbers.
    seed: u64,
    deconfliction: Deconfliction,
    simulation: Simulation,
    /// Where `simulation.estimator` stands, if it is given.
    estimator_span: Option<TomlSpan>,
}

/// Reads the settings that every kind of mission has. Two defaults depend on the kind: by how much
/// two vehicles together deviate from their paths, metres, and the time limit of a flight, seconds.
fn read_common(
    text: TomlText<'_>,
    root: &Table<'_>,
    (pair_error_m, limit_s): (f32, f32),
) -> Result<CommonSettings> {
    let seed = root.integer_in_range("seed", 1, 0..=i64::MAX as u64)?;
    let deconfliction = root.get("deconfliction").map(|v| v.table()).transpose()?;
    let deconfliction = deconfliction.unwrap_or_else(|| empty_table(text, "deconfliction"));
    let deconfliction = read_deconfliction(&deconfliction, pair_error_m)?;
    let simulation = root.get("simulation").map(|v| v.table()).transpose()?;
    let estimator_span = simulation.as_ref().and_then(|t| t.get("estimator")).map(|v| v.span);
    let simulation =
        read_simulation(&simulation.unwrap_or_else(|| empty_table(text, "simulation")), limit_s)?;
    Ok(CommonSettings { seed, deconfliction, simulation, estimator_span })
}

/// Reads `[[faults]]`; a fault's vehicle must be one of `vehicles`.
fn read_faults(
    root: &Table<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
) -> Result<Vec<Fault>> {
    let ids: Vec<u8> = vehicles.iter().map(|(v, _)| v.id).collect();
    let Some(value) = root.get("faults") else { return Ok(Vec::new()) };
    let items = value.items()?;
    check_list_len(&value, items.len(), MAX_FAULTS, "faults")?;
    let faults: Vec<Fault> =
        items.iter().map(|v| read_fault(&v.table()?, &ids)).collect::<Result<_>>()?;
    check_obstacle_count(&faults, &items)?;
    Ok(faults)
}

/// Hint at a usual mistake in text that is not TOML: `rest` is the text from the error on, `what`
/// is the parser's message.
fn syntax_hint(rest: &str, what: &str) -> Option<&'static str> {
    match rest.chars().next() {
        Some('“' | '”' | '„' | '‘' | '’' | '«') => {
            Some("quotes of TOML are straight: \"")
        }
        _ if what.contains("escape") => Some("a path is written with /, or between single quotes"),
        Some('[') if what.contains("duplicate") => {
            Some("each vehicle is a `[[vehicles]]`, each fault a `[[faults]]`")
        }
        _ => None,
    }
}

/// An empty table in place of one that the file leaves out: all its keys have their defaults.
fn empty_table<'a>(text: TomlText<'a>, name: &str) -> Table<'a> {
    static EMPTY: std::sync::LazyLock<DeTable<'static>> = std::sync::LazyLock::new(DeTable::new);
    Table::new(text, name, 0..0, &EMPTY)
}

/// The error that refuses `what`, which no code uses yet.
fn unsupported_error(text: TomlText<'_>, span: &TomlSpan, what: &str) -> ScenarioError {
    text.error(span, format!("not available yet: {what}"))
}

/// Reads a table that no code uses yet; if the scenario has it, adds the error that refuses it.
fn read_unsupported(
    root: &Table<'_>,
    key: &'static str,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<Option<UnsupportedTable>> {
    let Some(value) = root.get(key) else { return Ok(None) };
    value.table()?;
    unsupported.push(unsupported_error(root.text, &value.span, &format!("[{key}]")));
    let whole: toml::Table = toml::from_str(root.text.text)
        .map_err(|error| root.text.error(&value.span, format!("not TOML: {}", error.message())))?;
    let table = whole.get(key).and_then(toml::Value::as_table).cloned().unwrap_or_default();
    Ok(Some(UnsupportedTable { table }))
}

/// Reads a position by latitude, longitude and altitude.
fn read_geodetic(value: &TomlValue<'_>) -> Result<Geodetic> {
    let table = value.table()?;
    let hint = "a position is { lat_deg = …, lon_deg = …, alt_m = … }";
    let lat_deg = table.required("lat_deg", hint)?.f64(&(-90.0..=90.0))?;
    let lon_deg = table.required("lon_deg", hint)?.f64(&(-180.0..=180.0))?;
    let alt_m = table.required("alt_m", hint)?.f64(&(-1000.0..=20_000.0))?;
    table.refuse_unknown_keys()?;
    Ok(Geodetic { lat_deg, lon_deg, alt_m })
}

/// Reads `[map]`; the flag says whether the scenario gives the map's origin.
fn read_map(table: &Table<'_>, folder: &Path) -> Result<(MapSection, bool)> {
    let file_value =
        table.required("file", "a path to an OctoMap `.bt` file, or \"builtin:building\"")?;
    let name = file_value.str()?;
    if let Err(error) = MapSource::parse(name) {
        return Err(file_value.error(&format!("is not a map that can be read: {error}")));
    }
    let file = if name.starts_with("builtin:") {
        name.to_owned()
    } else {
        folder.join(name).display().to_string()
    };
    let origin = table.get("origin").map(|v| read_geodetic(&v)).transpose()?;
    let map = MapSection {
        file,
        resolution_m: table.f32("resolution_m", 0.25, RESOLUTION_RANGE_M)?,
        unknown: table.one_of(
            "unknown",
            UnknownSpace::Blocked,
            &[("blocked", UnknownSpace::Blocked), ("free", UnknownSpace::Free)],
        )?,
        origin: origin.unwrap_or(DEFAULT_ORIGIN),
    };
    table.refuse_unknown_keys()?;
    Ok((map, origin.is_some()))
}

/// Reads `[roadmap]`.
fn read_roadmap(table: &Table<'_>) -> Result<RoadmapSection> {
    let edge_max = table.get("edge_max_m");
    let shares = [("edge_min_share", "edge_min_m"), ("edge_max_share", "edge_max_m")];
    for (share, metres) in shares {
        if let (Some(value), true) = (table.get(share), table.get(metres).is_some()) {
            return Err(
                value.error(&format!("cannot stand beside roadmap.{metres}: give one of them"))
            );
        }
    }
    let roadmap = RoadmapSection {
        random_nodes: table.integer_in_range("nodes", 2300, 0..=1_000_000)? as u32,
        edge_min_m: table.f32("edge_min_m", 0.5, 0.0..=MAX_EDGE_M.into())?,
        edge_max_m: table.f32("edge_max_m", 8.0, 0.001..=MAX_EDGE_M.into())?,
        edge_min_share: table.optional_f32("edge_min_share", 0.0..=1.0)?,
        edge_max_share: table.optional_f32("edge_max_share", 0.0001..=1.0)?,
        terminal_edges: table.one_of(
            "terminals",
            TerminalEdges::Allowed,
            &[("joined", TerminalEdges::Allowed), ("apart", TerminalEdges::Forbidden)],
        )?,
        safety_margin_m: table.f32("safety_margin_m", 0.5, 0.0..=100.0)?,
        sampling: table.one_of(
            "sampling",
            Sampling::Uniform,
            &[
                ("uniform", Sampling::Uniform),
                ("halton", Sampling::Halton),
                ("bridge", Sampling::Bridge),
            ],
        )?,
        adds_passages: table.boolean("passages")?,
    };
    table.refuse_unknown_keys()?;
    let in_metres = roadmap.edge_min_share.is_none() && roadmap.edge_max_share.is_none();
    if in_metres && roadmap.edge_min_m >= roadmap.edge_max_m {
        let (min, max) = (roadmap.edge_min_m, roadmap.edge_max_m);
        let span = edge_max.map_or(table.span.clone(), |v| v.span);
        let why =
            format!("roadmap.edge_max_m ({max} m) must be above roadmap.edge_min_m ({min} m)");
        return Err(table.text.error(&span, why));
    }
    Ok(roadmap)
}

/// Reads the geofence, and the MAVLink system ids of ground stations whose commands count.
fn read_fence_and_ground_stations(
    table: &Table<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
) -> Result<(Option<Geofence>, [u8; MAX_GROUND_STATIONS])> {
    let geofence = table.get("geofence").map(|v| read_geofence(&v)).transpose()?;
    let ground_stations =
        table.get("ground_stations").map(|v| read_stations(&v, vehicles)).transpose()?;
    let ground_stations = ground_stations.unwrap_or(DEFAULT_GROUND_STATION_IDS);
    Ok((geofence, ground_stations))
}

/// Refuses a list of more than `most` items, which are called `what` in the error.
fn check_list_len(value: &TomlValue<'_>, count: usize, most: usize, what: &str) -> Result<()> {
    if count > most {
        return Err(value.error(&format!("holds more than {most} {what}")));
    }
    Ok(())
}

/// Reads the MAVLink system ids of the ground stations whose commands count.
fn read_stations(
    value: &TomlValue<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
) -> Result<[u8; MAX_GROUND_STATIONS]> {
    let given = value.items()?;
    if !(1..=MAX_GROUND_STATIONS).contains(&given.len()) {
        return Err(value.error(&format!("takes 1 to {MAX_GROUND_STATIONS} MAVLink system ids")));
    }
    let mut ids = [0; MAX_GROUND_STATIONS];
    for (id, given) in ids.iter_mut().zip(given) {
        *id = given.integer_in_range(1..=255)? as u8;
        if vehicles.iter().any(|(vehicle, _)| vehicle.id == *id) {
            return Err(given.error("is a vehicle's id: a ground station has one of its own"));
        }
    }
    Ok(ids)
}

/// Reads a point of the mission frame: ENU metres, or latitude, longitude and altitude, which need
/// an `origin` given in the scenario.
fn read_place(value: &TomlValue<'_>, origin: Option<&Geodetic>) -> Result<Point> {
    if !value.is_table() {
        return read_point(value);
    }
    let position = read_geodetic(value)?;
    let Some(origin) = origin else {
        let hint =
            "add `origin = { lat_deg = …, lon_deg = …, alt_m = … }` to [map], or give metres";
        let why =
            format!("{} is given by latitude and longitude, but map.origin is missing", value.name);
        return Err(value.text.error_with_hint(&value.span, why, hint));
    };
    let place = geodetic_to_enu(origin, &position);
    if place.xy().norm() > MAX_COORDINATE_M {
        let why = format!(
            "{} is {:.0} km from the origin at {:.4}, {:.4}; at most {:.0} km can be flown",
            value.name,
            place.xy().norm() / 1e3,
            origin.lat_deg,
            origin.lon_deg,
            MAX_COORDINATE_M / 1e3
        );
        let hint = "check the order of latitude and longitude, and the `origin` of [area] or [map]: metres are about it";
        return Err(value.text.error_with_hint(&value.span, why, hint));
    }
    Ok(place)
}

/// Reads a box by its least and greatest corner.
fn read_geofence(value: &TomlValue<'_>) -> Result<Geofence> {
    let table = value.table()?;
    let hint = "a geofence is { min = [x, y, z], max = [x, y, z] }";
    let (min, max) =
        (read_point(&table.required("min", hint)?)?, read_point(&table.required("max", hint)?)?);
    table.refuse_unknown_keys()?;
    if (0..3).any(|axis| min[axis] >= max[axis]) {
        return Err(value.error("must have every coordinate of min below that of max"));
    }
    Ok(Geofence { min, max })
}

/// What a coverage mission without an area lacks.
const AREA_HINT: &str = "add `[area]` with `file = \"field.geojson\"` or `polygon = [[x, y], …]`";
/// What a scenario without vehicles lacks.
const VEHICLES_HINT: &str = "add a `[[vehicles]]` with `id` and `start` for each";

/// Reads `[[vehicles]]`. Places in degrees need `origin`; each key that missions with goals do not
/// support adds an error to `unsupported`.
fn read_vehicles(
    value: &TomlValue<'_>,
    origin: Option<&Geodetic>,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<Vec<(VehicleSection, VehicleSpans)>> {
    let mut vehicles: Vec<(VehicleSection, VehicleSpans)> = Vec::new();
    for item in value.items()? {
        let table = item.table()?;
        let id_value =
            table.required("id", "each vehicle has its own MAVLink system id, 1 to 250")?;
        let id = id_value.integer_in_range(1..=MAX_VEHICLE_ID)? as u8;
        if vehicles.iter().any(|(v, _)| v.id == id) {
            return Err(id_value.error(&format!("is {id}, which another vehicle already has")));
        }
        vehicles.push(read_vehicle(&table, id, origin, unsupported)?);
    }
    if vehicles.is_empty() {
        return Err(value.error("must hold at least one vehicle"));
    }
    Ok(vehicles)
}

fn read_vehicle(
    table: &Table<'_>,
    id: u8,
    origin: Option<&Geodetic>,
    unsupported: &mut Vec<ScenarioError>,
) -> Result<(VehicleSection, VehicleSpans)> {
    let start = table.required(
        "start",
        "where its path begins: [east, north, up] in metres, or { lat_deg, lon_deg, alt_m }",
    )?;
    let goal = table.get("goal");
    let autopilot = table.one_of(
        "personality",
        AutopilotKind::Px4,
        &[("px4", AutopilotKind::Px4), ("ardupilot", AutopilotKind::ArduPilot)],
    )?;
    let companion = match table.get("companion") {
        None => CompanionHost::InProcess { flash: None },
        Some(value) => match value.str()? {
            "in-process" => CompanionHost::InProcess { flash: None },
            _ => CompanionHost::Url {
                autopilot: read_link(&value)?,
                radio: table.get("radio").map(|radio| read_link(&radio)).transpose()?,
            },
        },
    };
    let vehicle = VehicleSection {
        id,
        start: read_place(&start, origin)?,
        goal_index: goal
            .as_ref()
            .map(|v| v.integer_in_range(0..=1_000_000).map(|g| g as usize))
            .transpose()?,
        radius_m: table.f32("radius_m", 0.3, 0.001..=100.0)?,
        altitude_m: table.optional_f32("altitude_m", -1000.0..=20_000.0)?,
        speed_max_mps: table.f32("speed_max_mps", 5.0, 0.01..=100.0)?,
        hover_endurance_s: table.optional_f32("endurance_s", 1.0..=1e6)?,
        payload_kg: table.optional_f32("payload_kg", 0.0..=1e4)?,
        autopilot,
        home: table.get("home").map(|v| read_geodetic(&v)).transpose()?,
        ekf_origin: table.get("ekf_origin").map(|v| read_geodetic(&v)).transpose()?,
        companion,
        weight: table.optional_f32("weight", 0.001..=1000.0)?,
        climb_mps: table.optional_f32("climb_mps", 0.01..=100.0)?,
        descend_mps: table.optional_f32("descend_mps", 0.01..=100.0)?,
    };
    for key in ["altitude_m", "endurance_s", "payload_kg", "weight", "climb_mps", "descend_mps"] {
        if let Some(value) = table.get(key) {
            unsupported.push(unsupported_error(table.text, &value.span, key));
        }
    }
    table.refuse_unknown_keys()?;
    let spans =
        VehicleSpans { start: start.span, goal: goal.map(|v| v.span), table: table.span.clone() };
    Ok((vehicle, spans))
}

/// Reads the URL of a link.
fn read_link(value: &TomlValue<'_>) -> Result<LinkUrl> {
    let parsed = value.str()?.parse();
    parsed.map_err(|_| value.error("must be \"in-process\" or a URL such as \"tcp:HOST:PORT\""))
}
