//! State of one vehicle's mission: the table's state and the states that it interrupted, pending
//! commands, and the vehicle's plan.

use planner_core::Point;
use planner_core::detour::DetourGoal;
use planner_core::flight::{Task, VehiclePlan, WaypointRange};

use crate::autopilot::telemetry::Ack;
use crate::config::PlanFailure;
use crate::link::Links;
use crate::link::commands::Command;
use crate::mission::pending::{self, PendingCommands};
use crate::mission::photographed::PhotographedWaypoints;
use crate::mission::task::{PathProgress, TaskCommands};
use crate::mission::waits::{BarredStart, Waits};
use crate::mission::{GuardInputs, InterruptedStates, State, TargetState, TransitionRow};
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

mod paths;

/// The mission of one vehicle, whose plan has at most `W` waypoints and `G` gates.
#[derive(Clone, Debug)]
pub(crate) struct Mission<const W: usize, const G: usize> {
    state: State,
    /// When `state` was entered.
    entered_at: Instant,
    /// When MISSION_START took effect (`Ready` to `Scheduled`): the schedule's times count from
    /// then.
    started_at: Instant,
    /// When a pilot last took the vehicle over; again from `PilotReturned` does not count.
    pilot_took_over_at: Instant,
    /// The states that a pause and a loss interrupted.
    interrupted: InterruptedStates,
    /// Commands of the operator that the table has not carried out yet.
    pending: PendingCommands,
    /// The autopilot's `custom_mode` when the mission was started.
    mode_at_start: u32,
    /// First point of the vehicle's path, above its pad.
    path_start: Point,
    /// The vehicle's plan, with the path that it flies now, which may be a detour or the way back.
    plan: Option<VehiclePlan<W, G>>,
    /// Once the vehicle has left the path of its plan: whether it had taken all pictures of its
    /// share before. `None` while it is on that path.
    left_with_all_pictures: Option<bool>,
    /// Number of pictures of the path up to the place where the vehicle last came back from a
    /// detour: those taken before were noted when it left the path.
    pictures_before_rejoin: u32,
    /// Where the vehicle's plan ends: the place above the pad, the height of the path that leads
    /// there, and the length of the descent there, metres.
    home: (Point, f32, f32),
    /// Why the shell did not return the last plan or detour requested; `None` if it has, or has not
    /// answered yet.
    plan_failure: Option<PlanFailure>,
    /// Since when the estimate's error bound has exceeded what the margin leaves for it even at
    /// crawl speed; `None` while it fits.
    imprecise_at_crawl_since: Option<Instant>,
    waits: Waits,
    task_commands: TaskCommands,
    /// Waypoints of the area that are photographed.
    area_photographed: PhotographedWaypoints,
    /// Number of the fleet's committed divisions that the plan takes into account.
    division_count: usize,
    /// Whether the plan after the last division has come while the vehicle held for it
    /// (`Dividing`), and is not flown yet.
    division_plan_ready: bool,
    /// Hash of the inputs of the division that the shell was asked for and has not answered.
    requested_division_hash: Option<u32>,
}

impl<const W: usize, const G: usize> Mission<W, G> {
    /// A mission whose autopilot was not heard yet; `start` is the first point of the vehicle's
    /// path, above its pad.
    pub(crate) fn new(start: Point) -> Self {
        Self {
            state: State::WaitAutopilot,
            entered_at: Instant::ZERO,
            started_at: Instant::ZERO,
            pilot_took_over_at: Instant::ZERO,
            interrupted: InterruptedStates::default(),
            pending: PendingCommands::default(),
            mode_at_start: 0,
            path_start: start,
            plan: None,
            left_with_all_pictures: None,
            pictures_before_rejoin: 0,
            home: (start, start.z, 0.0),
            plan_failure: None,
            imprecise_at_crawl_since: None,
            waits: Waits::default(),
            task_commands: TaskCommands::default(),
            area_photographed: PhotographedWaypoints::default(),
            division_count: 0,
            division_plan_ready: false,
            requested_division_hash: None,
        }
    }

    /// State of the mission.
    pub(crate) fn state(&self) -> State {
        self.state
    }

    /// When the state was entered.
    pub(crate) fn entered_at(&self) -> Instant {
        self.entered_at
    }

