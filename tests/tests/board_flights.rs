//! An emulated board in flight, treated badly: reset at any moment, cables pulled, garbage on both lines. The board is the firmware
//! as it is flashed, the autopilot beside it the simulated one, in real time.
//!
//! `FLOCKMATE_FIRMWARE=… FLOCKMATE_RESETS=50 cargo test --workspace --test board_flights -- --nocapture` resets fifty times.

use std::path::Path;
use std::thread::scope;
use std::time::{Duration, Instant as Clock};

use companion::{Link as Port, State};
use flockmate_tests::board::{self, Emulated};
use flockmate_tests::vehicle::{Vehicle, mission};
use host_sim::autopilot::ardupilot;
use host_sim::mission::Mission;
use planner_core::Point;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// One vehicle across the lobby of the built-in building.
const LOBBY: &str = r#"
[map]
file = "builtin:building"
[roadmap]
nodes = 400
edge_max_m = 12.0
[mission]
goals = [[28.0, 3.0, 1.8]]
[[vehicles]]
id = 1
start = [10.0, 3.0, 1.5]
"#;
/// The same flown by ArduCopter.
const ARDUPILOT: &str = "personality = \"ardupilot\"\n";
/// Resets of a run that does not say how many.
const RESETS: usize = 4;
/// Boards at once.
const BOARDS: usize = 4;
/// From the start command to the landing, milliseconds.
const FLIGHT_MS: u32 = 20_000;
/// Commands to an autopilot that would have it fly: NAV_TAKEOFF, DO_SET_MODE, COMPONENT_ARM_DISARM.
const FLIES: [u32; 3] = [22, 176, 400];
/// A vehicle that flies at 2 m/s stops within that way, metres.
const STOPS_M: f32 = 4.0;
/// Streams and the first heartbeats take a companion less.
const FINDS: Duration = Duration::from_secs(3);

/// Resets the companion at a random moment of a flight, and sees the flight to its end; what came of it.
fn reset_in_flight(vehicle: &mut Vehicle, brakes: bool, rng: &mut Pcg32) -> Option<String> {
    vehicle.start();
    vehicle.run(Duration::from_millis(u64::from(rng.next_u32() % FLIGHT_MS)));
    if vehicle.heard.state == State::Done {
        return None;
    }
    let (state, place) = (vehicle.heard.state, vehicle.autopilot.truth().position);
    vehicle.reset();
    // From here on nobody but the autopilot flies it.
    let began = vehicle.autopilot.time_us();
    let mut highest_m = 0_f32;
    let mut farthest_m = 0_f32;
    let mut in_air = Duration::ZERO;
    vehicle.until("landed by itself, or hovering", |vehicle| {
        let truth = vehicle.autopilot.truth();
        let (away, armed, flies): (Point, _, _) = (truth.position - place, truth.armed, vehicle.flies());
        (farthest_m, highest_m) = (farthest_m.max(away.xy().norm()), highest_m.max(away.z));
        let passed = Duration::from_micros(vehicle.autopilot.time_us() - began);
        if flies {
            in_air = passed;
        }
        !armed || brakes && passed > 3 * FINDS && flies
    });
    if vehicle.autopilot.truth().armed {
        // ArduCopter brakes and hovers until its pilot lands it.
        vehicle.autopilot.set_pilot_mode(ardupilot::Mode::Land.number());
        vehicle.until("landed", |vehicle| !vehicle.autopilot.truth().armed);
    }
    vehicle.run(FINDS);
    let heard = &vehicle.heard;
    let context = format!("reset in {state:?} at {place:?}: {heard:?}");
    assert!(!vehicle.autopilot.truth().armed, "{context}");
    assert!(heard.setpoints.is_empty(), "it sends setpoints, {context}");
    assert!(!heard.commands.iter().any(|(number, _)| FLIES.contains(number)), "it flies on, {context}");
    assert!(farthest_m < STOPS_M && highest_m < 1.0, "{farthest_m} m away, {highest_m} m up, {context}");
    let said = |text: &str| heard.texts.iter().any(|said| said == text);
    assert!(said("Restarted: reset or watchdog"), "{context}");
    if in_air > FINDS {
        assert!(said("Found in flight: no mission"), "{context}");
        assert!(said("Landed after failsafe: mission over"), "{context}");
    }
    assert!(said("Autopilot found"), "{context}");
    Some(format!("{state:?}: {:.1} s in the air, {farthest_m:.1} m", in_air.as_secs_f32()))
}

/// Resets one board in flight again and again.
fn reset_again_and_again(program: &Path, missions: [&Mission; 2], resets: usize, seed: u64) -> Vec<String> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut lines = Vec::new();
    let mut flights = 0;
    while lines.len() < resets {
        let brakes = (flights + seed) % 2 == 0;
        let mission = missions[usize::from(brakes)];
        let bank = board::bank(&mission.roadmap_file, &mission.mission_file);
        let board = Emulated::start(program, None, Some(&bank));
        let mut vehicle = Vehicle::new(board, mission, rng.next_u64());
        let outcome = reset_in_flight(&mut vehicle, brakes, &mut rng);
        lines.extend(
            outcome.map(|line| format!("seed {seed}, {}: {line}", if brakes { "ArduCopter" } else { "PX4" })),
        );
        flights += 1;
    }
    lines
}

#[test]
fn a_companion_reset_in_flight_leaves_it_to_the_autopilot_and_says_so() {
    let Some(program) = board::program("flockmate") else { return };
    let resets = std::env::var("FLOCKMATE_RESETS").map_or(RESETS, |n| n.parse().expect("a number"));
    let missions = [mission(LOBBY), mission(&format!("{LOBBY}{ARDUPILOT}"))];
    let (began, mut lines) = (Clock::now(), Vec::new());
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

#[test]
fn cables_are_pulled_and_put_back_without_a_restart() {
    let Some(program) = board::program("flockmate") else { return };
    let mission = mission(LOBBY);
    let bank = board::bank(&mission.roadmap_file, &mission.mission_file);
    let mut vehicle = Vehicle::new(Emulated::start(&program, None, Some(&bank)), &mission, 1);
    vehicle.until("ready", |vehicle| vehicle.heard.state == State::Ready);
    // On the pad: said when it is silent, said when it is back, and ready again.
    vehicle.plug(Port::Autopilot, false);
    vehicle.until_said("Autopilot silent: start cancelled");
    let texts = vehicle.heard.texts.len();
    vehicle.plug(Port::Autopilot, true);
    vehicle.until("found again", |vehicle| {
        vehicle.heard.texts[texts..].iter().any(|text| text == "Autopilot found")
    });
    vehicle.start();
    vehicle.until("on its way", |vehicle| vehicle.heard.state == State::Follow);
    vehicle.run(Duration::from_secs(1));
    // In flight: shorter than the autopilot's patience, and the radio for as long as one likes.
    vehicle.plug(Port::Autopilot, false);
    vehicle.run(Duration::from_millis(500));
    vehicle.plug(Port::Autopilot, true);
    vehicle.run(Duration::from_secs(1));
    vehicle.plug(Port::Swarm, false);
    vehicle.run(Duration::from_secs(2));
    vehicle.plug(Port::Swarm, true);
    vehicle.until("landed", |vehicle| vehicle.heard.state == State::Done);
    let heard = &vehicle.heard;
    println!("{:?}", heard.texts);
    assert!(!heard.texts.iter().any(|text| text.starts_with("Restarted")), "{heard:?}");
    assert_eq!(heard.missing, [0, 0], "{heard:?}");
}
