//! Where on its path a vehicle is.

/// How far along its path a vehicle is, as its task sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    /// Way made along the path, metres.
    pub(crate) progress_m: f32,
    /// Whether it flies along the plan's own path now.
    pub(crate) follows: bool,
}
