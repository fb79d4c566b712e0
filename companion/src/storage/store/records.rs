//! Records of the journal while they are written: the next new record or, once a half is full,
//! copies of the records that count to the other half.

use super::flash::WORD_LEN;
use core::ops::Range;

/// Kind of a record of the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum RecordKind {
    /// Sequence number up to which slots were removed, and the parameters.
    Parameters = 1,
    /// The mission file; with length 0 it was removed.
    Mission = 2,
    /// Photographed waypoints of an area, as [`crate::mission::photographed`] writes them.
    Photographed = 3,
}

/// Failed attempts in a row to write the journal, after which the store writes no record until the
/// next start.
pub(super) const MAX_JOURNAL_TRIES: u8 = 4;

/// A record of the journal that is being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JournalRecord {
    pub(super) kind: RecordKind,
    /// Offset of the record's head in the storage bank.
    pub(super) at: u32,
    pub(super) len: u32,
    pub(super) crc: u32,
    pub(super) source: RecordSource,
    pub(super) step: RecordStep,
    pub(super) done: u32,
    pub(super) sum: u32,
}

impl JournalRecord {
    /// Bytes that the current step processes: the data, when the record is read back also its head.
    pub fn step_len(&self) -> u32 {
        if self.step == RecordStep::Verify { WORD_LEN as u32 + self.len } else { self.len }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordSource {
    /// All data is in the store's buffer.
    Buffer,
    Window,
    Flash(u32),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordStep {
    Head,
    Load,
    Data,
    Verify,
}

/// Compaction: the journal's other half is being filled with copies of the records that count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compaction {
    pub(super) half: usize,
    pub(super) at: u32,
    /// Next record to be copied: 0 parameters, 1 photographed waypoints, 2 mission, 3 the half's
    /// seal.
    pub(super) step: u8,
    pub(super) mission: Option<Range<u32>>,
}
