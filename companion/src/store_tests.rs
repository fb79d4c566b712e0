//! The store over a simulated flash: words of 32 bytes that tear when the power goes, and may not be readable afterwards.

extern crate std;
use std::collections::HashSet;
use std::vec;
use std::vec::Vec;

use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::frames::Geodetic;
use planner_core::plan::{Mode, VehicleTask};
use planner_core::roadmap::{self, Edge, LANDMARKS, RoadmapHeader, RoadmapView};
use planner_core::schedule::ScheduleConfig;
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::window::Taken;
use super::*;
use crate::mission_file::{self, MissionHeader, MissionVehicle};

/// As the H743's bank, but smaller, so that many cuts are tried in little time.
const LAYOUT: Layout = Layout { sector_len: 8 << 10, slot_len: 24 << 10, half_len: 8 << 10 };
const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };

/// The power went.
#[derive(Debug)]
struct Cut;

struct Flash {
    bytes: Vec<u8>,
    torn: HashSet<u32>,
    rng: Pcg32,
    /// Words that may still be programmed or erased before the power goes.
    power: Option<u32>,
    programmed: u32,
}

impl Flash {
    /// As it comes: anything may be in it, and some words cannot be read.
    fn new(seed: u64) -> Self {
        let mut rng = Pcg32::new(seed, 7);
        let bytes = (0..LAYOUT.len()).map(|_| rng.next_u32() as u8).collect();
        let torn = (0..50).map(|_| rng.next_u32() % (LAYOUT.len() / WORD as u32)).collect();
        Self { bytes, torn, rng, power: None, programmed: 0 }
    }

    /// Whether the power goes at this word.
    fn goes(&mut self) -> bool {
        self.programmed += 1;
        match &mut self.power {
            Some(0) => true,
            Some(left) => {
                *left -= 1;
                false
            }
            None => false,
        }
    }

    /// A word the power went at: as it was, as it was to be, or anything between, readable or not.
    fn tear(&mut self, at: usize, wanted: &[u8]) {
        let kind = self.rng.next_u32() % 4;
        for (i, byte) in wanted.iter().enumerate() {
            let mask = self.rng.next_u32() as u8;
            let old = self.bytes[at + i];
            self.bytes[at + i] = match kind {
                0 => old,
                1 => *byte,
                _ => old & mask | byte & !mask,
            };
        }
        if kind == 3 {
            self.torn.insert((at / WORD) as u32);
        }
    }

