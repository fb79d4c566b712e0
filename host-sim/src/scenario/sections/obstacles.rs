//! Reads `[map]` beside `[area]`: its obstacles become no-fly zones.

use std::path::Path;
use std::sync::Arc;

use companion::margins::CRUISE_TRACKING_ERROR_M;
use planner_core::coverage::area::{self, Ring, RingKind};
use planner_core::geo::frames::Geodetic;

use super::checks::VehicleSpans;
use super::{DEFAULT_ORIGIN, read_map};
use crate::coverage::MAX_NO_FLY_CORNERS;
use crate::coverage::obstacles::{MapObstacles, TooManyCorners};
use crate::map::{self, UnknownSpace};
use crate::margins;
use crate::scenario::coverage::AreaSection;
use crate::scenario::reader::{Result, Table, TomlSpan, TomlText};
use crate::scenario::{Deconfliction, MapSection, RoadmapSection, Simulation, VehicleSection};

/// The map that stands beside an area, not yet read.
pub(super) struct MapBesideArea {
    map: MapSection,
    /// Where `map.file` stands, for errors.
    span: TomlSpan,
    /// Whether the scenario gives `map.origin`.
    has_origin: bool,
}

/// Settings of the scenario on which the distance between paths and obstacles depends.
pub(super) struct FlightSettings<'a> {
    pub(super) vehicles: &'a [VehicleSection],
    /// Where the keys of `vehicles` stand, in the same order.
    pub(super) spans: &'a [VehicleSpans],
    pub(super) simulation: &'a Simulation,
    pub(super) deconfliction: &'a Deconfliction,
    pub(super) roadmap: &'a RoadmapSection,
}

impl MapBesideArea {
    /// Reads `[map]`, if the scenario has one. Unknown space counts as free unless `map.unknown` is
    /// given.
    pub(super) fn from_root(root: &Table<'_>, folder: &Path) -> Result<Option<Self>> {
        let Some(value) = root.get("map") else { return Ok(None) };
        let table = value.table()?;
        let (mut map, has_origin) = read_map(&table, folder)?;
        if table.get("unknown").is_none() {
            map.unknown = UnknownSpace::Free;
        }
        let span = table.get("file").map_or(value.span, |file| file.span);
        Ok(Some(Self { map, span, has_origin }))
    }

    /// The map's origin, if it is given.
    pub(super) fn origin(&self) -> Option<Geodetic> {
        self.has_origin.then_some(self.map.origin)
    }

    /// Refuses a map whose origin is not the mission's, or is missing while the area has one.
    fn check_origin(&self, text: TomlText<'_>, origin: &Geodetic) -> Result<()> {
        let same = self.map.origin == *origin;
        let why = match (self.has_origin, same) {
            (true, true) => return Ok(()),
            (true, false) => "map.origin is not area.origin",
            // Neither the area nor the map has an origin: both are in metres about the default one.
            (false, _) if *origin == DEFAULT_ORIGIN => return Ok(()),
            (false, _) => "map.origin is missing",
        };
        let Geodetic { lat_deg, lon_deg, alt_m } = origin;
        let hint = format!(
            "the map is in the area's frame: `origin = {{ lat_deg = {lat_deg}, \
             lon_deg = {lon_deg}, \
             alt_m = {alt_m} }}` in [map] says so; without area.origin, map.origin is that of both"
        );
        Err(text.error_with_hint(&self.span, why, hint))
    }

