//! Settings and errors of the roadmap builder, and the range of edge lengths.

/// Random points that are drawn for one free node before [`PrmError::NoFreeSpace`]. In a map with
/// one free cell in a thousand a node is still found with a probability of 1 − e⁻¹⁰.
pub const MAX_TRIES_PER_NODE: usize = 10_000;

/// Points that are drawn for the bridge test of one node before a uniform node takes its place: in
/// a map without narrow passages no point passes the test.
pub const MAX_TRIES_PER_BRIDGE: usize = 1_000;

/// Distribution of the random nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// Independent and uniform, as in the paper.
    Uniform,
    /// The Halton sequence in bases 2, 3 and 5, shifted by a random vector: nodes are spread more
    /// evenly (Cranley and Patterson 1976).
    Halton,
    /// Every second node by the bridge test (Hsu et al. 2003), the others uniform: more nodes in
    /// doors and narrow passages. A node of the bridge test has clearance and lies half way between
    /// two points without it.
    Bridge,
}

/// Settings of the roadmap to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrmConfig {
    /// Number of random nodes; terminals are not counted.
    pub random_nodes: usize,
    /// Length of the shortest edge allowed, metres (Dmin).
    pub edge_min_m: f32,
    /// Length of the longest edge allowed, metres (Dmax).
    pub edge_max_m: f32,
    /// Distance to obstacles that every edge has to exceed: vehicle radius plus safety margin,
    /// metres.
    pub clearance_m: f32,
    /// Seed of the random nodes.
    pub seed: u64,
    /// Distribution of the random nodes.
    pub sampling: Sampling,
}

/// Reason why a roadmap could not be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrmError {
    /// The named setting is NaN, infinite, negative, too large, or makes an empty range.
    Config(&'static str),
    /// The terminal with this index is not finite, is inside an obstacle, or is outside a map whose
    /// [`Outside`](crate::map::voxel::Outside) is blocked.
    TerminalBlocked(usize),
    /// More nodes than the caller's memory or 16-bit indices hold.
    TooManyNodes,
    /// This many random nodes were found, but [`MAX_TRIES_PER_NODE`] draws found no free place for
    /// the next one: hardly any space is free.
    NoFreeSpace(usize),
    /// The node with this index is not finite, or beyond 1e6 m.
    NotFinite(usize),
    /// More edges than the caller's memory holds.
    RoadmapFull,
}

/// An edge between two nodes, `a < b`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PrmEdge {
    /// The lower index.
    pub a: u16,
    /// The higher index.
    pub b: u16,
}

impl PrmConfig {
    /// Returns an error with the name of the first setting that is out of range.
    pub fn check(&self) -> Result<(), PrmError> {
        let good = |x: f32| x >= 0.0 && x.is_finite();
        if !(good(self.edge_min_m)) {
            return Err(PrmError::Config("edge_min_m"));
        }
        // Longer than 1e6 m the square of a length is too coarse in f32.
        if !(good(self.edge_max_m) && self.edge_max_m > 0.0 && self.edge_max_m <= 1e6)
            || self.edge_max_m < self.edge_min_m
        {
            return Err(PrmError::Config("edge_max_m"));
        }
        if !good(self.clearance_m) {
            return Err(PrmError::Config("clearance_m"));
        }
        if self.random_nodes > usize::from(u16::MAX) {
            return Err(PrmError::Config("nodes"));
        }
        Ok(())
    }
}

/// Squared length of the segment from `a` to `b`, m². All builders of edges call this function, so
/// that all round alike.
#[inline(always)]
pub fn squared_length(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    x * x + y * y + z * z
}

/// The range of squared edge lengths. Length 0 is never in it: two nodes at one place are not
/// joined.
#[derive(Clone, Copy)]
pub(super) struct LengthRange {
    /// Least squared length of an edge, m².
    min_sq: f32,
    /// Greatest squared length of an edge, m².
    max_sq: f32,
}

impl LengthRange {
    pub(super) fn new(config: &PrmConfig) -> Self {
        let min = config.edge_min_m * config.edge_min_m;
        Self { min_sq: min.max(f32::MIN_POSITIVE), max_sq: config.edge_max_m * config.edge_max_m }
    }

    /// Whether an edge may have this squared length, m².
    #[inline(always)]
    pub(super) fn contains(self, square: f32) -> bool {
        square >= self.min_sq && square <= self.max_sq
    }
}
