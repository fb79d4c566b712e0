//! What differs from board to board: registers, clocks, memory. The only place with `unsafe`.

#[cfg(all(target_os = "none", feature = "board"))]
pub mod crash;
#[cfg(all(target_os = "none", feature = "qemu"))]
pub mod qemu;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod stack;

#[cfg(all(target_os = "none", feature = "qemu"))]
pub use qemu as chosen;
