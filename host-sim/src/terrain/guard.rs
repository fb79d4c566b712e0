//! The decoder of compressed point clouds panics on damaged bytes. Here that ends in an error,
//! without a word of its own.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Result of `decode`; none where it panics.
pub(super) fn catch_panic<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            if !QUIET.get() {
                before(info);
            }
        }));
    });
    let outer = QUIET.replace(true);
    // State that a panic leaves half done is dropped with the closure.
    let outcome = catch_unwind(AssertUnwindSafe(decode));
    QUIET.set(outer);
    outcome.ok()
}
