//! Capacities of the desk's swarm, and what each costs; what each board can hold.

use companion::storage::mission_file::MissionView;
use companion::storage::store::FlashLayout;
use companion::storage::store::area::DATA_OFFSET;
use companion::{Companion, Config};
use planner_core::roadmap::RoadmapView;

/// Nodes of a roadmap, terminals among them: 30 bytes each in scratch.
pub const ROADMAP_NODES: usize = 16_384;
/// Cubes the nodes are sorted into while a roadmap is built: 2 bytes each. Enough for 250 × 250 ×
/// 100 m at Dmax 8 m.
pub const ROADMAP_CUBES: usize = 1 << 17;
/// Vehicles of a swarm, and goals: 4 bytes for each pair, 1.6 kB for each path.
pub const VEHICLES: usize = 256;
/// Waypoints of a path: 24 bytes each.
pub const WAYPOINTS: usize = 64;
/// Gates of one vehicle: 12 bytes each.
pub const GATES: usize = 2048;
/// Timed segments of flights among which a vehicle steps aside: 44 bytes each.
pub const TIMED_SEGMENTS: usize = 32_768;

/// A companion with the desk's capacities.
pub type DeskCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;

/// A companion on the heap: it is too large for a stack.
///
/// # Errors
/// The configuration names what is wrong.
pub fn new_companion(config: Config<VEHICLES>) -> anyhow::Result<Box<DeskCompanion>> {
    let companion = DeskCompanion::new(config)
        .map_err(|e| anyhow::anyhow!("no companion can fly this: {e:?}"))?;
    Ok(Box::new(companion))
}

/// Capacities of a board's firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardCapacity {
    /// Name of the board, as `cargo xtask build --board` takes it.
    pub name: &'static str,
    /// Nodes of a roadmap.
    pub nodes: usize,
    /// Half-edges of a roadmap: two for each edge.
    pub half_edges: usize,
    /// Vehicles of a mission, and goals.
    pub vehicles: usize,
    /// Gates of one vehicle.
    pub gates: usize,
    /// Timed segments among which a vehicle steps aside.
    pub pieces: usize,
    /// Bytes of a roadmap file.
    pub roadmap_bytes: usize,
    /// Vertices of an area.
    pub vertices: usize,
    /// Lanes over it.
    pub lanes: usize,
}

/// Outward corners of an area's no-fly zones that a board holds.
pub const BOARD_CORNERS: usize = 32;

const fn roadmap_bytes(layout: &FlashLayout) -> usize {
    (layout.slot_len - DATA_OFFSET) as usize
}

/// The default board.
pub const NUCLEO_H743: BoardCapacity = BoardCapacity {
    name: "nucleo-h743",
    nodes: 4096,
    half_edges: 65_536,
    vehicles: 32,
    gates: 128,
    pieces: 2048,
    roadmap_bytes: roadmap_bytes(&FlashLayout::H743),
    vertices: 256,
    lanes: 512,
};

/// The smaller board, with half the memory.
pub const HALF: BoardCapacity = BoardCapacity {
    name: "pico2",
    nodes: 2048,
    half_edges: 32_768,
    vehicles: 16,
    pieces: 1024,
    roadmap_bytes: roadmap_bytes(&FlashLayout::PICO2),
    lanes: 256,
    ..NUCLEO_H743
};

/// All boards; the first holds the most.
pub const BOARDS: [BoardCapacity; 3] =
    [NUCLEO_H743, BoardCapacity { name: "qemu", ..NUCLEO_H743 }, HALF];

impl BoardCapacity {
    /// The board of this name.
    ///
    /// # Errors
    /// There is none; the error names those there are.
    pub fn by_name(name: &str) -> Result<&'static Self, String> {
        let names = || BOARDS.map(|board| board.name).join(", ");
        BOARDS
            .iter()
            .find(|board| board.name == name)
            .ok_or_else(|| format!("boards are {}", names()))
    }

    /// The first of the board's limits that a roadmap file exceeds.
    pub fn roadmap_excess(&self, roadmap: &RoadmapView<'_>) -> Option<String> {
        self.first_excess(&[
            ("nodes", roadmap.node_count(), self.nodes),
            ("half-edges", roadmap.half_edge_count(), self.half_edges),
            ("bytes of roadmap", roadmap.byte_len(), self.roadmap_bytes),
        ])
    }

    /// The first of the board's limits that an area exceeds.
    pub fn area_excess(&self, vertices: usize, lanes: usize) -> Option<String> {
        self.first_excess(&[("vertices", vertices, self.vertices), ("lanes", lanes, self.lanes)])
    }

    /// The first of the board's limits that a mission file exceeds.
    pub fn mission_excess(&self, mission: &MissionView<'_>) -> Option<String> {
        self.first_excess(&[
            ("vehicles", mission.vehicles().len(), self.vehicles),
            ("goals", mission.goals().len(), self.vehicles),
        ])
    }

    /// Whether a vehicle's plan has more gates than it holds.
    pub fn gates_excess(&self, gates: usize) -> Option<String> {
        self.first_excess(&[("gates of one vehicle", gates, self.gates)])
    }

    fn first_excess(&self, limits: &[(&str, usize, usize)]) -> Option<String> {
        let over = limits.iter().find(|(_, count, most)| count > most);
        over.map(|(what, count, most)| format!("{count} {what}, {} holds {most}", self.name))
    }
}

/// A large value on the heap. Debug builds make it on a stack first, so a thread with room for that
/// makes it.
pub fn on_heap<T: Send + 'static>(make: fn() -> T) -> Box<T> {
    std::thread::Builder::new()
        .stack_size(4 * size_of::<T>() + (1 << 20))
        .spawn(move || Box::new(make()))
        .expect("the system starts threads")
        .join()
        .expect("making zeros does not panic")
}
