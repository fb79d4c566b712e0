//! Missions that fall short say why, where, and what would help; and what they say helps.

use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::{scenario, shortage, swarm};

const DEMO: &str = include_str!("../scenarios/demo.toml");
const LOBBY: &str = include_str!("../scenarios/lobby.toml");

/// The lobby with more keys, prepared.
fn prepared(more: &str) -> PreparedMission {
    let scenario = scenario::parse(&format!("{LOBBY}\n{more}\n"), "lobby.toml").unwrap();
    PreparedMission::prepare(scenario, &Progress::hidden()).unwrap()
}

fn reasons(more: &str) -> Vec<String> {
    let mut mission = prepared(more);
    let plan = mission.plan().unwrap();
    shortage::shortage_lines(&mission, &plan)
}

#[test]
fn too_few_nodes_and_too_wide_a_margin_are_distinguished() {
    let few = reasons("[roadmap]\nnodes = 10");
    assert!(
        few.len() == 4 && few[..2].iter().all(|l| l.contains("more roadmap.nodes (10)")),
        "{few:?}"
    );
    assert!(few[0].starts_with("goal 0 at [28, 3, 1.8] (lobby.toml:10): "), "{few:?}");
    assert!(
        few[..2].iter().all(|l| l.contains("or roadmap.passages = true, would help")),
        "{few:?}"
    );
    assert_eq!(reasons("[roadmap]\nnodes = 2300"), [""; 0]);
    assert_eq!(reasons("[roadmap]\nnodes = 10\npassages = true"), [""; 0]);
    // No door of the demo's rooms leaves a clearance of 1.5 m.
    let margin = DEMO.replace("safety_margin_m = 0.5", "safety_margin_m = 1.2");
    assert!(margin.contains("safety_margin_m = 1.2"));
    let mut mission = PreparedMission::prepare(
        scenario::parse(&margin, "demo.toml").unwrap(),
        &Progress::hidden(),
    )
    .unwrap();
    let plan = mission.plan().unwrap();
    let wide = shortage::shortage_lines(&mission, &plan);
    assert!(wide.len() == 9 && wide[8] == "and 12 more", "{wide:?}");
    let (_, margin) = wide[0].split_once("a roadmap.safety_margin_m of at most ").expect(&wide[0]);
    let margin_m: f32 = margin.split(' ').next().unwrap().parse().unwrap();
    assert!((0.8..1.2).contains(&margin_m), "{wide:?}");
}

#[test]
fn a_serial_link_that_fails_a_mission_is_reported_with_a_remedy() {
    let fly = |more: &str| {
        let mut mission = prepared(more);
        let plan = mission.plan().unwrap();
        swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden()).unwrap()
    };
    for (key, value, cause) in [
        ("serial_baud", "9600", "9600 baud carry 960"),
        ("serial_corruption", "0.01", "0.01 of its bytes change"),
    ] {
        let flight = fly(&format!("[simulation]\n{key} = {value}"));
        assert!(!flight.result.complete, "{key}");
        let found =
            flight.log.iter().find(|event| event.text.contains(cause)).map(|event| &event.text);
        let (_, remedy) =
            found.expect(key).split_once(&format!("simulation.{key} of ")).expect(key);
        let remedy = remedy.split(' ').next().unwrap();
        // What it says would do does.
        assert!(
            fly(&format!("[simulation]\n{key} = {remedy}")).result.complete,
            "{key} = {remedy}"
        );
    }
}

/// P2D: no edge joins two terminals, and lengths are shares of the map.
#[test]
fn terminals_are_kept_apart_and_lengths_follow_the_map() {
    let terminals =
        |mission: &PreparedMission| mission.scenario.vehicles.len() + mission.goals.len();
    let joined = |mission: &PreparedMission| {
        let is_terminal = |node: u16| usize::from(node) < terminals(mission);
        mission
            .roadmap
            .edges
            .iter()
            .filter(|edge| is_terminal(edge.a) && is_terminal(edge.b))
            .count()
    };
    // The longest side of the building is 49 m.
    let longest_m = 49.0 * 0.15;
    let apart =
        prepared("[roadmap]\nterminals = \"apart\"\nedge_min_share = 0.02\nedge_max_share = 0.15");
    assert!(joined(&prepared("")) > 0, "otherwise there is nothing to be kept apart");
    assert_eq!(joined(&apart), 0);
    let length_m = |a: u16, b: u16| {
        (apart.roadmap.nodes[usize::from(a)] - apart.roadmap.nodes[usize::from(b)]).norm()
    };
    let lengths: Vec<f32> =
        apart.roadmap.edges.iter().map(|edge| length_m(edge.a, edge.b)).collect();
    let (least_m, most_m) = (
        lengths.iter().copied().fold(f32::INFINITY, f32::min),
        lengths.iter().copied().fold(0.0, f32::max),
    );
    assert!(
        least_m >= 0.979 && most_m <= longest_m + 1e-3 && most_m > longest_m - 0.5,
        "{least_m} {most_m}"
    );
    let header = apart.roadmap_view();
    assert!((header.header().edge_max_m - longest_m).abs() < 1e-3);
}
