//! What is measured on a board, and what board and host compute alike.
//!
//! The programs `calls`, `measure` and `limits` run it on a board in QEMU; tests and benches run
//! it on the host and compare the results.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod calls;
pub mod cases;
