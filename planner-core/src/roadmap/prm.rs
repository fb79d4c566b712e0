//! The probabilistic roadmap (PRM) of paper P3D §3.2, Algorithm 1: terminals (starts and goals) and
//! random free nodes, joined where a straight flight between two keeps the clearance.
//!
//! Starts and goals are nodes; `random_nodes` points of free space follow (the paper's count
//! excludes the terminals as well). Two nodes are joined iff `edge_min_m ≤ length ≤ edge_max_m` and
//! the segment between them keeps `clearance_m` ([`segment_is_clear`]). The edges are exactly those
//! that a loop over all pairs finds ([`connect_all_pairs`]), with less work:
//!
//! 1. nodes are sorted into cubes ([`NodeGrid`]), so that only near pairs are measured;
//! 2. around a node the largest empty box in a fixed order of growth is taken (`prm/free_box.rs`):
//!    the segment to another node inside the box is clear, and one that leaves the box mostly meets
//!    a wall;
//! 3. the remaining segments go to the exact check, without their part inside the box.
//!
//! Cost: O(nodes · neighbours); 2300 nodes have some 80 000 pairs within the length range. Memory:
//! 14 bytes per node, 2 per cube. Metres, mission frame, f32.

mod config;
mod free_box;
mod neighbours;
#[cfg(test)]
mod tests;

use core::ops::Range;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use self::config::LengthRange;
pub use self::config::{
    MAX_TRIES_PER_BRIDGE, MAX_TRIES_PER_NODE, PrmConfig, PrmEdge, PrmError, Sampling,
    squared_length,
};
use self::free_box::NodeVisibility;
pub use self::neighbours::NodeGrid;
use crate::Point;
use crate::map::segment::{point_clearance, segment_clearance, segment_is_clear};
use crate::map::voxel::VoxelGrid;

/// Writes the terminals and then `config.random_nodes` random free points into `nodes`; returns the
/// number of nodes written, terminals included.
///
/// A random node lies in a cell that is neither an obstacle nor set in `never_sample` (unknown
/// space that edges may cross), and farther than `clearance_m` from every obstacle: a nearer node
/// could have no edge. A terminal only has to be outside obstacles; one without clearance gets no
/// edges.
pub fn sample_nodes(
    grid: &VoxelGrid<'_>,
    never_sample: Option<&VoxelGrid<'_>>,
    terminals: &[Point],
    config: &PrmConfig,
    nodes: &mut [Point],
) -> Result<usize, PrmError> {
    config.check()?;
    let total = terminals.len() + config.random_nodes;
    if total > nodes.len() || total > usize::from(u16::MAX) {
        return Err(PrmError::TooManyNodes);
    }
    for (i, terminal) in terminals.iter().enumerate() {
        if !terminal.iter().all(|x| x.is_finite()) || grid.is_blocked_at(terminal) {
            return Err(PrmError::TerminalBlocked(i));
        }
        nodes[i] = *terminal;
    }
    let mut draws = SampleSequence::new(config);
    let (min, size) = (grid.shape().min, grid.shape().max() - grid.shape().min);
    let is_free = |p: &Point| {
        grid.shape().cell_of(p).is_some_and(|cell| !grid.is_occupied(cell))
            && !never_sample.is_some_and(|never| never.is_blocked_at(p))
            && (config.clearance_m == 0.0 || segment_is_clear(grid, p, p, config.clearance_m))
    };
    for (found, node) in nodes[terminals.len()..total].iter_mut().enumerate() {
        let draw = |draws: &mut SampleSequence| {
            Some(min + draws.next().component_mul(&size)).filter(&is_free)
        };
        let tries = if config.sampling == Sampling::Bridge && found % 2 == 1 {
            MAX_TRIES_PER_BRIDGE
        } else {
            0
        };
        let bridge = (0..tries).find_map(|_| {
            draw(&mut draws).filter(|p| passes_bridge_test(grid, config, p, draws.next()))
        });
        let free = bridge.or_else(|| (0..MAX_TRIES_PER_NODE).find_map(|_| draw(&mut draws)));
        *node = free.ok_or(PrmError::NoFreeSpace(found))?;
    }
    Ok(total)
}

