//! All logs of the shared data: we read them as pymavlink does, and survive them however they are
//! damaged.
//!
//! The random damage is seeded by the log's index in the folder and the round.
//! `FLOCKMATE_FUZZ_ROUNDS=20 cargo test -p flockmate-tests --test logs` runs twenty rounds instead
//! of one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use companion::link::frame::{self, Frame, Framer, Header};
use companion::{Companion, Config, Duration, Event, Instant, Link};
use flockmate_tests::{logs, python, workspace};
use mavlink::Message;
use mavlink::dialects::ardupilotmega::MavMessage;
use planner_core::Point;
use planner_core::flight::{Path as FlightPath, VehiclePlan};
use planner_core::geo::frames::Geodetic;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use sim_autopilot::{Autopilot, SimulatedKind};

/// Where PX4's recording was flown.
const ORIGIN: Geodetic = Geodetic { lat_deg: 47.397_741_4, lon_deg: 8.545_596_2, alt_m: 489.8 };
const START: Point = Point::new(0.0, 0.0, 2.0);
/// The most bytes of a log that are damaged in one round.
const ROUND_BYTES: usize = 120_000;
/// SET_POSITION_TARGET_LOCAL_NED.
const SETPOINT: u32 = 84;

/// Number of messages by id, and of those with unknown ids.
#[derive(Debug, Default, PartialEq)]
struct Counts {
    known: BTreeMap<u32, usize>,
    unknown: usize,
}

/// Reads a log's frames in pieces as a serial port gives them.
fn counts(path: &Path) -> (Vec<Frame>, Counts) {
    let bytes: Vec<u8> = logs::read_log(path).into_iter().flat_map(|record| record.bytes).collect();
    let (mut framer, mut frames) = (Framer::new(), Vec::new());
    let mut hear = |now, mut piece: &[u8]| {
        while let Some(frame) = framer.next(now, &mut piece) {
            frames.push(frame);
        }
    };
    bytes.chunks(61).for_each(|piece| hear(Instant::ZERO, piece));
    // The framer takes an unknown frame at the end for whole once no byte has followed for a while.
    hear(Instant::from_millis(200), &[]);
    let counters = framer.counters();
    assert_eq!((counters.bad_crc, counters.noise_bytes), (0, 0), "{path:?}");
    let mut counts = Counts { unknown: counters.unknown_id as usize, ..Counts::default() };
    for frame in &frames {
        *counts.known.entry(frame.message_id).or_default() += 1;
    }
    (frames, counts)
}

#[test]
fn every_known_frame_is_decoded_and_every_unknown_one_skipped_whole() {
    for path in logs::all_logs() {
        let (frames, counts) = counts(&path);
        assert_eq!(frames.len() + counts.unknown, logs::read_log(&path).len(), "{path:?}");
        let refused: BTreeSet<_> = frames
            .iter()
            .filter(|f| MavMessage::parse(f.version, f.message_id, f.payload()).is_err())
            .map(|f| f.message_id)
            .collect();
        println!(
            "{}: {} frames, {} unknown, undecoded {refused:?}",
            path.display(),
            frames.len(),
            counts.unknown
        );
    }
}

#[test]
fn messages_are_counted_as_pymavlink_counts_them() {
    let (paths, Some(python)) = (logs::all_logs(), python()) else { return };
    let script = workspace().join("tests/conformance/log_counts.py");
    let output = Command::new(python).arg(script).args(&paths).output().expect("Python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let theirs: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one line of JSON");
    for path in &paths {
        let (_, mut ours) = counts(path);
        let mut expected = Counts::default();
        for (id, count) in theirs[path.to_str().unwrap()].as_object().unwrap() {
            let count = count.as_u64().unwrap() as usize;
            // Messages whose id pymavlink does not know are counted under −2.
            match id.parse() {
                Ok(id) if frame::extra_crc(id).is_some() => drop(expected.known.insert(id, count)),
                _ => expected.unknown += count,
            }
        }
        assert!(!expected.known.is_empty());
        // Ids that only we know are among pymavlink's unknown ones.
        let ours_alone: Vec<u32> =
            ours.known.keys().filter(|id| !expected.known.contains_key(id)).copied().collect();
        for id in ours_alone {
            ours.unknown += ours.known.remove(&id).unwrap_or(0);
        }
        assert_eq!(ours, expected, "{path:?}");
        let messages: usize = ours.known.values().sum();
        println!(
            "{}: {messages} messages of {} ids as pymavlink",
            path.display(),
            ours.known.len()
        );
    }
}

