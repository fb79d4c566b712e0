//! Framing against noise, false starts, unknown ids, cuts, and random damage.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, SYSTEM_TIME_DATA};
use proptest::prelude::*;

use super::*;

const HEADER: Header = Header { system: 7, component: 1, sequence: 3 };

fn heartbeat(sequence: u8) -> Vec<u8> {
    let mut out = [0; MAX_SENT];
    let data = HEARTBEAT_DATA { custom_mode: 0x0006_0000, mavlink_version: 3, ..HEARTBEAT_DATA::default() };
    let len = encode(Header { sequence, ..HEADER }, &data, &mut out);
    out[..len].to_vec()
}

/// A frame of an id no dialect here knows, its payload full of start bytes.
fn unknown() -> Vec<u8> {
    let mut out = [0; MAX_SENT];
    let len = encode_raw(HEADER, 0x00F0_F0F0, 99, &[0xFD, 200, 0, 0xFD, 30, 0, 0, 0xFE, 9, 1], &mut out);
    out[..len].to_vec()
}

fn drain(framer: &mut Framer, now: Instant, mut bytes: &[u8]) -> Vec<Frame> {
    let mut frames = Vec::new();
    while let Some(frame) = framer.next(now, &mut bytes) {
        frames.push(frame);
    }
    assert!(bytes.is_empty());
    frames
}

fn sequences(frames: &[Frame]) -> Vec<u8> {
    frames.iter().map(|f| f.sequence).collect()
}

#[test]
fn what_is_encoded_comes_back() {
    let sent = SYSTEM_TIME_DATA { time_unix_usec: 5, time_boot_ms: 0 };
    let mut out = [0; MAX_SENT];
    let len = encode(HEADER, &sent, &mut out);
    assert_eq!(len, 12 + 1, "trailing zeros are cut");
    let frames = drain(&mut Framer::new(), Instant::ZERO, &out[..len]);
    assert_eq!(frames[0].decode::<SYSTEM_TIME_DATA>(), Some(sent));
    assert_eq!(frames[0].decode::<HEARTBEAT_DATA>(), None);
    assert_eq!((frames[0].system, frames[0].component, frames[0].sequence), (7, 1, 3));
    assert_eq!(encode(HEADER, &SYSTEM_TIME_DATA::default(), &mut out[..12]), 0, "too small a buffer");
}

#[test]
fn version_1_and_signed_frames_are_read() {
    // V1 HEARTBEAT of system 1, as the crate's own encoder lays it out.
    let data = HEARTBEAT_DATA { mavlink_version: 3, ..HEARTBEAT_DATA::default() };
    let mut v1 = [0; 17];
    v1[..6].copy_from_slice(&[V1_START, 9, 5, 1, 1, 0]);
    data.ser(MavlinkVersion::V1, &mut v1[6..15]);
    let crc = calculate_crc(&v1[1..15], HEARTBEAT_DATA::EXTRA_CRC);
    v1[15..].copy_from_slice(&crc.to_le_bytes());
    let mut signed = heartbeat(6);
    signed[2] |= SIGNED;
    let end = signed.len() - 2;
    let crc = calculate_crc(&signed[1..end], HEARTBEAT_DATA::EXTRA_CRC);
    signed[end..].copy_from_slice(&crc.to_le_bytes());
    signed.extend_from_slice(&[0xFD; SIGNATURE_LEN]);
    let bytes = [&v1[..], &signed, &heartbeat(7)].concat();
    let frames = drain(&mut Framer::new(), Instant::ZERO, &bytes);
    assert_eq!(sequences(&frames), [5, 6, 7]);
    assert_eq!(frames[0].decode::<HEARTBEAT_DATA>(), Some(data));
    assert!(frames[1].signed && !frames[2].signed);
}

#[test]
fn unknown_ids_are_skipped_whole() {
    let bytes = [unknown(), heartbeat(1), unknown(), unknown(), heartbeat(2)].concat();
    let mut framer = Framer::new();
    assert_eq!(sequences(&drain(&mut framer, Instant::ZERO, &bytes)), [1, 2]);
    assert_eq!(framer.counters(), Counters { frames: 2, unknown: 3, ..Counters::default() });
}

