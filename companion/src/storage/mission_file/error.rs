//! Why a mission file is rejected, for programs and as a text for the operator.

use core::fmt;

use planner_core::file::FileError;

/// Why a mission file was rejected, on reading or writing. Its text has at most 41 characters, so
/// that it fits into a STATUSTEXT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionError {
    /// The bytes are no complete mission file, or its header has an invalid value.
    File(FileError),
    /// The vehicle at this index has no system id, one that another vehicle has, or a number out of
    /// range.
    InvalidVehicle(u16),
    /// In labelled mode, the vehicle with this system id has the same goal as another vehicle.
    SameGoal(u8),
    /// The vehicle with this system id starts outside the geofence.
    StartOutside(u8),
    /// The goal at this index has a number out of range.
    InvalidGoal(u16),
    /// The goal at this index lies outside the geofence.
    GoalOutside(u16),
    /// The output buffer is too small for the mission file of `needed` bytes.
    BufferTooSmall {
        /// Length of the mission file, bytes.
        needed: usize,
    },
    /// The mission has more vehicles or goals than this companion has room for.
    TooManyVehiclesOrGoals,
    /// No vehicle of the mission has this system id.
    NotInRoster(u8),
}

impl fmt::Display for MissionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(error) => error.fmt(f),
            Self::InvalidVehicle(index) => write!(f, "vehicle no. {index} is unsound or twice"),
            Self::SameGoal(id) => write!(f, "vehicle {id} has another one's goal"),
            Self::StartOutside(id) => write!(f, "vehicle {id} starts outside the geofence"),
            Self::InvalidGoal(index) => write!(f, "goal {index} is out of range"),
            Self::GoalOutside(index) => write!(f, "goal {index} lies outside the geofence"),
            Self::BufferTooSmall { needed } => write!(f, "it takes {needed} bytes"),
            Self::TooManyVehiclesOrGoals => write!(f, "it has too many vehicles or goals"),
            Self::NotInRoster(id) => write!(f, "it has no vehicle {id}"),
        }
    }
}

impl From<FileError> for MissionError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}
