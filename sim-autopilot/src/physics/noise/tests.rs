use super::*;

#[test]
fn samples_have_mean_zero_and_variance_one() {
    let mut random = Gaussian::new(7);
    let n = 100_000;
    let (mut sum, mut squares) = (0.0_f64, 0.0_f64);
    for _ in 0..n {
        let x = f64::from(random.sample());
        sum += x;
        squares += x * x;
    }
    assert!((sum / f64::from(n)).abs() < 0.02, "mean {}", sum / f64::from(n));
    assert!((squares / f64::from(n) - 1.0).abs() < 0.02, "variance {}", squares / f64::from(n));
}

#[test]
fn position_error_keeps_the_deviation_asked_for() {
    let mut squares = 0.0_f64;
    let n = 400;
    for seed in 0..n {
        let mut d = Disturbance::new(Point::zeros(), 0.0, 0.5, seed);
        for _ in 0..50 {
            d.advance();
        }
        squares += f64::from(d.position_error.x).powi(2);
    }
    let sigma = (squares / n as f64).sqrt();
    assert!((0.42..0.58).contains(&sigma), "standard deviation {sigma}");
}

#[test]
fn the_same_seed_gives_the_same_gusts_and_another_does_not() {
    let run = |seed| {
        let mut d = Disturbance::new(Point::new(3.0, 0.0, 0.0), 1.0, 0.0, seed);
        for _ in 0..100 {
            d.advance();
        }
        d.wind
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
    assert_ne!(run(1), Point::new(3.0, 0.0, 0.0));
}

#[test]
fn gusts_come_to_their_peak_and_never_beyond() {
    let peak = 3.0;
    let mut d = Disturbance::new(Point::zeros(), peak, 0.0, 5);
    let (mut strongest, mut squares) = (0.0_f32, 0.0_f64);
    let n = 60_000;
    for _ in 0..n {
        d.advance();
        strongest = strongest.max(d.wind.xy().norm());
        squares += f64::from(d.wind.x).powi(2);
    }
    assert!((0.99 * peak..1.001 * peak).contains(&strongest), "strongest {strongest}");
    let sigma = (squares / f64::from(n)).sqrt();
    assert!((0.8..1.1).contains(&sigma), "standard deviation {sigma}");
}

#[test]
fn switched_off_there_is_neither_gust_nor_error() {
    let mut d = Disturbance::new(Point::new(2.0, 1.0, 0.0), 0.0, 0.0, 3);
    d.advance();
    assert_eq!(d.wind, Point::new(2.0, 1.0, 0.0));
    assert_eq!(d.position_error, Point::zeros());
}
