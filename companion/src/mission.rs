//! The mission as an ordered transition table and a pure update function.
//!
//! [`first_applicable_row`] goes through [`TABLE`] from the top and takes the first row whose
//! `from` contains the state and whose guard has been met for the row's limit. Earlier rows have
//! priority: those of the pilot and the failsafe come first. `docs/table.md` prints the same table,
//! and a test compares the two.

pub(crate) mod course;
mod guard;
mod inputs;
mod pending;
pub(crate) mod photographed;
mod row;
pub mod table;
pub(crate) mod task;
pub(crate) mod waits;

pub(crate) use self::table::MAX_UNFOLLOWED;
use self::table::TABLE;

pub use self::guard::Guard;
pub use self::inputs::GuardInputs;
use self::row::state_mask;
pub use self::row::{Action, TransitionRow};
pub use crate::state::State;
pub use crate::state::interruption::{InterruptedStates, TargetState};

/// Whether the table has a row from `state` with this guard. A command whose guard has no row from
/// the state is refused.
pub fn has_row_for(state: State, guard: Guard) -> bool {
    TABLE.iter().any(|row| row.guard == guard && row.from_mask & state_mask(&[state]) != 0)
}

/// The first row of the table from `state` whose guard has been met for the row's time; `None`
/// where the state is kept.
pub fn first_applicable_row(state: State, inputs: &GuardInputs) -> Option<&'static TransitionRow> {
    let here = state_mask(&[state]);
    TABLE.iter().find(|row| row.from_mask & here != 0 && row.guard.is_met(inputs, row.limit))
}

#[cfg(test)]
mod tests;
