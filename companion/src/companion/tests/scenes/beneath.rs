//! Another vehicle comes down without guidance above one that holds its place: the one that holds
//! makes room, whatever it waits for, and continues its flight.

use std::collections::VecDeque;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, TUNNEL_DATA};
use planner_core::detour::DetourRequest;
use planner_core::flight::{Gate, Path, VehiclePlan};
use planner_core::geo::frames;
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::State::*;
use super::*;
use crate::link::frame::{self, Header, MAX_FRAME_LEN};
use crate::link::intent::{Intent, WAITING};
use crate::planner::coverage::OPEN_FIELD_CLEARANCE_M;

/// Height of the goal, that of [`GOAL`], metres.
const GOAL_Z_M: f32 = 3.5;
/// Number of random falls for each state of the vehicle below.
const FALLS: u64 = if cfg!(debug_assertions) { 10 } else { 40 };
/// Time after the fall within which the flight must be over, seconds.
const FLIGHT_OVER_BY_S: f32 = 500.0;

/// The vehicle that comes down, heard five times a second, late and with losses.
struct Faller {
    /// Its system id.
    id: u8,
    /// True position, ENU metres.
    place: Point,
    /// Flags of its intent before it comes down.
    flags: u8,
    /// Speed at which it comes down, m/s.
    falls_mps: f32,
    /// Share of its messages that are lost.
    loss: f32,
    /// Delay of its messages, seconds.
    delay_s: f32,
    /// Sequence number of its next frame.
    sequence: u8,
    /// Frames under way: time of arrival and bytes.
    under_way: VecDeque<(Instant, Vec<u8>)>,
    /// The last detour that the vehicle below requested; `None` before.
    asked: Option<DetourRequest>,
    /// Whether the vehicle below has a planner.
    answers: bool,
    rng: Pcg32,
}

impl Faller {
    fn real(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.rng.next_u32() >> 8) as f32 / 16_777_216.0
    }

    fn tick(&mut self, b: &mut Bench) {
        b.tick();
        self.place.z = (self.place.z - 0.05 * self.falls_mps).max(0.0);
        if (b.now.as_micros() / 50_000).is_multiple_of(4) {
            for bytes in self.reports(b.now) {
                let at = b.now + Duration::from_micros((self.delay_s * 1e6) as u64);
                if self.real(0.0, 1.0) >= self.loss {
                    self.under_way.push_back((at, bytes));
                }
            }
        }
        while self.under_way.front().is_some_and(|(at, _)| *at <= b.now) {
            let (_, bytes) = self.under_way.pop_front().expect("it is there");
            b.companion.handle_bytes(Link::Swarm, b.now, &bytes);
        }
        self.plan_away(b);
        b.drain();
        let planned = b.companion.mission.plan().is_some();
        let ground_m = b.companion.own_intent().ground_m;
        assert!(
            !planned || ground_m.abs() < 0.1,
            "ground at {ground_m} m in {:?}: {:?}",
            b.state(),
            b.texts
        );
    }

    /// The planner of the vehicle below. It answers a request for a path aside at once, with a path
    /// away from the falling vehicle; a request for a detour after a random time, in a coverage
    /// mission not at all.
    fn plan_away(&mut self, b: &mut Bench) {
        let over_area = b.companion.config.lost_vehicle_down_after_s.is_some();
        let answered = |request: &DetourRequest| request.land_aside || !over_area;
        let Some(request) = b.companion.detour_request(|_| {}).filter(answered) else {
            self.asked = None;
            return;
        };
        let asked =
            self.asked.filter(|asked| asked.land_aside == request.land_aside).unwrap_or(request);
        self.asked = Some(asked);
        if !self.answers
            || self.falls_mps <= 0.0
            || (!asked.land_aside && self.real(0.0, 60.0) > 1.0)
        {
            return;
        }
        let away = (asked.here - self.place).xy();
        let away = away * (3.0 / away.norm().max(0.1));
        let beside = Point::new(away.x, away.y, 0.0) * if asked.land_aside { 1.0 } else { 2.0 };
        let mut path = Path::new();
        path.push(asked.here, 1.2).unwrap();
        let end = asked.here + beside;
        let end_z_m = if asked.land_aside { end.z } else { GOAL_Z_M };
        path.push(Point::new(end.x, end.y, end_z_m), 1.2).unwrap();
        let plan = VehiclePlan { path, climb_m: 0.0, descent_m: asked.descent_m, ..plan() };
        b.companion.handle_plan(b.now, crate::PlanKind::Detour, Ok(&plan));
        self.asked = None;
    }

    /// The falling vehicle's intent and position.
    fn reports(&mut self, now: Instant) -> [Vec<u8>; 2] {
        let (falls, down) = (self.falls_mps > 0.0, self.place.z <= 0.0);
        let flags = match falls {
            true if down => GROUNDED | OUT_OF_PLAN,
            true => FLYING,
            false => self.flags,
        };
        let intent = Intent {
            system_id: self.id,
            flags,
            mission_crc: 0xC0FFEE,
            plan_crc: 5,
            heard_bits: u32::MAX,
            may_come_down: falls,
            gates_open_up_to_m: -1e6,
            ..Intent::default()
        };
        let place = frames::enu_to_geodetic(&ORIGIN, &self.place);
        let position = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: now.as_boot_ms(),
            lat: (place.lat_deg * 1e7) as i32,
            lon: (place.lon_deg * 1e7) as i32,
            alt: (place.alt_m * 1e3) as i32,
            vz: if falls && !down { (100.0 * self.falls_mps) as i16 } else { 0 },
            ..Default::default()
        };
        let (mut payload, mut out) = ([0; 133], [0; MAX_FRAME_LEN]);
        let mut head = || {
            self.sequence = self.sequence.wrapping_add(1);
            Header {
                system: self.id,
                component: crate::COMPANION_COMPONENT,
                sequence: self.sequence,
            }
        };
        let length = intent.encode(&mut payload);
        let (id, seed) = (TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC);
        let n = frame::encode_raw(head(), id, seed, &payload[..length], &mut out);
        let intent = out[..n].to_vec();
        let n = frame::encode(head(), &position, &mut out);
        [intent, out[..n].to_vec()]
    }

    fn until(&mut self, b: &mut Bench, seconds: f32, met: impl Fn(&Bench) -> bool) -> bool {
        for _ in 0..(seconds * 20.0) as u32 {
            if met(b) {
                return true;
            }
            self.tick(b);
        }
        met(b)
    }
}

