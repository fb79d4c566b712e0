//! Capacities of companions and planner on the host, with the memory each entry costs; capacities
//! of each board.

use companion::storage::mission_file::MissionView;
use companion::storage::store::FlashLayout;
use companion::storage::store::flash_area::DATA_OFFSET;
use companion::{Companion, Config};
use planner_core::roadmap::RoadmapView;

/// Most nodes of a roadmap, starts and goals among them: 30 bytes each in the search workspace.
pub const MAX_ROADMAP_NODES: usize = 16_384;
/// Most cubes of the grid into which nodes are sorted while a roadmap is built: 2 bytes each.
/// Enough for 250 × 250 × 100 m with edges of at most 8 m.
pub const MAX_ROADMAP_CUBES: usize = 1 << 17;
/// Most vehicles, and most goals: 4 bytes for each pair of vehicle and goal, 1.6 kB for each path.
pub const MAX_VEHICLES: usize = 256;
/// Most waypoints of a path: 24 bytes each.
pub const MAX_WAYPOINTS: usize = 64;
/// Most gates of one vehicle: 12 bytes each.
pub const MAX_GATES: usize = 2048;
/// Most timed segments of all scheduled flights; the search for a side-step (SIPP) plans around
/// them: 44 bytes each.
pub const MAX_TIMED_SEGMENTS: usize = 32_768;

/// Most keep-out zones of a detour: 32 bytes each.
pub const MAX_ZONES: usize = 32 * MAX_VEHICLES;

/// A companion with the host's capacities.
pub type HostCompanion = Companion<MAX_VEHICLES, MAX_WAYPOINTS, MAX_GATES>;

/// A companion on the heap: it is too large for a thread's stack.
///
/// # Errors
/// The companion refuses the configuration; the error names what is wrong.
pub fn new_companion(config: Config<MAX_VEHICLES>) -> anyhow::Result<Box<HostCompanion>> {
    let companion = HostCompanion::new(config)
        .map_err(|e| anyhow::anyhow!("no companion can fly this: {e:?}"))?;
    Ok(Box::new(companion))
}

/// Capacities of the firmware of one board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardCapacity {
    /// Name of the board, as `cargo xtask build --board` takes it.
    pub name: &'static str,
    /// Most nodes of a roadmap.
    pub nodes: usize,
    /// Most half-edges of a roadmap: two for each edge.
    pub half_edges: usize,
    /// Most vehicles of a mission, and most goals.
    pub vehicles: usize,
    /// Most gates of one vehicle.
    pub gates: usize,
    /// Most timed segments of all flights in a schedule.
    pub timed_segments: usize,
    /// Most bytes of a roadmap file.
    pub roadmap_bytes: usize,
    /// Most vertices of an area, over all its rings.
    pub vertices: usize,
    /// Most lanes over an area.
    pub lanes: usize,
}

/// Most convex corners of all no-fly zones of an area together; the same on every board.
pub const BOARD_NO_FLY_CORNERS: usize = 32;

/// Most bytes of a roadmap file that a slot of this flash holds.
const fn max_roadmap_file_len(layout: &FlashLayout) -> usize {
    (layout.slot_len - DATA_OFFSET) as usize
}

/// Capacities of the STM32H743 board, the default.
pub const NUCLEO_H743: BoardCapacity = BoardCapacity {
    name: "nucleo-h743",
    nodes: 4096,
    half_edges: 65_536,
    vehicles: 32,
    gates: 128,
    timed_segments: 2048,
    roadmap_bytes: max_roadmap_file_len(&FlashLayout::H743),
    vertices: 256,
    lanes: 512,
};

/// Capacities of the Pico 2 (RP2350), which has half the memory of the STM32H743.
pub const PICO2: BoardCapacity = BoardCapacity {
    name: "pico2",
    nodes: 2048,
    half_edges: 32_768,
    vehicles: 16,
    timed_segments: 1024,
    roadmap_bytes: max_roadmap_file_len(&FlashLayout::PICO2),
    lanes: 256,
    ..NUCLEO_H743
};

/// All boards; no other exceeds a capacity of the first.
pub const BOARDS: [BoardCapacity; 3] =
    [NUCLEO_H743, BoardCapacity { name: "qemu", ..NUCLEO_H743 }, PICO2];

impl BoardCapacity {
    /// The board of this name.
    ///
    /// # Errors
    /// No board has this name; the error lists the names.
    pub fn by_name(name: &str) -> Result<&'static Self, String> {
        let names = || BOARDS.map(|board| board.name).join(", ");
        BOARDS
            .iter()
            .find(|board| board.name == name)
            .ok_or_else(|| format!("boards are {}", names()))
    }

    /// Text about the first capacity of the board that a roadmap exceeds; `None` if it fits.
    pub fn roadmap_excess(&self, roadmap: &RoadmapView<'_>) -> Option<String> {
        self.first_excess(&[
            ("nodes", roadmap.node_count(), self.nodes),
            ("half-edges", roadmap.half_edge_count(), self.half_edges),
            ("bytes of roadmap", roadmap.byte_len(), self.roadmap_bytes),
        ])
    }

    /// Text about the first capacity of the board that an area exceeds; `None` if it fits.
    pub fn area_excess(&self, vertices: usize, lanes: usize) -> Option<String> {
        self.first_excess(&[("vertices", vertices, self.vertices), ("lanes", lanes, self.lanes)])
    }

    /// Text about the first capacity of the board that a mission file exceeds; `None` if it fits.
    pub fn mission_excess(&self, mission: &MissionView<'_>) -> Option<String> {
        self.first_excess(&[
            ("vehicles", mission.vehicles().len(), self.vehicles),
            ("goals", mission.goals().len(), self.vehicles),
        ])
    }

    /// Text saying that one vehicle's plan has more gates than the board holds; `None` if it fits.
    pub fn gates_excess(&self, gates: usize) -> Option<String> {
        self.first_excess(&[("gates of one vehicle", gates, self.gates)])
    }

    /// Text about the first of `limits` that is exceeded: what is counted, its count, and the most
    /// that the board holds.
    fn first_excess(&self, limits: &[(&str, usize, usize)]) -> Option<String> {
        let over = limits.iter().find(|(_, count, most)| count > most);
        over.map(|(what, count, most)| format!("{count} {what}, {} holds {most}", self.name))
    }
}

/// Makes a large value on the heap. Debug builds first place the value on the stack, so a thread
/// with a large enough stack makes it.
pub fn on_heap<T: Send + 'static>(make: fn() -> T) -> Box<T> {
    std::thread::Builder::new()
        .stack_size(4 * size_of::<T>() + (1 << 20))
        .spawn(move || Box::new(make()))
        .expect("the system starts threads")
        .join()
        .expect("making zeros does not panic")
}