    fn erase(&mut self, at: u32) -> Result<(), Cut> {
        assert_eq!(at % LAYOUT.sector_len, 0);
        let words = LAYOUT.sector_len as usize / WORD;
        let goes = self.goes();
        for i in 0..words {
            let at = at as usize + i * WORD;
            if goes && self.rng.next_u32() % 2 == 0 {
                self.tear(at, &[0xFF; WORD]);
            } else {
                self.bytes[at..at + WORD].fill(0xFF);
                self.torn.remove(&((at / WORD) as u32));
            }
        }
        if goes { Err(Cut) } else { Ok(()) }
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Cut> {
        assert!(at as usize % WORD == 0 && bytes.len() % WORD == 0 && (1..=BLOCK).contains(&bytes.len()));
        for (i, word) in bytes.chunks(WORD).enumerate() {
            let at = at as usize + i * WORD;
            let blank = self.bytes[at..at + WORD].iter().all(|b| *b == 0xFF);
            assert!(blank && !self.torn.contains(&((at / WORD) as u32)), "programmed twice at {at:#x}");
            if self.goes() {
                self.tear(at, word);
                return Err(Cut);
            }
            self.bytes[at..at + WORD].copy_from_slice(word);
        }
        Ok(())
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), Fault> {
        let (start, end) = (at as usize, at as usize + out.len());
        if (start / WORD..end.div_ceil(WORD)).any(|word| self.torn.contains(&(word as u32))) {
            return Err(Fault);
        }
        out.copy_from_slice(&self.bytes[start..end]);
        Ok(())
    }
}

/// Does what the store asks until it asks for nothing.
fn run(store: &mut Store, flash: &mut Flash, may_erase: bool) -> Result<(), Cut> {
    let mut read = [0; READ];
    for _ in 0..100_000 {
        let Some(request) = store.poll(may_erase) else { return Ok(()) };
        let outcome: Result<&[u8], Fault> = match request {
            FlashRequest::Erase { at } => {
                assert!(may_erase, "erased while armed");
                flash.erase(at)?;
                Ok(&[])
            }
            FlashRequest::Program { at, bytes } => {
                flash.program(at, bytes)?;
                Ok(&[])
            }
            FlashRequest::Read { at, len } => {
                assert!(len <= READ && len > 0);
                flash.read(at, &mut read[..len]).map(|()| &read[..len])
            }
        };
        store.handle(outcome);
    }
    panic!("it asks for ever");
}

/// Tidies the flash up as a board that stands idle does.
fn started(flash: &mut Flash) -> Store {
    let mut store = Store::mount(LAYOUT, flash);
    run(&mut store, flash, true).expect("the power is on");
    store
}

/// Uploads a file in pieces of `piece` bytes.
fn upload(
    store: &mut Store,
    flash: &mut Flash,
    file: File,
    bytes: &[u8],
    piece: usize,
) -> Result<Result<(), UploadError>, Cut> {
    if let Err(why) = store.open(file, true) {
        return Ok(Err(why));
    }
    run(store, flash, true)?;
    for (i, part) in bytes.chunks(piece).enumerate() {
        assert_eq!(store.take((i * piece) as u32, part), Taken::Yes);
        run(store, flash, true)?;
    }
    store.close();
    run(store, flash, true)?;
    match store.upload() {
        Some(UploadState::Ended(result)) => Ok(result),
        other => panic!("{other:?}"),
    }
}

fn roadmap(nodes: usize) -> Vec<u8> {
    let points: Vec<Point> = (0..nodes).map(|i| Point::new(i as f32, (i % 7) as f32, 2.0)).collect();
    let edges: Vec<Edge> =
        (1..nodes).map(|i| Edge { a: i as u16 - 1, b: i as u16, clearance_m: 1.0 }).collect();
    let header = RoadmapHeader {
        origin: ORIGIN,
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        tested_clearance_m: 0.8,
        max_clearance_m: 6.0,
        starts: 1,
        goals: 1,
    };
    let mut bytes = vec![0; roadmap::encoded_len(nodes, edges.len(), LANDMARKS).unwrap()];
    let mut workspace = std::boxed::Box::new(planner_core::search::SearchWorkspace::<1024>::new());
    roadmap::write_with_landmarks(&header, &points, &edges, &mut workspace, &mut bytes).unwrap();
    bytes
}

fn mission(vehicles: u8) -> Vec<u8> {
    let header = MissionHeader {
        roadmap_crc: 1,
        mode: Mode::Labelled,
        method: Method::Priority,
        origin: ORIGIN,
        schedule: ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.75,
            cruise_mps: 2.0,
            vertical_mps: 1.0,
        },
        safety_distance_m: 1.5,
        geofence: None,
    };
    let task = |id| VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.0, goal: None };
    let start = Point::new(1.0, 2.0, 3.0);
    let roster: Vec<_> = (1..=vehicles)
        .map(|id| MissionVehicle { task: task(id), start, radius_m: 0.3, speed_max_mps: 5.0 })
        .collect();
    let mut bytes = vec![0; mission_file::encoded_len(roster.len(), 0)];
    mission_file::write(&header, &roster, &[], &mut bytes).unwrap();
    bytes
}

fn held(flash: &Flash, extent: Option<Range<u32>>) -> Option<&[u8]> {
    extent.map(|extent| &flash.bytes[extent.start as usize..extent.end as usize])
}

