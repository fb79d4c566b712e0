//! Capacities of a board, and what each costs in RAM. The RP2350 has half a megabyte in all, so it
//! takes half.

use companion::Companion;

/// Half on the smaller board.
const fn halved_on_small_board(of: usize) -> usize {
    if cfg!(feature = "pico2") { of / 2 } else { of }
}

/// Nodes of a roadmap, terminals among them: 70 bytes each in scratch.
pub const ROADMAP_NODES: usize = halved_on_small_board(4096);
/// Half-edges of a roadmap: 4 bytes each, in flash; 8 bytes for each pair of them while a roadmap
/// is built on board.
pub const HALF_EDGES: usize = halved_on_small_board(65_536);
/// Cubes the nodes are sorted into while a roadmap is built: 2 bytes each. Enough for 100 × 100 ×
/// 50 m at Dmax 8 m.
pub const ROADMAP_CUBES: usize = halved_on_small_board(8192);
/// Vehicles of a swarm, and goals: 1.7 kB each, the most of it in the swarm's plan.
pub const VEHICLES: usize = halved_on_small_board(32);
/// Waypoints of a path: 24 bytes each.
pub const WAYPOINTS: usize = 64;
/// Gates of one vehicle: 12 bytes each.
pub const GATES: usize = 128;
/// Timed segments of flights among which a vehicle steps aside: 44 bytes each.
pub const TIMED_SEGMENTS: usize = halved_on_small_board(2048);
/// Lanes of a coverage mission: 72 bytes each in scratch, in all and in what is left of them.
pub const LANES: usize = halved_on_small_board(512);
/// Vertices of a coverage mission's area: 36 bytes each in scratch.
pub const AREA_VERTICES: usize = 256;
/// Outward corners of that area's no-fly zones: 4 bytes for each pair, and 8 each.
pub const AREA_CORNERS: usize = 32;

/// A companion with these.
pub type BoardCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;
