//! An initial order of lanes: cell after cell, each flown back and forth.
//!
//! A cell is a group of lanes in consecutive strips, one per strip: the boustrophedon decomposition
//! (Choset 2000), made of lanes. From the end of each cell the path goes on to the nearest corner
//! of a cell that is not flown yet. O(cells · lanes + lanes²) sums, and few distances around zones.

use super::lanes::Lane;
use super::transit::TransitGraph;
use crate::Length;

/// Groups lanes into cells. The lanes must be in the lane frame and in the order of their strips.
/// Gives each lane the number of its cell.
pub(super) fn group_into_cells(lanes: &mut [Lane]) {
    let touch = |a: &Lane, b: &Lane| a.from.x < b.to.x && b.from.x < a.to.x;
    let (mut cells, mut below, mut row) = (0, 0, 0);
    for k in 0..lanes.len() {
        let strip = lanes[k].strip;
        if strip != lanes[row].strip {
            (below, row) = (row, k);
        }
        // Candidate: the only lane of the strip before that overlaps this one. The candidate counts
        // only if it overlaps no other lane of this strip.
        let mut under =
            (below..row).filter(|&i| lanes[i].strip + 1 == strip && touch(&lanes[i], &lanes[k]));
        let only = under.next().filter(|_| under.next().is_none());
        let alone = |i: &usize| {
            let own = lanes[row..].iter().take_while(|lane| lane.strip == strip);
            own.filter(|lane| touch(&lanes[*i], lane)).count() == 1
        };
        let cell = only.filter(alone).map_or(cells, |i| lanes[i].cell());
        lanes[k].set_cell(cell);
        cells += u32::from(cell == cells);
    }
}

/// Whether a cell begins at lane `k`, or the lanes end there.
pub(super) fn is_cell_boundary(lanes: &[Lane], k: usize) -> bool {
    k == 0 || k == lanes.len() || lanes[k - 1].cell() != lanes[k].cell()
}

/// Sorts lanes that are grouped into cells, and turns them so that each cell is flown back and
/// forth. The first cell comes first, then each time, of the cells that are left, the one with the
/// corner nearest to the end of the cell before.
pub(super) fn order_cells<const N: usize>(lanes: &mut [Lane], transit: &TransitGraph<'_, N>) {
    for k in 1..lanes.len() {
        let place = lanes[..k].partition_point(|lane| lane.cell() <= lanes[k].cell());
        lanes[place..=k].rotate_right(1);
    }
    let mut turned = false;
    for k in 0..lanes.len() {
        turned = !is_cell_boundary(lanes, k) && !turned;
        if turned {
            lanes[k].reverse();
        }
    }
    let mut done = end_of_cell(lanes, 0);
    while done < lanes.len() {
        let (from, how) = nearest_cell(lanes, done, transit);
        let len = end_of_cell(lanes, from) - from;
        lanes[done..from + len].rotate_right(len);
        let cell = &mut lanes[done..done + len];
        if how.from_last_lane {
            cell.reverse();
        }
        if how.lanes_reversed {
            cell.iter_mut().for_each(Lane::reverse);
        }
        done += len;
    }
}

/// How a cell is flown: whether from its last lane to its first, and whether each lane is reversed.
#[derive(Clone, Copy, Default)]
struct CellTraversal {
    from_last_lane: bool,
    lanes_reversed: bool,
}

/// Finds, among the cells from lane `done` on, the one with the corner nearest to the end of the
/// lane before `done`. Returns the index of its first lane, and how the cell is then flown.
fn nearest_cell<const N: usize>(
    lanes: &[Lane],
    done: usize,
    transit: &TransitGraph<'_, N>,
) -> (usize, CellTraversal) {
    let here = lanes[done - 1].to;
    let mut best = (f32::INFINITY, done, CellTraversal::default());
    let mut from = done;
    while from < lanes.len() {
        let to = end_of_cell(lanes, from);
        for (lane, from_last_lane) in [(&lanes[from], false), (&lanes[to - 1], true)] {
            for (corner, lanes_reversed) in [(lane.from, false), (lane.to, true)] {
                // No path around zones is shorter than the straight line.
                if (corner - here).length() < best.0 {
                    let way = transit.distance_m(&here, &corner);
                    if way < best.0 {
                        best = (way, from, CellTraversal { from_last_lane, lanes_reversed });
                    }
                }
            }
        }
        from = to;
    }
    (best.1, best.2)
}

/// Index of the lane after the cell whose lane `from` is its first.
fn end_of_cell(lanes: &[Lane], from: usize) -> usize {
    (from + 1..lanes.len()).find(|k| is_cell_boundary(lanes, *k)).unwrap_or(lanes.len())
}

#[cfg(test)]
mod tests;
