//! A roadmap read in place: its nodes, its half-edges and its distances to landmarks.

use super::format::{
    HEADER_LEN, HEIGHT_LEN, HalfEdge, LANDMARK_COUNT, LANDMARK_DISTANCES_LEN, NODE_LEN,
    RoadmapError, RoadmapHeader, WORD_LEN, declared_len, decode_node, decode_target, f32_at,
    f64_at, u16_at, u32_at,
};
use crate::Point;
use crate::file::{CRC32, FileError};
use crate::geo::frames::Geodetic;

/// A checked roadmap over borrowed bytes. Copying it copies five slices, not the nodes and edges.
#[derive(Clone, Copy, Debug)]
pub struct RoadmapView<'a> {
    pub(super) header: RoadmapHeader,
    /// The CRC-32 at the end of the file.
    crc: u32,
    /// The positions of the nodes, as in the file.
    pub(super) nodes: &'a [[u8; NODE_LEN]],
    /// For each node the index of its first half-edge, then the number of half-edges.
    pub(super) offsets: &'a [[u8; WORD_LEN]],
    /// The half-edges of all nodes, those of node 0 first.
    pub(super) half_edges: &'a [[u8; WORD_LEN]],
    /// The distances to the landmarks, an entry for each node; empty if the roadmap has no
    /// landmarks.
    pub(super) landmark_distances: &'a [[u8; LANDMARK_DISTANCES_LEN]],
    /// The heights above the ground, an entry for each node; empty if the roadmap has none.
    pub(super) heights: &'a [[u8; HEIGHT_LEN]],
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
            start_count: u16_at(head, 56),
            goal_count: u16_at(head, 58),
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
    pub(super) fn from_body(
        header: RoadmapHeader,
        crc: u32,
        body: &'a [u8],
        counts: [usize; 3],
    ) -> Self {
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
            landmark_distances: landmarks.as_chunks().0,
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
            + self.landmark_distances.len() * LANDMARK_DISTANCES_LEN
    }

    /// Whether the roadmap stores distances to landmarks.
    pub fn has_landmarks(&self) -> bool {
        !self.landmark_distances.is_empty()
    }

    /// Lengths in metres of the shortest paths over all edges from a node to the two landmarks; 0
    /// for a landmark that the node has no path to. Both are 0 if the roadmap has no landmarks.
    #[inline]
    pub(crate) fn landmark_distances_m(&self, node: u16) -> [f32; LANDMARK_COUNT] {
        match self.landmark_distances.get(usize::from(node)) {
            Some(b) => [
                f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
                f32::from_le_bytes([b[4], b[5], b[6], b[7]]),
            ],
            None => [0.0; LANDMARK_COUNT],
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
