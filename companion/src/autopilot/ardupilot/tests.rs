use super::*;

#[test]
fn the_estimator_is_ready_as_it_was_seen_to_be() {
    // Uninitialised, without GPS, flying, and dead reckoning after a loss.
    for (flags, ready) in
        [(0x400, false), (0xA7, false), (0x33F, true), (0x73F, false), (0x0A7, false)]
    {
        assert_eq!(estimator_ready(flags), ready, "{flags:#x}");
    }
    assert_eq!(mode_params(GUIDED), (4.0, 0.0));
}
