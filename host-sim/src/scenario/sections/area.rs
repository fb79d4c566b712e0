//! Reads the scenario of a coverage mission: `[area]`, and the tables that depend on it.

mod errors;
mod spacing;

use std::path::Path;

use planner_core::coverage::area::{Ring, RingKind, SAME_VERTEX_M};
use planner_core::coverage::pack::Heights;
use planner_core::coverage::{Flat, area as core_area};
use planner_core::geo::frames::{Geodetic, geodetic_to_enu};

use self::errors::{
    area_hint, describe_area_error, faulty_ring, file_hint, ring_fault_text_and_hint,
};
use self::spacing::{read_camera, read_spacing};
use super::checks::{VehicleSpans, check_margins};
use super::obstacles::{FlightSettings, MapBesideArea};
use super::terrain::UnreadTerrain;
use super::{
    AREA_HINT, CommonSettings, DEFAULT_ORIGIN, VEHICLES_HINT, empty_table, read_common,
    read_faults, read_fence_and_ground_stations, read_geodetic, read_unsupported, read_vehicles,
    unsupported_error,
};
use crate::area::{self, AreaFormat, MAX_VERTICES, Polygons, RingXy};
use crate::map::UnknownSpace;
use crate::margins;
use crate::quote::printable_path;
use crate::scenario::coverage::{AreaSection, CoverageMethod, HeadingRule, ORIGIN_HINT, Trigger};
use crate::scenario::error::ScenarioError;
use crate::scenario::reader::{Result, Table, TomlSpan, TomlText, TomlValue};
use crate::scenario::{
    AssignmentObjective, MapSection, MissionMode, MissionSection, Scenario, VehicleSection,
};
use crate::terrain::WithoutCrs;

/// Time limit of a simulated flight in a coverage mission if the scenario gives none, seconds:
/// longer than a battery lasts.
const DEFAULT_AREA_TIME_LIMIT_S: f32 = 3600.0;

/// Edge of a cell of the level ground that a coverage mission has in place of a map, metres.
const LEVEL_GROUND_CELL_M: f32 = 1.0;
/// Extent in metres up to which an area in "metres" is refused: its numbers must be degrees.
const MAX_EXTENT_AS_DEGREES_M: f64 = 0.5;

/// Whether the numbers of a polygon are degrees or metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coordinates {
    /// Longitude and latitude, degrees.
    Wgs84,
    /// Metres east and north of the mission's origin.
    Metres,
}

/// The map of a mission without one: level ground.
fn level_ground(origin: Geodetic) -> MapSection {
    let file = String::new();
    MapSection { file, resolution_m: LEVEL_GROUND_CELL_M, unknown: UnknownSpace::Free, origin }
}

