use super::*;

#[test]
fn a_bucket_gives_its_burst_and_then_its_rate() {
    let at = |ms| Instant::ZERO + Duration::from_millis(ms);
    let mut rates = AnswerTokenBuckets::default();
    let count = |rates: &mut AnswerTokenBuckets, ms, sender| {
        (0..100).filter(|_| rates.take_token(at(ms), Link::Swarm, sender, AnswerKind::Ack)).count()
    };
    assert_eq!(count(&mut rates, 0, SenderKind::Other), 2);
    assert_eq!(count(&mut rates, 999, SenderKind::Other), 0);
    assert_eq!(count(&mut rates, 1000, SenderKind::Other), 1);
    assert_eq!(count(&mut rates, 1000, SenderKind::GroundStation), 10, "its own bucket");
    assert_eq!(count(&mut rates, 1 << 40, SenderKind::Other), 2, "no more is saved up");
}
