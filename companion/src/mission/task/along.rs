//! Where on its path a vehicle is.

/// Which path a vehicle is on, as its task sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The plan's own.
    OnPath,
    /// One around something on that, near it and back to it.
    Beside,
    /// Another one, or none.
    Elsewhere,
}

/// How far along its path a vehicle is, as its task sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    /// Way made along the path, metres.
    pub(crate) progress_m: f32,
    /// Which path that is.
    pub(crate) place: Place,
}
