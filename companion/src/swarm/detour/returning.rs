//! Which path a vehicle flies, and whether it comes back from there to its plan's path.
//!
//! Constant work but for [`Detours::rejoin_from_aside`], once a search.

use super::flown::{DetourPurpose, FlownPath, RejoinPlace, RejoinPlaces};
use super::{Detours, beside};
use crate::swarm::view::DetourView;
use crate::time::Duration;

/// Time for which a vehicle aside waits until the place where it left its path is free, seconds:
/// less than until it flies home.
const MAX_BARRED_WAIT_S: u64 = 60;
/// Time for which a vehicle aside seeks a way to the place where it left its path, once that is
/// free, seconds.
const MAX_REJOIN_SEARCH_S: u64 = 90;

impl Detours {
    /// Whether the path that is flown is not the plan's.
    pub(crate) fn is_on_detour(&self) -> bool {
        self.flown.is_detour()
    }

    /// Purpose of the path that is requested from the shell; `None` if none is.
    pub(crate) fn sought(&self) -> Option<DetourPurpose> {
        self.sought
    }

    /// Forgets the request for a path: the vehicle stays on the path that it flies.
    pub(crate) fn end_search(&mut self) {
        (self.sought, self.request_read, self.detour_ready) = (None, false, false);
    }

    /// Whether the vehicle flies straight home over an area, stops for that, or seeks the way.
    pub(crate) fn is_homeward(&self) -> bool {
        self.home.is_seeking() || self.flown == FlownPath::Detour(DetourPurpose::Home)
    }

    /// Whether the path that is flown ends aside, or back on the plan's path, not over the
    /// vehicle's goal.
    pub(crate) fn ends_aside(&self) -> bool {
        self.flown.purpose().is_some_and(|purpose| purpose.is_aside() || purpose.keeps_to_plan())
    }

    /// Whether the vehicle flies a detour over an area after which it comes back to its plan.
    pub(crate) fn is_beside_plan(&self) -> bool {
        self.flown.purpose().is_some_and(|purpose| purpose.keeps_to_plan())
    }

    /// Whether the detour that is flown ends on the plan's path over an area.
    pub(crate) fn leads_back(&self) -> bool {
        matches!(self.flown, FlownPath::Detour(DetourPurpose::Rejoin(_)))
    }

    /// Places where the vehicle is to come back to its path over an area; `None` if it does not
    /// come back.
    pub(crate) fn rejoin_places(&self) -> Option<RejoinPlaces> {
        match self.flown {
            FlownPath::Detour(DetourPurpose::Aside(places)) => places,
            _ => self.rejoin().map(|own| RejoinPlaces { own, beyond: own }),
        }
    }

    /// Place where the vehicle is to come back to its path over an area; `None` if it does not come
    /// back.
    pub(crate) fn rejoin(&self) -> Option<RejoinPlace> {
        self.flown.purpose().and_then(|purpose| purpose.rejoin())
    }

    /// Place where a vehicle aside comes back to its path now: where it left that; or beyond the
    /// block, once that place has been barred, or no way to it was found, for too long. `None`
    /// while it waits for that place to be free.
    pub(crate) fn rejoin_from_aside<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<RejoinPlace> {
        let RejoinPlaces { own, beyond } = self.rejoin_places()?;
        let barred = own != beyond && beside::is_barred(view, self.obstacles.all(), &own.position);
        let most_s = if barred { MAX_BARRED_WAIT_S } else { MAX_REJOIN_SEARCH_S };
        match self.blocked_for(view.now) >= Duration::from_secs(most_s) {
            true => Some(beyond),
            false => Some(own).filter(|_| !barred),
        }
    }

    /// Gives up the return to the plan's path: a vehicle beside it is from now on astray.
    pub(crate) fn give_up_plan(&mut self) {
        self.flown = self.flown.without_return();
    }

    /// Makes the plan's path the one flown, if it has come again from the shell.
    pub(crate) fn take_up_plan(&mut self) {
        if self.is_own_plan_ready() {
            self.flown = FlownPath::Plan;
        }
    }

    /// Whether the plan's path has come again from the shell after a detour, and is not flown yet.
    pub(crate) fn is_own_plan_ready(&self) -> bool {
        self.flown == FlownPath::PlanReturned
    }

    /// Whether the vehicle is beside its plan's path, or about to fly it again, or has to fly home
    /// without it.
    pub(crate) fn is_own_plan_outstanding(&self) -> bool {
        self.is_own_plan_ready() || self.is_own_plan_lost() || self.is_beside_plan()
    }

    /// Whether the vehicle is beside its plan's path and will not come back to it.
    pub(crate) fn is_own_plan_lost(&self) -> bool {
        self.flown == FlownPath::Astray
    }

    /// Whether the vehicle seeks a landing place aside.
    pub(crate) fn seeks_landing(&self) -> bool {
        self.sought == Some(DetourPurpose::Landing)
    }

    /// Whether the vehicle lands at the end of the detour that it flies.
    pub(crate) fn lands_at_end(&self) -> bool {
        self.flown == FlownPath::Detour(DetourPurpose::Landing)
    }
}
