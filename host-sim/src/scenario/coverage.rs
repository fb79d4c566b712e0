//! What `[area]` says: the scenario of a coverage mission.

pub use companion::storage::mission_file::coverage::Heading;
use planner_core::coverage::area::{Ring, RingKind};
use planner_core::coverage::footprint::{Camera, Spacing};
use planner_core::coverage::{Flat, pack::Heights};
pub use planner_core::flight::Trigger;
use planner_core::frames::Geodetic;

/// `[area]`
#[derive(Clone, Debug)]
pub struct Area {
    /// Where the table or its file stands, as `FILE:LINE`.
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
    /// The same with what of a picture is planned with.
    pub usable: Spacing,
    /// Height of the pictures, and of the layers.
    pub heights: Heights,
    /// Direction of the lanes, where it is given: degrees from east to the left.
    pub angle_deg: Option<f32>,
    /// Lanes begin and end so far beyond the edge.
    pub margin_m: f32,
    /// Whether a route may take more than one battery.
    pub batteries: bool,
    /// How work is divided.
    pub method: Method,
    /// Where vehicles look.
    pub heading: Heading,
    /// What takes the pictures.
    pub trigger: Trigger,
}

impl Area {
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

    /// Its name in results.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, method)| *method == self).map_or("", |(name, _)| name)
    }
}
