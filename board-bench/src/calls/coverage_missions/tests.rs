extern crate std;

use std::boxed::Box;

use super::*;

struct Uncounted;

impl Meter for Uncounted {
    fn call<T>(&mut self, name: &'static str, _: usize, work: impl FnOnce() -> T) -> T {
        let began = std::time::Instant::now();
        let result = work();
        std::println!("{name}: {:?}", began.elapsed());
        result
    }
}

#[test]
fn all_flights_are_planned_and_the_sum_is_the_same_again() {
    let mut out = Box::new(Flights::new());
    let mut area = Box::<CoveragePlanWorkspace>::default();
    let mut lent = Box::<CoverageWorkspace>::default();
    let mut sums = || {
        [
            measure_missions(&mut Uncounted, &mut area, &mut out),
            coverage_flights::measure_plan_parts(&mut Uncounted, &mut lent, &mut out),
        ]
    };
    let first = sums();
    assert_eq!(sums(), first);
}
