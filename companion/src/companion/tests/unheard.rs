//! A vehicle that no other vehicle hears any more in a coverage mission stays where its last intent
//! says that it may be.

use super::State::*;
use super::divisions::over_a_field;
use super::*;
use crate::link::intent::Intent;

/// Horizontal distance of a place from the path that an intent reports, beginning at `from`,
/// metres.
fn beside_m(intent: &Intent, from: &Point, place: &Point) -> f32 {
    let legs = core::iter::once(from).chain(&intent.points).zip(&intent.points);
    legs.fold((from - place).xy().norm(), |least, (a, b)| {
        let (leg, away) = ((b - a).xy(), (place - a).xy());
        let share = (away.dot(&leg) / leg.norm_squared().max(1e-6)).clamp(0.0, 1.0);
        least.min((away - leg * share).norm())
    })
}

/// Whenever its radio fails, also in the climb, the vehicle stays on the path of its last intent
/// until it stands.
#[test]
fn an_unheard_vehicle_stays_on_the_way_that_it_reported_last() {
    let (mut furthest_m, mut beyond) = (0.0_f32, 0);
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for tenths in (2..280).step_by(13) {
            let mut bench = over_a_field(kind);
            bench.start();
            while !matches!(bench.state(), TakeOff | Climb | Follow) {
                bench.run(0.1);
            }
            bench.run(tenths as f32 * 0.1);
            let reported =
                bench.swarm.iter().rev().find_map(|f| Intent::decode(f.padded_payload(), SYSTEM));
            let (reported, from) = (reported.expect("five a second"), bench.enu);
            bench.neighbour = None;
            beyond += usize::from(reported.unheard_point_count > 0);
            for _ in 0..500 {
                bench.run(0.1);
                if !matches!(bench.state(), TakeOff | Climb | Follow) {
                    break;
                }
                let off_m = beside_m(&reported, &from, &bench.enu);
                assert!(
                    off_m < 1.0,
                    "{off_m} m off, {tenths}: {reported:?} from {from:?}, {:?}",
                    bench.enu
                );
                furthest_m = furthest_m.max((bench.enu - from).norm());
            }
        }
    }
    assert!(furthest_m > 8.0 && beyond > 4, "{furthest_m} m, {beyond}");
}
