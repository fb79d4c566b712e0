use super::State;
use crate::mission::table::{STARTED_BEFORE_ARMING, STARTED_ON_PAD};

fn is_set(predicate: fn(State) -> bool, set: &[State]) -> bool {
    State::ALL.iter().all(|state| predicate(*state) == set.contains(state))
}

#[test]
fn predicates_are_the_tables_sets() {
    assert!(is_set(State::is_started_on_pad, STARTED_ON_PAD));
    assert!(is_set(State::is_started_before_arming, STARTED_BEFORE_ARMING));
}
