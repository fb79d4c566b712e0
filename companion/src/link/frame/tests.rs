//! Framing against noise, false starts, unknown ids, cuts, and random damage.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, SYSTEM_TIME_DATA};
use proptest::prelude::*;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::MavMessage;

use super::*;

const HEADER: Header = Header { system: 7, component: 1, sequence: 3 };

fn heartbeat(sequence: u8) -> Vec<u8> {
    let mut out = [0; MAX_FRAME_LEN];
    let data = HEARTBEAT_DATA {
        custom_mode: 0x0006_0000,
        mavlink_version: 3,
        ..HEARTBEAT_DATA::default()
    };
    let len = encode(Header { sequence, ..HEADER }, &data, &mut out);
    out[..len].to_vec()
}

/// A frame whose message id the dialect does not know, with a payload full of start bytes.
fn unknown() -> Vec<u8> {
    let mut out = [0; MAX_FRAME_LEN];
    let len =
        encode_raw(HEADER, 0x00F0_F0F0, 99, &[0xFD, 200, 0, 0xFD, 30, 0, 0, 0xFE, 9, 1], &mut out);
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
    let mut out = [0; MAX_FRAME_LEN];
    let len = encode(HEADER, &sent, &mut out);
    assert_eq!(len, 12 + 1, "trailing zeros are cut");
    let frames = drain(&mut Framer::new(), Instant::ZERO, &out[..len]);
    assert_eq!(frames[0].decode::<SYSTEM_TIME_DATA>(), Some(sent));
    assert_eq!(frames[0].decode::<HEARTBEAT_DATA>(), None);
    assert_eq!((frames[0].system, frames[0].component, frames[0].sequence), (7, 1, 3));
    assert_eq!(
        encode(HEADER, &SYSTEM_TIME_DATA::default(), &mut out[..12]),
        0,
        "too small a buffer"
    );
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
    signed[2] |= FLAG_SIGNED;
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
    assert_eq!(framer.counters(), Counters { frames: 2, unknown_id: 3, ..Counters::default() });
}

#[test]
fn an_unknown_frame_at_the_end_of_a_burst_is_skipped_too() {
    let mut framer = Framer::new();
    assert!(drain(&mut framer, Instant::ZERO, &unknown()).is_empty());
    assert_eq!(sequences(&drain(&mut framer, Instant::from_millis(500), &heartbeat(1))), [1]);
    assert_eq!(framer.counters(), Counters { frames: 1, unknown_id: 1, ..Counters::default() });
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
    assert_eq!(framer.counters().expired_partial, 1);
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
    /// Random bytes in chunks of any length neither panic nor overflow the buffer, and a frame that
    /// comes after them, and after a pause, still arrives.
    #[test]
    fn hostile_bytes_are_survived(
        noise in proptest::collection::vec(
            prop_oneof![Just(V1_START), Just(V2_START), Just(0u8), any::<u8>()],
            0..900,
        ),
        cut in 1usize..300,
    ) {
        let mut framer = Framer::new();
        let mut now = Instant::ZERO;
        for chunk in noise.chunks(cut) {
            drain(&mut framer, now, chunk);
            now = now + Duration::from_millis(7);
        }
        now = now + Duration::from_millis(101);
        drain(&mut framer, now, &[]);
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
        got.extend(drain(&mut framer, Instant::from_millis(101), &[]));
        let expected: Vec<u8> = (0..30).filter(|&s| usize::from(s) != at / len).collect();
        prop_assert_eq!(sequences(&got), expected);
    }
}

/// Reference implementation of the module's rule on a whole stream: start and sequence number of
/// each frame.
fn reference(stream: &[u8]) -> Vec<(usize, u8)> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at < stream.len() {
        let b = &stream[at..];
        let header = match b[0] {
            V1_START if b.len() >= 8 => Some((6, b[2], u32::from(b[5]))),
            V2_START if b.len() >= 12 && b[2] < 2 => {
                Some((10, b[4], u32::from_le_bytes([b[7], b[8], b[9], 0])))
            }
            _ => None,
        };
        let good = header.and_then(|(header, sequence, id)| {
            let crc_at = header + usize::from(b[1]);
            let stored = b.get(crc_at..crc_at + 2)?;
            let crc = mavlink::calculate_crc(&b[1..crc_at], extra_crc(id)?);
            (stored == crc.to_le_bytes()).then_some((crc_at + 2, sequence))
        });
        if let Some((_, sequence)) = good {
            found.push((at, sequence));
        }
        at += good.map_or(1, |(len, _)| len);
    }
    found
}

/// A frame of a known id, of any version and length, signed or not.
fn whole_frame() -> impl Strategy<Value = Vec<u8>> {
    let ids = MavMessage::all_ids();
    let payload = prop_oneof![
        proptest::collection::vec(any::<u8>(), 1..256),
        proptest::collection::vec(prop_oneof![Just(V1_START), Just(V2_START), 0u8..40], 1..60),
    ];
    (0..ids.len(), 0u8..3, any::<u8>(), payload, any::<[u8; SIGNATURE_LEN]>()).prop_map(
        move |(id, kind, sequence, mut payload, signature)| {
            let id = if kind == 0 { ids[id] & 0xFF } else { ids[id] };
            let id = if extra_crc(id).is_some() { id } else { 0 };
            *payload.last_mut().unwrap() |= 1;
            let mut out = std::vec![0; MAX_FRAME_LEN];
            let header = Header { sequence, ..HEADER };
            let len = encode_raw(header, id, extra_crc(id).unwrap(), &payload, &mut out);
            out.truncate(len);
            let crc_at = if kind == 0 {
                out.splice(..10, [V1_START, payload.len() as u8, sequence, 7, 1, id as u8]);
                len - 6
            } else {
                len - 2
            };
            if kind == 2 {
                out[2] = FLAG_SIGNED;
            }
            let crc = mavlink::calculate_crc(&out[1..crc_at], extra_crc(id).unwrap());
            out[crc_at..].copy_from_slice(&crc.to_le_bytes());
            if kind == 2 {
                out.extend(signature);
            }
            out
        },
    )
}

