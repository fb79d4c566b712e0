//! Counts the instructions of companion's public calls on the ground: files, parameters, commands,
//! malformed frames.

use board_bench::calls::{Meter, flight};
use board_bench::cases;
use companion::config::DEFAULT_GROUND_STATION_IDS;
use companion::config::parameters::{self, Parameters};
use companion::link::commands;
use companion::link::frame::{self, Framer, Header, MAX_FRAME_LEN};
use companion::link::intent::{self, Intent};
use companion::link::roster::{self, RosterReport};
use companion::storage::mission_file::{
    self, MissionBlock, MissionGoal, MissionHeader, MissionVehicle, MissionView,
};
use companion::storage::store::{FlashFault, FlashRequest, MAX_READ_LEN, ReadFlash, Store};
use companion::swarm::fleet::{Fleet, FleetTimeouts, OwnReport, StartStatus, VehicleReception};
use companion::{Duration, Event, Instant, Link};
use firmware::boards::chosen::{LAYOUT, memory};
use firmware::capacity::BoardCompanion;
use firmware::capacity::{GATES, VEHICLES};
use heapless::Vec;
use planner_core::Point;
use planner_core::plan::VehicleTask;
use planner_core::roadmap::RoadmapView;
use planner_core::track::deconflict::Method;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const COMPANION_BYTES: usize = size_of::<BoardCompanion>();
/// Bytes that the shell passes to the companion at once.
const CHUNK_LEN: usize = 256;
/// Message ids.
const FILE_TRANSFER: u32 = 110;
const PARAM_REQUEST_LIST: u32 = 21;
const PARAM_SET: u32 = 23;
const COMMAND_LONG: u32 = 76;
/// Opcodes of MAVLink FTP requests, and its ACK.
const TERMINATE: u8 = 1;
const OPEN_READ: u8 = 4;
const CREATE: u8 = 6;
const WRITE: u8 = 7;
const CRC32: u8 = 14;
const BURST_READ: u8 = 15;
const ACK: u8 = 128;
/// Data bytes of an FTP packet.
const FTP_DATA_LEN: usize = 239;
/// System id and component id of the ground station.
const GROUND_STATION_IDS: (u8, u8) = (255, 190);

/// Makes all counted calls of companion on the ground, each part in a function that is not inlined:
/// a companion takes 36 kB of the stack, and three in one stack frame overran the statics below the
/// stack.
#[inline(never)]
pub fn measure_companion_calls(meter: &mut impl Meter) {
    measure_framing(meter);
    measure_mission_parsing(meter);
    measure_fleet_agreement(meter);
    measure_parameters(meter);
    measure_grounded_companion(meter);
}

/// Counts the calls of a companion on the ground, with its flash.
#[inline(never)]
fn measure_grounded_companion(meter: &mut impl Meter) {
    let flash = RamFlash(memory::take_spare_memory().expect("it is taken once"));
    GroundedCompanion {
        companion: BoardCompanion::new(flight::config()).expect("the settings are good"),
        flash,
        meter,
        now: Instant::ZERO + Duration::from_secs(11),
        sequence: 0,
        ftp_sequence: 0,
    }
    .run();
}

/// Counts the instructions of the framer on chunks of 256 bytes. Three of four chunks are full of
/// frame starts of which none makes a valid frame; the others are random bytes.
#[inline(never)]
fn measure_framing(meter: &mut impl Meter) {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut companion = BoardCompanion::new(flight::config()).expect("the settings are good");
    let mut framer = Framer::new();
    for round in 0..200_u64 {
        let mut chunk = [0; CHUNK_LEN];
        chunk.iter_mut().for_each(|byte| *byte = rng.next_u32() as u8);
        if !round.is_multiple_of(4) {
            for start in chunk.chunks_exact_mut(10) {
                start.copy_from_slice(&[0xFD, 245 + round as u8 % 11, 0, 0, 0, 1, 1, 0, 0, 0]);
            }
        }
        let now = Instant::ZERO + Duration::from_millis(round);
        let mut input = &chunk[..];
        meter.call("frame::Framer::next, 256 hostile bytes", size_of::<Framer>(), || {
            while framer.next(now, &mut input).is_some() {}
        });
        meter.call("Companion::handle_bytes, 256 hostile bytes", COMPANION_BYTES, || {
            companion.handle_bytes(Link::Swarm, now, &chunk);
        });
    }
    let points = (0..intent::MAX_POINTS).map(|_| cases::random_point(&mut rng, 50.0)).collect();
    let intent = Intent {
        system_id: 2,
        flags: intent::FLYING,
        mission_crc: 1,
        plan_crc: 2,
        progress_m: 3.0,
        gates_open_up_to_m: 9.0,
        heard_bits: 7,
        points,
        ..Intent::default()
    };
    let mut payload = [0; 133];
    let len = meter.call("intent::Intent::encode", 0, || intent.encode(&mut payload));
    let mut padded = [0; 255];
    padded[..len].copy_from_slice(&payload[..len]);
    meter.call("intent::Intent::decode", 0, || Intent::decode(&padded, 2)).expect("it is one");
    let mut out = [0; MAX_FRAME_LEN];
    let full = [0xA5; 255];
    let header = Header { system: 1, component: 191, sequence: 0 };
    meter.call("frame::encode_raw, 255 bytes", 0, || {
        frame::encode_raw(header, 0, 50, &full, &mut out)
    });
}

