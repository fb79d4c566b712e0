//! The roadmap file: a graph of free nodes and clear edges, read in place from flash.
//!
//! Little-endian, versioned, closed by a CRC-32; byte by byte in `planner-core/README.md`. Nodes
//! are mission-frame points, edges are stored from both ends (half-edges) in compressed sparse
//! rows, neighbours in ascending order. A half-edge takes four bytes: its length follows from the
//! nodes, its clearance is kept in whole millimetres rounded down, so that 4096 nodes and 65536
//! half-edges take 320 kB, 32 kB more with landmarks. One roadmap built at a small margin serves
//! vehicles of any size, because each edge carries the clearance it really has (P3D Table 1 from a
//! single build).
//!
//! A roadmap may carry the lengths of the ways from each node to two landmarks, eight bytes a node.
//! By the triangle inequality their differences bound the way between any two nodes from below, in
//! a building better than the straight line does (ALT: Goldberg and Harrelson 2005, "Computing the
//! Shortest Path: A* Search Meets Graph Theory").
//!
//! It may carry each node's height over the ground too, four bytes a node, so that a board without
//! a map knows where something that falls comes to rest ([`RoadmapView::ground_range_near`]).
//!
//! [`RoadmapView::parse`] checks everything once, in O(nodes + half-edges · log degree); afterwards
//! no accessor can meet an offset or a target out of range, and A* finds shortest ways, whatever
//! the bytes were. Whether an edge is as clear as it says only the map can tell.

use crate::Point;
use crate::file::{CRC32, FileError};
use crate::frames::Geodetic;
use crate::prm::squared_length;

mod check;
mod ground;
mod write;
pub use ground::GROUND_REACH_M;
pub use write::{Edge, encoded_len, write, write_with_landmarks};

/// First eight bytes of the file.
pub const MAGIC: [u8; 8] = *b"FLKROAD\n";
/// Version of a roadmap file that says how high each node is over the ground.
pub const VERSION: u16 = 2;
/// Version of a roadmap file without heights; this version is written and read as well.
const VERSION_WITHOUT_HEIGHTS: u16 = 1;
/// Bytes before the first node.
pub const HEADER_LEN: usize = 72;
/// Most nodes an index of 16 bits can name; index 65535 stays free to mean "none".
pub const MAX_NODES: usize = u16::MAX as usize;
/// Largest coordinate magnitude, metres: up to there f32 distinguishes places a millimetre apart.
pub const MAX_COORDINATE_M: f32 = 16_384.0;
/// Longest edge a roadmap may have, metres. The schedule checks each metre of an edge, so this
/// bounds its work.
pub const MAX_EDGE_M: f32 = 100.0;
/// Longest path from a node to a landmark, metres: up to this length a sum of edges is right to 4
/// mm an edge.
pub const MAX_LANDMARK_DISTANCE_M: f32 = 4.0 * MAX_COORDINATE_M;
/// Largest clearance a half-edge can carry, metres.
pub const MAX_CLEARANCE_M: f32 = 65.535;

/// Number of landmarks of a roadmap that has landmarks.
pub const LANDMARKS: usize = 2;

const NODE_LEN: usize = 12;
const LANDMARKS_LEN: usize = 4 * LANDMARKS;
const HEIGHT_LEN: usize = 4;
const WORD_LEN: usize = 4;

