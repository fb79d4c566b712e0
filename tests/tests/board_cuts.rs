//! The upload of a roadmap to an emulated board is cut anywhere: afterwards the board holds the old
//! roadmap or the new one, whole. A board erases nothing while its vehicle is armed, or while it
//! does not know yet whether it is armed.
//!
//! The board is the firmware as it is flashed, in QEMU and in lock step with its client; its
//! emulated flash keeps its content over a reset, torn words too. Each cut is a reset: while a slot
//! is erased, after a random byte of the upload, or at a random moment after the last byte, while
//! the file is checked and sealed. Every second cut is delayed by microseconds until it leaves a
//! torn word, in the data or the seal. The test then reads by FTP what the board holds.
//!
//! `FLOCKMATE_FIRMWARE=… FLOCKMATE_CUTS=200 cargo test --workspace --test board_cuts -- --nocapture`
//! makes two hundred.

use std::io::{Error, ErrorKind, Result};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::scope;
use std::time::{Duration, Instant};

use companion::Link as Port;
use companion::link::frame::{self, Header};
use companion::storage::store::File;
use flockmate_tests::board;
use flockmate_tests::board_failure::reset;
use host_sim::boards::{EmulatedBoard, PortBytes};
use host_sim::link::ByteLink;
use host_sim::upload::{FtpClient, ftp_crc32};
use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType,
};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::{self, Edge, RoadmapHeader};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Board time between two exchanges with the board, microseconds.
const STEP_US: u64 = 4000;
/// Time between two heartbeats of the autopilot, microseconds.
const BEAT_US: u64 = 250_000;
/// Number of cuts unless `FLOCKMATE_CUTS` sets another.
const CUTS: usize = 16;
/// Number of boards that run at once.
const BOARDS: usize = 4;
/// Time in which a board erases a slot (three sectors of 1.1 s), and a little more, milliseconds.
const ERASE_MS: u32 = 3400;
/// More than a board needs to write the last words, read all back and seal, microseconds.
const SEAL_US: u32 = 6000;
/// Nodes of the longest uploaded files; the upload takes a board less than half a second.
const NODES: u32 = 300;
/// Number of attempts at an upload that the test does not cut.
const TRIES: usize = 5;
/// Words of 32 bytes in a slot, and the number of the word that is the seal.
const SLOT: usize = (384 << 10) / 32;
const SEAL: usize = 2;
/// Number of the slot's word at which the data begins.
const DATA: usize = 8;
/// Most board time between two looks for a torn word, microseconds.
const MOVE_US: u32 = 150;
/// As the companion's `ERASE_WITHOUT_AUTOPILOT_AFTER`, microseconds.
const ALONE_AFTER_US: u64 = 10_000_000;
/// Erasing begins within this time after `ALONE_AFTER_US`, microseconds.
const ERASES_WITHIN_US: u64 = 5_000_000;
/// Words in a block: if more words are torn, a sector was being erased.
const BLOCK: usize = 8;
/// Most looks for a torn word before the cut is made without one.
const LOOKS: usize = 80;

/// When the connection to a board is cut.
#[derive(Clone, Copy)]
enum Cut {
    Never,
    AfterBytes(usize),
    /// Microseconds of the board's time.
    At(u64),
}

/// A board that its clients share, one after the other.
type Shared = Arc<Mutex<EmulatedBoard>>;

/// The autopilot beside a board.
#[derive(Clone, Copy, PartialEq)]
enum Autopilot {
    None,
    Disarmed,
    Armed,
}

/// A client's link to a board's companion. It also plays an autopilot that sends heartbeats.
struct Line {
    board: Shared,
    began: Instant,
    received: Vec<u8>,
    sent: Vec<PortBytes>,
    autopilot: Autopilot,
    beat_at_us: u64,
    cut: Arc<Mutex<Cut>>,
}

