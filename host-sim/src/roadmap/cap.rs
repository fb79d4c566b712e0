//! Drops edges so that a roadmap fits a board: nodes that were connected stay connected, and
//! shortest paths become little longer.
//!
//! 1. *Connected.* The edges of a spanning forest of greatest clearances are kept (Kruskal 1956):
//!    between any two nodes the forest has a path whose narrowest edge is as wide as that of the
//!    widest path in the whole roadmap (Hu 1961). So whatever clearance is required, a node that
//!    could reach another one before still can.
//! 2. *Near.* Of the other edges, those to each node's nearest neighbours come first, up to
//!    `NEAREST_EDGE_SHARE` of the room left.
//! 3. *Far.* The rest of the room goes to the edges whose loss would lengthen the shortest paths
//!    from `PATH_SOURCES` nodes most: the number of paths over an edge, times the extra length of
//!    the detour around it over the edges kept so far. Half of these edges are chosen first: they
//!    shorten the detours around the others.
//!
//! Vehicles of several sizes fly on one roadmap, so nearest neighbours and shortest paths are
//! determined for each class of required clearances ([`CLEARANCE_CLASSES_M`]).
//!
//! Cost: a sort of the edges, a Dijkstra search for each source and class, and a short one for each
//! node, class and round, on all cores.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use planner_core::Point;
use planner_core::roadmap::Edge;
use rayon::prelude::*;

/// Required clearances for which shortest paths are kept short, metres.
pub const CLEARANCE_CLASSES_M: [f32; 3] = [0.3, 0.8, 1.2];
/// Share of the kept edges beyond the forest that join nearest neighbours. A larger share shortens
/// the longest detours, a smaller one the typical detours; measured on the scanned maps of
/// `tests/tests/boards_hold.rs`.
const NEAREST_EDGE_SHARE: f32 = 0.65;
/// Number of nodes from which shortest paths are counted.
const PATH_SOURCES: usize = 64;
/// Rounds in which the far edges are chosen; a third round would gain a tenth of what the second
/// does.
const FAR_EDGE_ROUNDS: usize = 2;
/// Longest detour around an edge, as a multiple of the edge's length; a longer detour counts as
/// this long.
const MAX_DETOUR_RATIO: f32 = 1.5;

/// Keeps at most `most` of the edges, in their order; `None` if so few edges cannot keep every
/// connected pair of nodes connected.
pub fn limit_edges(nodes: &[Point], edges: &[Edge], most: usize) -> Option<Vec<Edge>> {
    if edges.len() <= most {
        return Some(edges.to_vec());
    }
    let lengths: Vec<f32> = edges
        .iter()
        .map(|edge| (nodes[usize::from(edge.b)] - nodes[usize::from(edge.a)]).norm())
        .collect();
    let mut kept = widest_forest(nodes.len(), edges);
    let room = most.checked_sub(kept.iter().filter(|&&kept| kept).count())?;
    let near = (room as f32 * NEAREST_EDGE_SHARE) as usize;
    let rows = adjacency_lists(nodes.len(), edges, &lengths);
    let ranks = edge_ranks(&rows, edges.len());
    keep_first(&mut kept, near, &lengths, |i| ranks[i]);
    let usages: Vec<Vec<u32>> =
        clearance_classes().map(|class| edge_usage(&rows, edges.len(), class)).collect();
    let far = room - near;
    for round in 0..FAR_EDGE_ROUNDS {
        let losses = path_length_losses(&rows, &usages, &kept);
        // `f32` is not `Ord`; non-negative floats order like their bits.
        let most = far * (round + 1) / FAR_EDGE_ROUNDS - far * round / FAR_EDGE_ROUNDS;
        keep_first(&mut kept, most, &lengths, |i| Reverse(losses[i].to_bits()));
    }
    Some(edges.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(edge, _)| *edge).collect())
}

/// A half-edge: an edge as seen from one of its two nodes.
#[derive(Clone, Copy)]
struct OutgoingEdge {
    /// Index of the other node.
    to: u16,
    /// How many of [`CLEARANCE_CLASSES_M`] the edge's clearance exceeds.
    clearance_class: u8,
    /// Length of the edge, metres.
    length_m: f32,
    /// Index of the edge.
    edge: u32,
}

