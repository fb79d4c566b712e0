//! The coverage block of a mission file: the area, how it is photographed, and each vehicle's share
//! (paper CPP §3); `companion/README.md` lists it byte by byte.
//!
//! Lanes, routes and flights are not in the file: each companion computes them from these numbers.
//! The shares W of POWELL-BINPAT (paper CPP §3.2.3) are computed on the host.

use planner_core::coverage::Flat;
use planner_core::coverage::area::{MAX_VERTEX_COORDINATE_M, Ring, RingKind};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::pack::{Heights, TrackUnit};
use planner_core::file::FileError;
use planner_core::flight::Trigger;

use super::error::MissionError;
use super::numbers::{MAX_SPEED_MPS, f32_at, is_positive_up_to, put_numbers, u16_at, u32_at};
pub use crate::config::UnevenGround;
use crate::margins::{LEASE_RENEWAL_DELAY_S, LEASE_S, UNHEARD_NOTICED_AFTER_S};

/// Bytes of the block before the first vehicle's share.
const HEAD_LEN: usize = 60;
/// Bytes of a vehicle's share in the block.
const SHARE_LEN: usize = 12;
/// Bytes of a ring in the block.
const RING_LEN: usize = 4;
/// Bytes of a vertex in the block.
const VERTEX_LEN: usize = 8;
/// Greatest `search_steps` that a mission file may hold: a board may have to try that many changes
/// of the lanes' order.
pub const MAX_SEARCH_STEPS_OF_FILE: u32 = 20_000_000;

/// Heading of the vehicles on the lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadingRule {
    /// The same heading on all lanes.
    SameOnAllLanes,
    /// The direction of flight.
    DirectionOfFlight,
}

/// Which vehicles a part of the area may be assigned to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartEligibility {
    /// Any vehicle: the shares are sizes of parts, as POWELL found them or all equal.
    Anyone,
    /// Vehicles whose weight is that of the part: the shares are the vehicles' weights.
    SameWeight,
}

/// Settings of a coverage mission that all its vehicles share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverageHeader {
    /// The smallest part of the area that is assigned to one vehicle: a lane or a waypoint.
    pub assignment_unit: TrackUnit,
    /// Which vehicles a part may be assigned to.
    pub part_eligibility: PartEligibility,
    /// Heading of the vehicles on the lanes.
    pub heading_rule: HeadingRule,
    /// How the pictures are triggered.
    pub trigger: Trigger,
    /// Maximum number of changes of the lanes' order that the planner tries.
    pub search_steps: u32,
    /// Height at which pictures are taken, and distance between the layers of transit flights.
    pub heights: Heights,
    /// Footprint of a picture, and distances between lanes and between waypoints.
    pub spacing: Spacing,
    /// Direction of the lanes, degrees from east, counter-clockwise; `None`: the planner takes the
    /// direction across which the area is narrowest.
    pub lane_angle_deg: Option<f32>,
    /// Distance by which lanes begin and end beyond the area's edge, metres.
    pub border_overshoot_m: f32,
    /// Heights of uneven ground; the mission then needs the field whose CRC is its `roadmap_crc`.
    /// `None` for level ground.
    pub ground: Option<UnevenGround>,
}

/// Share and vertical speeds of one vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleShare {
    /// Weight of the vehicle, or size of a part ([`PartEligibility`]); at least 0.
    pub weight: f32,
    /// Speed upwards, m/s.
    pub climb_mps: f32,
    /// Speed downwards, m/s.
    pub descend_mps: f32,
}

/// The coverage block as it is to be written.
#[derive(Clone, Copy, Debug)]
pub struct CoverageBlock<'a> {
    /// Settings that all vehicles share.
    pub header: CoverageHeader,
    /// Share of each vehicle, in the order of the mission's vehicles.
    pub shares: &'a [VehicleShare],
    /// The rings of the area: outer edges, holes and no-fly zones.
    pub rings: &'a [Ring],
    /// Vertices of all rings, metres east and north of the mission's origin.
    pub vertices: &'a [Flat],
}

