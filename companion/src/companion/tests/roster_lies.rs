//! False roster reports: a liar may make a vehicle land, but never moves it off its path.

extern crate std;
use std::vec::Vec;

use proptest::prelude::{ProptestConfig, any};

use super::State::*;
use super::divisions::{bytes, over_a_field, own_roster};
use super::*;
use crate::Link;
use crate::autopilot::AutopilotKind;
use crate::link::roster::{RosterReport, RosterReportEntry, ShareStatus};

/// A false roster report: a true one with some fields replaced.
#[derive(Clone, Debug)]
struct Lie {
    system_id: u8,
    crc: bool,
    divisions: Option<u8>,
    first: Option<u8>,
    counted: Option<u32>,
    hash: Option<u32>,
    entries: Vec<(usize, u8, u8, u16, Option<u16>, bool)>,
}

fn lie() -> impl proptest::strategy::Strategy<Value = Lie> {
    use proptest::prelude::{Just, Strategy, prop_oneof};
    let id = prop_oneof![4 => Just(77u8), 1 => Just(78), 1 => Just(SYSTEM), 1 => any::<u8>()];
    let crc = prop_oneof![4 => Just(true), 1 => Just(false)];
    let divisions =
        prop_oneof![3 => Just(None), 1 => any::<u8>().prop_map(Some), 1 => (0u8..7).prop_map(Some)];
    let first = prop_oneof![6 => Just(None), 1 => any::<u8>().prop_map(Some)];
    let entry = (0usize..3, 0u8..8, 0u8..4, any::<u16>(), any::<Option<u16>>(), any::<bool>());
    let entries = proptest::collection::vec(entry, 0..4);
    (id, crc, divisions, first, any::<Option<u32>>(), any::<Option<u32>>(), entries).prop_map(
        |(system_id, crc, divisions, first, counted, hash, entries)| Lie {
            system_id,
            crc,
            divisions,
            first,
            counted,
            hash,
            entries,
        },
    )
}

impl Lie {
    fn reported(&self, b: &Bench) -> RosterReport {
        const ALL: [ShareStatus; 4] =
            [ShareStatus::Alive, ShareStatus::Lost, ShareStatus::Left, ShareStatus::Finished];
        let mut roster = own_roster(b);
        roster.system_id = self.system_id;
        roster.mission_crc = if self.crc { roster.mission_crc } else { 7 };
        roster.division_count = self.divisions.unwrap_or(roster.division_count);
        roster.first_rank = self.first.unwrap_or(roster.first_rank);
        roster.committed_hash = self.counted.unwrap_or(roster.pending_hash);
        roster.pending_hash = self.hash.unwrap_or(roster.pending_hash);
        for &(rank, incarnation, standing, done_dm, promise_dm, holds) in &self.entries {
            let standing = ALL[usize::from(standing)];
            roster.entries[rank] = RosterReportEntry {
                incarnation,
                status: standing,
                progress_dm: done_dm,
                commitment_dm: promise_dm,
                holds,
                agrees: holds,
            };
        }
        roster
    }
}

proptest::proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 200 } else { 5000 }))]
    /// Roster reports of unknown ids, of another mission or with this vehicle's own id change
    /// nothing. False reports of one vehicle of the roster may make this one land, but never move
    /// it off its path.
    #[test]
    fn lies_of_a_roster_land_a_vehicle_at_worst(
        waits in any::<bool>(),
        lies in proptest::collection::vec((lie(), 0u32..60), 1..20),
    ) {
        let mut b = over_a_field(AutopilotKind::Px4);
        if !waits {
            b.start();
            b.run_until(Follow, 30.0);
        }
        for (i, (lie, ticks)) in lies.iter().enumerate() {
            let before = std::boxed::Box::new(b.companion.neighbours.fleet().cloned());
            b.companion.handle_bytes(Link::Swarm, b.now, &bytes(&lie.reported(&b), i as u8));
            let of_roster = lie.crc && matches!(lie.system_id, 77 | 78);
            proptest::prop_assert!(
                of_roster || *before == b.companion.neighbours.fleet().cloned(),
                "{lie:?}"
            );
            b.drain();
            (0..*ticks).for_each(|_| b.tick());
            let y_m = (b.enu.y - START.y).abs();
            proptest::prop_assert!(
                y_m < 0.3 && b.enu.z < GOAL.z + 0.3,
                "off its path: {:?} {lies:?}",
                b.enu
            );
        }
        if b.state() == Ready {
            b.start();
        }
        for _ in 0..700 {
            b.run(1.0);
            if !b.armed && b.on_ground() {
                break;
            }
        }
        proptest::prop_assert!(
            !b.armed && b.on_ground(),
            "{:?} {:?} {lies:#?}",
            b.state(),
            b.texts
        );
    }
}
