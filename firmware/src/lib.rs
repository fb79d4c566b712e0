//! The companion as firmware: tasks around [`companion::Companion`], and the boards they run on.
//!
//! The library holds what needs no board: the shell's tasks over any UART, the planner, the crash
//! record, and the cases that board and desk compute alike. It is built and tested on the desk too;
//! [`boards`] is built for a board alone.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod boards;
pub mod calls;
pub mod capacity;
pub mod cases;
pub mod chips;
pub mod flash;
pub mod kept;
pub mod lent;
pub mod planner;
pub mod scratch;
pub mod shell;
