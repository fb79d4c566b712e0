//! Lanes, and the path along all of them.

use crate::Length;
use heapless::Vec;
use libm::{ceilf, fmaxf};

use super::footprint::Spacing;
use super::transit::TransitGraph;
use super::{CoverageError, Flat};

/// Most waypoints of an area: up to here f32 counts exactly.
const MAX_WAYPOINTS: f32 = (1 << 24) as f32;

/// Settings by which lanes are laid over an area: spacings, direction, margin, search
/// effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LanePattern {
    /// Footprint of an image, and spacings.
    pub spacing: Spacing,
    /// Direction of the lanes, degrees counter-clockwise from east; `None` chooses the direction
    /// across which the area is least wide.
    pub angle_from_east_deg: Option<f32>,
    /// Distance by which lanes begin before and end beyond the area's border, metres.
    pub border_overshoot_m: f32,
    /// Most changes of the lanes' order that the local search tries; only few of them compute a
    /// distance around zones.
    pub max_search_steps: u32,
}

/// One lane. Its waypoint `k` lies at the fraction `k / (count − 1)` of the way from `from` to
/// `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lane {
    /// First waypoint of the lane in the direction of flight, east and north.
    pub from: Flat,
    /// Last waypoint of the lane.
    pub to: Flat,
    /// Number of the lane's first waypoint along the whole path. While lanes are being ordered: the
    /// number of the lane's cell.
    pub first_waypoint: u32,
    /// Number of waypoints on the lane, at least 1.
    pub waypoint_count: u32,
    /// Length of the path from its beginning to this lane, metres. While lanes are being ordered:
    /// length of the link to the next lane.
    pub start_along_m: f32,
    /// Index of the strip in which the lane lies, from 0, counted across the lanes.
    pub strip: u16,
}

impl Lane {
    /// Length of the lane, metres.
    pub fn length_m(&self) -> f32 {
        (self.to - self.from).length()
    }

    /// Waypoint `k` of the lane, counted from 0; the last one for a larger `k`.
    pub fn waypoint(&self, k: u32) -> Flat {
        if self.waypoint_count < 2 {
            self.from
        } else {
            self.from + (self.to - self.from) * self.fraction_at(k)
        }
    }

    /// Fraction of the way from `from` to `to` at which waypoint `k` lies.
    fn fraction_at(&self, k: u32) -> f32 {
        if self.waypoint_count < 2 {
            0.0
        } else {
            k.min(self.waypoint_count - 1) as f32 / (self.waypoint_count - 1) as f32
        }
    }

    /// While lanes are being ordered: the number of the lane's cell, kept in `first_waypoint`.
    pub(super) fn cell(&self) -> u32 {
        self.first_waypoint
    }

    /// Sets the number that [`Self::cell`] returns.
    pub(super) fn set_cell(&mut self, cell: u32) {
        self.first_waypoint = cell;
    }

    /// While lanes are being ordered: length of the link to the next lane, metres, kept in
    /// `start_along_m`.
    pub(super) fn link_to_next_m(&self) -> f32 {
        self.start_along_m
    }

    /// Sets the length that [`Self::link_to_next_m`] returns.
    pub(super) fn set_link_to_next_m(&mut self, link_m: f32) {
        self.start_along_m = link_m;
    }

    /// Reverses the direction of the lane.
    pub(super) fn reverse(&mut self) {
        core::mem::swap(&mut self.from, &mut self.to);
    }
}

/// All lanes of an area, at most `L`, in the order in which one vehicle would fly them.
#[derive(Clone, Debug, Default)]
pub struct Tracks<const L: usize> {
    pub(super) lanes: Vec<Lane, L>,
    /// Unit vector along the lanes.
    pub(super) lane_direction: Flat,
}

impl<const L: usize> Tracks<L> {
    /// Creates an empty path, without lanes: all zeros.
    pub const fn new() -> Self {
        Self { lanes: Vec::new(), lane_direction: Flat::new(0.0, 0.0) }
    }

    /// Unit vector along the lanes, east and north; 0 if there are no lanes.
    pub fn lane_direction(&self) -> Flat {
        self.lane_direction
    }

    /// The lanes in the order of the path.
    pub fn lanes(&self) -> &[Lane] {
        &self.lanes
    }

    /// Number of waypoints of all lanes.
    pub fn waypoint_count(&self) -> u32 {
        self.lanes.last().map_or(0, |lane| lane.first_waypoint + lane.waypoint_count)
    }

    /// Length of the path along all lanes, transits included, metres.
    pub fn length_m(&self) -> f32 {
        self.lanes.last().map_or(0.0, |lane| lane.start_along_m + lane.length_m())
    }

    /// Index of the lane of a waypoint, given by its number; the last lane for a larger number.
    pub fn lane_of(&self, waypoint: u32) -> usize {
        self.lanes.partition_point(|lane| lane.first_waypoint <= waypoint).saturating_sub(1)
    }

    /// Position of a waypoint, east and north; `None` if there is no such number.
    pub fn waypoint(&self, number: u32) -> Option<Flat> {
        let lane = self.lanes.get(self.lane_of(number))?;
        let k = number.checked_sub(lane.first_waypoint).filter(|k| *k < lane.waypoint_count)?;
        Some(lane.waypoint(k))
    }

    /// Length of the path from its beginning to a waypoint, metres; to the last one for a larger
    /// number.
    pub fn distance_to_waypoint_m(&self, number: u32) -> f32 {
        let Some(lane) = self.lanes.get(self.lane_of(number)) else { return 0.0 };
        lane.start_along_m + lane.length_m() * lane.fraction_at(number - lane.first_waypoint)
    }

    /// Sets the number of waypoints of each lane by the spacing, numbers them, and computes lengths
    /// along the path.
    pub(super) fn space_waypoints<const N: usize>(
        &mut self,
        spacing: &Spacing,
        transit: &TransitGraph<'_, N>,
    ) -> Result<(), CoverageError> {
        for lane in &mut self.lanes {
            let steps = ceilf(lane.length_m() / spacing.max_waypoint_spacing_m - 1e-3);
            if steps > MAX_WAYPOINTS {
                return Err(CoverageError::SettingOutOfRange("waypoint_m"));
            }
            lane.waypoint_count = if lane.length_m() < super::area::SAME_VERTEX_M {
                1
            } else {
                fmaxf(steps, 1.0) as u32 + 1
            };
        }
        self.number_and_measure(transit)
    }

    /// Numbers the waypoints that each lane already has, and computes lengths along the path.
    pub(super) fn number_and_measure<const N: usize>(
        &mut self,
        transit: &TransitGraph<'_, N>,
    ) -> Result<(), CoverageError> {
        let (mut first, mut start_m) = (0, 0.0);
        let mut before: Option<Flat> = None;
        for lane in &mut self.lanes {
            if let Some(before) = before {
                start_m += transit.distance_m(&before, &lane.from);
            }
            (lane.first_waypoint, lane.start_along_m) = (first, start_m);
            first += lane.waypoint_count;
            if first as f32 > MAX_WAYPOINTS {
                return Err(CoverageError::SettingOutOfRange("waypoint_m"));
            }
            start_m += lane.length_m();
            before = Some(lane.to);
        }
        if start_m.is_finite() { Ok(()) } else { Err(CoverageError::Unreachable) }
    }
}
