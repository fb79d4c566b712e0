//! Ways around: what is requested of the shell, and what becomes of its answer.

use planner_core::detour::{DetourRequest, KeepOff};
use planner_core::flight::VehiclePlan;

use super::Companion;
use crate::config::PlanFailure;
use crate::events::{Event, Wanted};
use crate::guidance::Scene;
use crate::mission::State;
use crate::swarm::detour::Aim;
use crate::swarm::detour::asking::Outlook;
use crate::swarm::view::View;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// The view that decisions about detours follow from.
    pub(crate) fn view(&self) -> View<'_, V, W, G> {
        View {
            now: self.now,
            config: &self.config,
            mission: &self.mission,
            guidance: &self.guidance,
            telemetry: &self.telemetry,
            neighbours: &self.neighbours,
            scene: self.scene(),
        }
    }

    /// Remembers, on entering a state, where it was before its position jumped.
    pub(super) fn mark_place(&mut self, to: State) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, .. } = self;
        let own = (neighbours.own_rank(), config.system_id);
        let scene = Scene::new(mission.plan(), telemetry, own, detours.is_flying());
        let view = View { now: *now, config, mission, guidance, telemetry, neighbours, scene };
        detours.mark_place(to, &view);
    }

    /// Looks for what blocks the path, and whether the others stand.
    pub(super) fn look_around(&mut self) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, .. } = self;
        let own = (neighbours.own_rank(), config.system_id);
        let scene = Scene::new(mission.plan(), telemetry, own, detours.is_flying());
        let view = View { now: *now, config, mission, guidance, telemetry, neighbours, scene };
        if let Some(clear_at) = detours.look_around(&view) {
            self.neighbours.found_clear(clear_at);
        }
    }

    /// Asks the shell for a way around, or just aside.
    pub(super) fn request_detour(&mut self, aim: Aim) {
        self.detours.request(aim);
        self.guidance.forget_trap();
        self.mission.forget_failure();
        // Full only if the shell does not drain; then the way around is late.
        let _ = self.events.push_back(Event::PlanRequested(Wanted::Detour));
    }

    /// Asks the shell for a way around what blocks its path over a field, and back to that.
    pub(super) fn request_beyond(&mut self) {
        let back_m = self.detours.returns_m(&self.view());
        if self.detours.beside.seek(back_m) {
            self.request_detour(Aim::Beyond);
        } else {
            self.detours.beside.miss(self.now);
            self.mission.fail(PlanFailure::Unreachable);
        }
    }

    /// The detour that [`Wanted::Detour`] requests of the shell; `None` if none is requested, or
    /// none can be planned. `tell` is given all keep-out zones.
    pub fn detour(&self, tell: impl FnMut(KeepOff)) -> Option<DetourRequest> {
        let replans = matches!(self.mission.state(), State::Replanning | State::PadReplanning);
        if replans { self.detours.requested(&self.view(), tell) } else { None }
    }

    /// Takes the way around.
    pub(super) fn take_detour(&mut self, detour: &VehiclePlan<W, G>) {
        let along_m = self.guidance.along_m();
        let here = self.mission.plan().and_then(|plan| plan.path.point_at(along_m));
        // A promise made meanwhile is along the vehicle's own path.
        let beside = self.detours.beside;
        let bound = beside.back_m().is_some() && !beside.flies() && !self.is_undivided();
        if bound || !here.is_some_and(|here| self.mission.begins_at(detour, &here)) {
            self.miss_detour(PlanFailure::Invalid);
            return;
        }
        let progress_m = self.guidance.progress_m(self.mission.state(), &self.scene());
        let ground_m = self.mission.plan().map(|plan| self.guidance.ground_m(plan));
        self.mission.leave_plan(detour, progress_m, ground_m);
        self.detours.take(progress_m, self.now, self.guidance.progress_at());
        self.neighbours.avoid(self.now);
    }

    /// The requested detour does not exist.
    pub(super) fn miss_detour(&mut self, failure: PlanFailure) {
        self.mission.fail(failure);
        let outlook = if self.neighbours.any_comes_down_unheard(self.now) {
            Outlook::Settles
        } else if failure != PlanFailure::Late && self.neighbours.all_down(self.now) {
            Outlook::Closed
        } else {
            Outlook::Open
        };
        self.detours.miss(self.guidance.along_m(), outlook, self.now);
    }
}
