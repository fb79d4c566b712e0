//! Departure times of the planned flights of a coverage mission. Routes of two vehicles may meet at
//! a waypoint, and transits cross the climbs and descents of others. The vehicle that flies longest
//! departs first; each other departs as soon as its planned flight keeps the separation from all
//! flights that are already timed.
//!
//! Planned positions are compared every `COMPARISON_STEP_S`, at cruise speed without braking at
//! corners. Real flights deviate from that: on board the safety filter keeps vehicles apart. These
//! departures only see to it that the filter seldom has to act.

use planner_core::Point;

use super::flight::FlightPoint;

/// Time between two comparisons of the vehicles' planned positions, seconds.
const COMPARISON_STEP_S: f32 = 0.25;
/// Time between two departures that are tried, seconds.
const DEPARTURE_STEP_S: f32 = 2.0;
/// A vehicle within this horizontal distance of its pad is over its pad, metres.
const ABOVE_PAD_WITHIN_M: f32 = 0.01;
/// Latest departure that is tried, seconds after the round begins.
const MAX_GROUND_WAIT_S: f32 = 900.0;

/// One planned flight; its times count from its own departure.
pub struct DepartureFlight<'a> {
    /// Points of the flight.
    pub points: &'a [FlightPoint],
    /// Time at which each point is passed, seconds after the departure.
    pub times_s: &'a [f32],
}

/// Departure time of each flight of a round (one sortie of each vehicle), seconds after the round
/// begins, and the least distance between any two vehicles from the first departure of the two to
/// the last landing of the two, pads included, metres; infinite for one vehicle. `None` if some
/// flight has no departure within `MAX_GROUND_WAIT_S` that keeps the separation.
pub fn plan_departures(
    flights: &[DepartureFlight<'_>],
    separation_m: f32,
) -> Option<(Vec<f32>, f32)> {
    let tracks: Vec<Vec<Point>> = flights.iter().map(sample_positions).collect();
    let mut order: Vec<usize> = (0..flights.len()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(tracks[*i].len()));
    let mut delays: Vec<Option<usize>> = vec![None; flights.len()];
    let mut least_m = f32::INFINITY;
    let step = (DEPARTURE_STEP_S / COMPARISON_STEP_S) as usize;
    for &own in &order {
        let gap = |delay: usize| {
            let others =
                order.iter().filter_map(|other| delays[*other].map(|d| (&tracks[*other][..], d)));
            let mut least_m = f32::INFINITY;
            for other in others {
                least_m = least_m.min(min_distance_if_separated_m(
                    (&tracks[own][..], delay),
                    other,
                    separation_m,
                )?);
            }
            Some(least_m)
        };
        let tried = (0..=(MAX_GROUND_WAIT_S / DEPARTURE_STEP_S) as usize).map(|k| k * step);
        let (delay, gap_m) =
            tried.into_iter().find_map(|delay| gap(delay).map(|gap_m| (delay, gap_m)))?;
        delays[own] = Some(delay);
        least_m = least_m.min(gap_m);
    }
    Some((
        delays.iter().map(|delay| delay.unwrap_or(0) as f32 * COMPARISON_STEP_S).collect(),
        least_m,
    ))
}

/// Positions of a vehicle every [`COMPARISON_STEP_S`] of its flight, from its departure on.
fn sample_positions(flight: &DepartureFlight<'_>) -> Vec<Point> {
    let end_s = flight.times_s.last().copied().unwrap_or(0.0);
    let mut next = 1;
    let place = |step: usize| {
        let time_s = step as f32 * COMPARISON_STEP_S;
        while next + 1 < flight.times_s.len() && flight.times_s[next] < time_s {
            next += 1;
        }
        let (from, to) = (flight.times_s[next - 1], flight.times_s[next]);
        let share = if to > from { ((time_s - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        flight.points[next - 1].position.lerp(&flight.points[next].position, share)
    };
    (0..=(end_s / COMPARISON_STEP_S).ceil() as usize).map(place).collect()
}

/// Least distance between two flights, each given by its positions and departure delay in steps of
/// [`COMPARISON_STEP_S`], from the first departure to the last landing, metres. `None` if the
/// vehicles come nearer than the separation. Pads may be nearer to each other than the separation:
/// while both vehicles are over their pads, or one stands on its pad, no more than the horizontal
/// distance of the pads is required.
fn min_distance_if_separated_m(
    a: (&[Point], usize),
    b: (&[Point], usize),
    separation_m: f32,
) -> Option<f32> {
    let at = |(track, delay): (&[Point], usize), step: usize| {
        track[step.saturating_sub(delay).min(track.len() - 1)]
    };
    let (pad_a, pad_b) = (a.0[0], b.0[0]);
    let pads_m = separation_m.min((pad_a - pad_b).xy().norm());
    let over = |place: &Point, pad: &Point| (place - pad).xy().norm() < ABOVE_PAD_WITHIN_M;
    let end = (a.0.len() + a.1).max(b.0.len() + b.1);
    let mut least_m = f32::INFINITY;
    for step in a.1.min(b.1)..end {
        let (place_a, place_b) = (at(a, step), at(b, step));
        let gap_m = (place_a - place_b).norm();
        let stands = place_a == pad_a || place_b == pad_b;
        let both_over = over(&place_a, &pad_a) && over(&place_b, &pad_b);
        let enough_m = if stands || both_over { pads_m } else { separation_m };
        if gap_m < enough_m * 0.999 {
            return None;
        }
        least_m = least_m.min(gap_m);
    }
    Some(least_m)
}

#[cfg(test)]
mod tests;
