//! The inputs from which all vehicles compute the same division.

use heapless::Vec;

use crate::link::roster::{RosterReportEntry, ShareStatus};

/// What a division takes into account of one vehicle: as
/// [`planner_core::coverage::losses::VehicleStatus`], in decimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct VehicleDivisionInput {
    /// Whether the vehicle flies on, and gets a part of what is divided.
    pub alive: bool,
    /// Place along its path, decimetres, up to which it takes, or took, its pictures;
    /// [`VehicleDivisionInput::WHOLE_PATH`] where it took all of them.
    pub along_dm: u16,
}

impl VehicleDivisionInput {
    /// Value of `along_dm` for a vehicle that took all pictures of its path.
    pub const WHOLE_PATH: u16 = u16::MAX;

    /// The input of a vehicle, from its entry in the roster report.
    pub fn from_entry(entry: &RosterReportEntry) -> Self {
        let along_dm = match entry.status {
            ShareStatus::Alive => entry.commitment_dm.unwrap_or(entry.progress_dm),
            ShareStatus::Lost | ShareStatus::Left => entry.progress_dm,
            ShareStatus::Finished => Self::WHOLE_PATH,
        };
        Self { alive: entry.status == ShareStatus::Alive, along_dm }
    }

    /// `along_dm` in metres; infinite for [`VehicleDivisionInput::WHOLE_PATH`].
    pub fn along_m(&self) -> f32 {
        if self.along_dm == Self::WHOLE_PATH {
            f32::INFINITY
        } else {
            f32::from(self.along_dm) / 10.0
        }
    }
}

/// The inputs of all vehicles, by their rank in the roster.
pub type DivisionInputs<const V: usize> = Vec<VehicleDivisionInput, V>;
