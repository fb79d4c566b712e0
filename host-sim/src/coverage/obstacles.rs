//! The obstacles of a map that is given beside an area, and the no-fly zones around them.
//!
//! Method: a column of the map is blocked if an obstacle in it reaches up to where vehicles fly.
//! Blocked columns between which no vehicle fits form one part. The zone of a part is its convex
//! hull, moved outward by the required clearance. A zone is split in half, again and again, while
//! too large a share of it could be flown over: a wall around a field must not block the field.
//! Zones may overlap. Metres, ENU in the mission frame.

mod polygon;

use std::sync::OnceLock;

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::map::voxel::Outside;

use self::polygon::{
    Polygon, bounding_box, contains, convex_hull, offset_outward, simplified_outward,
};
use crate::capacity::BOARD_NO_FLY_CORNERS;
use crate::map::{ClearanceField, OccupancyMap, UnknownSpace, VoxelMap};

/// Greatest z, in the mission frame, of the top of a map cell that counts as ground, metres.
const MAX_GROUND_CELL_TOP_M: f32 = 0.5;
/// Added to the clearance of zones against rounding, metres.
const ZONE_ROUNDING_M: f64 = 0.01;
/// Most corners of a zone that is not a box.
const MAX_ZONE_CORNERS: usize = 8;
/// Distance from the box around all lanes and pads within which zones are kept, metres: transits
/// may lead there.
const KEEP_ZONES_WITHIN_M: f32 = 30.0;
/// Distance by which a kept zone widens the box in which other zones are kept, metres.
const KEEP_ZONES_BESIDE_KEPT_M: f32 = 5.0;

/// Ways to draw zones, the preferred one first: the first gives zones of the least area, the last
/// zones with the fewest corners.
const ZONE_STYLES: [ZoneStyle; 2] = [
    ZoneStyle { as_boxes: false, max_free_share: 0.3 },
    ZoneStyle { as_boxes: true, max_free_share: 0.5 },
];

/// A way to draw zones around blocked columns.
#[derive(Clone, Copy)]
struct ZoneStyle {
    /// Whether zones are axis-aligned boxes instead of convex hulls.
    as_boxes: bool,
    /// Greatest allowed share of a zone's columns that could be flown over; above it the zone is
    /// split.
    max_free_share: f64,
}

/// Error: the zones have this many corners, more than can be planned around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyCorners(pub usize);

/// The obstacles of a map above the ground.
#[derive(Debug)]
pub struct MapObstacles {
    /// The map, without the cells that count as ground; beyond its faces all is free.
    pub map: VoxelMap,
    /// Horizontal distance that paths keep from obstacles at their height, metres.
    pub required_clearance_m: f32,
    /// Computed at the first call of [`Self::clearance_field`].
    field: OnceLock<ClearanceField>,
}

impl MapObstacles {
    /// The obstacles of a map: its occupied cells without those that count as ground.
    pub fn new(map: &OccupancyMap, unknown: UnknownSpace, clearance_m: f32) -> Self {
        let mut map = VoxelMap {
            occupied_words: None,
            no_node_words: None,
            beyond_map: Outside::Free,
            ..map.to_voxel_map(unknown)
        };
        let shape = map.shape;
        let is_ground = |cell: &[u32; 3]| {
            let centre = shape.center(*cell);
            centre.z + shape.resolution_m / 2.0 <= MAX_GROUND_CELL_TOP_M
        };
        let ground: Vec<_> = occupied_cells(&map).filter(is_ground).collect();
        for cell in ground {
            let (word, mask) = shape.word_and_mask(cell);
            map.obstacle_words[word] &= !mask;
        }
        Self { map, required_clearance_m: clearance_m, field: OnceLock::new() }
    }

    /// Lower bounds of the distance to the nearest obstacle; computed at the first call.
    pub fn clearance_field(&self) -> &ClearanceField {
        self.field.get_or_init(|| ClearanceField::new(&self.map.grid()))
    }

    /// Horizontal distance from a vehicle that climbs from `place` to the nearest obstacle beside
    /// or above it, metres; `None` if no obstacle is nearer than the clearance.
    pub fn too_near_climb_obstacle_m(&self, place: &Point) -> Option<f32> {
        let shape = &self.map.shape;
        let half = Flat::repeat(shape.resolution_m / 2.0);
        let distance_m = |cell: [u32; 3]| {
            let centre = shape.center(cell);
            let beside = ((centre - place).xy().abs() - half).sup(&Flat::zeros());
            (centre.z + half.x > place.z).then(|| beside.norm())
        };
        let nearest_m =
            occupied_cells(&self.map).filter_map(distance_m).fold(f32::INFINITY, f32::min);
        (nearest_m < self.required_clearance_m).then_some(nearest_m)
    }

