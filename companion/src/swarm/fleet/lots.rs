//! What a division follows from.

use heapless::Vec;

use crate::link::roster::{Entry, Standing};

/// Inputs of a division, of one vehicle: as [`planner_core::coverage::losses::Fate`], in
/// decimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Lot {
    /// Whether it flies on.
    pub lives: bool,
    /// Place along its path up to which the pictures are the vehicle's own; [`Lot::WHOLE_PATH`] where
    /// the vehicle took all of them.
    pub along_dm: u16,
}

impl Lot {
    /// Mark of a vehicle's whole path.
    pub const WHOLE_PATH: u16 = u16::MAX;

    /// The inputs of a vehicle of the roster.
    pub fn of(entry: &Entry) -> Self {
        let along_dm = match entry.standing {
            Standing::Alive => entry.promise_dm.unwrap_or(entry.done_dm),
            Standing::Lost | Standing::Left => entry.done_dm,
            Standing::Finished => Self::WHOLE_PATH,
        };
        Self { lives: entry.standing == Standing::Alive, along_dm }
    }

    /// The place, metres; infinite for [`Lot::WHOLE_PATH`].
    pub fn along_m(&self) -> f32 {
        if self.along_dm == Self::WHOLE_PATH { f32::INFINITY } else { f32::from(self.along_dm) / 10.0 }
    }
}

/// The lots of all vehicles by rank.
pub type Lots<const V: usize> = Vec<Lot, V>;
