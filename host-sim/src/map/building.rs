//! `builtin:building`: a nine-floor building like that of paper P3D §4, 41 × 24 × 49 m, generated
//! from a seed.
//!
//! The paper states its outer size (its Fig. 8) and that it has many rooms, doors, windows and a
//! stairwell; it has no floor plan. Ours: a corridor along the middle of every floor with rooms on
//! both sides, a stairwell at the west end, an atrium in the middle and a lift shaft at the east
//! end, all three open through every slab between floors. The ground floor is a lobby. The seed
//! places partitions and doors. Doors and shafts are just wide enough that a uniform roadmap of the
//! paper's 2300 nodes reaches every room with 0.8 m of clearance, as the paper's roadmap does, and
//! a roadmap of far fewer nodes does not. All cells are known, free or occupied. The corner of the
//! outer walls is at (0, 0, 0), metres.

use planner_core::Point;
use planner_core::map::voxel::GridShape;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::error::MapError;
use super::occupancy::OccupancyMap;
use super::octree::Occupancy;

/// Outer size along x, y, z, metres.
pub const SIZE_M: [f32; 3] = [41.0, 24.0, 49.0];
/// Number of floors.
pub const FLOORS: u32 = 9;
/// Height from one floor's slab to the next, metres.
pub const FLOOR_HEIGHT_M: f32 = 5.44;
/// Seed of `builtin:building` without `?seed=`.
pub const DEFAULT_SEED: u64 = 1;

/// Thickness of walls, floors and ceilings, metres.
const WALL_THICKNESS_M: f32 = 0.25;
/// Range of the corridor in y between its walls, metres.
const CORRIDOR_Y_M: [f32; 2] = [9.5, 14.5];
/// Ranges in x of the shafts through the slabs, metres; in y they are as wide as the corridor.
const SHAFTS_X_M: [[f32; 2]; 3] = [[0.75, 6.25], [17.5, 23.0], [34.75, 40.25]];
/// West faces, in x, of the walls across the corridor west and east of the shafts, metres.
const CROSS_WALLS_X_M: [f32; 4] = [6.75, 16.75, 23.5, 34.0];
/// Range in x of the ground floor without partitions (the lobby), metres.
const LOBBY_X_M: [f32; 2] = [7.5, 31.0];

/// An axis-aligned box of one occupancy, metres.
struct Block {
    /// Least corner.
    min: [f32; 3],
    /// Greatest corner.
    max: [f32; 3],
    /// Whether the box is solid or free.
    state: Occupancy,
}

/// The building as a map with cells of `resolution_m`; walls are at least one cell thick.
pub fn building_map(seed: u64, resolution_m: f32) -> Result<OccupancyMap, MapError> {
    let name = "builtin:building";
    if !(0.05..=1.0).contains(&resolution_m) {
        let why = format!("resolution_m of {resolution_m}, its walls and doors ask for 0.05 to 1");
        return Err(MapError::DoesNotFitGrid { file: name.into(), why });
    }
    let cells = |metres: f32| (metres / resolution_m).round() as u32;
    let shape = GridShape { dims: SIZE_M.map(cells), min: Point::zeros(), resolution_m };
    let mut map = OccupancyMap::all_unknown(shape, name)?;
    for Block { min, max, state } in building_blocks(seed) {
        let from = [0, 1, 2].map(|a| cells(min[a]).min(shape.dims[a] - 1));
        let to = [0, 1, 2].map(|a| cells(max[a]).clamp(from[a] + 1, shape.dims[a]));
        map.fill(from, to, state);
    }
    Ok(map)
}

/// Boxes of the building, in order: a later box overwrites earlier ones.
fn building_blocks(seed: u64) -> Vec<Block> {
    let mut plan = BlockList { blocks: Vec::new(), rng: Pcg32::seed_from_u64(seed) };
    let [length, width, height] = SIZE_M;
    plan.add_solid([0.0; 3], SIZE_M);
    plan.add_opening(
        [WALL_THICKNESS_M; 3],
        [length - WALL_THICKNESS_M, width - WALL_THICKNESS_M, height - WALL_THICKNESS_M],
    );
    for floor in 0..FLOORS {
        plan.add_storey(floor);
    }
    for [x0, x1] in SHAFTS_X_M {
        for floor in 1..FLOORS {
            let z = floor as f32 * FLOOR_HEIGHT_M;
            plan.add_opening([x0, CORRIDOR_Y_M[0], z], [x1, CORRIDOR_Y_M[1], z + WALL_THICKNESS_M]);
        }
    }
    plan.blocks
}

/// The boxes made so far, and the source of the random numbers for further ones.
struct BlockList {
    /// The boxes; where they overlap, the later one counts.
    blocks: Vec<Block>,
    rng: Pcg32,
}