impl Line {
    fn new(board: &Shared, autopilot: Autopilot, cut: &Arc<Mutex<Cut>>) -> Box<Self> {
        Box::new(Self {
            board: Arc::clone(board),
            began: Instant::now(),
            received: Vec::new(),
            sent: Vec::new(),
            autopilot,
            beat_at_us: 0,
            cut: Arc::clone(cut),
        })
    }

    fn now_us(&self) -> u64 {
        self.board.lock().unwrap().now_us()
    }

    fn put(&mut self, bytes: &[u8]) {
        let at_us = self.now_us();
        self.sent.push(PortBytes { port: Port::Autopilot, at_us, bytes: bytes.to_owned() });
    }

    fn beat(&mut self) {
        let armed = self.autopilot == Autopilot::Armed;
        let flags = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        let beat = HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: if armed { flags | MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { flags },
            system_status: MavState::MAV_STATE_STANDBY,
            mavlink_version: 3,
            ..HEARTBEAT_DATA::DEFAULT
        };
        let mut out = [0; frame::MAX_FRAME_LEN];
        let length =
            frame::encode(Header { system: 1, component: 1, sequence: 0 }, &beat, &mut out);
        self.put(&out[..length]);
    }
}

impl ByteLink for Line {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let now_us = self.now_us();
        if matches!(*self.cut.lock().unwrap(), Cut::At(at_us) if now_us >= at_us) {
            return Err(ErrorKind::ConnectionAborted.into());
        }
        if self.autopilot != Autopilot::None && now_us >= self.beat_at_us {
            self.beat_at_us = now_us + BEAT_US;
            self.beat();
        }
        let length = self.received.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.received[..length]);
        self.received.drain(..length);
        Ok(length)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        let passes = match &mut *self.cut.lock().unwrap() {
            Cut::AfterBytes(left) => {
                let passes = bytes.len().min(*left);
                *left -= passes;
                passes
            }
            Cut::Never | Cut::At(_) => bytes.len(),
        };
        self.put(&bytes[..passes]);
        if passes < bytes.len() {
            // The board receives what came before.
            self.wait_briefly();
            return Err(Error::from(ErrorKind::ConnectionAborted));
        }
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        None
    }

    fn now(&self) -> Instant {
        self.began + Duration::from_micros(self.now_us())
    }

    fn wait_briefly(&mut self) {
        let mut until_us = self.now_us() + STEP_US;
        if let Cut::At(at_us) = *self.cut.lock().unwrap() {
            until_us = until_us.min(at_us);
        }
        let sent = core::mem::take(&mut self.sent);
        let answer = self.board.lock().unwrap().run_grant(until_us, &sent).expect("the board runs");
        let ours = answer.sent.into_iter().filter(|piece| piece.port == Port::Autopilot);
        self.received.extend(ours.flat_map(|piece| piece.bytes));
    }
}

/// A roadmap file of `nodes` nodes in a row.
fn roadmap(nodes: u32, shift_m: f32) -> Vec<u8> {
    let points: Vec<Point> = (0..nodes).map(|i| Point::new(i as f32, shift_m, 2.0)).collect();
    let edge = |i: u32| Edge { a: i as u16 - 1, b: i as u16, clearance_m: 1.0 };
    let edges: Vec<Edge> = (1..nodes).map(edge).collect();
    let header = RoadmapHeader {
        origin: Geodetic { lat_deg: 47.0, lon_deg: 8.0, alt_m: 500.0 },
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        tested_clearance_m: 0.8,
        max_clearance_m: 6.0,
        start_count: 1,
        goal_count: 1,
    };
    let mut bytes =
        vec![0; roadmap::encoded_len(points.len(), edges.len(), 0).expect("it is small")];
    let length = roadmap::write(&header, &points, &edges, &mut bytes).expect("it is a roadmap");
    assert_eq!(length, bytes.len());
    bytes
}

/// A client of a board, whose connection is cut as `cut` says.
fn client(board: &Shared, autopilot: Autopilot, cut: &Arc<Mutex<Cut>>) -> FtpClient {
    FtpClient::new(Line::new(board, autopilot, cut), None)
}

