//! Detours: requests them from the shell, and handles the shell's answers.

use planner_core::detour::{DetourRequest, KeepOutZone};
use planner_core::flight::VehiclePlan;
use planner_core::{Length, Point};

use super::Companion;
use crate::config::PlanFailure;
use crate::events::{Event, PlanKind};
use crate::guidance::GuidanceInputs;
use crate::replanning::detour::Detours;
use crate::replanning::detour::path_kind::{DetourPurpose, RejoinPlace, RejoinPlaces};
use crate::replanning::detour::searches::RetryOutlook;
use crate::replanning::view::DetourView;
use crate::state::State;

/// Greatest distance between the end of a detour and the place where the vehicle is to come back to
/// its path, metres: a detour that ends further away is refused.
const MAX_REJOIN_ERROR_M: f32 = 0.2;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// References to the companion's parts by which decisions about detours are made.
    pub(crate) fn detour_view(&self) -> DetourView<'_, V, W, G> {
        DetourView {
            now: self.now,
            config: &self.config,
            mission: &self.mission,
            guidance: &self.guidance,
            telemetry: &self.telemetry,
            neighbours: &self.neighbours,
            guidance_inputs: self.guidance_inputs(),
        }
    }

    /// To be called on entering state `to`. On entering `PositionLost` because of a jump, the
    /// reference's place on the path is kept as the place to report to others; on entering a state
    /// that trusts the position again, it is forgotten.
    pub(super) fn update_place_before_jump(&mut self, to: State) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, .. } = self;
        let own = (neighbours.own_rank(), config.system_id);
        let guidance_inputs =
            GuidanceInputs::new(mission.plan(), telemetry, own, detours.path_source());
        let view = DetourView {
            now: *now,
            config,
            mission,
            guidance,
            telemetry,
            neighbours,
            guidance_inputs,
        };
        detours.update_place_before_jump(to, &view);
    }

    /// Continues the scan of the path for obstacles and for vehicles out of the plan, and decides
    /// whether the vehicle is blocked and whether it claims the turn to fly a detour.
    pub(super) fn scan_for_obstacles(&mut self) {
        let Self { now, config, mission, guidance, telemetry, neighbours, detours, timers, .. } =
            self;
        let own = (neighbours.own_rank(), config.system_id);
        let guidance_inputs =
            GuidanceInputs::new(mission.plan(), telemetry, own, detours.path_source());
        let view = DetourView {
            now: *now,
            config,
            mission,
            guidance,
            telemetry,
            neighbours,
            guidance_inputs,
        };
        if let Some(clear_at) = detours.scan_path(&view, timers) {
            self.neighbours.mark_path_clear(clear_at);
        }
    }

    /// Requests from the shell a path for this purpose: a detour, or a path aside, home or back.
    pub(super) fn request_detour(&mut self, aim: DetourPurpose) {
        self.detours.note_request(aim);
        self.guidance.reset_trap_timer();
        self.mission.forget_plan_failure();
        // The queue is full only if the shell does not drain the events; then the mission table
        // makes the request again later.
        let _ = self.events.push_back(Event::PlanRequested(PlanKind::Detour));
    }

    /// Requests a path aside, out of the column under a vehicle that descends; `from`: the state
    /// before. In a coverage mission a path requested later leads back from there.
    pub(super) fn request_detour_aside(&mut self, from: State) {
        // A vehicle that flies back, or to a landing place aside, seeks a place aside to land at.
        if self.guidance.returning || self.detours.lands_at_end() {
            return self.request_detour(DetourPurpose::LandingAside);
        }
        self.request_detour(DetourPurpose::Aside(self.rejoin_after_aside(from)));
    }

    /// In a coverage mission, two places on its path to which a vehicle that goes aside may come
    /// back. On a detour these are the places of that detour. Otherwise the first is where the
    /// vehicle holds for a division, or else its reference; the second is the first free place
    /// beyond what blocks the path, or equal to the first if there is none or the vehicle has
    /// promised to hold for a division. `None` for a vehicle that does not come back.
    fn rejoin_after_aside(&self, from: State) -> Option<RejoinPlaces> {
        if !self.detours.keeps_to_plan_over_area(&self.detour_view()) {
            return None;
        }
        if let Some(places) = self.detours.rejoin_places() {
            return Some(places);
        }
        let holds = from == State::Dividing || self.is_holding_for_division();
        let promised_m = self.division_hold_m();
        let own = self.place_on_path(
            promised_m.filter(|_| holds).unwrap_or(self.guidance.reference_along_m()),
        )?;
        let beyond = if promised_m.is_none() { self.place_beyond_block() } else { None };
        Some(RejoinPlaces { first_choice: own, beyond_block: beyond.unwrap_or(own) })
    }

    /// The first free place along its path in a coverage mission beyond what blocks the path.
    // Inlined into both callers it would take half a kilobyte of flash.
    #[inline(never)]
    fn place_beyond_block(&self) -> Option<RejoinPlace> {
        self.detours.first_rejoin_m(&self.detour_view()).and_then(|at_m| self.place_on_path(at_m))
    }

    /// The place `along_m` metres along the path that is flown now; `None` without a path.
    #[inline(never)]
    fn place_on_path(&self, along_m: f32) -> Option<RejoinPlace> {
        let position = self.mission.plan()?.path.point_at(along_m)?;
        Some(RejoinPlace { along_m, position })
    }

    /// Requests a detour around the obstacle on its path in a coverage mission, which leads back to
    /// the path.
    pub(super) fn request_detour_back_to_path(&mut self) {
        let rejoin = match self.detours.is_beside_plan() {
            true => self.detours.rejoin_place_from_aside(&self.detour_view()),
            false => self.place_beyond_block(),
        };
        match rejoin {
            Some(back) => self.request_detour(DetourPurpose::Rejoin(back)),
            None => {
                Detours::note_no_rejoin_place(self.now, &mut self.timers);
                self.mission.set_plan_failure(PlanFailure::Unreachable);
            }
        }
    }

    /// The detour that [`PlanKind::Detour`] requests from the shell; `None` if none is requested,
    /// or none can be planned. `visit` is called with each keep-out zone. The next answer counts
    /// for this request: an answer that comes before the shell has read the request belongs to an
    /// older one and is ignored.
    pub fn detour_request(&mut self, visit: impl FnMut(KeepOutZone)) -> Option<DetourRequest> {
        let replans = self.mission.state().waits_for_detour();
        self.detours.note_request_read();
        if replans { self.detours.detour_request(&self.detour_view(), visit) } else { None }
    }

    /// Switches to the detour that the shell has planned, or refuses it if it starts or ends
    /// elsewhere than requested, or promises made since forbid it.
    pub(super) fn adopt_detour(&mut self, detour: &VehiclePlan<W, G>) {
        let here = self.detours.start_of_detour(&self.detour_view());
        let begins = here.is_some_and(|here| self.mission.is_plan_valid_from(detour, &here));
        let purpose = self.detours.requested_purpose().filter(|_| begins);
        let ends = detour.path.waypoints().last().map(|last| last.position);
        let Some(purpose) = purpose.and_then(|purpose| self.checked_purpose(purpose, ends)) else {
            self.handle_detour_failure(PlanFailure::Invalid);
            return;
        };
        let progress_m =
            self.guidance.reported_progress_m(self.mission.state(), &self.guidance_inputs());
        let ground_m = self.planned_ground_m();
        let lowest_m = self
            .mission
            .plan()
            .map_or(ground_m, |plan| self.guidance.lowest_planned_ground_m(plan));
        self.mission.switch_to_detour(detour, progress_m);
        self.mission.note_ground_below_start(ground_m);
        if purpose.is_aside() {
            self.mission.note_ground_below_end(lowest_m);
        }
        let progress_at = self.guidance.last_progress_at();
        self.detours.adopt_detour(purpose, progress_m, self.now, progress_at, &mut self.timers);
        self.neighbours.mark_out_of_plan_avoided(self.now);
        // In the air the vehicle follows the detour from its start. On the pad the climb comes
        // first.
        if self.mission.state() == State::Replanning {
            self.guidance.begin_path(self.now);
            if self.detours.ends_away_from_goal() {
                self.guidance.note_end_away_from_goal();
            }
        }
    }

    /// The purpose for which a detour that ends at `ends` may be flown; `None` if it ends elsewhere
    /// than requested, or promises made since forbid it.
    fn checked_purpose(
        &self,
        purpose: DetourPurpose,
        ends: Option<Point>,
    ) -> Option<DetourPurpose> {
        // Where along its own path the vehicle has promised, perhaps since the request, to hold for
        // a division.
        let promised_m = self.division_hold_m();
        match purpose {
            DetourPurpose::Rejoin(back) => {
                // A late answer may belong to another request, and end elsewhere.
                let ends_on_plan_path = (ends? - back.position).length() < MAX_REJOIN_ERROR_M;
                (ends_on_plan_path && promised_m.is_none()).then_some(purpose)
            }
            // From aside the vehicle comes back to its path no further than where it promised to
            // hold.
            DetourPurpose::Aside(Some(places)) => {
                let allowed =
                    |place: &RejoinPlace| promised_m.is_none_or(|at_m| place.along_m <= at_m);
                let holds_at_m = promised_m
                    .filter(|_| !allowed(&places.first_choice) || self.is_holding_for_division());
                let own = holds_at_m
                    .and_then(|at_m| self.place_on_path(at_m))
                    .unwrap_or(places.first_choice);
                let beyond = if allowed(&places.beyond_block) { places.beyond_block } else { own };
                Some(DetourPurpose::Aside(Some(RejoinPlaces {
                    first_choice: own,
                    beyond_block: beyond,
                })))
            }
            _ => Some(purpose),
        }
    }

    /// Handles that the shell has found no detour, none in time, or none that can be flown: decides
    /// whether and when another search makes sense.
    pub(super) fn handle_detour_failure(&mut self, failure: PlanFailure) {
        self.mission.set_plan_failure(failure);
        let outlook = if self.neighbours.any_comes_down_unheard(self.now) {
            RetryOutlook::SilentVehicleComesDown
        } else if failure != PlanFailure::Late && self.neighbours.are_all_out_or_down(self.now) {
            RetryOutlook::NoneWillMove
        } else if failure == PlanFailure::Unreachable {
            RetryOutlook::OthersMayMove
        } else {
            RetryOutlook::NotSearched
        };
        let along_m = self.guidance.reference_along_m();
        self.detours.note_failure(along_m, outlook, self.now, &mut self.timers);
    }
}
