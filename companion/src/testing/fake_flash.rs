//! A simulated flash whose words of 32 bytes tear when the power is lost, and may be unreadable
//! afterwards; and sample files to be stored in it.

extern crate std;
use std::collections::HashSet;
use std::ops::Range;
use std::vec;
use std::vec::Vec;

use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::plan::{GoalMode, VehicleTask};
use planner_core::roadmap::{self, Edge, LANDMARK_COUNT, RoadmapHeader};
use planner_core::schedule::ScheduleConfig;
use planner_core::track::deconflict::Method;
use rand_core::Rng;
use rand_pcg::Pcg32;

use crate::storage::mission_file::{self, MissionBlock, MissionHeader, MissionVehicle};
use crate::storage::store::{
    ErasePermission, FlashFault, FlashLayout, FlashRequest, MAX_PROGRAM_LEN, MAX_READ_LEN,
    ReadFlash, Store, WORD_LEN,
};

/// Layout as the H743's storage bank, but smaller, so that many power losses can be simulated
/// quickly.
pub const LAYOUT: FlashLayout = FlashLayout {
    sector_len: 8 << 10,
    slot_len: 24 << 10,
    journal_half_len: 8 << 10,
    stalls_processor: false,
};
pub const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };

/// The power was lost during a request.
#[derive(Debug)]
pub struct PowerLoss;

/// A storage bank in memory whose power can be lost.
pub struct Flash {
    /// Content of the bank.
    pub bytes: Vec<u8>,
    /// Indices of the words that are unreadable.
    pub torn: HashSet<u32>,
    pub rng: Pcg32,
    /// Number of words programmed and sectors erased until the power is lost; `None`: it is not
    /// lost.
    pub power: Option<u32>,
    /// Number of words programmed and sectors erased so far.
    pub programmed: u32,
}

impl Flash {
    /// A flash as delivered: with random bytes, and some unreadable words.
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg32::new(seed, 7);
        let bytes = (0..LAYOUT.len()).map(|_| rng.next_u32() as u8).collect();
        let torn = (0..50).map(|_| rng.next_u32() % (LAYOUT.len() / WORD_LEN as u32)).collect();
        Self { bytes, torn, rng, power: None, programmed: 0 }
    }

    /// Counts a word that is programmed, or a sector that is erased. Returns whether the power is
    /// lost then.
    pub fn loses_power(&mut self) -> bool {
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

    /// Tears a word: it keeps its old bytes, has the new ones or a mixture, and may be unreadable.
    pub fn tear(&mut self, at: usize, wanted: &[u8]) {
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
            self.torn.insert((at / WORD_LEN) as u32);
        }
    }

    /// Erases the sector at this offset.
    pub fn erase(&mut self, at: u32) -> Result<(), PowerLoss> {
        assert_eq!(at % LAYOUT.sector_len, 0);
        let words = LAYOUT.sector_len as usize / WORD_LEN;
        let goes = self.loses_power();
        for i in 0..words {
            let at = at as usize + i * WORD_LEN;
            if goes && self.rng.next_u32().is_multiple_of(2) {
                self.tear(at, &[0xFF; WORD_LEN]);
            } else {
                self.bytes[at..at + WORD_LEN].fill(0xFF);
                self.torn.remove(&((at / WORD_LEN) as u32));
            }
        }
        if goes { Err(PowerLoss) } else { Ok(()) }
    }

    /// Programs whole words at this offset.
    pub fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), PowerLoss> {
        assert!(
            (at as usize).is_multiple_of(WORD_LEN)
                && bytes.len().is_multiple_of(WORD_LEN)
                && (1..=MAX_PROGRAM_LEN).contains(&bytes.len())
        );
        for (i, word) in bytes.chunks(WORD_LEN).enumerate() {
            let at = at as usize + i * WORD_LEN;
            let blank = self.bytes[at..at + WORD_LEN].iter().all(|b| *b == 0xFF);
            assert!(
                blank && !self.torn.contains(&((at / WORD_LEN) as u32)),
                "programmed twice at {at:#x}"
            );
            if self.loses_power() {
                self.tear(at, word);
                return Err(PowerLoss);
            }
            self.bytes[at..at + WORD_LEN].copy_from_slice(word);
        }
        Ok(())
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let (start, end) = (at as usize, at as usize + out.len());
        if (start / WORD_LEN..end.div_ceil(WORD_LEN)).any(|word| self.torn.contains(&(word as u32)))
        {
            return Err(FlashFault);
        }
        out.copy_from_slice(&self.bytes[start..end]);
        Ok(())
    }
}

