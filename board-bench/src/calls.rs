//! Calls every public function of `planner-core` and `companion` that does work, on inputs chosen
//! to be expensive; a [`Meter`] measures each call.
//!
//! The program `calls` runs them on a board in QEMU and counts instructions;
//! `cargo xtask bench --only worst-case` prints the table. A test runs them on the host without
//! counting.

pub mod coverage;
pub mod coverage_flights;
pub mod coverage_missions;
pub mod coverage_workspace;
pub mod flight;
pub mod limits;
mod limits_area_flights;
mod limits_cameras;
mod limits_coverage;
mod limits_field;
mod limits_graph;
mod limits_results;
pub mod limits_routes;
mod limits_safety;
#[cfg(test)]
mod public_functions;

/// Measures calls: on a board it counts instructions, in host tests it only makes them.
pub trait Meter {
    /// Calls `work` and records its cost under `name`; of several calls of one name the largest
    /// cost counts. `bytes` is the size of the state or workspace that the call is lent, without
    /// its inputs.
    fn call<T>(&mut self, name: &'static str, bytes: usize, work: impl FnOnce() -> T) -> T;
}

#[cfg(test)]
mod tests;
