//! Every way in which small swarms can fly their plans, searched breadth first.
//!
//! Plans and gates come from the planner as vehicles get them; the model knows nothing else of the
//! schedule. The state is the progress of each vehicle: the stretch between two marks that it is
//! on. Marks are its own gates, its waypoints, and the places where a report with the greatest
//! error opens a gate of another vehicle. Actions: each vehicle advances by a stretch, or stops
//! where it is; its reported progress is wrong by up to 0.25 m either way; it leaves the plan,
//! which opens the gates that wait for it. A message that arrives late is a step of the sender that
//! is not taken yet: the search takes the steps in every order.
//!
//! - No conflict: where two vehicles that fly the plan can be at the same time, they are no nearer
//!   than the safety distance. Here a gate counts as open as soon as some report may open it.
//! - No deadlock: some vehicle can continue until all have landed. Here a gate counts as open only
//!   if every report opens it.
//!
//! Planted errors must be found. Which plans they spoil is known without the search. Gates only
//! open: so two vehicles can be at two places at once if both reach these when each goes as far as
//! it may but no further than its place, with all others out of the plan. By this test a dropped
//! gate *matters* in a plan; each gate that matters is dropped in turn. The same test serves for
//! vehicles that do not stop at a gate when they already stand at it (`<` for `≤` in the gate's
//! place). Gates that open only beyond their progress (`<` for `≤` there) matter if a vehicle is
//! stuck when each goes as far as it may; such plans are searched among more.
//!
//! `FLOCKMATE_MODELS=N` searches N plans each in place of [`PLANS`].

use std::collections::{HashSet, VecDeque};

use flockmate_tests::number_from_env;
use flockmate_tests::swarms::{Plan, Random, Swarm, end_arc_length_m, position_at};
use planner_core::Point;
use planner_core::flight::{Gate, MAX_REPORTED_PROGRESS_LAG_M};
use rayon::prelude::*;

/// Number of plans searched for each number of vehicles, each with a gate that matters.
const PLANS: usize = 600;
/// Per so many plans one must be found in which a vehicle is stuck if gates open only beyond their
/// progress.
const PLANS_FOR_ONE_STUCK: usize = 20;
/// Longest flight from the pad to the ground, metres: ten timed segments.
const LONGEST_M: f32 = 15.0;
/// Rounding of sums of lengths, metres.
const ROUNDING_M: f32 = 1e-4;
/// The stretch of a vehicle that has left the plan.
const OUT: u8 = u8::MAX;

/// The stretch that each vehicle is on.
type State = [u8; 4];

/// One vehicle's flight in stretches: the first is its pad, the last the ground below its goal.
struct Course {
    marks: Vec<f32>,
    /// For each stretch the gates at its beginning: index of the awaited vehicle, and its progress
    /// that opens the gate, metres.
    gates: Vec<Vec<(usize, f32)>>,
    /// Points of each stretch, near each other.
    points: Vec<Vec<Point>>,
}

impl Course {
    fn last(&self) -> u8 {
        (self.marks.len() - 1) as u8
    }
}

/// How vehicles obey gates.
#[derive(Clone, Copy, PartialEq)]
enum Obeys {
    Right,
    /// A planted error: a gate opens only beyond the required progress.
    OpensBeyond,
    /// A planted error: a gate does not hold a vehicle that already stands at it.
    NotAtGate,
}

/// Which of the reports that a vehicle may have sent the others go by.
#[derive(Clone, Copy)]
enum Reports {
    Highest,
    Lowest,
}

struct Model {
    courses: Vec<Course>,
    obeys: Obeys,
    /// For each pair of vehicles the pairs of stretches that are too near to each other.
    near: Vec<Vec<HashSet<(u8, u8)>>>,
}

#[derive(Debug, PartialEq)]
enum Outcome {
    Good(usize),
    Conflict,
    Deadlock,
}

