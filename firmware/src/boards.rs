//! What differs between boards: registers, clocks, memory. `unsafe` is allowed here (and in
//! `workspace`).

use crate::crash_record::FileWork;

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
#[cfg(all(target_os = "none", feature = "pico2"))]
pub mod pico2;
#[cfg(all(target_os = "none", feature = "qemu"))]
pub mod qemu;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod resources;
#[cfg(all(target_os = "none", any(feature = "nucleo-h743", feature = "qemu")))]
pub mod sections;
#[cfg(all(target_os = "none", feature = "board"))]
pub mod stack;

#[cfg(all(target_os = "none", feature = "board"))]
pub use lock::BasepriRawMutex;

/// Halts the processor until an interrupt.
#[cfg(all(target_os = "none", feature = "qemu"))]
pub use qemu::sleep;

/// Halts the processor until an interrupt (WFI).
#[cfg(all(target_os = "none", feature = "board", not(feature = "qemu")))]
pub fn sleep() {
    cortex_m::asm::wfi();
}

/// On the host: a critical section in place of the boards' BASEPRI mutex.
#[cfg(not(all(target_os = "none", feature = "board")))]
pub type BasepriRawMutex = embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// Records that `work` on the uploaded files with checksum `files` begins; false if it crashed
/// three starts in a row, then it must not be done. On the host it may always begin.
pub fn begin_work(work: FileWork, files: u32) -> bool {
    #[cfg(all(target_os = "none", feature = "board"))]
    return crash::begin_work(work, files);
    #[cfg(not(all(target_os = "none", feature = "board")))]
    return crate::crash_record::CrashRecord::default().begin_work(work, files);
}

/// Records that the work that runs has ended without a crash.
pub fn finish_work() {
    #[cfg(all(target_os = "none", feature = "board"))]
    crash::finish_work();
}
