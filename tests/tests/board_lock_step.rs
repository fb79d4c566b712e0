//! Boards in lock step with the simulation: a flight repeats exactly, whatever else this machine
//! does. For other programs a board can run by the wall clock, with TCP ports.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{available_parallelism, scope};

use flockmate_tests::board;
use flockmate_tests::vehicle::prepare_mission;
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::swarm::{self, SwarmFlight};
use host_sim::upload::FtpClient;

/// Three vehicles in the lobby of the built-in building; two of them cross.
const THREE: &str = r#"
[map]
file = "builtin:building"
[roadmap]
nodes = 400
edge_max_m = 12.0
[mission]
goals = [[16.0, 6.0, 3.5], [16.0, 2.0, 3.5], [22.0, 4.0, 3.5]]
[[vehicles]]
id = 1
start = [10.0, 2.0, 3.5]
[[vehicles]]
id = 2
start = [10.0, 6.0, 3.5]
personality = "ardupilot"
[[vehicles]]
id = 3
start = [13.0, 4.0, 3.5]
"#;

/// A flight of three boards.
fn fly(mission: &mut PreparedMission) -> SwarmFlight {
    let plan = mission.plan().expect("there is a plan");
    swarm::fly(mission, &plan, "fly", swarm::Pace::Fastest, &Progress::on_terminal())
        .expect("the boards answer")
}

#[test]
fn a_flight_of_boards_is_the_same_twice_on_any_load() {
    let Some(program) = board::built_program("flockmate") else { return };
    let folder = tempfile::tempdir().expect("a temporary directory");
    let mut mission = prepare_mission(THREE);
    board::put_on_boards(&mut mission, &program, folder.path());
    let first = fly(&mut mission);
    assert!(
        first.result.complete,
        "{:?}",
        first.log.iter().map(|event| &event.text).collect::<Vec<_>>()
    );
    let over = AtomicBool::new(false);
    let second = scope(|scope| {
        let busy = || {
            while !over.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        };
        (0..available_parallelism().map_or(2, usize::from)).for_each(|_| _ = scope.spawn(busy));
        let second = fly(&mut mission);
        over.store(true, Ordering::Relaxed);
        second
    });
    println!(
        "{:.0} s in {:.1} s, beside a load {:.1} s",
        first.simulated_s, first.wall_time_s, second.wall_time_s
    );
    assert!(
        board::observable_text(&first) == board::observable_text(&second),
        "{:?}\n{:?}",
        first.result,
        second.result
    );
}

#[test]
fn by_the_wall_clock_a_board_answers_through_its_port() {
    let Some(program) = board::built_program("flockmate") else { return };
    let (_board, [autopilot, _]) = board::start_by_wall_clock(&program);
    let mut client = FtpClient::new(autopilot.open().expect("its port is open"), None);
    assert_eq!(client.wait_for_companion().expect("it speaks"), 250);
}
