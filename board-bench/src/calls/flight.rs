//! Scripted flights of a companion among 32 neighbours, to count whole control steps.
//!
//! The script acts as a PX4 that moves to each setpoint, and as neighbours that send random
//! positions, intents and flags, or fall silent. In half of the flights (the hard ones) all
//! neighbours are off the plan, out of the plan, or silent for up to 90 s. All are near, except the
//! silent neighbours of some flights.

use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::link::intent::{self, Intent};
use companion::link::roster::{self, RosterReport, RosterReportEntry};
use companion::{Duration, Event, Instant, Link, PlanFailure};
use firmware::capacity::{BoardCompanion, GATES, VEHICLES, WAYPOINTS};
use heapless::Vec;
use planner_core::Point;
use planner_core::flight::{Task, VehiclePlan};
use planner_core::geo::frames::{self, swap_enu_ned};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

mod drawn;

pub use self::drawn::{
    CRUISE_MPS, ORIGIN, area_config, config, random_area_plan, random_path, random_plan,
};
use self::drawn::{MISSION_CRC, OWN_ID, PLAN_CRC};
use super::Meter;
use crate::cases::{random_below, random_between, random_point};

/// Row of the table in `docs/worst-case.md`: a control step while all neighbours are heard.
pub const STEP_ROW: &str = "Companion::handle_timeout, 32 speak";
/// Row of the table: a control step after most neighbours left the plan or fell silent.
pub const HARD_STEP_ROW: &str = "Companion::handle_timeout, most gone";
/// Row of the table: a control step while all neighbours are near, on the plan or off it, but few
/// are on the path, so that the safety filter compares all of them.
pub const NEAR_STEP_ROW: &str = "a control step, 32 near";
/// Row of the table: a control step of a coverage mission beside 32 neighbours, in flight or while
/// the work is divided.
pub const AREA_STEP_ROW: &str = "a control step, coverage, 32 near";
/// Row of the table: the safety filter alone, which is part of each control step.
pub const FILTER_ROW: &str = "Companion::query_filter_blocker, 32 near";
/// Row of the table: any other control step.
pub const OTHER_STEP_ROW: &str = "Companion::handle_timeout, else";
/// Least distance of the neighbours from this vehicle where none is to be on the path, metres.
const MIN_BESIDE_M: f32 = 4.0;
/// Least distance by which a silent neighbour is moved away in a flight of [`has_silent_far_away`],
/// metres.
const MIN_SILENT_AWAY_M: f32 = 70.0;
/// Greatest such distance, metres.
const MAX_SILENT_AWAY_M: f32 = 120.0;
/// Control steps counted in each flight.
const COUNTED_STEPS: usize = 200;
/// Most steps of 0.9 s before the counted ones, in which silent neighbours' last messages grow old.
/// After a longer step the companion would find its own position stale.
const MAX_AGEING_STEPS: usize = 100;
const STEP_TIME: Duration = Duration::from_millis(50);
const AGEING_STEP_TIME: Duration = Duration::from_millis(900);
/// Number of steps of 50 ms within which the vehicle must be on its path.
const MAX_TAKE_OFF_STEPS: usize = 400;
const HEARTBEAT: u32 = 0;
const SYS_STATUS: u32 = 1;
const ESTIMATOR_STATUS: u32 = 230;
const LOCAL_POSITION_NED: u32 = 32;
const GLOBAL_POSITION_INT: u32 = 33;
const GPS_GLOBAL_ORIGIN: u32 = 49;
const COMMAND_LONG: u32 = 76;
const SET_POSITION_TARGET_LOCAL_NED: u32 = 84;
const EXTENDED_SYS_STATE: u32 = 245;
const TUNNEL: u32 = 385;
const DO_SET_MODE: u16 = 176;
const MISSION_START: u16 = 300;
const ARM_DISARM: u16 = 400;
const REQUEST_MESSAGE: u16 = 512;
struct SimulatedNeighbour {
    enu_m: Point,
    flags: u8,
    progress_m: f32,
    silent: bool,
}

/// One scripted flight: companion, autopilot and neighbours.
pub struct BenchFlight<'a, M> {
    companion: &'a mut BoardCompanion,
    meter: &'a mut M,
    now: Instant,
    /// This vehicle's position, ENU.
    enu_m: Point,
    /// The last setpoint, ENU.
    target: Option<Point>,
    mode: u32,
    armed: bool,
    sequences: [u8; 256],
    others: Vec<SimulatedNeighbour, VEHICLES>,
    plan: &'a VehiclePlan<WAYPOINTS, GATES>,
}

