use super::*;
use crate::coverage::flight::WaypointAction;

fn flight(places: &[[f32; 3]]) -> (Vec<FlightPoint>, Vec<f32>) {
    let point = |p: &[f32; 3]| FlightPoint {
        position: Point::from(*p),
        action: WaypointAction::AtLaneHeight,
        lane: None,
    };
    let points: Vec<FlightPoint> = places.iter().map(point).collect();
    let mut times = vec![0.0];
    for pair in points.windows(2) {
        times.push(times[times.len() - 1] + (pair[1].position - pair[0].position).norm() / 5.0);
    }
    (points, times)
}

#[test]
fn lanes_side_by_side_are_not_flown_at_once() {
    let long = flight(&[[0.0, 0.0, 0.0], [0.0, 0.0, 30.0], [100.0, 0.0, 30.0], [0.0, 9.0, 30.0]]);
    let beside = flight(&[[0.0, 3.0, 0.0], [0.0, 1.0, 30.0], [100.0, 1.0, 30.0]]);
    let timed =
        |f: &'static (Vec<FlightPoint>, Vec<f32>)| DepartureFlight { points: &f.0, times_s: &f.1 };
    let (long, beside) = (&*Box::leak(Box::new(long)), &*Box::leak(Box::new(beside)));
    let (departures_s, least_m) =
        plan_departures(&[timed(beside), timed(long)], 2.0).expect("they can wait");
    assert!(departures_s[1] == 0.0 && departures_s[0] > 0.0, "{departures_s:?}");
    assert!((2.0 * 0.999..3.1).contains(&least_m), "{least_m}");
    // Pads 2 m apart are no reason to come as near over the lanes.
    let (departures_s, least_m) =
        plan_departures(&[timed(beside), timed(long)], 8.0).expect("they can wait");
    assert!(departures_s[0] > 0.0 && least_m < 3.1, "{departures_s:?}, {least_m}");
    let places = |flight: &DepartureFlight<'_>, delay_s: f32| {
        (sample_positions(flight), (delay_s / COMPARISON_STEP_S) as usize)
    };
    let (long_places, beside_places) =
        (places(&timed(long), 0.0), places(&timed(beside), departures_s[0]));
    for step in 0..long_places.0.len() {
        let other =
            beside_places.0[step.saturating_sub(beside_places.1).min(beside_places.0.len() - 1)];
        let own = long_places.0[step];
        let in_the_air = own.z > 29.0 && other.z > 29.0;
        assert!(!in_the_air || (own - other).norm() >= 8.0 * 0.999, "{own} {other}");
    }
    let apart = flight(&[[0.0, 30.0, 0.0], [0.0, 30.0, 30.0], [90.0, 30.0, 30.0]]);
    let apart = &*Box::leak(Box::new(apart));
    assert_eq!(plan_departures(&[timed(long), timed(apart)], 2.0).expect("apart").0, [0.0, 0.0]);
}