/// Reason why a roadmap was refused, on reading or writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoadmapError {
    /// The bytes are no whole file.
    File(FileError),
    /// The node of this index is NaN, infinite or beyond [`MAX_COORDINATE_M`].
    Node(u16),
    /// The row of this node is out of order or beyond the half-edges.
    Offset(u16),
    /// A half-edge of this node leads to itself or to no node, or its row is not in ascending
    /// order.
    Target(u16),
    /// A half-edge of this node has no opposite with the same clearance.
    OneWay(u16),
    /// An edge of this node has no length: its two nodes coincide.
    ZeroLength(u16),
    /// An edge of this node is shorter or longer than the header says.
    EdgeLength(u16),
    /// An edge of this node has less clearance than the header says that it was tested at, or more
    /// than can be stored.
    EdgeClearance(u16),
    /// A way from this node to a landmark is beyond [`MAX_LANDMARK_DISTANCE_M`], or is not the one
    /// that a search over all edges finds.
    Landmark(u16),
    /// The height of this node over the ground is NaN, negative or beyond
    /// [`MAX_LANDMARK_DISTANCE_M`], or this node has none and others do.
    Height(u16),
    /// The roadmap has more nodes than the workspace the landmarks are searched in.
    WorkspaceTooSmall,
    /// The roadmap has more than [`MAX_NODES`] nodes.
    TooManyNodes,
    /// The output buffer is smaller than the roadmap; `needed` bytes would do.
    RoadmapFull {
        /// Bytes the roadmap takes.
        needed: usize,
    },
    /// The edge at this index names a node that does not exist.
    EdgeNode(usize),
    /// The edge at this index joins a node to itself.
    SelfLoop(usize),
    /// The edge at this index has a clearance that is NaN, infinite or negative.
    Clearance(usize),
    /// These two nodes are joined twice.
    Duplicate(u16, u16),
}

impl From<FileError> for RoadmapError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Header of a roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadmapHeader {
    /// The mission origin: zero of the nodes' frame.
    pub origin: Geodetic,
    /// Shortest edge the builder allowed (P3D `Dmin`), metres.
    pub edge_min_m: f32,
    /// Longest edge the builder allowed (P3D `Dmax`), metres.
    pub edge_max_m: f32,
    /// Clearance every edge was tested to exceed, metres: no vehicle that needs more than this may
    /// skip [`HalfEdge::clearance_m`].
    pub tested_clearance_m: f32,
    /// Value at which stored clearances saturate, metres: an edge with this value has at least that
    /// much.
    pub max_clearance_m: f32,
    /// Number of start nodes; these are the nodes `0..starts`.
    pub starts: u16,
    /// Number of goal nodes; these are the nodes `starts..starts + goals`.
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

    /// Whether an edge from `a` to `b` has a valid length, by exactly the rule of the builder.
    fn is_edge_length_valid(&self, a: &Point, b: &Point) -> bool {
        let square = squared_length((*a).into(), (*b).into());
        square >= self.edge_min_m * self.edge_min_m && square <= self.edge_max_m * self.edge_max_m
    }

    /// Least and greatest clearance of an edge, metres, as a half-edge carries it. A millimetre
    /// less than tested is rounding: the test is exact, the distance is not.
    fn clearances(&self) -> (f32, f32) {
        let metres = |millimetres: u16| f32::from(millimetres) / 1000.0;
        let most = millimetres_down(self.max_clearance_m);
        (
            metres(millimetres_down(self.tested_clearance_m).min(most).saturating_sub(1)),
            metres(most),
        )
    }
}

/// Computed in f64, where the product is exact, so that rounding can only go down. The cast
/// saturates.
fn millimetres_down(metres: f32) -> u16 {
    (f64::from(metres) * 1000.0) as u16
}

/// One direction of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfEdge {
    /// The node it leads to.
    pub target: u16,
    /// Distance from the segment to the nearest obstacle, metres, rounded down to a millimetre; at
    /// least this much if it equals [`RoadmapHeader::max_clearance_m`].
    pub clearance_m: f32,
}

impl HalfEdge {
    #[inline]
    fn from_bytes(bytes: &[u8; WORD_LEN]) -> Self {
        let millimetres = u16::from_le_bytes([bytes[2], bytes[3]]);
        Self { target: target_of(bytes), clearance_m: f32::from(millimetres) / 1000.0 }
    }
}

/// False for NaN too.
fn in_range(node: &Point) -> bool {
    node.iter().all(|c| libm::fabsf(*c) <= MAX_COORDINATE_M)
}

/// The target of a half-edge as it lies in the file.
#[inline]
pub(crate) fn target_of(bytes: &[u8; WORD_LEN]) -> u16 {
    u16::from_le_bytes([bytes[0], bytes[1]])
}

#[inline(always)]
fn node_of(b: &[u8; NODE_LEN]) -> Point {
    let at = |i: usize| f32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]);
    Point::new(at(0), at(4), at(8))
}