/// What must survive: a companion and a simulated autopilot of each kind; framers check what they
/// send.
#[derive(Clone)]
struct Victims {
    now: Instant,
    companion: Companion<4, 16, 8>,
    autopilots: [Autopilot; 2],
    /// Framers of what each link of the companion and each autopilot sends.
    heard: [Framer; 4],
    said: usize,
}

impl Victims {
    fn new() -> Self {
        let autopilot = |autopilot| {
            let config = sim_autopilot::AutopilotConfig {
                autopilot,
                ..sim_autopilot::AutopilotConfig::default()
            };
            Autopilot::new(&config).unwrap()
        };
        Self {
            now: Instant::ZERO,
            companion: Companion::new(Config::new(1, START, ORIGIN)).unwrap(),
            autopilots: [SimulatedKind::Px4, SimulatedKind::Ardupilot].map(autopilot),
            heard: [const { Framer::new() }; 4],
            said: 0,
        }
    }

    /// Gives bytes to both links and both autopilots, then lets time pass.
    fn hear(&mut self, bytes: &[u8], passes: Duration) {
        for link in [Link::Autopilot, Link::Swarm] {
            self.companion.handle_bytes(link, self.now, bytes);
            self.drain();
        }
        self.autopilots.iter_mut().for_each(|autopilot| autopilot.handle_bytes(bytes));
        self.now = self.now + passes;
        while let Some(due) = self.companion.poll_timeout().filter(|due| *due <= self.now) {
            self.companion.handle_timeout(due.max(self.now));
            self.drain();
        }
        for at in 0..2 {
            self.autopilots[at].step(0.004, 0.0);
            let truth = self.autopilots[at].true_state();
            assert!(
                truth.position.iter().chain(truth.velocity.iter()).all(|x| x.is_finite()),
                "{truth:?}"
            );
            let mut out = [0; 2048];
            loop {
                let length = self.autopilots[at].poll_transmit(&mut out);
                if length == 0 {
                    break;
                }
                self.check(2 + at, &out[..length]);
            }
        }
    }

    fn drain(&mut self) {
        while let Some(event) = self.companion.poll_event() {
            if let Event::PlanRequested(wanted) = event {
                self.companion.handle_plan(self.now, wanted, Ok(&plan()));
            }
        }
        let mut out = [0; 512];
        for link in [Link::Autopilot, Link::Swarm] {
            loop {
                let length = self.companion.poll_transmit(link, &mut out);
                if length == 0 {
                    break;
                }
                self.check(link as usize, &out[..length]);
            }
        }
    }

    /// Asserts that what they send is whole frames, and that setpoints are finite.
    fn check(&mut self, at: usize, mut bytes: &[u8]) {
        while let Some(frame) = self.heard[at].next(self.now, &mut bytes) {
            self.said += 1;
            if frame.message_id == SETPOINT {
                let fields = frame.padded_payload()[4..28].chunks_exact(4);
                let finite = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).is_finite();
                assert!(fields.into_iter().all(finite), "a setpoint that is no number");
            }
        }
        let counters = self.heard[at].counters();
        // PX4 sends GNSS_INTEGRITY, which no dialect here knows.
        assert!(counters.unknown_id == 0 || at == 2, "{counters:?}");
        assert_eq!((counters.bad_crc, counters.noise_bytes), (0, 0));
    }

    /// Lets time pass and asserts that all of them still send messages.
    fn recover(mut self) {
        for _ in 0..100 {
            self.hear(&[], Duration::from_millis(20));
        }
        let before = self.said;
        for _ in 0..300 {
            self.hear(&[], Duration::from_millis(20));
        }
        assert!(self.said > before, "silenced for good");
    }
}

