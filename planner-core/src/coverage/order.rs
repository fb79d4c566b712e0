//! The order in which lanes are flown, and the direction of each: a local search for the shortest
//! path along all of them.
//!
//! A convex area has one lane per strip. These are flown back and forth (paper CPP §3.2.1), from
//! the end of the first lane that gives the shorter links. Other areas start from an order by cells
//! (`cells`). Parts of it are reversed (2-opt) and runs of whole cells, at most ten lanes, moved
//! (Or-opt) as long as that shortens the path. Then the lanes that were added beside no-fly zones
//! (`patches`) are inserted where they lengthen the path least. Then the same moves are tried with
//! single lanes instead of cells, until the search steps are used up. Both ends of the path are
//! free. O(n²) sums per round, rounds bounded by the search steps, and O(n²) for the initial order.
//! The lengths of links between consecutive lanes are stored, and a distance around zones is
//! computed only where straight lines would be shorter.

use super::Flat;
use super::cells::{is_cell_boundary, order_cells};
use super::lanes::Lane;
use super::transit::TransitGraph;
use crate::Length;

/// Least shortening of the path that counts, metres: a smaller one may be rounding.
const MIN_GAIN_M: f32 = 1e-3;
/// Most lanes that Or-opt moves together; in the first search these are whole cells.
const MAX_MOVED_LANES: usize = 10;

/// Sorts lanes into the order, and turns them in the directions, in which they are flown. The first
/// `centre_count` of them run along the middle of strips, in the order of the strips, grouped into
/// cells; the others were added beside no-fly zones. The local search tries at most `search_steps`
/// changes of the order.
pub(super) fn order_lanes<const N: usize>(
    lanes: &mut [Lane],
    centre_count: usize,
    transit: &TransitGraph<'_, N>,
    search_steps: u32,
) {
    if lanes.windows(2).all(|pair| pair[0].strip < pair[1].strip) {
        let first = usize::from(!is_shorter_with_first_reversed(lanes));
        for lane in lanes.iter_mut().skip(first).step_by(2) {
            lane.reverse();
        }
        return;
    }
    let mut search = LaneOrderSearch { transit, steps_left: search_steps };
    order_cells(&mut lanes[..centre_count], transit);
    (1..=centre_count).for_each(|k| search.measure_links(&mut lanes[..centre_count], &[k]));
    search.shorten(&mut lanes[..centre_count]);
    (centre_count..lanes.len()).for_each(|k| search.insert_last(&mut lanes[..=k]));
    // From here on each lane is moved by itself: it is a cell of its own.
    for (lane, k) in lanes.iter_mut().zip(0..) {
        lane.set_cell(k);
    }
    search.shorten(lanes);
}

/// Whether lanes in ascending strips, flown back and forth, have shorter links if the first lane is
/// reversed.
fn is_shorter_with_first_reversed(lanes: &[Lane]) -> bool {
    let mut gain_m = 0.0;
    for (i, pair) in lanes.windows(2).enumerate() {
        let longer_m = (pair[1].to - pair[0].to).length() - (pair[1].from - pair[0].from).length();
        gain_m += if i % 2 == 0 { longer_m } else { -longer_m };
    }
    gain_m > MIN_GAIN_M
}

/// Local search over orders, with the lengths of links in the lanes ([`Lane::link_to_next_m`]).
struct LaneOrderSearch<'t, 'a, const N: usize> {
    /// Lengths of links around no-fly zones.
    transit: &'t TransitGraph<'a, N>,
    /// Number of steps that may still be made.
    steps_left: u32,
}

impl<const N: usize> LaneOrderSearch<'_, '_, N> {
    /// Applies Or-opt and 2-opt moves as long as they shorten the path.
    #[inline(never)]
    fn shorten(&mut self, lanes: &mut [Lane]) {
        while self.or_opt(lanes) | self.two_opt(lanes) {}
    }

    /// Uses up one search step. Returns false if none was left.
    fn take_search_step(&mut self) -> bool {
        let left = self.steps_left > 0;
        self.steps_left = self.steps_left.saturating_sub(1);
        left
    }

    /// Length of the link between two lane ends, around zones, metres; 0 if one of them is `None`,
    /// as at an end of the path.
    fn transit_length_m(&self, from: Option<Flat>, to: Option<Flat>) -> f32 {
        match (from, to) {
            (Some(from), Some(to)) => self.transit.distance_m(&from, &to),
            _ => 0.0,
        }
    }

    /// Computes and stores the lengths of the links that lead to the lanes with these indices.
    #[inline(never)]
    fn measure_links(&self, lanes: &mut [Lane], to: &[usize]) {
        for &k in to.iter().filter(|k| **k > 0) {
            let next = lanes.get(k).map(|lane| lane.from);
            let link_m = self.transit_length_m(Some(lanes[k - 1].to), next);
            lanes[k - 1].set_link_to_next_m(link_m);
        }
    }

    /// 2-opt: reverses parts of the order where that shortens the path. Returns whether any part
    /// was reversed; false when the search steps are used up.
    fn two_opt(&mut self, lanes: &mut [Lane]) -> bool {
        let mut gained = false;
        for i in 0..lanes.len() {
            for j in i..lanes.len() {
                if !is_cell_boundary(lanes, i) || !is_cell_boundary(lanes, j + 1) {
                    continue;
                }
                if !self.take_search_step() {
                    return false;
                }
                let old = link_before_m(lanes, i) + lanes[j].link_to_next_m();
                let before = i.checked_sub(1).map(|k| lanes[k].to);
                let after = lanes.get(j + 1).map(|lane| lane.from);
                let (from, to) = (lanes[i].from, lanes[j].to);
                // No link around zones is shorter than the straight line.
                if straight_distance_m(before, to) + straight_distance_m(after, from)
                    > old - MIN_GAIN_M
                {
                    continue;
                }
                let new = self.transit_length_m(before, Some(to))
                    + self.transit_length_m(Some(from), after);
                if new < old - MIN_GAIN_M {
                    reverse_lanes(&mut lanes[i..=j]);
                    self.measure_links(lanes, &[i, j + 1]);
                    gained = true;
                }
            }
        }
        gained
    }