impl CoverageBlock<'_> {
    /// Length of the block, bytes.
    pub fn encoded_len(&self) -> usize {
        encoded_len(self.shares.len(), self.rings.len(), self.vertices.len())
    }

    /// Writes the block to `out`, which has the block's length.
    pub(super) fn write(&self, out: &mut [u8]) {
        let h = &self.header;
        out[..2].copy_from_slice(&(self.vertices.len() as u16).to_le_bytes());
        out[2..4].copy_from_slice(&(self.rings.len() as u16).to_le_bytes());
        out[4] = u8::from(h.assignment_unit == TrackUnit::Waypoint);
        out[5] = u8::from(h.part_eligibility == PartEligibility::SameWeight);
        out[6] = u8::from(h.heading_rule == HeadingRule::DirectionOfFlight);
        out[7] = match h.trigger {
            Trigger::Distance => 0,
            Trigger::Waypoint => 1,
            Trigger::None => 2,
        };
        out[8..12].copy_from_slice(&h.search_steps.to_le_bytes());
        let Spacing { footprint, max_lane_spacing_m: lane_m, max_waypoint_spacing_m: waypoint_m } =
            h.spacing;
        let angle_deg = h.lane_angle_deg.unwrap_or(f32::NAN);
        let numbers = [
            h.heights.max_picture_height_m,
            h.heights.layer_spacing_m,
            footprint.along_m,
            footprint.across_m,
            lane_m,
            waypoint_m,
            angle_deg,
            h.border_overshoot_m,
        ]
        .into_iter()
        .chain(h.ground.map_or([0.0; 4], |g| {
            [g.min_height_above_ground_m, g.height_tolerance_m, g.low_m, g.high_m]
        }));
        let (head, rest) = out.split_at_mut(HEAD_LEN);
        put_numbers(head, 12, numbers);
        let (shares, rest) = rest.split_at_mut(self.shares.len() * SHARE_LEN);
        put_numbers(
            shares,
            0,
            self.shares.iter().flat_map(|s| [s.weight, s.climb_mps, s.descend_mps]),
        );
        let (rings, vertices) = rest.split_at_mut(self.rings.len() * RING_LEN);
        for (to, ring) in rings.chunks_exact_mut(RING_LEN).zip(self.rings) {
            to[..2].copy_from_slice(&ring.end.to_le_bytes());
            to[2] = match ring.kind {
                RingKind::Outer => 0,
                RingKind::Hole => 1,
                RingKind::NoFly => 2,
            };
            to[3] = 0;
        }
        put_numbers(vertices, 0, self.vertices.iter().flat_map(|v| [v.x, v.y]));
    }
}

/// Length of the block with so many vehicles, rings and vertices, bytes.
pub const fn encoded_len(vehicles: usize, rings: usize, vertices: usize) -> usize {
    HEAD_LEN + vehicles * SHARE_LEN + rings * RING_LEN + vertices * VERTEX_LEN
}

/// A coverage block whose numbers have been checked; it borrows its bytes.
/// [`planner_core::coverage::area::Area::new`] checks whether its rings form an area.
#[derive(Clone, Copy, Debug)]
pub struct CoverageView<'a> {
    /// The decoded numbers at the block's beginning.
    header: CoverageHeader,
    /// The vehicles' shares, as in the file and in the order of its vehicles.
    shares: &'a [[u8; SHARE_LEN]],
    /// The rings, as in the file.
    rings: &'a [[u8; RING_LEN]],
    /// The vertices of all rings, as in the file.
    vertices: &'a [[u8; VERTEX_LEN]],
}

