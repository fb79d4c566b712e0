//! `cargo xtask build`: builds the firmware.

use anyhow::Result;

use crate::bare_metal::{self, Board};

/// Arguments of `build`.
#[derive(clap::Args)]
pub struct Args {
    /// Board to build for; all boards if not given.
    #[arg(long, value_name = "BOARD")]
    board: Option<Board>,
}

/// Builds the firmware and prints the paths of its programs.
pub fn run(args: &Args) -> Result<()> {
    for board in
        Board::ALL.into_iter().filter(|board| args.board.is_none_or(|wanted| wanted == *board))
    {
        let programs = bare_metal::build(board)?.folder;
        for program in board.programs() {
            println!("{}", programs.join(program).display());
        }
    }
    Ok(())
}
