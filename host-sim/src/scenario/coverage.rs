//! What `[area]` says: the scenario of a coverage mission.

use std::sync::Arc;

pub use companion::storage::mission_file::coverage::HeadingRule;
use planner_core::coverage::area::{Ring, RingKind};
use planner_core::coverage::footprint::{Camera, Spacing};
use planner_core::coverage::{Flat, pack::Heights};
use planner_core::field::FieldView;
use planner_core::field::follow::TerrainFollowing;
use planner_core::file::FileError;
pub use planner_core::flight::Trigger;
use planner_core::frames::Geodetic;

use crate::terrain::HeightGrid;

/// Hint of an error about a vehicle that does not stand on the ground.
pub const ORIGIN_HINT: &str =
    "area.origin = { lat_deg = …, lon_deg = …, alt_m = … } says how high the ground is";

/// `[area]`
#[derive(Clone, Debug)]
pub struct Area {
    /// Source of the area for error messages, as `FILE:LINE`.
    pub place: String,
    /// Vertices of all rings, metres east and north of the origin.
    pub vertices: Vec<Flat>,
    /// The rings.
    pub rings: Vec<Ring>,
    /// The mission's origin.
    pub origin: Geodetic,
    /// The camera, where one is given.
    pub camera: Option<Camera>,
    /// Footprint and spacings.
    pub spacing: Spacing,
    /// Spacing with the part of a picture that the plan counts on.
    pub usable: Spacing,
    /// Height of the pictures above the origin, or above the ground.
    pub height_m: f32,
    /// The greatest height of the pictures, and of the layers over that.
    pub heights: Heights,
    /// The ground, where it is not level.
    pub terrain: Option<Terrain>,
    /// Direction of the lanes, where it is given: degrees from east to the left.
    pub angle_deg: Option<f32>,
    /// Lanes begin and end so far beyond the edge.
    pub margin_m: f32,
    /// Whether a route may take more than one battery.
    pub batteries: bool,
    /// How work is divided.
    pub method: Method,
    /// Heading of the vehicles.
    pub heading: HeadingRule,
    /// Trigger of the pictures.
    pub trigger: Trigger,
}

/// The ground below an area.
#[derive(Clone, Debug)]
pub struct Terrain {
    /// Heights of the terrain, metres above the mission's origin.
    pub grid: Arc<HeightGrid>,
    /// Bytes of the field that vehicles follow.
    pub field: Arc<[u8]>,
    /// Vehicles fly at most so much higher above the field than [`Area::height_m`], metres.
    pub tolerance_m: f32,
    /// Metres up or down for each metre over ground, at most.
    pub slope: f32,
}

impl Terrain {
    /// Surface that paths follow at this height above the ground.
    ///
    /// # Errors
    /// The bytes are no field.
    pub fn following(&self, height_m: f32) -> Result<TerrainFollowing<'_>, FileError> {
        let field = FieldView::parse(&self.field)?;
        Ok(TerrainFollowing { field, height_m, tolerance_m: self.tolerance_m, slope: self.slope })
    }
}

impl Area {
    /// The ground at a place, metres above the origin: level ground where there is no terrain, and
    /// beyond its map.
    pub fn ground_m(&self, place: &Flat) -> f32 {
        self.terrain.as_ref().and_then(|terrain| terrain.grid.height_at(place)).unwrap_or(0.0)
    }

    /// Vertices of the rings of one kind.
    pub fn rings_of(&self, kind: RingKind) -> impl Iterator<Item = &[Flat]> {
        let starts = std::iter::once(0).chain(self.rings.iter().map(|ring| usize::from(ring.end)));
        let rings = self.rings.iter().zip(starts).filter(move |(ring, _)| ring.kind == kind);
        rings.map(|(ring, start)| &self.vertices[start..usize::from(ring.end)])
    }
}

/// How work is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Whole lanes.
    SimpleBinpat,
    /// Waypoints.
    Binpat,
    /// Waypoints, by the best shares.
    #[default]
    PowellBinpat,
    /// The best contiguous division there is.
    Exact,
}

impl Method {
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
    /// There is none; all names.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::NAMES.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, method)| *method)
            .ok_or_else(|| "must be one of simple-binpat, binpat, powell-binpat, exact".to_owned())
    }

    /// Name of the method in results.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, method)| *method == self).map_or("", |(name, _)| name)
    }
}
