//! Reads the ground below an area: `terrain` and `terrain_tolerance_m` of `[area]`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use planner_core::coverage::Flat;
use planner_core::coverage::pack::Heights;
use planner_core::geo::frames::Geodetic;

use super::checks::VehicleSpans;
use crate::margins;
use crate::quote::printable_path;
use crate::scenario::coverage::{AreaSection, Terrain};
use crate::scenario::error::ScenarioError;
use crate::scenario::reader::{Result, Table, TomlSpan, TomlText};
use crate::scenario::{MissionSection, Simulation, VehicleSection};
use crate::terrain::{
    self, FieldConfig, FieldError, HeightGrid, TerrainError, TerrainFrame, WithoutCrs,
};

/// Greatest difference between a start's given height and the ground below it, metres.
const MAX_PAD_HEIGHT_ERROR_M: f32 = 5.0;
/// Greatest step of the ground near a pad, metres.
const MAX_STEP_AT_PAD_M: f32 = 1.0;
/// Number of rings around a pad beside a step on which a level place is sought, for the hint.
const PLACE_SEARCH_STEPS: usize = 40;
/// Distance of these rings from each other, metres.
const PLACE_SEARCH_STEP_M: f32 = 0.5;
/// Number of places on each ring.
const PLACE_SEARCH_DIRECTIONS: usize = 16;
/// How far beside lanes and around corners paths may lead, metres.
const PATHS_BESIDE_LANES_M: f32 = 5.0;

/// The file of heights that `[area]` names, not yet read.
pub(super) struct UnreadTerrain {
    /// Path of the file.
    path: PathBuf,
    /// Where the file's name stands, for errors.
    span: TomlSpan,
    /// Height of the band of paths above the ground, metres.
    tolerance_m: f32,
    /// What holds for a file without a coordinate system.
    without_crs: WithoutCrs,
}

impl UnreadTerrain {
    /// The file of heights that `[area]` names, if any.
    pub(super) fn from_table(
        table: &Table<'_>,
        folder: &Path,
        without_crs: WithoutCrs,
    ) -> Result<Option<Self>> {
        let tolerance = table.get("terrain_tolerance_m");
        let Some(file) = table.get("terrain") else {
            return match tolerance {
                Some(value) => Err(value.error("needs area.terrain")),
                None => Ok(None),
            };
        };
        let tolerance_m = table.f32("terrain_tolerance_m", 3.0, 0.1..=1000.0)?;
        Ok(Some(Self {
            path: folder.join(file.str()?),
            span: file.span.clone(),
            tolerance_m,
            without_crs,
        }))
    }

    /// Reads the heights of the ground in `window`: its south-western and north-eastern corner,
    /// metres.
    fn read(&self, text: TomlText<'_>, origin: &Geodetic, window: [Flat; 2]) -> Result<HeightGrid> {
        let frame = TerrainFrame { origin, without_crs: self.without_crs, window: Some(window) };
        terrain::read(&self.path, &frame).map_err(|error| self.terrain_error(text, &error))
    }

    /// The error about the file, at its name in the scenario.
    fn terrain_error(&self, text: TomlText<'_>, error: &TerrainError) -> ScenarioError {
        let path = printable_path(&self.path);
        match error {
            TerrainError::UnusableCrs { what, hint } => text.error_with_hint(
                &self.span,
                format!("area.terrain: {path} is in {what}, which cannot be used"),
                *hint,
            ),
            TerrainError::NoGeoreference(hint) => text.error_with_hint(
                &self.span,
                format!("area.terrain: {path} does not say where it is"),
                *hint,
            ),
            other => {
                let hint = match other {
                    TerrainError::Read(_) => "paths are relative to the scenario's folder",
                    TerrainError::TooLong(_) | TerrainError::TooManyCells(_) => {
                        "cut it to the area, or make its cells larger: gdalwarp -te … -tr …"
                    }
                    TerrainError::NoHeightInWindow(_) => {
                        "the file must hold the area and all pads; area.origin says where they are"
                    }
                    _ => "export it again as ESRI ASCII grid, GeoTIFF, LAS or LAZ",
                };
                text.error_with_hint(&self.span, format!("area.terrain: {path} {other}"), hint)
            }
        }
    }

    /// Height of the ground at the origin, metres above sea level.
    pub(super) fn origin_ground_altitude_m(
        &self,
        text: TomlText<'_>,
        origin: &Geodetic,
    ) -> Result<f64> {
        let grid = self.read(text, origin, [Flat::repeat(-1.0), Flat::repeat(1.0)])?;
        let height_m = grid.height_at(&Flat::zeros());
        let hint = "another area.origin, or a file that holds it";
        height_m.map(f64::from).ok_or_else(|| {
            text.error_with_hint(
                &self.span,
                "area.terrain has no height at the mission's origin".to_owned(),
                hint,
            )
        })
    }