    /// Reads the map, and adds its obstacles to the area as no-fly zones.
    pub(super) fn add_no_fly_zones(
        &self,
        text: TomlText<'_>,
        area: &mut AreaSection,
        flown: &FlightSettings<'_>,
    ) -> Result<()> {
        self.check_origin(text, &area.origin)?;
        if area.terrain.is_some() {
            let hint = "leave out [map], or area.terrain where the ground is level";
            return Err(text.error_with_hint(
                &self.span,
                "[map] beside area.terrain: not yet",
                hint,
            ));
        }
        let map = map::load(&self.map.file, self.map.resolution_m)
            .map_err(|error| text.error(&self.span, format!("map.file: {error}")))?;
        let clearance_m = flown.clearance_m();
        let obstacles = MapObstacles::new(&map, self.map.unknown, clearance_m);
        drop(map);
        flown.check_climbs(text, &obstacles)?;
        let below_m = flown.clearance_below_m().max(clearance_m);
        let floor_m = area.heights.max_picture_height_m - below_m;
        // Lanes extend beyond the border by the overshoot, and lie up to half a picture beside it.
        let beyond_m = area.border_overshoot_m + area.spacing.footprint.across_m / 2.0;
        let pads = flown.vehicles.iter().map(|vehicle| vehicle.start.xy());
        let places: Vec<_> = area.vertices.iter().copied().chain(pads).collect();
        let own = area.rings_of(RingKind::NoFly).map(<[_]>::len).sum();
        let zones = obstacles.no_fly_zones(floor_m, (&places, beyond_m), own, MAX_NO_FLY_CORNERS);
        let zones = zones.map_err(|TooManyCorners(corners)| {
            let why = format!(
                "map.file: no-fly zones have {corners} corners with those around the map's \
                 obstacles; at most {MAX_NO_FLY_CORNERS} can be used"
            );
            let hint = "a larger map.resolution_m or a greater area.height_m makes fewer";
            text.error_with_hint(&self.span, why, hint)
        })?;
        for zone in zones {
            area.vertices.extend(zone);
            area.rings.push(Ring { end: area.vertices.len() as u16, kind: RingKind::NoFly });
        }
        area.obstacles = Some(Arc::new(obstacles));
        area::Area::new(&area.vertices, &area.rings).map(drop).map_err(|error| {
            text.error(&self.span, format!("map.file: no area with its zones: {error:?}"))
        })
    }
}

impl FlightSettings<'_> {
    /// Horizontal distance between paths and obstacles, metres: the largest radius, plus how far
    /// companions let a vehicle deviate from its path in a coverage mission, at least the margin to
    /// walls and the roadmap's safety margin.
    fn clearance_m(&self) -> f32 {
        let Deconfliction { separation_m, safety_distance_m, .. } = *self.deconfliction;
        let walls_m =
            margins::required_distances(self.simulation, 0.0, self.vehicles).wall_margin_m;
        let margin_m = (separation_m - safety_distance_m) / 2.0;
        self.largest_radius_m() + margin_m.max(walls_m).max(self.roadmap.safety_margin_m)
    }

    /// Height that a path keeps above obstacles below it, metres.
    fn clearance_below_m(&self) -> f32 {
        let lower_m = |vehicle: &VehicleSection| {
            margins::max_height_error_m(self.simulation.estimator, vehicle.autopilot)
        };
        let lower_m = self.vehicles.iter().map(lower_m).fold(0.0, f32::max);
        self.largest_radius_m() + CRUISE_TRACKING_ERROR_M + lower_m
    }

    /// Greatest radius of a vehicle, metres.
    fn largest_radius_m(&self) -> f32 {
        self.vehicles.iter().map(|vehicle| vehicle.radius_m).fold(0.0, f32::max)
    }

    /// Refuses a pad beside or below an obstacle.
    fn check_climbs(&self, text: TomlText<'_>, obstacles: &MapObstacles) -> Result<()> {
        for (vehicle, spans) in self.vehicles.iter().zip(self.spans) {
            let mut hull = vehicle.start;
            hull.z += vehicle.radius_m;
            let Some(near_m) = obstacles.too_near_climb_obstacle_m(&hull) else { continue };
            let why = format!(
                "vehicle {} starts {near_m:.2} m from an obstacle of the map; \
                 its climb needs {:.2} m",
                vehicle.id, obstacles.required_clearance_m
            );
            let hint =
                "a start further away; the map's ground must be at the height of the ground here";
            return Err(text.error_with_hint(&spans.start, why, hint));
        }
        Ok(())
    }
}
