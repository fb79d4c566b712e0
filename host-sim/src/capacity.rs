//! Capacities of the desk's swarm, and what each costs. A board chooses its own.

/// Nodes of a roadmap, terminals among them: 30 bytes each in scratch.
pub const ROADMAP_NODES: usize = 16_384;
/// Vehicles of a swarm, and goals: 4 bytes for each pair, 1.6 kB for each path.
pub const VEHICLES: usize = 256;
/// Waypoints of a path: 24 bytes each.
pub const WAYPOINTS: usize = 64;
/// Gates of one vehicle: 12 bytes each.
pub const GATES: usize = 2048;