#[test]
fn files_come_back_after_a_restart() {
    let mut flash = Flash::new(1);
    let mut store = started(&mut flash);
    assert_eq!((store.roadmap(), store.mission(), store.size(File::Roadmap)), (None, None, None));
    for (round, nodes) in [300, 10, 600].into_iter().enumerate() {
        let (road, flown) = (roadmap(nodes), mission(nodes as u8 % 50 + 1));
        for (file, bytes) in [(File::Roadmap, &road), (File::Mission, &flown)] {
            assert_eq!(upload(&mut store, &mut flash, file, bytes, 239).unwrap(), Ok(()));
            assert_eq!(store.size(file), Some(bytes.len() as u32));
        }
        assert_eq!(store.roadmap().is_some(), round > 0, "used from the next start on");
        if round > 0 {
            assert_eq!(store.open(File::Roadmap, true), Err(UploadError::Waiting), "one waits already");
        }
        store = started(&mut flash);
        assert_eq!(held(&flash, store.roadmap()), Some(road.as_slice()));
        assert_eq!(held(&flash, store.mission()), Some(flown.as_slice()));
        assert!(RoadmapView::parse(held(&flash, store.roadmap()).unwrap()).is_ok());
    }
    store.remove(File::Roadmap);
    store.remove(File::Mission);
    run(&mut store, &mut flash, false).unwrap();
    assert_eq!((store.size(File::Roadmap), store.size(File::Mission)), (None, None));
    store = started(&mut flash);
    assert_eq!((store.roadmap(), store.mission()), (None, None));
    assert_eq!(upload(&mut store, &mut flash, File::Roadmap, &roadmap(20), 80).unwrap(), Ok(()));
    store = started(&mut flash);
    assert_eq!(held(&flash, store.roadmap()), Some(roadmap(20).as_slice()));
}

#[test]
fn what_is_damaged_or_not_whole_leaves_the_old() {
    let mut flash = Flash::new(2);
    let mut store = started(&mut flash);
    let (road, flown) = (roadmap(200), mission(3));
    upload(&mut store, &mut flash, File::Roadmap, &road, 239).unwrap().unwrap();
    upload(&mut store, &mut flash, File::Mission, &flown, 239).unwrap().unwrap();
    for (file, whole) in [(File::Roadmap, roadmap(210)), (File::Mission, mission(4))] {
        for (bytes, why) in [
            (&whole[..whole.len() - 1], UploadError::Damaged),
            (&whole[1..], UploadError::Damaged),
            (&[][..], UploadError::Damaged),
            (&[&whole[..], &[0xFF; 40]].concat(), UploadError::Damaged),
            (&[&whole[..60], &[0x11], &whole[61..]].concat(), UploadError::Damaged),
        ] {
            store = started(&mut flash);
            assert_eq!(upload(&mut store, &mut flash, file, bytes, 100).unwrap(), Err(why));
        }
        store = started(&mut flash);
        store.open(file, true).unwrap();
        run(&mut store, &mut flash, true).unwrap();
        assert_eq!(store.take(0, &whole[..100]), Taken::Yes);
        assert_eq!(store.take(101, &whole[101..150]), Taken::Yes);
        store.close();
        assert_eq!(store.upload(), Some(UploadState::Ended(Err(UploadError::Incomplete))));
    }
    store = started(&mut flash);
    assert_eq!(held(&flash, store.roadmap()), Some(road.as_slice()));
    assert_eq!(held(&flash, store.mission()), Some(flown.as_slice()));
    assert_eq!(store.open(File::Mission, true), Ok(()));
    assert_eq!(store.take(4000, &[0; 97]), Taken::TooLarge);
    assert_eq!(store.open(File::Roadmap, true), Ok(()));
    run(&mut store, &mut flash, true).unwrap();
    assert_eq!(store.take(24 << 10, &[0; 1]), Taken::TooLarge);
}

