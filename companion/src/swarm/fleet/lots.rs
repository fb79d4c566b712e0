//! What a division follows from.

use heapless::Vec;

use crate::link::roster::{MemberStatus, RosterReportEntry};

/// Inputs of a division, of one vehicle: as [`planner_core::coverage::losses::VehicleStatus`], in
/// decimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DivisionInput {
    /// Whether it flies on.
    pub alive: bool,
    /// Place along its path up to which the pictures are the vehicle's own;
    /// [`DivisionInput::WHOLE_PATH`] where the vehicle took all of them.
    pub along_dm: u16,
}

impl DivisionInput {
    /// Mark of a vehicle's whole path.
    pub const WHOLE_PATH: u16 = u16::MAX;

    /// The inputs of a vehicle of the roster.
    pub fn from_entry(entry: &RosterReportEntry) -> Self {
        let along_dm = match entry.status {
            MemberStatus::Alive => entry.commitment_dm.unwrap_or(entry.progress_dm),
            MemberStatus::Lost | MemberStatus::Left => entry.progress_dm,
            MemberStatus::Finished => Self::WHOLE_PATH,
        };
        Self { alive: entry.status == MemberStatus::Alive, along_dm }
    }

    /// The place, metres; infinite for [`DivisionInput::WHOLE_PATH`].
    pub fn along_m(&self) -> f32 {
        if self.along_dm == Self::WHOLE_PATH {
            f32::INFINITY
        } else {
            f32::from(self.along_dm) / 10.0
        }
    }
}

/// The lots of all vehicles by rank.
pub type DivisionInputs<const V: usize> = Vec<DivisionInput, V>;