/// The half-edges of each node, shortest first.
fn adjacency_lists(nodes: usize, edges: &[Edge], lengths: &[f32]) -> Vec<Vec<OutgoingEdge>> {
    let mut rows = vec![Vec::new(); nodes];
    for (i, (edge, &length_m)) in edges.iter().zip(lengths).enumerate() {
        let class =
            CLEARANCE_CLASSES_M.iter().filter(|&&required_m| edge.clearance_m > required_m).count()
                as u8;
        for (from, to) in [(edge.a, edge.b), (edge.b, edge.a)] {
            rows[usize::from(from)].push(OutgoingEdge {
                to,
                clearance_class: class,
                length_m,
                edge: i as u32,
            });
        }
    }
    rows.par_iter_mut().for_each(|row| {
        row.sort_unstable_by(|a, b| a.length_m.total_cmp(&b.length_m).then(a.edge.cmp(&b.edge)));
    });
    rows
}

/// The rank of each edge: the number of shorter edges at its node that vehicles of a class can fly;
/// the least of these numbers over both nodes and all classes that can fly the edge itself.
fn edge_ranks(rows: &[Vec<OutgoingEdge>], edges: usize) -> Vec<u32> {
    let mut ranks = vec![u32::MAX; edges];
    for row in rows {
        let mut shorter = [0; CLEARANCE_CLASSES_M.len() + 1];
        for out in row {
            for count in &mut shorter[..=usize::from(out.clearance_class)] {
                let rank = &mut ranks[out.edge as usize];
                *rank = (*rank).min(*count);
                *count += 1;
            }
        }
    }
    ranks
}

/// Marks the edges of a spanning forest of greatest clearances; of equally wide edges it takes the
/// first.
fn widest_forest(nodes: usize, edges: &[Edge]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&a, &b| edges[b].clearance_m.total_cmp(&edges[a].clearance_m).then(a.cmp(&b)));
    let mut root: Vec<u16> = (0..nodes as u16).collect();
    let mut find = |mut node: u16, to: Option<u16>| {
        while root[usize::from(node)] != node {
            let above = root[usize::from(root[usize::from(node)])];
            root[usize::from(node)] = above;
            node = above;
        }
        if let Some(to) = to {
            root[usize::from(node)] = to;
        }
        node
    };
    let mut kept = vec![false; edges.len()];
    for i in order {
        let (a, b) = (find(edges[i].a, None), find(edges[i].b, None));
        if a != b {
            find(a, Some(b));
            kept[i] = true;
        }
    }
    kept
}

/// Keeps the first `count` more edges by `order`; ties go to the shorter edge, then to the lower
/// index.
fn keep_first<O: Ord>(
    kept: &mut [bool],
    count: usize,
    lengths: &[f32],
    order: impl Fn(usize) -> O,
) {
    let mut others: Vec<usize> = (0..kept.len()).filter(|&i| !kept[i]).collect();
    others.sort_by(|&a, &b| {
        order(a).cmp(&order(b)).then(lengths[a].total_cmp(&lengths[b])).then(a.cmp(&b))
    });
    for i in others.into_iter().take(count) {
        kept[i] = true;
    }
}

/// The classes of required clearances, numbered as in [`OutgoingEdge::clearance_class`].
fn clearance_classes() -> impl Iterator<Item = u8> {
    1..=CLEARANCE_CLASSES_M.len() as u8
}

