//! The layout of a roadmap file: its limits, its header, and how its numbers are read.

use crate::Point;
use crate::file::FileError;
use crate::geo::frames::Geodetic;
use crate::roadmap::prm::squared_length;

/// First eight bytes of a roadmap file.
pub const MAGIC: [u8; 8] = *b"FLKROAD\n";
/// File version with a height above the ground for each node.
pub const VERSION: u16 = 2;
/// File version without heights, written if the caller has none; both versions are read.
pub(super) const VERSION_WITHOUT_HEIGHTS: u16 = 1;
/// Length of the header, the bytes before the first node.
pub const HEADER_LEN: usize = 72;
/// Most nodes that 16-bit indices can name; index 65535 is reserved for "no node".
pub const MAX_NODES: usize = u16::MAX as usize;
/// Largest magnitude of a coordinate, metres: up to here f32 resolves a millimetre.
pub const MAX_COORDINATE_M: f32 = 16_384.0;
/// Longest edge that a roadmap may have, metres. The scheduler cuts edges into timed segments of
/// 1.5 m (longer only on long flights), so this limit bounds the work for one edge.
pub const MAX_EDGE_M: f32 = 100.0;
/// Longest path from a node to a landmark that the file may store, metres: up to this length the
/// f32 sum of edge lengths errs by at most 4 mm per edge.
pub const MAX_LANDMARK_DISTANCE_M: f32 = 4.0 * MAX_COORDINATE_M;
/// Largest clearance that a half-edge can store, metres.
pub const MAX_CLEARANCE_M: f32 = 65.535;

/// Number of landmarks of a roadmap, unless it has none.
pub const LANDMARK_COUNT: usize = 2;

/// Bytes of a node: east, north and up as f32.
pub(super) const NODE_LEN: usize = 12;
/// Bytes of a node's distances to the landmarks, an f32 each.
pub(super) const LANDMARK_DISTANCES_LEN: usize = 4 * LANDMARK_COUNT;
/// Bytes of a node's height above the ground, an f32.
pub(super) const HEIGHT_LEN: usize = 4;
/// Bytes of a row offset, of a half-edge and of the CRC.
pub(super) const WORD_LEN: usize = 4;

/// Reason why a roadmap was refused, when it was read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoadmapError {
    /// The bytes are not a complete roadmap file.
    File(FileError),
    /// A coordinate of the node with this index is NaN, infinite or beyond [`MAX_COORDINATE_M`].
    Node(u16),
    /// The row offset of this node is below the one before or beyond the half-edges; or the first
    /// offset is not 0, or the last one not the number of half-edges.
    Offset(u16),
    /// A half-edge of this node leads to the node itself or to no node, or the targets of its row
    /// are not strictly ascending.
    Target(u16),
    /// A half-edge of this node has no opposite half-edge with the same clearance.
    OneWay(u16),
    /// An edge of this node has no length: its two nodes coincide.
    ZeroLength(u16),
    /// An edge of this node is shorter or longer than the limits in the header.
    EdgeLength(u16),
    /// The clearance of an edge of this node is more than a millimetre below the header's
    /// `tested_clearance_m`, or above its `max_clearance_m`.
    EdgeClearance(u16),
    /// The distance of this node to a landmark is beyond [`MAX_LANDMARK_DISTANCE_M`], or is not the
    /// length of the shortest path over all edges.
    Landmark(u16),
    /// The height of this node above the ground is NaN, negative, or finite and beyond
    /// [`MAX_LANDMARK_DISTANCE_M`]; or the number of heights is not the number of nodes, and this
    /// is the first node without one. (An infinite height is allowed: nothing is below the node.)
    Height(u16),
    /// The workspace in which the distances to landmarks are computed holds fewer nodes than the
    /// roadmap has.
    WorkspaceTooSmall,
    /// The roadmap has more than [`MAX_NODES`] nodes.
    TooManyNodes,
    /// The output buffer is smaller than the roadmap, which takes `needed` bytes.
    RoadmapFull {
        /// Length of the roadmap file in bytes.
        needed: usize,
    },
    /// The edge with this index names a node that does not exist.
    EdgeNode(usize),
    /// The edge with this index joins a node to itself.
    SelfLoop(usize),
    /// The edge with this index has a clearance that is NaN, infinite or negative.
    InvalidClearance(usize),
    /// Two edges join these two nodes.
    Duplicate(u16, u16),
}

