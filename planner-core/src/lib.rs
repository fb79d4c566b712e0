//! Path, schedule and coverage planning for a swarm of UAVs, over memory that the caller lends.
//!
//! No allocation, no I/O, no clock, no protocol. Lengths are metres, times seconds, angles degrees
//! where a name ends in `_deg` and radians otherwise. Points are ENU (east, north, up) in the
//! mission frame.
//!
//! The caller owns all memory. A map is a slice of 64-bit words, and a function that needs scratch
//! memory takes a workspace by reference:
//!
//! ```
//! use planner_core::Point;
//! use planner_core::map::segment::segment_is_clear;
//! use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
//!
//! // A room of 8 m × 4 m × 4 m in cells of 0.5 m, with a pillar in one column of cells.
//! let shape = GridShape { dims: [16, 8, 8], min: Point::zeros(), resolution_m: 0.5 };
//! let mut words = vec![0; shape.word_count()];
//! for k in 0..8 {
//!     let (word, bit) = shape.word_and_mask([8, 4, k]);
//!     words[word] |= bit;
//! }
//! let grid = VoxelGrid::new(shape, Outside::Blocked, &words)?;
//! let (a, b) = (Point::new(1.0, 1.5, 2.0), Point::new(7.0, 1.5, 2.0));
//! assert!(segment_is_clear(&grid, &a, &b, 0.4), "it passes the pillar at 0.5 m");
//! assert!(!segment_is_clear(&grid, &a, &b, 0.6));
//! # Ok::<(), planner_core::map::voxel::GridError>(())
//! ```
//!
//! `examples/ten_uavs.rs` continues from such a map: roadmap, assignment, paths, schedule and gates
//! of ten UAVs.
#![no_std]
#![forbid(unsafe_code)]

pub mod assignment;
pub mod coverage;
pub mod detour;
pub mod file;
pub mod flight;
pub mod geo;
pub mod map;
pub mod plan;
pub mod roadmap;
pub mod schedule;
mod sort;
pub mod track;

pub use geo::{Length, Point};

/// A setting outside its allowed range; holds the setting's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingError(pub &'static str);

/// Returns an error with the name of the first setting that is not a positive, finite number.
pub(crate) fn check_positive(settings: &[(&'static str, f32)]) -> Result<(), SettingError> {
    match settings.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some((name, _)) => Err(SettingError(name)),
        None => Ok(()),
    }
}
