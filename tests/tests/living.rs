//! A companion copes with behaviour observed in real autopilots, here shown by the simulated ones:
//! docs/autopilots.md has the list. Both run in memory and exchange bytes, on flat ground.

use companion::link::frame::{self, Frame, Framer, Header};
use companion::{Companion, Config, Event, Instant, Link, State};
use planner_core::Point;
use planner_core::flight::{Path, Task, VehiclePlan};
use sim_autopilot::{Autopilot, Px4Mode, SimulatedKind, ardupilot};

const STEP_US: u64 = 4_000;
const START: Point = Point::new(0.0, 0.0, 2.0);
const GOAL: Point = Point::new(14.0, 0.0, 2.0);
const READY_S: f32 = 8.0;
const SET_MODE: u16 = 176;
const ARM: u16 = 400;
const HEARTBEAT: u32 = 0;
const SETPOINT: u32 = 84;

/// A companion and its autopilot, and all frames that the companion sent.
struct Pair {
    autopilot: Autopilot,
    companion: Companion<4, 16, 8>,
    now_us: u64,
    /// Whether the companion is stalled: bytes for it wait.
    stalled: bool,
    /// Bytes from the autopilot that the companion has not received yet.
    waiting: Vec<u8>,
    framer: Framer,
    /// Frames that the companion sent to the autopilot, each with its time, microseconds.
    said: Vec<(u64, Frame)>,
    /// States that the companion entered, each with its time, microseconds.
    states: Vec<(u64, State)>,
    sequence: u8,
}

impl Pair {
    fn new(autopilot: SimulatedKind) -> Self {
        let config = sim_autopilot::AutopilotConfig {
            autopilot,
            estimator_ready_s: READY_S,
            ..sim_autopilot::AutopilotConfig::default()
        };
        let mut autopilot = Autopilot::new(&config).unwrap();
        autopilot.set_land_on_offboard_loss();
        Self {
            autopilot,
            companion: Companion::new(Config::new(1, START, config.world_origin)).unwrap(),
            now_us: 0,
            stalled: false,
            waiting: Vec::new(),
            framer: Framer::new(),
            said: Vec::new(),
            states: Vec::new(),
            sequence: 0,
        }
    }

    /// A pair in flight, in the middle of its path.
    fn following(autopilot: SimulatedKind) -> Self {
        let mut pair = Self::new(autopilot);
        pair.until(State::Ready);
        pair.command(191, 300, [0.0; 2]);
        pair.until(State::Follow);
        pair.run(2.5);
        assert_eq!(pair.companion.state(), State::Follow);
        pair
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    fn step(&mut self) {
        self.now_us += STEP_US;
        self.autopilot.step(STEP_US as f32 * 1e-6, 0.0);
        let mut buffer = [0; 1024];
        loop {
            let length = self.autopilot.poll_transmit(&mut buffer);
            if length == 0 {
                break;
            }
            self.waiting.extend_from_slice(&buffer[..length]);
        }
        if self.stalled {
            return;
        }
        let bytes = core::mem::take(&mut self.waiting);
        self.companion.handle_bytes(Link::Autopilot, self.now(), &bytes);
        self.drain();
        if self.companion.poll_timeout().is_some_and(|due| due <= self.now()) {
            self.companion.handle_timeout(self.now());
        }
        self.drain();
    }

    fn drain(&mut self) {
        let mut buffer = [0; 512];
        for link in [Link::Autopilot, Link::Swarm] {
            loop {
                let length = self.companion.poll_transmit(link, &mut buffer);
                if length == 0 {
                    break;
                }
                if link == Link::Autopilot {
                    self.autopilot.handle_bytes(&buffer[..length]);
                    let mut input = &buffer[..length];
                    let frame = self.framer.next(Instant::from_micros(self.now_us), &mut input);
                    self.said.push((self.now_us, frame.expect("a whole frame")));
                }
            }
        }
        while let Some(event) = self.companion.poll_event() {
            match event {
                Event::RestartRequested
                | Event::WaitsForUnstartedVehicle { .. }
                | Event::DetourSkippedWaypoints { .. } => {}
                Event::PlanRequested(wanted) => {
                    self.companion.handle_plan(self.now(), wanted, Ok(&plan()));
                }
                Event::StateChanged { to, .. } => self.states.push((self.now_us, to)),
            }
        }
    }

    fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds * 250.0) as u32 {
            self.step();
        }
    }

    fn until(&mut self, state: State) {
        for _ in 0..250 * 120 {
            if self.companion.state() == state {
                return;
            }
            self.step();
        }
        panic!("not {state:?}: {:?}", self.states);
    }

    /// COMMAND_LONG of a ground station on the swarm link, or to the autopilot.
    fn command(&mut self, component: u8, command: u16, params: [f32; 2]) {
        let mut payload = [0; 33];
        for (k, param) in params.iter().enumerate() {
            payload[4 * k..4 * k + 4].copy_from_slice(&param.to_le_bytes());
        }
        payload[28..30].copy_from_slice(&command.to_le_bytes());
        payload[30..32].copy_from_slice(&[1, component]);
        self.ground(component, 76, &payload);
    }

    fn ground(&mut self, component: u8, id: u32, payload: &[u8]) {
        let header = Header { system: 255, component: 190, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut out = [0; frame::MAX_FRAME_LEN];
        let length =
            frame::encode_raw(header, id, frame::extra_crc(id).unwrap(), payload, &mut out);
        if component == 1 {
            self.autopilot.handle_bytes(&out[..length]);
        } else {
            self.companion.handle_bytes(Link::Swarm, self.now(), &out[..length]);
        }
    }

    /// First parameters of the COMMAND_LONGs with this command that the companion sent after
    /// `since_us`.
    fn asked(&self, since_us: u64, command: u16) -> Vec<f32> {
        let sent = self.said.iter().filter(|(at, f)| *at > since_us && f.message_id == 76);
        let fields = sent.map(|(_, f)| f.padded_payload());
        let wanted = fields.filter(|p| p[28..30] == command.to_le_bytes());
        wanted.map(|p| f32::from_le_bytes([p[0], p[1], p[2], p[3]])).collect()
    }

    fn count(&self, since_us: u64, id: u32) -> usize {
        self.said.iter().filter(|(at, f)| *at > since_us && f.message_id == id).count()
    }

    fn at(&self) -> Point {
        self.autopilot.true_state().position
    }

    fn entered(&self, state: State) -> u64 {
        self.states.iter().find(|entry| entry.1 == state).expect("it was entered").0
    }

    fn assert_at_goal(&self) {
        // ArduCopter drifts on for half a metre while it changes to LAND.
        assert!((self.at() - GOAL).xy().norm() < 0.8, "landed at {}", self.at());
    }
}

