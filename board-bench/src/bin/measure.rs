//! Test program: counts the instructions of the board's main work and prints checksums of its
//! results. It runs in QEMU with `-icount shift=0`; `tests/tests/board.rs` reads its output. A
//! roadmap lies in bank 2, a map in memory behind it. Each output line is a name and numbers.
#![no_std]
#![no_main]

use core::hint::black_box;

use board_bench::cases::{self, StepCase, StepKind};
use companion::planner::LendWorkspace as _;
use firmware::boards::chosen::{clock, memory};
use firmware::boards::stack;
use firmware::capacity::{ROADMAP_NODES, VEHICLES, WAYPOINTS};
use firmware::workspace::{PlannerWorkspace, WorkspaceOverlay};
use heapless::Vec;
use planner_core::plan::{self, AssignedGoals, SwarmPlan};
use planner_core::roadmap::prm::PrmConfig;
use planner_core::roadmap::search::{self, SearchWorkspace};
use planner_core::roadmap::{HalfEdge, RoadmapView};
use planner_core::track::deconflict::Method;
use rand_core::SeedableRng;
use rand_pcg::Pcg32;
use semihosting::println;
use static_cell::ConstStaticCell;

type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;

static WORKSPACE: ConstStaticCell<WorkspaceOverlay> = ConstStaticCell::new(WorkspaceOverlay::new());
static PLAN: ConstStaticCell<Plan> = ConstStaticCell::new(Plan::new());
static CASES: ConstStaticCell<cases::PlanCaseWorkspace> =
    ConstStaticCell::new(cases::PlanCaseWorkspace::new());

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    println!("panic {info}");
    semihosting::process::exit(1)
}

#[cortex_m_rt::entry]
fn main() -> ! {
    clock::start();
    let view = print_instructions("parse", || RoadmapView::parse(memory::bank2()))
        .expect("a roadmap lies in bank 2");
    println!("roadmap {} {} {:08x}", view.node_count(), view.half_edge_count(), view.crc());
    let workspace = WORKSPACE.take();
    measure_plan(&view, workspace.for_goals());
    measure_steps();
    measure_build(workspace, 0.0);
    measure_build(workspace, cases::CLEARANCE_M);
    let ws = CASES.take();
    for number in 0..cases::PLAN_CASES {
        let case = cases::plan_case(&view, number, ws);
        let [costs, assignment, paths, advice] =
            [case.costs_crc, case.assignment_crc, case.paths_crc, case.advice_crc];
        println!("case {number} {costs:08x} {assignment:08x} {paths:08x} {advice:08x}");
    }
    println!("stack {} {}", stack::max_used_bytes(), stack::size_bytes());
    semihosting::process::exit(0)
}

/// Runs `work` and returns its result and the instructions it took, without those of reading the
/// clock.
fn count_instructions<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let idle = clock::instructions();
    let before = clock::instructions();
    let result = black_box(work());
    (result, (clock::instructions() - before).saturating_sub(before - idle))
}

fn print_instructions<T>(name: &str, work: impl FnOnce() -> T) -> T {
    let (result, count) = count_instructions(work);
    println!("count {name} {count}");
    result
}

/// Counts the instructions of each step of planning a swarm from the roadmap's starts to its goals:
/// costs, assignment, paths, schedule.
fn measure_plan(view: &RoadmapView<'_>, ws: &mut PlannerWorkspace) {
    let plan = PLAN.take();
    let (vehicles, descents_m) = (cases::vehicle_tasks(view), cases::goal_descents(view));
    let request = cases::plan_request(&vehicles, &descents_m);
    let mut goals = AssignedGoals::new();
    print_instructions("costs", || plan::compute_costs(view, &request, ws)).expect("a cost matrix");
    print_instructions("assign", || plan::assign_goals(&request, ws, &mut goals))
        .expect("an assignment");
    print_instructions("paths", || find_shortest_paths(view, &goals, &mut ws.search));
    print_instructions("schedule", || plan::schedule_flights(view, &request, &goals, ws, plan))
        .expect("a schedule");
    println!("plan {:08x}", plan.crc);
}

/// Finds the shortest path of each vehicle to its goal, by A*.
fn find_shortest_paths(
    view: &RoadmapView<'_>,
    goals: &AssignedGoals<VEHICLES>,
    search: &mut SearchWorkspace<ROADMAP_NODES>,
) {
    let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, cases::CLEARANCE_M);
    for (start, goal) in (0u16..).zip(goals) {
        let mut nodes: Vec<u16, WAYPOINTS> = Vec::new();
        let target = view.header().start_count + goal.expect("every vehicle has a goal");
        search::astar(view, start, target, passable, search, &mut nodes).expect("a path");
        black_box(&nodes);
    }
}

/// Counts the instructions of each [`StepCase`], advice among 32 neighbours. Prints the largest and
/// the mean count.
fn measure_steps() {
    let mut rng = Pcg32::seed_from_u64(1);
    let (mut worst, mut sum) = (0, 0);
    for number in 0..cases::STEP_CASES {
        let case = StepCase::new(&mut rng, VEHICLES, StepKind::of_case(number));
        let (_, count) = count_instructions(|| black_box(&case).advise(Method::Priority));
        worst = worst.max(count);
        sum += count;
    }
    println!("count step {worst}");
    println!("count mean-step {}", sum / cases::STEP_CASES as u64);
}

/// Counts the instructions of building a roadmap from the map, with this clearance.
fn measure_build(workspace: &mut WorkspaceOverlay, clearance_m: f32) {
    let (head, words) = memory::measurement_map();
    let grid = cases::voxel_map(&head, words);
    let builder = workspace.builder();
    let config = PrmConfig { clearance_m, ..cases::ROADMAP_CONFIG };
    let name = if clearance_m > 0.0 { "build-with-clearance" } else { "build" };
    print_instructions(name, || builder.build(&grid, &[], &config)).expect("a roadmap");
    let (nodes, edges) = (builder.nodes(), builder.edges());
    println!("{name} {} {} {:08x}", nodes.len(), edges.len(), cases::roadmap_crc(nodes, edges));
}
