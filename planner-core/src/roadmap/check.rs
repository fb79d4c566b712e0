//! The checks of a roadmap file's content: rows in order, each edge stored from both ends within
//! the header's limits, and distances to landmarks that are those of shortest paths.

use super::format::{
    LANDMARK_COUNT, MAX_LANDMARK_DISTANCE_M, MAX_NODES, RoadmapError, has_valid_coordinates,
};
use super::view::RoadmapView;

impl RoadmapView<'_> {
    /// Checks row offsets, coordinates, targets, opposite half-edges, clearances and lengths.
    pub(super) fn check_graph(&self) -> Result<(), RoadmapError> {
        // Rows first: the opposite of a half-edge is looked up by binary search in a row that must
        // be known to be valid.
        let mut end = 0;
        for (i, raw) in self.offsets.iter().enumerate() {
            let node = i.min(MAX_NODES) as u16;
            let offset = u32::from_le_bytes(*raw) as usize;
            if offset < end || offset > self.half_edges.len() || (i == 0 && offset != 0) {
                return Err(RoadmapError::Offset(node));
            }
            end = offset;
        }
        if end != self.half_edges.len() {
            return Err(RoadmapError::Offset(self.nodes.len() as u16));
        }
        for node in 0..self.nodes.len() as u16 {
            if !has_valid_coordinates(&self.node(node)) {
                return Err(RoadmapError::Node(node));
            }
            let mut previous = None;
            for edge in self.half_edges(node) {
                let sound = usize::from(edge.target) < self.nodes.len() && edge.target != node;
                if !sound || previous.is_some_and(|p| p >= edge.target) {
                    return Err(RoadmapError::Target(node));
                }
                previous = Some(edge.target);
            }
        }
        let (least_m, most_m) = self.header.clearance_limits_m();
        for node in 0..self.nodes.len() as u16 {
            let here = self.node(node);
            for edge in self.half_edges(node) {
                if self.edge_between(edge.target, node).map(|e| e.clearance_m)
                    != Some(edge.clearance_m)
                {
                    return Err(RoadmapError::OneWay(node));
                }
                if !(least_m..=most_m).contains(&edge.clearance_m) {
                    return Err(RoadmapError::EdgeClearance(node));
                }
                let there = self.node(edge.target);
                if (there - here).norm_squared() == 0.0 {
                    return Err(RoadmapError::ZeroLength(node));
                }
                if !self.header.is_edge_length_valid(&here, &there) {
                    return Err(RoadmapError::EdgeLength(node));
                }
            }
        }
        Ok(())
    }

    /// Checks that the distances to landmarks are, to the bit, the shortest ones over all edges;
    /// only then are their differences lower bounds. No search is needed. The distances are right
    /// if the landmark's own is zero, no edge would give a node a shorter distance than the file
    /// has for it, and each other distance is the sum of an edge's length and the smaller distance
    /// at that edge's other end. (Following ever smaller distances leads to the landmark, so none
    /// is too small; along the true shortest path, none is too large.)
    pub(super) fn check_landmarks(&self) -> Result<(), RoadmapError> {
        if self.landmark_distances.is_empty() {
            return Ok(());
        }
        let nodes = 0..self.nodes.len() as u16;
        let (mut farthest, mut farthest_m) = (0, 0.0);
        for node in nodes.clone() {
            let [way_m, _] = self.landmark_distances_m(node);
            if way_m > farthest_m {
                (farthest, farthest_m) = (node, way_m);
            }
        }
        let landmarks = [0, farthest];
        for node in nodes {
            let here = self.landmark_distances_m(node);
            let (mut sound, mut explained) = (true, [false; LANDMARK_COUNT]);
            for edge in self.half_edges(node) {
                let length = self.distance_m(node, edge.target);
                let there = self.landmark_distances_m(edge.target);
                for i in 0..LANDMARK_COUNT {
                    let reached = there[i] > 0.0 || edge.target == landmarks[i];
                    let way = there[i] + length;
                    sound &= !reached || here[i] <= way && (here[i] > 0.0 || node == landmarks[i]);
                    explained[i] |= reached && here[i] == way && there[i] < here[i];
                }
            }
            for i in 0..LANDMARK_COUNT {
                sound &= match here[i] {
                    0.0 => true,
                    way => {
                        way > 0.0
                            && way <= MAX_LANDMARK_DISTANCE_M
                            && explained[i]
                            && node != landmarks[i]
                    }
                };
            }
            if !sound {
                return Err(RoadmapError::Landmark(node));
            }
        }
        Ok(())
    }
}
