use super::State;
use crate::mission::table::{ON_PAD, STARTED_ON_PAD};

fn is_set(predicate: fn(State) -> bool, set: &[State]) -> bool {
    State::ALL.iter().all(|state| predicate(*state) == set.contains(state))
}

#[test]
fn predicates_are_the_tables_sets() {
    assert!(is_set(State::is_on_pad, ON_PAD));
    assert!(is_set(State::is_before_arming, STARTED_ON_PAD));
}
