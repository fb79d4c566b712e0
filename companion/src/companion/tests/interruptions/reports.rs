//! The intent of a vehicle that a pilot or a failsafe flies: it no longer reports what it did
//! before.

use super::*;
use crate::link::intent::ON_DETOUR;

/// States in which a failsafe or a pilot flies the vehicle.
const OTHERS_FLY: [State; 2] = [State::Failsafe, State::PilotControl];

/// A failsafe or the pilot, by the state `by`, flies the vehicle from now on.
fn take(b: &mut Bench, by: State) {
    (b.mode, b.status) = match (by, b.kind) {
        (State::Failsafe, AutopilotKind::Px4) => (px4::RTL, 5),
        (State::Failsafe, AutopilotKind::ArduPilot) => (ardupilot::RTL, 5),
        _ => (pilot_mode(b.kind), 3),
    };
    b.run_until(by, 2.0);
    b.run(0.5);
}

/// Checks that the intent has no points and says that the vehicle may come down.
fn check(b: &Bench, case: &str) {
    let intent = b.companion.own_intent();
    assert!(intent.may_come_down, "{case}: {intent:?}");
    assert!(intent.points.is_empty(), "{case}: {intent:?}");
    assert_eq!(intent.flags & (ON_DETOUR | ON_PLAN), 0, "{case}: {intent:?}");
}

/// A vehicle that stood reported that it stays; once a failsafe or the pilot flies it, it no longer
/// reports that.
#[test]
fn a_vehicle_taken_where_it_stood_no_longer_reports_that_it_stays() {
    let mut held = 0;
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for (&(state, paused_in), by) in
            CASES.iter().flat_map(|case| OTHERS_FLY.map(|by| (case, by)))
        {
            let Some(mut b) = reach(kind, state, paused_in) else { continue };
            b.run(5.0);
            if b.state() != state {
                continue;
            }
            held += usize::from(b.companion.guidance.hold.is_reported());
            take(&mut b, by);
            check(&b, &format!("{kind:?} {state:?} {paused_in:?} {by:?}"));
        }
    }
    assert!(held >= 4, "{held} of these reported that they stay");
}

/// A vehicle taken on a detour does not report the detour either: on a detour it would avoid others
/// before it lands.
#[test]
fn a_vehicle_taken_on_a_detour_no_longer_reports_it() {
    for by in OTHERS_FLY {
        let mut b = reach(AutopilotKind::Px4, State::Blocked, None).expect("it can be blocked");
        b.stuck = false;
        b.answer_detour = Some(Ok(()));
        b.run_until(State::Follow, 60.0);
        assert_ne!(b.companion.own_intent().flags & ON_DETOUR, 0);
        b.run(1.0);
        take(&mut b, by);
        check(&b, &format!("{by:?}"));
    }
}
