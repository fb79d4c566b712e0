//! The best route that Fields2Cover finds for a field, chosen from those that its driver prints.
//!
//! Without obstacles all of its lane orders over the field as one cell are compared, with straight
//! connections. With obstacles a straight connection may cross one, so it is led around by the
//! shortest path instead; and its orders in one cell compete with its boustrophedon decomposition:
//! the cells in their best order, each in its best direction (its own planner for that needs
//! OR-tools). Both choices favour Fields2Cover: no route that it offers without OR-tools is shorter
//! and crosses no obstacle.

use anyhow::{Context, Result};
use planner_core::coverage::Flat;

/// East and north, metres.
pub type EastNorth = [f64; 2];

pub fn to_f64(at: Flat) -> EastNorth {
    [f64::from(at.x), f64::from(at.y)]
}

/// Scale of the obstacles: paths run along their borders, where Fields2Cover's lanes end, and must
/// not count as crossing them.
const OBSTACLE_SCALE: f64 = 0.999;
/// Depth up to which a path that enters an obstacle counts as only touching it, metres.
const MAX_TOUCH_DEPTH_M: f64 = 1e-6;
/// Most cells of a decomposition whose orders are all compared.
const MAX_CELLS: usize = 14;
/// Number of grid cells across a lane by which the swept share is measured.
const GRID_CELLS_PER_LANE: f64 = 10.0;

/// Fields2Cover's best route over a field.
#[derive(Clone, Debug)]
pub struct BestRoute {
    /// Length of all lanes, metres.
    pub lanes_m: f64,
    /// Length of all lanes and connections, metres.
    pub total_m: f64,
    /// Planning time, microseconds.
    pub time_us: f64,
    /// Number of connections that would cross an obstacle if flown straight.
    pub crossings: usize,
    /// Name of its lane order, or `N cells`.
    pub name: String,
    /// The lanes, each by both ends.
    pub lanes: Vec<[EastNorth; 2]>,
}

/// Share of a field that lies beside a lane by at most half of `lane_m`.
pub fn swept_share(
    lanes: &[[EastNorth; 2]],
    lane_m: f64,
    holds: impl Fn(&EastNorth) -> bool,
    [low, high]: [EastNorth; 2],
) -> f64 {
    let cell_m = lane_m / GRID_CELLS_PER_LANE;
    let count = |axis: usize| ((high[axis] - low[axis]) / cell_m).ceil() as usize;
    let (mut all, mut swept) = (0_u64, 0_u64);
    for row in 0..count(1) {
        for column in 0..count(0) {
            let at =
                [(column, low[0]), (row, low[1])].map(|(k, from)| from + (k as f64 + 0.5) * cell_m);
            if holds(&at) {
                all += 1;
                swept += u64::from(lanes.iter().any(|lane| is_swept(lane, lane_m, &at)));
            }
        }
    }
    swept as f64 / all.max(1) as f64
}

fn is_swept([from, to]: &[EastNorth; 2], lane_m: f64, at: &EastNorth) -> bool {
    let ([x, y], [u, v]) = ([to[0] - from[0], to[1] - from[1]], [at[0] - from[0], at[1] - from[1]]);
    let length_m = x.hypot(y);
    let (along_m, beside_m) = ((x * u + y * v) / length_m, (x * v - y * u).abs() / length_m);
    (0.0..=length_m).contains(&along_m) && beside_m <= lane_m / 2.0 + 1e-3
}

/// A route over one cell as the driver printed it: both ends of each lane.
struct PrintedRoute {
    cell: usize,
    time_us: f64,
    name: String,
    lanes: Vec<[EastNorth; 2]>,
}

impl PrintedRoute {
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let (cell, time_us) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        let name = words.next()?.to_owned();
        let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
        let lanes = numbers.chunks_exact(4).map(|n| [[n[0], n[1]], [n[2], n[3]]]).collect();
        Some(Self { cell, time_us, name, lanes })
    }

    /// Length of the lanes, length with connections, and number of connections that cross an
    /// obstacle.
    fn measure(&self, obstacles: &Obstacles) -> (f64, f64, usize) {
        obstacles.measure(&self.lanes)
    }
}

