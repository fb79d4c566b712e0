//! Checks that the measured flights take off and that their steps are counted.

extern crate std;

use super::*;

#[derive(Default)]
struct Counts {
    steps: usize,
    in_areas: usize,
    filtered: usize,
}

impl Meter for Counts {
    fn call<T>(&mut self, name: &'static str, _bytes: usize, work: impl FnOnce() -> T) -> T {
        self.steps += usize::from(name == STEP_ROW || name == HARD_STEP_ROW);
        self.in_areas += usize::from(name == AREA_STEP_ROW);
        self.filtered += usize::from(name == FILTER_ROW);
        work()
    }
}

#[test]
fn the_filter_is_counted_in_flight() {
    let mut meter = Counts::default();
    for seed in 0..10 {
        let plan = random_plan(&mut Pcg32::seed_from_u64(seed));
        let mut companion = BoardCompanion::new(config()).expect("the settings are good");
        measure_safety_filter(seed, &plan, &mut companion, &mut meter);
    }
    assert_eq!(meter.filtered, 10 * FILTER_ROUNDS);
}

#[test]
fn most_steps_of_a_flight_are_flown() {
    let mut meter = Counts::default();
    let mut flown = 0;
    for seed in 0..10 {
        let plan = random_plan(&mut Pcg32::seed_from_u64(seed));
        let mut companion = BoardCompanion::new(config()).expect("the settings are good");
        flown += measure_flight(seed, &plan, &mut companion, &mut meter);
    }
    assert_eq!(meter.steps, flown);
    assert!(flown > 8 * COUNTED_STEPS, "{flown}");
}

#[test]
fn steps_of_coverage_missions_are_flown() {
    let mut meter = Counts::default();
    let mut flown = 0;
    for seed in 0..12 {
        let plan = random_area_plan(&mut Pcg32::seed_from_u64(seed));
        let mut companion = BoardCompanion::new(area_config()).expect("the settings are good");
        flown += measure_flight(seed, &plan, &mut companion, &mut meter);
        std::println!("{:?}", companion.state());
    }
    assert!(meter.in_areas > flown, "steps before the flight count too");
    assert!(flown > 6 * COUNTED_STEPS, "{flown}");
}