/// Counts the calls on a mission file with the most vehicles and goals.
#[inline(never)]
fn measure_mission_parsing(meter: &mut impl Meter) {
    let header = MissionHeader {
        roadmap_crc: 0,
        mode: cases::ASSIGNMENT_MODE,
        method: Method::Priority,
        origin: flight::ORIGIN,
        cruise_mps: 2.0,
        schedule: cases::SCHEDULE,
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: DEFAULT_GROUND_STATION_IDS,
    };
    let vehicle = |id: u8| MissionVehicle {
        task: VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.0, goal: Some(0) },
        path_start: Point::new(f32::from(id), 0.0, 1.0),
        radius_m: 0.3,
        speed_max_mps: 5.0,
    };
    let vehicles: Vec<_, VEHICLES> = (1..=VEHICLES as u8).map(vehicle).collect();
    let goals = [MissionGoal { position: Point::new(1.0, 2.0, 3.0), descent_m: 1.0 }; VEHICLES];
    let mut file = [0; mission_file::encoded_len(VEHICLES, VEHICLES)];
    meter
        .call("mission_file::write_mission, 32", 0, || {
            mission_file::write_mission(&header, &vehicles, &MissionBlock::Goals(&goals), &mut file)
        })
        .expect("a good mission");
    let view = meter
        .call("mission_file::MissionView::parse, 32", size_of::<MissionView<'_>>(), || {
            MissionView::parse(&file)
        })
        .expect("a good mission");
    let config = meter
        .call("mission_file::MissionView::companion_config, 32", 0, || {
            view.companion_config::<VEHICLES>(VEHICLES as u8)
        })
        .expect("it is there");
    let (mut tasks, mut descents_m) = (Vec::<_, VEHICLES>::new(), Vec::<_, VEHICLES>::new());
    let _ = meter.call("mission_file::MissionView::plan_request, 32", 0, || {
        view.plan_request(&mut tasks, &mut descents_m, GATES)
    });
    let _ = meter.call("config::Config::check, 32", 0, || config.check());
    let roadmap = RoadmapView::parse(memory::bank2()).expect("a roadmap lies in bank 2");
    meter.call("mission_file::MissionView::can_be_planned_with", 0, || {
        view.can_be_planned_with(Some(&roadmap))
    });
}

