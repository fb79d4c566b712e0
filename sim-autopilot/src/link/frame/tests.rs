//! Tests of the framing: against the companion's independent implementation, and in noise.

use companion::link::frame as other;
use companion::time::Instant;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::*;

/// A message id below 260 or one known to the dialect, any sender (system, component, sequence
/// number), and any payload.
fn any_frame() -> impl Strategy<Value = (u32, (u8, u8, u8), Vec<u8>)> {
    let known: Vec<u32> = (0..=u32::from(u16::MAX)).filter(|&id| crc_extra(id).is_some()).collect();
    // Half of the bytes are zero, as at the end of many payloads.
    let byte = prop_oneof![Just(0_u8), any::<u8>()];
    (prop_oneof![0_u32..260, select(known)], any::<(u8, u8, u8)>(), vec(byte, 0..=255))
}

fn written((id, sender, payload): &(u32, (u8, u8, u8), Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    if let Some(seed) = crc_extra(*id) {
        write_raw(*sender, *id, seed, payload, &mut out);
    }
    out
}

fn all(framer: &mut PortFramer, now_us: u64, mut input: &[u8]) -> Vec<CheckedFrame> {
    core::iter::from_fn(|| framer.next(now_us, &mut input)).collect()
}

proptest! {
    /// Both framings write the same bytes, and each reads what the other wrote.
    #[test]
    fn both_framings_agree(frame in any_frame()) {
        let ours = written(&frame);
        let (id, (system, component, sequence), payload) = &frame;
        let header = other::Header { system: *system, component: *component, sequence: *sequence };
        let mut theirs = [0; other::MAX_FRAME_LEN];
        let seed = other::extra_crc(*id);
        prop_assert_eq!(seed, super::crc_extra(*id));
        let len = seed.map_or(0, |seed| other::encode_raw(header, *id, seed, payload, &mut theirs));
        prop_assert_eq!(&ours[..], &theirs[..len]);
        let read = all(&mut PortFramer::default(), 0, &theirs[..len]);
        let heard = other::Framer::new().next(Instant::ZERO, &mut &ours[..]);
        prop_assert_eq!(read.len(), usize::from(seed.is_some()));
        for (frame, heard) in read.iter().zip(heard) {
            let known = (frame.system, frame.component, frame.sequence, frame.message_id);
            prop_assert_eq!(
                known,
                (heard.system, heard.component, heard.sequence, heard.message_id)
            );
            prop_assert_eq!(known, (*system, *component, *sequence, *id));
            prop_assert_eq!(frame.padded_payload(), heard.padded_payload());
            let mut passed = Vec::new();
            frame.write(&mut passed);
            prop_assert_eq!(&passed, &ours);
        }
    }

    /// Frames between noise, received in parts of any length, are all found once false starts have
    /// timed out.
    #[test]
    fn no_noise_hides_a_frame(
        frames in vec(
            (vec(prop_oneof![Just(V1_START), Just(V2_START), any::<u8>()], 0..20), any_frame()),
            1..8,
        ),
        cuts in vec(1_usize..60, 1..40),
    ) {
        let bytes: Vec<u8> = frames
            .iter()
            .flat_map(|(noise, frame)| [noise.clone(), written(frame)].concat())
            .collect();
        let (mut framer, mut found, mut rest) = (PortFramer::default(), Vec::new(), &bytes[..]);
        for cut in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (now, later) = rest.split_at((*cut).min(rest.len()));
            found.extend(all(&mut framer, 0, now));
            rest = later;
        }
        found.extend(all(&mut framer, PARTIAL_LIFETIME_US + 1, &[]));
        let again = |found: &CheckedFrame| {
            let mut again = Vec::new();
            found.write(&mut again);
            again
        };
        let wholes: Vec<Vec<u8>> = frames.iter().map(|(_, frame)| written(frame)).collect();
        // One of 65 536 false starts has a correct checksum by chance, which no receiver can
        // detect.
        prop_assume!(found.iter().all(|found| wholes.contains(&again(found))));
        for (whole, (_, frame)) in wholes.iter().zip(&frames) {
            let there = found.iter().any(|found| again(found) == *whole);
            prop_assert!(whole.is_empty() || there, "{:?}", frame);
        }
    }
}

#[test]
fn version_1_and_signed_frames_are_read() {
    let seed = crc_extra(0).unwrap();
    let mut first = vec![V1_START, 9, 7, 3, 1, 0, 0, 0, 0, 0, 2, 12, 1, 3, 3];
    first.extend(calculate_crc(&first[1..], seed).to_le_bytes());
    let mut signed = vec![V2_START, 1, FLAG_SIGNED, 0, 8, 3, 1, 0, 0, 0, 5];
    signed.extend(calculate_crc(&signed[1..], seed).to_le_bytes());
    signed.extend([0; 13]);
    let mut framer = PortFramer::default();
    let found = all(&mut framer, 0, &[first, signed.clone()].concat());
    assert_eq!(found.iter().map(|frame| frame.sequence).collect::<Vec<_>>(), [7, 8]);
    assert_eq!(found[0].padded_payload()[..9], [0, 0, 0, 0, 2, 12, 1, 3, 3]);
    // An unknown incompatibility flag may change the frame's layout.
    signed[2] = 2;
    assert!(all(&mut framer, 0, &signed).is_empty());
}

#[test]
fn a_frame_that_takes_too_long_is_given_up() {
    let whole = written(&(4, (1, 1, 9), vec![1; 14]));
    for (late_us, count) in [(0, 1), (PARTIAL_LIFETIME_US, 1), (PARTIAL_LIFETIME_US + 1, 0)] {
        let mut framer = PortFramer::default();
        assert!(all(&mut framer, 5, &whole[..7]).is_empty());
        assert_eq!(all(&mut framer, 5 + late_us, &[]).len(), 0);
        assert_eq!(all(&mut framer, 5 + late_us, &whole[7..]).len(), count, "{late_us}");
    }
}