/// A checked roadmap over borrowed bytes. Copying it copies five slices, not the roadmap.
#[derive(Clone, Copy, Debug)]
pub struct RoadmapView<'a> {
    header: RoadmapHeader,
    crc: u32,
    nodes: &'a [[u8; NODE_LEN]],
    offsets: &'a [[u8; WORD_LEN]],
    half_edges: &'a [[u8; WORD_LEN]],
    /// An entry for each node, or none at all.
    landmarks: &'a [[u8; LANDMARKS_LEN]],
    /// An entry for each node, or none at all.
    heights: &'a [[u8; HEIGHT_LEN]],
}

impl<'a> RoadmapView<'a> {
    /// Checks a roadmap at the start of `bytes`; what follows its length is ignored, so a whole
    /// flash slot can be given.
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

    /// The parts of a body that is as long as its counts say, of nodes, half-edges and landmarks;
    /// what is left is heights. Nothing is checked.
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

    /// Number of nodes; node indices are below it.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Number of half-edges: twice the number of edges.
    pub fn half_edge_count(&self) -> usize {
        self.half_edges.len()
    }

    /// Bytes the roadmap takes, CRC included.
    pub fn byte_len(&self) -> usize {
        let words = self.offsets.len() + self.half_edges.len() + self.heights.len() + 1;
        HEADER_LEN
            + self.nodes.len() * NODE_LEN
            + words * WORD_LEN
            + self.landmarks.len() * LANDMARKS_LEN
    }

    /// Whether it carries the ways to landmarks.
    pub fn has_landmarks(&self) -> bool {
        !self.landmarks.is_empty()
    }

    /// Lengths in metres of the shortest ways from a node to the landmarks, over all edges; 0 where
    /// there is none. All 0 if the roadmap has no landmarks.
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

    /// The header.
    pub fn header(&self) -> &RoadmapHeader {
        &self.header
    }

    /// The mission origin.
    pub fn origin(&self) -> &Geodetic {
        &self.header.origin
    }

    /// The CRC-32 at the end of the file: its identity on the radio.
    pub fn crc(&self) -> u32 {
        self.crc
    }

    /// Position of a node, metres; NaN where `node` is not below [`Self::node_count`].
    #[inline]
    pub fn node(&self, node: u16) -> Point {
        self.nodes.get(usize::from(node)).map_or(Point::from_element(f32::NAN), node_of)
    }

    /// The edges out of a node, targets ascending; none for a node that does not exist.
    #[inline]
    pub fn half_edges(&self, node: u16) -> impl ExactSizeIterator<Item = HalfEdge> + use<'a> {
        self.half_edges_of(node).1.iter().map(HalfEdge::from_bytes)
    }

    /// A half-edge by its index.
    #[inline]
    pub(crate) fn half_edge(&self, k: usize) -> HalfEdge {
        HalfEdge::from_bytes(&self.half_edges[k])
    }

    /// The edge from `a` to `b`, if there is one. O(log degree).
    pub fn edge_between(&self, a: u16, b: u16) -> Option<HalfEdge> {
        let (_, row) = self.half_edges_of(a);
        row.binary_search_by_key(&b, target_of).ok().map(|i| HalfEdge::from_bytes(&row[i]))
    }

    /// Straight distance between two nodes, metres; NaN if either does not exist.
    #[inline]
    pub fn distance_m(&self, a: u16, b: u16) -> f32 {
        fpu::sqrtf((self.node(b) - self.node(a)).norm_squared())
    }

    /// Whether a vehicle that needs `required_m` (radius + margin) may fly `edge`. An edge with
    /// exactly the required clearance is blocked, as touching is; up to the tested clearance every
    /// edge of the roadmap is clear.
    #[inline]
    pub fn has_clearance(&self, edge: &HalfEdge, required_m: f32) -> bool {
        edge.clearance_m > required_m || required_m <= self.header.tested_clearance_m
    }

    /// Index of a node's first half-edge, and its half-edges.
    #[inline]
    pub(crate) fn half_edges_of(&self, node: u16) -> (usize, &'a [[u8; WORD_LEN]]) {
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

/// The file length that a header states. The file's version has to be one that this code reads.
///
/// # Errors
/// It is no roadmap, of another version, or its counts are not those of such a length.
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