/// Counts the instructions by which the largest fleet agrees on lost vehicles' work, while each
/// neighbour reports new progress in every round.
#[inline(never)]
fn measure_fleet_agreement(meter: &mut impl Meter) {
    let mut fleet =
        Fleet::<VEHICLES>::new(0, VEHICLES, FleetTimeouts::of_flight(Duration::from_secs(60)));
    let bytes = size_of_val(&fleet);
    let mut now = Instant::ZERO;
    fleet.begin_flight(now);
    for round in 0..120_u16 {
        now = now + Duration::from_secs(1);
        // Ten rounds each, one more vehicle of the last ranks is silent; the others commit to a
        // stop and hold.
        let hearing = |rank: usize| {
            let speaks = rank < VEHICLES - usize::from(round / 10);
            VehicleReception {
                heard_at: speaks.then_some(now),
                hears_us: speaks,
                heard_by_others: speaks,
                heard_bits: u32::MAX >> (round / 10),
            }
        };
        let promise_dm = Some(100 + round);
        let own = OwnReport {
            progress_dm: 10 * round,
            new_commitment_dm: promise_dm,
            holds: true,
            ..OwnReport::default()
        };
        meter.call("fleet::Fleet::step, 32", bytes, || fleet.step(now, &own, hearing));
        if meter.call("fleet::Fleet::is_division_to_be_computed", bytes, || {
            fleet.is_division_to_be_computed()
        }) {
            meter.call("fleet::Fleet::set_hash_from_plan", bytes, || fleet.set_hash_from_plan(7));
        }
        meter.call("fleet::Fleet::division_inputs_hash", bytes, || fleet.division_inputs_hash());
        for first in [0, roster::MAX_ENTRIES_PER_MESSAGE] {
            let mut reported =
                meter.call("fleet::Fleet::roster_report", bytes, || fleet.roster_report(first));
            let mut payload = [0; roster::MAX_LEN];
            meter.call("roster::RosterReport::encode", 0, || reported.encode(&mut payload));
            let mut padded = [0; 255];
            padded[..roster::MAX_LEN].copy_from_slice(&payload);
            let read = meter.call("roster::RosterReport::decode", 0, || {
                RosterReport::decode(&padded, reported.system_id)
            });
            assert!(read.is_some_and(|read| read == reported));
            for entry in &mut reported.entries {
                (entry.progress_dm, entry.commitment_dm, entry.holds) =
                    (10 * round + 5, promise_dm, true);
            }
            let sender = 1 + usize::from(round) % (VEHICLES / 2);
            meter.call("fleet::Fleet::handle_roster_report, 32", bytes, || {
                fleet.handle_roster_report(sender, &reported, StartStatus::Started)
            });
        }
    }
}

/// Measures requests for parameters.
#[inline(never)]
fn measure_parameters(meter: &mut impl Meter) {
    let mut values = Parameters::default();
    let mut config = flight::config();
    for (index, parameter) in parameters::TABLE.iter().enumerate() {
        let _ = meter.call("parameters::Parameters::set", 0, || values.set(index, parameter.max));
        meter.call("parameters::Parameters::index_of", 0, || {
            Parameters::index_of(parameter.name.as_bytes())
        });
    }
    meter.call("parameters::Parameters::apply", 0, || values.apply(&mut config));
    let bytes = meter.call("parameters::Parameters::to_bytes", 0, || values.to_bytes());
    let (entries, _) = bytes.as_chunks();
    entries.iter().for_each(|entry| {
        meter.call("parameters::Parameters::restore", 0, || values.restore(entry))
    });
}

/// A flash in memory whose operations take no time.
struct RamFlash(&'static mut [u8]);

impl ReadFlash for RamFlash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let at = at as usize;
        out.copy_from_slice(self.0.get(at..at + out.len()).ok_or(FlashFault)?);
        Ok(())
    }
}

/// A companion on the ground, its flash, and a scripted ground station.
struct GroundedCompanion<'a, M> {
    companion: BoardCompanion,
    flash: RamFlash,
    meter: &'a mut M,
    now: Instant,
    /// Sequence number of the next frame.
    sequence: u8,
    /// FTP sequence number of the next request.
    ftp_sequence: u16,
}

