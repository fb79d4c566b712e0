use super::*;
use proptest::prelude::*;

const PATH: ReportedPath = ReportedPath { along_m: 0.0, points_end_m: 0.0 };

proptest! {
    #[test]
    fn half_the_round_trip_is_the_delay(
        ways in proptest::collection::vec(0..900_u64, 1..60),
        held in 0..2500_u64,
    ) {
        let (mut sent, mut late) = (SentIntents::default(), MessageDelay::default());
        for (i, way) in ways.iter().enumerate() {
            let now = Instant::from_millis(i as u64 * 200);
            sent.note_sent(i as u8, PATH, now);
            let echo = IntentEcho::new(3, i as u8, Duration::from_millis(held)).unwrap();
            let back = now + Duration::from_millis(2 * way + held);
            let delay_s = sent.message_delay_s(&echo, back).unwrap();
            prop_assert!((delay_s - *way as f32 * 1e-3).abs() < 0.01);
            late.update(delay_s);
            prop_assert!(late.delay_s >= delay_s - 1e-6);
        }
    }

    #[test]
    fn wrong_echoes_stay_bounded(
        echoes in proptest::collection::vec((any::<u8>(), 0..255_u8, 0..60_000_u64), 1..50),
    ) {
        let (mut sent, mut late) = (SentIntents::default(), MessageDelay::default());
        for i in 0..20 {
            sent.note_sent(i, PATH, Instant::from_millis(u64::from(i) * 200));
        }
        for (sequence, held, at_ms) in echoes {
            let echo = IntentEcho { rank: 0, sequence, held_ticks: held };
            if let Some(delay_s) =
                sent.message_delay_s(&echo, Instant::from_millis(4000 + at_ms))
            {
                late.update(delay_s);
            }
            prop_assert!((0.0..=MAX_DELAY_S).contains(&late.delay_s));
        }
    }
}

#[test]
fn the_newest_intent_that_arrived_says_where_its_points_led() {
    let mut sent = SentIntents::default();
    let at = |i: u8| Instant::from_millis(1000 + u64::from(i) * 200);
    (0..8).for_each(|i| {
        sent.note_sent(i, ReportedPath { points_end_m: f32::from(i), ..PATH }, at(i));
    });
    let echo = |sequence| IntentEcho { rank: 0, sequence, held_ticks: 0 };
    let mut arrived =
        |sequence| sent.note_arrival(&echo(sequence)).map(|sent| (sent.at, sent.path.points_end_m));
    assert_eq!(arrived(3), Some((at(3), 3.0)));
    assert_eq!(arrived(2), None, "overtaken");
    assert_eq!(arrived(99), None, "never sent");
    assert_eq!(arrived(7), Some((at(7), 7.0)));
}

#[test]
fn too_old_is_no_echo() {
    assert_eq!(IntentEcho::new(1, 2, Duration::from_millis(2550)), None);
    assert_eq!(IntentEcho::new(255, 2, Duration::from_millis(0)), None);
    assert!(IntentEcho::new(254, 2, Duration::from_millis(2540)).is_some());
}
