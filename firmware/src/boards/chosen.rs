//! The board that the firmware is built for, chosen by a cargo feature.

#[cfg(any(
    all(feature = "nucleo-h743", feature = "pico2"),
    all(feature = "nucleo-h743", feature = "qemu"),
    all(feature = "pico2", feature = "qemu"),
))]
compile_error!("a build is for exactly one board: nucleo-h743, pico2 or qemu");

#[cfg(not(any(feature = "nucleo-h743", feature = "pico2", feature = "qemu")))]
compile_error!("a build for a board names it: nucleo-h743, pico2 or qemu");

#[cfg(feature = "nucleo-h743")]
pub use super::nucleo_h743::*;
#[cfg(feature = "pico2")]
pub use super::pico2::*;
#[cfg(feature = "qemu")]
pub use super::qemu::*;
