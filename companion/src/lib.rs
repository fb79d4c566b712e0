//! The companion of one UAV, sans-IO: bytes and time in, bytes and events out.
#![no_std]
#![forbid(unsafe_code)]

pub mod frame;
pub mod time;
