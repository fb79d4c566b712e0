//! The mutex around state that tasks of both executors share.
#![expect(unsafe_code, reason = "the priority below which nothing runs")]

use cortex_m::register::{basepri, basepri_max};
use embassy_sync::blocking_mutex::raw::RawMutex;

use super::chosen::LINKS_PRIORITY;

/// Raw mutex that raises BASEPRI to the priority of the links' executor: while it is held neither
/// executor runs another task, but device interrupts still receive bytes. Embassy's asynchronous
/// mutex cannot be used: it stores the waker of one task only. Two waiting tasks of the higher
/// executor would wake each other for ever, and the lower executor, which holds the mutex, would
/// never run to release it.
pub struct BasepriRawMutex(());

// SAFETY: it is locked by tasks only, never in a device's interrupt; so while it is held no code
// that may lock it runs.
unsafe impl RawMutex for BasepriRawMutex {
    const INIT: Self = Self(());

    fn lock<R>(&self, work: impl FnOnce() -> R) -> R {
        let before = basepri::read();
        basepri_max::write(LINKS_PRIORITY);
        let result = work();
        // SAFETY: restores the value read before.
        unsafe { basepri::write(before) };
        result
    }
}