fn plan() -> VehiclePlan<16, 8> {
    let mut path = FlightPath::new();
    for point in [START, START + Point::new(8.0, 0.0, 0.0), START + Point::new(8.0, 6.0, 1.0)] {
        path.push(point, 1.2).unwrap();
    }
    let gates = heapless::Vec::new();
    VehiclePlan {
        task: planner_core::flight::Task::Goto(0),
        path,
        climb_m: 1.7,
        descent_m: 2.7,
        depart_s: 0.0,
        gates,
        swarm_plan_crc: 5,
    }
}

fn below(rng: &mut Pcg32, end: usize) -> usize {
    rng.next_u32() as usize % end.max(1)
}

/// Runs a kind of damage on a piece of every log, several at a time.
fn on_every_log(damage: impl Fn(&mut Victims, &[Vec<u8>], &mut Pcg32) + Sync) {
    let rounds = std::env::var("FLOCKMATE_FUZZ_ROUNDS")
        .map_or(1, |n| n.parse().expect("a number of rounds"));
    let work: Vec<_> = logs::all_logs().into_iter().enumerate().collect();
    work.par_iter().for_each(|(place, path)| {
        let records: Vec<Vec<u8>> =
            logs::read_log(path).into_iter().map(|record| record.bytes).collect();
        for round in 0..rounds {
            let mut rng = Pcg32::seed_from_u64(*place as u64 + 1000 * round);
            let from = if round == 0 { 0 } else { below(&mut rng, records.len()) };
            let mut length = 0;
            let fits = records[from..].iter().take_while(|record| {
                length += record.len();
                length <= ROUND_BYTES
            });
            let to = from + fits.count();
            let mut victims = Victims::new();
            damage(&mut victims, &records[from..to], &mut rng);
            victims.recover();
        }
    });
}

#[test]
fn any_prefix_is_survived() {
    on_every_log(|victims, records, rng| {
        let bytes = records.concat();
        // The stream is cut after random bytes: a copy must recover from there.
        for byte in bytes.iter().take(ROUND_BYTES / 4) {
            victims.hear(core::slice::from_ref(byte), Duration::from_micros(90));
            if below(rng, 2000) == 0 {
                victims.clone().recover();
            }
        }
    });
}

#[test]
fn flipped_bits_are_survived() {
    on_every_log(|victims, records, rng| {
        let mut bytes = records.concat();
        let one_in = 8 << below(rng, 10);
        for byte in &mut bytes {
            if below(rng, one_in) == 0 {
                *byte ^= 1 << below(rng, 8);
            }
        }
        for piece in bytes.chunks(61) {
            victims.hear(piece, Duration::from_millis(2));
        }
    });
}

#[test]
fn shuffled_pieces_are_survived() {
    on_every_log(|victims, records, rng| {
        let bytes = records.concat();
        let mut rest = bytes.as_slice();
        let mut pieces = Vec::new();
        while !rest.is_empty() {
            let (piece, after) = rest.split_at((1 + below(rng, 400)).min(rest.len()));
            pieces.push(piece);
            rest = after;
        }
        for last in (1..pieces.len()).rev() {
            pieces.swap(last, below(rng, last + 1));
        }
        for piece in pieces {
            victims.hear(piece, Duration::from_millis(5));
        }
    });
}

/// A flipped bit would fail the CRC. Here the CRC is right, the sender is one that is listened to,
/// and the payload is damaged.
#[test]
fn forged_payloads_are_survived() {
    on_every_log(|victims, records, rng| {
        let senders = [(1, 1), (1, 191), (2, 191), (255, 190)];
        for (sequence, record) in records.iter().enumerate() {
            let Some(frame) = Framer::new().next(Instant::ZERO, &mut record.as_slice()) else {
                continue;
            };
            let (system, component) = senders[below(rng, senders.len())];
            let mut payload = *frame.padded_payload();
            let used = frame.payload().len();
            for _ in 0..below(rng, 4) {
                payload[below(rng, used)] = match below(rng, 3) {
                    0 => rng.next_u32() as u8,
                    1 => 0xFF,
                    _ => 0x7F,
                };
            }
            let header = Header { system, component, sequence: sequence as u8 };
            let extra = frame::extra_crc(frame.message_id).expect("the framer knew it");
            let mut out = [0; frame::MAX_FRAME_LEN];
            let length =
                frame::encode_raw(header, frame.message_id, extra, &payload[..used], &mut out);
            victims.hear(&out[..length], Duration::from_millis(4));
        }
    });
}