/// Reads the scenario of a coverage mission.
pub(in crate::scenario) fn read_coverage_scenario(
    text: TomlText<'_>,
    root: &Table<'_>,
    folder: &Path,
) -> Result<Scenario> {
    let CommonSettings { seed, deconfliction, simulation, estimator_span } =
        read_common(text, root, (margins::PAIR_DEVIATION_COVERAGE_M, DEFAULT_AREA_TIME_LIMIT_S))?;
    let map = MapBesideArea::from_root(root, folder)?;
    let origin = map.as_ref().and_then(MapBesideArea::origin);
    let (mut area, terrain) =
        read_area(&root.required("area", AREA_HINT)?.table()?, folder, origin)?;
    let mut unsupported = Vec::new();
    let vehicles = root.required("vehicles", VEHICLES_HINT)?;
    let mut vehicles = read_vehicles(&vehicles, Some(&area.origin), &mut unsupported)?;
    // These keys are unsupported in missions with goals, but not here.
    unsupported.retain(|error| !COVERAGE_VEHICLE_KEYS.iter().any(|key| error.why.ends_with(key)));
    let formation = read_unsupported(root, "formation", &mut unsupported)?;
    let mission = root.get("mission").map(|v| v.table()).transpose()?;
    let mission = mission.unwrap_or_else(|| empty_table(text, "mission"));
    unsupported.extend(goal_keys_beside_area(text, &mission));
    let mission = self::read_coverage_mission(&mission, &vehicles)?;
    let roadmap = root.get("roadmap").map(|v| v.table()).transpose()?;
    let roadmap = super::read_roadmap(&roadmap.unwrap_or_else(|| empty_table(text, "roadmap")))?;
    let faults = read_faults(root, &vehicles)?;
    if let Some(terrain) = &terrain {
        terrain.apply_terrain(text, &mut area, &mut vehicles, &mission, &simulation)?;
    }
    let vehicle_file_lines = vehicles.iter().map(|(_, s)| text.file_and_line(&s.start)).collect();
    let (vehicles, spans): (Vec<VehicleSection>, Vec<VehicleSpans>) = vehicles.into_iter().unzip();
    let apart_m =
        margins::min_pad_distance_m(&simulation, deconfliction.safety_distance_m, &vehicles);
    check_pads_apart(text, &vehicles, &spans, apart_m)?;
    check_starts_below_pictures(text, &vehicles, &spans, area.heights.max_picture_height_m)?;
    if let Some(span) = &estimator_span {
        check_margins(text, span, None, &deconfliction, &simulation, &vehicles)?;
    }
    area.usable_spacing = margins::with_usable_footprint(
        &area.spacing,
        area.picture_height_m,
        mission.cruise_mps,
        &simulation,
        &vehicles,
    );
    if let Some(map) = &map {
        let (vehicles, spans) = (&vehicles[..], &spans[..]);
        let (simulation, deconfliction, roadmap) = (&simulation, &deconfliction, &roadmap);
        let settings = FlightSettings { vehicles, spans, simulation, deconfliction, roadmap };
        map.add_no_fly_zones(text, &mut area, &settings)?;
    }
    Ok(Scenario {
        path: text.file.to_owned(),
        text: text.text.to_owned(),
        seed,
        map: level_ground(area.origin),
        roadmap,
        mission,
        vehicle_file_lines,
        vehicles,
        deconfliction,
        simulation,
        faults,
        area: Some(area),
        formation,
        unsupported,
    })
}

/// An error for each given key about goals or their assignment: a coverage mission has no goals.
fn goal_keys_beside_area(text: TomlText<'_>, mission: &Table<'_>) -> Vec<ScenarioError> {
    let unsupported = |key: &'static str| {
        let value = mission.get(key)?;
        Some(unsupported_error(text, &value.span, &format!("mission.{key} beside [area]")))
    };
    GOAL_KEYS.into_iter().filter_map(unsupported).collect()
}

/// Keys of `[mission]` that only missions with goals support.
const GOAL_KEYS: [&str; 3] = ["objective", "goals", "goals_file"];
/// Keys of a vehicle that only coverage missions support.
const COVERAGE_VEHICLE_KEYS: [&str; 4] = ["endurance_s", "weight", "climb_mps", "descend_mps"];

/// Refuses pads less than `apart_m` apart horizontally: no vehicle may climb through another one.
fn check_pads_apart(
    text: TomlText<'_>,
    vehicles: &[VehicleSection],
    spans: &[VehicleSpans],
    apart_m: f32,
) -> Result<()> {
    for (index, (vehicle, spans)) in vehicles.iter().zip(spans).enumerate() {
        let apart = |other: &VehicleSection| (vehicle.start - other.start).xy().norm();
        let near = |other: &&VehicleSection| apart(other) < apart_m;
        if let Some(other) = vehicles[..index].iter().find(near) {
            let why = format!(
                "vehicles {} and {} start {:.2} m apart: to land beside each other they need {apart_m:.2} m",
                other.id,
                vehicle.id,
                apart(other)
            );
            return Err(text.error(&spans.start, why));
        }
    }
    Ok(())
}

/// Refuses a vehicle that starts at or above the height at which pictures are taken.
fn check_starts_below_pictures(
    text: TomlText<'_>,
    vehicles: &[VehicleSection],
    spans: &[VehicleSpans],
    height_m: f32,
) -> Result<()> {
    let Some((vehicle, spans)) = vehicles.iter().zip(spans).find(|(v, _)| v.start.z >= height_m)
    else {
        return Ok(());
    };
    let why = format!(
        "vehicle {} stands {:.1} m above the origin, pictures are taken at {height_m:.1} m",
        vehicle.id, vehicle.start.z
    );
    Err(text.error_with_hint(&spans.start, why, ORIGIN_HINT))
}

