//! An emulated board in flight, treated badly: reset at any moment, cables pulled, garbage on both
//! lines. The board runs the firmware as it is flashed, in lock step with a simulated autopilot, so
//! every run of a test is the same.
//!
//! `FLOCKMATE_FIRMWARE=… FLOCKMATE_RESETS=50 cargo test --workspace --test board_flights -- --nocapture`
//! resets fifty times, and `FLOCKMATE_GARBAGE=1000000` puts a megabyte on each line.

use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, scope};
use std::time::{Duration, Instant};

use companion::autopilot::AutopilotKind;
use companion::storage::store::File;
use companion::{Link as Port, State};
use flockmate_tests::board;
use flockmate_tests::board_failure::{self, BoardFailure};
use flockmate_tests::vehicle::{BoardMessages, Vehicle, prepare_mission, widest_late_leg_middle};
use host_sim::link::ByteLink;
use host_sim::mission::PreparedMission;
use host_sim::upload::FtpClient;
use mavlink::dialects::ardupilotmega::{COMMAND_INT_DATA, MavCmd, MavFrame};
use planner_core::Point;
use planner_core::geo::frames::{Geodetic, enu_to_geodetic};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use sim_autopilot::ardupilot;

/// One vehicle across the lobby of the built-in building.
const LOBBY: &str = r#"
[map]
file = "builtin:building"
[roadmap]
nodes = 400
edge_max_m = 12.0
[mission]
goals = [[28.0, 3.0, 3.5]]
[[vehicles]]
id = 1
start = [10.0, 3.0, 3.5]
"#;
/// Height of the start of its path, metres.
const CLIMBS_TO_M: f32 = 3.5;
/// Line that makes ArduCopter fly it.
const ARDUPILOT: &str = "personality = \"ardupilot\"\n";
/// Number of resets unless `FLOCKMATE_RESETS` sets another.
const RESETS: usize = 4;
/// Number of boards that run at once.
const BOARDS: usize = 4;
/// Time from the start command to the landing, milliseconds.
const FLIGHT_MS: u32 = 22_000;
/// Commands that make an autopilot fly: NAV_TAKEOFF, DO_SET_MODE, COMPONENT_ARM_DISARM.
const FLIES: [u32; 3] = [22, 176, 400];
/// Distance within which a vehicle that flies at 2 m/s stops, metres.
const STOPS_M: f32 = 4.0;
/// STATUSTEXTs of a companion about its autopilot.
const FOUND: &str = "Autopilot found";
const SILENT: &str = "Autopilot silent: start cancelled";
/// More time than a companion needs to find its autopilot and get its streams.
const FINDS: Duration = Duration::from_millis(4500);

/// The demo, whose first vehicle flies alone.
const DEMO: &str = include_str!("../../host-sim/scenarios/demo.toml");
/// Line with which each vehicle's table begins.
const VEHICLE: &str = "[[vehicles]]";
/// Garbage on each line unless `FLOCKMATE_GARBAGE` sets another amount, bytes.
const GARBAGE: usize = 200_000;
/// Garbage per millisecond, bytes, in addition to the autopilot's 4 kB/s.
const PER_MS: usize = 10;
/// Time by which a plan is slowed on purpose.
const BURST: Duration = Duration::from_millis(38);
/// Times for which setpoints are held up on purpose.
const HELD_UP: [Duration; 2] = [Duration::from_millis(83), Duration::from_millis(217)];
/// Period of setpoints, microseconds of the board's time, and how late a setpoint may be: as long
/// as other interrupts and calls of the companion hold it up.
const PERIOD_US: u64 = 50_000;
const LATE_US: u64 = 100;

