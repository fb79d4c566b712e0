use super::*;
use proptest::prelude::*;

fn padded(roster: &RosterReport) -> [u8; 255] {
    let (mut out, mut padded) = ([0; MAX_LEN], [0; 255]);
    let len = roster.encode(&mut out);
    padded[..len].copy_from_slice(&out[..len]);
    padded
}

proptest! {
    #[test]
    fn comes_back_as_sent_and_refuses_the_unsound(
        entries in proptest::collection::vec(
            (0u8..8, 0usize..4, any::<u16>(), any::<Option<u16>>(), any::<[bool; 2]>()),
            1..=MAX_ENTRIES_PER_MESSAGE,
        ),
        head in (0u8..16, any::<u8>(), any::<u8>(), any::<u32>(), any::<u32>(), any::<u32>()),
        [has_started, hears_started_vehicle] in any::<[bool; 2]>(),
    ) {
        let entries = entries
            .iter()
            .map(|&(incarnation, standing, done_dm, promise_dm, [holds, agrees])| {
                RosterReportEntry {
                    incarnation,
                    status: ShareStatus::ALL[standing],
                    progress_dm: done_dm,
                    commitment_dm: promise_dm,
                    holds,
                    agrees,
                }
            })
            .collect();
        let (divisions, first, plan, mission_crc, counted, hash) = head;
        let roster = RosterReport {
            system_id: 9,
            division_count: divisions,
            has_started,
            hears_started_vehicle,
            first_rank: first,
            plan_crc8: plan,
            mission_crc,
            committed_hash: counted,
            pending_hash: hash,
            entries,
        };
        prop_assert_eq!(RosterReport::decode(&padded(&roster), 9), Some(roster.clone()));
        prop_assert_eq!(RosterReport::decode(&padded(&roster), 8), None);
        for (at, value) in [(0, 0), (4, 17), (5, 1), (9, 0), (9, 23)] {
            let mut bad = padded(&roster);
            bad[at] = value;
            prop_assert_eq!(RosterReport::decode(&bad, 9), None);
        }
    }

    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 255)) {
        let mut padded: [u8; 255] = bytes.try_into().unwrap();
        padded[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        padded[5] = VERSION;
        let _ = RosterReport::decode(&padded, padded[6]);
    }
}