    /// Or-opt: moves up to [`MAX_MOVED_LANES`] consecutive lanes, in the first search whole cells,
    /// as they are or reversed, where that shortens the path. Returns whether any were moved; false
    /// when the search steps are used up.
    fn or_opt(&mut self, lanes: &mut [Lane]) -> bool {
        let mut gained = false;
        let count = lanes.len();
        for len in 1..=MAX_MOVED_LANES.min(count.saturating_sub(1)) {
            for i in 0..=count - len {
                if !is_cell_boundary(lanes, i) || !is_cell_boundary(lanes, i + len) {
                    continue;
                }
                if !self.take_search_step() {
                    return false;
                }
                let Some((to, turned)) = self.best_insertion(lanes, i, len) else { continue };
                if turned {
                    reverse_lanes(&mut lanes[i..i + len]);
                }
                let moved = if to < i {
                    lanes[to..i + len].rotate_right(len);
                    [to, to + len, i + len]
                } else {
                    lanes[i..to].rotate_left(len);
                    [i, to - len, to]
                };
                self.measure_links(lanes, &moved);
                gained = true;
            }
        }
        gained
    }

    /// The place in the order to which `len` lanes from `i` on are best moved, and whether
    /// reversed: they would come before the lane that is there now. `None` if no place shortens the
    /// path.
    fn best_insertion(&mut self, lanes: &[Lane], i: usize, len: usize) -> Option<(usize, bool)> {
        let before = i.checked_sub(1).map(|k| lanes[k].to);
        let after = lanes.get(i + len).map(|lane| lane.from);
        let links_m = link_before_m(lanes, i) + lanes[i + len - 1].link_to_next_m();
        if links_m - before.map_or(0.0, |before| straight_distance_m(after, before)) <= MIN_GAIN_M {
            return None;
        }
        let mut best = Insertion {
            added_length_m: links_m - self.transit_length_m(before, after) - MIN_GAIN_M,
            at: None,
        };
        for place in (0..i).chain(i + len + 1..=lanes.len()).filter(|k| is_cell_boundary(lanes, *k))
        {
            if !self.take_search_step() {
                break;
            }
            self.try_insertion(lanes, place, [lanes[i].from, lanes[i + len - 1].to], &mut best);
        }
        best.at
    }

    /// Inserts the last lane where it lengthens the path least.
    fn insert_last(&self, lanes: &mut [Lane]) {
        let Some((last, others)) = lanes.split_last_mut() else { return };
        last.set_link_to_next_m(0.0);
        let mut best = Insertion { added_length_m: f32::INFINITY, at: None };
        (0..=others.len())
            .for_each(|place| self.try_insertion(others, place, [last.from, last.to], &mut best));
        let Some((place, turned)) = best.at else { return };
        if turned {
            last.reverse();
        }
        lanes[place..].rotate_right(1);
        self.measure_links(lanes, &[place, place + 1]);
    }

    /// Updates `best` if a sequence of lanes with ends `from` and `to` lengthens the path less when
    /// it is inserted before lane `place`.
    #[inline(never)]
    fn try_insertion(
        &self,
        lanes: &[Lane],
        place: usize,
        [from, to]: [Flat; 2],
        best: &mut Insertion,
    ) {
        let left = place.checked_sub(1).map(|k| lanes[k].to);
        let right = lanes.get(place).map(|lane| lane.from);
        let gap = link_before_m(lanes, place);
        for (first, last, turned) in [(from, to, false), (to, from, true)] {
            if straight_distance_m(left, first) + straight_distance_m(right, last) - gap
                >= best.added_length_m
            {
                continue;
            }
            let more_m = self.transit_length_m(left, Some(first))
                + self.transit_length_m(Some(last), right)
                - gap;
            if more_m < best.added_length_m {
                *best = Insertion { added_length_m: more_m, at: Some((place, turned)) };
            }
        }
    }
}

/// The best insertion so far: by how much it lengthens the path, before which lane, and whether the
/// inserted lanes are reversed.
struct Insertion {
    /// By how much the path becomes longer, metres.
    added_length_m: f32,
    /// Index of the lane before which it is, and whether the lanes are reversed; `None` before the
    /// first is found.
    at: Option<(usize, bool)>,
}

/// Length of the link to lane `k` from the one before it, metres; 0 for the first lane.
fn link_before_m(lanes: &[Lane], k: usize) -> f32 {
    k.checked_sub(1).map_or(0.0, |before| lanes[before].link_to_next_m())
}

/// Straight distance between two lane ends, metres; 0 if `from` is `None`, as at an end of the
/// path.
fn straight_distance_m(from: Option<Flat>, to: Flat) -> f32 {
    from.map_or(0.0, |from| (to - from).length())
}

/// Reverses the order and the directions of lanes.
fn reverse_lanes(lanes: &mut [Lane]) {
    lanes.reverse();
    // The link that led to a lane now leads from it.
    for k in 1..lanes.len() {
        let link_m = lanes[k].link_to_next_m();
        lanes[k - 1].set_link_to_next_m(link_m);
    }
    lanes.iter_mut().for_each(Lane::reverse);
}

#[cfg(test)]
mod tests;
