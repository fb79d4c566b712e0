//! Where on its path a vehicle is.

/// Which path a vehicle is on, as its task sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathRelation {
    /// The plan's own.
    OnPath,
    /// A detour around a keep-out zone on the path, near the path and back to it.
    Beside,
    /// Another one, or none.
    Elsewhere,
}

/// Progress of a vehicle along its path, as its task sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathProgress {
    /// Way made along the path, metres.
    pub(crate) progress_m: f32,
    /// Which path that is.
    pub(crate) place: PathRelation,
}