#[test]
fn nothing_is_erased_while_armed() {
    let mut flash = Flash::new(3);
    let mut store = Store::mount(LAYOUT, &mut flash);
    assert_eq!(store.open(File::Roadmap, false), Err(UploadError::Armed));
    store.set_parameter(0, 2.5).unwrap();
    run(&mut store, &mut flash, false).unwrap();
    assert!(store.is_unsaved(), "there is no clean half to keep it in yet");
    run(&mut store, &mut flash, true).unwrap();
    assert!(!store.is_unsaved());
    // With areas erased ahead, parameters are kept and a roadmap is taken in while armed.
    store.set_parameter(0, 3.5).unwrap();
    run(&mut store, &mut flash, false).unwrap();
    let road = roadmap(50);
    store.open(File::Roadmap, false).unwrap();
    run(&mut store, &mut flash, false).unwrap();
    for (i, part) in road.chunks(200).enumerate() {
        assert_eq!(store.take(200 * i as u32, part), Taken::Yes);
        run(&mut store, &mut flash, false).unwrap();
    }
    store.close();
    run(&mut store, &mut flash, false).unwrap();
    assert_eq!(store.upload(), Some(UploadState::Ended(Ok(()))));
    let store = Store::mount(LAYOUT, &mut flash);
    assert_eq!(store.parameters().get(0), Some(("FLK_ACCEL", 3.5)));
    assert_eq!(held(&flash, store.roadmap()), Some(road.as_slice()));
}

#[test]
fn parameters_outlive_many_changes_and_the_mission_with_them() {
    let mut flash = Flash::new(4);
    let mut store = started(&mut flash);
    let flown = mission(40);
    upload(&mut store, &mut flash, File::Mission, &flown, 239).unwrap().unwrap();
    for i in 0..300u32 {
        let value = 0.5 + (i % 40) as f32 * 0.1;
        store.set_parameter(0, value).unwrap();
        run(&mut store, &mut flash, true).unwrap();
        if i % 13 == 0 {
            store = started(&mut flash);
        }
        assert_eq!(store.parameters().get(0), Some(("FLK_ACCEL", value)));
        assert_eq!(held(&flash, store.mission()), Some(flown.as_slice()));
    }
}

