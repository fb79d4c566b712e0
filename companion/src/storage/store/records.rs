//! How records get into the journal: the next one, a copy of what counts into the other half when
//! the first is full.

use super::flash::WORD;
use core::ops::Range;

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum RecordKind {
    /// Which roadmaps were removed, and the parameters.
    Parameters = 1,
    /// The mission file; of length 0 when it was removed.
    Mission = 2,
    /// Photographed waypoints of an area: as [`crate::mission::photographed`] writes them.
    Photographed = 3,
}

/// Attempts to write the journal before the store gives up until the next start.
pub(super) const MAX_JOURNAL_TRIES: u8 = 4;

/// A record being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JournalRecord {
    pub kind: RecordKind,
    /// Offset of the record.
    pub at: u32,
    pub len: u32,
    pub crc: u32,
    pub source: RecordSource,
    pub step: RecordStep,
    pub done: u32,
    pub sum: u32,
}

impl JournalRecord {
    /// Bytes of its step: what is read back begins with the head.
    pub fn total_len(&self) -> u32 {
        if self.step == RecordStep::Verify { WORD as u32 + self.len } else { self.len }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordSource {
    /// The record is in the buffer, whole.
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

/// The journal's other half being filled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compaction {
    pub half: usize,
    pub at: u32,
    /// Next: 0 the parameters, 1 what is photographed, 2 the mission, 3 the seal.
    pub step: u8,
    pub mission: Option<Range<u32>>,
}
