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
    /// What the record keeps.
    pub(super) kind: RecordKind,
    /// Offset of the record's head in the storage bank.
    pub(super) at: u32,
    /// Bytes of data.
    pub(super) len: u32,
    /// CRC-32 of the data.
    pub(super) crc: u32,
    /// Where the data come from.
    pub(super) source: RecordSource,
    /// The step that is under way.
    pub(super) step: RecordStep,
    /// Bytes that the present step has processed: of the data; when read back, head included.
    pub(super) done: u32,
    /// Running CRC-32 of the data read back.
    pub(super) sum: u32,
}

impl JournalRecord {
    /// Bytes that the present step processes: the data; when the record is read back, its head too.
    pub fn step_len(&self) -> u32 {
        if self.step == RecordStep::Verify { WORD_LEN as u32 + self.len } else { self.len }
    }
}

/// Where the data of a record comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordSource {
    /// All data is in the store's buffer.
    Buffer,
    /// The data is in the reassembly window.
    Window,
    /// The data is copied from this offset of the storage bank.
    Flash(u32),
}

/// What the next request of a record does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordStep {
    /// Program the head.
    Head,
    /// From flash: read the next data into the buffer. From the window: program the next data.
    NextData,
    /// Program the data that is in the buffer.
    Data,
    /// Read head and data back.
    Verify,
}

/// Compaction: the journal's other half is being filled with copies of the records that count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compaction {
    /// The half that is being filled.
    pub(super) half: usize,
    /// Offset of the next copy in the storage bank.
    pub(super) at: u32,
    /// Next record to be copied: 0 parameters, 1 photographed waypoints, 2 mission, 3 the half's
    /// seal.
    pub(super) step: u8,
    /// Range of the mission file's copy; `None` while it is not copied, or if there is none.
    pub(super) mission: Option<Range<u32>>,
}
