//! Which path a vehicle flies, and whether it comes back from there to its plan's path.
//!
//! Constant work but for [`Detours::rejoin_place_from_aside`], once a search.

use planner_core::Point;
use planner_core::detour::{self, KeepOutZone};

use super::beside::BLOCKED_BEYOND_STOP_M;
use super::path_kind::{DetourPurpose, PathKind, RejoinPlace, RejoinPlaces};
use super::{Detours, beside};
use crate::guidance::PathSource;
use crate::replanning::view::DetourView;
use crate::time::{Duration, Instant};
use crate::timers::Timers;

/// Time for which a vehicle aside waits until the place where it left its path is free, seconds:
/// less than the time after which it flies home.
const MAX_BARRED_WAIT_S: u64 = 60;
/// Time for which a vehicle aside seeks a way to the place where it left its path, once that is
/// free, seconds.
const MAX_REJOIN_SEARCH_S: u64 = 90;

impl Detours {
    /// Whether the path that is flown is not the plan's.
    pub(crate) fn is_on_detour(&self) -> bool {
        self.path_kind.is_detour()
    }

    /// Where the path that is flown comes from, for guidance.
    pub(crate) fn path_source(&self) -> PathSource {
        if self.is_on_detour() { PathSource::Detour } else { PathSource::SharedPlan }
    }

    /// Purpose of the path that is requested from the shell; `None` if none is.
    pub(crate) fn requested_purpose(&self) -> Option<DetourPurpose> {
        self.requested_purpose
    }

    /// Forgets the request for a path: the vehicle stays on the path that it flies.
    pub(crate) fn cancel_request(&mut self) {
        (self.requested_purpose, self.request_read, self.detour_ready) = (None, false, false);
    }

    /// Whether the vehicle flies straight home in a coverage mission, stops for that, or seeks the
    /// way.
    pub(crate) fn is_homeward(&self) -> bool {
        self.home.is_seeking() || self.path_kind == PathKind::Detour(DetourPurpose::Home)
    }

    /// Whether the path that is flown does not end at the vehicle's goal, but at a place to its
    /// side or back on the plan's path.
    pub(crate) fn ends_away_from_goal(&self) -> bool {
        self.path_kind
            .purpose()
            .is_some_and(|purpose| purpose.is_aside() || purpose.returns_to_plan())
    }

    /// Whether the vehicle flies, in a coverage mission, a detour back to its plan's path, or aside
    /// with a place there to come back to.
    pub(crate) fn is_beside_plan(&self) -> bool {
        self.path_kind.purpose().is_some_and(|purpose| purpose.returns_to_plan())
    }

    /// Whether the detour that is flown ends on the plan's path in a coverage mission.
    pub(crate) fn ends_on_plan_path(&self) -> bool {
        matches!(self.path_kind, PathKind::Detour(DetourPurpose::Rejoin(_)))
    }

    /// Places where the vehicle is to come back to its path in a coverage mission; `None` if it
    /// does not come back.
    pub(crate) fn rejoin_places(&self) -> Option<RejoinPlaces> {
        match self.path_kind {
            PathKind::Detour(DetourPurpose::Aside(places)) => places,
            _ => {
                self.rejoin_place().map(|own| RejoinPlaces { first_choice: own, beyond_block: own })
            }
        }
    }

    /// Place where the vehicle is to come back to its path in a coverage mission; `None` if it does
    /// not come back.
    pub(crate) fn rejoin_place(&self) -> Option<RejoinPlace> {
        self.path_kind.purpose().and_then(|purpose| purpose.rejoin_place())
    }

    /// Place where a vehicle aside returns to its path now: where it left the path; or beyond the
    /// block, once the first place has been barred, or no way to it was found, for too long. `None`
    /// while the vehicle waits for the first place to be free.
    pub(crate) fn rejoin_place_from_aside<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<RejoinPlace> {
        let RejoinPlaces { first_choice: own, beyond_block: beyond } = self.rejoin_places()?;
        let barred = own != beyond && beside::is_barred(view, self.obstacles.all(), &own.position);
        let most_s = if barred { MAX_BARRED_WAIT_S } else { MAX_REJOIN_SEARCH_S };
        match self.blocked_for(view.now) >= Duration::from_secs(most_s) {
            true => Some(beyond),
            false => Some(own).filter(|_| !barred),
        }
    }

    /// Gives up rejoining the plan's path: a vehicle beside it is off the plan from now on.
    pub(crate) fn give_up_plan(&mut self) {
        self.path_kind = self.path_kind.without_rejoin();
    }

    /// The vehicle turns home: it seeks a path there and gives up the plan's.
    pub(crate) fn begin_way_home(&mut self, now: Instant, timers: &mut Timers) {
        self.give_up_plan();
        self.home.begin(now, timers);
    }

    /// The vehicle flies back the way that it came: it seeks no path home and gives up the plan's.
    pub(crate) fn begin_turn_back(&mut self) {
        self.give_up_plan();
        self.home.end();
    }

    /// Whether a reported obstacle bars the way back, up to a little beyond where the vehicle can
    /// stop, or the descent at its end. All obstacles count: no planner led this way around any.
    pub(crate) fn is_way_back_barred<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let Some(plan) = view.mission.plan().filter(|_| view.guidance.returning) else {
            return false;
        };
        let along_m = view.guidance.reference_along_m();
        let until_m = view.guidance.braking_end_m().max(along_m) + BLOCKED_BEYOND_STOP_M;
        let here = view.telemetry.position;
        let bars = |obstacle: &KeepOutZone| {
            let (climb_m, descent_m) = (plan.climb_m, plan.descent_m);
            let ahead = along_m.max(0.0)..until_m;
            detour::is_path_blocked(&plan.path, ahead, climb_m, descent_m, &here, obstacle)
        };
        !self.lands_at_end() && self.obstacles.all().iter().any(bars)
    }

    /// Whether a reported obstacle is anywhere below a place, seen from above.
    pub(crate) fn is_obstacle_below(&self, place: &Point) -> bool {
        let below = |obstacle: &KeepOutZone| {
            let away = obstacle.from - place;
            away.z <= 0.0 && away.xy().norm_squared() < obstacle.radius_m * obstacle.radius_m
        };
        self.obstacles.all().iter().any(below)
    }

    /// Makes the plan's path the one flown, if it has come again from the shell.
    pub(crate) fn take_up_plan(&mut self) {
        if self.is_own_plan_ready() {
            self.path_kind = PathKind::Plan;
        }
    }

    /// Whether the plan's path has come again from the shell after a detour, and is not flown yet.
    pub(crate) fn is_own_plan_ready(&self) -> bool {
        self.path_kind == PathKind::PlanReady
    }

    /// Whether the vehicle is off its plan's path: on a detour that leads back to it, about to
    /// resume it, or unable to return to it.
    pub(crate) fn is_off_own_path(&self) -> bool {
        self.is_own_plan_ready() || self.is_own_plan_lost() || self.is_beside_plan()
    }

    /// Whether the vehicle is beside its plan's path and will not come back to it.
    pub(crate) fn is_own_plan_lost(&self) -> bool {
        self.path_kind == PathKind::OffPlan
    }

    /// Whether the vehicle seeks a landing place aside.
    pub(crate) fn seeks_landing_aside(&self) -> bool {
        self.requested_purpose == Some(DetourPurpose::LandingAside)
    }

    /// Whether the vehicle lands at the end of the detour that it flies.
    pub(crate) fn lands_at_end(&self) -> bool {
        self.path_kind == PathKind::Detour(DetourPurpose::LandingAside)
    }
}