/// Executes one request of the store; the bytes of a read are put into `read`.
pub fn execute(
    flash: &mut Flash,
    request: FlashRequest<'_>,
    erasing: ErasePermission,
    read: &mut [u8; MAX_READ_LEN],
) -> Result<Result<usize, FlashFault>, PowerLoss> {
    match request {
        FlashRequest::Erase { at } => {
            assert_eq!(erasing, ErasePermission::Allowed, "erased while armed");
            flash.erase(at)?;
            Ok(Ok(0))
        }
        FlashRequest::Program { at, bytes } => {
            flash.program(at, bytes)?;
            Ok(Ok(0))
        }
        FlashRequest::Read { at, len } => {
            assert!(len <= MAX_READ_LEN && len > 0);
            Ok(flash.read(at, &mut read[..len]).map(|()| len))
        }
    }
}

/// Executes the store's requests until it has none.
pub fn run(
    store: &mut Store,
    flash: &mut Flash,
    erasing: ErasePermission,
) -> Result<(), PowerLoss> {
    let mut read = [0; MAX_READ_LEN];
    for _ in 0..100_000 {
        let Some(request) = store.poll_request(erasing) else { return Ok(()) };
        let outcome = execute(flash, request, erasing, &mut read)?;
        store.handle_flash_outcome(outcome.map(|len| &read[..len]));
    }
    panic!("it asks for ever");
}

/// A store mounted on this flash, after the work that a board does while idle: areas are erased
/// ahead of time.
pub fn started(flash: &mut Flash) -> Store {
    let mut store = Store::mount(LAYOUT, flash);
    run(&mut store, flash, ErasePermission::Allowed).expect("the power is on");
    store
}

/// A roadmap file with a chain of this many nodes.
pub fn roadmap(nodes: usize) -> Vec<u8> {
    let points: Vec<Point> =
        (0..nodes).map(|i| Point::new(i as f32, (i % 7) as f32, 2.0)).collect();
    let edges: Vec<Edge> =
        (1..nodes).map(|i| Edge { a: i as u16 - 1, b: i as u16, clearance_m: 1.0 }).collect();
    let header = RoadmapHeader {
        origin: ORIGIN,
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        tested_clearance_m: 0.8,
        max_clearance_m: 6.0,
        start_count: 1,
        goal_count: 1,
    };
    let mut bytes = vec![0; roadmap::encoded_len(nodes, edges.len(), LANDMARK_COUNT).unwrap()];
    let mut workspace =
        std::boxed::Box::new(planner_core::roadmap::search::SearchWorkspace::<1024>::new());
    roadmap::write_with_landmarks(&header, &points, &edges, &[], &mut workspace, &mut bytes)
        .unwrap();
    bytes
}

/// A mission file with this many vehicles.
pub fn mission(vehicles: u8) -> Vec<u8> {
    let header = MissionHeader {
        roadmap_crc: 1,
        mode: GoalMode::Labelled,
        method: Method::Priority,
        origin: ORIGIN,
        cruise_mps: 2.0,
        schedule: ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.75,
            cruise_mps: 2.0,
            vertical_mps: 1.0,
        },
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: crate::config::DEFAULT_GROUND_STATION_IDS,
    };
    let task = |id| VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.0, goal: None };
    let start = Point::new(1.0, 2.0, 3.0);
    let roster: Vec<_> = (1..=vehicles)
        .map(|id| MissionVehicle {
            task: task(id),
            path_start: start,
            radius_m: 0.3,
            speed_max_mps: 5.0,
        })
        .collect();
    let mut bytes = vec![0; mission_file::encoded_len(roster.len(), 0)];
    mission_file::write_mission(&header, &roster, &MissionBlock::Goals(&[]), &mut bytes).unwrap();
    bytes
}

/// The bytes of this range of offsets.
pub fn bytes_at(flash: &Flash, extent: Option<Range<u32>>) -> Option<&[u8]> {
    extent.map(|extent| &flash.bytes[extent.start as usize..extent.end as usize])
}
