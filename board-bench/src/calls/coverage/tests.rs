extern crate std;

use std::boxed::Box;

use super::*;

struct Uncounted;

impl Meter for Uncounted {
    fn call<T>(&mut self, _: &'static str, _: usize, work: impl FnOnce() -> T) -> T {
        work()
    }
}

#[test]
fn all_calls_are_made_and_the_sum_is_the_same_again() {
    let mut lent = Box::<CoverageWorkspace>::default();
    let first = measure_coverage_calls(&mut Uncounted, &mut lent);
    assert_eq!(measure_coverage_calls(&mut Uncounted, &mut lent), first);
    std::println!("lent {} bytes", size_of::<CoverageWorkspace>());
}
