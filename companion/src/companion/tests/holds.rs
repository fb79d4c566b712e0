//! A vehicle that reported that it stays where it stands moves on only after others have had the
//! chance to hear that it will.

extern crate std;

use super::State::*;
use super::divisions::over_a_field_with;
use super::*;
use crate::autopilot::AutopilotKind;
use crate::link::intent::Intent;

/// Number of reports without the hold that a vehicle sends before it moves again.
const MIN_REPORTS: usize = 4;

/// The intents that the companion has sent since its frames were last cleared.
fn intents(b: &Bench) -> Vec<Intent> {
    b.swarm.iter().filter_map(|frame| Intent::decode(frame.padded_payload(), SYSTEM)).collect()
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(
        if cfg!(debug_assertions) { 100 } else { 1000 }
    ))]
    /// Paused on its path or in its last descent, at any rate of reports.
    #[test]
    fn a_vehicle_that_held_reports_where_it_flies_before_it_moves(
        px4 in proptest::prelude::any::<bool>(),
        swarm_hz in 2u8..=10,
        ticks in 0u32..480,
        paused_ticks in 20u32..200,
    ) {
        let kind = if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let mut b = over_a_field_with(kind, |config| config.swarm_hz = swarm_hz);
        b.start();
        b.run_until(Follow, 30.0);
        (0..ticks).for_each(|_| b.tick());
        let order = |b: &mut Bench, param1| {
            let command = MavCmd::MAV_CMD_DO_PAUSE_CONTINUE;
            b.command(command, param1, SYSTEM, crate::COMPANION_COMPONENT);
        };
        order(&mut b, 0.0);
        let mut reported = false;
        for _ in 0..paused_ticks {
            let holds = b.companion.guidance.hold.is_reported();
            b.swarm.clear();
            b.tick();
            reported |= holds && !intents(&b).is_empty();
        }
        proptest::prop_assume!(b.state() == Paused && reported);
        b.swarm.clear();
        order(&mut b, 1.0);
        let stood = b.companion.guidance.setpoint_position();
        let moved = |b: &Bench| (b.companion.guidance.setpoint_position() - stood).norm() > 0.01;
        for _ in 0..120 {
            if moved(&b) || !b.armed {
                break;
            }
            b.tick();
        }
        proptest::prop_assert!(moved(&b) || b.state() == Land, "{:?} {:?}", b.state(), b.texts);
        let reports = intents(&b).iter().filter(|intent| intent.points.len() > 1).count();
        proptest::prop_assert!(
            reports >= MIN_REPORTS || b.state() == Land,
            "{reports} reports at {swarm_hz} Hz in {:?}: {:?}",
            b.state(),
            b.texts
        );
    }
}