/// A path that rises and then turns a corner.
fn path(last_m: f32, clearance_m: f32) -> Path<WAYPOINTS> {
    let mut path = Path::new();
    for (x, y, z) in [(8.0, 12.0, 1.5), (22.0, 12.0, GOAL_Z_M), (22.0, 12.0 + last_m, GOAL_Z_M)] {
        path.push(Point::new(x, y, z), clearance_m).unwrap();
    }
    path
}

/// What the vehicles of a mission do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MissionKind {
    /// Each flies to its goal.
    Goals,
    /// They photograph an area.
    Area,
}

/// A vehicle that has flown a few metres and holds its place in this state.
fn holding(state: State, mission: MissionKind, faller: &mut Faller) -> Bench {
    let mut config = two_vehicles();
    let mut wanted =
        VehiclePlan { path: path(faller.real(1.0, 6.0), 1.2), descent_m: GOAL_Z_M, ..plan() };
    let flown_m = faller.real(5.0, 9.0);
    if mission == MissionKind::Area {
        config.lost_vehicle_down_after_s = Some(60.0);
        let mut out = path(6.0, OPEN_FIELD_CLEARANCE_M);
        for point in [Point::new(8.0, 18.0, GOAL_Z_M), Point::new(8.0, 12.0, GOAL_Z_M), START] {
            out.push(point, OPEN_FIELD_CLEARANCE_M).unwrap();
        }
        wanted = VehiclePlan { path: out, ..field_plan() };
    }
    if state == Dividing {
        // With two vehicles in the roster this one may continue alone.
        faller.id = 77;
    } else {
        config
            .roster
            .push(RosterEntry { system_id: 78, path_start: Point::new(8.0, 28.0, 1.5) })
            .unwrap();
    }
    if state == Follow {
        wanted
            .gates
            .push(Gate { at_m: flown_m, wait_for_id: 77, open_from_progress_m: 6.0 })
            .unwrap();
    }
    let mut b = Bench::new(config);
    b.answer_plan = Some(Ok(wanted));
    (b.answer_detour, b.answer_division) = (None, false);
    if state != Dividing {
        b.neighbour = on_pad(ON_PLAN);
    }
    assert!(faller.until(&mut b, 6.0, |b| b.state() == Ready));
    b.start();
    assert!(faller.until(&mut b, 30.0, |b| b.state() == Follow), "{:?}", b.texts);
    let over_m = flown_m - 3.0;
    assert!(
        faller.until(&mut b, 30.0, |b| b.companion.guidance.reference_along_m() > over_m),
        "{:?}",
        b.texts
    );
    match state {
        Follow => {}
        Paused => pause(&mut b),
        Dividing => losses::leaves(&mut b),
        _ => b.neighbour = stands(Point::new(22.0, 12.0, 3.0), OUT_OF_PLAN),
    }
    assert!(faller.until(&mut b, 30.0, |b| b.state() == state), "{state:?} {:?}", b.texts);
    b
}

