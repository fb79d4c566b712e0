//! Spatial grid of the nodes: they are sorted into cubes, so that pairs within the length range are
//! found without measuring all pairs.
//!
//! A counting sort over a grid of cubes around the nodes. A cube's edge is half of `edge_max_m`
//! (longer where that would be too many cubes). Cubes are numbered x fastest, so the nodes of cubes
//! that are neighbours in x are neighbours in the sorted order, and a node's candidates are a few
//! contiguous runs.

use super::config::{LengthRange, PrmConfig, PrmError, squared_length};
use crate::Point;

/// Candidate nodes whose distances are computed at once.
const CANDIDATE_LANES: usize = 16;

/// Spatial grid of up to `NODES` nodes, sorted into fewer than `CUBES` cubes: 14 bytes per node, 2
/// per cube. The default board has 4096 of each.
pub struct NodeGrid<const NODES: usize, const CUBES: usize> {
    /// Coordinates of the nodes in sorted order.
    x: [f32; NODES],
    y: [f32; NODES],
    z: [f32; NODES],
    /// Node index at each place of the sorted order.
    sorted_nodes: [u16; NODES],
    /// Place of the first node of each cube; the entry after the last cube is the number of nodes.
    cube_starts: [u16; CUBES],
    /// Number of nodes in the grid.
    len: usize,
    /// Minimum corner of the first cube, metres in the mission frame.
    min: [f32; 3],
    /// Edge of a cube, metres.
    cube_m: f32,
    /// Number of cubes along each axis.
    dims: [usize; 3],
}

impl<const NODES: usize, const CUBES: usize> Default for NodeGrid<NODES, CUBES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const NODES: usize, const CUBES: usize> NodeGrid<NODES, CUBES> {
    /// Creates an empty grid, all zero: a static of it takes no flash.
    pub const fn new() -> Self {
        const { assert!(NODES <= u16::MAX as usize && CUBES >= 2) };
        Self {
            x: [0.0; NODES],
            y: [0.0; NODES],
            z: [0.0; NODES],
            sorted_nodes: [0; NODES],
            cube_starts: [0; CUBES],
            len: 0,
            min: [0.0; 3],
            cube_m: 0.0,
            dims: [0; 3],
        }
    }

    /// Number of nodes in the grid.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the grid has no nodes.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sorts the nodes into the grid, replacing what it held. O(nodes + cubes).
    pub fn sort_nodes(&mut self, nodes: &[Point], config: &PrmConfig) -> Result<(), PrmError> {
        config.check()?;
        self.len = 0;
        if nodes.len() > NODES {
            return Err(PrmError::TooManyNodes);
        }
        let Some(first_node) = nodes.first() else {
            return Ok(());
        };
        let (mut min, mut max) = (*first_node, *first_node);
        for (i, node) in nodes.iter().enumerate() {
            // Beyond 1e6 m f32 coordinates are too coarse to fly by.
            if !node.iter().all(|c| c.abs() <= 1e6) {
                return Err(PrmError::NotFinite(i));
            }
            (min, max) = (min.inf(node), max.sup(node));
        }
        self.min = min.into();
        self.choose_cubes((max - min).into(), config.edge_max_m / 2.0);
        let [nx, ny, nz] = self.dims;
        let count = nx * ny * nz;
        self.cube_starts.fill(0);
        // `cube_starts` first counts the nodes of each cube, then holds the end of each cube's run
        // in the sorted order. Placing a node lowers that end by one, so that finally `cube_starts`
        // holds the run's beginning.
        for node in nodes {
            self.cube_starts[self.cube_of(node)] += 1;
        }
        let mut sum = 0;
        for first in &mut self.cube_starts[..count] {
            sum += *first;
            *first = sum;
        }
        self.cube_starts[count] = sum;
        // Placed from the last node on, so that the nodes of a cube keep their order.
        for (i, node) in nodes.iter().enumerate().rev() {
            let cube = self.cube_of(node);
            self.cube_starts[cube] -= 1;
            let place = usize::from(self.cube_starts[cube]);
            (self.x[place], self.y[place], self.z[place]) = (node.x, node.y, node.z);
            self.sorted_nodes[place] = i as u16;
        }
        self.len = nodes.len();
        Ok(())
    }

    /// Sets the cubes' edge to the least of `edge`, `edge` · 1.25, … for which the cubes fit
    /// `CUBES`, with one entry left for the end.
    fn choose_cubes(&mut self, size: [f32; 3], edge: f32) {
        let longest = size[0].max(size[1]).max(size[2]);
        // With a smaller edge the cubes would not fit anyway; this also keeps the casts below
        // small.
        self.cube_m = edge.max(longest / CUBES as f32).max(1e-6);
        loop {
            self.dims = size.map(|s| (s / self.cube_m) as usize + 1);
            if self.dims.iter().fold(1, |count: usize, &dim| count.saturating_mul(dim)) < CUBES {
                return;
            }
            self.cube_m *= 1.25;
        }
    }

