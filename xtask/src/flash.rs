//! `cargo xtask flash`: builds the firmware and writes it to a connected board, by probe-rs.

use anyhow::{Result, bail, ensure};

use crate::bare_metal::{self, Board};
use crate::shell::{command, find_on_path, run};

/// Arguments of `flash`.
#[derive(clap::Args)]
pub struct Args {
    /// The board, behind a debug probe
    #[arg(long, value_name = "BOARD", default_value = "nucleo-h743")]
    board: Board,
}

/// Builds the firmware, writes it to the board's flash, and resets the board.
pub fn run_flash(args: &Args) -> Result<()> {
    let chip = match args.board {
        Board::Qemu => bail!("the board qemu is not flashed: cargo xtask emulate"),
        Board::NucleoH743 => "STM32H743ZITx",
        Board::Pico2 => "RP235x",
    };
    ensure!(
        find_on_path("probe-rs").is_some(),
        "probe-rs is not on the path: cargo install probe-rs-tools --locked"
    );
    let program = bare_metal::build(args.board)?.folder.join("flockmate");
    run(command("probe-rs").args(["download", "--chip", chip, "--verify"]).arg(&program))?;
    run(command("probe-rs").args(["reset", "--chip", chip]))
}
