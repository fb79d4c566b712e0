use super::*;

#[test]
fn a_setpoint_is_missed_only_while_more_are_to_come() {
    let setpoints = SetpointGaps::new();
    assert_eq!(setpoints.since_last_ms(1000), None);
    setpoints.note_setpoint(1000);
    setpoints.note_setpoint(1050);
    assert_eq!(
        (setpoints.since_last_ms(1050), setpoints.since_last_ms(1500)),
        (Some(0), Some(450))
    );
    setpoints.end_stream(1500);
    assert_eq!(setpoints.since_last_ms(9000), None);
    setpoints.begin_stream(9000);
    setpoints.note_setpoint(9000);
    assert_eq!(setpoints.take_setpoint_stats(9000), Some([3, 450]));
    assert_eq!(setpoints.take_setpoint_stats(9000), None);
}

#[test]
fn the_watchdog_is_fed_only_while_tasks_come_by_and_setpoints_flow() {
    let shell = Shell::new();
    assert!(shell.may_feed_watchdog_at(19_999) && !shell.may_feed_watchdog_at(20_000), "it starts");
    shell.has_companion.store(true, Ordering::Relaxed);
    let come_by =
        |ms| shell.checked_in_ms.iter().for_each(|seen| seen.store(ms, Ordering::Relaxed));
    come_by(1000);
    assert!(shell.may_feed_watchdog_at(1399) && !shell.may_feed_watchdog_at(1400));
    come_by(5000);
    shell.setpoints.begin_stream(5000);
    assert!(shell.may_feed_watchdog_at(5399));
    come_by(5300);
    assert!(!shell.may_feed_watchdog_at(5400), "the first setpoint is late");
    shell.setpoints.note_setpoint(5400);
    assert!(shell.may_feed_watchdog_at(5400));
    shell.checked_in_ms[TIMER_TASK].store(4000, Ordering::Relaxed);
    assert!(!shell.may_feed_watchdog_at(5400), "one task hangs");
}
