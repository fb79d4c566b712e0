//! Where the mission is: its state and what that interrupts, what was commanded, and the plan.

use planner_core::detour::Goal;
use planner_core::flight::{Path, Task, VehiclePlan, WaypointRange};
use planner_core::{Length, Point};

use crate::autopilot::telemetry::Ack;
use crate::config::PlanFailure;
use crate::link::Links;
use crate::link::commands::{self, Command, PendingCommands};
use crate::mission::photographed::PhotographedWaypoints;
use crate::mission::task::{PathProgress, Tasks};
use crate::mission::waits::{BarredStart, Waits};
use crate::mission::{
    Action, Guard, GuardInputs, InterruptedStates, State, TargetState, TransitionRow,
};
use crate::time::{Duration, Instant};

/// Greatest distance between the start of a path and the vehicle, metres.
const PATH_BEGIN_M: f32 = 0.1;
/// A picture no further than this before the place where the vehicle comes back to its path is
/// taken there, metres.
const TAKEN_M: f32 = 0.05;

/// One vehicle's mission: at most `W` waypoints and `G` gates.
#[derive(Clone, Debug)]
pub(crate) struct Mission<const W: usize, const G: usize> {
    state: State,
    entered_at: Instant,
    /// When MISSION_START was taken: the schedule counts from it.
    started_at: Instant,
    /// When the pilot took the vehicle.
    pilot_since: Instant,
    interrupted: InterruptedStates,
    pending: PendingCommands,
    /// The autopilot's mode at the start.
    mode_before: u32,
    /// First point of the path, above the pad.
    start: Point,
    plan: Option<VehiclePlan<W, G>>,
    /// Whether all pictures of its part were taken before it left the path of its plan, if it has.
    left_with_all_pictures: Option<bool>,
    /// Pictures of its path up to where it last came back from a detour: those taken before that
    /// were noted when it left.
    pictures_before_rejoin: u32,
    /// Place where the plan ends, the height in which the plan leads there, and the descent,
    /// metres.
    home: (Point, f32, f32),
    failure: Option<PlanFailure>,
    /// Since when the estimate is worse than the margin leaves at a crawl.
    imprecise_since: Option<Instant>,
    waits: Waits,
    tasks: Tasks,
    photographed: PhotographedWaypoints,
    /// Divisions that count for the plan.
    division: usize,
    /// Whether the part that the last one gives has come and is not flown yet.
    division_plan_ready: bool,
    /// The division that the shell was requested to compute, and when.
    division_requested: Option<(u32, Instant)>,
}

impl<const W: usize, const G: usize> Mission<W, G> {
    /// Before the autopilot was heard; the path is to begin at `path_start`.
    pub(crate) fn new(start: Point) -> Self {
        Self {
            state: State::WaitAutopilot,
            entered_at: Instant::ZERO,
            started_at: Instant::ZERO,
            pilot_since: Instant::ZERO,
            interrupted: InterruptedStates::default(),
            pending: PendingCommands::default(),
            mode_before: 0,
            start,
            plan: None,
            left_with_all_pictures: None,
            pictures_before_rejoin: 0,
            home: (start, start.z, 0.0),
            failure: None,
            imprecise_since: None,
            waits: Waits::default(),
            tasks: Tasks::default(),
            photographed: PhotographedWaypoints::default(),
            division: 0,
            division_plan_ready: false,
            division_requested: None,
        }
    }

    /// State of the mission.
    pub(crate) fn state(&self) -> State {
        self.state
    }

    /// Time at which this state was entered.
    pub(crate) fn entered_at(&self) -> Instant {
        self.entered_at
    }

    /// Time in this state.
    pub(crate) fn time_in_state(&self, now: Instant) -> Duration {
        now - self.entered_at
    }

    /// When the mission was started.
    pub(crate) fn started_at(&self) -> Instant {
        self.started_at
    }

    /// Time for which the pilot has had the vehicle.
    pub(crate) fn time_with_pilot(&self, now: Instant) -> Duration {
        now - self.pilot_since
    }

    /// The state of the flight itself, beneath pause and loss.
    pub(crate) fn uninterrupted_state(&self) -> State {
        self.interrupted.uninterrupted_state(self.state)
    }

