//! A roadmap on its way into an emulated board, cut anywhere: afterwards the board holds the old one or the new one, whole. An
//! armed board erases nothing, nor one that does not know yet whether it is.
//!
//! The board is the firmware as it is flashed, in QEMU; its emulated flash keeps over a reset what was in it, torn words too. Each
//! cut is a reset: while a slot is erased, after a random byte of the upload, or a random moment after the last one, while it is
//! checked and sealed. Every second cut is moved on, by instants, to one that leaves a torn word: of the data, or the seal. What
//! the board holds then is asked of it by FTP.
//!
//! `FLOCKMATE_FIRMWARE=… FLOCKMATE_CUTS=200 cargo test --workspace --test board_cuts -- --nocapture` makes two hundred.

use std::io::{Error, ErrorKind, Result};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::{scope, sleep};
use std::time::{Duration, Instant as Clock};

use companion::Link as Port;
use companion::link::frame::{self, Header};
use companion::storage::store::File;
use flockmate_tests::board::{self, Emulated};
use host_sim::link::Link;
use host_sim::upload::{Client, crc32};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType};
use planner_core::Point;
use planner_core::frames::Geodetic;
use planner_core::roadmap::{self, Edge, RoadmapHeader};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// What works takes a tenth of it.
const PATIENCE: Duration = Duration::from_secs(150);
/// Cuts of a run that does not say how many.
const CUTS: usize = 16;
/// Boards at once: they mostly wait for their flash.
const BOARDS: usize = 4;
/// Erasing a slot takes a board three times 1.1 s.
const ERASE_MS: u32 = 3400;
/// Writing the last words, reading all back and sealing takes it less, microseconds.
const SEAL_US: u32 = 6000;
/// A file of this length takes a board less than half a second.
const NODES: u32 = 300;
/// Uploads that are not cut by us are tried so often.
const TRIES: usize = 5;
/// Words in a slot, and which of its first ones is the seal.
const SLOT: usize = (384 << 10) / 32;
const SEAL: usize = 2;
/// Where a slot's data begins, words.
const DATA: usize = 8;
/// A halted board runs on for less than this between two looks, microseconds.
const MOVE_US: u32 = 150;
/// As `ALONE_AFTER` of the companion's services.
const ALONE_AFTER: Duration = Duration::from_secs(10);
/// More torn words than a block has are a sector that is erased.
const BLOCK: usize = 8;
/// Looks for a torn word before a cut is made all the same.
const LOOKS: usize = 80;

/// When a line is cut.
#[derive(Clone, Copy)]
enum Cut {
    Never,
    AfterBytes(usize),
    At(Clock),
}

/// What a client sees of its vehicle: the companion, and an autopilot that tells that it is there.
struct Line {
    link: Box<dyn Link>,
    /// Whether the autopilot is armed; none is there if there is nothing in it.
    armed: Option<bool>,
    beat_at: Clock,
    cut: Arc<Mutex<Cut>>,
}

impl Line {
    fn new(board: &Emulated, armed: Option<bool>, cut: &Arc<Mutex<Cut>>) -> Box<Self> {
        let link = board.plug(Port::Autopilot);
        Box::new(Self { link, armed, beat_at: Clock::now(), cut: Arc::clone(cut) })
    }

    fn beat(&mut self, armed: bool) -> Result<()> {
        let flags = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        let beat = HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: if armed { flags | MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { flags },
            system_status: MavState::MAV_STATE_STANDBY,
            mavlink_version: 3,
            ..HEARTBEAT_DATA::DEFAULT
        };
        let mut out = [0; frame::MAX_SENT];
        let length = frame::encode(Header { system: 1, component: 1, sequence: 0 }, &beat, &mut out);
        self.link.send(&out[..length])
    }
}

impl Link for Line {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if matches!(*self.cut.lock().unwrap(), Cut::At(at) if Clock::now() >= at) {
            return Err(ErrorKind::ConnectionAborted.into());
        }
        if let Some(armed) = self.armed
            && Clock::now() >= self.beat_at
        {
            self.beat_at = Clock::now() + Duration::from_millis(250);
            self.beat(armed)?;
        }
        self.link.receive(buffer)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        let mut cut = self.cut.lock().unwrap();
        if let Cut::AfterBytes(left) = &mut *cut {
            if let Some(rest) = left.checked_sub(bytes.len()) {
                *left = rest;
            } else {
                self.link.send(&bytes[..*left])?;
                return Err(Error::from(ErrorKind::ConnectionAborted));
            }
        }
        self.link.send(bytes)
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.link.local_address()
    }
}

/// A roadmap of that many nodes in a row.
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
        starts: 1,
        goals: 1,
    };
    let mut bytes = vec![0; roadmap::encoded_len(points.len(), edges.len(), 0).expect("it is small")];
    let length = roadmap::write(&header, &points, &edges, &mut bytes).expect("it is a roadmap");
    assert_eq!(length, bytes.len());
    bytes
}