    /// Zones around the obstacles that reach above z = `floor_m` and are near `places` (the area's
    /// vertices and the pads). Lanes extend `beyond_m` beyond these places. `own` is the number of
    /// corners of all other no-fly zones. Uses the first way to draw zones with which a board can
    /// plan, else the first within `most` corners.
    ///
    /// # Errors
    /// All zones together have more than `most` corners.
    pub fn no_fly_zones(
        &self,
        floor_m: f32,
        (places, beyond_m): (&[Flat], f32),
        own: usize,
        most: usize,
    ) -> Result<Vec<Vec<Flat>>, TooManyCorners> {
        let columns = Columns::new(&self.map, f64::from(self.required_clearance_m), floor_m);
        let parts = columns.blocked_parts();
        let drawn = ZONE_STYLES.map(|style| {
            let zones = parts.iter().flat_map(|part| columns.zones_around(part, &style));
            near_zones(
                zones.map(|zone| to_flat(&zone)).collect(),
                places,
                beyond_m + KEEP_ZONES_WITHIN_M,
            )
        });
        let corners = |zones: &[Vec<Flat>]| own + zones.iter().map(Vec::len).sum::<usize>();
        let counts = drawn.each_ref().map(|zones| corners(zones));
        let fits = |limit: usize| counts.iter().position(|count| *count <= limit);
        match fits(BOARD_NO_FLY_CORNERS).or_else(|| fits(most)) {
            Some(index) => Ok(drawn.into_iter().nth(index).unwrap_or_default()),
            None => Err(TooManyCorners(counts[ZONE_STYLES.len() - 1])),
        }
    }
}

/// The occupied cells of a map.
fn occupied_cells(map: &VoxelMap) -> impl Iterator<Item = [u32; 3]> + '_ {
    let [bx, by, _] = map.shape.brick_dims();
    let bricks = map.obstacle_words.iter().zip(0u32..).filter(|(word, _)| **word != 0);
    bricks.flat_map(move |(&word, at)| {
        let [i, j, k] = [at % bx, at / bx % by, at / (bx * by)].map(|brick| brick * 4);
        let bits = (0..64).filter(move |bit| word >> bit & 1 == 1);
        bits.map(move |bit| [i + bit % 4, j + bit / 4 % 4, k + bit / 16])
    })
}

/// The polygon in f32.
fn to_flat(polygon: &Polygon) -> Vec<Flat> {
    polygon.iter().map(|[x, y]| Flat::new(*x as f32, *y as f32)).collect()
}

/// The zones that may matter to flights between `places`: those that meet the box around all
/// places, wider by `near_m`. The box grows by each kept zone, wider by
/// [`KEEP_ZONES_BESIDE_KEPT_M`], until it meets no further zone. Each zone is represented by its
/// bounding box.
fn near_zones(mut zones: Vec<Vec<Flat>>, places: &[Flat], near_m: f32) -> Vec<Vec<Flat>> {
    let extent = |points: &[Flat], around_m: f32| {
        let start = [Flat::repeat(f32::INFINITY), Flat::repeat(f32::NEG_INFINITY)];
        let [low, high] = points.iter().fold(start, |[low, high], p| [low.inf(p), high.sup(p)]);
        [low - Flat::repeat(around_m), high + Flat::repeat(around_m)]
    };
    let mut reach = extent(places, near_m);
    let mut kept = Vec::new();
    loop {
        let is_near = |zone: &mut Vec<Flat>| {
            let [low, high] = extent(zone, 0.0);
            (0..2).all(|axis| low[axis] <= reach[1][axis] && high[axis] >= reach[0][axis])
        };
        let near: Vec<_> = zones.extract_if(.., is_near).collect();
        if near.is_empty() {
            return kept;
        }
        for zone in &near {
            let [low, high] = extent(zone, KEEP_ZONES_BESIDE_KEPT_M);
            reach = [reach[0].inf(&low), reach[1].sup(&high)];
        }
        kept.extend(near);
    }
}

/// The columns of a map, with further columns around the map for the clearance.
struct Columns {
    /// Numbers of columns to the east and to the north.
    size: [usize; 2],
    /// South-western corner of the first column, metres.
    low: [f64; 2],
    /// Side of a column, metres.
    cell_m: f64,
    /// Horizontal distance that paths keep from obstacles, metres.
    clearance_m: f64,
    /// Columns with an obstacle that reaches up to where vehicles fly.
    blocked: Vec<bool>,
    /// Columns whose middle is nearer to a blocked one than the clearance.
    inflated: Vec<bool>,
}

/// Indices of a column, east and north.
type Column = [usize; 2];

impl Columns {
    fn new(map: &VoxelMap, clearance_m: f64, floor_m: f32) -> Self {
        let cell_m = f64::from(map.shape.resolution_m);
        let around = (clearance_m / cell_m).ceil() as usize + 1;
        let size = [0, 1].map(|axis| map.shape.dims[axis] as usize + 2 * around);
        let low = [0, 1].map(|axis| f64::from(map.shape.min[axis]) - around as f64 * cell_m);
        let free = vec![false; size[0] * size[1]];
        let mut columns =
            Self { size, low, cell_m, clearance_m, blocked: free.clone(), inflated: free };
        for cell in occupied_cells(map) {
            let at = columns.index([0, 1].map(|axis| cell[axis] as usize + around));
            let centre = map.shape.center(cell);
            let top_m = centre.z + map.shape.resolution_m / 2.0;
            columns.blocked[at] = columns.blocked[at] || top_m > floor_m;
        }
        columns.inflate(around);
        columns
    }