/// Brings the companion down at a random moment of a flight, and checks the flight until its end.
/// Returns a line about it; `None` if the mission was over before.
fn reset_in_flight(
    vehicle: &mut Vehicle,
    how: BoardFailure,
    kind: AutopilotKind,
    rng: &mut Pcg32,
) -> Option<String> {
    vehicle.start_mission();
    vehicle.step_for(Duration::from_millis(u64::from(rng.next_u32() % FLIGHT_MS)));
    if is_over(vehicle) {
        return None;
    }
    let (state, place) = (vehicle.heard.state, vehicle.autopilot.true_state().position);
    // The autopilot flies a commanded take-off to its end.
    let top_m = place.z.max(CLIMBS_TO_M);
    vehicle.fail_board(how);
    // From here on only the autopilot flies the vehicle.
    let began = vehicle.autopilot.time_us();
    let mut highest_m = 0_f32;
    let mut farthest_m = 0_f32;
    let mut in_air = Duration::ZERO;
    vehicle.step_until("landed by itself, or hovering", |vehicle| {
        let truth = vehicle.autopilot.true_state();
        let (away, armed, flies): (Point, _, _) =
            (truth.position - place, truth.armed, vehicle.is_off_ground());
        (farthest_m, highest_m) =
            (farthest_m.max(away.xy().norm()), highest_m.max(truth.position.z - top_m));
        let passed = Duration::from_micros(vehicle.autopilot.time_us() - began);
        if flies {
            in_air = passed;
        }
        // ArduCopter brakes and hovers until its pilot lands it.
        let hovers = kind == AutopilotKind::ArduPilot && passed > 2 * FINDS && flies;
        !armed || hovers
    });
    if vehicle.autopilot.true_state().armed {
        vehicle.autopilot.set_pilot_mode(ardupilot::CopterMode::Land.number());
        vehicle.step_until("landed", |vehicle| !vehicle.autopilot.true_state().armed);
    }
    vehicle.step_until_said(FOUND);
    vehicle.step_for(FINDS);
    let heard = &vehicle.heard;
    let context = format!("{how:?} in {state:?} at {place:?}: {heard:?}");
    assert!(!vehicle.autopilot.true_state().armed, "{context}");
    assert!(heard.setpoints.is_empty(), "it sends setpoints, {context}");
    assert!(
        !heard.commands.iter().any(|(number, _)| FLIES.contains(number)),
        "it flies on, {context}"
    );
    assert!(
        farthest_m < STOPS_M && highest_m < 1.0,
        "{farthest_m} m away, {highest_m} m up, {context}"
    );
    let said = |text: &str| heard.texts.iter().any(|said| said == text);
    assert!(heard.texts.iter().any(|said| said.starts_with(how.restart_message())), "{context}");
    if in_air > FINDS {
        assert!(said("Found in flight: no mission"), "{context}");
        assert!(said("Landed after failsafe: mission over"), "{context}");
    }
    Some(format!(
        "{how:?} in {state:?}: {:.1} s in the air, {farthest_m:.1} m",
        in_air.as_secs_f32()
    ))
}

/// Brings a board down in `resets` flights. Returns a line about each.
fn reset_again_and_again(
    program: &Path,
    missions: [&PreparedMission; 2],
    resets: usize,
    seed: u64,
) -> Vec<String> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut lines = Vec::new();
    let mut flights = 0;
    while lines.len() < resets {
        let (kind, name, mission) = if (flights + seed).is_multiple_of(2) {
            (AutopilotKind::ArduPilot, "ArduCopter", missions[1])
        } else {
            (AutopilotKind::Px4, "PX4", missions[0])
        };
        let mut vehicle = Vehicle::new(program, mission, mission, rng.next_u64());
        // The autopilots alternate, so each meets every failure.
        let how = BoardFailure::ALL[(lines.len() / 2 + seed as usize) % BoardFailure::ALL.len()];
        let outcome = reset_in_flight(&mut vehicle, how, kind, &mut rng);
        lines.extend(outcome.map(|line| format!("seed {seed}, {name}: {line}")));
        flights += 1;
        assert!(flights < 10 + 4 * resets as u64, "most flights end before they are reset");
    }
    lines
}

#[test]
fn a_companion_reset_in_flight_leaves_it_to_the_autopilot_and_says_so() {
    let Some(program) = board::built_program("flockmate") else { return };
    let resets = std::env::var("FLOCKMATE_RESETS").map_or(RESETS, |n| n.parse().expect("a number"));
    let missions = [prepare_mission(LOBBY), prepare_mission(&format!("{LOBBY}{ARDUPILOT}"))];
    let (began, mut lines) = (Instant::now(), Vec::new());
    scope(|scope| {
        let of_board = |i: usize| {
            let (program, missions) = (&program, missions.each_ref());
            let share = resets * (i + 1) / BOARDS - resets * i / BOARDS;
            scope.spawn(move || reset_again_and_again(program, missions, share, i as u64 + 1))
        };
        let threads: Vec<_> = (0..BOARDS).map(of_board).collect();
        threads.into_iter().for_each(|thread| lines.extend(thread.join().expect("a board")));
    });
    lines.iter().for_each(|line| println!("{line}"));
    println!("{} resets in {:.0} s", lines.len(), began.elapsed().as_secs_f32());
    assert_eq!(lines.len(), resets);
}