    /// Commands that are not done yet.
    pub(crate) fn pending(&self) -> &PendingCommands {
        &self.pending
    }

    /// The autopilot's mode at the start.
    pub(crate) fn mode_before(&self) -> u32 {
        self.mode_before
    }

    /// First point of the path, above the pad.
    pub(crate) fn path_start(&self) -> Point {
        self.start
    }

    /// The place of the vehicle on the ground before it starts.
    pub(crate) fn pad_position(&self) -> Point {
        self.start - Point::new(0.0, 0.0, self.climb_m())
    }

    /// The plan.
    pub(crate) fn plan(&self) -> Option<&VehiclePlan<W, G>> {
        self.plan.as_ref()
    }

    /// Height of its climb, metres.
    pub(crate) fn climb_m(&self) -> f32 {
        self.plan.as_ref().map_or(0.0, |plan| plan.climb_m)
    }

    /// Reason why the plan requested last did not come.
    pub(crate) fn plan_failure(&self) -> Option<PlanFailure> {
        self.failure
    }

    /// Whether the schedule lets it take off: it waits on the pad rather than at its first gate in
    /// the air.
    pub(crate) fn departure_due(&self, now: Instant) -> bool {
        let depart_s = self.plan.as_ref().map_or(0.0, |plan| plan.depart_s);
        (now - self.started_at).as_secs_f32() >= depart_s
    }

    /// Time for which the bound of the position estimate has exceeded the part that the margin
    /// leaves for it.
    pub(crate) fn estimate_imprecise_for(&self, now: Instant) -> Duration {
        self.imprecise_since.map_or(Duration::default(), |since| now - since)
    }

    /// Notes whether the estimate is precise enough.
    pub(crate) fn note_estimate(&mut self, usable: bool, now: Instant) {
        self.imprecise_since = if usable { None } else { self.imprecise_since.or(Some(now)) };
    }

    /// The vehicle waits for the vehicle `id`, which has not started, or for none (0). Returns
    /// whether `id` is to be reported.
    pub(crate) fn should_report_wait(&mut self, id: u8, now: Instant) -> bool {
        self.waits.report.update(id, now)
    }

    /// Notes whether something bars the start of the vehicle.
    pub(crate) fn note_start_barred(&mut self, barred: bool, now: Instant) {
        self.waits.barred_start.update(barred, now);
    }

    /// Time for which the start has been barred.
    pub(crate) fn start_barred_for(&self, now: Instant) -> Duration {
        self.waits.barred_start.lasts_for(now)
    }

    /// Takes a command in and says the result; `None` for one that is not the mission's.
    pub(crate) fn handle_command(&mut self, inputs: &GuardInputs, command: &Command) -> Option<u8> {
        commands::apply_command(&mut self.pending, self.state, inputs, command)
    }

    /// Changes the state as a row of the table says. Returns it before and after.
    pub(crate) fn enter_state(
        &mut self,
        row: &TransitionRow,
        custom_mode: u32,
        lands: bool,
        now: Instant,
    ) -> (State, State) {
        let from = self.state;
        let to = match row.to {
            TargetState::State(to) => to,
            TargetState::Interrupted => self.interrupted.target(from),
        };
        self.interrupted.record_interruption(from, to, lands);
        (self.state, self.entered_at) = (to, now);
        if row.guard == Guard::StartCommanded {
            (self.started_at, self.mode_before) = (now, custom_mode);
        }
        if to == State::PilotControl && from != State::PilotReturned {
            self.pilot_since = now;
        }
        let ends = matches!(to, State::Aborted | State::Done)
            || matches!(row.action, Action::ForgetStart | Action::CancelStart);
        self.pending.state_changed(row.guard, to, ends);
        (from, to)
    }

