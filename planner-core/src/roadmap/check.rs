//! What makes a file a roadmap: rows in order, edges both ways within the header's limits, ways to
//! the landmarks that are right.

use super::{LANDMARKS, MAX_LANDMARK_DISTANCE_M, MAX_NODES, RoadmapError, RoadmapView, in_range};

impl RoadmapView<'_> {
    /// Rows, nodes and edges are what the header and one another say.
    pub(super) fn check_graph(&self) -> Result<(), RoadmapError> {
        // Ranges first: the opposite of a half-edge is looked up in a row that must already be
        // known to be sound.
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
            if !in_range(&self.node(node)) {
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
        let (least_m, most_m) = self.header.clearances();
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

    /// The ways to the landmarks must be, to the bit, those that a search over all edges finds;
    /// then their differences bound every way from below. Nothing is searched: the ways are right
    /// if that to the landmark is zero, no edge shortens one, and each other one is the sum of an
    /// edge and of a shorter way from the edge's other end. (Along the shorter ways one comes to
    /// the landmark, so none is too short; along the true shortest way, none is too long.)
    pub(super) fn check_landmarks(&self) -> Result<(), RoadmapError> {
        if self.landmarks.is_empty() {
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
            let (mut sound, mut explained) = (true, [false; LANDMARKS]);
            for edge in self.half_edges(node) {
                let length = self.distance_m(node, edge.target);
                let there = self.landmark_distances_m(edge.target);
                for i in 0..LANDMARKS {
                    let reached = there[i] > 0.0 || edge.target == landmarks[i];
                    let way = there[i] + length;
                    sound &= !reached || here[i] <= way && (here[i] > 0.0 || node == landmarks[i]);
                    explained[i] |= reached && here[i] == way && there[i] < here[i];
                }
            }
            for i in 0..LANDMARKS {
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