/// Asserts that the mission was flown to its end.
fn done(vehicle: &Vehicle) {
    assert_eq!(vehicle.heard.state, State::Done, "{:?}", vehicle.heard.texts);
}

/// Whether the mission is over.
fn is_over(vehicle: &mut Vehicle) -> bool {
    matches!(vehicle.heard.state, State::Done | State::Aborted)
}

#[test]
fn cables_are_pulled_and_put_back_without_a_restart() {
    let Some(program) = board::built_program("flockmate") else { return };
    let mission = prepare_mission(LOBBY);
    let mut vehicle = Vehicle::new(&program, &mission, &mission, 1);
    vehicle.step_until("ready", |vehicle| vehicle.heard.state == State::Ready);
    // On the pad the companion reports that the autopilot is silent, and that it is back; then it
    // is ready again. The last report counts.
    let last = |vehicle: &Vehicle, text| vehicle.heard.texts.iter().rposition(|said| said == text);
    let heard = |vehicle: &Vehicle| last(vehicle, FOUND) > last(vehicle, SILENT);
    vehicle.pull_out(Port::Autopilot);
    vehicle.step_until(SILENT, |vehicle| !heard(vehicle));
    vehicle.plug_in(Port::Autopilot);
    vehicle.step_until(FOUND, |vehicle| heard(vehicle));
    vehicle.start_mission();
    vehicle.step_until("on its way", |vehicle| {
        vehicle.heard.state == State::Follow || is_over(vehicle)
    });
    vehicle.step_for(Duration::from_secs(1));
    // In flight: the autopilot's cable for less than its timeout, the radio's for any time.
    vehicle.pull_out(Port::Autopilot);
    vehicle.step_for(Duration::from_millis(500));
    vehicle.plug_in(Port::Autopilot);
    vehicle.step_for(Duration::from_secs(1));
    vehicle.pull_out(Port::Swarm);
    vehicle.step_for(Duration::from_secs(2));
    vehicle.plug_in(Port::Swarm);
    vehicle.step_until("over", is_over);
    let heard = &vehicle.heard;
    println!("{:?}", heard.texts);
    assert!(!heard.texts.iter().any(|text| text.starts_with("Restarted")), "{:?}", heard.texts);
    assert_eq!(heard.missing_frames, [0, 0], "frames were lost: {:?}", heard.texts);
    done(&vehicle);
}

#[test]
fn a_board_beside_an_autopilot_that_the_mission_does_not_name_says_so() {
    let Some(program) = board::built_program("flockmate") else { return };
    let [ours, others] =
        [prepare_mission(LOBBY), prepare_mission(&LOBBY.replace("id = 1", "id = 7"))];
    let mut vehicle = Vehicle::new(&program, &ours, &others, 1);
    vehicle.step_until_said("This system id is not in the mission: no plan");
}

/// STATUSTEXT about a mission that the board no longer plans.
const ASIDE: &str = "Mission set aside: it crashed 3 starts in a row";

#[test]
fn a_mission_that_brings_the_planner_down_in_three_starts_is_set_aside() {
    let Some(program) = board::built_program("flockmate") else { return };
    let mission = prepare_mission(LOBBY);
    let mut vehicle = Vehicle::new(&program, &mission, &mission, 1);
    for in_a_row in 1..=3 {
        vehicle.break_planner();
        vehicle.heard = BoardMessages::default();
        let crashed = |vehicle: &Vehicle| {
            vehicle.heard.texts.iter().any(|text| text.starts_with("Restarted: fault"))
        };
        vehicle.step_until("planning", |vehicle| crashed(vehicle));
        let texts = &vehicle.heard.texts;
        let aside = texts.iter().any(|text| text == ASIDE);
        assert!(in_a_row == 3 || !aside, "after {in_a_row} in a row: {texts:?}");
    }
    // From that start on the mission is not planned: the planner is broken again, but the board
    // stays up.
    vehicle.step_until_said(ASIDE);
    vehicle.step_for(FINDS);
    vehicle.break_planner();
    vehicle.heard = BoardMessages::default();
    vehicle.step_for(2 * FINDS);
    let heard = &vehicle.heard;
    assert!(!heard.texts.iter().any(|text| text.starts_with("Restarted")), "{heard:?}");
    assert_eq!(heard.state, State::Aborted, "there is no plan");
}

