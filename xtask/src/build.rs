//! `cargo xtask build`.

use anyhow::Result;

use crate::bare_metal::{self, Board};

/// What to build.
#[derive(clap::Args)]
pub struct Args {
    /// For which board; all of them if it is not given.
    #[arg(long, value_name = "BOARD")]
    board: Option<Board>,
}

/// Builds the firmware and says where it is.
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
