//! Capacities of the desk's swarm, and what each costs. A board chooses its own.

/// Nodes of a roadmap, terminals among them: 30 bytes each in scratch.
pub const ROADMAP_NODES: usize = 16_384;
/// Cubes the nodes are sorted into while a roadmap is built: 2 bytes each. Enough for 250 × 250 × 100 m at Dmax 8 m.
pub const ROADMAP_CUBES: usize = 1 << 17;
/// Vehicles of a swarm, and goals: 4 bytes for each pair, 1.6 kB for each path.
pub const VEHICLES: usize = 256;
/// Waypoints of a path: 24 bytes each.
pub const WAYPOINTS: usize = 64;
/// Gates of one vehicle: 12 bytes each.
pub const GATES: usize = 2048;