/// A client's end of a radio that the vehicle's thread serves. Client and vehicle take turns; time
/// passes between two turns of the client.
struct Radio {
    turns: Receiver<(Instant, Vec<u8>)>,
    sends: SyncSender<Vec<u8>>,
    now: Instant,
    heard: Vec<u8>,
    sent: Vec<u8>,
}

impl ByteLink for Radio {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = self.heard.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.heard[..length]);
        self.heard.drain(..length);
        Ok(length)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.sent.extend(bytes);
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        None
    }

    fn now(&self) -> Instant {
        self.now
    }

    /// Ends the client's turn: passes on what it sent, and waits until the vehicle's thread gives
    /// the next turn, with its time and the bytes received.
    fn wait_briefly(&mut self) {
        // The vehicle's thread has ended once the vehicle has landed.
        let _ = self.sends.send(core::mem::take(&mut self.sent));
        if let Ok((now, heard)) = self.turns.recv() {
            (self.now, self.heard) = (now, heard);
        }
    }
}

#[test]
fn setpoints_flow_through_planning_uploading_and_garbage() {
    let Some(program) = board::built_program("flockmate") else { return };
    let length =
        std::env::var("FLOCKMATE_GARBAGE").map_or(GARBAGE, |n| n.parse().expect("a number"));
    let (mut vehicle, place) = demo_on_its_way(&program);
    // An upload by radio of another roadmap than the one in use.
    let ((turn, turns), (sends, sent)) = (sync_channel(1), sync_channel(1));
    let other = prepare_mission(LOBBY).roadmap_or_field_file;
    let began = Instant::now();
    let upload = thread::spawn(move || {
        let radio = Radio { turns, sends, now: began, heard: Vec::new(), sent: Vec::new() };
        let mut client = FtpClient::new(Box::new(radio), Some(1));
        client.wait_for_companion().and_then(|_| client.upload(File::Roadmap, &other, |_| ()))
    });
    block(&mut vehicle, &place);
    let mut rng = Pcg32::seed_from_u64(1);
    let (mut left, mut steps, mut uploads) = (length, 0, true);
    vehicle.step_until("done with garbage and upload", |vehicle| {
        steps += 1;
        let handful = (4 * PER_MS).min(left);
        for port in [Port::Autopilot, Port::Swarm] {
            let mut garbage = [0; 4 * PER_MS];
            rng.fill_bytes(&mut garbage);
            vehicle.send(port, &garbage[..handful]);
        }
        left -= handful;
        let heard = core::mem::take(&mut vehicle.radio_bytes);
        if uploads {
            // The client may end in its turn.
            match sent.recv() {
                Ok(bytes) => vehicle.send(Port::Swarm, &bytes),
                Err(_) => uploads = false,
            }
            uploads &= turn.send((began + vehicle.time, heard)).is_ok();
        }
        let around = vehicle.heard.texts.iter().any(|text| text == "Flying around");
        if around && left > 0 && vehicle.heard.state == State::Follow && steps % 250 == 0 {
            // The vehicle is paused, so that it does not land before all garbage has arrived.
            vehicle.send_command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0);
        } else if left == 0 && vehicle.heard.state == State::Paused && steps % 250 == 0 {
            vehicle.send_command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0);
        }
        !uploads && is_over(vehicle)
    });
    let stack = vehicle.board.max_stack_used().expect("a board");
    let (count, gap_ms) = reported(&mut vehicle);
    let heard = &vehicle.heard;
    println!("{:?}", heard.texts);
    println!(
        "{length} bytes of garbage on each line: {count} setpoints reported, {} heard, at most {gap_ms} ms apart; {} µs late at \
         most; {stack} bytes of stack",
        heard.setpoints.len(),
        late_us(heard)
    );
    assert_eq!(count, heard.setpoints.len(), "setpoints were lost");
    assert_eq!(heard.missing_frames, [0, 0], "frames were lost");
    done(&vehicle);
    assert_eq!(left, 0, "over before the end of the garbage: {:?}", heard.texts);
    upload.join().expect("a client").expect("the upload arrives");
    assert!(heard.texts.iter().any(|text| text == "Flying around"));
    assert!(late_us(heard) <= LATE_US && gap_ms <= 51, "setpoints were {gap_ms} ms apart");
    assert!(stack <= 64 << 10, "{stack} bytes of stack");
}

