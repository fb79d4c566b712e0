//! A first order of lanes: cells, each flown back and forth, one after the other.
//!
//! Lanes that follow each other, one a strip, are a cell: the boustrophedon decomposition
//! (Choset 2000) of the lanes themselves. From each cell the way goes on to the nearest corner of
//! another. O(cells · lanes + lanes²) sums, and few distances.

use super::lanes::Lane;
use super::transit::Transit;
use crate::Length;

/// Groups lanes, in the lanes' frame and in the order of their strips, into cells. `first` of a
/// lane becomes the number of its cell.
pub(super) fn group_into_cells(lanes: &mut [Lane]) {
    let touch = |a: &Lane, b: &Lane| a.from.x < b.to.x && b.from.x < a.to.x;
    let (mut cells, mut below, mut row) = (0, 0, 0);
    for k in 0..lanes.len() {
        let strip = lanes[k].strip;
        if strip != lanes[row].strip {
            (below, row) = (row, k);
        }
        // The only lane of the strip before that this one touches, if nothing else touches that
        // one.
        let mut under =
            (below..row).filter(|&i| lanes[i].strip + 1 == strip && touch(&lanes[i], &lanes[k]));
        let only = under.next().filter(|_| under.next().is_none());
        let alone = |i: &usize| {
            let own = lanes[row..].iter().take_while(|lane| lane.strip == strip);
            own.filter(|lane| touch(&lanes[*i], lane)).count() == 1
        };
        lanes[k].first = only.filter(alone).map_or(cells, |i| lanes[i].first);
        cells += u32::from(lanes[k].first == cells);
    }
}

/// Whether a cell ends before this lane.
pub(super) fn is_break(lanes: &[Lane], k: usize) -> bool {
    k == 0 || k == lanes.len() || lanes[k - 1].first != lanes[k].first
}

/// Sorts lanes that are grouped by cells: begins with the first cell and always goes to the nearest
/// corner of another.
pub(super) fn order_cells<const N: usize>(lanes: &mut [Lane], transit: &Transit<'_, N>) {
    for k in 1..lanes.len() {
        let place = lanes[..k].partition_point(|lane| lane.first <= lanes[k].first);
        lanes[place..=k].rotate_right(1);
    }
    let mut turned = false;
    for k in 0..lanes.len() {
        turned = !is_break(lanes, k) && !turned;
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
        if how.backwards {
            cell.reverse();
        }
        if how.turned {
            cell.iter_mut().for_each(Lane::reverse);
        }
        done += len;
    }
}

/// How a cell is entered: from its last lane, and at the end of that lane.
#[derive(Clone, Copy, Default)]
struct Entry {
    backwards: bool,
    turned: bool,
}

/// The first lane of the cell, from lane `done` on, whose corner is nearest to the end of the lane
/// before, and the corner.
fn nearest_cell<const N: usize>(
    lanes: &[Lane],
    done: usize,
    transit: &Transit<'_, N>,
) -> (usize, Entry) {
    let here = lanes[done - 1].to;
    let mut best = (f32::INFINITY, done, Entry::default());
    let mut from = done;
    while from < lanes.len() {
        let to = end_of_cell(lanes, from);
        for (lane, backwards) in [(&lanes[from], false), (&lanes[to - 1], true)] {
            for (corner, turned) in [(lane.from, false), (lane.to, true)] {
                // No way is shorter than the straight one.
                if (corner - here).length() < best.0 {
                    let way = transit.distance_m(&here, &corner);
                    if way < best.0 {
                        best = (way, from, Entry { backwards, turned });
                    }
                }
            }
        }
        from = to;
    }
    (best.1, best.2)
}

fn end_of_cell(lanes: &[Lane], from: usize) -> usize {
    (from + 1..lanes.len()).find(|k| is_break(lanes, *k)).unwrap_or(lanes.len())
}

#[cfg(test)]
mod tests;
