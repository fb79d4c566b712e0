//! Lanes, and the way along all of them.

use crate::Length;
use heapless::Vec;
use libm::{ceilf, fmaxf};

use super::footprint::Spacing;
use super::transit::Transit;
use super::{CoverageError, Flat};

/// Most waypoints of an area: an f32 counts them exactly.
const MAX_WAYPOINTS: f32 = (1 << 24) as f32;

/// Inputs of lanes, besides the area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LanePattern {
    /// Footprint and spacings.
    pub spacing: Spacing,
    /// Direction of the lanes, degrees from east to the left; the one of least width where absent.
    pub angle_deg: Option<f32>,
    /// Distance beyond the area's edge at which lanes begin and end, metres.
    pub margin_m: f32,
    /// Most changes of the lanes' order that are looked at; few of them cost distances around
    /// zones.
    pub search_steps: u32,
}

/// One lane. Waypoint `k` lies `k / (count − 1)` of the way from `from` to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lane {
    /// Start of the lane.
    pub from: Flat,
    /// End of the lane.
    pub to: Flat,
    /// Number of its first waypoint, counted along the whole path; while lanes are ordered, that of
    /// its cell.
    pub first: u32,
    /// Waypoints on it, at least 1.
    pub count: u32,
    /// Length of the whole path before its first waypoint, metres; while lanes are ordered, of the
    /// way to the next one.
    pub start_m: f32,
    /// The strip it lies in.
    pub strip: u16,
}

impl Lane {
    /// Length of the lane, metres.
    pub fn length_m(&self) -> f32 {
        (self.to - self.from).length()
    }

    /// Waypoint `k` of it, from 0: the last one for numbers beyond.
    pub fn waypoint(&self, k: u32) -> Flat {
        if self.count < 2 {
            self.from
        } else {
            self.from + (self.to - self.from) * self.fraction_at(k)
        }
    }

    fn fraction_at(&self, k: u32) -> f32 {
        if self.count < 2 { 0.0 } else { k.min(self.count - 1) as f32 / (self.count - 1) as f32 }
    }

    /// Reverses the direction of the lane.
    pub(super) fn reverse(&mut self) {
        core::mem::swap(&mut self.from, &mut self.to);
    }
}

/// All lanes in the order in which one vehicle would fly them: at most `L`.
#[derive(Clone, Debug, Default)]
pub struct Tracks<const L: usize> {
    pub(super) lanes: Vec<Lane, L>,
    pub(super) along: Flat,
}

impl<const L: usize> Tracks<L> {
    /// No lanes: all zeros.
    pub const fn new() -> Self {
        Self { lanes: Vec::new(), along: Flat::new(0.0, 0.0) }
    }

    /// The direction along the lanes, of length 1; 0 where there are none.
    pub fn lane_direction(&self) -> Flat {
        self.along
    }

    /// The lanes.
    pub fn lanes(&self) -> &[Lane] {
        &self.lanes
    }

    /// Number of waypoints.
    pub fn waypoint_count(&self) -> u32 {
        self.lanes.last().map_or(0, |lane| lane.first + lane.count)
    }

    /// Length of the whole path, metres.
    pub fn length_m(&self) -> f32 {
        self.lanes.last().map_or(0.0, |lane| lane.start_m + lane.length_m())
    }

    /// The lane of a waypoint, by number: the last lane for numbers beyond.
    pub fn lane_of(&self, waypoint: u32) -> usize {
        self.lanes.partition_point(|lane| lane.first <= waypoint).saturating_sub(1)
    }

    /// Place of a waypoint.
    pub fn waypoint(&self, number: u32) -> Option<Flat> {
        let lane = self.lanes.get(self.lane_of(number))?;
        let k = number.checked_sub(lane.first).filter(|k| *k < lane.count)?;
        Some(lane.waypoint(k))
    }

    /// Length of the path up to a waypoint, metres: up to the last one for numbers beyond.
    pub fn distance_to_waypoint_m(&self, number: u32) -> f32 {
        let Some(lane) = self.lanes.get(self.lane_of(number)) else { return 0.0 };
        lane.start_m + lane.length_m() * lane.fraction_at(number - lane.first)
    }

    /// Numbers the waypoints and computes the lengths along the path.
    pub(super) fn number_waypoints<const N: usize>(
        &mut self,
        spacing: &Spacing,
        transit: &Transit<'_, N>,
    ) -> Result<(), CoverageError> {
        for lane in &mut self.lanes {
            let steps = ceilf(lane.length_m() / spacing.waypoint_m - 1e-3);
            if steps > MAX_WAYPOINTS {
                return Err(CoverageError::Setting("waypoint_m"));
            }
            lane.count = if lane.length_m() < super::area::SAME_VERTEX_M {
                1
            } else {
                fmaxf(steps, 1.0) as u32 + 1
            };
        }
        self.measure_lengths(transit)
    }

    /// Numbers the waypoints that each lane already has, and computes the lengths along the path.
    pub(super) fn measure_lengths<const N: usize>(
        &mut self,
        transit: &Transit<'_, N>,
    ) -> Result<(), CoverageError> {
        let (mut first, mut start_m) = (0, 0.0);
        let mut before: Option<Flat> = None;
        for lane in &mut self.lanes {
            if let Some(before) = before {
                start_m += transit.distance_m(&before, &lane.from);
            }
            (lane.first, lane.start_m) = (first, start_m);
            first += lane.count;
            if first as f32 > MAX_WAYPOINTS {
                return Err(CoverageError::Setting("waypoint_m"));
            }
            start_m += lane.length_m();
            before = Some(lane.to);
        }
        if start_m.is_finite() { Ok(()) } else { Err(CoverageError::Unreachable) }
    }
}
