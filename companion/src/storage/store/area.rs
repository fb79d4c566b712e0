//! Areas of flash, each written once between two erasures: two slots for roadmaps, two halves of
//! the journal.
//!
//! | offset | word of 32 bytes | programmed |
//! |---|---|---|
//! | 0 | "clean" | after all sectors of the area were erased: an erasure that was cut has none |
//! | 32 | "used" | before anything else is written |
//! | 64 | seal: what the area holds | last of all, when everything was read back |
//! | 256 | data | between the two |
//!
//! A word that was cut while it was programmed may read as anything, or not at all; no decision
//! hangs on one such word being one or the other: a seal is believed only with its CRC, an area is
//! written only if it is clean and unused.

use super::flash::{FlashFault, FlashLayout, MAX_PROGRAM, ReadFlash, WORD, crc32};

/// Offset of a slot's data, bytes.
pub const DATA_OFFSET: u32 = MAX_PROGRAM as u32;
const USED_OFFSET: u32 = WORD as u32;
const SEAL_OFFSET: u32 = 2 * WORD as u32;

const CLEAN: [u8; WORD] = *b"FLKCLEAN: erased, may be written";
const USED: [u8; WORD] = *b"FLKUSED:  written to, seal ahead";
const SEAL_MAGIC: [u8; 4] = *b"FLKS";

/// One of the four areas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashArea {
    /// Roadmap slot 0 or 1.
    Slot(usize),
    /// Half 0 or 1 of the journal.
    Half(usize),
}

impl FlashArea {
    /// Offset of the area's first byte in the storage bank.
    pub fn offset(self, layout: &FlashLayout) -> u32 {
        match self {
            Self::Slot(i) => i as u32 * layout.slot_len,
            Self::Half(i) => 2 * layout.slot_len + i as u32 * layout.half_len,
        }
    }

    /// Length of the area.
    pub fn len(self, layout: &FlashLayout) -> u32 {
        match self {
            Self::Slot(_) => layout.slot_len,
            Self::Half(_) => layout.half_len,
        }
    }

    /// Offset of the area's data in the storage bank.
    pub fn data_offset(self, layout: &FlashLayout) -> u32 {
        self.offset(layout) + DATA_OFFSET
    }

    /// End of the area in the storage bank.
    pub fn end(self, layout: &FlashLayout) -> u32 {
        self.offset(layout) + self.len(layout)
    }
}

/// A word to program, and where.
pub type WordToProgram = (u32, [u8; WORD]);

/// The word that says an area is clean.
pub fn clean_mark(layout: &FlashLayout, area: FlashArea) -> WordToProgram {
    (area.offset(layout), CLEAN)
}

/// The word that says an area is written to.
pub fn used_mark(layout: &FlashLayout, area: FlashArea) -> WordToProgram {
    (area.offset(layout) + USED_OFFSET, USED)
}

/// The word that seals an area.
pub fn seal_mark(layout: &FlashLayout, area: FlashArea, seal: &Seal) -> WordToProgram {
    (area.offset(layout) + SEAL_OFFSET, seal.to_bytes())
}

/// Record that marks an area as complete: sequence number, length, CRC and kind of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// The larger, the newer.
    pub sequence: u32,
    /// Bytes of the roadmap file; 0 in the journal.
    pub len: u32,
    /// CRC-32 at the end of the roadmap file; 0 in the journal.
    pub crc: u32,
    /// Whether that file is a field.
    pub field: bool,
}

impl Seal {
    fn to_bytes(self) -> [u8; WORD] {
        let mut word = [0; WORD];
        word[..4].copy_from_slice(&SEAL_MAGIC);
        word[4..8].copy_from_slice(&self.sequence.to_le_bytes());
        word[8..12].copy_from_slice(&self.len.to_le_bytes());
        word[12..16].copy_from_slice(&self.crc.to_le_bytes());
        word[16] = u8::from(self.field);
        append_word_crc(&mut word);
        word
    }

    fn from_bytes(word: &[u8; WORD]) -> Option<Self> {
        (word[..4] == SEAL_MAGIC && has_valid_word_crc(word)).then(|| Self {
            sequence: u32_at(word, 4),
            len: u32_at(word, 8),
            crc: u32_at(word, 12),
            field: word[16] == 1,
        })
    }
}

/// Puts the CRC-32 of a word's first 28 bytes into its last 4.
pub fn append_word_crc(word: &mut [u8; WORD]) {
    let crc = crc32(&word[..WORD - 4]);
    word[WORD - 4..].copy_from_slice(&crc.to_le_bytes());
}

/// Whether a word ends with the CRC-32 of the rest.
pub fn has_valid_word_crc(word: &[u8; WORD]) -> bool {
    crc32(&word[..WORD - 4]) == u32_at(word, WORD - 4)
}

/// The little-endian number at an offset.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Condition of an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaCondition {
    /// The area is to be erased before it is written.
    Dirty,
    /// May be written.
    Clean,
    /// Being written.
    Open,
    /// Holds something whole.
    Sealed(Seal),
}

impl AreaCondition {
    /// The seal of a sealed area.
    pub fn seal(self) -> Option<Seal> {
        match self {
            Self::Sealed(seal) => Some(seal),
            _ => None,
        }
    }
}

/// Reads the first words of an area; a slot's file is read whole and checked.
pub fn read_condition(
    layout: &FlashLayout,
    area: FlashArea,
    flash: &mut impl ReadFlash,
) -> AreaCondition {
    let at = area.offset(layout);
    let mut word = |offset| {
        let mut word = [0; WORD];
        flash.read(at + offset, &mut word).map(|()| word)
    };
    let (clean, used, sealed) = (word(0), word(USED_OFFSET), word(SEAL_OFFSET));
    if clean == Ok(CLEAN) && used == Ok([0xFF; WORD]) && sealed == Ok([0xFF; WORD]) {
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

/// CRC-32 over a file in flash without its last four bytes.
fn file_crc(at: u32, len: u32, flash: &mut impl ReadFlash) -> Result<u32, FlashFault> {
    let mut block = [0; MAX_PROGRAM];
    let (mut sum, mut done) = (super::flash::CRC_START, 0);
    let covered = len.saturating_sub(4);
    while done < covered {
        let count = (covered - done).min(MAX_PROGRAM as u32);
        let block = &mut block[..count as usize];
        flash.read(at + done, block)?;
        sum = super::flash::crc_step(sum, block);
        done += count;
    }
    Ok(!sum)
}
