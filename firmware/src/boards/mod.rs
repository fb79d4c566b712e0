//! What differs from board to board: registers, clocks, memory. The only place with `unsafe`.

use crate::kept::FileWork;

#[cfg(all(target_os = "none", feature = "board"))]
pub mod chosen;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod crash;
#[cfg(all(target_os = "none", feature = "board"))]
mod executors;
#[cfg(all(target_os = "none", feature = "board"))]
mod limits;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod lock;
#[cfg(all(target_os = "none", any(feature = "nucleo-h743", feature = "qemu")))]
mod mpu;
#[cfg(all(target_os = "none", feature = "nucleo-h743"))]
pub mod nucleo_h743;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod parts;
#[cfg(all(target_os = "none", feature = "pico2"))]
pub mod pico2;
#[cfg(all(target_os = "none", feature = "qemu"))]
pub mod qemu;
#[cfg(all(target_os = "none", any(feature = "nucleo-h743", feature = "qemu")))]
pub mod sections;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod stack;

#[cfg(all(target_os = "none", feature = "board"))]
pub use lock::HoldsExecutors;

/// Sleeps until an interrupt comes.
#[cfg(all(target_os = "none", feature = "qemu"))]
pub use qemu::sleep;

/// Sleeps until an interrupt comes.
#[cfg(all(target_os = "none", feature = "board", not(feature = "qemu")))]
pub fn sleep() {
    cortex_m::asm::wfi();
}

/// On the desk there is no other executor to hold back.
#[cfg(not(all(target_os = "none", feature = "board")))]
pub type HoldsExecutors = embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// Work with uploaded files begins; false if it brought three starts in a row down, and is not to
/// be done. A desk has no starts.
pub fn begin_work(work: FileWork, files: u32) -> bool {
    #[cfg(all(target_os = "none", feature = "board"))]
    return crash::begin_work(work, files);
    #[cfg(not(all(target_os = "none", feature = "board")))]
    return crate::kept::CrashRecord::default().begin_work(work, files);
}

/// Notes that the work has ended.
pub fn finish_work() {
    #[cfg(all(target_os = "none", feature = "board"))]
    crash::finish_work();
}
