//! The four areas of the storage bank, each written once between two erasures: two slots for
//! roadmaps or fields, two halves of the journal.
//!
//! | offset | word of 32 bytes | programmed |
//! |---|---|---|
//! | 0 | "clean" | after all sectors of the area were erased; an interrupted erasure leaves none |
//! | 32 | "used" | before anything else is written to the area |
//! | 64 | seal: sequence number, length and CRC of the data | last of all, after the data was read back |
//! | 256 | data | between "used" and the seal |
//!
//! A word whose programming was interrupted may read as anything, or not at all. So no decision
//! relies on one such word: a seal counts only with its CRC, and an area is written only if it is
//! marked "clean" and not "used".

use super::flash::{FlashFault, FlashLayout, MAX_PROGRAM_LEN, ReadFlash, WORD_LEN, crc32};

/// Offset of an area's data from its first byte.
pub const DATA_OFFSET: u32 = MAX_PROGRAM_LEN as u32;
/// Offset of the "used" mark from the area's first byte.
const USED_OFFSET: u32 = WORD_LEN as u32;
/// Offset of the seal from the area's first byte.
const SEAL_OFFSET: u32 = 2 * WORD_LEN as u32;

/// Mark of an area that was erased and may be written.
const CLEAN: [u8; WORD_LEN] = *b"FLKCLEAN: erased, may be written";
/// Mark of an area that was written to.
const USED: [u8; WORD_LEN] = *b"FLKUSED:  written to, seal ahead";
/// First bytes of a seal.
const SEAL_MAGIC: [u8; 4] = *b"FLKS";

/// One of the four areas of the storage bank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashArea {
    /// Slot 0 or 1, for a roadmap or a field.
    Slot(usize),
    /// Half 0 or 1 of the journal.
    JournalHalf(usize),
}

impl FlashArea {
    /// Offset of the area's first byte in the storage bank.
    pub fn offset(self, layout: &FlashLayout) -> u32 {
        match self {
            Self::Slot(i) => i as u32 * layout.slot_len,
            Self::JournalHalf(i) => 2 * layout.slot_len + i as u32 * layout.journal_half_len,
        }
    }

    /// Length of the area, bytes.
    pub fn len(self, layout: &FlashLayout) -> u32 {
        match self {
            Self::Slot(_) => layout.slot_len,
            Self::JournalHalf(_) => layout.journal_half_len,
        }
    }

    /// Offset of the area's data in the storage bank.
    pub fn data_offset(self, layout: &FlashLayout) -> u32 {
        self.offset(layout) + DATA_OFFSET
    }

    /// Offset of the area's end in the storage bank.
    pub fn end(self, layout: &FlashLayout) -> u32 {
        self.offset(layout) + self.len(layout)
    }
}

/// Offset in the storage bank, and the word to program there.
pub type WordToProgram = (u32, [u8; WORD_LEN]);

/// The word that marks an area as completely erased.
pub fn clean_mark(layout: &FlashLayout, area: FlashArea) -> WordToProgram {
    (area.offset(layout), CLEAN)
}

/// The word that marks an area as being written.
pub fn used_mark(layout: &FlashLayout, area: FlashArea) -> WordToProgram {
    (area.offset(layout) + USED_OFFSET, USED)
}

/// The word that seals an area.
pub fn seal_mark(layout: &FlashLayout, area: FlashArea, seal: &Seal) -> WordToProgram {
    (area.offset(layout) + SEAL_OFFSET, seal.to_bytes())
}

/// Seal of a complete area: its sequence number; for a slot also the length, CRC and kind of its
/// file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// Sequence number; of two slots or halves the higher one is newer.
    pub sequence: u32,
    /// Bytes of the slot's file; 0 in the journal.
    pub len: u32,
    /// CRC-32 in the last four bytes of the slot's file; 0 in the journal.
    pub crc: u32,
    /// Whether the slot's file is a field of heights, not a roadmap.
    pub is_height_field: bool,
}

