use super::*;
use proptest::prelude::*;

fn sample(count: usize) -> Intent {
    let points = (0..count).map(|i| Point::new(i as f32, -1.5, 3.25)).collect();
    Intent {
        system_id: 9,
        flags: FLYING | ON_PLAN,
        mission_crc: 0xDEAD_BEEF,
        plan_crc: 7,
        progress_m: -1.25,
        gates_open_up_to_m: 17.5,
        heard_bits: 0x8000_0005,
        ground_m: -0.5,
        may_come_down: count == 3,
        unheard_flight_delay_s: 15 * count as u8,
        echo: (count > 2).then_some(IntentEcho { rank: 254, sequence: 9, held_ticks: count as u8 }),
        points,
        unheard_flight_point_count: count as u8 / 2,
    }
}

fn padded(intent: &Intent) -> [u8; 255] {
    let (mut out, mut padded) = ([0; 133], [0; 255]);
    let len = intent.encode(&mut out);
    assert!(len <= 5 + 128);
    padded[..len].copy_from_slice(&out[..len]);
    padded
}

#[test]
fn comes_back_as_sent_and_refuses_the_unsound() {
    for count in 0..=MAX_POINTS {
        assert_eq!(Intent::decode(&padded(&sample(count)), 9), Some(sample(count)));
    }
    assert_eq!(Intent::decode(&padded(&sample(2)), 8), None, "another sender");
    for (at, value) in [(0, 0), (4, 31), (5, 2), (8, 9), (8, 0x32)] {
        let mut bad = padded(&sample(2));
        bad[at] = value;
        assert_eq!(Intent::decode(&bad, 9), None, "byte {at}");
    }
    let nan = Intent { progress_m: f32::NAN, ..sample(0) };
    assert_eq!(Intent::decode(&padded(&nan), 9), None);
}

proptest! {
    #[test]
    fn any_bytes_are_survived(
        bytes in proptest::collection::vec(any::<u8>(), 255),
        kind in any::<bool>(),
    ) {
        let mut padded: [u8; 255] = bytes.try_into().unwrap();
        if kind {
            padded[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
            padded[5] = VERSION;
        }
        if let Some(intent) = Intent::decode(&padded, padded[6]) {
            prop_assert!(
                intent.progress_m.is_finite()
                    && intent
                        .points
                        .iter()
                        .all(|p| p.norm().is_finite() || p.amax().is_finite())
            );
        }
    }
}