    /// The text for a change of state that interrupts another.
    pub(crate) fn interruption_text(&self, from: State, to: State) -> Option<&'static str> {
        self.interrupted.interruption_text(from, to)
    }

    /// A plan is requested: there is none, and no failure.
    pub(crate) fn forget_plan(&mut self) {
        (self.plan, self.failure, self.division, self.left_with_all_pictures) =
            (None, None, 0, None);
        (self.division_plan_ready, self.division_requested) = (false, None);
        self.waits.barred_start = BarredStart::default();
        self.tasks.reset();
    }

    /// A detour is requested: the plan stays until it comes.
    pub(crate) fn forget_failure(&mut self) {
        self.failure = None;
    }

    /// Stores the requested plan.
    pub(crate) fn set_plan(&mut self, plan: &VehiclePlan<W, G>) {
        match self.starts_at(plan, &self.start) {
            true => self.begin_plan(plan),
            false => self.failure = Some(PlanFailure::Invalid),
        }
    }

    // Copies of it would take a kilobyte of flash each.
    #[inline(never)]
    fn begin_plan(&mut self, plan: &VehiclePlan<W, G>) {
        self.plan = Some(plan.clone());
        (self.left_with_all_pictures, self.pictures_before_rejoin) = (None, 0);
        if let [.., down, over] = plan.path.waypoints() {
            self.home = (over.position, down.position.z, plan.descent_m);
        }
    }

    /// Place where the vehicle's plan ends, as a goal that is reached without a roadmap, and the
    /// descent there, metres.
    pub(crate) fn home_goal(&self) -> (Goal, f32) {
        let (over, layer_m, descent_m) = self.home;
        (Goal::Home { over, layer_m }, descent_m)
    }

    /// Whether the part that the last division gives has come and is not flown yet.
    pub(crate) fn has_division(&self) -> bool {
        self.division_plan_ready
    }

    /// Begins to fly the division's path.
    pub(crate) fn fly_division(&mut self) {
        self.division_plan_ready = false;
    }

    /// Whether the shell is to be asked for this division now; true at most once within `again`
    /// until it answers: an answer does not say which request it is for.
    pub(crate) fn should_request_division(
        &mut self,
        fingerprint: u32,
        now: Instant,
        again: Duration,
    ) -> bool {
        let waits = self.division_requested.is_some_and(|(_, at)| now - at < again);
        if !waits {
            self.division_requested = Some((fingerprint, now));
        }
        !waits
    }

    /// Ends the open request; whether it was for this division.
    pub(crate) fn take_division_request(&mut self, fingerprint: u32) -> bool {
        self.division_requested.take().is_some_and(|(of, _)| of == fingerprint)
    }

    /// Divisions that count for the plan.
    pub(crate) fn division_count(&self) -> usize {
        self.division
    }

    /// Takes the plan after so many divisions; it is to begin at `place`. Returns whether it does.
    /// In the air it is flown from the next row of the table on.
    pub(crate) fn accept_division(
        &mut self,
        plan: &VehiclePlan<W, G>,
        place: &Point,
        division: usize,
        in_air: bool,
    ) -> bool {
        let begins = self.starts_at(plan, place);
        if begins {
            self.begin_plan(plan);
            self.tasks.reset();
            (self.division, self.division_plan_ready) = (division, in_air);
        }
        begins
    }

    /// Flies on as planned after so many divisions: the last one could not be planned.
    pub(crate) fn keep_plan_after_division(&mut self, division: usize) {
        (self.division, self.division_plan_ready) = (division, false);
    }

    /// Commands what the task wants at this place of the path.
    pub(crate) fn step_task(&mut self, along: PathProgress, now: Instant, links: &mut Links) {
        if let Some(plan) = &self.plan {
            self.tasks.step(&plan.task, &plan.path, along, now, links);
        }
    }

    /// The photographed waypoints of the area.
    pub(crate) fn photographed(&self) -> &PhotographedWaypoints {
        &self.photographed
    }

    /// The photographed waypoints of the area, to be changed.
    pub(crate) fn photographed_mut(&mut self) -> &mut PhotographedWaypoints {
        &mut self.photographed
    }

    /// Notes the pictures that it has passed, `along_m` metres along its path.
    pub(crate) fn note_photographed(&mut self, along_m: f32) {
        let Some(plan) = &self.plan else { return };
        if let Task::Photograph(photographs) = &plan.task {
            let end = photographs.passed_count(&plan.path, along_m);
            let pictures = WaypointRange { first: self.pictures_before_rejoin, end };
            self.photographed.note_pictures(photographs, &plan.path, pictures);
        }
    }

    /// The vehicle leaves its pad to fly its plan.
    pub(crate) fn leave_pad(&mut self) {
        if let Some(VehiclePlan { task: Task::Photograph(photographs), .. }) = &self.plan {
            self.photographed.leave_pad(photographs);
        }
    }

    /// Takes the autopilot's answer to a command of the task's.
    pub(crate) fn handle_ack(&mut self, ack: &Ack, links: &mut Links) {
        self.tasks.handle_ack(ack, links);
    }

    /// Notes why the requested plan did not come.
    pub(crate) fn set_failure(&mut self, failure: PlanFailure) {
        self.failure = Some(failure);
    }

    /// Whether all pictures of its part were taken, `along_m` metres along its path or before it
    /// left that. A stretch is not all.
    pub(crate) fn has_all_pictures(&self, along_m: f32) -> bool {
        self.left_with_all_pictures.unwrap_or_else(|| {
            match self.plan.as_ref().map(|plan| (&plan.task, &plan.path)) {
                Some((Task::Photograph(photographs), path)) => {
                    !photographs.goes_on
                        && photographs.taken_count(path, along_m) == photographs.count(path)
                }
                Some(_) => true,
                None => false,
            }
        })
    }

    /// The vehicle leaves its path `along_m` metres along it: from now on places are those of
    /// another path.
    fn leave_path(&mut self, along_m: f32) {
        if self.left_with_all_pictures.is_none() {
            self.note_photographed(along_m);
            self.left_with_all_pictures = Some(self.has_all_pictures(along_m));
        }
    }

    /// Flies along another path, beside the shared plan, `along_m` metres along that, above the
    /// same ground.
    pub(crate) fn switch_to_detour(
        &mut self,
        way: &VehiclePlan<W, G>,
        along_m: f32,
        ground_m: Option<f32>,
    ) {
        self.leave_path(along_m);
        if let Some(plan) = &mut self.plan {
            plan.path = way.path.clone();
            plan.descent_m = way.descent_m;
            if let (Some(first), Some(ground_m)) = (way.path.waypoints().first(), ground_m) {
                plan.climb_m = libm::fmaxf(first.position.z - ground_m, 0.0);
            }
            plan.gates.clear();
            plan.depart_s = 0.0;
        }
    }

    /// Flies along its own path again, as it was planned, from `back_m` metres along it; it left
    /// that at `left_m`. Returns the number of pictures between, which do not count as taken: they
    /// show another place.
    pub(crate) fn resume_own_path(
        &mut self,
        plan: &VehiclePlan<W, G>,
        left_m: f32,
        back_m: f32,
    ) -> u32 {
        self.begin_plan(plan);
        let Task::Photograph(photographs) = &plan.task else { return 0 };
        let taken = |along_m: f32| photographs.taken_count(&plan.path, along_m);
        // The one at the very place is taken.
        self.pictures_before_rejoin = taken(back_m - TAKEN_M);
        self.pictures_before_rejoin.saturating_sub(taken(left_m))
    }

    /// Flies back, as `turn` makes the path, from `along_m` metres along it. Off the shared plan:
    /// neighbours keep clear of it as of a stranger.
    pub(crate) fn reverse_path(&mut self, along_m: f32, turn: impl FnOnce(&mut Path<W>)) {
        self.leave_path(along_m);
        if let Some(plan) = &mut self.plan {
            turn(&mut plan.path);
            plan.gates.clear();
            core::mem::swap(&mut plan.climb_m, &mut plan.descent_m);
        }
    }

    /// Finite, from `place`, and a path wherever there is a goal.
    pub(crate) fn starts_at(&self, plan: &VehiclePlan<W, G>, place: &Point) -> bool {
        let numbers = [plan.climb_m, plan.descent_m, plan.depart_s];
        let finite = numbers.iter().all(|h| h.is_finite() && *h >= 0.0)
            && plan.gates.iter().all(|g| !g.at_m.is_nan() && !g.until_m.is_nan());
        let first = plan.path.waypoints().first();
        let begins = first.is_some_and(|w| (w.position - place).length() < PATH_BEGIN_M);
        finite && (begins || !plan.task.leaves_pad())
    }
}
