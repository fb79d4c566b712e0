//! What the store has in hand.

use super::area::{FlashArea, Seal};
use super::records::JournalRecord;

/// Work of the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashJob {
    /// No work.
    None,
    /// The result of the request under way does not matter any more.
    Ignored,
    /// Reads bytes for a caller of the store.
    Read { at: u32, len: usize },
    /// Computes the CRC of a file for a caller of the store.
    Sum { at: u32, end: u32, sum: u32 },
    /// Erasing an area, sector by sector.
    Erase { area: FlashArea, at: u32 },
    /// Saying that it is clean.
    MarkClean(FlashArea),
    /// Saying that it is written to.
    MarkUsed(FlashArea),
    /// The window's first block.
    Flush(FlashArea),
    /// The window's last bytes, from there on.
    FlushRest { slot: FlashArea, done: u32 },
    /// Reading the roadmap back.
    Check { slot: FlashArea, done: u32, sum: u32, tail: [u8; 4] },
    /// Sealing an area.
    Seal(FlashArea, Seal),
    /// Reading the seal back.
    SealCheck(FlashArea, Seal),
    /// A record of the journal.
    Record(JournalRecord),
}
