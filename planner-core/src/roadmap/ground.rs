//! The ground below nodes, and the ground below any place, found from the nodes around it.
//!
//! The desk writes with each node how high it is over the first obstacle below it. Between a node
//! and its ground all is free, so a place beside it at a height between the two is on the same
//! storey. A node that is lower than the place may be below the storey's floor, but not if it is
//! lower by less than twice the clearance of every edge: both have that much room.

use libm::{fmaxf, fminf};

use super::{MAX_LANDMARK_DISTANCE_M, RoadmapError, RoadmapView};
use crate::Point;

/// Horizontal distance within which nodes show the ground below a place, metres.
pub const GROUND_REACH_M: f32 = 3.0;
/// Most nodes, the nearest ones, that show the ground below a place. Fewer know too little where
/// the floor has edges, more see the ground too wide to leave a path; measured by
/// `tests/tests/detours.rs`.
const MAX_GROUND_NODES: usize = 6;

impl RoadmapView<'_> {
    /// Height of the ground below a node, metres; `None` where the file does not say, or nothing is
    /// below.
    pub fn ground_m(&self, node: u16) -> Option<f32> {
        let height_m = f32::from_le_bytes(*self.heights.get(usize::from(node))?);
        height_m.is_finite().then(|| self.node(node).z - height_m)
    }

    /// The lowest and the highest ground that the nodes around a place have on its storey, metres;
    /// `None` where none has any. O(nodes).
    pub fn ground_range_near(&self, place: &Point) -> Option<(f32, f32)> {
        let room_m = 2.0 * self.header.tested_clearance_m;
        let mut nearest = [(GROUND_REACH_M * GROUND_REACH_M, None); MAX_GROUND_NODES];
        for node in 0..self.heights.len() as u16 {
            let at = self.node(node);
            let (east_m, north_m) = (at.x - place.x, at.y - place.y);
            let across = east_m * east_m + north_m * north_m;
            if across >= nearest[MAX_GROUND_NODES - 1].0 || at.z + room_m < place.z {
                continue;
            }
            if let Some(ground_m) = self.ground_m(node).filter(|ground_m| *ground_m <= place.z) {
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
