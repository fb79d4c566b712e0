//! The flash operations that the shell needs from a board.

use companion::storage::store::{FlashFault, ReadFlash};

/// A board's flash for files and parameters; offsets count from the first byte of its storage bank.
pub trait Flash: ReadFlash {
    /// Erases the sector that begins at offset `at`.
    fn erase(&mut self, at: u32) -> impl Future<Output = Result<(), FlashFault>>;

    /// Programs `bytes`, whole words, at offset `at`; the words must be erased.
    fn program(&mut self, at: u32, bytes: &[u8]) -> impl Future<Output = Result<(), FlashFault>>;
}