/// A client that has found the companion, and is never cut.
fn uncut(board: &Shared, autopilot: Autopilot) -> FtpClient {
    let mut client = client(board, autopilot, &Arc::new(Mutex::new(Cut::Never)));
    client.wait_for_companion().expect("the board is there");
    client
}

/// Where cuts fell, and what the board held afterwards.
#[derive(Debug, Default)]
struct Tally {
    /// The board held the old file afterwards, or (`replaced`) the new one.
    kept: usize,
    replaced: usize,
    /// The cut left torn words: in a sector that was being erased, in the data, before the data
    /// (`torn_mark`), or in the seal.
    torn_sector: usize,
    torn_data: usize,
    torn_mark: usize,
    torn_seal: usize,
}

impl Tally {
    fn add(&mut self, other: &Self) {
        self.kept += other.kept;
        self.replaced += other.replaced;
        self.torn_sector += other.torn_sector;
        self.torn_data += other.torn_data;
        self.torn_mark += other.torn_mark;
        self.torn_seal += other.torn_seal;
    }

    fn note_torn(&mut self, torn: &[usize]) {
        let Some(first) = torn.first() else { return };
        *match first % SLOT {
            _ if torn.len() > BLOCK => &mut self.torn_sector,
            SEAL => &mut self.torn_seal,
            DATA.. => &mut self.torn_data,
            _ => &mut self.torn_mark,
        } += 1;
    }
}

/// What the board does with its flash when the cut comes.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Erasing,
    Taking,
    Sealing,
}

/// Begins an upload and cuts it at a random moment of `part`. Returns whether it completed before
/// the cut.
fn cut_upload(board: &Shared, file: &[u8], part: Part, rng: &mut Pcg32) -> bool {
    let after_us = 1000 * u64::from(rng.next_u32() % ERASE_MS);
    let seal_in_us = u64::from(rng.next_u32() % SEAL_US);
    let now_us = || board.lock().unwrap().now_us();
    // Each piece of 239 bytes travels with about 24 bytes of framing.
    let bytes = rng.next_u32() as usize % (file.len() * 11 / 10);
    let cut = Arc::new(Mutex::new(match part {
        Part::Erasing => Cut::At(now_us() + after_us),
        Part::Taking => Cut::AfterBytes(bytes),
        Part::Sealing => Cut::Never,
    }));
    let mut client = client(board, Autopilot::Disarmed, &cut);
    let all = file.len() as u64;
    let sealing = |arrived| {
        if part == Part::Sealing && arrived == all {
            *cut.lock().unwrap() = Cut::At(now_us() + seal_in_us);
        }
    };
    client.wait_for_companion().and_then(|_| client.upload(File::Roadmap, file, sealing)).is_ok()
}

/// Stops a board once a word is torn (while sealing: the seal), at the latest after running it
/// `most` times for a moment. Returns the torn words.
fn stop(board: &Shared, part: Part, most: usize, rng: &mut Pcg32) -> Vec<usize> {
    let mut board = board.lock().unwrap();
    for _ in 0..most {
        let torn = board.torn_flash_words().expect("a board");
        let found = torn.first().is_some_and(|word| part != Part::Sealing || word % SLOT == SEAL);
        if found {
            return torn;
        }
        let until_us = board.now_us() + u64::from(rng.next_u32() % MOVE_US);
        board.run_grant(until_us, &[]).expect("a board");
    }
    board.torn_flash_words().expect("a board")
}

/// Starts a board with an empty flash.
fn start(program: &Path, folder: &Path) -> Shared {
    Arc::new(Mutex::new(EmulatedBoard::start(program, &folder.join("log")).expect("a board")))
}

