//! What to build, why it could not be built, and which lengths an edge may have.

/// Random points tried for one free node before the map counts as full. A map with one free cell in
/// a thousand still yields a node with a probability of 1 − e⁻¹⁰.
pub const TRIES_PER_NODE: usize = 10_000;

/// Random pairs tried for one bridge sample before a uniform node replaces it: a map without narrow
/// passages has none.
pub const TRIES_PER_BRIDGE: usize = 1_000;

/// Distribution of the random nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// Independent and uniform, as in the paper.
    Uniform,
    /// The Halton sequence in bases 2, 3 and 5, shifted by the seed (Cranley and Patterson 1976):
    /// more even.
    Halton,
    /// Every second node by the bridge test (Hsu et al. 2003), the others uniform: more of them in
    /// doors and narrow passages. Such a node is clear and lies half way between two points that
    /// are not.
    Bridge,
}

/// Settings of the roadmap to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Random nodes, beside the terminals.
    pub nodes: usize,
    /// Shortest edge, metres (Dmin).
    pub edge_min_m: f32,
    /// Longest edge, metres (Dmax).
    pub edge_max_m: f32,
    /// Distance every edge keeps to obstacles, strictly: radius and safety margin, metres.
    pub clearance_m: f32,
    /// Seed of the nodes.
    pub seed: u64,
    /// Distribution of the random nodes.
    pub sampling: Sampling,
}

/// Reason why a roadmap could not be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrmError {
    /// The named field is NaN, infinite, negative, or makes an empty range.
    Config(&'static str),
    /// The terminal of this index is not finite, not in the map or inside an obstacle.
    TerminalBlocked(usize),
    /// More nodes than the caller's memory holds.
    TooManyNodes,
    /// After this many nodes none was found in [`TRIES_PER_NODE`] draws: hardly any space is free.
    NoFreeSpace(usize),
    /// The node of this index is not finite.
    NotFinite(usize),
    /// More edges than the caller's memory holds.
    RoadmapFull,
}

/// An edge between two nodes, `a < b`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Edge {
    /// The lower index.
    pub a: u16,
    /// The higher index.
    pub b: u16,
}

impl Config {
    /// Checks every number.
    pub fn check(&self) -> Result<(), PrmError> {
        let good = |x: f32| x >= 0.0 && x.is_finite();
        if !(good(self.edge_min_m)) {
            return Err(PrmError::Config("edge_min_m"));
        }
        // Beyond 1e6 m squares of lengths lose their meaning next to other f32 coordinates.
        if !(good(self.edge_max_m) && self.edge_max_m > 0.0 && self.edge_max_m <= 1e6)
            || self.edge_max_m < self.edge_min_m
        {
            return Err(PrmError::Config("edge_max_m"));
        }
        if !good(self.clearance_m) {
            return Err(PrmError::Config("clearance_m"));
        }
        if self.nodes > usize::from(u16::MAX) {
            return Err(PrmError::Config("nodes"));
        }
        Ok(())
    }
}

/// Squared length of the segment from `a` to `b`, m²; the one place where it is computed, so that
/// every builder rounds alike.
#[inline(always)]
pub fn squared_length(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    x * x + y * y + z * z
}

/// The squared lengths an edge may have. Two nodes in one place are never joined.
#[derive(Clone, Copy)]
pub(super) struct LengthRange {
    min: f32,
    max: f32,
}

impl LengthRange {
    pub(super) fn new(config: &Config) -> Self {
        let min = config.edge_min_m * config.edge_min_m;
        Self { min: min.max(f32::MIN_POSITIVE), max: config.edge_max_m * config.edge_max_m }
    }

    #[inline(always)]
    pub(super) fn contains(self, square: f32) -> bool {
        square >= self.min && square <= self.max
    }
}
