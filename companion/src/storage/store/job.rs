//! Jobs of the flash store, each of one or several requests to the flash.

use super::flash_area::{FlashArea, Seal};
use super::records::JournalRecord;

/// The job that the store executes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashJob {
    /// No work.
    None,
    /// The upload was aborted while a flash operation was in progress: its result is discarded.
    Abandoned,
    /// Read bytes for a caller of the store.
    Read { at: u32, len: usize },
    /// Compute the running CRC-32 of a file for a caller of the store: done up to `at`.
    Crc { at: u32, end: u32, sum: u32 },
    /// Erase an area, sector by sector; next the sector at `at`.
    Erase { area: FlashArea, at: u32 },
    /// Program the word that marks an area as erased completely.
    MarkClean(FlashArea),
    /// Program the word that marks an area as being written.
    MarkUsed(FlashArea),
    /// Program the first block of the reassembly window into this slot.
    Flush(FlashArea),
    /// Program the last bytes of an upload from the reassembly window; `done` of them are
    /// programmed.
    FlushRest { slot: FlashArea, done: u32 },
    /// Read an upload back and compute its CRC-32; `tail` collects the file's last four bytes, its
    /// own CRC.
    CheckUploadCrc { slot: FlashArea, done: u32, sum: u32, tail: [u8; 4] },
    /// Program the seal of an area whose data was read back.
    Seal(FlashArea, Seal),
    /// Read the seal of an area back.
    SealCheck(FlashArea, Seal),
    /// Write a record of the journal, and read it back.
    Record(JournalRecord),
}