/// Cuts the power at a random word of `change`; afterwards a fresh start must find `before` or `after`, whole.
fn cut_anywhere(seed: u64, change: impl Fn(&mut Store, &mut Flash) -> Result<(), Cut>, cuts: u32) {
    let (old_road, old_mission) = (roadmap(200), mission(30));
    let (new_road, new_mission) = (roadmap(500), mission(50));
    let mut found = [0; 2];
    for cut in 0..cuts {
        let mut flash = Flash::new(seed + u64::from(cut));
        let mut store = started(&mut flash);
        upload(&mut store, &mut flash, File::Roadmap, &old_road, 239).unwrap().unwrap();
        upload(&mut store, &mut flash, File::Mission, &old_mission, 239).unwrap().unwrap();
        store.set_parameter(0, 1.0).unwrap();
        store = started(&mut flash);
        assert!(store.parameters().get(0).unwrap().1 == 1.5, "never asked to keep it");
        store.set_parameter(0, 1.0).unwrap();
        run(&mut store, &mut flash, true).unwrap();
        // How many words the change takes, from a first go without a cut.
        let (bytes, torn, rng) = (flash.bytes.clone(), flash.torn.clone(), flash.rng.clone());
        let begun = flash.programmed;
        change(&mut Store::mount(LAYOUT, &mut flash), &mut flash).expect("the power is on");
        let words = flash.programmed - begun;
        (flash.bytes, flash.torn, flash.rng) = (bytes, torn, rng);
        flash.power = Some(flash.rng.next_u32() % words);
        change(&mut Store::mount(LAYOUT, &mut flash), &mut flash).expect_err("the power goes");
        flash.power = None;
        // Some boards are cut again while they tidy up.
        if cut % 3 == 0 {
            flash.power = Some(flash.rng.next_u32() % 40);
            let mut store = Store::mount(LAYOUT, &mut flash);
            let _ = run(&mut store, &mut flash, true);
            flash.power = None;
        }
        let mut store = started(&mut flash);
        let (road, flown) = (held(&flash, store.roadmap()), held(&flash, store.mission()));
        let is_new = road == Some(new_road.as_slice());
        assert!(is_new || road == Some(old_road.as_slice()), "cut {cut}: neither roadmap is whole");
        assert!(flown == Some(&new_mission) || flown == Some(&old_mission), "cut {cut}: neither mission");
        let value = store.parameters().get(0).unwrap().1;
        assert!(value == 1.0 || value == 2.0, "cut {cut}: {value}");
        found[usize::from(is_new)] += 1;
        // And everything still works.
        assert_eq!(
            upload(&mut store, &mut flash, File::Roadmap, &new_road, 239).unwrap(),
            Ok(()),
            "cut {cut}"
        );
        assert_eq!(
            upload(&mut store, &mut flash, File::Mission, &new_mission, 80).unwrap(),
            Ok(()),
            "cut {cut}"
        );
        store = started(&mut flash);
        assert_eq!(held(&flash, store.roadmap()), Some(new_road.as_slice()), "cut {cut}");
        assert_eq!(held(&flash, store.mission()), Some(new_mission.as_slice()), "cut {cut}");
    }
    std::println!("{cuts} cuts: {} found the old roadmap, {} the new", found[0], found[1]);
}

#[test]
fn a_cut_anywhere_leaves_the_old_roadmap_or_the_new_one_whole() {
    let change = |store: &mut Store, flash: &mut Flash| {
        let road = roadmap(500);
        run(store, flash, true)?;
        upload(store, flash, File::Roadmap, &road, 239)?.expect("it is sound");
        *store = Store::mount(LAYOUT, flash);
        run(store, flash, true)
    };
    cut_anywhere(1000, change, 300);
}

#[test]
fn a_cut_anywhere_leaves_the_old_mission_or_the_new_one_whole() {
    let change = |store: &mut Store, flash: &mut Flash| {
        let flown = mission(50);
        run(store, flash, true)?;
        for _ in 0..5 {
            upload(store, flash, File::Mission, &flown, 239)?.expect("it is sound");
            store.set_parameter(0, 2.0).unwrap();
            run(store, flash, true)?;
        }
        Ok(())
    };
    cut_anywhere(5000, change, 300);
}

#[test]
fn a_flash_that_fails_is_told_and_never_asked_for_ever() {
    for failing in 0..3 {
        let mut flash = Flash::new(6);
        let mut store = started(&mut flash);
        store.set_parameter(0, 2.0).unwrap();
        let opened = store.open(File::Roadmap, true);
        assert_eq!(opened, Ok(()));
        let mut asked = 0;
        let road = roadmap(50);
        loop {
            while let Some(request) = store.poll(true) {
                asked += 1;
                assert!(asked < 10_000, "it asks for ever");
                let bad = match request {
                    FlashRequest::Erase { .. } => failing == 0,
                    FlashRequest::Program { .. } => failing == 1,
                    FlashRequest::Read { .. } => failing == 2,
                };
                let nothing = [0; READ];
                let len = if let FlashRequest::Read { len, .. } = request { len } else { 0 };
                store.handle(if bad { Err(Fault) } else { Ok(&nothing[..len]) });
            }
            match store.upload() {
                Some(UploadState::Taking) if store.take(0, &road[..200]) == Taken::Yes => store.close(),
                Some(UploadState::Ended(result)) => break assert!(result.is_err()),
                _ => break,
            }
        }
    }
}
