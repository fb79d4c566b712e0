//! Helpers shared by the cross-crate tests.

use std::path::PathBuf;

/// A file of the shared real data, or `None` with a line that says what is skipped.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no shared data {name} beside the checkout");
    None
}
