use super::*;

#[test]
fn modes_split_into_main_and_sub() {
    assert_eq!(mode_params(OFFBOARD), (6.0, 0.0));
    assert_eq!(mode_params(LAND), (4.0, 6.0));
    assert_eq!(mode_params(RTL), (4.0, 5.0));
    assert_eq!(mode_params(HOLD), (4.0, 3.0));
}
