//! Tests of the failsafes of the simulated PX4: lost setpoints, a lost position, an empty battery.

use super::*;

#[test]
fn lost_setpoints_start_the_return_within_1_23_s_and_a_stream_ends_it_by_itself() {
    let mut bench = Bench::hovering(5.0);
    bench.stream = None;
    let took = bench.until(3.0, Autopilot::in_failsafe);
    assert!((1.0..=1.23).contains(&took), "failsafe after {took} s");
    bench.run(1.1);
    assert_eq!(bench.heartbeat(), (RETURN, 157, 5));
    let gimbal = |f: &Frame| {
        (
            u16::from_le_bytes([f.padded_payload()[28], f.padded_payload()[29]]),
            f.padded_payload()[30],
            f.padded_payload()[31],
        )
    };
    let commands: Vec<_> = bench.of(76).map(|(_, frame)| gimbal(frame)).collect();
    assert_eq!(
        commands,
        [(1001, 1, 0), (1000, 1, 0), (1001, 1, 0)],
        "gimbal commands to component 0"
    );
    bench.stream(20.0, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
    let back = bench.until(1.0, |a| !a.in_failsafe());
    assert!(back < 0.1, "back in Offboard after {back} s");
    bench.run(1.1);
    assert_eq!(bench.heartbeat(), (OFFBOARD, 145, 4));
}

#[test]
fn the_failsafe_is_what_com_obl_rc_act_says() {
    for (action, mode) in [(0, RETURN), (3, RETURN), (4, LAND), (5, HOLD)] {
        let mut bench = Bench::hovering(5.0);
        bench.set_param("COM_OBL_RC_ACT", f32::from_bits(action), 6);
        bench.stream = None;
        bench.run(2.5);
        assert_eq!(bench.heartbeat(), (mode, 157, 5), "COM_OBL_RC_ACT {action}");
    }
}

#[test]
fn com_of_loss_t_acts() {
    let mut bench = Bench::hovering(5.0);
    bench.set_param("COM_OF_LOSS_T", 3.0, 9);
    bench.stream = None;
    let took = bench.until(5.0, Autopilot::in_failsafe);
    assert!((3.0..3.3).contains(&took), "failsafe after {took} s");
}

#[test]
fn slow_streams_keep_offboard_down_to_1_2_hz_and_not_at_0_8() {
    for (rate, keeps) in [(2.5, true), (1.2, true), (0.8, false)] {
        let mut bench = Bench::hovering(5.0);
        bench.stream(rate, setpoint(POSITION, 1, [0.0, 0.0, -5.0], [0.0; 3], 0.0));
        let mut lost = false;
        for _ in 0..2000 {
            bench.run(0.004);
            lost |= bench.autopilot.in_failsafe();
        }
        assert_eq!(lost, !keeps, "{rate} Hz");
    }
}

#[test]
fn a_hold_somebody_commanded_stays_though_setpoints_flow() {
    let mut bench = Bench::hovering(5.0);
    assert_eq!(bench.set_mode(4.0, 3.0), [0, 0]);
    bench.run(3.0);
    assert_eq!(bench.heartbeat(), (HOLD, 157, 4));
}

#[test]
fn what_asks_for_nothing_counts_as_loss() {
    let at = [0.0, 0.0, -5.0];
    let mut wrong_component = setpoint(POSITION, 1, at, [0.0; 3], 0.0);
    wrong_component[51] = 2;
    for (what, payload) in [
        ("mask 0xDFF", setpoint(0xDFF, 1, at, [0.0; 3], 0.0)),
        ("wrong target component", wrong_component),
        ("frame 7", setpoint(VELOCITY, 7, at, [1.0, 0.0, 0.0], 0.0)),
        ("NaN", setpoint(POSITION, 1, [f32::NAN; 3], [0.0; 3], 0.0)),
    ] {
        let mut bench = Bench::hovering(5.0);
        bench.stream(20.0, payload);
        bench.run(1.5);
        assert!(bench.autopilot.in_failsafe(), "{what}");
    }
}

#[test]
fn without_gps_it_lands_where_it_is() {
    let mut bench = Bench::hovering(5.0);
    bench.autopilot.set_gps_fix(GpsFix::Lost);
    bench.run(1.5);
    assert_eq!(bench.heartbeat(), (LAND, 157, 5));
    bench.until(30.0, |a| !a.true_state().armed);
    assert_eq!(bench.arm(), [1]);
}

#[test]
fn com_low_bat_act_3_returns_when_the_battery_is_critical() {
    let mut bench = Bench::hovering(5.0);
    bench.set_param("COM_LOW_BAT_ACT", f32::from_bits(3), 6);
    bench.autopilot.set_battery(0.06);
    bench.run(1.5);
    assert_eq!(bench.heartbeat(), (RETURN, 157, 5));
}
