//! What the tasks of both executors share, held for the time of one call.
#![expect(unsafe_code, reason = "the priority below which nothing runs")]

use cortex_m::register::{basepri, basepri_max};
use embassy_sync::blocking_mutex::raw::RawMutex;

use super::chosen::LINKS_PRIORITY;

/// Blocks both executors, but no device: bytes are still received. An asynchronous mutex would not
/// do. It knows one task that waits for it; two tasks of the higher executor that wait while the
/// lower one holds it wake each other for ever, and the lower one never comes to let it go.
pub struct HoldsExecutors(());

// SAFETY: a task that takes it runs at the priority of an executor or below, never in a device's
// interrupt. Then nothing that may take it runs beside.
unsafe impl RawMutex for HoldsExecutors {
    const INIT: Self = Self(());

    fn lock<R>(&self, work: impl FnOnce() -> R) -> R {
        let before = basepri::read();
        basepri_max::write(LINKS_PRIORITY);
        let result = work();
        // SAFETY: as it was found.
        unsafe { basepri::write(before) };
        result
    }
}