/// What a client sees of a board until a cut.
fn client(board: &Emulated, armed: Option<bool>, cut: &Arc<Mutex<Cut>>) -> Client {
    Client::new(Line::new(board, armed, cut), None)
}

/// One that found it, and is never cut.
fn uncut(board: &Emulated, armed: Option<bool>) -> Client {
    let mut client = client(board, armed, &Arc::new(Mutex::new(Cut::Never)));
    client.find().expect("the board is there");
    client
}

/// Where cuts fell, and what the board held afterwards.
#[derive(Debug, Default)]
struct Tally {
    kept: usize,
    replaced: usize,
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

/// What is being done to the flash when a cut comes.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Erasing,
    Taking,
    Sealing,
}

/// Begins an upload and cuts it at a random moment of a part; whether it was over before.
fn cut_upload(board: &Emulated, file: &[u8], part: Part, rng: &mut Pcg32) -> bool {
    let after_ms = Duration::from_millis(u64::from(rng.next_u32() % ERASE_MS));
    let seal_in = Duration::from_micros(u64::from(rng.next_u32() % SEAL_US));
    // Beside every piece of 239 bytes travel 24 or so.
    let bytes = rng.next_u32() as usize % (file.len() * 11 / 10);
    let cut = Arc::new(Mutex::new(match part {
        Part::Erasing => Cut::At(Clock::now() + after_ms),
        Part::Taking => Cut::AfterBytes(bytes),
        Part::Sealing => Cut::Never,
    }));
    let mut client = client(board, Some(false), &cut);
    let all = file.len() as u64;
    let sealing = |arrived| {
        if part == Part::Sealing && arrived == all {
            *cut.lock().unwrap() = Cut::At(Clock::now() + seal_in);
        }
    };
    client.find().and_then(|_| client.upload(File::Roadmap, file, sealing)).is_ok()
}

/// Halts a board; every second time, if it may, where a word of the kind that the part has is torn. The torn words.
fn halt(board: &mut Emulated, part: Part, moves_on: bool, rng: &mut Pcg32) -> Vec<usize> {
    for _ in 0..LOOKS {
        board.halt(true);
        let torn = board.torn();
        let found = torn.first().is_some_and(|word| part != Part::Sealing || word % SLOT == SEAL);
        if found || !moves_on {
            return torn;
        }
        board.halt(false);
        sleep(Duration::from_micros(u64::from(rng.next_u32() % MOVE_US)));
    }
    board.halt(true);
    board.torn()
}

/// Cuts uploads to one board again and again.
fn cut_again_and_again(program: &Path, cuts: usize, seed: u64) -> Tally {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut board = Emulated::start(program, None, None);
    let mut tally = Tally::default();
    let file = roadmap(20, seed as f32);
    let mut old = crc32(&file);
    let first = || uncut(&board, Some(false)).upload(File::Roadmap, &file, |_| ()).is_ok();
    assert!((0..TRIES).any(|_| first()), "no upload is possible");
    board.reset();
    for cut in 0..cuts {
        let file = roadmap(10 + rng.next_u32() % NODES, cut as f32);
        let new = crc32(&file);
        let part = [Part::Erasing, Part::Taking, Part::Sealing][rng.next_u32() as usize % 3];
        let whole = cut_upload(&board, &file, part, &mut rng);
        let torn = halt(&mut board, part, cut % 2 == 0, &mut rng);
        board.reset();
        board.halt(false);
        tally.note_torn(&torn);
        let now = uncut(&board, Some(false)).sum(File::Roadmap).expect("it holds a roadmap");
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
    let Some(program) = board::program("flockmate") else { return };
    let cuts = std::env::var("FLOCKMATE_CUTS").map_or(CUTS, |n| n.parse().expect("a number"));
    let began = Clock::now();
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
    let Some(program) = board::program("flockmate") else { return };
    let mut board = Emulated::start(&program, None, None);
    let file = roadmap(20, 0.0);
    let mut client = uncut(&board, Some(true));
    for _ in 0..3 {
        let refused = client.upload(File::Roadmap, &file, |_| ()).expect_err("it is armed");
        assert!(format!("{refused:#}").contains("the companion protects its file"), "{refused:#}");
        sleep(Duration::from_secs(1));
        assert!(board.torn().is_empty());
    }
    drop(client);
    // Without an autopilot it is known after ten seconds of the board's time that none is armed; no time of its own passes faster.
    let began = Clock::now();
    board.reset();
    while board.torn().is_empty() {
        assert!(began.elapsed() < PATIENCE, "it erases nothing without an autopilot");
        sleep(Duration::from_millis(100));
    }
    assert!(began.elapsed() > ALONE_AFTER, "erased after {:?}", began.elapsed());
    uncut(&board, None).upload(File::Roadmap, &file, |_| ()).expect("nothing is armed");
}
