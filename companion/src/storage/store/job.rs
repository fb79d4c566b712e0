//! What the store has in hand.

use super::area::{Area, Seal};
use super::records::Record;

/// Work of the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// No work.
    None,
    /// The result of the request under way does not matter any more.
    Ignored,
    /// Reading for somebody.
    Read { at: u32, len: usize },
    /// Summing for somebody.
    Sum { at: u32, end: u32, sum: u32 },
    /// Erasing an area, sector by sector.
    Erase { area: Area, at: u32 },
    /// Saying that it is clean.
    MarkClean(Area),
    /// Saying that it is written to.
    MarkUsed(Area),
    /// The window's first block.
    Flush(Area),
    /// The window's last bytes, from there on.
    FlushRest { slot: Area, done: u32 },
    /// Reading the roadmap back.
    Check { slot: Area, done: u32, sum: u32, tail: [u8; 4] },
    /// Sealing an area.
    Seal(Area, Seal),
    /// Reading the seal back.
    SealCheck(Area, Seal),
    /// A record of the journal.
    Record(Record),
}