/// Whether most neighbours of flight `seed` leave the plan or fall silent.
pub fn has_many_off_plan(seed: u64) -> bool {
    seed.is_multiple_of(2)
}

/// Whether the silent neighbours of flight `seed` are far away, at the edge of the range in which a
/// detour considers them.
fn has_silent_far_away(seed: u64) -> bool {
    seed % 8 == 2
}

/// Random vector from this vehicle to a neighbour. In half of the hard flights the vector is at
/// least 4 m long: no neighbour is on the path, so the filter checks the path to its end.
fn offset_to_neighbour(seed: u64, rng: &mut Pcg32, reach_m: f32) -> Point {
    let at = random_point(rng, reach_m);
    if seed.is_multiple_of(4) { at + at * (MIN_BESIDE_M / at.norm().max(0.1)) } else { at }
}

/// Flies flight `seed` and measures its control steps by `meter`; returns their number.
///
/// # Panics
/// The companion does not take off, so the script is wrong.
pub fn measure_flight<M: Meter>(
    seed: u64,
    plan: &VehiclePlan<WAYPOINTS, GATES>,
    companion: &mut BoardCompanion,
    meter: &mut M,
) -> usize {
    let mut rng = Pcg32::seed_from_u64(seed);
    let hard = has_many_off_plan(seed);
    let mut flight = BenchFlight::on_pad(plan, companion, meter);
    flight.take_off();
    for (i, other) in flight.others.iter_mut().enumerate() {
        let (flags, silent) = match seed % 4 {
            // All neighbours fly detours: each is compared with the whole path ahead.
            1 => (AIR | intent::ON_DETOUR, false),
            3 => MOSTLY_ON_PLAN[random_below(&mut rng, MOSTLY_ON_PLAN.len())],
            _ => OFF_PLAN_OR_SILENT[random_below(&mut rng, OFF_PLAN_OR_SILENT.len())],
        };
        // The first neighbour is always heard, so that this vehicle does not lose its swarm link.
        (other.flags, other.silent) = (flags, silent && i > 0);
        other.enu_m =
            flight.enu_m + offset_to_neighbour(seed, &mut rng, if hard { 6.0 } else { 20.0 });
        if other.silent && has_silent_far_away(seed) {
            other.enu_m += random_point(&mut rng, 1.0).try_normalize(1e-3).unwrap_or_default()
                * random_between(&mut rng, MIN_SILENT_AWAY_M, MAX_SILENT_AWAY_M);
        }
        other.progress_m = random_between(&mut rng, 0.0, 60.0);
    }
    flight.send_states_from(&mut rng, |_| true);
    if hard {
        for _ in 0..random_below(&mut rng, MAX_AGEING_STEPS) {
            flight.send_state_from(0, &mut rng);
            flight.tick(OTHER_STEP_ROW, AGEING_STEP_TIME);
        }
    }
    for step in 0..COUNTED_STEPS {
        if !flight.flies() {
            return step;
        }
        if step.is_multiple_of(8) {
            let here = flight.enu_m;
            for other in flight.others.iter_mut().filter(|other| !other.silent) {
                other.enu_m =
                    here + offset_to_neighbour(seed, &mut rng, if hard { 3.0 } else { 12.0 });
            }
            flight.send_states_from(&mut rng, |other| !other.silent);
        }
        let (now, companion) = (flight.now, &mut *flight.companion);
        flight
            .meter
            .call(FILTER_ROW, size_of::<BoardCompanion>(), || companion.query_filter_blocker(now));
        flight.tick(if hard { HARD_STEP_ROW } else { STEP_ROW }, STEP_TIME);
    }
    COUNTED_STEPS
}