/// Reads `[mission]` of a coverage mission, which has no goals.
fn read_coverage_mission(
    table: &Table<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
) -> Result<MissionSection> {
    table.one_of("mode", MissionMode::Coverage, &[("coverage", MissionMode::Coverage)])?;
    table.declare_keys(&GOAL_KEYS);
    let (geofence, ground_stations) = read_fence_and_ground_stations(table, vehicles)?;
    let mission = MissionSection {
        mode: MissionMode::Coverage,
        objective: AssignmentObjective::Makespan,
        cruise_mps: table.f32("cruise_mps", 2.0, 0.01..=100.0)?,
        goals: Vec::new(),
        goal_file_lines: Vec::new(),
        geofence,
        ground_stations,
    };
    table.refuse_unknown_keys()?;
    Ok(mission)
}

/// Reads the area, and which file has the heights of the ground below it, if any. `origin` is the
/// origin of `[map]`, if the scenario gives it.
fn read_area(
    table: &Table<'_>,
    folder: &Path,
    origin: Option<Geodetic>,
) -> Result<(AreaSection, Option<UnreadTerrain>)> {
    let (polygons, coordinates, source) = read_polygons(table, folder)?;
    let given = table.get("origin").map(|v| read_geodetic(&v)).transpose()?.or(origin);
    let first = polygons.outers[0][0];
    let mut origin = given.unwrap_or(match coordinates {
        Coordinates::Wgs84 => Geodetic { lat_deg: first[1], lon_deg: first[0], alt_m: 0.0 },
        Coordinates::Metres => DEFAULT_ORIGIN,
    });
    let without_crs = match coordinates {
        Coordinates::Wgs84 => WithoutCrs::Refused,
        Coordinates::Metres => WithoutCrs::Metres,
    };
    let terrain = UnreadTerrain::from_table(table, folder, without_crs)?;
    if let (Some(terrain), None) = (&terrain, given) {
        origin.alt_m = terrain.origin_ground_altitude_m(table.text, &origin)?;
    }
    let (vertices, rings) =
        rings_in_mission_frame(table, &source, &polygons, coordinates, &origin)?;
    let camera = table.get("camera").map(|v| read_camera(&v)).transpose()?;
    let (height_m, spacing) = read_spacing(table, camera.as_ref())?;
    let layer_m = table.f32("layer_m", 5.0, 0.1..=1000.0)?;
    let method = table.get("method").map(|v| v.one_of(&CoverageMethod::NAMES)).transpose()?;
    let area = AreaSection {
        file_line: table.text.file_and_line(&source),
        vertices,
        rings,
        given_no_fly_zones: polygons.no_fly.len(),
        origin,
        camera,
        spacing,
        usable_spacing: spacing,
        picture_height_m: height_m,
        heights: Heights { max_picture_height_m: height_m, layer_spacing_m: layer_m },
        terrain: None,
        obstacles: None,
        lane_angle_deg: table.optional_f32("angle_deg", -360.0..=360.0)?,
        border_overshoot_m: table.f32("margin_m", 0.0, 0.0..=1000.0)?,
        allows_battery_swaps: table.boolean("batteries")?,
        method: method.unwrap_or(CoverageMethod::PowellBinpat),
        heading: table.one_of(
            "heading",
            HeadingRule::SameOnAllLanes,
            &[("sweep", HeadingRule::SameOnAllLanes), ("lane", HeadingRule::DirectionOfFlight)],
        )?,
        trigger: table.one_of(
            "trigger",
            Trigger::Distance,
            &[
                ("distance", Trigger::Distance),
                ("waypoint", Trigger::Waypoint),
                ("none", Trigger::None),
            ],
        )?,
    };
    table.refuse_unknown_keys()?;
    Ok((area, terrain))
}

