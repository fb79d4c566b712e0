//! A lower bound on the largest route cost max C_k of every contiguous division of the path.
//!
//! The larger of two bounds. (1) If m vehicles fly, their routes leave out at most the m − 1
//! longest steps between waypoints, each vehicle flies at least to its nearest waypoint and back,
//! and all use different layers. The largest cost is no less than the mean of these m costs; the
//! bound is the least such mean over m. (2) Some vehicle flies to the waypoint that takes longest
//! even for the vehicle that is soonest there and home. O(n · K) for n waypoints and K vehicles.

use crate::Length;
use libm::{fmaxf, fminf};

use super::CoverageError;
use super::pack::CoverageProblem;
use crate::sort;

/// Most vehicles for which the bound can be computed.
const MAX_VEHICLES: usize = 32;

/// The lower bound on max C_k, seconds.
///
/// # Errors
/// Those of [`CoverageProblem::check`] for at most 32 vehicles.
pub fn lower_bound_s<const L: usize, const N: usize>(
    problem: &CoverageProblem<'_, L, N>,
) -> Result<f32, CoverageError> {
    problem.check::<MAX_VEHICLES>()?;
    let fastest = |speed: fn(&super::pack::Vehicle) -> f32| {
        problem.vehicles.iter().map(speed).fold(0.0, fmaxf)
    };
    let cruise_mps = fastest(|v| v.cruise_mps);
    let vertical = |layer: u8| {
        let delays =
            problem.vehicles.iter().map(|vehicle| problem.altitude_delay_s(vehicle, layer));
        delays.fold(f32::INFINITY, fminf)
    };
    let mut longest = LargestValues::new();
    let mut furthest_s: f32 = 0.0;
    let mut nearest_m = [f32::INFINITY; MAX_VEHICLES];
    for lane in problem.tracks.lanes() {
        let step = lane.length_m() / fmaxf((lane.waypoint_count - 1) as f32, 1.0);
        for k in 0..lane.waypoint_count {
            let place = lane.waypoint(k);
            let mut least_s = f32::INFINITY;
            for (near, vehicle) in nearest_m.iter_mut().zip(problem.vehicles) {
                // The straight line: no path around zones is shorter.
                let there_m =
                    (place - vehicle.transit_start).length() + (place - vehicle.home).length();
                *near = fminf(*near, there_m);
                least_s = fminf(least_s, there_m / vehicle.cruise_mps);
            }
            furthest_s = fmaxf(furthest_s, least_s);
            if k > 0 {
                longest.insert(step);
            }
        }
    }
    for pair in problem.tracks.lanes().windows(2) {
        longest.insert(pair[1].start_along_m - pair[0].start_along_m - pair[0].length_m());
    }
    let nearest_m = &mut nearest_m[..problem.vehicles.len()];
    sort::heapsort_by(nearest_m, f32::total_cmp);
    let (mut ground_m, mut delay_s, mut least_s) = (problem.tracks.length_m(), 0.0, f32::INFINITY);
    for (flying, near) in nearest_m.iter().enumerate() {
        ground_m += near - if flying > 0 { longest.values[flying - 1] } else { 0.0 };
        delay_s += vertical(flying as u8 + 1);
        let mean = (ground_m / cruise_mps + delay_s) / (flying + 1) as f32;
        least_s = fminf(least_s, mean);
    }
    Ok(fmaxf(least_s, furthest_s + vertical(1)))
}

/// The largest values inserted so far, in descending order.
struct LargestValues {
    /// The values; 0 where none was inserted.
    values: [f32; MAX_VEHICLES],
}

impl LargestValues {
    fn new() -> Self {
        Self { values: [0.0; MAX_VEHICLES] }
    }

    /// Inserts a value; the least value is dropped if there is no room.
    fn insert(&mut self, value: f32) {
        let at = self.values.partition_point(|held| *held >= value);
        if at < MAX_VEHICLES {
            self.values[at..].rotate_right(1);
            self.values[at] = value;
        }
    }
}
