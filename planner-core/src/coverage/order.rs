//! The order in which lanes are flown, and each one's direction: the shortest way from lane to lane.
//!
//! A convex area has one lane a strip, and they are flown back and forth (CPP §3.2.1), from the end where that joins them by
//! less. Elsewhere a first order takes the
//! nearest end each time; then parts are turned round (2-opt) and up to three lanes moved (Or-opt) as long as that
//! shortens the way, or until the looks are used up. Both ends of the way are free. O(n²) distances a round, bounded by
//! `steps_left`.

use super::Flat;
use super::lanes::Lane;
use super::transit::Transit;
use crate::Length;

/// Least shortening of the tour that counts, metres: a smaller gain is rounding.
const MIN_GAIN_M: f32 = 1e-3;
/// Most lanes that Or-opt moves together.
const MAX_MOVED_LANES: usize = 3;

/// Sorts lanes into the order and the directions in which they are flown.
pub(super) fn order_lanes<const N: usize>(lanes: &mut [Lane], transit: &Transit<'_, N>, looks: u32) {
    if lanes.windows(2).all(|pair| pair[0].strip < pair[1].strip) {
        let first = usize::from(!should_reverse_first(lanes));
        for lane in lanes.iter_mut().skip(first).step_by(2) {
            lane.reverse();
        }
        return;
    }
    order_nearest_first(lanes, transit);
    let mut search = LaneOrderSearch { transit, steps_left: looks };
    while search.two_opt(lanes) | search.or_opt(lanes) {}
}

/// Whether lanes in a row, flown back and forth, are joined by less if the first one is turned.
fn should_reverse_first(lanes: &[Lane]) -> bool {
    let mut gain_m = 0.0;
    for (i, pair) in lanes.windows(2).enumerate() {
        let longer_m = (pair[1].to - pair[0].to).length() - (pair[1].from - pair[0].from).length();
        gain_m += if i % 2 == 0 { longer_m } else { -longer_m };
    }
    gain_m > MIN_GAIN_M
}

/// Order that begins with the first lane and always goes to the nearest end.
fn order_nearest_first<const N: usize>(lanes: &mut [Lane], transit: &Transit<'_, N>) {
    for done in 1..lanes.len() {
        let here = lanes[done - 1].to;
        let mut best = (f32::INFINITY, done, false);
        for (i, lane) in lanes.iter().enumerate().skip(done) {
            for (end, turned) in [(lane.from, false), (lane.to, true)] {
                // No way is shorter than the straight one.
                if (end - here).length() < best.0 {
                    let way = transit.distance_m(&here, &end);
                    if way < best.0 {
                        best = (way, i, turned);
                    }
                }
            }
        }
        lanes.swap(done, best.1);
        if best.2 {
            lanes[done].reverse();
        }
    }
}

struct LaneOrderSearch<'t, 'a, const N: usize> {
    transit: &'t Transit<'a, N>,
    steps_left: u32,
}

impl<const N: usize> LaneOrderSearch<'_, '_, N> {
    /// Uses up one search step. Returns false if none is left.
    fn take_search_step(&mut self) -> bool {
        let left = self.steps_left > 0;
        self.steps_left = self.steps_left.saturating_sub(1);
        left
    }

    /// Length between two lane ends; zero where the path begins or ends.
    fn transit_length_m(&self, from: Option<Flat>, to: Option<Flat>) -> f32 {
        match (from, to) {
            (Some(from), Some(to)) => self.transit.distance_m(&from, &to),
            _ => 0.0,
        }
    }

    /// 2-opt: reverses parts of the order where that shortens the path.
    fn two_opt(&mut self, lanes: &mut [Lane]) -> bool {
        let mut gained = false;
        for i in 0..lanes.len() {
            for j in i..lanes.len() {
                if !self.take_search_step() {
                    return false;
                }
                let before = i.checked_sub(1).map(|k| lanes[k].to);
                let after = lanes.get(j + 1).map(|lane| lane.from);
                let (from, to) = (lanes[i].from, lanes[j].to);
                let old = self.transit_length_m(before, Some(from)) + self.transit_length_m(Some(to), after);
                // No way is shorter than the straight one.
                if straight_distance_m(before, to) + straight_distance_m(after, from) > old - MIN_GAIN_M {
                    continue;
                }
                let new = self.transit_length_m(before, Some(to)) + self.transit_length_m(Some(from), after);
                if new < old - MIN_GAIN_M {
                    reverse_lanes(&mut lanes[i..=j]);
                    gained = true;
                }
            }
        }
        gained
    }

    /// Or-opt: moves up to [`MAX_MOVED_LANES`] lanes that follow each other, as they are or turned round.
    fn or_opt(&mut self, lanes: &mut [Lane]) -> bool {
        let mut gained = false;
        let count = lanes.len();
        for len in 1..=MAX_MOVED_LANES.min(count.saturating_sub(1)) {
            for i in 0..=count - len {
                let Some((to, turned)) = self.best_insertion(lanes, i, len) else { continue };
                if turned {
                    reverse_lanes(&mut lanes[i..i + len]);
                }
                if to < i {
                    lanes[to..i + len].rotate_right(len);
                } else {
                    lanes[i..to].rotate_left(len);
                }
                gained = true;
            }
        }
        gained && self.steps_left > 0
    }

    /// The best place for `len` lanes from `i` on: they would stand before the lane that is at it now.
    fn best_insertion(&mut self, lanes: &[Lane], i: usize, len: usize) -> Option<(usize, bool)> {
        let (from, to) = (lanes[i].from, lanes[i + len - 1].to);
        let before = i.checked_sub(1).map(|k| lanes[k].to);
        let after = lanes.get(i + len).map(|lane| lane.from);
        let saved = self.transit_length_m(before, Some(from)) + self.transit_length_m(Some(to), after)
            - self.transit_length_m(before, after);
        let mut best = (MIN_GAIN_M, None);
        for place in (0..i).chain(i + len + 1..=lanes.len()) {
            if !self.take_search_step() {
                break;
            }
            let left = place.checked_sub(1).map(|k| lanes[k].to);
            let right = lanes.get(place).map(|lane| lane.from);
            let gap = self.transit_length_m(left, right);
            for (first, last, turned) in [(from, to, false), (to, from, true)] {
                if saved + gap - straight_distance_m(left, first) - straight_distance_m(right, last) <= best.0
                {
                    continue;
                }
                let gain = saved + gap
                    - self.transit_length_m(left, Some(first))
                    - self.transit_length_m(Some(last), right);
                if gain > best.0 {
                    best = (gain, Some((place, turned)));
                }
            }
        }
        best.1
    }
}

fn straight_distance_m(from: Option<Flat>, to: Flat) -> f32 {
    from.map_or(0.0, |from| (to - from).length())
}

/// Flies lanes the other way, the last one first.
fn reverse_lanes(lanes: &mut [Lane]) {
    lanes.reverse();
    for lane in lanes {
        lane.reverse();
    }
}

#[cfg(test)]
mod tests;