/// Reads the area's polygons, whether they are in degrees or metres, and where they stand.
fn read_polygons(table: &Table<'_>, folder: &Path) -> Result<(Polygons, Coordinates, TomlSpan)> {
    let (file, polygon) = (table.get("file"), table.get("polygon"));
    let words = [
        ("wgs84", Coordinates::Wgs84),
        ("metres", Coordinates::Metres),
        ("meters", Coordinates::Metres),
    ];
    let said = table.get("coordinates").map(|v| v.one_of(&words)).transpose()?;
    let (mut polygons, usual, span) = match (&file, &polygon) {
        (Some(_), Some(polygon)) => {
            return Err(polygon.error("cannot stand beside area.file: give one of them"));
        }
        (None, None) => {
            let hint = "add `file = \"field.geojson\"` or `polygon = [[x, y], …]`";
            return Err(table.text.error_with_hint(&table.span, "area.file is missing", hint));
        }
        (Some(file), None) => {
            let path = folder.join(file.str()?);
            let polygons = area::read(&path).map_err(|error| ScenarioError {
                hint: Some(file_hint(&error).to_owned()),
                ..file.error(&format!("is no area: {}: {error}", printable_path(&path)))
            })?;
            let metres = AreaFormat::from_path(&path) == Some(AreaFormat::Wkt);
            let usual = if metres { Coordinates::Metres } else { Coordinates::Wgs84 };
            (polygons, usual, file.span.clone())
        }
        (None, Some(polygon)) => {
            let (ring, coordinates) = read_ring(polygon)?;
            if (coordinates, said) == (Coordinates::Wgs84, Some(Coordinates::Metres)) {
                let why =
                    "area.polygon is in degrees, and area.coordinates is \"metres\"".to_owned();
                let hint = "give [x, y] in metres, or leave `coordinates` out";
                return Err(table.text.error_with_hint(&polygon.span, why, hint));
            }
            let polygons = Polygons { outers: vec![ring], ..Polygons::default() };
            (polygons, coordinates, polygon.span.clone())
        }
    };
    let coordinates = said.unwrap_or(usual);
    for (key, rings) in [("holes", &mut polygons.holes), ("no_fly", &mut polygons.no_fly)] {
        let Some(value) = table.get(key) else { continue };
        for item in value.items()? {
            let (ring, own) = read_ring(&item)?;
            if own == Coordinates::Wgs84 && coordinates == Coordinates::Metres {
                let hint = "give [x, y] in metres";
                let why = format!("{} is in degrees and the area in metres", item.name);
                return Err(table.text.error_with_hint(&item.span, why, hint));
            }
            rings.push(ring);
        }
    }
    let count = polygons.vertex_count();
    if count > MAX_VERTICES {
        let why = format!("area has {count} vertices; at most {MAX_VERTICES} can be used");
        return Err(table.text.error(&span, why));
    }
    Ok((polygons, coordinates, span))
}

/// Reads one ring: `[[x, y], …]` counts as metres unless `coordinates` says otherwise,
/// `[{ lat_deg, lon_deg }, …]` is degrees.
fn read_ring(value: &TomlValue<'_>) -> Result<(RingXy, Coordinates)> {
    let items = value.items()?;
    let degrees = items.first().is_some_and(TomlValue::is_table);
    let mut ring = RingXy::with_capacity(items.len());
    for item in &items {
        ring.push(match degrees {
            true => {
                let table = item.table()?;
                let hint = "a place is { lat_deg = …, lon_deg = … }";
                let lat = table.required("lat_deg", hint)?.f64(&(-90.0..=90.0))?;
                let lon = table.required("lon_deg", hint)?.f64(&(-180.0..=180.0))?;
                table.declare_keys(&["alt_m"]);
                table.refuse_unknown_keys()?;
                [lon, lat]
            }
            false => {
                let pair = item.items()?;
                let [x, y] = pair.as_slice() else {
                    return Err(item.error("must be two numbers, x and y"));
                };
                let range = -1e7..=1e7;
                [x.f64(&range)?, y.f64(&range)?]
            }
        });
    }
    area::remove_repeated_vertices(&mut ring);
    if ring.len() < 3 {
        return Err(value.error("must have at least three places that differ"));
    }
    Ok((ring, if degrees { Coordinates::Wgs84 } else { Coordinates::Metres }))
}