    /// Index of a column in `blocked` and `inflated`.
    fn index(&self, [i, j]: Column) -> usize {
        j * self.size[0] + i
    }

    /// All columns, row by row from the south.
    fn all(&self) -> impl Iterator<Item = Column> + use<> {
        let [wide, tall] = self.size;
        (0..tall).flat_map(move |j| (0..wide).map(move |i| [i, j]))
    }

    /// A column and the columns beside it, diagonally too.
    fn with_neighbours(&self, [i, j]: Column) -> impl Iterator<Item = Column> + use<> {
        let [wide, tall] = self.size;
        let near = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        near(j, tall).flat_map(move |j| near(i, wide).map(move |i| [i, j]))
    }

    /// Marks the inflated columns, which lie at most `around` columns from a blocked one.
    fn inflate(&mut self, around: usize) {
        let gap_m = |apart: isize| (apart.unsigned_abs() as f64 - 0.5).max(0.0) * self.cell_m;
        let reach = around as isize;
        let steps = (-reach..=reach).flat_map(|j| (-reach..=reach).map(move |i| [i, j]));
        let near: Vec<[isize; 2]> =
            steps.filter(|[i, j]| gap_m(*i).hypot(gap_m(*j)) <= self.clearance_m).collect();
        self.inflated.clone_from(&self.blocked);
        for column in self.all() {
            // Only from columns at the edge of a blocked region: all columns around the others are
            // blocked.
            let is_blocked = |column: Column| self.blocked[self.index(column)];
            if !is_blocked(column) || self.with_neighbours(column).all(is_blocked) {
                continue;
            }
            for [i, j] in &near {
                let to = [column[0].wrapping_add_signed(*i), column[1].wrapping_add_signed(*j)];
                let at = self.index(to);
                self.inflated[at] = true;
            }
        }
    }

    /// The blocked columns, in parts whose inflated columns touch.
    fn blocked_parts(&self) -> Vec<Vec<Column>> {
        let mut left = self.inflated.clone();
        let mut parts = Vec::new();
        for first in self.all() {
            if !std::mem::take(&mut left[self.index(first)]) {
                continue;
            }
            let (mut part, mut open) = (Vec::new(), vec![first]);
            while let Some(column) = open.pop() {
                if self.blocked[self.index(column)] {
                    part.push(column);
                }
                for beside in self.with_neighbours(column) {
                    if std::mem::take(&mut left[self.index(beside)]) {
                        open.push(beside);
                    }
                }
            }
            parts.push(part);
        }
        parts
    }

    /// Zones that together contain these columns and the clearance around them.
    fn zones_around(&self, part: &[Column], style: &ZoneStyle) -> Vec<Polygon> {
        let place = |[i, j]: [usize; 2]| {
            [self.low[0] + i as f64 * self.cell_m, self.low[1] + j as f64 * self.cell_m]
        };
        let corners = part
            .iter()
            .flat_map(|&[i, j]| [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(place));
        let hull = convex_hull(corners.collect());
        let inner = match style.as_boxes {
            true => bounding_box(&hull),
            false => simplified_outward(hull, MAX_ZONE_CORNERS),
        };
        let zone = offset_outward(&inner, self.clearance_m + ZONE_ROUNDING_M);
        if self.free_share(&zone) <= style.max_free_share {
            return vec![zone];
        }
        let range = |axis: usize| {
            let along = || part.iter().map(move |column| column[axis]);
            (along().min().unwrap_or(0), along().max().unwrap_or(0))
        };
        let (east, north) = (range(0), range(1));
        let axis = usize::from(north.1 - north.0 > east.1 - east.0);
        let (first, last) = [east, north][axis];
        if first == last {
            return vec![zone];
        }
        let middle = (first + last).div_ceil(2);
        let (before, after): (Vec<_>, Vec<_>) =
            part.iter().partition(|column| column[axis] < middle);
        [before, after].iter().flat_map(|half| self.zones_around(half, style)).collect()
    }

    /// Share of a zone that could be flown over: its columns that are not inflated.
    fn free_share(&self, zone: &Polygon) -> f64 {
        let box_of = bounding_box(zone);
        let [from, to] = [box_of[0], box_of[2]].map(|corner| {
            [0, 1].map(|axis| ((corner[axis] - self.low[axis]) / self.cell_m).floor() as isize)
        });
        let is_grown = |column: [isize; 2]| {
            let inside = (0..2).all(|a| column[a] >= 0 && column[a] < self.size[a] as isize);
            inside && self.inflated[self.index(column.map(|index| index as usize))]
        };
        let (mut all, mut free) = (0.0, 0.0);
        for column in (from[1]..=to[1]).flat_map(|j| (from[0]..=to[0]).map(move |i| [i, j])) {
            let middle =
                [0, 1].map(|axis| self.low[axis] + (column[axis] as f64 + 0.5) * self.cell_m);
            if contains(zone, &middle) {
                all += 1.0;
                free += f64::from(u8::from(!is_grown(column)));
            }
        }
        if all > 0.0 { free / all } else { 0.0 }
    }
}