/// Whether a point is farther than the edges' clearance from every obstacle; with clearance 0,
/// whether its cell is free.
fn bridge_end_is_clear(grid: &VoxelGrid<'_>, config: &PrmConfig, p: &Point) -> bool {
    match config.clearance_m > 0.0 {
        true => segment_is_clear(grid, p, p, config.clearance_m),
        false => !grid.is_blocked_at(p),
    }
}

/// The bridge test: whether `p` plus and `p` minus a random offset are both inside the grid and
/// without clearance. `draw`, a point of the unit cube, gives the offset: on each axis at most
/// twice the clearance, or an eighth of the longest edge where that is more.
fn passes_bridge_test(grid: &VoxelGrid<'_>, config: &PrmConfig, p: &Point, draw: Point) -> bool {
    let reach_m = (2.0 * config.clearance_m).max(config.edge_max_m / 8.0);
    let offset = (draw - Point::new(0.5, 0.5, 0.5)) * (2.0 * reach_m);
    [p + offset, p - offset]
        .iter()
        .all(|end| grid.shape().cell_of(end).is_some() && !bridge_end_is_clear(grid, config, end))
}

/// Sequence of pseudo-random or Halton points of the unit cube, [0, 1) on each axis.
struct SampleSequence {
    /// Source of [`Sampling::Uniform`] and [`Sampling::Bridge`].
    rng: Pcg32,
    /// How the points are drawn.
    sampling: Sampling,
    /// Number of Halton points drawn so far.
    halton_index: u32,
    /// Vector by which each Halton point is shifted; what leaves the unit cube comes in at the
    /// opposite face.
    halton_shift: Point,
}

impl SampleSequence {
    fn new(config: &PrmConfig) -> Self {
        let mut rng = Pcg32::seed_from_u64(config.seed);
        let shift = uniform_point(&mut rng);
        // The generator is seeded again, so that uniform points do not depend on the draw of
        // `shift`.
        Self {
            rng: Pcg32::seed_from_u64(config.seed),
            sampling: config.sampling,
            halton_index: 0,
            halton_shift: shift,
        }
    }

    /// The next point of the sequence.
    fn next(&mut self) -> Point {
        match self.sampling {
            Sampling::Uniform | Sampling::Bridge => uniform_point(&mut self.rng),
            Sampling::Halton => {
                self.halton_index = self.halton_index.wrapping_add(1);
                let p = Point::new(
                    radical_inverse(self.halton_index, 2),
                    radical_inverse(self.halton_index, 3),
                    radical_inverse(self.halton_index, 5),
                );
                (p + self.halton_shift).map(|x| if x >= 1.0 { x - 1.0 } else { x })
            }
        }
    }
}

/// A uniform point of the unit cube, 24 random bits per axis, so every value is exact in f32 and
/// below 1.
fn uniform_point(rng: &mut Pcg32) -> Point {
    let mut draw = || (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
    let (x, y) = (draw(), draw());
    Point::new(x, y, draw())
}

/// The digits of `index` in `base`, mirrored at the radix point: the van der Corput sequence, in
/// [0, 1).
fn radical_inverse(mut index: u32, base: u32) -> f32 {
    let (mut value, mut place) = (0.0, 1.0);
    while index > 0 {
        place /= base as f32;
        value += (index % base) as f32 * place;
        index /= base;
    }
    value.min(1.0 - f32::EPSILON)
}

/// Writes all edges between `nodes` into `edges` and returns their number. Their order depends only
/// on nodes and settings, but is not ascending.
pub fn connect<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    config: &PrmConfig,
    workspace: &mut NodeGrid<NODES, CUBES>,
    edges: &mut [PrmEdge],
) -> Result<usize, PrmError> {
    workspace.sort_nodes(nodes, config)?;
    let mut count = 0;
    connect_range(grid, workspace, config, 0..nodes.len(), |edge| {
        *edges.get_mut(count).ok_or(PrmError::RoadmapFull)? = edge;
        count += 1;
        Ok(())
    })?;
    Ok(count)
}

