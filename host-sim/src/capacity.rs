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
/// Pieces of flights among which a vehicle steps aside: 44 bytes each.
pub const PIECES: usize = 32_768;

/// A large value on the heap. Debug builds make it on a stack first, so a thread with room for that makes it.
pub fn on_heap<T: Send + 'static>(make: fn() -> T) -> Box<T> {
    std::thread::Builder::new()
        .stack_size(4 * size_of::<T>() + (1 << 20))
        .spawn(move || Box::new(make()))
        .expect("the system starts threads")
        .join()
        .expect("making zeros does not panic")
}