/// For each edge that is not kept, by how many metres shortest paths become longer without it,
/// times its share of all uses of edges by paths of a class; summed over the classes.
/// `usages[class][edge]` is the number of paths over an edge.
fn path_length_losses(rows: &[Vec<OutgoingEdge>], usages: &[Vec<u32>], kept: &[bool]) -> Vec<f32> {
    let is_kept = |out: &&OutgoingEdge| kept[out.edge as usize];
    let kept_rows: Vec<Vec<OutgoingEdge>> =
        rows.iter().map(|row| row.iter().filter(is_kept).copied().collect()).collect();
    let mut losses = vec![0.0; kept.len()];
    for (class, usage) in clearance_classes().zip(usages) {
        let all = usage.iter().map(|&paths| f64::from(paths)).sum::<f64>().max(1.0) as f32;
        let found: Vec<Vec<(u32, f32)>> = (0..rows.len())
            .into_par_iter()
            .map(|node| {
                let is_wanted = |out: &&OutgoingEdge| {
                    usize::from(out.to) > node
                        && usage[out.edge as usize] > 0
                        && !kept[out.edge as usize]
                };
                let wanted: Vec<&OutgoingEdge> = rows[node].iter().filter(is_wanted).collect();
                let Some(longest) = wanted.last() else { return Vec::new() };
                let ways_m = shortest_distances_within(
                    node,
                    &kept_rows,
                    class,
                    MAX_DETOUR_RATIO * longest.length_m,
                );
                let loss = |out: &&OutgoingEdge| {
                    let around_m = ways_m[usize::from(out.to)].min(MAX_DETOUR_RATIO * out.length_m);
                    // By rounding, the detour can come out shorter than the edge.
                    let longer_m = (around_m - out.length_m).max(0.0);
                    (out.edge, usage[out.edge as usize] as f32 / all * longer_m)
                };
                wanted.iter().map(loss).collect()
            })
            .collect();
        for (edge, loss) in found.into_iter().flatten() {
            losses[edge as usize] += loss;
        }
    }
    losses
}

/// Lengths of the shortest paths from `source` to all nodes over edges whose clearance class is at
/// least `class`, metres; infinite where longer than `most_m`.
fn shortest_distances_within(
    source: usize,
    rows: &[Vec<OutgoingEdge>],
    class: u8,
    most_m: f32,
) -> Vec<f32> {
    let mut way_m = vec![f32::INFINITY; rows.len()];
    let mut waiting = BinaryHeap::from([(Reverse(0_u32), source)]);
    way_m[source] = 0.0;
    while let Some((Reverse(bits), node)) = waiting.pop() {
        let here_m = f32::from_bits(bits);
        if here_m > way_m[node] {
            continue;
        }
        for out in rows[node].iter().filter(|out| out.clearance_class >= class) {
            let (to, there_m) = (usize::from(out.to), here_m + out.length_m);
            if there_m < way_m[to] && there_m <= most_m {
                way_m[to] = there_m;
                waiting.push((Reverse(there_m.to_bits()), to));
            }
        }
    }
    way_m
}

/// How many shortest paths lead over each edge, of those from [`PATH_SOURCES`] nodes to all others
/// over edges whose clearance class is at least `class`.
fn edge_usage(rows: &[Vec<OutgoingEdge>], edges: usize, class: u8) -> Vec<u32> {
    let sources = PATH_SOURCES.min(rows.len());
    let searches: Vec<Vec<(u32, u32)>> = (0..sources)
        .into_par_iter()
        .map(|source| shortest_path_edge_counts(source * rows.len() / sources, rows, class))
        .collect();
    let mut usage = vec![0; edges];
    for (edge, paths) in searches.into_iter().flatten() {
        usage[edge as usize] += paths;
    }
    usage
}

/// The edges of the shortest paths from `source` to all nodes over edges whose clearance class is
/// at least `class`, each with the number of these paths that lead over it (Dijkstra 1959).
fn shortest_path_edge_counts(
    source: usize,
    rows: &[Vec<OutgoingEdge>],
    class: u8,
) -> Vec<(u32, u32)> {
    let mut way_m = vec![f32::INFINITY; rows.len()];
    let mut last_edge = vec![None; rows.len()];
    let (mut settled, mut order) = (vec![false; rows.len()], Vec::new());
    // `f32` is not `Ord`; non-negative floats order like their bits.
    let mut waiting = BinaryHeap::from([(Reverse(0_u32), source)]);
    way_m[source] = 0.0;
    while let Some((_, node)) = waiting.pop() {
        if std::mem::replace(&mut settled[node], true) {
            continue;
        }
        order.push(node);
        for out in rows[node].iter().filter(|out| out.clearance_class >= class) {
            let (to, there_m) = (usize::from(out.to), way_m[node] + out.length_m);
            if there_m < way_m[to] {
                (way_m[to], last_edge[to]) = (there_m, Some((node, out.edge)));
                waiting.push((Reverse(there_m.to_bits()), to));
            }
        }
    }
    let mut paths = vec![1; rows.len()];
    let mut used = Vec::with_capacity(order.len());
    for node in order.into_iter().rev() {
        if let Some((before, i)) = last_edge[node] {
            paths[before] += paths[node];
            used.push((i, paths[node]));
        }
    }
    used
}

#[cfg(test)]
mod tests;