impl BlockList {
    /// Adds a solid box, metres.
    fn add_solid(&mut self, min: [f32; 3], max: [f32; 3]) {
        self.blocks.push(Block { min, max, state: Occupancy::Occupied });
    }

    /// Adds a free box, metres.
    fn add_opening(&mut self, min: [f32; 3], max: [f32; 3]) {
        self.blocks.push(Block { min, max, state: Occupancy::Free });
    }

    /// A random number, uniform in `[from, to)`.
    fn uniform(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * (self.rng.next_u32() >> 8) as f32 / 16_777_216.0
    }

    /// Adds one floor with its walls, doors and windows; `floor` counts from 0, the ground floor.
    fn add_storey(&mut self, floor: u32) {
        let [length, width, _] = SIZE_M;
        let slab = floor as f32 * FLOOR_HEIGHT_M;
        let z = slab + WALL_THICKNESS_M;
        let ceiling =
            if floor + 1 == FLOORS { SIZE_M[2] - WALL_THICKNESS_M } else { slab + FLOOR_HEIGHT_M };
        if floor > 0 {
            self.add_solid([0.0, 0.0, slab], [length, width, z]);
        }
        for (y0, y1, wall) in [
            (
                WALL_THICKNESS_M,
                CORRIDOR_Y_M[0] - WALL_THICKNESS_M,
                CORRIDOR_Y_M[0] - WALL_THICKNESS_M,
            ),
            (CORRIDOR_Y_M[1] + WALL_THICKNESS_M, width - WALL_THICKNESS_M, CORRIDOR_Y_M[1]),
        ] {
            self.add_solid([0.0, wall, z], [length, wall + WALL_THICKNESS_M, ceiling]);
            // Five or six rooms on each side of the corridor; partitions at equal shares of the
            // length, each moved by up to 0.4 m.
            let rooms = 5 + (self.rng.next_u32() % 2) as usize;
            let mut west = WALL_THICKNESS_M;
            for room in 1..=rooms {
                let east = if room == rooms {
                    length - WALL_THICKNESS_M
                } else {
                    length * room as f32 / rooms as f32 + self.uniform(-0.4, 0.4)
                };
                if room < rooms {
                    self.add_solid([east, y0, z], [east + WALL_THICKNESS_M, y1, ceiling]);
                }
                self.add_door(west, east, wall, z);
                if room < rooms && self.rng.next_u32().is_multiple_of(2) {
                    let at = self.uniform(y0 + 1.0, y1 - 4.5);
                    self.add_opening([east, at, z], [east + WALL_THICKNESS_M, at + 3.0, z + 3.5]);
                }
                self.add_window(
                    west,
                    east,
                    if y0 < 1.0 { 0.0 } else { width - WALL_THICKNESS_M },
                    z,
                );
                west = east + WALL_THICKNESS_M;
            }
        }
        // Walls across the corridor, each with a wide opening.
        for x in CROSS_WALLS_X_M {
            self.add_solid(
                [x, CORRIDOR_Y_M[0], z],
                [x + WALL_THICKNESS_M, CORRIDOR_Y_M[1], ceiling],
            );
            self.add_opening(
                [x, CORRIDOR_Y_M[0] + 0.75, z],
                [x + WALL_THICKNESS_M, CORRIDOR_Y_M[1] - 0.75, z + 4.0],
            );
        }
        if floor == 0 {
            let [x0, x1] = LOBBY_X_M;
            self.add_opening([x0, WALL_THICKNESS_M, z], [x1, CORRIDOR_Y_M[1], ceiling]);
        }
    }

    /// Adds a door from the corridor into the room between x = `west` and x = `east`, in the
    /// corridor wall at y = `wall`, above the floor at `z`.
    fn add_door(&mut self, west: f32, east: f32, wall: f32, z: f32) {
        let width = self.uniform(3.5, 4.25);
        let at = self.uniform(west + 0.75, east - 0.75 - width);
        let height = self.uniform(3.75, 4.5);
        self.add_opening([at, wall, z], [at + width, wall + WALL_THICKNESS_M, z + height]);
    }

    /// Adds a window to the room between x = `west` and x = `east`, in the outer wall whose south
    /// face is at y = `wall`, above the floor at `z`.
    fn add_window(&mut self, west: f32, east: f32, wall: f32, z: f32) {
        let at = self.uniform(west + 1.0, (west + east) / 2.0);
        self.add_opening(
            [at, wall, z + 1.0],
            [(at + 2.5).min(east - 0.5), wall + WALL_THICKNESS_M, z + 2.5],
        );
    }
}

#[cfg(test)]
mod tests;
