//! `host-sim upload` sends no file that the board cannot hold: the limit is named, and not one byte leaves.

use std::net::UdpSocket;
use std::process::Command;

use companion::mission_file::{self, MissionGoal, MissionHeader, MissionVehicle};
use host_sim::capacity::{BOARDS, Board};
use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::frames::Geodetic;
use planner_core::plan::{Mode, Objective, VehicleTask};
use planner_core::roadmap::{self, Edge, LANDMARKS, RoadmapHeader};
use planner_core::schedule::ScheduleConfig;

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };

/// A roadmap of nodes half a metre apart, each joined to the next ones.
fn file(nodes: usize, next: usize) -> Vec<u8> {
    let header = RoadmapHeader {
        origin: ORIGIN,
        edge_min_m: 0.5,
        edge_max_m: 100.0,
        tested_clearance_m: 0.3,
        max_clearance_m: 6.0,
        starts: 1,
        goals: 1,
    };
    let places: Vec<Point> = (0..nodes).map(|i| Point::new(0.5 * i as f32, 0.0, 1.5)).collect();
    let pairs = (0..nodes).flat_map(|a| (a + 1..nodes.min(a + 1 + next)).map(move |b| (a as u16, b as u16)));
    let edges: Vec<Edge> = pairs.map(|(a, b)| Edge { a, b, clearance_m: 1.0 }).collect();
    let mut bytes = vec![0; roadmap::encoded_len(nodes, edges.len(), 0).expect("it is small")];
    roadmap::write(&header, &places, &edges, &mut bytes).expect("it is a roadmap");
    bytes
}

/// A mission of vehicles and goals in two rows.
fn mission(vehicles: u8, goals: usize) -> Vec<u8> {
    let schedule =
        ScheduleConfig { separation_m: 2.0, parked_separation_m: 1.75, cruise_mps: 1.8, vertical_mps: 1.0 };
    let header = MissionHeader {
        roadmap_crc: 1,
        mode: Mode::Unlabelled(Objective::Makespan),
        method: Method::Priority,
        origin: ORIGIN,
        cruise_mps: 2.0,
        schedule,
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: [255, 0, 0, 0],
    };
    let vehicle = |id: u8| MissionVehicle {
        task: VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.5, goal: None },
        start: Point::new(3.0 * f32::from(id), 0.0, 1.5),
        radius_m: 0.3,
        speed_max_mps: 3.0,
    };
    let goal = |i: usize| MissionGoal { position: Point::new(3.0 * i as f32, 20.0, 1.5), descent_m: 1.5 };
    let vehicles: Vec<_> = (1..=vehicles).map(vehicle).collect();
    let goals: Vec<_> = (0..goals).map(goal).collect();
    let mut bytes = vec![0; mission_file::encoded_len(vehicles.len(), goals.len())];
    mission_file::write(&header, &vehicles, &goals, &mut bytes).expect("it is a mission");
    bytes
}

/// Uploads it to a vehicle that says nothing; what the command says. Nothing may arrive.
fn refused(file: &[u8], board: Option<&str>) -> String {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let path = folder.path().join("roadmap.bin");
    std::fs::write(&path, file).expect("it can be written");
    let vehicle = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    vehicle.set_nonblocking(true).expect("it can be");
    let url = format!("udp:{}", vehicle.local_addr().expect("it is bound"));
    let mut upload = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    upload.arg("upload").arg(&path).args(["--link", &url]);
    board.iter().for_each(|board| {
        upload.args(["--board", board]);
    });
    let done = upload.output().expect("it starts");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(vehicle.recv(&mut [0; 512]).is_err(), "something was sent: {said}");
    said
}

#[track_caller]
fn is_refused(file: &[u8], board: Option<&str>, limit: &str) {
    let said = refused(file, board);
    assert!(said.contains(limit), "{limit:?} is not in {said:?}");
}

#[test]
fn a_roadmap_beyond_a_boards_limit_is_not_sent_and_the_limit_is_named() {
    let refused = |nodes: usize, next: usize, board: Option<&str>, limit: &str| {
        is_refused(&file(nodes, next), board, limit);
    };
    refused(4097, 1, None, "4097 nodes, nucleo-h743 holds 4096");
    refused(4097, 1, Some("qemu"), "4097 nodes, qemu holds 4096");
    refused(2049, 1, Some("pico2"), "2049 nodes, pico2 holds 2048");
    // Nine edges a node, but the last ones have fewer.
    refused(4096, 9, None, "73638 half-edges, nucleo-h743 holds 65536");
    refused(2048, 9, Some("pico2"), "36774 half-edges, pico2 holds 32768");
}

/// So a roadmap within the other limits never has too many bytes.
#[test]
fn every_board_has_flash_for_as_many_nodes_and_half_edges_as_it_holds() {
    for Board { name, nodes, half_edges, roadmap_bytes, .. } in &BOARDS {
        let largest = roadmap::encoded_len(*nodes, half_edges / 2, LANDMARKS + 1).expect("it is small");
        assert!(largest <= *roadmap_bytes, "{name}: {largest} bytes, {roadmap_bytes} of flash");
    }
}

#[test]
fn a_mission_beyond_a_boards_limit_is_not_sent_and_the_limit_is_named() {
    is_refused(&mission(33, 2), None, "33 vehicles, nucleo-h743 holds 32");
    is_refused(&mission(2, 33), None, "33 goals, nucleo-h743 holds 32");
    is_refused(&mission(33, 33), Some("qemu"), "33 vehicles, qemu holds 32");
    is_refused(&mission(17, 1), Some("pico2"), "17 vehicles, pico2 holds 16");
    is_refused(&mission(1, 17), Some("pico2"), "17 goals, pico2 holds 16");
}
