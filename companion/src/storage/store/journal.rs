//! The journal: records one after the other in one of two halves. Once a half is full, the records
//! that count are copied to the other half, which is sealed last.
//!
//! A record is a head of one flash word (magic number, kind, length, CRC-32 of the data, CRC-32 of
//! the head), then the data, padded to whole words with 0xFF. The last complete record of a kind
//! counts. A head that is neither erased nor valid ends the journal: the next record goes to the
//! other half.

use super::flash::{MAX_PROGRAM_LEN, WORD_LEN};
use super::flash_area::{AreaCondition, append_word_crc};
use super::records::{Compaction, RecordKind};
use crate::config::parameters::STORED_LEN;
use core::ops::Range;

/// First bytes of the head of each record.
pub(super) const RECORD_MAGIC: [u8; 4] = *b"FLKR";

/// State of the journal.
#[derive(Clone, Debug)]
pub struct Journal {
    /// Condition of each half.
    pub(super) halves: [AreaCondition; 2],
    /// The sealed half whose records count; `None` if there is none.
    pub(super) active_half: Option<usize>,
    /// Offset of the next record in the storage bank; the half's end if it takes no more.
    pub(super) next_record_at: u32,
    /// Range of the mission file in the storage bank; `None` if there is none.
    pub(super) mission: Option<Range<u32>>,
    /// CRC-32 of all bytes of the mission file, as its record's head states it: not the CRC at the
    /// file's end, by which vehicles recognise their mission.
    pub(super) mission_record_crc: u32,
    /// Whether the mission file was removed and no record says so yet.
    pub(super) mission_removal_unsaved: bool,
    /// The compaction under way: the other half is being filled. `None` without one.
    pub(super) compacting: Option<Compaction>,
    /// Failed attempts in a row to write a record or a half.
    pub(super) consecutive_failures: u8,
}

impl Default for Journal {
    fn default() -> Self {
        Self {
            halves: [AreaCondition::Dirty; 2],
            active_half: None,
            next_record_at: 0,
            mission: None,
            mission_record_crc: 0,
            mission_removal_unsaved: false,
            compacting: None,
            consecutive_failures: 0,
        }
    }
}

/// Bytes of a record with `data` bytes of data: its head, and the data in whole words.
pub fn record_len(data: u32) -> u32 {
    WORD_LEN as u32 + data.next_multiple_of(WORD_LEN as u32)
}

/// The head of a record, one flash word.
pub fn record_head(kind: RecordKind, len: u32, crc: u32) -> [u8; WORD_LEN] {
    let mut word = [0; WORD_LEN];
    word[..4].copy_from_slice(&RECORD_MAGIC);
    word[4] = kind as u8;
    word[8..12].copy_from_slice(&len.to_le_bytes());
    word[12..16].copy_from_slice(&crc.to_le_bytes());
    append_word_crc(&mut word);
    word
}

/// Bytes of the data of the parameters' record: the removed slots' sequence number, and all
/// parameters.
pub const PARAMETERS_LEN: usize = 4 + STORED_LEN;
const _: () = assert!(PARAMETERS_LEN <= MAX_PROGRAM_LEN);
