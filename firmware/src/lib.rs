//! The companion as firmware: async tasks around [`companion::Companion`], and the boards they run
//! on.
//!
//! The library holds what needs no board: the shell's tasks over any UART, the planner, the crash
//! record. It is built and tested on the host too; only [`boards`] needs a board (a bare-metal
//! target and a board's feature).
#![no_std]

#[cfg(test)]
extern crate std;

pub mod boards;
pub mod capacity;
pub mod chips;
pub mod crash_record;
pub mod flash;
pub mod flash_lender;
pub mod planner;
pub mod shell;
pub mod workspace;