/// A falling vehicle, still far away.
fn faller(state: State, seed: u64) -> Faller {
    Faller {
        id: 78,
        place: Point::new(8.0, 80.0, 12.0),
        flags: FLYING | ON_PLAN | if state == Replanning { WAITING } else { 0 },
        falls_mps: 0.0,
        loss: 0.0,
        delay_s: 0.0,
        sequence: 0,
        under_way: VecDeque::new(),
        asked: None,
        answers: true,
        rng: Pcg32::new(seed, state as u64),
    }
}

/// Plays one fall. Returns the least distance between the two vehicles, metres, and whether the
/// flight ended; in a coverage mission, whether it ended in `Done`.
fn falls_over(state: State, mission: MissionKind, seed: u64) -> (f32, bool) {
    let over_area = mission == MissionKind::Area;
    let mut faller = faller(state, seed);
    let mut b = holding(state, mission, &mut faller);
    let wait_s = if state == Replanning { faller.real(0.0, 2.0) } else { faller.real(2.0, 6.0) };
    faller.until(&mut b, wait_s, |_| false);
    (faller.loss, faller.delay_s) = (faller.real(0.0, 0.3), faller.real(0.0, 0.8));
    // One fall in three begins almost right above: a path out may then first lead nearer to the
    // vertical through the falling vehicle.
    let off_most_m = if seed.is_multiple_of(3) { 0.1 } else { 1.2 };
    let (angle, off_m) = (faller.real(-3.2, 3.2), faller.real(0.0, off_most_m));
    let mut beside = Point::new(libm::cosf(angle), libm::sinf(angle), 0.0) * off_m;
    if state == Paused {
        // A paused vehicle evades along its own path only: here that leads out of the column at
        // once.
        beside.x = beside.x.abs();
    }
    faller.place = b.enu + beside + Point::new(0.0, 0.0, faller.real(10.0, 16.0));
    faller.flags &= !WAITING;
    let hovers_s = faller.real(0.5, 2.0);
    faller.until(&mut b, hovers_s, |_| false);
    faller.falls_mps = faller.real(0.7, 1.5);
    let mut least_m = f32::INFINITY;
    while faller.place.z > 0.0 {
        faller.tick(&mut b);
        if b.enu.z > 0.1 {
            least_m = least_m.min((b.enu - faller.place).norm());
        }
    }
    // What the vehicle waits for happens, but outside a coverage mission a detour is found in one
    // flight of two.
    let finds = over_area || seed.is_multiple_of(2);
    b.answer_detour = if finds { Some(Ok(())) } else { detours::NO_WAY };
    b.answer_division = true;
    match state {
        Follow => b.neighbour = Some((Point::new(8.0, 20.0, 0.0), FLYING | ON_PLAN, 7.0, 5)),
        Paused => resume(&mut b),
        _ => {}
    }
    let ended = faller.until(&mut b, FLIGHT_OVER_BY_S, |b| matches!(b.state(), Done | Aborted));
    // The bench's detours outside a coverage mission keep clear of nothing: one may lead into the
    // fallen vehicle, and is not flown to its end.
    let ended = ended || (finds && !over_area);
    if over_area && b.state() != Done {
        std::println!("{:?}", b.texts);
    }
    (least_m, ended && (!over_area || b.state() == Done))
}