fn distance_m(a: &EastNorth, b: &EastNorth) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Convex obstacles, slightly shrunk.
pub struct Obstacles(Vec<Vec<EastNorth>>);

impl Obstacles {
    /// Obstacles with these corners, slightly shrunk.
    pub fn new(rings: impl Iterator<Item = Vec<EastNorth>>) -> Self {
        let shrunk = |ring: Vec<EastNorth>| {
            let middle =
                [0, 1].map(|axis| ring.iter().map(|at| at[axis]).sum::<f64>() / ring.len() as f64);
            let corner = |at: &EastNorth| {
                [0, 1].map(|axis| middle[axis] + OBSTACLE_SCALE * (at[axis] - middle[axis]))
            };
            ring.iter().map(corner).collect()
        };
        Self(rings.map(shrunk).collect())
    }

    /// Length of the lanes, length with the connections around obstacles, and number of connections
    /// that are not straight.
    pub fn measure(&self, lanes: &[[EastNorth; 2]]) -> (f64, f64, usize) {
        let lanes_m = lanes.iter().map(|[from, to]| distance_m(from, to)).sum::<f64>();
        let mut found = (lanes_m, lanes_m, 0);
        for pair in lanes.windows(2) {
            found.1 += self.shortest_path_m(&pair[0][1], &pair[1][0]);
            found.2 += usize::from(!self.is_line_free(&pair[0][1], &pair[1][0]));
        }
        found
    }

    /// Corners of each obstacle, slightly shrunk.
    pub fn rings(&self) -> &[Vec<EastNorth>] {
        &self.0
    }

    /// Whether a straight way crosses no obstacle: where it meets a convex ring, the middle between
    /// both crossings is inside.
    fn is_line_free(&self, from: &EastNorth, to: &EastNorth) -> bool {
        self.0.iter().all(|ring| {
            let (x, y) = (to[0] - from[0], to[1] - from[1]);
            let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
            let turn = ring_orientation(ring);
            for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                // The inside is to the left of the edges of a ring that turns left. `side` is in
                // metres. A leg along an edge is outside.
                let edge = [b[0] - a[0], b[1] - a[1]];
                let length_m = turn * edge[0].hypot(edge[1]);
                let side = (edge[0] * (from[1] - a[1]) - edge[1] * (from[0] - a[0])) / length_m
                    - MAX_TOUCH_DEPTH_M;
                let change = (edge[0] * y - edge[1] * x) / length_m;
                match change {
                    change if change > 0.0 => enters = enters.max(-side / change),
                    change if change < 0.0 => leaves = leaves.min(-side / change),
                    _ if side < 0.0 => return true,
                    _ => {}
                }
            }
            enters >= leaves
        })
    }

    /// Length of the shortest path between two points around the obstacles, from corner to corner.
    fn shortest_path_m(&self, from: &EastNorth, to: &EastNorth) -> f64 {
        if self.is_line_free(from, to) {
            return distance_m(from, to);
        }
        let nodes: Vec<&EastNorth> =
            [from, to].into_iter().chain(self.0.iter().flatten()).collect();
        let mut length_m = vec![f64::INFINITY; nodes.len()];
        let mut done = vec![false; nodes.len()];
        length_m[0] = 0.0;
        while let Some(here) = (0..nodes.len())
            .filter(|k| !done[*k] && length_m[*k].is_finite())
            .min_by(|a, b| length_m[*a].total_cmp(&length_m[*b]))
        {
            done[here] = true;
            for next in 0..nodes.len() {
                if !done[next] && self.is_line_free(nodes[here], nodes[next]) {
                    length_m[next] =
                        length_m[next].min(length_m[here] + distance_m(nodes[here], nodes[next]));
                }
            }
        }
        length_m[1]
    }
}

