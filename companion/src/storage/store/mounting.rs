//! Reading the journal when the store is mounted.

use super::Store;
use super::flash::{MAX_PROGRAM_LEN, ReadFlash, WORD_LEN};
use super::flash_area::{self, FlashArea, has_valid_word_crc, u32_at};
use super::journal::*;
use super::records::RecordKind;

impl Store {
    /// Finds the newest sealed half of the journal, and restores what its records hold.
    pub(super) fn mount_journal(&mut self, flash: &mut impl ReadFlash) {
        let layout = self.layout;
        self.journal.halves =
            [0, 1].map(|i| flash_area::read_condition(&layout, FlashArea::JournalHalf(i), flash));
        let number = |i: &usize| self.journal.halves[*i].seal().map(|seal| seal.sequence);
        let Some(active) = (0..2).filter(|i| number(i).is_some()).max_by_key(number) else {
            return;
        };
        self.journal.active_half = Some(active);
        let half = FlashArea::JournalHalf(active);
        let (mut at, end) = (half.data_offset(&layout), half.end(&layout));
        while at + WORD_LEN as u32 <= end {
            let mut word = [0; WORD_LEN];
            if flash.read(at, &mut word).is_err() {
                at = end;
                break;
            }
            if word == [0xFF; WORD_LEN] {
                break;
            }
            let len = u32_at(&word, 8);
            let fits = len <= end - at && record_len(len) <= end - at;
            if word[..4] != RECORD_MAGIC || !has_valid_word_crc(&word) || !fits {
                at = end;
                break;
            }
            self.restore_record(word[4], at + WORD_LEN as u32, len, u32_at(&word, 12), flash);
            at += record_len(len);
        }
        self.journal.next_record_at = at;
    }

    /// Restores the data of a record, from `at` on, if its CRC is right.
    fn restore_record(
        &mut self,
        kind: u8,
        at: u32,
        len: u32,
        crc: u32,
        flash: &mut impl ReadFlash,
    ) {
        let mut block = [0; MAX_PROGRAM_LEN];
        let (mut sum, mut done) = (super::flash::CRC_START, 0);
        while done < len {
            let count = (len - done).min(MAX_PROGRAM_LEN as u32);
            if flash.read(at + done, &mut block[..count as usize]).is_err() {
                return;
            }
            sum = super::flash::continue_crc(sum, &block[..count as usize]);
            done += count;
        }
        if !sum != crc {
            return;
        }
        if kind == RecordKind::Mission as u8 {
            self.journal.mission = (len > 0).then_some(at..at + len);
            self.journal.mission_record_crc = crc;
        } else if kind == RecordKind::Parameters as u8
            && (4..=MAX_PROGRAM_LEN as u32).contains(&len)
        {
            // The block holds all of the record's data.
            self.removed_up_to_sequence = u32_at(&block, 0);
            let (entries, _) = block[4..len as usize].as_chunks();
            entries.iter().for_each(|entry| self.parameters.restore(entry));
        } else if kind == RecordKind::Photographed as u8 && len <= MAX_PROGRAM_LEN as u32 {
            self.photographed = block[..len as usize].iter().copied().collect();
        }
    }
}