    /// Time since the state was entered.
    pub(crate) fn time_in_state(&self, now: Instant) -> Duration {
        now - self.entered_at
    }

    /// When MISSION_START took effect (`Ready` to `Scheduled`).
    pub(crate) fn started_at(&self) -> Instant {
        self.started_at
    }

    /// Time since a pilot last took the vehicle over.
    pub(crate) fn time_since_pilot_takeover(&self, now: Instant) -> Duration {
        now - self.pilot_took_over_at
    }

    /// The state of the flight without pause and loss: the current state or the one that they
    /// interrupted.
    pub(crate) fn uninterrupted_state(&self) -> State {
        self.interrupted.uninterrupted_state(self.state)
    }

    /// The state to which the mission returns from the current one.
    pub(crate) fn interrupted_state(&self) -> State {
        self.interrupted.state_to_resume(self.state)
    }

    /// Commands of the operator that have not been carried out yet.
    pub(crate) fn pending(&self) -> &PendingCommands {
        &self.pending
    }

    /// The autopilot's `custom_mode` when the mission was started.
    pub(crate) fn mode_at_start(&self) -> u32 {
        self.mode_at_start
    }

    /// First point of the vehicle's path, above its pad.
    pub(crate) fn path_start(&self) -> Point {
        self.path_start
    }

    /// Place of the vehicle on its pad: the climb's height below the first point of the path.
    pub(crate) fn pad_position(&self) -> Point {
        self.path_start - Point::new(0.0, 0.0, self.climb_m())
    }

    /// The vehicle's plan; `None` until the shell has returned one. Its path is the one flown now:
    /// a detour, or the way back, replaces the plan's own path there.
    pub(crate) fn plan(&self) -> Option<&VehiclePlan<W, G>> {
        self.plan.as_ref()
    }

    /// Height of the climb from the pad to the path, metres; 0 without a plan.
    pub(crate) fn climb_m(&self) -> f32 {
        self.plan.as_ref().map_or(0.0, |plan| plan.climb_m)
    }

    /// Why the shell did not return the last plan or detour requested; `None` if it has, or not yet
    /// answered.
    pub(crate) fn plan_failure(&self) -> Option<PlanFailure> {
        self.plan_failure
    }

    /// Whether `later_by` (0 unless a neighbour is late) has passed since the plan's departure
    /// time. Until then the vehicle waits on its pad; later waits are at gates in the air.
    pub(crate) fn departure_due(&self, now: Instant, later_by: Duration) -> bool {
        let depart_s = self.plan.as_ref().map_or(0.0, |plan| plan.depart_s);
        (now - self.started_at).as_secs_f32() >= depart_s + later_by.as_secs_f32()
    }

    /// Time for which the estimate's error bound has exceeded what the margin leaves for it even at
    /// crawl speed.
    pub(crate) fn imprecise_at_crawl_for(&self, now: Instant) -> Duration {
        self.imprecise_at_crawl_since.map_or(Duration::default(), |since| now - since)
    }

    /// Notes the share of the cruise speed at which the estimate's error bound fits into the
    /// margin; 0 if it does not even at crawl speed.
    pub(crate) fn note_estimate_speed_share(&mut self, share: f32, now: Instant) {
        self.imprecise_at_crawl_since =
            if share > 0.0 { None } else { self.imprecise_at_crawl_since.or(Some(now)) };
    }

    /// To be called each step with the vehicle that has not started and that this one waits for, 0
    /// for none. Returns whether the wait is to be reported now.
    pub(crate) fn should_report_wait(&mut self, id: u8, now: Instant, timers: &mut Timers) -> bool {
        self.waits.unstarted.should_report(id, now, timers)
    }

    /// To be called each step in which a vehicle or an obstacle bars the start.
    pub(crate) fn note_start_barred(&mut self, now: Instant) {
        self.waits.barred_start.note_barred(now);
    }

    /// To be called each step in which nothing bars the start.
    pub(crate) fn note_start_free(&mut self, now: Instant) {
        self.waits.barred_start.note_free(now);
    }

    /// Time for which the start of this vehicle has been barred.
    pub(crate) fn start_barred_for(&self, now: Instant) -> Duration {
        self.waits.barred_start.barred_for(now)
    }