impl Model {
    fn new(plan: &Plan, gates: &[Vec<Gate>], obeys: Obeys, safety_m: f32) -> Self {
        let flights = &plan.flights;
        let index = |id: u8| flights.iter().position(|f| f.vehicle_id == id).unwrap();
        let mut courses = Vec::new();
        for (i, flight) in flights.iter().enumerate() {
            let (pad_m, end) = (-flight.climb_m, end_arc_length_m(flight));
            let waypoints = flight.path.waypoints().iter().map(|w| w.along_m);
            let waits = gates[i].iter().map(|g| g.at_m);
            let heard = gates.iter().flatten().filter(|g| g.wait_for_id == flight.vehicle_id);
            let reports = heard.flat_map(|g| {
                [
                    g.open_from_progress_m - MAX_REPORTED_PROGRESS_LAG_M,
                    g.open_from_progress_m + MAX_REPORTED_PROGRESS_LAG_M,
                ]
            });
            let all = waypoints.chain(waits).chain(reports).chain([end]);
            let mut marks: Vec<f32> = all.filter(|&m| m > pad_m + ROUNDING_M && m <= end).collect();
            // The stretch from mark 0 to mark 1, which is the same place, is the pad.
            marks.extend([pad_m, pad_m]);
            marks.sort_by(f32::total_cmp);
            let (pad, mut flown) = (marks[0], marks.split_off(1));
            flown.dedup_by(|b, a| *b - *a < ROUNDING_M);
            let marks: Vec<f32> = std::iter::once(pad).chain(flown).collect();
            let begins = |at_m: f32| -> usize {
                // The stretch that begins at this mark; at the pad the second one.
                (1..marks.len()).rfind(|&k| marks[k] <= at_m + ROUNDING_M).unwrap()
            };
            let mut at: Vec<Vec<(usize, f32)>> = vec![Vec::new(); marks.len()];
            gates[i].iter().for_each(|g| {
                at[begins(g.at_m)].push((index(g.wait_for_id), g.open_from_progress_m));
            });
            let stretch = |k: usize| {
                let (from, to) = (marks[k], marks.get(k + 1).copied().unwrap_or(marks[k]));
                let steps = ((to - from) / 0.1).ceil().max(1.0) as usize;
                (0..=steps)
                    .map(|s| position_at(flight, from + (to - from) * s as f32 / steps as f32))
                    .collect()
            };
            let points = (0..marks.len()).map(stretch).collect();
            courses.push(Course { marks, gates: at, points });
        }
        let near = |i: usize, j: usize| {
            let (a, b) = (&courses[i], &courses[j]);
            let mut pairs = HashSet::new();
            for (k, points) in a.points.iter().enumerate() {
                for (l, others) in b.points.iter().enumerate() {
                    let moves = |k: usize, c: &Course| k > 0 && k + 1 < c.marks.len();
                    let meets = |p: &Point| others.iter().any(|q| (p - q).norm() < safety_m - 0.01);
                    if (moves(k, a) || moves(l, b)) && points.iter().any(meets) {
                        pairs.insert((k as u8, l as u8));
                    }
                }
            }
            pairs
        };
        let count = courses.len();
        let near = (0..count).map(|i| (0..i).map(|j| near(i, j)).collect()).collect();
        Self { courses, obeys, near }
    }

    /// Whether vehicle `i` may continue from its stretch.
    fn goes_on(&self, state: &State, i: usize, reports: Reports) -> bool {
        let course = &self.courses[i];
        if state[i] >= course.last() {
            return false;
        }
        course.gates[usize::from(state[i]) + 1].iter().all(|&(other, until_m)| {
            let (at, other) = (state[other], &self.courses[other]);
            if at == OUT {
                return true;
            }
            let (k, landed) = (usize::from(at), at == other.last());
            let reported_m = match (k, reports) {
                (0, _) => other.marks[0],
                _ if landed => other.marks[k] + 1.0,
                // The other vehicle may be anywhere on its stretch: some report is this high, but
                // none is beyond the ground ...
                (_, Reports::Highest) => (other.marks[k] + MAX_REPORTED_PROGRESS_LAG_M)
                    .min(other.marks[usize::from(other.last())]),
                // ... and once it stands at the end of the stretch, no report is lower than this.
                (_, Reports::Lowest) => other.marks[k + 1] - MAX_REPORTED_PROGRESS_LAG_M,
            };
            match self.obeys {
                Obeys::Right => reported_m >= until_m - ROUNDING_M,
                Obeys::OpensBeyond => reported_m > until_m + ROUNDING_M,
                Obeys::NotAtGate => true,
            }
        })
    }