/// Time, in addition to that of its descent, after which a vehicle that no other vehicle hears any
/// more is on the ground, seconds: its lease, age and delay of the last message, the stop, the wait
/// of the row `SwarmLinkLost`, and the slow end of a descent.
const UNHEARD_DOWN_EXCEPT_DESCENT_S: f32 =
    LEASE_S as f32 + UNHEARD_NOTICED_AFTER_S + LEASE_RENEWAL_DELAY_S + 5.0 + 20.0 + 15.0;

impl<'a> CoverageView<'a> {
    /// Time, seconds, after which a vehicle that no other vehicle hears any more is on the ground:
    /// the end of its lease, the delays and the stop (`UNHEARD_DOWN_EXCEPT_DESCENT_S`), and the
    /// descent from the highest layer to the lowest ground at the slowest descent speed.
    pub fn unheard_vehicle_down_after_s(&self) -> f32 {
        let Heights { max_picture_height_m: mission_m, layer_spacing_m: layer_m } =
            self.header.heights;
        let low_m = self.header.ground.map_or(0.0, |ground| ground.low_m);
        let slowest_mps =
            self.shares().map(|share| share.descend_mps).fold(f32::INFINITY, libm::fminf);
        UNHEARD_DOWN_EXCEPT_DESCENT_S
            + (mission_m - low_m + layer_m * self.shares.len() as f32) / slowest_mps
    }

    /// Checks the coverage block of a mission with so many vehicles.
    pub(super) fn parse(b: &'a [u8], vehicles: usize) -> Result<Self, MissionError> {
        let refuse = |name| Err(FileError::Header(name).into());
        let Some(head) = b.first_chunk::<HEAD_LEN>() else { return Err(FileError::Length.into()) };
        let (vertex_count, ring_count) =
            (usize::from(u16_at(head, 0)), usize::from(u16_at(head, 2)));
        if b.len() != encoded_len(vehicles, ring_count, vertex_count) {
            return Err(FileError::Length.into());
        }
        let header = CoverageHeader::parse(head)?;
        let (shares, rest) = b[HEAD_LEN..].split_at(vehicles * SHARE_LEN);
        let (rings, vertices) = rest.split_at(ring_count * RING_LEN);
        let view = Self {
            header,
            shares: shares.as_chunks().0,
            rings: rings.as_chunks().0,
            vertices: vertices.as_chunks().0,
        };
        if let Some(i) = view.shares().position(|share| !share.is_valid()) {
            return Err(MissionError::InvalidVehicle(i as u16));
        }
        if view.rings.iter().any(|ring| ring[2] > 2 || ring[3] != 0) {
            return refuse("rings");
        }
        if view.vertices().any(|v| !v.iter().all(|c| libm::fabsf(*c) <= MAX_VERTEX_COORDINATE_M)) {
            return refuse("vertices");
        }
        Ok(view)
    }

    /// Settings of the coverage mission that all its vehicles share.
    pub fn header(&self) -> &CoverageHeader {
        &self.header
    }

    /// Share of each vehicle, in the order of the mission's vehicles.
    pub fn shares(&self) -> impl ExactSizeIterator<Item = VehicleShare> + '_ {
        self.shares.iter().map(|b| VehicleShare {
            weight: f32_at(b, 0),
            climb_mps: f32_at(b, 4),
            descend_mps: f32_at(b, 8),
        })
    }

    /// The rings of the area: outer edges, holes and no-fly zones.
    pub fn rings(&self) -> impl ExactSizeIterator<Item = Ring> + '_ {
        self.rings.iter().map(|b| Ring {
            end: u16_at(b, 0),
            kind: match b[2] {
                0 => RingKind::Outer,
                1 => RingKind::Hole,
                _ => RingKind::NoFly,
            },
        })
    }

    /// Vertices of all rings, metres east and north of the mission's origin.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = Flat> + '_ {
        self.vertices.iter().map(|b| Flat::new(f32_at(b, 0), f32_at(b, 4)))
    }

    /// Length of the block, bytes.
    pub(super) fn byte_len(&self) -> usize {
        encoded_len(self.shares.len(), self.rings.len(), self.vertices.len())
    }
}

