//! The board that the firmware is built for, chosen by a cargo feature.

#[cfg(feature = "nucleo-h743")]
pub use super::nucleo_h743::*;
#[cfg(feature = "pico2")]
pub use super::pico2::*;
#[cfg(feature = "qemu")]
pub use super::qemu::*;
