//! Catches panics of the decoder of compressed point clouds, which panics on damaged bytes, and
//! suppresses their message.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread prints no message.
    static SUPPRESSES_PANIC_MESSAGE: Cell<bool> = const { Cell::new(false) };
}

/// The result of `decode`; `None` if it panics, without a panic message.
pub(super) fn catch_panic<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            if !SUPPRESSES_PANIC_MESSAGE.get() {
                before(info);
            }
        }));
    });
    let outer = SUPPRESSES_PANIC_MESSAGE.replace(true);
    // What a panic leaves half done is dropped with the closure, so unwinding is safe.
    let outcome = catch_unwind(AssertUnwindSafe(decode));
    SUPPRESSES_PANIC_MESSAGE.set(outer);
    outcome.ok()
}
