//! Coverage: a fleet photographs an area in the least time, each vehicle on one unbroken route.
//!
//! Source: CPP (Luna 2022). One algorithm a file:
//!
//! | file | is |
//! |---|---|
//! | `footprint.rs` | what a camera sees; spacing of lanes and waypoints (CPP eqs. 1, 2) |
//! | `area.rs` | polygons, checked |
//! | `sweep.rs` | the direction of the lanes: least width, rotating calipers |
//! | `tracks.rs` | back-and-forth lanes over concave areas, holes and no-fly zones: `strips.rs` lays them, `lanes.rs` holds them |
//! | `patches.rs` | more lanes where a no-fly zone covers a lane and not what it should photograph |
//! | `cells.rs` | lanes in cells that are flown back and forth: a first order |
//! | `order.rs` | the order and the directions in which lanes are flown |
//! | `transit.rs` | shortest ways around no-fly zones |
//! | `around.rs` | the path home, or aside, of a vehicle that leaves its route |
//! | `pack.rs` | CBinPack, SIMPLE-BINPAT and BINPAT: routes, vehicles, layers, costs |
//! | `powell.rs` | POWELL-BINPAT: the shares that make the largest cost least |
//! | `exact.rs` | the least largest cost of all contiguous divisions |
//! | `bound.rs` | a lower bound on it |
//! | `flights.rs` | routes as flights of the swarm: paths, pictures, order |
//! | `divide.rs` | what is left after a loss, as a path of its own |
//! | `losses.rs` | that divided among those that fly on, as flights from where they hold |
//!
//! Places are metres, east and north, in the mission frame: [`Flat`]. A lane is two points; its
//! waypoints follow from lane and index and are not stored.

pub mod area;
pub mod around;
pub mod bound;
mod cells;
pub mod divide;
pub mod exact;
mod flat;
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

pub use self::flat::Flat;

/// Reason why there is no coverage plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CoverageError {
    /// The area is not one: see [`area::AreaError`].
    Area(area::AreaError),
    /// The setting of this name is outside its range.
    Setting(&'static str),
    /// Lanes further apart than a footprint is wide, or waypoints further than it is long, leave
    /// gaps.
    Gaps,
    /// The path has more lanes, or more pieces of one lane, than the memory holds.
    LanesFull,
    /// The no-fly zones have more corners than the memory holds.
    NoFlyFull,
    /// No lane is left: the no-fly zones hold the whole area.
    NothingToCover,
    /// A vehicle's place is inside a no-fly zone: its index.
    InsideNoFly(u8),
    /// No way leads to a lane: no-fly zones close it in.
    Unreachable,
    /// The fleet has no vehicles, or more than the memory holds.
    Vehicles,
    /// The memory lent is too small.
    WorkspaceTooSmall,
}

impl From<area::AreaError> for CoverageError {
    fn from(error: area::AreaError) -> Self {
        Self::Area(error)
    }
}