    /// Reads the terrain file; sets the area's terrain and greatest picture height, and puts the
    /// vehicles on the ground.
    pub(super) fn apply_terrain(
        &self,
        text: TomlText<'_>,
        area: &mut AreaSection,
        vehicles: &mut [(VehicleSection, VehicleSpans)],
        mission: &MissionSection,
        simulation: &Simulation,
    ) -> Result<()> {
        let pads: Vec<Flat> = vehicles.iter().map(|(vehicle, _)| vehicle.start.xy()).collect();
        let [low, high] = area.vertices.iter().chain(&pads).fold(
            [Flat::repeat(f32::INFINITY), Flat::repeat(f32::NEG_INFINITY)],
            |[low, high], place| [low.inf(place), high.sup(place)],
        );
        // Lanes may begin outside the border, by the overshoot and half a footprint.
        let lanes_beyond_m = area.border_overshoot_m + area.spacing.footprint.across_m / 2.0;
        let beyond = Flat::repeat(lanes_beyond_m + PATHS_BESIDE_LANES_M);
        let own: Vec<VehicleSection> = vehicles.iter().map(|(v, _)| v.clone()).collect();
        let slope = own.iter().map(|vehicle| {
            let [climb_mps, descend_mps] = vehicle.climb_and_descent_mps();
            climb_mps.min(descend_mps) / mission.cruise_mps.min(vehicle.speed_max_mps)
        });
        let max_slope = slope.fold(f32::INFINITY, f32::min);
        let max_cross_track_m = margins::required_distances(simulation, 0.0, &own).wall_margin_m;
        let area_box = [low - beyond, high + beyond];
        let config = FieldConfig { area: area_box, max_cross_track_m, max_slope };
        let grid = self.read(text, &area.origin, config.window())?.relative_to(area.origin.alt_m);
        let field = terrain::encode_field(&grid, &config).map_err(|error| {
            let why = format!("area.terrain: {}: {error}", printable_path(&self.path));
            let hint = match error {
                FieldError::HeightOutOfRange(_) => "area.origin needs an alt_m near the ground",
                _ => "the file must hold the area, all pads and some metres around them",
            };
            text.error_with_hint(&self.span, why, hint)
        })?;
        for (vehicle, spans) in vehicles {
            let near_m = vehicle.radius_m + margins::max_touchdown_offset_m(simulation, vehicle);
            vehicle.start.z = pad_ground_m(&grid, &area.origin, vehicle, near_m)
                .map_err(|(why, hint)| text.error_with_hint(&spans.start, why, hint))?;
        }
        let terrain = Terrain {
            grid: Arc::new(grid),
            field_file: field.into(),
            tolerance_m: self.tolerance_m,
            max_slope,
        };
        let top_m = terrain.following(area.picture_height_m).map_or(0.0, |f| f.max_path_z_m());
        if top_m <= 0.0 {
            let hint = format!("area.origin alt_m = {:.1} is above it", area.origin.alt_m);
            return Err(text.error_with_hint(
                &self.span,
                "area.terrain lies below the origin".to_owned(),
                hint,
            ));
        }
        area.heights = Heights { max_picture_height_m: top_m, ..area.heights };
        area.terrain = Some(terrain);
        Ok(())
    }
}

/// Height of the ground on which a vehicle stands, metres up in the mission frame.
///
/// # Errors
/// What is wrong and what helps: the start's own height is another one, or there is a step within
/// `near_m` of it.
fn pad_ground_m(
    grid: &HeightGrid,
    origin: &Geodetic,
    vehicle: &VehicleSection,
    near_m: f32,
) -> std::result::Result<f32, (String, String)> {
    let (id, place) = (vehicle.id, vehicle.start.xy());
    let ground_m = grid.height_at(&place).unwrap_or(0.0);
    let off_m = vehicle.start.z - ground_m;
    if off_m.abs() > MAX_PAD_HEIGHT_ERROR_M {
        let why = format!("vehicle {id} starts {off_m:.1} m from the ground of area.terrain");
        let altitude_m = origin.alt_m + f64::from(ground_m);
        let up = format!(
            "there the ground is {ground_m:.1} m above the origin, alt_m = {altitude_m:.1}"
        );
        return Err((why, up));
    }
    let step_m = |place: &Flat| {
        let Some(own_m) = grid.height_at(place) else { return f32::INFINITY };
        let range = grid.height_range_around_m(place, near_m).unwrap_or([own_m; 2]);
        range.map(|height_m| (height_m - own_m).abs()).into_iter().fold(0.0, f32::max)
    };
    let found_m = step_m(&place);
    if found_m <= MAX_STEP_AT_PAD_M {
        return Ok(ground_m);
    }
    let why = format!(
        "area.terrain has a step of {found_m:.1} m within {near_m:.1} m of vehicle {id}'s start"
    );
    Err((why, level_place_hint(&place, |beside| step_m(beside) <= MAX_STEP_AT_PAD_M)))
}

/// Says where the nearest level ground is, seen from `place`.
fn level_place_hint(place: &Flat, is_level: impl Fn(&Flat) -> bool) -> String {
    let aside = |ring: usize, direction: usize| {
        let turned = std::f32::consts::TAU * direction as f32 / PLACE_SEARCH_DIRECTIONS as f32;
        let aside = Flat::new(turned.cos(), turned.sin()) * (ring as f32 * PLACE_SEARCH_STEP_M);
        // As precise as the hint states it.
        aside.map(|m| (m * 10.0).round() / 10.0)
    };
    let mut places = (1..=PLACE_SEARCH_STEPS)
        .flat_map(|ring| (0..PLACE_SEARCH_DIRECTIONS).map(move |k| aside(ring, k)));
    match places.find(|aside| is_level(&(place + aside))) {
        Some(aside) => {
            let [east_m, north_m] = [aside.x, aside.y];
            format!("move it by {east_m:.1} m east and {north_m:.1} m north: there is none")
        }
        None => "a vehicle over its pad may touch it: choose level ground".to_owned(),
    }
}