/// 1 for a ring that turns left (counter-clockwise), else −1.
fn ring_orientation(ring: &[EastNorth]) -> f64 {
    let doubled: f64 =
        ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    doubled.signum()
}

/// The best of the printed routes: over the field as one cell, and over its cells.
///
/// # Errors
/// A line is not a printed route.
pub fn best_routes(text: &str, obstacles: &Obstacles) -> Result<[Option<BestRoute>; 2]> {
    let candidates: Vec<PrintedRoute> = text
        .lines()
        .map(|line| PrintedRoute::parse(line).with_context(|| format!("theirs printed {line:?}")))
        .collect::<Result<_>>()?;
    let whole = candidates.iter().filter(|candidate| candidate.cell == 0).map(|candidate| {
        let (lanes_m, total_m, crossings) = candidate.measure(obstacles);
        BestRoute {
            lanes_m,
            total_m,
            time_us: candidate.time_us,
            crossings,
            name: candidate.name.clone(),
            lanes: candidate.lanes.clone(),
        }
    });
    let whole = whole.min_by(|a, b| a.total_m.total_cmp(&b.total_m));
    Ok([whole, best_route_over_cells(&candidates, obstacles)])
}

/// The best route over the cells in any order, by dynamic programming over the set of cells flown
/// and the route by which the last one was flown; `None` for too many cells.
fn best_route_over_cells(candidates: &[PrintedRoute], obstacles: &Obstacles) -> Option<BestRoute> {
    let ways: Vec<&PrintedRoute> =
        candidates.iter().filter(|c| c.cell > 0 && !c.lanes.is_empty()).collect();
    let mut cells: Vec<usize> = ways.iter().map(|way| way.cell).collect();
    cells.dedup();
    if cells.is_empty() || cells.len() > MAX_CELLS {
        return None;
    }
    let bit = |way: &PrintedRoute| {
        1_usize << cells.iter().position(|cell| *cell == way.cell).unwrap_or(0)
    };
    let measured: Vec<(f64, f64, usize)> = ways.iter().map(|way| way.measure(obstacles)).collect();
    let between = |a: &PrintedRoute, b: &PrintedRoute| {
        let (from, to) = (a.lanes[a.lanes.len() - 1][1], b.lanes[0][0]);
        (obstacles.shortest_path_m(&from, &to), usize::from(!obstacles.is_line_free(&from, &to)))
    };
    let links: Vec<Vec<(f64, usize)>> =
        ways.iter().map(|a| ways.iter().map(|b| between(a, b)).collect()).collect();
    let none = (f64::INFINITY, 0.0, 0);
    let mut found = vec![vec![none; ways.len()]; 1 << cells.len()];
    for (k, way) in ways.iter().enumerate() {
        let (lanes_m, total_m, crossings) = measured[k];
        found[bit(way)][k] = (total_m, lanes_m, crossings);
    }
    for done in 1..found.len() {
        for last in 0..ways.len() {
            let (total_m, lanes_m, crossings) = found[done][last];
            for (next, way) in ways.iter().enumerate() {
                if done & bit(way) != 0 {
                    continue;
                }
                let (own_m, own_total_m, own_crossings) = measured[next];
                let (link_m, crosses) = links[last][next];
                let whole_m = total_m + link_m + own_total_m;
                let slot = &mut found[done | bit(way)][next];
                if whole_m < slot.0 {
                    *slot = (whole_m, lanes_m + own_m, crossings + crosses + own_crossings);
                }
            }
        }
    }
    let (total_m, lanes_m, crossings) =
        found.last()?.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let name = format!("{} cells", cells.len());
    // The lanes of a cell are the same in every direction and order.
    let first = cells.iter().filter_map(|cell| ways.iter().find(|way| way.cell == *cell));
    let lanes = first.flat_map(|way| way.lanes.iter().copied()).collect();
    Some(BestRoute { lanes_m, total_m, time_us: ways[0].time_us, crossings, name, lanes })
}
