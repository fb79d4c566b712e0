use super::*;

/// Horizontally and in height: RMS and maximum of the position error in a flight of a minute,
/// the same of its drift in 10 s, and RMS of the velocity error, horizontal first.
struct FlightErrors {
    across: [f32; 4],
    up: [f32; 4],
    velocity: [f32; 2],
}

fn flight(estimator: EstimatorErrors, autopilot: SimulatedKind, seed: u64) -> FlightErrors {
    let mut errors = EstimateErrorState::new(estimator, autopilot, seed);
    let (mut positions, mut across_v, mut up_v) = (Vec::new(), 0.0, 0.0);
    for _ in 0..3000 {
        errors.advance();
        positions.push(errors.position);
        across_v += errors.velocity.xy().norm_squared() / 2.0;
        up_v += errors.velocity.z * errors.velocity.z;
    }
    let stats = |values: Vec<f32>| {
        let squares: f32 = values.iter().map(|v| v * v).sum();
        [(squares / values.len() as f32).sqrt(), values.iter().fold(0.0, |a: f32, b| a.max(*b))]
    };
    let drifts: Vec<Point> = positions.iter().zip(&positions[500..]).map(|(a, b)| b - a).collect();
    let both = |of: &dyn Fn(&Point) -> f32| {
        let (e, d) = (positions.iter().map(of).collect(), drifts.iter().map(of).collect());
        let ([a, b], [c, d]) = (stats(e), stats(d));
        [a, b, c, d]
    };
    FlightErrors {
        across: both(&|p| p.xy().norm()),
        up: both(&|p| p.z.abs()),
        velocity: [(across_v / 3000.0).sqrt(), (up_v / 3000.0).sqrt()],
    }
}

/// The median over seeds lies in the recorded range, and nine of ten values lie between half of
/// its lower end and 1.25 times its upper end.
fn holds(name: &str, mut values: Vec<f32>, range: [f32; 2]) {
    values.sort_by(f32::total_cmp);
    let at = |share: f32| values[(share * (values.len() - 1) as f32) as usize];
    println!("{name}: {:.3} {:.3} {:.3}, recorded {range:?}", at(0.05), at(0.5), at(0.95));
    assert!((range[0]..=range[1]).contains(&at(0.5)), "{name}: median {}", at(0.5));
    assert!(at(0.05) >= 0.5 * range[0] && at(0.95) <= 1.25 * range[1] + 0.01, "{name}");
}

#[test]
fn the_model_s_errors_lie_in_the_ranges_of_the_recorded_flights() {
    let ranges = [
        (
            SimulatedKind::Px4,
            [[0.13, 0.27], [0.26, 0.72], [0.20, 0.41], [0.38, 1.03]],
            [[0.11, 0.51], [0.27, 1.09], [0.11, 0.57], [0.21, 1.42]],
            [[0.14, 0.26], [0.10, 0.20]],
        ),
        (
            SimulatedKind::Ardupilot,
            [[0.02, 0.04], [0.03, 0.11], [0.01, 0.04], [0.03, 0.11]],
            [[0.01, 0.03], [0.02, 0.08], [0.01, 0.04], [0.02, 0.08]],
            [[0.015, 0.025], [0.0, 0.005]],
        ),
    ];
    for (autopilot, across, up, velocity) in ranges {
        let flights: Vec<FlightErrors> =
            (0..100).map(|seed| flight(EstimatorErrors::Recorded, autopilot, seed)).collect();
        for k in 0..4 {
            let what = ["RMS", "greatest", "RMS of drift", "greatest drift"][k];
            holds(
                &format!("{autopilot:?} across {what}"),
                flights.iter().map(|f| f.across[k]).collect(),
                across[k],
            );
            holds(
                &format!("{autopilot:?} up {what}"),
                flights.iter().map(|f| f.up[k]).collect(),
                up[k],
            );
        }
        for k in 0..2 {
            let what = ["across", "up"][k];
            let values = flights.iter().map(|f| f.velocity[k]).collect();
            holds(&format!("{autopilot:?} velocity {what}"), values, velocity[k]);
        }
    }
}

#[test]
fn rtk_stays_within_what_it_promises() {
    for seed in 0..200 {
        for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
            let f = flight(EstimatorErrors::Rtk, autopilot, seed);
            assert!(f.across[1] <= 0.1 && f.up[1] <= 0.15 && f.across[1] > 0.01);
        }
    }
}

#[test]
fn the_same_seed_errs_alike_and_a_perfect_estimate_never() {
    let run = |seed| flight(EstimatorErrors::Recorded, SimulatedKind::Px4, seed).across;
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
    assert_eq!(flight(EstimatorErrors::Perfect, SimulatedKind::Px4, 3).across, [0.0; 4]);
}