/// Cuts uploads to one board again and again.
fn cut_again_and_again(program: &Path, cuts: usize, seed: u64) -> Tally {
    let mut rng = Pcg32::seed_from_u64(seed);
    let folder = tempfile::tempdir().expect("a temporary directory");
    let board = start(program, folder.path());
    let mut tally = Tally::default();
    let file = roadmap(20, seed as f32);
    let mut old = ftp_crc32(&file);
    let first = || uncut(&board, Autopilot::Disarmed).upload(File::Roadmap, &file, |_| ()).is_ok();
    assert!((0..TRIES).any(|_| first()), "no upload is possible");
    reset(&mut board.lock().unwrap());
    for cut in 0..cuts {
        let file = roadmap(10 + rng.next_u32() % NODES, cut as f32);
        let new = ftp_crc32(&file);
        let part = [Part::Erasing, Part::Taking, Part::Sealing][rng.next_u32() as usize % 3];
        let whole = cut_upload(&board, &file, part, &mut rng);
        let torn = stop(&board, part, if cut % 2 == 0 { LOOKS } else { 0 }, &mut rng);
        reset(&mut board.lock().unwrap());
        tally.note_torn(&torn);
        let now = uncut(&board, Autopilot::Disarmed)
            .remote_crc(File::Roadmap)
            .expect("it holds a roadmap");
        assert!(
            now == new || now == old && !whole,
            "seed {seed}, cut {cut}: the board holds {now:08x}, old is {old:08x}, new {new:08x}; torn: {torn:?}"
        );
        *if now == new { &mut tally.replaced } else { &mut tally.kept } += 1;
        old = now;
    }
    tally
}

#[test]
fn an_upload_cut_anywhere_leaves_the_old_or_the_new() {
    let Some(program) = board::built_program("flockmate") else { return };
    let cuts = std::env::var("FLOCKMATE_CUTS").map_or(CUTS, |n| n.parse().expect("a number"));
    let began = Instant::now();
    let mut tally = Tally::default();
    scope(|scope| {
        let of_board = |i: usize| {
            let (program, share) = (&program, cuts * (i + 1) / BOARDS - cuts * i / BOARDS);
            scope.spawn(move || cut_again_and_again(program, share, i as u64 + 1))
        };
        let threads: Vec<_> = (0..BOARDS).map(of_board).collect();
        threads.into_iter().for_each(|thread| tally.add(&thread.join().expect("a board")));
    });
    println!("{cuts} cuts in {:.0} s: {tally:?}", began.elapsed().as_secs_f32());
    assert_eq!(tally.kept + tally.replaced, cuts);
}

#[test]
fn an_armed_board_erases_nothing() {
    let Some(program) = board::built_program("flockmate") else { return };
    let folder = tempfile::tempdir().expect("a temporary directory");
    let board = start(&program, folder.path());
    let file = roadmap(20, 0.0);
    let torn = || board.lock().unwrap().torn_flash_words().expect("a board");
    let run = |time_us: u64| {
        let mut board = board.lock().unwrap();
        let until_us = board.now_us() + time_us;
        board.run_grant(until_us, &[]).expect("a board");
    };
    let mut client = uncut(&board, Autopilot::Armed);
    for _ in 0..3 {
        let refused = client.upload(File::Roadmap, &file, |_| ()).expect_err("it is armed");
        assert!(format!("{refused:#}").contains("the companion protects its file"), "{refused:#}");
        run(1_000_000);
        assert!(torn().is_empty());
    }
    drop(client);
    // A board without an autopilot assumes after ten seconds of its time that none is armed.
    reset(&mut board.lock().unwrap());
    while torn().is_empty() {
        let now_us = board.lock().unwrap().now_us();
        assert!(
            now_us < ALONE_AFTER_US + ERASES_WITHIN_US,
            "it erases nothing without an autopilot"
        );
        run(100_000);
    }
    let erased_us = board.lock().unwrap().now_us();
    assert!(erased_us > ALONE_AFTER_US, "erased after {erased_us} µs");
    uncut(&board, Autopilot::None).upload(File::Roadmap, &file, |_| ()).expect("nothing is armed");
}
