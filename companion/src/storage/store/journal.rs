//! The journal: records one after the other in one of two halves; when it is full, what counts is copied to the other half, which
//! is sealed last.
//!
//! A record is a word (kind, length, CRC-32 of the data, its own CRC-32), then the data, padded to whole words with 0xFF. The
//! last whole record of a kind counts. A word that is neither blank nor whole ends the journal: the next record goes to the
//! other half.

use core::ops::Range;

use super::area::{self, Area, Condition, close, is_closed, u32_at};
use super::records::Compaction;
use super::{BLOCK, ReadFlash, Store, WORD};
use crate::services::parameters::STORED_LEN;

const MAGIC: [u8; 4] = *b"FLKR";

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Which roadmaps were removed, and the parameters.
    Parameters = 1,
    /// The mission file; of length 0 when it was removed.
    Mission = 2,
}

/// The state of the journal.
#[derive(Clone, Debug)]
pub struct Journal {
    /// Its halves.
    pub halves: [Condition; 2],
    /// The half that counts.
    pub active: Option<usize>,
    /// Where the next record goes, in the storage bank; the end of the half when it is full.
    pub end: u32,
    /// Where the mission file is.
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
            halves: [Condition::Dirty; 2],
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
pub fn head(kind: Kind, len: u32, crc: u32) -> [u8; WORD] {
    let mut word = [0; WORD];
    word[..4].copy_from_slice(&MAGIC);
    word[4] = kind as u8;
    word[8..12].copy_from_slice(&len.to_le_bytes());
    word[12..16].copy_from_slice(&crc.to_le_bytes());
    close(&mut word);
    word
}

/// Bytes of the parameters' record.
pub const PARAMETERS_LEN: usize = 4 + STORED_LEN;
const _: () = assert!(PARAMETERS_LEN <= BLOCK);

impl Store {
    pub(super) fn mount_journal(&mut self, flash: &mut impl ReadFlash) {
        let layout = self.layout;
        self.journal.halves = [0, 1].map(|i| area::look(&layout, Area::Half(i), flash));
        let number = |i: &usize| self.journal.halves[*i].seal().map(|seal| seal.sequence);
        let Some(active) = (0..2).filter(|i| number(i).is_some()).max_by_key(number) else { return };
        self.journal.active = Some(active);
        let half = Area::Half(active);
        let (mut at, end) = (half.data_at(&layout), half.end(&layout));
        while at + WORD as u32 <= end {
            let mut word = [0; WORD];
            if flash.read(at, &mut word).is_err() {
                at = end;
                break;
            }
            if word == [0xFF; WORD] {
                break;
            }
            let len = u32_at(&word, 8);
            let fits = len <= end - at && record_len(len) <= end - at;
            if word[..4] != MAGIC || !is_closed(&word) || !fits {
                at = end;
                break;
            }
            self.take_record(word[4], at + WORD as u32, len, u32_at(&word, 12), flash);
            at += record_len(len);
        }
        self.journal.end = at;
    }

    fn take_record(&mut self, kind: u8, at: u32, len: u32, crc: u32, flash: &mut impl ReadFlash) {
        let mut block = [0; BLOCK];
        let (mut sum, mut done) = (super::CRC_START, 0);
        while done < len {
            let count = (len - done).min(BLOCK as u32);
            if flash.read(at + done, &mut block[..count as usize]).is_err() {
                return;
            }
            sum = super::crc_step(sum, &block[..count as usize]);
            done += count;
        }
        if !sum != crc {
            return;
        }
        if kind == Kind::Mission as u8 {
            self.journal.mission = (len > 0).then_some(at..at + len);
            self.journal.mission_crc = crc;
        } else if kind == Kind::Parameters as u8 && (4..=BLOCK as u32).contains(&len) {
            // Short enough to be in the block whole.
            self.forgotten = u32_at(&block, 0);
            let (entries, _) = block[4..len as usize].as_chunks();
            entries.iter().for_each(|entry| self.parameters.restore(entry));
        }
    }
}