/// Flies flight `seed` among neighbours that are near but rarely on the path, and measures the
/// safety filter alone by `meter`: at cruise speed, and stopped, when it checks further ahead.
///
/// # Panics
/// The companion does not take off, so the script is wrong.
pub fn measure_safety_filter<M: Meter>(
    seed: u64,
    plan: &VehiclePlan<WAYPOINTS, GATES>,
    companion: &mut BoardCompanion,
    meter: &mut M,
) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut flight = BenchFlight::on_pad(plan, companion, meter);
    flight.take_off();
    for round in 0..FILTER_ROUNDS {
        for i in 0..flight.others.len() {
            flight.others[i].enu_m = flight.enu_m + far_offset();
            flight.others[i].flags = NEAR_FLAGS[random_below(&mut rng, NEAR_FLAGS.len())];
        }
        if round % 2 == 1 {
            flight.others[0].enu_m = flight.enu_m;
        }
        flight.send_states_from(&mut rng, |_| true);
        for _ in 0..4 {
            flight.tick(OTHER_STEP_ROW, STEP_TIME);
        }
        let (nearest_m, furthest_m) =
            (random_between(&mut rng, 3.0, 12.0), random_between(&mut rng, 6.0, 24.0));
        for i in 0..flight.others.len() {
            let way = random_point(&mut rng, 1.0);
            let away_m = random_between(&mut rng, nearest_m, nearest_m.max(furthest_m) + 0.1);
            flight.others[i].enu_m = flight.enu_m + way * (away_m / way.norm().max(0.01));
        }
        flight.send_states_from(&mut rng, |_| true);
        let (now, companion) = (flight.now, &mut *flight.companion);
        flight
            .meter
            .call(FILTER_ROW, size_of::<BoardCompanion>(), || companion.query_filter_blocker(now));
        // A whole step beside these neighbours. Time passes, so that their next messages are newer.
        flight.tick(NEAR_STEP_ROW, STEP_TIME);
    }
}

/// Offset of a neighbour that is too far away to matter, metres.
fn far_offset() -> Point {
    Point::new(300.0, 0.0, 0.0)
}

/// Rounds of a flight in which the filter is measured.
const FILTER_ROUNDS: usize = 40;
const NEAR_FLAGS: [u8; 4] =
    [AIR, AIR | intent::ON_DETOUR, intent::FLYING, intent::FLYING | intent::OUT_OF_PLAN];
/// Flags of an intent: in the air and on the plan.
const AIR: u8 = intent::FLYING | intent::ON_PLAN;
/// Pairs of which each neighbour gets one at random: its intent's flags, and whether it falls
/// silent.
const MOSTLY_ON_PLAN: [(u8, bool); 4] = [
    (AIR, false),
    (intent::GROUNDED | intent::ON_PLAN | intent::WAITING, false),
    (AIR | intent::ON_DETOUR, false),
    (intent::GROUNDED | intent::LANDED | intent::ON_PLAN, false),
];
const OFF_PLAN_OR_SILENT: [(u8, bool); 4] = [
    (intent::FLYING, false),
    (intent::FLYING | intent::OUT_OF_PLAN, false),
    (AIR, true),
    (intent::FLYING, true),
];

impl<'a, M: Meter> BenchFlight<'a, M> {
    /// This vehicle on its pad; all neighbours far away, with a progress beyond every gate.
    fn on_pad(
        plan: &'a VehiclePlan<WAYPOINTS, GATES>,
        companion: &'a mut BoardCompanion,
        meter: &'a mut M,
    ) -> Self {
        let (enu_m, progress_m) = (far_offset(), 1e3);
        let far = || SimulatedNeighbour { enu_m, flags: AIR, progress_m, silent: false };
        Self {
            companion,
            meter,
            now: Instant::ZERO,
            enu_m: Point::new(0.0, 0.0, 9.0),
            target: None,
            mode: 0,
            armed: false,
            sequences: [0; 256],
            others: (0..VEHICLES).map(|_| far()).collect(),
            plan,
        }
    }

    fn flies(&self) -> bool {
        let state = self.companion.state();
        state.follows_path_or_is_blocked() || state == companion::State::Dividing
    }

    fn has_area(&self) -> bool {
        matches!(self.plan.task, Task::Photograph(_))
    }

    fn take_off(&mut self) {
        let mut rng = Pcg32::seed_from_u64(0);
        self.send_states_from(&mut rng, |_| true);
        for step in 0..MAX_TAKE_OFF_STEPS {
            if step.is_multiple_of(4) {
                // In a coverage mission the vehicle takes off only if a majority hears it.
                let count = if self.has_area() { self.others.len() } else { 1 };
                (0..count).for_each(|i| self.send_state_from(i, &mut rng));
            }
            if self.companion.state() == companion::State::Ready {
                let mut order = [0; 33];
                order[28..30].copy_from_slice(&MISSION_START.to_le_bytes());
                (order[30], order[31]) = (OWN_ID, companion::COMPANION_COMPONENT);
                self.feed_frame(Link::Swarm, (255, 190), COMMAND_LONG, &order);
            }
            self.tick(OTHER_STEP_ROW, STEP_TIME);
            if self.companion.state() == companion::State::Follow {
                return;
            }
        }
        panic!("it does not take off: {:?}", self.companion.state());
    }

