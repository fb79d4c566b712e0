use super::*;

/// Whether an expression in a function's body names a set of states.
fn names_set(expression: &str) -> bool {
    let file = syn::parse_file(&format!("fn f() {{ {expression} }}")).unwrap();
    let names = ["Ready", "Climb", "Done"].map(str::to_owned).into();
    !lines_of_state_sets(&file.items, &names).is_empty()
}

#[test]
fn a_pattern_of_two_states_is_a_set() {
    for set in [
        "matches!(state, State::Ready | State::Done)",
        "matches!(state, Ready | Done)",
        "matches!(self.state(), companion::State::Ready | companion::State::Done if late)",
        "matches!(state, Other | State::Ready | State::Done)",
        "match state { State::Ready | State::Done => 1, _ => 2 }",
        "match (state, x) { (State::Ready | State::Done, 1) => 1, _ => 2 }",
        "if let State::Ready | State::Done = state {}",
    ] {
        assert!(names_set(set), "{set}");
    }
    for other in [
        "matches!(state, State::Ready)",
        "matches!(phase, Phase::Ready | Phase::Done)",
        "matches!(state, State::Ready | State::Unknown)",
        "match state { State::Ready => 1, State::Done => 2, _ => 3 }",
        "match (a, b) { (State::Ready, 1) | (State::Done, 2) => 1, _ => 2 }",
        "bits(Ready | Done)",
    ] {
        assert!(!names_set(other), "{other}");
    }
}

#[test]
fn the_states_are_those_of_the_enum() {
    let item = syn::parse_str("enum State { Ready, Done }").unwrap();
    assert_eq!(variant_names(&item), ["Done", "Ready"].map(str::to_owned).into());
}
