use std::collections::VecDeque;

use super::*;

/// Uploads 200 pieces over a link that delivers one answer each `every_ms` and loses every
/// `loses`th request. Returns the number of requests sent and the time taken, seconds.
fn upload(every_ms: u64, loses: usize) -> (usize, f32) {
    const PIECES: usize = 200;
    let began = Clock::now();
    let mut retransmission = Retransmission::new(began);
    // Requests that wait for their answers.
    let mut line = VecDeque::new();
    let mut under_way: Vec<(usize, Clock, bool)> = Vec::new();
    let (mut next, mut answered, mut sent, mut ms) = (0, 0, 0, 0);
    while answered < PIECES {
        let now = began + Duration::from_millis(ms);
        let mut send = |piece| {
            sent += 1;
            if sent % loses != 0 {
                line.push_back(piece);
            }
        };
        while under_way.len() < retransmission.window() && next < PIECES {
            under_way.push((next, now, false));
            send(next);
            next += 1;
        }
        for (piece, sent_at, repeated) in &mut under_way {
            if retransmission.back_off_if_timed_out(*sent_at, now) {
                (*sent_at, *repeated) = (now, true);
                send(*piece);
            }
        }
        ms += 10;
        let answer = ms.is_multiple_of(every_ms).then(|| line.pop_front()).flatten();
        if let Some(at) = under_way.iter().position(|(piece, ..)| Some(*piece) == answer) {
            let (_, sent_at, repeated) = under_way.remove(at);
            answered += 1;
            if !repeated {
                retransmission.note_round_trip(began + Duration::from_millis(ms) - sent_at);
            }
        }
    }
    (sent, ms as f32 * 1e-3)
}

#[test]
fn a_slow_link_is_not_filled_with_repeats() {
    // As on a cable, as for 30-byte answers by radio, and as behind an emulator that runs at a
    // third of the real speed.
    for every_ms in [10, 120, 360] {
        let (sent, took_s) = upload(every_ms, usize::MAX);
        assert!(sent < 220, "every {every_ms} ms an answer: {sent} sent for 200");
        assert!(took_s < 0.25 * every_ms as f32, "every {every_ms} ms an answer: {took_s} s");
    }
}

#[test]
fn a_link_that_loses_every_third_is_still_used() {
    let (sent, took_s) = upload(10, 3);
    assert!(sent < 320 && took_s < 40.0, "{sent} sent for 200 in {took_s} s");
}

#[test]
fn silence_doubles_the_wait_up_to_its_bound_and_an_answer_ends_that() {
    let began = Clock::now();
    let mut retransmission = Retransmission::new(began);
    let mut sent_at = began;
    let waits: Vec<u128> = (0..4)
        .map(|_| {
            let over = (1..)
                .map(|ms| sent_at + Duration::from_millis(ms))
                .find(|now| retransmission.back_off_if_timed_out(sent_at, *now));
            let wait = over.expect("some time") - sent_at;
            sent_at += wait;
            wait.as_millis()
        })
        .collect();
    assert_eq!(waits, [401, 801, 1601, 2001]);
    retransmission.note_round_trip(Duration::from_millis(20));
    assert!(retransmission.back_off_if_timed_out(sent_at, sent_at + Duration::from_millis(401)));
}