    /// The stretch that each vehicle reaches if it goes as far as it may, but no further than
    /// `until`. Vehicles may begin out of the plan.
    fn furthest(&self, begin: State, until: State, reports: Reports) -> State {
        let mut state = begin;
        loop {
            let before = state;
            for i in 0..self.courses.len() {
                while state[i] < until[i] && self.goes_on(&state, i, reports) {
                    state[i] += 1;
                }
            }
            if state == before {
                return state;
            }
        }
    }

    /// Whether two vehicles can come too near, found without a search: no other vehicle has to wait
    /// for them.
    fn meets(&self) -> bool {
        (0..self.courses.len()).flat_map(|i| (0..i).map(move |j| (i, j))).any(|(i, j)| {
            let mut begin = [OUT; 4];
            (begin[i], begin[j]) = (0, 0);
            self.near[i][j].iter().any(|&(at, other)| {
                let mut until = begin;
                (until[i], until[j]) = (at, other);
                self.furthest(begin, until, Reports::Highest) == until
            })
        })
    }

    /// Whether a vehicle waits forever when none leaves the plan, found without a search.
    fn sticks(&self) -> bool {
        let last = |i: usize| self.courses.get(i).map_or(0, Course::last);
        let ends = std::array::from_fn(last);
        self.furthest([0; 4], ends, Reports::Lowest) != ends
    }

    fn search(&self) -> Outcome {
        let count = self.courses.len();
        let begin = [0; 4];
        let (mut seen, mut open) = (HashSet::from([begin]), VecDeque::from([begin]));
        while let Some(state) = open.pop_front() {
            let (mut ends, mut moves) = (true, false);
            for i in 0..count {
                for j in (0..i).filter(|&j| state[i] != OUT && state[j] != OUT) {
                    if self.near[i][j].contains(&(state[i], state[j])) {
                        return Outcome::Conflict;
                    }
                }
                ends &= state[i] >= self.courses[i].last();
                moves |= self.goes_on(&state, i, Reports::Lowest);
            }
            if !ends && !moves {
                return Outcome::Deadlock;
            }
            for i in 0..count {
                let mut reach = |to: u8| {
                    let mut next = state;
                    next[i] = to;
                    if seen.insert(next) {
                        open.push_back(next);
                    }
                };
                if self.goes_on(&state, i, Reports::Highest) {
                    reach(state[i] + 1);
                }
                if state[i] < self.courses[i].last() {
                    reach(OUT);
                }
            }
        }
        Outcome::Good(seen.len())
    }
}

#[derive(Default, Debug)]
struct Sum {
    plans: usize,
    states: usize,
    largest: usize,
    wrong: Vec<String>,
    gates: usize,
    /// Number of gates that were dropped, all of which matter.
    dropped: usize,
    /// Number of plans in which gates that open only beyond their progress matter.
    beyond: usize,
}

/// A plan whose flights are short enough, its gates, and the safety distance.
struct Short {
    plan: Box<Plan>,
    gates: Vec<Vec<Gate>>,
    safety_m: f32,
}

impl Short {
    fn random(seed: u64, count: usize) -> Option<Self> {
        let mut rng = Random::new(seed);
        let swarm = Swarm::small(count, &mut rng);
        let plan = if swarm.tasks.len() == count { swarm.plan().ok()? } else { return None };
        if plan
            .flights
            .iter()
            .any(|f| !f.task.leaves_pad() || end_arc_length_m(f) + f.climb_m > LONGEST_M)
        {
            return None;
        }
        let owns = swarm.vehicle_plans(&plan).expect("an Ok plan has all parts");
        let gates = owns.iter().map(|own| own.gates.to_vec()).collect();
        Some(Self { plan, gates, safety_m: swarm.safety_distance_m })
    }