impl From<FileError> for RoadmapError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Header of a roadmap file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadmapHeader {
    /// The mission origin: the WGS84 position of the point (0, 0, 0) of the nodes' ENU frame.
    pub origin: Geodetic,
    /// Shortest edge that the builder was allowed to make (`Dmin` of paper P3D), metres.
    pub edge_min_m: f32,
    /// Longest edge that the builder was allowed to make (`Dmax` of paper P3D), metres.
    pub edge_max_m: f32,
    /// Clearance that every edge was tested to exceed, metres. A vehicle that needs more must check
    /// [`HalfEdge::clearance_m`] of each edge.
    pub tested_clearance_m: f32,
    /// Largest clearance stored, metres: an edge that stores this value has at least this
    /// clearance.
    pub max_clearance_m: f32,
    /// Number of start nodes, which are the nodes `0..start_count`.
    pub start_count: u16,
    /// Number of goal nodes, which are the nodes `start_count..start_count + goal_count`.
    pub goal_count: u16,
}

impl RoadmapHeader {
    /// Checks that each number of the header is in its range; `node_count` is the number of nodes.
    pub(super) fn check(&self, node_count: usize) -> Result<(), RoadmapError> {
        let refuse = |name| Err(FileError::Header(name).into());
        if !self.origin.is_valid() {
            return refuse("origin");
        }
        if !(self.edge_min_m >= 0.0 && self.edge_min_m <= MAX_EDGE_M) {
            return refuse("edge_min_m");
        }
        if !(self.edge_max_m >= self.edge_min_m && self.edge_max_m <= MAX_EDGE_M) {
            return refuse("edge_max_m");
        }
        if !(self.tested_clearance_m >= 0.0 && self.tested_clearance_m <= MAX_COORDINATE_M) {
            return refuse("tested_clearance_m");
        }
        if !(self.max_clearance_m >= 0.0 && self.max_clearance_m <= MAX_CLEARANCE_M) {
            return refuse("max_clearance_m");
        }
        if usize::from(self.start_count) + usize::from(self.goal_count) > node_count {
            return refuse("terminals");
        }
        Ok(())
    }

    /// Whether the length of an edge from `a` to `b` is within the header's limits, computed
    /// exactly as the builder computes it.
    pub(super) fn is_edge_length_valid(&self, a: &Point, b: &Point) -> bool {
        let square = squared_length((*a).into(), (*b).into());
        square >= self.edge_min_m * self.edge_min_m && square <= self.edge_max_m * self.edge_max_m
    }

    /// Least and greatest clearance that a half-edge of this roadmap may store, metres. The least
    /// is a millimetre below the tested clearance: the test is exact, the distance is rounded.
    pub(super) fn clearance_limits_m(&self) -> (f32, f32) {
        let metres = |millimetres: u16| f32::from(millimetres) / 1000.0;
        let most = floor_to_millimetres(self.max_clearance_m);
        (
            metres(floor_to_millimetres(self.tested_clearance_m).min(most).saturating_sub(1)),
            metres(most),
        )
    }
}

/// Metres as whole millimetres, rounded down. In f64 the product is exact, so only the cast rounds;
/// it saturates at 65535.
pub(super) fn floor_to_millimetres(metres: f32) -> u16 {
    (f64::from(metres) * 1000.0) as u16
}

/// One of the two directions of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfEdge {
    /// Index of the node to which the half-edge leads.
    pub target: u16,
    /// Distance from the edge to the nearest obstacle, metres, rounded down to a millimetre. If it
    /// equals [`RoadmapHeader::max_clearance_m`], the distance may be larger.
    pub clearance_m: f32,
}

