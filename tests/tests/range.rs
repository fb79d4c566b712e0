//! The demo with a radio that does not reach every vehicle; `cargo xtask bench --only range` flies twenty seeds of each range.

use std::process::Command;

#[test]
fn gates_open_for_vehicles_out_of_radio_range() {
    // Fails where a mission is not complete, or a vehicle stands for long, touches or comes too near.
    let range = Command::new(env!("CARGO_BIN_EXE_range")).args(["--range", "20", "--seeds", "2"]).status();
    assert!(range.unwrap().success());
}
