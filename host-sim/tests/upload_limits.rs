//! `host-sim upload` sends no file that the board cannot hold: the limit is named, and not one byte
//! leaves.

use std::net::UdpSocket;
use std::process::Command;

use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::{self, Edge, RoadmapHeader};

/// A roadmap of nodes half a metre apart, each joined to the next ones.
fn file(nodes: usize, next: usize) -> Vec<u8> {
    let header = RoadmapHeader {
        origin: Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 },
        edge_min_m: 0.5,
        edge_max_m: 100.0,
        tested_clearance_m: 0.3,
        max_clearance_m: 6.0,
        start_count: 1,
        goal_count: 1,
    };
    let places: Vec<Point> = (0..nodes).map(|i| Point::new(0.5 * i as f32, 0.0, 1.5)).collect();
    let pairs = (0..nodes)
        .flat_map(|a| (a + 1..nodes.min(a + 1 + next)).map(move |b| (a as u16, b as u16)));
    let edges: Vec<Edge> = pairs.map(|(a, b)| Edge { a, b, clearance_m: 1.0 }).collect();
    let mut bytes = vec![0; roadmap::encoded_len(nodes, edges.len(), 0).expect("it is small")];
    roadmap::write(&header, &places, &edges, &mut bytes).expect("it is a roadmap");
    bytes
}

/// Uploads a file to a vehicle that does not answer, and checks that nothing arrives there; returns
/// the command's error message.
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

#[test]
fn a_file_beyond_a_boards_limit_is_not_sent_and_the_limit_is_named() {
    let said = |nodes: usize, next: usize, board: Option<&str>, limit: &str| {
        let said = refused(&file(nodes, next), board);
        assert!(said.contains(limit), "{limit:?} is not in {said:?}");
    };
    said(4097, 1, None, "4097 nodes, nucleo-h743 holds 4096");
    said(4097, 1, Some("qemu"), "4097 nodes, qemu holds 4096");
    said(2049, 1, Some("pico2"), "2049 nodes, pico2 holds 2048");
    // Nine edges a node, but the last ones have fewer.
    said(4096, 9, None, "73638 half-edges, nucleo-h743 holds 65536");
    said(2048, 9, Some("pico2"), "36774 half-edges, pico2 holds 32768");
}