impl Seal {
    /// The seal as a word of flash, with its CRC.
    fn to_bytes(self) -> [u8; WORD_LEN] {
        let mut word = [0; WORD_LEN];
        word[..4].copy_from_slice(&SEAL_MAGIC);
        word[4..8].copy_from_slice(&self.sequence.to_le_bytes());
        word[8..12].copy_from_slice(&self.len.to_le_bytes());
        word[12..16].copy_from_slice(&self.crc.to_le_bytes());
        word[16] = u8::from(self.is_height_field);
        append_word_crc(&mut word);
        word
    }

    /// The seal in a word of flash; `None` if the word is no sound seal.
    fn from_bytes(word: &[u8; WORD_LEN]) -> Option<Self> {
        (word[..4] == SEAL_MAGIC && has_valid_word_crc(word)).then(|| Self {
            sequence: u32_at(word, 4),
            len: u32_at(word, 8),
            crc: u32_at(word, 12),
            is_height_field: word[16] == 1,
        })
    }
}

/// Writes the CRC-32 of a word's first 28 bytes into its last 4.
pub fn append_word_crc(word: &mut [u8; WORD_LEN]) {
    let crc = crc32(&word[..WORD_LEN - 4]);
    word[WORD_LEN - 4..].copy_from_slice(&crc.to_le_bytes());
}

/// Whether a word's last 4 bytes are the CRC-32 of its first 28.
pub fn has_valid_word_crc(word: &[u8; WORD_LEN]) -> bool {
    crc32(&word[..WORD_LEN - 4]) == u32_at(word, WORD_LEN - 4)
}

/// The little-endian u32 at offset `at`.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Condition of an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaCondition {
    /// Unknown or half-written contents: the area must be erased before it is written.
    Dirty,
    /// Erased: the area may be written.
    Clean,
    /// Being written.
    Open,
    /// Complete: a slot's file or a half of the journal.
    Sealed(Seal),
}

impl AreaCondition {
    /// The seal of a sealed area; `None` for any other.
    pub fn seal(self) -> Option<Seal> {
        match self {
            Self::Sealed(seal) => Some(seal),
            _ => None,
        }
    }
}

/// The condition of an area, read from its three marks in flash; a slot's whole file is read to
/// check its CRC.
pub fn read_condition(
    layout: &FlashLayout,
    area: FlashArea,
    flash: &mut impl ReadFlash,
) -> AreaCondition {
    let at = area.offset(layout);
    let mut word = |offset| {
        let mut word = [0; WORD_LEN];
        flash.read(at + offset, &mut word).map(|()| word)
    };
    let (clean, used, sealed) = (word(0), word(USED_OFFSET), word(SEAL_OFFSET));
    if clean == Ok(CLEAN) && used == Ok([0xFF; WORD_LEN]) && sealed == Ok([0xFF; WORD_LEN]) {
        return AreaCondition::Clean;
    }
    let Some(seal) = sealed.ok().and_then(|word| Seal::from_bytes(&word)) else {
        return AreaCondition::Dirty;
    };
    match area {
        FlashArea::Slot(_) if seal.len > area.len(layout) - DATA_OFFSET => AreaCondition::Dirty,
        FlashArea::Slot(_) if file_crc(at + DATA_OFFSET, seal.len, flash) != Ok(seal.crc) => {
            AreaCondition::Dirty
        }
        _ => AreaCondition::Sealed(seal),
    }
}

/// CRC-32 of a file in flash without its last four bytes, which are its own CRC.
fn file_crc(at: u32, len: u32, flash: &mut impl ReadFlash) -> Result<u32, FlashFault> {
    let mut block = [0; MAX_PROGRAM_LEN];
    let (mut sum, mut done) = (super::flash::CRC_START, 0);
    let covered = len.saturating_sub(4);
    while done < covered {
        let count = (covered - done).min(MAX_PROGRAM_LEN as u32);
        let block = &mut block[..count as usize];
        flash.read(at + done, block)?;
        sum = super::flash::continue_crc(sum, block);
        done += count;
    }
    Ok(!sum)
}