    fn model(&self, obeys: Obeys) -> Model {
        Model::new(&self.plan, &self.gates, obeys, self.safety_m)
    }

    /// The model without one gate of a vehicle.
    fn dropped(&self, vehicle: usize, gate: usize) -> Model {
        let mut gates = self.gates.clone();
        gates[vehicle].remove(gate);
        Model::new(&self.plan, &gates, Obeys::Right, self.safety_m)
    }
}

/// Searches the plan of one seed; `None` if there is no plan, or no gate of it matters.
fn one(seed: u64, count: usize) -> Option<Sum> {
    let short = Short::random(seed, count)?;
    let each =
        short.gates.iter().enumerate().flat_map(|(i, gates)| (0..gates.len()).map(move |g| (i, g)));
    let without: Vec<Model> = each.clone().map(|(i, g)| short.dropped(i, g)).collect();
    let matter: Vec<&Model> = without.iter().filter(|model| model.meets()).collect();
    if matter.is_empty() {
        return None;
    }
    let mut sum = Sum { plans: 1, gates: without.len(), dropped: matter.len(), ..Sum::default() };
    let mut expect = |what: &str, model: &Model, good: fn(&Outcome) -> bool| {
        let outcome = model.search();
        if !good(&outcome) {
            sum.wrong.push(format!("seed {seed}, {count} vehicles, {what}: {outcome:?}"));
        }
        outcome
    };
    let conflict = |outcome: &Outcome| *outcome == Outcome::Conflict;
    matter.iter().for_each(|model| {
        expect("a gate dropped", model, conflict);
    });
    expect("gates hold no vehicle that stands at them", &short.model(Obeys::NotAtGate), conflict);
    let beyond = short.model(Obeys::OpensBeyond);
    let sticks = beyond.sticks();
    if sticks {
        expect("gates open beyond", &beyond, |outcome| *outcome == Outcome::Deadlock);
    }
    let right = short.model(Obeys::Right);
    if right.meets() || right.sticks() {
        expect("found without a search", &right, |_| false);
    }
    if let Outcome::Good(states) =
        expect("as planned", &right, |outcome| matches!(outcome, Outcome::Good(_)))
    {
        (sum.states, sum.largest) = (states, states);
    }
    sum.beyond = usize::from(sticks);
    Some(sum)
}

fn search(count: usize) {
    let wanted = number_from_env("FLOCKMATE_MODELS", PLANS as u64) as usize;
    let mut all = Sum::default();
    let mut seed = 0;
    while all.plans < wanted {
        let sums: Vec<Sum> =
            (seed..seed + 256).into_par_iter().filter_map(|s| one(s, count)).collect();
        seed += 256;
        for sum in sums {
            all.plans += sum.plans;
            all.states += sum.states;
            all.largest = all.largest.max(sum.largest);
            all.gates += sum.gates;
            all.dropped += sum.dropped;
            all.beyond += sum.beyond;
            all.wrong.extend(sum.wrong);
        }
    }
    println!(
        "{count} vehicles: {} plans of {seed} seeds, {} states, {} of the largest; {} of {} gates matter, dropped each is \
         found; gates that open beyond are found in {}",
        all.plans, all.states, all.largest, all.dropped, all.gates, all.beyond
    );
    assert!(
        all.wrong.is_empty(),
        "{} wrong: {:#?}",
        all.wrong.len(),
        &all.wrong[..all.wrong.len().min(10)]
    );
    assert!(
        all.beyond * PLANS_FOR_ONE_STUCK >= wanted,
        "too few in which gates that open beyond matter"
    );
}

#[test]
fn three_vehicles_never_meet_and_never_stand_for_ever() {
    search(3);
}

#[test]
fn four_vehicles_never_meet_and_never_stand_for_ever() {
    search(4);
}
