//! Ways around: what is requested of the shell, and what becomes of its answer.

use planner_core::detour::{DetourRequest, KeepOutZone};
use planner_core::flight::VehiclePlan;
use planner_core::{Length, Point};

use super::Companion;
use crate::config::PlanFailure;
use crate::events::{Event, PlanKind};
use crate::guidance::GuidanceInputs;
use crate::mission::State;
use crate::swarm::detour::asking::RetryOutlook;
use crate::swarm::detour::flown::{DetourPurpose, RejoinPlace, RejoinPlaces};
use crate::swarm::view::DetourView;

/// A detour ends at most this far from the place where the vehicle is to come back to its path,
/// metres.
const MAX_REJOIN_ERROR_M: f32 = 0.2;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// The view that decisions about detours follow from.
    pub(crate) fn detour_view(&self) -> DetourView<'_, V, W, G> {
        DetourView {
            now: self.now,
            config: &self.config,
            mission: &self.mission,
            guidance: &self.guidance,
            telemetry: &self.telemetry,
            neighbours: &self.neighbours,
            scene: self.guidance_inputs(),
        }
    }

    /// Remembers, on entering a state, where it was before its position jumped.
    pub(super) fn save_place_before_jump(&mut self, to: State) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, .. } = self;
        let own = (neighbours.own_rank(), config.system_id);
        let scene = GuidanceInputs::new(mission.plan(), telemetry, own, detours.is_on_detour());
        let view =
            DetourView { now: *now, config, mission, guidance, telemetry, neighbours, scene };
        detours.save_place_before_jump(to, &view);
    }

    /// Scans for obstacles on the path, and checks whether the others stand.
    pub(super) fn scan_for_obstacles(&mut self) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, .. } = self;
        let own = (neighbours.own_rank(), config.system_id);
        let scene = GuidanceInputs::new(mission.plan(), telemetry, own, detours.is_on_detour());
        let view =
            DetourView { now: *now, config, mission, guidance, telemetry, neighbours, scene };
        if let Some(clear_at) = detours.scan_path(&view) {
            self.neighbours.mark_path_clear(clear_at);
        }
    }

    /// Requests a detour, or a path aside, from the shell.
    pub(super) fn request_detour(&mut self, aim: DetourPurpose) {
        self.detours.note_request(aim);
        self.guidance.reset_trap_timer();
        self.mission.forget_failure();
        // Full only if the shell does not drain; then the detour is late.
        let _ = self.events.push_back(Event::PlanRequested(PlanKind::Detour));
    }

    /// Requests a path aside, from under a vehicle that comes down; over a field another one leads
    /// back to its path from there.
    pub(super) fn request_detour_aside(&mut self, from: State) {
        // On its way back, or to a place to land at, it was to land already.
        if self.guidance.returning || self.detours.lands_at_end() {
            return self.request_detour(DetourPurpose::Landing);
        }
        self.request_detour(DetourPurpose::Aside(self.rejoin_after_aside(from)));
    }

    /// Where it comes back to its path over a field: where it left that before, or holds for a
    /// division, or stands; and beyond what blocks the path, if there is such a place and it did
    /// not promise to hold before.
    fn rejoin_after_aside(&self, from: State) -> Option<RejoinPlaces> {
        if !self.detours.keeps_to_plan_over_field(&self.detour_view()) {
            return None;
        }
        if let Some(places) = self.detours.rejoin_places() {
            return Some(places);
        }
        let holds = from == State::Dividing || self.is_holding_for_division();
        let promised_m = self.division_hold_m();
        let own =
            self.place_on_path(promised_m.filter(|_| holds).unwrap_or(self.guidance.along_m()))?;
        let beyond = if promised_m.is_none() { self.place_beyond_block() } else { None };
        Some(RejoinPlaces { own, beyond: beyond.unwrap_or(own) })
    }

    /// The first place of its path over a field beyond what blocks that.
    // Its body in both callers would take half a kilobyte of flash.
    #[inline(never)]
    fn place_beyond_block(&self) -> Option<RejoinPlace> {
        self.detours.rejoin_m(&self.detour_view()).and_then(|at_m| self.place_on_path(at_m))
    }

    #[inline(never)]
    fn place_on_path(&self, along_m: f32) -> Option<RejoinPlace> {
        let position = self.mission.plan()?.path.point_at(along_m)?;
        Some(RejoinPlace { along_m, position })
    }

    /// Requests a detour around the obstacle on its path over a field, and back to the path.
    pub(super) fn request_detour_back_to_path(&mut self) {
        let rejoin = match self.detours.is_beside_plan() {
            true => self.detours.rejoin_from_aside(&self.detour_view()),
            false => self.place_beyond_block(),
        };
        match rejoin {
            Some(back) => self.request_detour(DetourPurpose::Back(back)),
            None => {
                self.detours.note_no_rejoin_place(self.now);
                self.mission.set_failure(PlanFailure::Unreachable);
            }
        }
    }

    /// The detour that [`PlanKind::Detour`] requests of the shell; `None` if none is requested, or
    /// none can be planned. `tell` is given all keep-out zones. The next answer counts for this
    /// request: one that comes before the shell has read a request was to an older one, and is
    /// ignored.
    pub fn detour_request(&mut self, tell: impl FnMut(KeepOutZone)) -> Option<DetourRequest> {
        let replans = matches!(self.mission.state(), State::Replanning | State::PadReplanning);
        self.detours.note_request_read();
        if replans { self.detours.detour_request(&self.detour_view(), tell) } else { None }
    }

    /// Begins the requested detour.
    pub(super) fn begin_detour(&mut self, detour: &VehiclePlan<W, G>) {
        let along_m = self.guidance.along_m();
        let here = self.mission.plan().and_then(|plan| plan.path.point_at(along_m));
        let begins = here.is_some_and(|here| self.mission.starts_at(detour, &here));
        let purpose = self.detours.sought().filter(|_| begins);
        let ends = detour.path.waypoints().last().map(|last| last.position);
        let Some(purpose) = purpose.and_then(|purpose| self.checked_purpose(purpose, ends)) else {
            self.handle_detour_failure(PlanFailure::Invalid);
            return;
        };
        let progress_m = self.guidance.progress_m(self.mission.state(), &self.guidance_inputs());
        let ground_m = self.mission.plan().map(|plan| self.guidance.ground_m(plan));
        self.mission.switch_to_detour(detour, progress_m, ground_m);
        self.detours.begin_detour(purpose, progress_m, self.now, self.guidance.last_progress_at());
        self.neighbours.mark_avoided(self.now);
        // Whatever comes next, it is on this path: on the ground it is not on any.
        if self.mission.state() == State::Replanning {
            self.guidance.begin_path(self.now);
            self.guidance.ends_aside = self.detours.ends_aside();
        }
    }

    /// The purpose of a detour that has come and ends at `ends`; `None` if it may not be flown by
    /// now.
    fn checked_purpose(
        &self,
        purpose: DetourPurpose,
        ends: Option<Point>,
    ) -> Option<DetourPurpose> {
        // A promise made meanwhile is along the vehicle's own path.
        let promised_m = self.division_hold_m();
        match purpose {
            DetourPurpose::Back(back) => {
                // An answer may be late, and be for another request.
                let leads_back = (ends? - back.position).length() < MAX_REJOIN_ERROR_M;
                (leads_back && promised_m.is_none()).then_some(purpose)
            }
            // From aside it comes back no further than there.
            DetourPurpose::Aside(Some(places)) => {
                let allowed =
                    |place: &RejoinPlace| promised_m.is_none_or(|at_m| place.along_m <= at_m);
                let holds_at_m =
                    promised_m.filter(|_| !allowed(&places.own) || self.is_holding_for_division());
                let own =
                    holds_at_m.and_then(|at_m| self.place_on_path(at_m)).unwrap_or(places.own);
                let beyond = if allowed(&places.beyond) { places.beyond } else { own };
                Some(DetourPurpose::Aside(Some(RejoinPlaces { own, beyond })))
            }
            _ => Some(purpose),
        }
    }

    /// The requested detour does not exist.
    pub(super) fn handle_detour_failure(&mut self, failure: PlanFailure) {
        self.mission.set_failure(failure);
        let outlook = if self.neighbours.any_comes_down_unheard(self.now) {
            RetryOutlook::Settles
        } else if failure != PlanFailure::Late && self.neighbours.are_all_down(self.now) {
            RetryOutlook::Closed
        } else {
            RetryOutlook::Open
        };
        self.detours.note_failure(self.guidance.along_m(), outlook, self.now);
    }
}