    /// Stores an operator's command for the mission table. Returns its `MAV_RESULT`; `None` for a
    /// command that is not one of the mission's.
    pub(crate) fn handle_command(&mut self, inputs: &GuardInputs, command: &Command) -> Option<u8> {
        pending::apply_command(&mut self.pending, self.state, inputs, command)
    }

    /// Changes the state as a row says. `after_search` as in
    /// [`InterruptedStates::record_interruption`]. Returns the states before and after.
    pub(crate) fn enter_state(
        &mut self,
        row: &TransitionRow,
        custom_mode: u32,
        after_search: State,
        now: Instant,
    ) -> (State, State) {
        let from = self.state;
        let to = match row.to {
            TargetState::State(to) => to,
            TargetState::Interrupted => self.interrupted.state_to_resume(from),
        };
        self.interrupted.record_interruption(from, to, after_search);
        (self.state, self.entered_at) = (to, now);
        if (from, to) == (State::Ready, State::Scheduled) {
            (self.started_at, self.mode_at_start) = (now, custom_mode);
        }
        if to == State::PilotControl && from != State::PilotReturned {
            self.pilot_took_over_at = now;
        }
        self.pending.clear_carried_out(row, to);
        (from, to)
    }

    /// The STATUSTEXT that names the interrupted state; `None` if the change interrupts none.
    pub(crate) fn interruption_text(&self, from: State, to: State) -> Option<&'static str> {
        self.interrupted.interruption_text(from, to)
    }

    /// Forgets plan and failure, since a plan of the whole mission is requested.
    pub(crate) fn forget_plan(&mut self) {
        (self.plan, self.plan_failure, self.division_count, self.left_with_all_pictures) =
            (None, None, 0, None);
        (self.division_plan_ready, self.requested_division_hash) = (false, None);
        self.waits.barred_start = BarredStart::default();
        self.task_commands.begin_plan();
    }

    /// Forgets the last failure, since a detour is requested; the plan stays until the detour
    /// comes.
    pub(crate) fn forget_plan_failure(&mut self) {
        self.plan_failure = None;
    }

    /// Stores the plan that the shell returned; one that is invalid or does not begin at the
    /// vehicle's path start is stored as a failure.
    pub(crate) fn set_plan(&mut self, plan: &VehiclePlan<W, G>) {
        match self.is_plan_valid_from(plan, &self.path_start) {
            true => self.begin_plan(plan),
            false => self.plan_failure = Some(PlanFailure::Invalid),
        }
    }

    /// Takes over a valid plan in place of the former one.
    // Not inlined: each copy would take a kilobyte of flash.
    #[inline(never)]
    fn begin_plan(&mut self, plan: &VehiclePlan<W, G>) {
        self.plan = Some(plan.clone());
        (self.left_with_all_pictures, self.pictures_before_rejoin) = (None, 0);
        if let [before @ .., over] = plan.path.waypoints() {
            let down = before.last().unwrap_or(over);
            self.home = (over.position, down.position.z, plan.descent_m);
        }
    }

    /// Where the vehicle's plan ends, as a goal that is reached without a roadmap, and the length
    /// of the descent there, metres.
    pub(crate) fn home_goal(&self) -> (DetourGoal, f32) {
        let (over, layer_m, descent_m) = self.home;
        (DetourGoal::Point { end: over, layer_z_m: layer_m }, descent_m)
    }

    /// Whether the plan after the last division has come while the vehicle held for it
    /// (`Dividing`), and is not flown yet.
    pub(crate) fn is_division_plan_ready(&self) -> bool {
        self.division_plan_ready
    }

    /// Notes that the vehicle flies the plan after the last division from now on.
    pub(crate) fn note_division_plan_begun(&mut self) {
        self.division_plan_ready = false;
    }

    /// Opens a request for the division with this hash, for the shell to answer, and returns true.
    /// False while another request is open, whatever its hash: until the shell has answered (an
    /// answer does not name its request), or `again` has passed.
    pub(crate) fn open_division_request_if_due(
        &mut self,
        hash: u32,
        now: Instant,
        again: Duration,
        timers: &mut Timers,
    ) -> bool {
        let asks =
            self.requested_division_hash.is_none() || timers.is_due(Timer::DivisionRequest, now);
        if asks {
            self.requested_division_hash = Some(hash);
            timers.set(Timer::DivisionRequest, now + again);
        }
        asks
    }

    /// Closes the open request for a division. Returns whether it was for the one with this hash.
    pub(crate) fn close_division_request(&mut self, hash: u32) -> bool {
        self.requested_division_hash.take().is_some_and(|requested| requested == hash)
    }

    /// Number of the fleet's committed divisions that the plan takes into account.
    pub(crate) fn division_count(&self) -> usize {
        self.division_count
    }

    /// Stores the plan after `division` divisions if it is valid and begins at `place`; returns
    /// whether it does. A vehicle in the air flies it once a row of the table says so.
    pub(crate) fn accept_division_plan(
        &mut self,
        plan: &VehiclePlan<W, G>,
        place: &Point,
        division: usize,
    ) -> bool {
        let begins = self.is_plan_valid_from(plan, place);
        if begins {
            self.begin_plan(plan);
            self.task_commands.begin_plan();
            self.division_count = division;
            self.division_plan_ready = self.state == State::Dividing;
        }
        begins
    }

    /// Keeps the present plan although `division` divisions count now: the last one could not be
    /// planned.
    pub(crate) fn keep_plan_after_division(&mut self, division: usize) {
        (self.division_count, self.division_plan_ready) = (division, false);
    }

    /// Sends the task's commands to the autopilot that are due at this place of the path. Returns
    /// whether the vehicle leaves its path at this place, and takes no more pictures.
    pub(crate) fn step_task(
        &mut self,
        along: PathProgress,
        now: Instant,
        timers: &mut Timers,
        links: &mut Links,
    ) -> bool {
        let Some(plan) = &self.plan else { return false };
        let leaves_path = self.task_commands.step(&plan.task, &plan.path, along);
        self.task_commands.send_commands(now, timers, links);
        leaves_path
    }

    /// The photographed waypoints of the area.
    pub(crate) fn photographed(&self) -> &PhotographedWaypoints {
        &self.area_photographed
    }

    /// The photographed waypoints of the area, to be changed.
    pub(crate) fn photographed_mut(&mut self) -> &mut PhotographedWaypoints {
        &mut self.area_photographed
    }

    /// Notes as photographed the pictures of the plan that the vehicle has passed, `along_m` metres
    /// along its path.
    pub(crate) fn note_photographed(&mut self, along_m: f32) {
        let Some(plan) = &self.plan else { return };
        if let Task::Photograph(photographs) = &plan.task {
            let end = photographs.certainly_taken_count(&plan.path, along_m);
            let pictures = WaypointRange { first: self.pictures_before_rejoin, end };
            self.area_photographed.note_pictures(photographs, &plan.path, pictures);
        }
    }

    /// Notes in the record of photographed waypoints that the vehicle leaves its pad to fly its
    /// plan.
    pub(crate) fn note_pad_left(&mut self) {
        if let Some(VehiclePlan { task: Task::Photograph(photographs), .. }) = &self.plan {
            self.area_photographed.note_pad_left(photographs);
        }
    }

    /// Handles the autopilot's COMMAND_ACK of a command of the task.
    pub(crate) fn handle_ack(&mut self, ack: &Ack, links: &mut Links) {
        self.task_commands.handle_ack(ack, links);
    }

    /// Stores why the shell did not return the requested plan or detour.
    pub(crate) fn set_plan_failure(&mut self, failure: PlanFailure) {
        self.plan_failure = Some(failure);
    }

    /// Whether all pictures of the vehicle's share are taken: `along_m` metres along its path, or
    /// before it left that path. False where the path is only the first part of its route; true for
    /// a task without pictures.
    pub(crate) fn has_all_pictures(&self, along_m: f32) -> bool {
        self.left_with_all_pictures.unwrap_or_else(|| {
            match self.plan.as_ref().map(|plan| (&plan.task, &plan.path)) {
                Some((Task::Photograph(photographs), path)) => {
                    !photographs.is_first_part
                        && photographs.taken_count(path, along_m) == photographs.planned_count(path)
                }
                Some(_) => true,
                None => false,
            }
        })
    }

    /// Notes pictures, and whether all are taken, as the vehicle leaves the path of its plan
    /// `along_m` metres along it: from now on distances are along another path.
    fn note_path_left(&mut self, along_m: f32) {
        if self.left_with_all_pictures.is_none() {
            self.note_photographed(along_m);
            self.left_with_all_pictures = Some(self.has_all_pictures(along_m));
        }
    }
}
