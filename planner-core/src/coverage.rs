//! Coverage: a fleet photographs an area in the least time; each vehicle flies one continuous
//! route.
//!
//! Source: paper CPP (Luna 2022). One algorithm per file:
//!
//! | file | is |
//! |---|---|
//! | `footprint.rs` | ground that an image shows; spacing of lanes and waypoints (CPP eqs. 1, 2) |
//! | `area.rs` | checked polygons: the area and its no-fly zones |
//! | `sweep.rs` | the direction of the lanes: least width, rotating calipers |
//! | `tracks.rs` | back-and-forth lanes, also over concave areas, holes and no-fly zones |
//! | `strips.rs`, `lanes.rs` | the area cut into strips, with a lane along each; lanes as a path |
//! | `patches.rs` | extra lanes for ground that a no-fly zone keeps the lanes from photographing |
//! | `cells.rs` | lanes grouped into cells that are flown back and forth: an initial order |
//! | `order.rs` | the order and the directions in which lanes are flown |
//! | `given.rs` | lanes that another tool has laid, ordered by the same search |
//! | `transit.rs` | shortest paths around no-fly zones |
//! | `around.rs` | the path of a vehicle that leaves its route: home, or around an obstacle |
//! | `pack.rs` | CBinPack, SIMPLE-BINPAT and BINPAT: routes, vehicles, layers, costs |
//! | `powell.rs` | POWELL-BINPAT: the shares that make the largest cost least |
//! | `exact.rs` | the division into contiguous routes whose largest cost is least |
//! | `bound.rs` | a lower bound on that cost |
//! | `flights.rs` | routes as flights of the swarm: paths, pictures, order |
//! | `divide.rs` | the lanes left after the loss of a vehicle, as a path of their own |
//! | `losses.rs` | these lanes divided among the remaining vehicles, each from where it holds |
//!
//! Points are metres east and north in the mission frame: [`Flat`]. A lane is two points; its
//! waypoints are computed from lane and index, not stored.

pub mod area;
pub mod around;
pub mod bound;
mod cells;
pub mod divide;
pub mod exact;
pub mod flights;
pub mod footprint;
pub mod given;
mod intervals;
mod lanes;
pub mod losses;
pub mod order;
pub mod pack;
mod patches;
pub mod powell;
mod strips;
pub mod sweep;
pub mod tracks;
pub mod transit;

pub use crate::geo::Flat;

/// Reason why a coverage plan could not be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CoverageError {
    /// The polygon is invalid: see [`area::AreaError`].
    Area(area::AreaError),
    /// The setting with this name is outside its range.
    SettingOutOfRange(&'static str),
    /// Lanes are further apart than an image is wide, or waypoints further than an image is long,
    /// so that ground between images is missed.
    Gaps,
    /// There are more lanes or strips, more intervals along one line, or more ranges of
    /// photographed waypoints than the memory holds.
    LanesFull,
    /// The no-fly zones have more convex corners than the memory holds.
    NoFlyFull,
    /// There is no lane: the no-fly zones cover the whole area, no waypoint is left to photograph,
    /// or no given lane has a length.
    NothingToCover,
    /// The vehicle with this index is inside a no-fly zone.
    InsideNoFly(u8),
    /// No path around the no-fly zones leads to some lane, or home from it.
    Unreachable,
    /// The fleet has no vehicles, or more than the memory holds; or routes, pads or statuses do not
    /// match the vehicles.
    Vehicles,
    /// The workspace that the caller lends is too small.
    WorkspaceTooSmall,
}

impl From<area::AreaError> for CoverageError {
    fn from(error: area::AreaError) -> Self {
        Self::Area(error)
    }
}