impl VehicleShare {
    /// Whether weight and speeds are in range.
    fn is_valid(&self) -> bool {
        self.weight >= 0.0
            && self.weight.is_finite()
            && is_positive_up_to(self.climb_mps, MAX_SPEED_MPS)
            && is_positive_up_to(self.descend_mps, MAX_SPEED_MPS)
    }
}

impl CoverageHeader {
    /// Reads and checks the bytes before the first vehicle's share.
    fn parse(head: &[u8; HEAD_LEN]) -> Result<Self, MissionError> {
        let refuse = |name| Err(FileError::Header(name).into());
        let angle_deg = f32_at(head, 36);
        let [min_height_above_ground_m, height_tolerance_m, low_m, high_m] =
            [44, 48, 52, 56].map(|at| f32_at(head, at));
        let header = Self {
            assignment_unit: match head[4] {
                0 => TrackUnit::Lane,
                1 => TrackUnit::Waypoint,
                _ => return refuse("unit"),
            },
            part_eligibility: match head[5] {
                0 => PartEligibility::Anyone,
                1 => PartEligibility::SameWeight,
                _ => return refuse("parts"),
            },
            heading_rule: match head[6] {
                0 => HeadingRule::SameOnAllLanes,
                1 => HeadingRule::DirectionOfFlight,
                _ => return refuse("heading"),
            },
            trigger: match head[7] {
                0 => Trigger::Distance,
                1 => Trigger::Waypoint,
                2 => Trigger::None,
                _ => return refuse("trigger"),
            },
            search_steps: u32_at(head, 8),
            heights: Heights {
                max_picture_height_m: f32_at(head, 12),
                layer_spacing_m: f32_at(head, 16),
            },
            spacing: Spacing {
                footprint: Footprint { along_m: f32_at(head, 20), across_m: f32_at(head, 24) },
                max_lane_spacing_m: f32_at(head, 28),
                max_waypoint_spacing_m: f32_at(head, 32),
            },
            lane_angle_deg: (!angle_deg.is_nan()).then_some(angle_deg),
            border_overshoot_m: f32_at(head, 40),
            ground: (head[44..60] != [0; 16]).then_some(UnevenGround {
                min_height_above_ground_m,
                height_tolerance_m,
                low_m,
                high_m,
            }),
        };
        header.check()?;
        Ok(header)
    }

    /// Checks all values of the header; the error names the first that is wrong.
    fn check(&self) -> Result<(), MissionError> {
        let refuse = |name| Err(FileError::Header(name).into());
        if self.spacing.check().is_err() {
            return refuse("spacing");
        }
        let heights = [self.heights.max_picture_height_m, self.heights.layer_spacing_m];
        if !heights.iter().all(|h| is_positive_up_to(*h, MAX_VERTEX_COORDINATE_M)) {
            return refuse("heights");
        }
        if self.search_steps > MAX_SEARCH_STEPS_OF_FILE {
            return refuse("search_steps");
        }
        if self.lane_angle_deg.is_some_and(|angle| !angle.is_finite()) {
            return refuse("angle_deg");
        }
        if !(0.0..=MAX_VERTEX_COORDINATE_M).contains(&self.border_overshoot_m) {
            return refuse("margin_m");
        }
        let sound = |ground: &UnevenGround| {
            let ends = [ground.low_m, ground.high_m];
            is_positive_up_to(ground.min_height_above_ground_m, MAX_VERTEX_COORDINATE_M)
                && is_positive_up_to(ground.height_tolerance_m, MAX_VERTEX_COORDINATE_M)
                && ends.iter().all(|m| libm::fabsf(*m) <= MAX_VERTEX_COORDINATE_M)
                && ground.low_m <= ground.high_m
                && ground.high_m + ground.min_height_above_ground_m
                    <= self.heights.max_picture_height_m
        };
        if !self.ground.as_ref().is_none_or(sound) {
            return refuse("ground");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