impl HalfEdge {
    /// Decodes a half-edge from its bytes in the file.
    #[inline]
    pub(super) fn from_bytes(bytes: &[u8; WORD_LEN]) -> Self {
        let millimetres = u16::from_le_bytes([bytes[2], bytes[3]]);
        Self { target: decode_target(bytes), clearance_m: f32::from(millimetres) / 1000.0 }
    }
}

/// Whether all coordinates are at most [`MAX_COORDINATE_M`] in magnitude; false for NaN.
pub(super) fn has_valid_coordinates(node: &Point) -> bool {
    node.iter().all(|c| libm::fabsf(*c) <= MAX_COORDINATE_M)
}

/// Index of the target node, decoded from a half-edge's bytes in the file.
#[inline]
pub(crate) fn decode_target(bytes: &[u8; WORD_LEN]) -> u16 {
    u16::from_le_bytes([bytes[0], bytes[1]])
}

/// Position of a node, metres, decoded from its bytes in the file.
#[inline(always)]
pub(super) fn decode_node(b: &[u8; NODE_LEN]) -> Point {
    let at = |i: usize| f32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]);
    Point::new(at(0), at(4), at(8))
}

/// The file length that a header states. Refuses a version that this code does not read.
///
/// # Errors
/// The bytes are not a roadmap's header, the version is unknown, or counts and length contradict
/// one another.
pub fn declared_len(head: &[u8; HEADER_LEN]) -> Result<usize, RoadmapError> {
    if head[..8] != MAGIC {
        return Err(FileError::Magic.into());
    }
    let heights = match u16_at(head, 8) {
        VERSION_WITHOUT_HEIGHTS => 0,
        VERSION => 1,
        other => return Err(FileError::Version(other).into()),
    };
    let total = u32_at(head, 12) as usize;
    let (node_count, half_edge_count) = (u32_at(head, 60) as usize, u32_at(head, 64) as usize);
    let landmarks = u32_at(head, 68) as usize;
    let sound = half_edge_count % 2 == 0 && (landmarks == 0 || landmarks == LANDMARK_COUNT);
    if usize::from(u16_at(head, 10)) != HEADER_LEN || !sound {
        return Err(FileError::Length.into());
    }
    if node_count > MAX_NODES {
        return Err(RoadmapError::TooManyNodes);
    }
    if encoded_len(node_count, half_edge_count / 2, landmarks + heights) != Some(total) {
        return Err(FileError::Length.into());
    }
    Ok(total)
}

/// Length of a roadmap file in bytes, or `None` if it exceeds the file's 32-bit length. `edges` is
/// the number of edges, not of half-edges. `columns` is how many numbers are stored per node
/// besides its position and row offset: 0, or [`LANDMARK_COUNT`] for
/// [`write_with_landmarks`](super::write_with_landmarks), and one more with heights.
pub fn encoded_len(nodes: usize, edges: usize, columns: usize) -> Option<usize> {
    let a_node = columns.checked_add(4)?;
    let words = nodes.checked_mul(a_node)?.checked_add(2)?.checked_add(edges.checked_mul(2)?)?;
    let bytes = words.checked_mul(WORD_LEN)?.checked_add(HEADER_LEN)?;
    u32::try_from(bytes).ok().map(|_| bytes)
}

/// The little-endian number at byte `at` of the header.
pub(super) fn u16_at(head: &[u8; HEADER_LEN], at: usize) -> u16 {
    u16::from_le_bytes([head[at], head[at + 1]])
}

/// The little-endian u32 at byte `at` of the header.
pub(super) fn u32_at(head: &[u8; HEADER_LEN], at: usize) -> u32 {
    u32::from(u16_at(head, at)) | u32::from(u16_at(head, at + 2)) << 16
}

/// The little-endian f32 at byte `at` of the header.
pub(super) fn f32_at(head: &[u8; HEADER_LEN], at: usize) -> f32 {
    f32::from_bits(u32_at(head, at))
}

/// The little-endian f64 at byte `at` of the header.
pub(super) fn f64_at(head: &[u8; HEADER_LEN], at: usize) -> f64 {
    f64::from_bits(u64::from(u32_at(head, at)) | u64::from(u32_at(head, at + 4)) << 32)
}
