//! Command line of `host-sim`.
fn main() {}