    /// Index along `axis` of the cube that holds coordinate `x`, or of the nearest cube.
    fn cube_along(&self, axis: usize, x: f32) -> usize {
        (((x - self.min[axis]) / self.cube_m) as usize).min(self.dims[axis] - 1)
    }

    /// Index of the cube that holds a point.
    fn cube_of(&self, p: &Point) -> usize {
        let [i, j, k] = [0, 1, 2].map(|axis| self.cube_along(axis, p[axis]));
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// Node index at a place of the sorted order.
    pub(super) fn node(&self, place: usize) -> u16 {
        self.sorted_nodes[place]
    }

    /// Position of the node at a place of the sorted order, metres.
    #[inline(always)]
    pub(super) fn point(&self, place: usize) -> [f32; 3] {
        [self.x[place], self.y[place], self.z[place]]
    }

    /// Calls `visit` with the places after `place` whose nodes are within the length range of the
    /// node at `place`, up to [`CANDIDATE_LANES`] places per call.
    #[inline(always)]
    pub(super) fn for_each_later_in_range<E>(
        &self,
        place: usize,
        config: &PrmConfig,
        mut visit: impl FnMut(&[u16]) -> Result<(), E>,
    ) -> Result<(), E> {
        let lengths = LengthRange::new(config);
        let here = self.point(place);
        // The search radius is the longest edge plus a millionth of it and plus the largest
        // coordinate times four f32 epsilons, so that the rounding of `x ± reach` loses no cube.
        let largest = here[0].abs().max(here[1].abs()).max(here[2].abs());
        let reach = config.edge_max_m * (1.0 + 1e-6) + largest * 4.0 * f32::EPSILON;
        let [_, j0, k0] = [0, 1, 2].map(|axis| self.cube_along(axis, here[axis]));
        let i_low = self.cube_along(0, here[0] - reach);
        let i_high = self.cube_along(0, here[0] + reach);
        let j_low = self.cube_along(1, here[1] - reach);
        let j_high = self.cube_along(1, here[1] + reach);
        let k_high = self.cube_along(2, here[2] + reach);
        let mut near = [0_u16; 2 * CANDIDATE_LANES];
        let mut count = 0;
        for k in k0..=k_high {
            for j in (if k == k0 { j0 } else { j_low })..=j_high {
                let row = (k * self.dims[1] + j) * self.dims[0];
                let mut from = usize::from(self.cube_starts[row + i_low]);
                let to = usize::from(self.cube_starts[row + i_high + 1]);
                if (k, j) == (k0, j0) {
                    from = from.max(place + 1);
                }
                while from < to {
                    let lanes = (to - from).min(CANDIDATE_LANES);
                    let mut hits = self.in_range_mask(here, lengths, from, lanes);
                    while hits != 0 {
                        near[count] = (from + hits.trailing_zeros() as usize) as u16;
                        count += 1;
                        hits &= hits - 1;
                    }
                    from += lanes;
                    if count >= CANDIDATE_LANES {
                        visit(&near[..CANDIDATE_LANES])?;
                        near.copy_within(CANDIDATE_LANES.., 0);
                        count -= CANDIDATE_LANES;
                    }
                }
            }
        }
        visit(&near[..count])
    }

    /// Bit i is set if the node at place `from + i`, i < `lanes`, is within the length range of
    /// `here`.
    #[inline(always)]
    fn in_range_mask(
        &self,
        here: [f32; 3],
        lengths: LengthRange,
        from: usize,
        lanes: usize,
    ) -> u32 {
        let mut hits = 0;
        match (
            self.x[from..].first_chunk::<CANDIDATE_LANES>(),
            self.y[from..].first_chunk::<CANDIDATE_LANES>(),
            self.z[from..].first_chunk::<CANDIDATE_LANES>(),
        ) {
            (Some(x), Some(y), Some(z)) => {
                for i in 0..CANDIDATE_LANES {
                    hits |=
                        u32::from(lengths.contains(squared_length(here, [x[i], y[i], z[i]]))) << i;
                }
                hits & ((1 << lanes) - 1)
            }
            _ => {
                for i in 0..lanes {
                    hits |= u32::from(lengths.contains(squared_length(here, self.point(from + i))))
                        << i;
                }
                hits
            }
        }
    }
}
