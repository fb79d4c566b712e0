//! The checker of schedules: flies them at any speeds and measures distances.

extern crate std;

use std::vec::Vec as StdVec;

use super::super::*;
use crate::Point;

/// Flies all vehicles in lock-step along their paths, obeying gates, vehicle `i` at `speeds[i]`.
/// Returns the smallest distance between two vehicles of which one moves, or those that were still
/// under way after `steps` steps of 50 ms.
pub(crate) fn fly<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    speeds: &[f32],
    steps: usize,
) -> Result<f32, StdVec<u8>> {
    let mut ws = ScheduleWorkspace::new();
    let gates: StdVec<Vec<Gate, 1024>> = (0..flights.len())
        .map(|i| {
            let mut out = Vec::new();
            gates(cfg, flights, i, &mut ws, &mut out).unwrap();
            out
        })
        .collect();
    let end = |f: &Flight<W>| {
        if f.task.leaves_pad() { f.path.length_m() + f.descent_m } else { -f.climb_m }
    };
    let place = |f: &Flight<W>, m: f32| {
        let below = fmaxf(-m, fmaxf(m - f.path.length_m(), 0.0));
        f.path.point_at(m).unwrap() - Point::new(0.0, 0.0, below)
    };
    let mut along: StdVec<f32> = flights.iter().map(|f| -f.climb_m).collect();
    let mut smallest = f32::INFINITY;
    for _ in 0..steps {
        for i in 0..flights.len() {
            let shut = |g: &&Gate| {
                let other = flights.iter().position(|f| f.vehicle_id == g.wait_for_id).unwrap();
                g.at_m >= along[i] - 0.01 && along[other] < g.open_from_progress_m
            };
            let free = gates[i].iter().filter(shut).map(|g| g.at_m).fold(f32::INFINITY, fminf);
            // `open_from_progress_m` lies slightly beyond the end of the last timed segment.
            let goal = end(&flights[i]) + if flights[i].task.leaves_pad() { 0.02 } else { 0.0 };
            along[i] = fmaxf(along[i], fminf(fminf(along[i] + speeds[i] * 0.05, free), goal));
        }
        let moves = |i: usize| along[i] > -flights[i].climb_m && along[i] < end(&flights[i]);
        for i in 0..flights.len() {
            for j in (0..i).filter(|&j| moves(i) || moves(j)) {
                let apart = place(&flights[i], along[i]) - place(&flights[j], along[j]);
                smallest = fminf(smallest, apart.norm());
            }
        }
        if (0..flights.len()).all(|i| along[i] >= end(&flights[i])) {
            return Ok(smallest);
        }
    }
    Err((0..flights.len())
        .filter(|&i| along[i] < end(&flights[i]))
        .map(|i| flights[i].vehicle_id)
        .collect())
}
