//! What path a vehicle flies, and what path it seeks: one value each.
//!
//! A path is sought from the request to the shell until it comes, or the vehicle leaves the state
//! in which it waits for that. A path that has come is flown for the purpose that it was sought
//! for.

use planner_core::Point;

/// A place of the plan's path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RejoinPlace {
    /// Distance along that path, metres.
    pub along_m: f32,
    pub position: Point,
}

/// Where a vehicle that makes room comes back to its path over a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RejoinPlaces {
    /// Where it left that path, or holds for a division.
    pub own: RejoinPlace,
    /// The next free one when it left, used if the other one stays barred; the same where there was
    /// none.
    pub beyond: RejoinPlace,
}

/// Purpose of a requested path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DetourPurpose {
    /// To fly to the goal.
    Goal,
    /// To leave the column under a vehicle that lands; and, over a field, to come back from there.
    Aside(Option<RejoinPlaces>),
    /// To land where no vehicle lies.
    Landing,
    /// To fly home over a field.
    Home,
    /// To fly back to the own path over a field.
    Back(RejoinPlace),
}

/// Path that a vehicle flies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum FlownPath {
    /// That of its plan.
    #[default]
    Plan,
    /// That of its plan again, which has come and is not taken up yet.
    PlanReturned,
    /// One that was sought.
    Detour(DetourPurpose),
    /// One beside its path, to which it does not come back any more.
    Astray,
}

impl DetourPurpose {
    /// Whether the path ends where the vehicle only makes room, or lands.
    pub(crate) fn is_aside(&self) -> bool {
        matches!(self, Self::Aside(_) | Self::Landing)
    }

    /// Place where the vehicle comes back to its own path over a field.
    pub(crate) fn rejoin(&self) -> Option<RejoinPlace> {
        match self {
            Self::Back(back) => Some(*back),
            Self::Aside(places) => places.map(|places| places.own),
            _ => None,
        }
    }

    /// Whether the vehicle keeps to its plan: it comes back to it.
    pub(crate) fn keeps_to_plan(&self) -> bool {
        self.rejoin().is_some()
    }
}

impl FlownPath {
    /// The purpose of the detour that is flown.
    pub(crate) fn purpose(&self) -> Option<DetourPurpose> {
        match self {
            Self::Detour(purpose) => Some(*purpose),
            _ => None,
        }
    }

    /// Whether it is not that of the plan.
    pub(crate) fn is_detour(&self) -> bool {
        matches!(self, Self::Detour(_) | Self::Astray)
    }

    /// The path once the vehicle does not come back to its plan from beside it.
    pub(crate) fn without_return(self) -> Self {
        match self {
            Self::PlanReturned => Self::Plan,
            Self::Detour(purpose) if purpose.keeps_to_plan() => Self::Astray,
            other => other,
        }
    }
}