#[test]
fn an_unknown_frame_at_the_end_of_a_burst_is_skipped_too() {
    let mut framer = Framer::new();
    assert!(drain(&mut framer, Instant::ZERO, &unknown()).is_empty());
    assert_eq!(sequences(&drain(&mut framer, Instant::from_millis(500), &heartbeat(1))), [1]);
    assert_eq!(framer.counters(), Counters { frames: 1, unknown: 1, ..Counters::default() });
}

#[test]
fn good_frames_behind_a_bad_one_survive() {
    for damaged in 0..heartbeat(0).len() {
        let mut bad = heartbeat(0);
        bad[damaged] ^= 0x55;
        let tail: Vec<u8> = (1..60).flat_map(heartbeat).collect();
        let mut framer = Framer::new();
        let mut got = drain(&mut framer, Instant::ZERO, &[bad, tail].concat());
        got.extend(drain(&mut framer, Instant::from_millis(101), &[]));
        assert_eq!(sequences(&got), (1..60).collect::<Vec<_>>(), "byte {damaged}");
    }
}

#[test]
fn a_partial_frame_expires_and_frees_what_it_held_back() {
    let mut framer = Framer::new();
    let false_start = [V2_START, 250, 0, 0, 0, 7, 1, 30, 0, 0];
    let bytes = [&false_start[..], &heartbeat(1)].concat();
    assert!(drain(&mut framer, Instant::ZERO, &bytes).is_empty());
    assert_eq!(framer.expires_at(), Some(Instant::from_millis(100)));
    assert_eq!(sequences(&drain(&mut framer, Instant::from_micros(100_001), &[])), [1]);
    assert_eq!(framer.counters().expired, 1);
    assert_eq!(framer.expires_at(), None);
}

#[test]
fn a_cut_frame_does_not_join_a_later_one() {
    let whole = heartbeat(1);
    let mut framer = Framer::new();
    assert!(drain(&mut framer, Instant::ZERO, &whole[..9]).is_empty());
    assert_eq!(sequences(&drain(&mut framer, Instant::from_millis(900), &heartbeat(2))), [2]);
}

#[test]
fn every_id_of_the_dialect_is_known() {
    for id in MavMessage::all_ids() {
        assert!(extra_crc(*id).is_some(), "id {id}");
    }
    assert_eq!(extra_crc(0x00F0_F0F0), None);
}

proptest! {
    /// Whatever the bytes and however they are cut, nothing panics, the buffer never overflows, and undamaged frames
    /// in quiet surroundings still arrive.
    #[test]
    fn hostile_bytes_are_survived(
        noise in proptest::collection::vec(prop_oneof![Just(V1_START), Just(V2_START), Just(0u8), any::<u8>()], 0..900),
        cut in 1usize..300,
    ) {
        let mut framer = Framer::new();
        let mut now = Instant::ZERO;
        for chunk in noise.chunks(cut) {
            drain(&mut framer, now, chunk);
            now = now + Duration::from_millis(7);
        }
        // Each expiry frees at least one byte, so the buffer is empty after this many lifetimes.
        for _ in 0..BUFFER {
            now = now + Duration::from_millis(101);
            drain(&mut framer, now, &[]);
        }
        prop_assert_eq!(framer.expires_at(), None);
        prop_assert_eq!(sequences(&drain(&mut framer, now, &heartbeat(9))), [9]);
    }

    /// One damaged byte anywhere in a stream changes only the frame it is in.
    #[test]
    fn one_bad_byte_costs_one_frame(at in 0usize..400, flip in 1u8..=255) {
        let mut stream: Vec<u8> = (0..30).flat_map(heartbeat).collect();
        let len = heartbeat(0).len();
        let at = at.min(29 * len - 1);
        stream[at] ^= flip;
        let mut framer = Framer::new();
        let mut got = drain(&mut framer, Instant::ZERO, &stream);
        for wait in 1..60 {
            got.extend(drain(&mut framer, Instant::from_millis(101 * wait), &[]));
        }
        let expected: Vec<u8> = (0..30).filter(|&s| usize::from(s) != at / len).collect();
        prop_assert_eq!(sequences(&got), expected);
    }
}
