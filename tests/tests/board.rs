//! An emulated board computes the same bits as the host, within a limit of instructions (program
//! `measure`). It also does so, without a panic, for every public call of planner-core with extreme
//! and invalid arguments (program `limits`).
//!
//! QEMU counts: with `-icount shift=0` an instruction takes a nanosecond of the board's time.
//! Counted are the board's instructions, not cycles of the chip.

use std::collections::HashMap;

use board_bench::calls::limits::{self, CallListener, Results};
use board_bench::calls::limits_routes::{self, RouteWorkspaces};
use board_bench::cases::{self, PlanCaseWorkspace};
use flockmate_tests::{board, workspace};
use host_sim::map::{UnknownSpace, building};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;
use planner_core::plan::{self, PlanWorkspace, SwarmPlan};
use planner_core::roadmap::prm::{self, PrmConfig};

/// Most instructions permitted, by the name that `measure` prints.
const LIMITS: [(&str, u64); 4] = [
    ("replan", 40_000_000),
    ("build", 100_000_000),
    ("build-with-clearance", 100_000_000),
    ("step", 60_000),
];

#[test]
fn the_board_computes_what_the_host_computes() {
    let Some(program) = board::built_program("measure") else { return };
    let scenario = scenario::load(&workspace().join("host-sim/scenarios/demo.toml"))
        .expect("the demo is good");
    let mission = PreparedMission::prepare(scenario, &Progress::on_terminal())
        .expect("the demo can be prepared");
    let map = building::building_map(building::DEFAULT_SEED, 0.5)
        .expect("the building")
        .to_voxel_map(UnknownSpace::Blocked);
    let lines = board::run_measuring_program(
        &program,
        &mission.roadmap_or_field_file,
        &board::map_image(&map.grid()),
    );

    let view = mission.roadmap_view();
    let mut ws = Box::new(PlanCaseWorkspace::new());
    for number in 0..cases::PLAN_CASES {
        let case = cases::plan_case(&view, number, &mut ws);
        let [costs, assignment, paths, scales] =
            [case.costs_crc, case.assignment_crc, case.paths_crc, case.advice_crc];
        let line = format!("case {number} {costs:08x} {assignment:08x} {paths:08x} {scales:08x}");
        assert!(lines.contains(&line), "the host has {line:?}, the board\n{}", lines.join("\n"));
    }
    assert!(lines.contains(&format!("plan {:08x}", swarm_crc(&mission))), "{}", lines.join("\n"));
    for (name, clearance_m) in [("build", 0.0), ("build-with-clearance", cases::CLEARANCE_M)] {
        let config = PrmConfig { clearance_m, ..cases::ROADMAP_CONFIG };
        let line = format!("{name} {}", built(&map.grid(), &config));
        assert!(lines.contains(&line), "the host has {line:?}, the board\n{}", lines.join("\n"));
    }

    let mut counts: HashMap<&str, u64> = lines
        .iter()
        .filter_map(|line| line.strip_prefix("count ")?.split_once(' '))
        .map(|(name, count)| (name, count.parse().expect("a number")))
        .collect();
    counts.insert("replan", ["costs", "assign", "paths"].iter().map(|part| counts[part]).sum());
    for (name, count) in &counts {
        println!("{name}: {count} instructions");
    }
    for (name, limit) in LIMITS {
        assert!(counts[name] <= limit, "{name}: {} of {limit} instructions", counts[name]);
    }
}

/// Counts calls.
struct Calls(usize);

impl CallListener for Calls {
    fn before_call(&mut self, _name: &'static str) {
        self.0 += 1;
    }
}

#[test]
fn at_its_limits_the_board_answers_as_the_host_does() {
    let Some(program) = board::built_program("limits") else { return };
    let mut calls = Calls(0);
    let mut answers = Results::new(&mut calls);
    limits::call_without_roadmap(&mut answers);
    let places = answers.sum();
    let routes = limits_routes::call_all(&mut answers, &mut Box::new(RouteWorkspaces::new()));
    let expected = format!("limits {} {places:08x} {routes:08x?}", calls.0);
    // Neither roadmap nor map is read.
    let lines = board::run_measuring_program(&program, &[0], &[0]);
    println!("{}", lines.join("\n"));
    assert_eq!(lines.first(), Some(&expected));
}

/// CRC of the plan for the whole swarm.
fn swarm_crc(mission: &PreparedMission) -> u32 {
    let view = mission.roadmap_view();
    let (vehicles, descents_m) = (cases::vehicle_tasks(&view), cases::goal_descents(&view));
    let request = cases::plan_request(&vehicles, &descents_m);
    let mut ws = host_sim::capacity::on_heap(PlanWorkspace::<4096, 32, 2048>::new);
    let mut plan = Box::new(SwarmPlan::<32, 64>::new());
    plan::plan_swarm(&view, &request, &mut ws, &mut plan).expect("a plan");
    plan.crc
}

/// The values that `measure` prints for a roadmap built on board, computed on the host.
fn built(grid: &planner_core::map::voxel::VoxelGrid<'_>, config: &PrmConfig) -> String {
    let mut nodes = vec![planner_core::Point::zeros(); config.random_nodes];
    prm::sample_nodes(grid, None, &[], config, &mut nodes).expect("free space");
    let mut node_grid = Box::new(prm::NodeGrid::<4096, 8192>::new());
    let mut edges = vec![prm::PrmEdge::default(); 1 << 15];
    let count =
        prm::connect(grid, &nodes, config, &mut node_grid, &mut edges).expect("it connects");
    let edge = |e: &prm::PrmEdge| planner_core::roadmap::Edge { a: e.a, b: e.b, clearance_m: 0.0 };
    let edges: Vec<_> = edges[..count].iter().map(edge).collect();
    format!("{} {} {:08x}", nodes.len(), edges.len(), cases::roadmap_crc(&nodes, &edges))
}
