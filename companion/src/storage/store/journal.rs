//! The journal: records one after the other in one of two halves; when it is full, what counts is
//! copied to the other half, which is sealed last.
//!
//! A record is a word (kind, length, CRC-32 of the data, its own CRC-32), then the data, padded to
//! whole words with 0xFF. The last whole record of a kind counts. A word that is neither blank nor
//! whole ends the journal: the next record goes to the other half.

use super::area::{AreaCondition, append_word_crc};
use super::flash::{MAX_PROGRAM, WORD};
use super::records::{Compaction, RecordKind};
use crate::services::parameters::STORED_LEN;
use core::ops::Range;

pub(super) const MAGIC: [u8; 4] = *b"FLKR";

/// The state of the journal.
#[derive(Clone, Debug)]
pub struct Journal {
    /// Condition of both halves.
    pub halves: [AreaCondition; 2],
    /// The half that counts.
    pub active: Option<usize>,
    /// Offset of the next record in the storage bank; the end of the half when it is full.
    pub end: u32,
    /// Place of the mission file.
    pub mission: Option<Range<u32>>,
    /// CRC-32 of the mission file's record.
    pub mission_crc: u32,
    /// The mission was removed, and that is not kept yet.
    pub removed: bool,
    /// The other half being filled.
    pub compacting: Option<Compaction>,
    /// Tries that failed.
    pub failures: u8,
}

impl Default for Journal {
    fn default() -> Self {
        Self {
            halves: [AreaCondition::Dirty; 2],
            active: None,
            end: 0,
            mission: None,
            mission_crc: 0,
            removed: false,
            compacting: None,
            failures: 0,
        }
    }
}

/// Bytes that a record takes.
pub fn record_len(data: u32) -> u32 {
    WORD as u32 + data.next_multiple_of(WORD as u32)
}

/// The word before a record's data.
pub fn record_head(kind: RecordKind, len: u32, crc: u32) -> [u8; WORD] {
    let mut word = [0; WORD];
    word[..4].copy_from_slice(&MAGIC);
    word[4] = kind as u8;
    word[8..12].copy_from_slice(&len.to_le_bytes());
    word[12..16].copy_from_slice(&crc.to_le_bytes());
    append_word_crc(&mut word);
    word
}

/// Bytes of the parameters' record.
pub const PARAMETERS_LEN: usize = 4 + STORED_LEN;
const _: () = assert!(PARAMETERS_LEN <= MAX_PROGRAM);
