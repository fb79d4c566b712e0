//! What the shell wants of a board's flash.

use companion::storage::store::{FlashFault, ReadFlash};

/// A board's flash for files and parameters.
pub trait Flash: ReadFlash {
    /// Erases the sector that begins at an offset of the storage bank.
    fn erase(&mut self, at: u32) -> impl Future<Output = Result<(), FlashFault>>;

    /// Programs words that were erased.
    fn program(&mut self, at: u32, bytes: &[u8]) -> impl Future<Output = Result<(), FlashFault>>;
}
