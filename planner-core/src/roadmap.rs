//! The roadmap file: a graph of free nodes and clear edges, read in place from flash, not copied.
//!
//! Little-endian, versioned, ends with a CRC-32; its bytes are listed in `planner-core/README.md`.
//! Nodes are points of the mission frame. Each edge is stored once from each end (two half-edges)
//! in compressed sparse rows, targets in ascending order. A half-edge takes four bytes: its length
//! is computed from the nodes, its clearance is stored in whole millimetres, rounded down. So 4096
//! nodes and 65536 half-edges take 320 kB, 32 kB more with landmarks. Because each edge carries its
//! own clearance, one roadmap built for a small required clearance serves vehicles of any size
//! (paper P3D Table 1 from a single build).
//!
//! A roadmap may store the length of the shortest path from each node to two landmarks (nodes),
//! eight bytes per node. By the triangle inequality, the difference of two nodes' distances to a
//! landmark is a lower bound on the path between them, in a building a better one than the straight
//! line (ALT: Goldberg and Harrelson 2005, "Computing the Shortest Path: A* Search Meets Graph
//! Theory").
//!
//! A roadmap may also store each node's height above the ground, four bytes per node, so that a
//! board without a map knows the ground height below a vehicle
//! ([`RoadmapView::ground_range_near`]).
//!
//! [`RoadmapView::parse`] checks the file once, in O(nodes + half-edges · log degree). After that
//! no accessor can meet an offset or a target out of range, and A* finds shortest paths, whatever
//! the bytes were. Parsing cannot check clearances: that takes the map.

use crate::Point;
use crate::file::{CRC32, FileError};
use crate::frames::Geodetic;
use crate::prm::squared_length;

mod check;
mod ground;
mod write;
pub use ground::GROUND_REACH_M;
pub use write::{Edge, encoded_len, write, write_with_landmarks};

/// First eight bytes of a roadmap file.
pub const MAGIC: [u8; 8] = *b"FLKROAD\n";
/// File version with a height above the ground for each node.
pub const VERSION: u16 = 2;
/// File version without heights, written if the caller has none; both versions are read.
const VERSION_WITHOUT_HEIGHTS: u16 = 1;
/// Length of the header, the bytes before the first node.
pub const HEADER_LEN: usize = 72;
/// Most nodes that 16-bit indices can name; index 65535 is reserved for "no node".
pub const MAX_NODES: usize = u16::MAX as usize;
/// Largest magnitude of a coordinate, metres: up to here f32 resolves a millimetre.
pub const MAX_COORDINATE_M: f32 = 16_384.0;
/// Longest edge that a roadmap may have, metres. The scheduler checks every metre of an edge, so
/// this limit bounds the scheduler's work.
pub const MAX_EDGE_M: f32 = 100.0;
/// Longest path from a node to a landmark that the file may store, metres: up to this length the
/// f32 sum of edge lengths errs by at most 4 mm per edge.
pub const MAX_LANDMARK_DISTANCE_M: f32 = 4.0 * MAX_COORDINATE_M;
/// Largest clearance that a half-edge can store, metres.
pub const MAX_CLEARANCE_M: f32 = 65.535;

/// Number of landmarks of a roadmap, unless it has none.
pub const LANDMARKS: usize = 2;

const NODE_LEN: usize = 12;
const LANDMARKS_LEN: usize = 4 * LANDMARKS;
const HEIGHT_LEN: usize = 4;
const WORD_LEN: usize = 4;

/// Reason why a roadmap was refused, when it was read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoadmapError {
    /// The bytes are not a complete roadmap file.
    File(FileError),
    /// A coordinate of the node with this index is NaN, infinite or beyond [`MAX_COORDINATE_M`].
    Node(u16),
    /// The row offset of this node is below the one before, or beyond the half-edges.
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
    /// The height of this node above the ground is NaN, negative or beyond
    /// [`MAX_LANDMARK_DISTANCE_M`]; or the number of heights is not the number of nodes, and this
    /// is the first node without one.
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
    Clearance(usize),
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
    /// Number of start nodes, which are the nodes `0..starts`.
    pub starts: u16,
    /// Number of goal nodes, which are the nodes `starts..starts + goals`.
    pub goals: u16,
}

impl RoadmapHeader {
    fn check(&self, node_count: usize) -> Result<(), RoadmapError> {
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
        if usize::from(self.starts) + usize::from(self.goals) > node_count {
            return refuse("terminals");
        }
        Ok(())
    }

    /// Whether the length of an edge from `a` to `b` is within the header's limits, computed
    /// exactly as the builder computes it.
    fn is_edge_length_valid(&self, a: &Point, b: &Point) -> bool {
        let square = squared_length((*a).into(), (*b).into());
        square >= self.edge_min_m * self.edge_min_m && square <= self.edge_max_m * self.edge_max_m
    }