fn plan() -> VehiclePlan<16, 8> {
    let mut path = Path::new();
    path.push(START, 2.0).unwrap();
    path.push(GOAL, 2.0).unwrap();
    let gates = heapless::Vec::new();
    VehiclePlan {
        task: Task::Goto(0),
        path,
        climb_m: 1.7,
        descent_m: 1.7,
        depart_s: 0.0,
        gates,
        swarm_plan_crc: 5,
    }
}

#[test]
fn px4s_flood_with_messages_nobody_knows_is_lived_with() {
    let mut pair = Pair::following(SimulatedKind::Px4);
    pair.until(State::Done);
    pair.assert_at_goal();
    let counters = pair.companion.counters(Link::Autopilot);
    assert!(counters.unknown_id > 20, "GNSS_INTEGRITY every second: {counters:?}");
    assert_eq!((counters.bad_crc, counters.noise_bytes), (0, 0));
}

#[test]
fn px4s_failsafe_is_left_alone_to_the_ground() {
    let mut pair = Pair::following(SimulatedKind::Px4);
    pair.stalled = true;
    pair.run(2.5);
    assert!(pair.autopilot.in_failsafe());
    pair.stalled = false;
    let resumed_us = pair.now_us;
    pair.until(State::Failsafe);
    // One setpoint would bring PX4 back to Offboard by itself; the gimbal commands that PX4 sends
    // need no answer.
    pair.until(State::Aborted);
    assert!(!pair.autopilot.true_state().armed && pair.at().z < 0.31, "landed by its failsafe");
    assert_eq!((pair.count(resumed_us, SETPOINT), pair.count(resumed_us, 77)), (0, 0));
    assert!(pair.asked(resumed_us, SET_MODE).is_empty() && pair.asked(resumed_us, ARM).is_empty());
}

#[test]
fn px4_disarms_itself_after_landing_and_shows_offboard_again() {
    let mut pair = Pair::following(SimulatedKind::Px4);
    pair.until(State::Disarm);
    let since_us = pair.now_us;
    pair.until(State::Done);
    assert!(pair.asked(since_us, ARM).is_empty(), "it was given the time to");
    pair.run(10.0);
    assert_eq!(pair.autopilot.custom_mode(), Px4Mode::Offboard.custom_mode());
    assert_eq!(pair.companion.state(), State::Done);
    assert_eq!(pair.count(pair.entered(State::Done), SETPOINT), 0);
}

#[test]
fn a_hold_px4s_pilot_chose_stays_until_offboard_and_a_word() {
    let mut pair = Pair::following(SimulatedKind::Px4);
    pair.autopilot.set_pilot_mode(Px4Mode::Hold);
    pair.until(State::PilotControl);
    let since_us = pair.now_us;
    pair.run(5.0);
    assert_eq!(pair.companion.state(), State::PilotControl);
    assert!(
        pair.count(since_us, SETPOINT) > 40,
        "the place it is at, so that Offboard can be entered"
    );
    pair.autopilot.return_from_pilot();
    pair.run(5.0);
    assert_eq!(pair.companion.state(), State::PilotReturned, "Offboard without a resume");
    assert!(pair.asked(since_us, SET_MODE).is_empty());
    pair.command(191, 193, [1.0, 0.0]);
    pair.until(State::Done);
    pair.assert_at_goal();
}

