//! How far along its path a vehicle is, and on which path.

/// Which path a vehicle flies, for its task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PathRelation {
    /// The path of its plan.
    OnPath,
    /// A detour near that path, around a keep-out zone on it and back to it.
    Beside,
    /// Another path, or none: no pictures are taken.
    #[default]
    Elsewhere,
}

/// Progress of a vehicle along the path that it flies, for its task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathProgress {
    /// Distance flown along that path, metres.
    pub(crate) progress_m: f32,
    /// Distance of the reference along that path, metres: where a vehicle that holds comes to rest.
    pub(crate) reference_m: f32,
    /// Relation of that path to the path of the plan.
    pub(crate) relation: PathRelation,
}