    /// Least and greatest clearance that a half-edge of this roadmap may store, metres. The least
    /// is a millimetre below the tested clearance: the test is exact, the distance is rounded.
    fn clearance_limits_m(&self) -> (f32, f32) {
        let metres = |millimetres: u16| f32::from(millimetres) / 1000.0;
        let most = millimetres_down(self.max_clearance_m);
        (
            metres(millimetres_down(self.tested_clearance_m).min(most).saturating_sub(1)),
            metres(most),
        )
    }
}

/// Metres as whole millimetres, rounded down. In f64 the product is exact, so only the cast rounds;
/// it saturates at 65535.
fn millimetres_down(metres: f32) -> u16 {
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
    #[inline]
    fn from_bytes(bytes: &[u8; WORD_LEN]) -> Self {
        let millimetres = u16::from_le_bytes([bytes[2], bytes[3]]);
        Self { target: decode_target(bytes), clearance_m: f32::from(millimetres) / 1000.0 }
    }
}

/// Whether all coordinates are at most [`MAX_COORDINATE_M`] in magnitude; false for NaN.
fn has_valid_coordinates(node: &Point) -> bool {
    node.iter().all(|c| libm::fabsf(*c) <= MAX_COORDINATE_M)
}

/// Index of the target node, decoded from a half-edge's bytes in the file.
#[inline]
pub(crate) fn decode_target(bytes: &[u8; WORD_LEN]) -> u16 {
    u16::from_le_bytes([bytes[0], bytes[1]])
}

#[inline(always)]
fn decode_node(b: &[u8; NODE_LEN]) -> Point {
    let at = |i: usize| f32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]);
    Point::new(at(0), at(4), at(8))
}

/// A checked roadmap over borrowed bytes. Copying it copies five slices, not the nodes and edges.
#[derive(Clone, Copy, Debug)]
pub struct RoadmapView<'a> {
    header: RoadmapHeader,
    crc: u32,
    nodes: &'a [[u8; NODE_LEN]],
    offsets: &'a [[u8; WORD_LEN]],
    half_edges: &'a [[u8; WORD_LEN]],
    /// The distances to the landmarks, an entry for each node; empty if the roadmap has no
    /// landmarks.
    landmarks: &'a [[u8; LANDMARKS_LEN]],
    /// The heights above the ground, an entry for each node; empty if the roadmap has none.
    heights: &'a [[u8; HEIGHT_LEN]],
}

