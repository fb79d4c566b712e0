//! Ground height below nodes, and an estimate of the ground height below any point from the nodes
//! around it.
//!
//! The desktop writes with each node its height above the first obstacle below it. Between a node
//! and its ground all space is free, so a point beside the node at a height between the two is on
//! the same storey. A node lower than the point may be below that storey's floor, but not if it is
//! lower by less than twice the clearance to which all edges were tested: both node and point keep
//! at least that clearance from the floor.

use libm::{fmaxf, fminf};

use super::format::{MAX_LANDMARK_DISTANCE_M, RoadmapError};
use super::view::RoadmapView;
use crate::Point;

/// Horizontal distance within which nodes count for the ground below a point, metres.
pub const MAX_GROUND_NODE_DISTANCE_M: f32 = 3.0;
/// Most nodes, the nearest ones, that count for the ground below a point. With fewer, a step or the
/// end of a floor is missed; with more, the range of heights is too wide for a detour to leave the
/// path. Measured by `tests/tests/detours.rs`.
const MAX_GROUND_NODES: usize = 6;

impl RoadmapView<'_> {
    /// Height of the ground below a node, metres up in the mission frame; `None` if the file has no
    /// heights, or nothing is below the node.
    pub fn ground_z_m(&self, node: u16) -> Option<f32> {
        let height_m = f32::from_le_bytes(*self.heights.get(usize::from(node))?);
        height_m.is_finite().then(|| self.node(node).z - height_m)
    }

    /// Lowest and highest ground around `place`, metres up in the mission frame: that below the
    /// nearest nodes (at most six) on the same storey within [`MAX_GROUND_NODE_DISTANCE_M`]. `None`
    /// if there is no such node. O(nodes).
    pub fn ground_z_range_near(&self, place: &Point) -> Option<(f32, f32)> {
        let room_m = 2.0 * self.header.tested_clearance_m;
        let mut nearest =
            [(MAX_GROUND_NODE_DISTANCE_M * MAX_GROUND_NODE_DISTANCE_M, None); MAX_GROUND_NODES];
        for node in 0..self.heights.len() as u16 {
            let at = self.node(node);
            let (east_m, north_m) = (at.x - place.x, at.y - place.y);
            let across = east_m * east_m + north_m * north_m;
            if across >= nearest[MAX_GROUND_NODES - 1].0 || at.z + room_m < place.z {
                continue;
            }
            if let Some(ground_m) = self.ground_z_m(node).filter(|ground_m| *ground_m <= place.z) {
                let mut witness = (across, Some(ground_m));
                for other in nearest.iter_mut().filter(|other| across < other.0) {
                    core::mem::swap(other, &mut witness);
                }
            }
        }
        let grounds = nearest.iter().filter_map(|(_, ground_m)| *ground_m);
        grounds
            .map(|ground_m| (ground_m, ground_m))
            .reduce(|a, b| (fminf(a.0, b.0), fmaxf(a.1, b.1)))
    }

    /// Checks that each height is from 0 to [`MAX_LANDMARK_DISTANCE_M`], or infinite.
    pub(super) fn check_heights(&self) -> Result<(), RoadmapError> {
        let sound = |height_m: f32| {
            (0.0..=MAX_LANDMARK_DISTANCE_M).contains(&height_m) || height_m == f32::INFINITY
        };
        match self.heights.iter().position(|raw| !sound(f32::from_le_bytes(*raw))) {
            Some(node) => Err(RoadmapError::Height(node as u16)),
            None => Ok(()),
        }
    }
}
