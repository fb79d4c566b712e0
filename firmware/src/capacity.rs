//! Capacities of a board, and the RAM (or flash) that each item takes. The RP2350 has 520 kB of
//! RAM, so most capacities are halved there.

use companion::Companion;

/// `of`, or half of it on the Pico 2.
const fn halved_on_small_board(of: usize) -> usize {
    if cfg!(feature = "pico2") { of / 2 } else { of }
}

/// Most nodes of a roadmap, starts and goals included: 70 bytes each in the planning workspace.
pub const ROADMAP_NODES: usize = halved_on_small_board(4096);
/// Most half-edges of a roadmap (two per edge): 4 bytes each in flash, and 8 bytes for each edge
/// while a roadmap is built on board.
pub const HALF_EDGES: usize = halved_on_small_board(65_536);
/// Most cubes of the grid that sorts nodes by place while a roadmap is built: 2 bytes each. Enough
/// for 100 × 100 × 50 m at a longest edge (Dmax) of 8 m.
pub const ROADMAP_CUBES: usize = halved_on_small_board(8192);
/// Most vehicles of a swarm, and most goals: 1.7 kB for each vehicle, mainly in the swarm's plan.
pub const VEHICLES: usize = halved_on_small_board(32);
/// Most waypoints of a path: 24 bytes each.
pub const WAYPOINTS: usize = 64;
/// Most gates in one vehicle's plan: 12 bytes each.
pub const GATES: usize = 128;
/// Most timed segments of flights already scheduled, among which safe-interval search finds a
/// vehicle's route: 44 bytes each.
pub const TIMED_SEGMENTS: usize = halved_on_small_board(2048);
/// Most lanes of a coverage mission: 72 bytes each in the workspace, for the whole plan and for the
/// lanes left after a loss together.
pub const LANES: usize = halved_on_small_board(512);
/// Most vertices of a coverage mission's area: 36 bytes each in the workspace.
pub const AREA_VERTICES: usize = 256;
/// Most convex corners of a coverage mission's no-fly zones, around which transits lead: 4 bytes
/// for each pair of corners, and 8 for each corner.
pub const NO_FLY_CORNERS: usize = 32;

/// A companion with this board's capacities.
pub type BoardCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;
