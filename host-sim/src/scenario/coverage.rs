//! The `[area]` table of a scenario, as read: what a coverage mission photographs, and how.

use std::sync::Arc;

pub use companion::storage::mission_file::coverage::HeadingRule;
use planner_core::coverage::area::{Ring, RingKind};
use planner_core::coverage::footprint::{Camera, Spacing};
use planner_core::coverage::{Flat, pack::Heights};
use planner_core::file::FileError;
pub use planner_core::flight::Trigger;
use planner_core::geo::frames::Geodetic;
use planner_core::map::field::FieldView;
use planner_core::map::field::follow::TerrainFollowing;

use crate::coverage::obstacles::MapObstacles;
use crate::terrain::HeightGrid;

/// Hint of an error about a vehicle whose start is not on the ground.
pub const ORIGIN_HINT: &str = "area.origin = { lat_deg = …, lon_deg = …, alt_m = … } says how high the ground is; a start's alt_m counts from \
     sea level too";

/// `[area]`: the area of a coverage mission, and how it is photographed.
#[derive(Clone, Debug)]
pub struct AreaSection {
    /// Where the area stands in the scenario, for error messages, as `FILE:LINE`.
    pub file_line: String,
    /// Vertices of all rings, one ring after the other, metres east and north of the origin.
    pub vertices: Vec<Flat>,
    /// Kind of each ring, and where its vertices end.
    pub rings: Vec<Ring>,
    /// Number of no-fly zones that the scenario and its area file give. In `rings` the zones around
    /// the map's obstacles come after these.
    pub given_no_fly_zones: usize,
    /// Origin of the mission frame.
    pub origin: Geodetic,
    /// The camera; `None` if `lane_m` and `waypoint_m` are given instead.
    pub camera: Option<Camera>,
    /// Footprint of a picture, and distances of lanes and waypoints, metres.
    pub spacing: Spacing,
    /// `spacing` with its footprint reduced to the part that the plan counts on despite flight
    /// errors.
    pub usable_spacing: Spacing,
    /// Height of the pictures, metres: above the ground with terrain, else above the origin.
    pub picture_height_m: f32,
    /// Greatest height of the pictures above the origin, and distance between transit layers,
    /// metres.
    pub heights: Heights,
    /// Heights of the ground; `None` over level ground.
    pub terrain: Option<Terrain>,
    /// Obstacles of `[map]`, around which `rings` has no-fly zones; `None` without a map.
    pub obstacles: Option<Arc<MapObstacles>>,
    /// Direction of the lanes, degrees counter-clockwise from east; `None`: the plan chooses it.
    pub lane_angle_deg: Option<f32>,
    /// How far beyond the area's edge lanes begin and end, metres.
    pub border_overshoot_m: f32,
    /// Whether a route may take more than one battery.
    pub allows_battery_swaps: bool,
    /// How the work is divided among the vehicles.
    pub method: CoverageMethod,
    /// Heading of the vehicles on the lanes.
    pub heading: HeadingRule,
    /// What triggers the camera.
    pub trigger: Trigger,
}

/// Heights of the ground below an area, and how vehicles follow them.
#[derive(Clone, Debug)]
pub struct Terrain {
    /// Heights of the ground, metres above the mission's origin.
    pub grid: Arc<HeightGrid>,
    /// Bytes of the height field that vehicles follow (`field.bin`).
    pub field_file: Arc<[u8]>,
    /// How far vehicles may fly higher above the field than [`AreaSection::picture_height_m`],
    /// metres.
    pub tolerance_m: f32,
    /// Steepest slope that vehicles fly, metres of height for each metre over ground.
    pub max_slope: f32,
}

impl Terrain {
    /// The surface that paths follow at this height above the ground, metres.
    ///
    /// # Errors
    /// The field's bytes are malformed.
    pub fn following(&self, height_m: f32) -> Result<TerrainFollowing<'_>, FileError> {
        let field = FieldView::parse(&self.field_file)?;
        Ok(TerrainFollowing {
            field,
            min_height_m: height_m,
            tolerance_m: self.tolerance_m,
            max_slope: self.max_slope,
        })
    }
}

impl AreaSection {
    /// Height of the ground at a place, metres above the origin; 0 without terrain and outside its
    /// map.
    pub fn ground_height_m(&self, place: &Flat) -> f32 {
        self.terrain.as_ref().and_then(|terrain| terrain.grid.height_at(place)).unwrap_or(0.0)
    }

    /// Vertices of the rings of one kind.
    pub fn rings_of(&self, kind: RingKind) -> impl Iterator<Item = &[Flat]> {
        let starts = std::iter::once(0).chain(self.rings.iter().map(|ring| usize::from(ring.end)));
        let rings = self.rings.iter().zip(starts).filter(move |(ring, _)| ring.kind == kind);
        rings.map(|(ring, start)| &self.vertices[start..usize::from(ring.end)])
    }
}

/// How the work is divided among the vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CoverageMethod {
    /// Whole lanes, divided in proportion to the vehicles' weights (SIMPLE-BINPAT).
    SimpleBinpat,
    /// Waypoints, divided in proportion to the vehicles' weights (BINPAT).
    Binpat,
    /// Waypoints, divided in the proportions that Powell's method finds best (POWELL-BINPAT).
    #[default]
    PowellBinpat,
    /// The division into contiguous parts whose greatest cost is the least possible.
    Exact,
}

impl CoverageMethod {
    /// Every method by its name.
    pub const NAMES: [(&str, Self); 6] = [
        ("powell-binpat", Self::PowellBinpat),
        ("powell", Self::PowellBinpat),
        ("binpat", Self::Binpat),
        ("simple-binpat", Self::SimpleBinpat),
        ("simple", Self::SimpleBinpat),
        ("exact", Self::Exact),
    ];

    /// The method of this name.
    ///
    /// # Errors
    /// No method has this name; the text lists all names.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::NAMES.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, method)| *method)
            .ok_or_else(|| "must be one of simple-binpat, binpat, powell-binpat, exact".to_owned())
    }

    /// Name of the method in results, the first of its names.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, method)| *method == self).map_or("", |(name, _)| name)
    }
}