    /// One step of `time`: first the companion's control step, recorded as `name`, then the
    /// autopilot's motion and telemetry.
    fn tick(&mut self, name: &'static str, time: Duration) {
        self.now = self.now + time;
        let name = if self.has_area() { AREA_STEP_ROW } else { name };
        let (now, companion) = (self.now, &mut *self.companion);
        self.meter.call(name, size_of::<BoardCompanion>(), || companion.handle_timeout(now));
        self.drain_outputs();
        if let Some(target) = self.target.filter(|_| self.armed) {
            let way = target - self.enu_m;
            let reach_m = CRUISE_MPS * 0.05;
            self.enu_m += way * (reach_m / way.norm().max(reach_m));
        }
        if time > STEP_TIME || self.now.as_micros().is_multiple_of(1_000_000) {
            let [a, b, c, d] = self.mode.to_le_bytes();
            let armed = if self.armed { 129 } else { 1 };
            self.feed_frame(
                Link::Autopilot,
                (OWN_ID, 1),
                HEARTBEAT,
                &[a, b, c, d, 2, 12, armed, 4, 3],
            );
            let landed = if self.enu_m.z > 9.05 { 2 } else { 1 };
            self.feed_frame(Link::Autopilot, (OWN_ID, 1), EXTENDED_SYS_STATE, &[0, landed]);
            let mut status = [0; 31];
            status[30] = 90;
            self.feed_frame(Link::Autopilot, (OWN_ID, 1), SYS_STATUS, &status);
            // All accuracies of the estimator are 0 m.
            self.feed_frame(Link::Autopilot, (OWN_ID, 1), ESTIMATOR_STATUS, &[0; 42]);
        }
        let ned = swap_enu_ned(&self.enu_m);
        let mut position = [0; 28];
        position[..4].copy_from_slice(&self.now.as_boot_ms().to_le_bytes());
        put_floats(&mut position[4..], &[ned.x, ned.y, ned.z]);
        self.feed_frame(Link::Autopilot, (OWN_ID, 1), LOCAL_POSITION_NED, &position);
    }

    /// Passes a frame with this payload to the companion, as received on `link` from `from`
    /// (system, component).
    fn feed_frame(&mut self, link: Link, from: (u8, u8), id: u32, payload: &[u8]) {
        let sequence = &mut self.sequences[usize::from(from.0)];
        *sequence = sequence.wrapping_add(1);
        let header = Header { system: from.0, component: from.1, sequence: *sequence };
        let mut bytes = [0; MAX_FRAME_LEN];
        let extra = frame::extra_crc(id).expect("a message of the dialect");
        let len = frame::encode_raw(header, id, extra, payload, &mut bytes);
        let (now, companion) = (self.now, &mut *self.companion);
        let bytes = &bytes[..len];
        self.meter.call("Companion::handle_bytes, a frame", size_of::<BoardCompanion>(), || {
            companion.handle_bytes(link, now, bytes);
        });
        self.drain_outputs();
    }

    fn send_states_from(&mut self, rng: &mut Pcg32, sends: impl Fn(&SimulatedNeighbour) -> bool) {
        for i in 0..self.others.len() {
            if sends(&self.others[i]) {
                self.send_state_from(i, rng);
            }
        }
    }

    /// Passes neighbour `i`'s intent and position to the companion.
    fn send_state_from(&mut self, i: usize, rng: &mut Pcg32) {
        let SimulatedNeighbour { enu_m, flags, progress_m, .. } = self.others[i];
        let system_id = 2 + i as u8;
        let points = (0..intent::MAX_POINTS).map(|_| enu_m + random_point(rng, 3.0)).collect();
        let intent = Intent {
            system_id,
            flags,
            mission_crc: MISSION_CRC,
            plan_crc: PLAN_CRC,
            progress_m,
            gates_open_up_to_m: -1e6,
            heard_bits: u32::MAX,
            points,
            ..Intent::default()
        };
        let mut payload = [0; 133];
        let len = intent.encode(&mut payload);
        self.feed_frame(
            Link::Swarm,
            (system_id, companion::COMPANION_COMPONENT),
            TUNNEL,
            &payload[..len],
        );
        if self.has_area() {
            self.send_roster_from(system_id);
        }
        let at = frames::enu_to_geodetic(&ORIGIN, &enu_m);
        let mut position = [0; 28];
        position[..4].copy_from_slice(&self.now.as_boot_ms().to_le_bytes());
        let whole = [(at.lat_deg * 1e7) as i32, (at.lon_deg * 1e7) as i32, (at.alt_m * 1e3) as i32];
        for (to, number) in position[4..].chunks_exact_mut(4).zip(whole) {
            to.copy_from_slice(&number.to_le_bytes());
        }
        for to in position[20..26].chunks_exact_mut(2) {
            to.copy_from_slice(&(random_between(rng, -200.0, 200.0) as i16).to_le_bytes());
        }
        self.feed_frame(
            Link::Swarm,
            (system_id, companion::COMPANION_COMPONENT),
            GLOBAL_POSITION_INT,
            &position,
        );
    }

