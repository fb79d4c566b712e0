//! The plan of a swarm, and the memory in which it is computed.

use heapless::Vec;

use crate::assignment::AssignmentWorkspace;
use crate::flight::Flight;
use crate::roadmap::search::SearchWorkspace;
use crate::schedule::ScheduleWorkspace;
use crate::schedule::sipp::SippWorkspace;

/// The plan of a whole swarm: flight `i` is that of vehicle `i` of the request. A vehicle without a
/// goal has a flight too, with [`Task::Stay`](crate::flight::Task::Stay).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwarmPlan<const V: usize, const W: usize> {
    /// One flight per vehicle.
    pub flights: Vec<Flight<W>, V>,
    /// CRC-32 over separations, speeds, ids, goals, climbs, descents, segment lengths, waypoints
    /// with their times, and departures.
    pub crc: u32,
}

impl<const V: usize, const W: usize> SwarmPlan<V, W> {
    /// Creates a plan without vehicles.
    pub const fn new() -> Self {
        Self { flights: Vec::new(), crc: 0 }
    }

    /// Sum of the lengths of all paths, metres.
    pub fn total_path_m(&self) -> f64 {
        self.flights.iter().map(|f| f64::from(f.path.length_m())).sum()
    }
}

/// Memory of [`super::plan_swarm`] and its steps, for roadmaps of up to `N` nodes, swarms of up to
/// `V` vehicles and `V` goals, and up to `P` timed segments of all scheduled flights in
/// [`crate::schedule::sipp`].
pub struct PlanWorkspace<const N: usize, const V: usize, const P: usize> {
    /// Memory of roadmap searches, also for [`crate::detour`].
    pub search: SearchWorkspace<N>,
    /// Memory of [`crate::schedule::sipp`].
    pub sipp: SippWorkspace<N, P>,
    /// Memory of [`crate::assignment`].
    pub assignment: AssignmentWorkspace<V>,
    /// Path lengths from starts to goals, row-major and contiguous from the first number on. Later
    /// the same memory holds the intervals of `departures.rs`.
    pub(super) costs: [[f32; V]; V],
    /// Memory of the schedule, also for [`super::vehicle_plan`].
    pub schedule: ScheduleWorkspace,
}

impl<const N: usize, const V: usize, const P: usize> PlanWorkspace<N, V, P> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        Self {
            search: SearchWorkspace::new(),
            sipp: SippWorkspace::new(),
            assignment: AssignmentWorkspace::new(),
            costs: [[0.0; V]; V],
            schedule: ScheduleWorkspace::new(),
        }
    }
}

impl<const N: usize, const V: usize, const P: usize> Default for PlanWorkspace<N, V, P> {
    fn default() -> Self {
        Self::new()
    }
}
