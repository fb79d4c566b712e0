//! Every public call of `planner-core` and `companion` that does work, on inputs made to be hard,
//! each counted by a [`Meter`].
//!
//! The program `calls` runs them on a board in QEMU and counts instructions;
//! `cargo xtask bench --only worst-case` prints the table. On the desk the same runs without
//! counting, as a test.

pub mod coverage;
pub mod coverage_flights;
pub mod flight;
pub mod limits;
mod limits_area_flights;
mod limits_cameras;
mod limits_coverage;
mod limits_field;
mod limits_graph;
mod limits_results;
pub mod limits_routes;
#[cfg(test)]
mod limits_tests;
#[cfg(test)]
mod public_functions;

/// Measures calls: a board counts instructions, the desk measures nothing.
pub trait Meter {
    /// Does the work and notes under a name what it cost; of several of one name the most counts.
    /// `bytes` is what the call needs to be lent: its state or workspace, without its inputs.
    fn call<T>(&mut self, name: &'static str, bytes: usize, work: impl FnOnce() -> T) -> T;
}