impl<'a> RoadmapView<'a> {
    /// Checks the roadmap at the start of `bytes` and returns a view of it. Bytes after the length
    /// that the header states are ignored, so a whole flash slot may be passed.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, RoadmapError> {
        let head: &[u8; HEADER_LEN] = bytes.first_chunk().ok_or(FileError::Truncated)?;
        let total = declared_len(head)?;
        let counts = [60, 64, 68].map(|at| u32_at(head, at) as usize);
        let body = bytes.get(..total).ok_or(FileError::Truncated)?;
        let (covered, stored) = body.split_last_chunk::<WORD_LEN>().ok_or(FileError::Truncated)?;
        let crc = u32::from_le_bytes(*stored);
        if CRC32.checksum(covered) != crc {
            return Err(FileError::Crc.into());
        }
        let header = RoadmapHeader {
            origin: Geodetic {
                lat_deg: f64_at(head, 16),
                lon_deg: f64_at(head, 24),
                alt_m: f64_at(head, 32),
            },
            edge_min_m: f32_at(head, 40),
            edge_max_m: f32_at(head, 44),
            tested_clearance_m: f32_at(head, 48),
            max_clearance_m: f32_at(head, 52),
            starts: u16_at(head, 56),
            goals: u16_at(head, 58),
        };
        header.check(counts[0])?;
        let view = Self::from_body(header, crc, &covered[HEADER_LEN..], counts);
        view.check_graph()?;
        view.check_landmarks()?;
        view.check_heights()?;
        Ok(view)
    }

    /// A view of `body`, whose length must fit `counts`: the numbers of nodes, half-edges and
    /// landmarks. The bytes after the landmarks are heights. Nothing is checked.
    fn from_body(header: RoadmapHeader, crc: u32, body: &'a [u8], counts: [usize; 3]) -> Self {
        let [node_count, half_edge_count, landmarks] = counts;
        let (nodes, rest) = body.split_at(node_count * NODE_LEN);
        let (offsets, rest) = rest.split_at((node_count + 1) * WORD_LEN);
        let (half_edges, rest) = rest.split_at(half_edge_count * WORD_LEN);
        let (landmarks, heights) = rest.split_at(node_count * landmarks * WORD_LEN);
        Self {
            header,
            crc,
            nodes: nodes.as_chunks().0,
            offsets: offsets.as_chunks().0,
            half_edges: half_edges.as_chunks().0,
            landmarks: landmarks.as_chunks().0,
            heights: heights.as_chunks().0,
        }
    }

    /// Number of nodes; valid indices are below this number.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Number of half-edges, which is twice the number of edges.
    pub fn half_edge_count(&self) -> usize {
        self.half_edges.len()
    }

    /// Length of the roadmap in bytes, CRC included.
    pub fn byte_len(&self) -> usize {
        let words = self.offsets.len() + self.half_edges.len() + self.heights.len() + 1;
        HEADER_LEN
            + self.nodes.len() * NODE_LEN
            + words * WORD_LEN
            + self.landmarks.len() * LANDMARKS_LEN
    }

    /// Whether the roadmap stores distances to landmarks.
    pub fn has_landmarks(&self) -> bool {
        !self.landmarks.is_empty()
    }

    /// Lengths in metres of the shortest paths over all edges from a node to the two landmarks; 0
    /// for a landmark that the node has no path to. Both are 0 if the roadmap has no landmarks.
    #[inline]
    pub(crate) fn landmark_distances_m(&self, node: u16) -> [f32; LANDMARKS] {
        match self.landmarks.get(usize::from(node)) {
            Some(b) => [
                f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
                f32::from_le_bytes([b[4], b[5], b[6], b[7]]),
            ],
            None => [0.0; LANDMARKS],
        }
    }

    /// The file's header.
    pub fn header(&self) -> &RoadmapHeader {
        &self.header
    }

    /// The mission origin, WGS84.
    pub fn origin(&self) -> &Geodetic {
        &self.header.origin
    }

    /// The CRC-32 at the end of the file, by which vehicles compare roadmaps over the radio.
    pub fn crc(&self) -> u32 {
        self.crc
    }

    /// Position of a node in the mission frame, metres; NaN if `node` is not below
    /// [`Self::node_count`].
    #[inline]
    pub fn node(&self, node: u16) -> Point {
        self.nodes.get(usize::from(node)).map_or(Point::from_element(f32::NAN), decode_node)
    }

    /// The half-edges that lead out of a node, targets ascending; none for a node that does not
    /// exist.
    #[inline]
    pub fn half_edges(&self, node: u16) -> impl ExactSizeIterator<Item = HalfEdge> + use<'a> {
        self.half_edge_row(node).1.iter().map(HalfEdge::from_bytes)
    }

    /// The half-edge with index `k` in the file.
    #[inline]
    pub(crate) fn half_edge(&self, k: usize) -> HalfEdge {
        HalfEdge::from_bytes(&self.half_edges[k])
    }

    /// The half-edge from `a` to `b`; `None` if the nodes are not joined. O(log degree).
    pub fn edge_between(&self, a: u16, b: u16) -> Option<HalfEdge> {
        let (_, row) = self.half_edge_row(a);
        row.binary_search_by_key(&b, decode_target).ok().map(|i| HalfEdge::from_bytes(&row[i]))
    }

    /// Straight-line distance between two nodes, metres; NaN if either does not exist.
    #[inline]
    pub fn distance_m(&self, a: u16, b: u16) -> f32 {
        fpu::sqrtf((self.node(b) - self.node(a)).norm_squared())
    }

    /// Whether a vehicle that needs `required_m` (radius + safety margin) may fly `edge`. The
    /// edge's clearance must be greater than `required_m`; equal is blocked. A requirement up to
    /// the header's tested clearance is met by every edge.
    #[inline]
    pub fn has_clearance(&self, edge: &HalfEdge, required_m: f32) -> bool {
        edge.clearance_m > required_m || required_m <= self.header.tested_clearance_m
    }

    /// Index of a node's first half-edge, and the bytes of all its half-edges.
    #[inline]
    pub(crate) fn half_edge_row(&self, node: u16) -> (usize, &'a [[u8; WORD_LEN]]) {
        let at = usize::from(node);
        match self.offsets.get(at..at + 2) {
            Some([from, to]) => {
                let (from, to) =
                    (u32::from_le_bytes(*from) as usize, u32::from_le_bytes(*to) as usize);
                (from, self.half_edges.get(from..to).unwrap_or(&[]))
            }
            _ => (0, &[]),
        }
    }
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
    let sound = half_edge_count % 2 == 0 && (landmarks == 0 || landmarks == LANDMARKS);
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

fn u16_at(head: &[u8; HEADER_LEN], at: usize) -> u16 {
    u16::from_le_bytes([head[at], head[at + 1]])
}

fn u32_at(head: &[u8; HEADER_LEN], at: usize) -> u32 {
    u32::from(u16_at(head, at)) | u32::from(u16_at(head, at + 2)) << 16
}

fn f32_at(head: &[u8; HEADER_LEN], at: usize) -> f32 {
    f32::from_bits(u32_at(head, at))
}

fn f64_at(head: &[u8; HEADER_LEN], at: usize) -> f64 {
    f64::from_bits(u64::from(u32_at(head, at)) | u64::from(u32_at(head, at + 4)) << 32)
}

#[cfg(test)]
pub(crate) mod tests;