/// The demo's first vehicle alone, in flight on its path, and a place ahead of it.
fn demo_on_its_way(program: &Path) -> (Vehicle, Geodetic) {
    let demo = DEMO.match_indices(VEHICLE).nth(1).map_or(DEMO, |(second, _)| &DEMO[..second]);
    let mut demo = prepare_mission(demo);
    let plan = demo.plan().expect("the demo has a plan");
    let place =
        enu_to_geodetic(&demo.scenario.map.origin, &widest_late_leg_middle(&plan.flights[0].path));
    let mut vehicle = Vehicle::new(program, &demo, &demo, 1);
    vehicle.start_mission();
    vehicle.step_until("on its way", |vehicle| vehicle.heard.state == State::Follow);
    (vehicle, place)
}

/// Reports an obstacle on the path, so that a detour is planned in flight.
fn block(vehicle: &mut Vehicle, place: &Geodetic) {
    vehicle.send_message(&COMMAND_INT_DATA {
        command: MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
        target_system: 1,
        frame: MavFrame::MAV_FRAME_GLOBAL,
        param1: 0.4,
        x: (place.lat_deg * 1e7).round() as i32,
        y: (place.lon_deg * 1e7).round() as i32,
        z: place.alt_m as f32,
        ..COMMAND_INT_DATA::DEFAULT
    });
}

/// Number of setpoints that a board reports, and the longest time between two, milliseconds.
fn reported(vehicle: &mut Vehicle) -> (usize, u64) {
    vehicle.step_until_said("Setpoints: ");
    let mut texts = vehicle.heard.texts.iter();
    let said = texts.find_map(|text| text.strip_prefix("Setpoints: ")?.strip_suffix(" ms apart"));
    let (count, gap) = said.and_then(|said| said.split_once(", at most ")).expect("two numbers");
    (count.parse().expect("a number"), gap.parse().expect("a number"))
}

/// How late a setpoint was at most, microseconds of the board's time. A setpoint due to a change of
/// state comes early.
fn late_us(heard: &BoardMessages) -> u64 {
    let gaps = heard.setpoints_us.windows(2).map(|pair| pair[1] - pair[0]);
    gaps.max().expect("many").saturating_sub(PERIOD_US)
}

#[test]
fn a_plan_of_38_ms_in_the_air_moves_no_setpoint() {
    let Some(program) = board::built_program("flockmate") else { return };
    let fly = |blocks: bool, burst: Duration| {
        let (mut vehicle, place) = demo_on_its_way(&program);
        if blocks {
            vehicle.slow_planner(burst);
            block(&mut vehicle, &place);
            vehicle.step_until_said("Flying around");
        }
        let planned = vehicle.time;
        vehicle.step_until("over", is_over);
        done(&vehicle);
        (late_us(&vehicle.heard), planned)
    };
    let (quiet_us, _) = fly(false, Duration::ZERO);
    let (plain_us, planned) = fly(true, Duration::from_nanos(4));
    let (burst_us, planned_late) = fly(true, BURST);
    println!(
        "setpoints are late by {quiet_us} µs at most, by {plain_us} µs beside a plan, by {burst_us} µs beside one that takes \
         38 ms longer and comes {:?} later",
        planned_late - planned
    );
    assert!(planned_late - planned > BURST / 2, "the planner was not slowed");
    assert!(quiet_us.max(plain_us).max(burst_us) <= LATE_US);
}

#[test]
fn a_setpoint_that_is_held_up_is_reported_with_its_gap() {
    let Some(program) = board::built_program("flockmate") else { return };
    for held_up in HELD_UP {
        let (mut vehicle, _) = demo_on_its_way(&program);
        board_failure::block_tasks(&mut vehicle.board, held_up);
        vehicle.step_until("over", is_over);
        let (_, gap_ms) = reported(&mut vehicle);
        // The board counts whole milliseconds.
        let times = vehicle.heard.setpoints_us.iter().map(|us| us / 1000).collect::<Vec<_>>();
        let longest_ms = times.windows(2).map(|pair| pair[1] - pair[0]).max().expect("many");
        println!("held up for {held_up:?}: {gap_ms} ms reported, {longest_ms} ms seen");
        assert_eq!(gap_ms, longest_ms);
        assert!(gap_ms >= held_up.as_millis() as u64 && gap_ms < held_up.as_millis() as u64 + 52);
    }
}
