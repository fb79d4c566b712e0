//! The roadmap file: a graph of free nodes and clear edges, read in place from flash, not copied.
//!
//! Little-endian, versioned, ends with a CRC-32; its bytes are listed in `planner-core/README.md`.
//! Nodes are points of the mission frame. Each edge is stored once from each end (two half-edges)
//! in compressed sparse rows, targets in ascending order. A half-edge takes four bytes: its length
//! is computed from the nodes, its clearance is stored in whole millimetres, rounded down. So 4096
//! nodes and 65536 half-edges take 328 kB, 33 kB more with landmarks. Because each edge carries its
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
//! ([`RoadmapView::ground_z_range_near`]).
//!
//! [`RoadmapView::parse`] checks the file once, in O(nodes + half-edges · log degree). After that
//! no accessor can meet an offset or a target out of range, and A* finds shortest paths, whatever
//! the bytes were. Parsing cannot check clearances: that takes the map.

mod check;
mod format;
mod ground;
pub mod prm;
pub mod search;
mod view;
mod write;

pub(crate) use format::decode_target;
pub use format::{
    HEADER_LEN, HalfEdge, LANDMARK_COUNT, MAGIC, MAX_CLEARANCE_M, MAX_COORDINATE_M, MAX_EDGE_M,
    MAX_LANDMARK_DISTANCE_M, MAX_NODES, RoadmapError, RoadmapHeader, VERSION, declared_len,
    encoded_len,
};
pub use ground::MAX_GROUND_NODE_DISTANCE_M;
pub use view::RoadmapView;
pub use write::{Edge, write, write_with_landmarks};

#[cfg(test)]
pub(crate) mod tests;
