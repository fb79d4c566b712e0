//! Nodes sorted into cubes, so that the pairs in range are found without looking at all pairs.
//!
//! A counting sort over a box of cubes around the nodes, half the longest edge a side (more where
//! that would be too many cubes), x fastest: the nodes of neighbouring cubes in a row lie side by
//! side, and a node's neighbours are a few runs.

use super::config::{Config, LengthRange, PrmError, squared_length};
use crate::Point;

/// Candidates whose distances are computed at once.
const CANDIDATE_LANES: usize = 16;

/// Scratch for `NODES` nodes and `CUBES` cubes: 14 bytes a node, 2 a cube. The default board has
/// 4096 of each.
pub struct Workspace<const NODES: usize, const CUBES: usize> {
    /// Coordinates in sorted order.
    x: [f32; NODES],
    y: [f32; NODES],
    z: [f32; NODES],
    /// Node at each place of the sorted order.
    node: [u16; NODES],
    /// First place of each cube; after the last cube the number of nodes.
    first: [u16; CUBES],
    len: usize,
    min: [f32; 3],
    cube_m: f32,
    dims: [usize; 3],
}

impl<const NODES: usize, const CUBES: usize> Default for Workspace<NODES, CUBES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const NODES: usize, const CUBES: usize> Workspace<NODES, CUBES> {
    /// Empty, all zero: a static of this costs no flash.
    pub const fn new() -> Self {
        const { assert!(NODES <= u16::MAX as usize && CUBES >= 2) };
        Self {
            x: [0.0; NODES],
            y: [0.0; NODES],
            z: [0.0; NODES],
            node: [0; NODES],
            first: [0; CUBES],
            len: 0,
            min: [0.0; 3],
            cube_m: 0.0,
            dims: [0; 3],
        }
    }

    /// Nodes in the index.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing is indexed.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sorts the nodes. O(nodes + cubes).
    pub fn build_index(&mut self, nodes: &[Point], config: &Config) -> Result<(), PrmError> {
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
            // Beyond 1e6 m f32 is too coarse to fly by.
            if !node.iter().all(|c| c.abs() <= 1e6) {
                return Err(PrmError::NotFinite(i));
            }
            (min, max) = (min.inf(node), max.sup(node));
        }
        self.min = min.into();
        self.choose_cubes((max - min).into(), config.edge_max_m / 2.0);
        let [nx, ny, nz] = self.dims;
        let count = nx * ny * nz;
        self.first.fill(0);
        // Counts become the ends of the cubes, and placing the nodes moves each end down to the
        // beginning.
        for node in nodes {
            self.first[self.cube_of(node)] += 1;
        }
        let mut sum = 0;
        for first in &mut self.first[..count] {
            sum += *first;
            *first = sum;
        }
        self.first[count] = sum;
        // Backwards, so that nodes keep their order inside a cube.
        for (i, node) in nodes.iter().enumerate().rev() {
            let cube = self.cube_of(node);
            self.first[cube] -= 1;
            let place = usize::from(self.first[cube]);
            (self.x[place], self.y[place], self.z[place]) = (node.x, node.y, node.z);
            self.node[place] = i as u16;
        }
        self.len = nodes.len();
        Ok(())
    }

    /// The smallest cubes from `edge` on that fit the memory, with one entry left for the end.
    fn choose_cubes(&mut self, size: [f32; 3], edge: f32) {
        let longest = size[0].max(size[1]).max(size[2]);
        // Lower than this no count fits anyway, and the casts below stay small.
        self.cube_m = edge.max(longest / CUBES as f32).max(1e-6);
        loop {
            self.dims = size.map(|s| (s / self.cube_m) as usize + 1);
            if self.dims.iter().fold(1, |count: usize, &dim| count.saturating_mul(dim)) < CUBES {
                return;
            }
            self.cube_m *= 1.25;
        }
    }

    fn cube_along(&self, axis: usize, x: f32) -> usize {
        (((x - self.min[axis]) / self.cube_m) as usize).min(self.dims[axis] - 1)
    }

    fn cube_of(&self, p: &Point) -> usize {
        let [i, j, k] = [0, 1, 2].map(|axis| self.cube_along(axis, p[axis]));
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// The node at a place.
    pub(super) fn node(&self, place: usize) -> u16 {
        self.node[place]
    }

    /// Position of the node at a place.
    #[inline(always)]
    pub(super) fn point(&self, place: usize) -> [f32; 3] {
        [self.x[place], self.y[place], self.z[place]]
    }

    /// Calls `visit` with the places after `place` whose nodes are in the range of lengths from it,
    /// up to [`CANDIDATE_LANES`] at a time.
    #[inline(always)]
    pub(super) fn for_each_in_range<E>(
        &self,
        place: usize,
        config: &Config,
        mut visit: impl FnMut(&[u16]) -> Result<(), E>,
    ) -> Result<(), E> {
        let lengths = LengthRange::new(config);
        let here = self.point(place);
        // Rounding of `x ± reach` must not lose a cube: a millionth more, and an ulp of the largest
        // coordinate.
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
                let mut from = usize::from(self.first[row + i_low]);
                let to = usize::from(self.first[row + i_high + 1]);
                if (k, j) == (k0, j0) {
                    from = from.max(place + 1);
                }
                while from < to {
                    let lanes = (to - from).min(CANDIDATE_LANES);
                    let mut hits = self.in_range(here, lengths, from, lanes);
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

    /// A bit for each of the `lanes` places from `from` on whose distance is in range.
    #[inline(always)]
    fn in_range(&self, here: [f32; 3], lengths: LengthRange, from: usize, lanes: usize) -> u32 {
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