#[test]
fn arducopters_estimator_is_waited_for_and_its_stray_parameters_passed_over() {
    let mut pair = Pair::new(SimulatedKind::Ardupilot);
    pair.run(READY_S - 1.0);
    assert_eq!(pair.companion.state(), State::WaitPosition);
    pair.run(30.0);
    assert_eq!(pair.companion.state(), State::Ready, "and nothing is armed without a word");
    assert!(pair.asked(0, SET_MODE).is_empty() && pair.asked(0, ARM).is_empty());
    pair.command(191, 300, [0.0; 2]);
    pair.until(State::Done);
    pair.assert_at_goal();
}

#[test]
fn arducopters_armed_bit_may_come_a_second_late() {
    // HEARTBEAT comes at 1 Hz: eight starts spread over its period.
    let mut latest_us = 0;
    for phase in 0..8 {
        let mut pair = Pair::new(SimulatedKind::Ardupilot);
        pair.until(State::Ready);
        pair.run(0.125 * phase as f32);
        pair.command(191, 300, [0.0; 2]);
        pair.until(State::Climb);
        latest_us = latest_us.max(pair.entered(State::TakeOff) - pair.entered(State::Arming));
        assert!(pair.asked(0, ARM).iter().all(|arm| *arm == 1.0), "no disarming in between");
        // A setpoint before it has lifted off would end the take-off.
        let taking_off = pair.entered(State::TakeOff)..pair.entered(State::Climb);
        let early =
            pair.said.iter().filter(|(at, f)| taking_off.contains(at) && f.message_id == SETPOINT);
        assert_eq!(early.count(), 0, "phase {phase}");
        pair.until(State::Done);
    }
    assert!(latest_us > 500_000, "{latest_us} us");
}

#[test]
fn a_stall_beside_arducopter_does_not_fly_the_last_velocity_on() {
    let mut pair = Pair::following(SimulatedKind::Ardupilot);
    pair.stalled = true;
    let before = pair.at();
    let mut farthest_m = 0.0_f32;
    for _ in 0..750 {
        pair.step();
        farthest_m = farthest_m.max((pair.at() - before).norm());
    }
    // With ArduCopter's own timeout of 3 s, the velocity of 2 m/s would have led more than 6 m
    // away.
    assert!(farthest_m < 3.0, "{farthest_m} m: GUID_TIMEOUT was set");
    pair.stalled = false;
    pair.until(State::Done);
    pair.assert_at_goal();
}

#[test]
fn a_stream_that_still_runs_when_arducopters_pilot_returns_holds_the_place() {
    let mut pair = Pair::following(SimulatedKind::Ardupilot);
    pair.autopilot.set_pilot_mode(ardupilot::CopterMode::Brake);
    pair.until(State::PilotControl);
    pair.run(3.0);
    let at = pair.at();
    pair.autopilot.return_from_pilot();
    pair.run(5.0);
    assert!((pair.at() - at).norm() < 0.2, "moved from {at} to {}", pair.at());
    assert_eq!(pair.companion.state(), State::PilotReturned);
    pair.command(191, 193, [1.0, 0.0]);
    pair.until(State::Done);
    pair.assert_at_goal();
}

#[test]
fn arducopters_ground_station_failsafe_ends_the_mission() {
    let mut pair = Pair::new(SimulatedKind::Ardupilot);
    pair.autopilot.set_parameter("FS_GCS_ENABLE", 1).unwrap();
    let beat = [0, 0, 0, 0, 6, 8, 0, 4, 3];
    pair.until(State::Ready);
    pair.command(191, 300, [0.0; 2]);
    pair.until(State::Follow);
    pair.ground(1, HEARTBEAT, &beat);
    // The ground station is silent from here; the companion's own heartbeats do not count.
    pair.until(State::Failsafe);
    let since_us = pair.now_us;
    pair.ground(1, HEARTBEAT, &beat);
    pair.until(State::Aborted);
    assert_eq!((pair.count(since_us, SETPOINT), pair.asked(since_us, SET_MODE).len()), (0, 0));
    assert!(!pair.autopilot.true_state().armed);
}

#[test]
fn an_autopilot_that_reboots_on_the_ground_is_asked_for_its_streams_again() {
    for autopilot in [SimulatedKind::Px4, SimulatedKind::Ardupilot] {
        let mut pair = Pair::new(autopilot);
        pair.until(State::Ready);
        pair.autopilot.reboot();
        pair.run(20.0);
        assert_eq!(pair.companion.state(), State::Ready, "{autopilot:?}");
        pair.command(191, 300, [0.0; 2]);
        pair.until(State::Done);
        pair.assert_at_goal();
    }
}
