use super::*;
use proptest::prelude::*;

fn encoded(report: &PhotographedReport) -> [u8; 255] {
    let (mut out, mut padded) = ([0; MAX_LEN], [0; 255]);
    let len = report.encode(&mut out);
    padded[..len].copy_from_slice(&out[..len]);
    padded
}

proptest! {
    #[test]
    fn comes_back_as_sent_and_refuses_the_unsound(
        ranges in proptest::collection::vec((0u32..1 << 24, 1u32..1 << 24), 0..=MAX_RANGES),
        (mission_crc, round, flies, plan) in any::<(u32, u8, bool, bool)>(),
    ) {
        let ranges = ranges
            .iter()
            .map(|&(first, count)| WaypointRange { first, end: first + count })
            .collect();
        let report = PhotographedReport {
            system_id: 9,
            mission_crc,
            round,
            flies,
            are_ranges_left_out_by_plan: plan,
            ranges,
        };
        prop_assert_eq!(PhotographedReport::decode(&encoded(&report), 9), Some(report.clone()));
        prop_assert_eq!(PhotographedReport::decode(&encoded(&report), 8), None);
        for (at, value) in [(0, 0), (4, 9), (5, 2), (9, 20)] {
            let mut bad = encoded(&report);
            bad[at] = value;
            prop_assert_eq!(PhotographedReport::decode(&bad, 9), None);
        }
    }

    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 255)) {
        let mut padded: [u8; 255] = bytes.try_into().unwrap();
        padded[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        padded[5] = VERSION;
        let _ = PhotographedReport::decode(&padded, padded[6]);
    }
}

#[test]
fn a_range_that_is_too_large_is_left_out() {
    let range = WaypointRange { first: 1 << 24, end: (1 << 24) + 1 };
    assert_eq!(decode_range(&encode_range(&range)), WaypointRange { first: 0, end: 0 });
}