/// In a third of the falls the falling vehicle begins within 0.1 m of the vertical through the one
/// that holds, in the others within 1.2 m: near the vertical, a path out may first lead nearer to
/// it.
#[test]
fn whoever_holds_its_place_makes_room_for_one_that_comes_down() {
    let safety_m = config().safety_distance_m;
    let to_goals = [Follow, Blocked, Replanning, Paused].map(|state| (state, MissionKind::Goals));
    let over_area = [Follow, Dividing].map(|state| (state, MissionKind::Area));
    for (state, mission) in to_goals.into_iter().chain(over_area) {
        let falls: Vec<_> =
            (0..FALLS).map(|seed| (seed, falls_over(state, mission, seed))).collect();
        let bad: Vec<_> =
            falls.iter().filter(|(_, (least_m, down))| *least_m < safety_m || !down).collect();
        assert!(bad.is_empty(), "{state:?}, {mission:?}, {} of {FALLS}: {bad:?}", bad.len());
    }
}

/// Once the fallen vehicle is on the ground, the place where this one left its path is free again:
/// it comes back there and leaves out no picture.
#[test]
fn whoever_made_room_over_an_area_comes_back_to_where_it_left_its_path() {
    let mut returns = 0;
    for seed in 0..FALLS {
        let mut faller = faller(Blocked, seed);
        let mut b = holding(Blocked, MissionKind::Area, &mut faller);
        let (east_m, north_m) = (faller.real(-0.8, 0.8), faller.real(-0.8, 0.8));
        faller.place = b.enu + Point::new(east_m, north_m, faller.real(10.0, 16.0));
        faller.until(&mut b, 1.0, |_| false);
        faller.falls_mps = faller.real(0.3, 1.5);
        // Else it evaded backwards along its path, and is not counted.
        let aside = faller.until(&mut b, 20.0, |b| b.companion.detours.is_beside_plan());
        (b.answer_detour, b.answer_division) = (Some(Ok(())), true);
        if !aside || !faller.until(&mut b, 120.0, |b| b.companion.detours.ends_on_plan_path()) {
            continue;
        }
        returns += 1;
        let back = b.companion.detours.rejoin_place().expect("it comes back");
        let left_at_m = b.companion.detours.left_at_m();
        assert!((back.along_m - left_at_m).abs() < 0.5, "{seed}: {back:?} {left_at_m}");
    }
    assert!(returns > FALLS / 8, "{returns}");
}

/// The vehicle is paused before its planner answers: the search for a path aside is forgotten, and
/// it still flies its part.
#[test]
fn whoever_is_interrupted_while_it_seeks_a_way_aside_flies_its_part() {
    let mut sought = 0;
    for seed in 0..FALLS {
        for state in [Follow, Dividing] {
            let mut faller = faller(state, seed);
            let mut b = holding(state, MissionKind::Area, &mut faller);
            let (east_m, north_m) = (faller.real(-0.8, 0.8), faller.real(-0.8, 0.8));
            faller.place = b.enu + Point::new(east_m, north_m, faller.real(10.0, 16.0));
            faller.until(&mut b, 1.0, |_| false);
            (faller.falls_mps, faller.answers) = (1.0, false);
            // Else it evades backwards along its path, and is not counted.
            if !faller.until(&mut b, 20.0, |b| b.state() == Replanning) {
                continue;
            }
            sought += 1;
            let wait_s = faller.real(0.0, 4.5);
            faller.until(&mut b, wait_s, |_| false);
            pause(&mut b);
            faller.until(&mut b, 30.0, |_| false);
            (faller.answers, b.answer_detour, b.answer_division) = (true, Some(Ok(())), true);
            if state == Follow {
                b.neighbour = Some((Point::new(8.0, 20.0, 0.0), FLYING | ON_PLAN, 7.0, 5));
            }
            resume(&mut b);
            faller.until(&mut b, 5.0, |_| false);
            assert!(!b.companion.detours.is_on_detour() || b.companion.detours.is_blocked());
            faller.until(&mut b, FLIGHT_OVER_BY_S, |b| matches!(b.state(), Done | Aborted));
            assert_eq!(b.state(), Done, "{seed} {state:?} {:?}", b.texts);
        }
    }
    assert!(sought > FALLS / 8, "{sought}");
}