/// What may lie between frames: noise, false starts, headers alone, frames cut, damaged, or of an
/// unknown id.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![Just(V1_START), Just(V2_START), Just(0u8), any::<u8>()];
    prop_oneof![
        Just(Vec::new()),
        proptest::collection::vec(byte, 1..40),
        (any::<u8>(), any::<[u8; 3]>())
            .prop_map(|(len, id)| [V2_START, len, 0, 0, 1, 7, 1, id[0], id[1], id[2]].into()),
        (any::<u8>(), any::<u8>()).prop_map(|(len, id)| [V1_START, len, 1, 7, 1, id].into()),
        Just([V1_START, 5, V2_START, 0xFF].into()),
        (whole_frame(), any::<prop::sample::Index>())
            .prop_map(|(frame, cut)| frame[..cut.index(frame.len())].to_vec()),
        (whole_frame(), any::<prop::sample::Index>(), 1u8..).prop_map(|(mut frame, at, flip)| {
            let at = at.index(frame.len());
            frame[at] ^= flip;
            frame
        }),
        proptest::collection::vec(any::<u8>(), 1..255).prop_map(|payload| {
            let mut out = [0; MAX_FRAME_LEN];
            let len = encode_raw(HEADER, 0x00F0_F0F0, 99, &payload, &mut out);
            out[..len].to_vec()
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    /// Garbage of any kind between frames loses no whole frame, however the stream is cut into
    /// chunks. A candidate in the garbage whose checksum is right by chance is a frame: the
    /// reference finds it too.
    #[test]
    fn garbage_between_frames_loses_none(
        parts in proptest::collection::vec((garbage(), whole_frame()), 1..12),
        chunks in proptest::collection::vec(prop_oneof![Just(1usize), 1usize..400], 1..20),
    ) {
        let (mut stream, mut starts) = (Vec::new(), Vec::new());
        for (garbage, frame) in &parts {
            stream.extend(garbage);
            starts.push(stream.len());
            stream.extend(frame);
        }
        let expected = reference(&stream);
        // Sometimes a wrong CRC of 16 bits is right by chance, also that of a candidate in a
        // signature or a cut frame.
        let by_chance = expected.iter().any(|(at, _)| !starts.contains(at));
        for at in &starts {
            prop_assert!(
                by_chance || expected.iter().any(|(found, _)| found == at),
                "the reference loses byte {at}"
            );
        }
        let (mut framer, mut got, mut rest) = (Framer::new(), Vec::new(), &stream[..]);
        for (step, chunk) in chunks.iter().cycle().enumerate() {
            let (now, later) = rest.split_at((*chunk).min(rest.len()));
            // All bytes arrive within the lifetime of a partial frame.
            got.extend(drain(&mut framer, Instant::from_micros(step as u64), now));
            rest = later;
            if rest.is_empty() {
                break;
            }
        }
        got.extend(drain(&mut framer, Instant::from_millis(200), &[]));
        prop_assert_eq!(sequences(&got), expected.iter().map(|f| f.1).collect::<Vec<_>>());
        prop_assert_eq!(framer.expires_at(), None);
    }

    /// A frame is returned at most 9/8 of a lifetime after its last byte, whatever precedes it and
    /// however slowly bytes arrive.
    #[test]
    fn a_frame_is_held_back_for_a_lifetime_at_most(
        before in proptest::collection::vec(garbage(), 0..8),
        gap_us in 0u64..9000,
    ) {
        let garbage: Vec<u8> = before.concat();
        prop_assume!(reference(&garbage).is_empty());
        let stream = [&garbage[..], &heartbeat(1)].concat();
        prop_assume!(reference(&stream) == [(garbage.len(), 1)]);
        let mut framer = Framer::new();
        let mut now = Instant::ZERO;
        for (i, byte) in stream.iter().enumerate() {
            // The garbage arrives slowly, the frame at once.
            now = now + Duration::from_micros(if i < garbage.len() { gap_us } else { 0 });
            let got = drain(&mut framer, now, &[*byte]);
            prop_assert!(got.is_empty() || i + 1 == stream.len());
            if !got.is_empty() {
                return Ok(());
            }
        }
        let due = now + Duration::from_micros(PARTIAL_LIFETIME.as_micros() + ARRIVAL_STEP_US);
        let mut given = false;
        while !given && now <= due {
            now = now + Duration::from_millis(7);
            given = !drain(&mut framer, now, &[0]).is_empty();
        }
        prop_assert!(given);
    }
}

#[test]
fn a_false_start_costs_no_frame_behind_it() {
    let ten: Vec<u8> = (0..11).flat_map(heartbeat).collect();
    // The second start byte begins a frame of unknown id, as long as ten heartbeats.
    let len = (10 * heartbeat(0).len() - 2) as u8;
    let garbage = [V1_START, 5, V2_START, len, 0, 0, 1, 7, 1, 0xF0, 0xF0, 0xF0];
    let mut framer = Framer::new();
    let mut got = drain(&mut framer, Instant::ZERO, &[&garbage[..], &ten].concat());
    got.extend(drain(&mut framer, Instant::from_millis(101), &[]));
    assert_eq!(sequences(&got), (0..11).collect::<Vec<_>>());
}