/// Finds the edges from the nodes at places `range` of the sorted order to nodes at later places,
/// and passes each to `found`; an error of `found` ends the search. The ranges 0..n and n..m give
/// the edges of 0..m in the same order, so that cores can share the work without changing the
/// result.
pub fn connect_range<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    workspace: &NodeGrid<NODES, CUBES>,
    config: &PrmConfig,
    range: Range<usize>,
    mut found: impl FnMut(PrmEdge) -> Result<(), PrmError>,
) -> Result<(), PrmError> {
    connect_range_with_clearance_bound(
        grid,
        workspace,
        config,
        range,
        |_| None,
        |edge, _| found(edge),
    )
}

/// As [`connect_range`], but `hint` may answer whether the segment between two nodes is clear. The
/// answer must be that of [`segment_is_clear`], or `None`. `hint` is called only where the free box
/// does not decide; if the segment is clear, `found` is called next. The second argument of `found`
/// is a lower bound on the distance of the edge to obstacles, metres, right to 2⁻¹¹ cell; 0 where
/// the free box gives none.
pub fn connect_range_with_clearance_bound<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    workspace: &NodeGrid<NODES, CUBES>,
    config: &PrmConfig,
    range: Range<usize>,
    hint: impl Fn(PrmEdge) -> Option<bool>,
    mut found: impl FnMut(PrmEdge, f32) -> Result<(), PrmError>,
) -> Result<(), PrmError> {
    config.check()?;
    let mut visibility = NodeVisibility::new(grid, config);
    for place in range.start..range.end.min(workspace.len()) {
        visibility.set_node(workspace.point(place));
        let edge = |other: usize| {
            let (a, b) = (workspace.node(place), workspace.node(other));
            PrmEdge { a: a.min(b), b: a.max(b) }
        };
        workspace.for_each_later_in_range(place, config, |places| {
            let hint = |other| hint(edge(other));
            visibility.for_each_visible(workspace, places, hint, |other, room_m| {
                found(edge(other), room_m)
            })
        })?;
    }
    Ok(())
}

/// The edges of Algorithm 1 as the paper prints it, every pair in turn: the reference for tests of
/// [`connect`]. O(nodes²).
pub fn connect_all_pairs(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    config: &PrmConfig,
    mut found: impl FnMut(PrmEdge),
) -> Result<(), PrmError> {
    config.check()?;
    if nodes.len() > usize::from(u16::MAX) {
        return Err(PrmError::TooManyNodes);
    }
    let lengths = LengthRange::new(config);
    for (k, a) in nodes.iter().enumerate() {
        for (l, b) in nodes.iter().enumerate().skip(k + 1) {
            if lengths.contains(squared_length((*a).into(), (*b).into()))
                && segment_is_clear(grid, a, b, config.clearance_m)
            {
                found(PrmEdge { a: k as u16, b: l as u16 });
            }
        }
    }
    Ok(())
}

/// Distance from an edge to the nearest obstacle, metres, at most `max_m`, as the roadmap file
/// stores it. `None` if an end of the edge is not an index of `nodes`.
pub fn edge_clearance(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    edge: PrmEdge,
    max_m: f32,
) -> Option<f32> {
    let (a, b) = (nodes.get(usize::from(edge.a))?, nodes.get(usize::from(edge.b))?);
    Some(if edge.a == edge.b {
        point_clearance(grid, a, max_m)
    } else {
        segment_clearance(grid, a, b, max_m)
    })
}
