//! What path a vehicle flies, and whether it comes back to that of its plan from there.
//!
//! Constant work but for [`Detours::rejoin_from_aside`], once a search.

use super::flown::{DetourPurpose, FlownPath, RejoinPlace, RejoinPlaces};
use super::{Detours, beside};
use crate::swarm::view::DetourView;
use crate::time::Duration;

/// Time for which a vehicle that made room waits for the place where it left its path, seconds:
/// less than until it flies home.
const BARRED_MOST_S: u64 = 60;
/// Time for which it seeks a way to that place once that is free, seconds.
const NO_WAY_MOST_S: u64 = 90;

impl Detours {
    /// Whether the current path is a detour.
    pub(crate) fn is_on_detour(&self) -> bool {
        self.flown.is_detour()
    }

    /// What the shell is asked for.
    pub(crate) fn sought(&self) -> Option<DetourPurpose> {
        self.sought
    }

    /// Ends the search: the vehicle stays on the path that it is on.
    pub(crate) fn end_search(&mut self) {
        (self.sought, self.request_read, self.detour_ready) = (None, false, false);
    }

    /// Whether it flies its way home over a field, stops for it, or seeks it.
    pub(crate) fn is_homeward(&self) -> bool {
        self.home.is_seeking() || self.flown == FlownPath::Detour(DetourPurpose::Home)
    }

    /// Whether the path flown ends elsewhere than over the vehicle's goal: aside, or back on its
    /// own path.
    pub(crate) fn ends_aside(&self) -> bool {
        self.flown.purpose().is_some_and(|purpose| purpose.is_aside() || purpose.keeps_to_plan())
    }

    /// Whether it is beside its path over a field, to come back to it.
    pub(crate) fn is_beside_plan(&self) -> bool {
        self.flown.purpose().is_some_and(|purpose| purpose.keeps_to_plan())
    }

    /// Whether the detour that it flies leads back to its path over a field.
    pub(crate) fn leads_back(&self) -> bool {
        matches!(self.flown, FlownPath::Detour(DetourPurpose::Back(_)))
    }

    /// Places where it is to come back to its path over a field.
    pub(crate) fn rejoin_places(&self) -> Option<RejoinPlaces> {
        match self.flown {
            FlownPath::Detour(DetourPurpose::Aside(places)) => places,
            _ => self.rejoin().map(|own| RejoinPlaces { own, beyond: own }),
        }
    }

    /// Place where it is to come back to its path over a field.
    pub(crate) fn rejoin(&self) -> Option<RejoinPlace> {
        self.flown.purpose().and_then(|purpose| purpose.rejoin())
    }

    /// Place where it comes back to its path from aside: where it left that, or beyond if that
    /// place stays barred, or no way leads there. `None` while it waits for that place.
    pub(crate) fn rejoin_from_aside<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<RejoinPlace> {
        let RejoinPlaces { own, beyond } = self.rejoin_places()?;
        let barred = own != beyond && beside::is_barred(view, self.obstacles.all(), &own.position);
        let most_s = if barred { BARRED_MOST_S } else { NO_WAY_MOST_S };
        match self.blocked_for(view.now) >= Duration::from_secs(most_s) {
            true => Some(beyond),
            false => Some(own).filter(|_| !barred),
        }
    }

    /// The vehicle turns to another task: it does not come back to its path from beside it.
    pub(crate) fn give_up_plan(&mut self) {
        self.flown = self.flown.without_return();
    }

    /// The vehicle takes up its own path.
    pub(crate) fn take_up_plan(&mut self) {
        if self.is_own_plan_ready() {
            self.flown = FlownPath::Plan;
        }
    }

    /// Whether its own path has come, and is to be taken up.
    pub(crate) fn is_own_plan_ready(&self) -> bool {
        self.flown == FlownPath::PlanReturned
    }

    /// Whether it is to take up its own path again, or to go home without it.
    pub(crate) fn is_own_plan_outstanding(&self) -> bool {
        self.is_own_plan_ready() || self.is_own_plan_lost() || self.is_beside_plan()
    }

    /// Whether its own path will not come.
    pub(crate) fn is_own_plan_lost(&self) -> bool {
        self.flown == FlownPath::Astray
    }

    /// Whether it seeks a place aside to land at.
    pub(crate) fn seeks_landing(&self) -> bool {
        self.sought == Some(DetourPurpose::Landing)
    }

    /// Whether it lands at the end of its detour.
    pub(crate) fn lands_at_end(&self) -> bool {
        self.flown == FlownPath::Detour(DetourPurpose::Landing)
    }
}