impl<M: Meter> GroundedCompanion<'_, M> {
    /// Uploads a roadmap, reads it back, sets all parameters, sends commands, and mounts the flash
    /// again.
    fn run(mut self) {
        self.mount();
        let roadmap = RoadmapView::parse(memory::bank2()).expect("a roadmap lies in bank 2");
        let file = &memory::bank2()[..roadmap.byte_len()];
        self.request_ftp(CREATE, 0, b"roadmap.bin");
        for (i, piece) in file.chunks(FTP_DATA_LEN).enumerate() {
            self.request_ftp(WRITE, (i * FTP_DATA_LEN) as u32, piece);
        }
        self.request_ftp(TERMINATE, 0, &[]);
        self.request_ftp(CRC32, 0, b"roadmap.bin");
        self.request_ftp(OPEN_READ, 0, b"roadmap.bin");
        self.request_ftp(BURST_READ, 0, &[]);
        for parameter in parameters::TABLE {
            let mut set = [0; 23];
            set[..4].copy_from_slice(&parameter.max.to_le_bytes());
            (set[4], set[5], set[22]) = (1, companion::COMPANION_COMPONENT, 9);
            set[6..6 + parameter.name.len()].copy_from_slice(parameter.name.as_bytes());
            self.feed_frame(PARAM_SET, &set);
        }
        self.feed_frame(PARAM_REQUEST_LIST, &[1, companion::COMPANION_COMPONENT]);
        for command in [
            commands::MISSION_START,
            commands::PAUSE_CONTINUE,
            commands::REQUEST_MESSAGE,
            commands::LAND,
        ] {
            let mut order = [0; 33];
            order[28..30].copy_from_slice(&command.to_le_bytes());
            (order[30], order[31]) = (1, companion::COMPANION_COMPONENT);
            self.feed_frame(COMMAND_LONG, &order);
        }
        let store = self.mount();
        assert!(store, "what was uploaded is there");
    }

    /// Mounts the flash as a start does. Returns whether it holds a roadmap.
    fn mount(&mut self) -> bool {
        let flash = &mut self.flash;
        let store = self
            .meter
            .call("store::Store::mount", size_of::<Store>(), || Store::mount(LAYOUT, flash));
        let found = store.map_range().is_some();
        let companion = &mut self.companion;
        self.meter
            .call("Companion::attach_store", COMPANION_BYTES, || companion.attach_store(store));
        self.drain_outputs();
        found
    }

    /// Sends an FTP request, and repeats it until it is acknowledged.
    fn request_ftp(&mut self, opcode: u8, offset: u32, data: &[u8]) {
        self.ftp_sequence = self.ftp_sequence.wrapping_add(1);
        let mut payload = [0; 254];
        (payload[1], payload[2]) = (1, companion::COMPANION_COMPONENT);
        payload[3..5].copy_from_slice(&self.ftp_sequence.to_le_bytes());
        (payload[6], payload[7]) = (opcode, data.len() as u8);
        payload[11..15].copy_from_slice(&offset.to_le_bytes());
        payload[15..15 + data.len()].copy_from_slice(data);
        for _ in 0..10 {
            if self.feed_frame(FILE_TRANSFER, &payload) {
                return;
            }
        }
        panic!("FTP request {opcode} is not answered");
    }

    /// Passes a frame to the companion. Returns whether the companion acknowledged an FTP request.
    fn feed_frame(&mut self, id: u32, payload: &[u8]) -> bool {
        self.now = self.now + Duration::from_millis(20);
        self.sequence = self.sequence.wrapping_add(1);
        let header = Header {
            system: GROUND_STATION_IDS.0,
            component: GROUND_STATION_IDS.1,
            sequence: self.sequence,
        };
        let mut bytes = [0; MAX_FRAME_LEN];
        let extra = frame::extra_crc(id).expect("a message of the dialect");
        let len = frame::encode_raw(header, id, extra, payload, &mut bytes);
        let (now, companion) = (self.now, &mut self.companion);
        self.meter.call("Companion::handle_bytes, a frame", COMPANION_BYTES, || {
            companion.handle_bytes(Link::Autopilot, now, &bytes[..len]);
        });
        self.drain_outputs()
    }

    /// Sends the companion's frames, takes its events and executes its flash requests until none
    /// are left. Returns whether an FTP request was acknowledged.
    fn drain_outputs(&mut self) -> bool {
        let Self { companion, flash, meter, now, .. } = self;
        let now = *now;
        let mut granted = false;
        meter.call(flight::OTHER_STEP_ROW, COMPANION_BYTES, || companion.handle_timeout(now));
        loop {
            let mut out = [0; MAX_FRAME_LEN];
            let mut len = 0;
            for link in [Link::Autopilot, Link::Swarm] {
                len = meter.call("Companion::poll_transmit", COMPANION_BYTES, || {
                    companion.poll_transmit(link, &mut out)
                });
                granted |= len > 16 && out[7..10] == [110, 0, 0] && out[16] == ACK;
            }
            let event: Option<Event> =
                meter.call("Companion::poll_event", COMPANION_BYTES, || companion.poll_event());
            let mut bytes = [0; MAX_READ_LEN];
            let request =
                meter.call("Companion::poll_flash", COMPANION_BYTES, || companion.poll_flash());
            let idle = request.is_none() && event.is_none() && len == 0;
            let outcome = match request {
                None if idle => return granted,
                None => continue,
                Some(FlashRequest::Erase { at }) => {
                    flash.0[at as usize..][..LAYOUT.sector_len as usize].fill(0xFF);
                    Ok(0)
                }
                Some(FlashRequest::Program { at, bytes }) => {
                    flash.0[at as usize..][..bytes.len()].copy_from_slice(bytes);
                    Ok(0)
                }
                Some(FlashRequest::Read { at, len }) => {
                    flash.read(at, &mut bytes[..len]).map(|()| len)
                }
            };
            let outcome = outcome.map(|len| &bytes[..len]);
            meter.call("Companion::handle_flash", COMPANION_BYTES, || {
                companion.handle_flash(now, outcome)
            });
        }
    }
}
