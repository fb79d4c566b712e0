//! The path that a vehicle flies, and the path that it seeks: one value each.
//!
//! A path is sought from the request to the shell until the path comes, or the vehicle leaves the
//! state in which it waits for the path. A path that has come is flown for the purpose for which it
//! was requested.

use planner_core::Point;

/// A place on the path of the vehicle's plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RejoinPlace {
    /// Arc length along the plan's path, metres.
    pub along_m: f32,
    /// The place itself, ENU metres.
    pub position: Point,
}

/// Places where a vehicle that went aside in a coverage mission comes back to its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RejoinPlaces {
    /// Place where the vehicle left its path, or where it is to hold for a division.
    pub first_choice: RejoinPlace,
    /// First free place beyond the block as it was when the vehicle left, used if `first_choice`
    /// stays barred; equal to `first_choice` where there was none.
    pub beyond_block: RejoinPlace,
}

/// Purpose of a path requested from the shell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DetourPurpose {
    /// A detour to the goal of the plan.
    Goal,
    /// Aside, out of the column under a vehicle that lands; in a coverage mission with the places
    /// where it comes back to its path.
    Aside(Option<RejoinPlaces>),
    /// Aside, to land where no other vehicle lies.
    LandingAside,
    /// Straight home in a coverage mission.
    Home,
    /// Around an obstacle in a coverage mission, back to this place on the own path.
    Rejoin(RejoinPlace),
}

/// Kind of path that a vehicle flies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum PathKind {
    /// The path of its plan.
    #[default]
    Plan,
    /// The path of its plan after a detour: it has come from the shell, and the vehicle has not
    /// begun it yet.
    PlanReady,
    /// A path that was requested for this purpose.
    Detour(DetourPurpose),
    /// A path beside the plan's; the vehicle does not come back to the plan's any more.
    OffPlan,
}

impl DetourPurpose {
    /// Whether the path ends aside, where the vehicle only makes room, or lands.
    pub(crate) fn is_aside(&self) -> bool {
        matches!(self, Self::Aside(_) | Self::LandingAside)
    }

    /// Place where the vehicle comes back to its own path in a coverage mission; `None` if it does
    /// not.
    pub(crate) fn rejoin_place(&self) -> Option<RejoinPlace> {
        match self {
            Self::Rejoin(back) => Some(*back),
            Self::Aside(places) => places.map(|places| places.first_choice),
            _ => None,
        }
    }

    /// Whether the vehicle comes back to its plan after this path.
    pub(crate) fn returns_to_plan(&self) -> bool {
        self.rejoin_place().is_some()
    }
}

impl PathKind {
    /// Purpose of the detour that is flown; `None` on the plan's path, or off the plan.
    pub(crate) fn purpose(&self) -> Option<DetourPurpose> {
        match self {
            Self::Detour(purpose) => Some(*purpose),
            _ => None,
        }
    }

    /// Whether the path is another one than that of the plan.
    pub(crate) fn is_detour(&self) -> bool {
        matches!(self, Self::Detour(_) | Self::OffPlan)
    }

    /// The kind of path once the vehicle has given up coming back to its plan.
    pub(crate) fn without_rejoin(self) -> Self {
        match self {
            Self::PlanReady => Self::Plan,
            Self::Detour(purpose) if purpose.returns_to_plan() => Self::OffPlan,
            other => other,
        }
    }
}