/// Converts the rings to the mission frame, and refuses rings that form no area.
fn rings_in_mission_frame(
    table: &Table<'_>,
    source: &TomlSpan,
    polygons: &Polygons,
    coordinates: Coordinates,
    origin: &Geodetic,
) -> Result<(Vec<Flat>, Vec<Ring>)> {
    let bad = |why: String, hint: &str| Err(table.text.error_with_hint(source, why, hint));
    let border = if table.get("file").is_some() { "area.file" } else { "area.polygon" };
    let (mut vertices, mut rings) = (Vec::new(), Vec::new());
    let kinds = [
        (RingKind::Outer, &polygons.outers),
        (RingKind::Hole, &polygons.holes),
        (RingKind::NoFly, &polygons.no_fly),
    ];
    for (kind, ring) in
        kinds.iter().flat_map(|(kind, rings)| rings.iter().map(move |ring| (*kind, ring)))
    {
        let begin = vertices.len();
        for &[x, y] in ring {
            let Some(place) = place_in_mission_frame([x, y], coordinates, origin) else {
                let why = format!("{border}: longitude {x}, latitude {y} is no place on earth");
                return bad(why, "metres need `coordinates = \"metres\"`");
            };
            // Vertices that are equal up to rounding, or were given twice, become one.
            let repeats = vertices[begin..]
                .last()
                .is_some_and(|last: &Flat| (place - last).amax() < SAME_VERTEX_M);
            if !repeats {
                vertices.push(place);
            }
        }
        while vertices.len() > begin + 1
            && (vertices[begin] - vertices[vertices.len() - 1]).amax() < SAME_VERTEX_M
        {
            vertices.pop();
        }
        rings.push(Ring { end: vertices.len() as u16, kind });
    }
    let wide = |axis: usize| {
        let along = || polygons.outers.iter().flatten().map(|place| place[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    if coordinates == Coordinates::Metres && wide(0).max(wide(1)) < MAX_EXTENT_AS_DEGREES_M {
        let why = format!("area is {:.6} by {:.6} m", wide(0), wide(1));
        return bad(why, "degrees need `coordinates = \"wgs84\"`");
    }
    match core_area::Area::new(&vertices, &rings).map(|area| ring_fault_text_and_hint(&area)) {
        Ok(None) => Ok((vertices, rings)),
        Ok(Some((why, hint))) => bad(format!("{border}: {why}"), hint),
        Err(error) => {
            let (why, hint) = (describe_area_error(error, &rings), area_hint(error));
            match faulty_ring(error, &rings).and_then(|ring| ring_span(table, &rings, ring)) {
                Some((key, span)) => {
                    Err(table.text.error_with_hint(&span, format!("area.{key}: {why}"), hint))
                }
                None => bad(format!("{border}: {why}"), hint),
            }
        }
    }
}

/// Key and place of a hole or no-fly zone that the scenario's own keys give; `None` for other
/// rings.
fn ring_span(table: &Table<'_>, rings: &[Ring], ring: usize) -> Option<(&'static str, TomlSpan)> {
    let kind = rings[ring].kind;
    let key = match kind {
        RingKind::Outer => return None,
        RingKind::Hole => "holes",
        RingKind::NoFly => "no_fly",
    };
    let items = table.get(key)?.items().ok()?;
    // Rings of the area file come before those of the scenario's key.
    let all = rings.iter().filter(|other| other.kind == kind).count();
    let nth = rings[..ring].iter().filter(|other| other.kind == kind).count();
    items.get((nth + items.len()).checked_sub(all)?).map(|item| (key, item.span.clone()))
}

/// A place in the mission frame; `None` for one that is not on earth.
fn place_in_mission_frame(
    [x, y]: [f64; 2],
    coordinates: Coordinates,
    origin: &Geodetic,
) -> Option<Flat> {
    match coordinates {
        Coordinates::Metres => Some(Flat::new(x as f32, y as f32)),
        Coordinates::Wgs84 => {
            let place = Geodetic { lat_deg: y, lon_deg: x, alt_m: origin.alt_m };
            place.is_valid().then(|| geodetic_to_enu(origin, &place).xy())
        }
    }
}

#[cfg(test)]
mod tests;