    /// Passes a neighbour's roster message to the companion; it reports every vehicle as alive.
    fn send_roster_from(&mut self, system_id: u8) {
        for first in (0..VEHICLES).step_by(roster::MAX_ENTRIES_PER_MESSAGE) {
            let known = VEHICLES.min(first + roster::MAX_ENTRIES_PER_MESSAGE) - first;
            let entries = core::iter::repeat_n(RosterReportEntry::default(), known).collect();
            let mission_crc = MISSION_CRC;
            let roster = RosterReport {
                system_id,
                first_rank: first as u8,
                plan_crc8: PLAN_CRC as u8,
                mission_crc,
                entries,
                ..RosterReport::default()
            };
            let mut payload = [0; roster::MAX_LEN];
            let len = roster.encode(&mut payload);
            self.feed_frame(
                Link::Swarm,
                (system_id, companion::COMPANION_COMPONENT),
                TUNNEL,
                &payload[..len],
            );
        }
    }

    /// Takes the companion's frames and events: executes commands to the autopilot, answers plan
    /// requests with the plan. Requests for a detour are answered as unreachable.
    fn drain_outputs(&mut self) {
        for link in [Link::Autopilot, Link::Swarm] {
            loop {
                let mut out = [0; MAX_FRAME_LEN];
                let companion = &mut *self.companion;
                let len = self.meter.call(
                    "Companion::poll_transmit",
                    size_of::<BoardCompanion>(),
                    || companion.poll_transmit(link, &mut out),
                );
                if len == 0 {
                    break;
                }
                if link == Link::Autopilot {
                    self.execute_command(&out[..len]);
                }
            }
        }
        while let Some(event) = self.companion.poll_event() {
            let Event::PlanRequested(wanted) = event else { continue };
            let (now, companion) = (self.now, &mut *self.companion);
            let mut obstacles = 0_usize;
            let around =
                self.meter.call("Companion::detour_request", size_of::<BoardCompanion>(), || {
                    companion.detour_request(|_| obstacles += 1)
                });
            let answer =
                if around.is_some() { Err(PlanFailure::Unreachable) } else { Ok(self.plan) };
            self.meter.call("Companion::handle_plan", size_of::<BoardCompanion>(), || {
                companion.handle_plan(now, wanted, answer);
            });
        }
    }

    /// Executes a command that the companion sends to the autopilot.
    fn execute_command(&mut self, frame: &[u8]) {
        let mut p = [0; 255];
        let payload = &frame[10..frame.len() - 2];
        p[..payload.len()].copy_from_slice(payload);
        let real = |at: usize| f32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
        match u32::from_le_bytes([frame[7], frame[8], frame[9], 0]) {
            SET_POSITION_TARGET_LOCAL_NED => {
                self.target = Some(swap_enu_ned(&Point::new(real(4), real(8), real(12))));
            }
            COMMAND_LONG => match u16::from_le_bytes([p[28], p[29]]) {
                DO_SET_MODE => self.mode = (real(4) as u32) << 16 | (real(8) as u32) << 24,
                ARM_DISARM => self.armed = real(0) == 1.0,
                REQUEST_MESSAGE if real(0) == GPS_GLOBAL_ORIGIN as f32 => {
                    let mut origin = [0; 20];
                    let whole = [ORIGIN.lat_deg * 1e7, ORIGIN.lon_deg * 1e7, ORIGIN.alt_m * 1e3];
                    for (to, number) in origin.chunks_exact_mut(4).zip(whole) {
                        to.copy_from_slice(&(number as i32).to_le_bytes());
                    }
                    self.feed_frame(Link::Autopilot, (OWN_ID, 1), GPS_GLOBAL_ORIGIN, &origin);
                }
                _ => {}
            },
            _ => {}
        }
    }
}

fn put_floats(to: &mut [u8], numbers: &[f32]) {
    for (to, number) in to.chunks_exact_mut(4).zip(numbers) {
        to.copy_from_slice(&number.to_le_bytes());
    }
}

#[cfg(test)]
mod tests;
