//! What the store and its shell share: the flash's layout, requests to it, the files.

use planner_core::file::CRC32;

/// Bytes that are programmed together and are whole or torn after a power loss: the H743's flash
/// word. Smaller ones divide it.
pub const WORD: usize = 32;
/// Most bytes of one request to program: a page of the RP2350's flash.
pub const MAX_PROGRAM: usize = 256;
/// Most bytes of one request to read.
pub const MAX_READ: usize = 1024;

/// State of a CRC-32 before its first byte.
pub(crate) const CRC_START: u32 = u32::MAX;

/// A running CRC-32 (ISO-HDLC without its last inversion) after some more bytes.
pub(crate) fn crc_step(state: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC32.digest_with_initial(state.reverse_bits());
    digest.update(bytes);
    !digest.finalize()
}

pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    CRC32.checksum(bytes)
}

/// Layout of the storage bank, counted from its first byte: two slots, then two halves of the
/// journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashLayout {
    /// Length of a sector, which is erased at once, bytes.
    pub sector_len: u32,
    /// Length of a roadmap slot, whole sectors.
    pub slot_len: u32,
    /// Length of a half of the journal, whole sectors.
    pub half_len: u32,
    /// Whether nothing runs while it programs: then it does so on the ground alone.
    pub stalls: bool,
}

impl FlashLayout {
    /// Bank 2 of the STM32H743: 8 sectors of 128 kB, roadmap slots in 0–2 and 3–5, journal in 6
    /// and 7.
    pub const H743: Self =
        Self { sector_len: 128 << 10, slot_len: 384 << 10, half_len: 128 << 10, stalls: false };
    /// 832 kB of the RP2350's external flash, sectors of 4 kB.
    pub const PICO2: Self =
        Self { sector_len: 4 << 10, slot_len: 384 << 10, half_len: 32 << 10, stalls: true };

    /// Bytes of the whole bank.
    pub const fn len(&self) -> u32 {
        2 * self.slot_len + 2 * self.half_len
    }

    /// Whether it has no room at all.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A flash operation failed: an erase or program error, or a torn word on reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFault;

/// Flash as it is read at the start, when nothing flies and waiting harms nobody.
pub trait ReadFlash {
    /// Reads bytes at an offset of the storage bank.
    ///
    /// # Errors
    /// They cannot be read: a word among them is torn.
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault>;
}

/// Request to the shell at an offset of the storage bank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashRequest<'a> {
    /// Erase the sector that begins there.
    Erase {
        /// Offset of the first byte.
        at: u32,
    },
    /// Program bytes: a multiple of [`WORD`] at a multiple of it, at most [`MAX_PROGRAM`], all
    /// erased before.
    Program {
        /// The first byte.
        at: u32,
        /// Bytes to program.
        bytes: &'a [u8],
    },
    /// Read bytes, at most [`MAX_READ`].
    Read {
        /// The first byte.
        at: u32,
        /// Number of bytes.
        len: usize,
    },
}

/// Whether areas may be erased now: it may stall the processor for seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErasePermission {
    /// Erasing is allowed: the vehicle does not fly.
    Allowed,
    /// The vehicle is armed, or about to be.
    Forbidden,
    /// The roadmap is planned on, or it is soon known whether there is an autopilot, and whether it
    /// is armed: what needs it waits.
    NotYet,
}

/// A file as ground tools see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum File {
    /// The roadmap.
    Roadmap,
    /// The heights of uneven ground, in the roadmap's slot: of the two there is one.
    Field,
    /// The mission.
    Mission,
}

impl File {
    /// All, in the order of a listing.
    pub const ALL: [Self; 3] = [Self::Roadmap, Self::Field, Self::Mission];

    /// Name of the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Roadmap => "roadmap.bin",
            Self::Field => "field.bin",
            Self::Mission => "mission.bin",
        }
    }
}

/// Result of a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadOutcome<'a> {
    /// The bytes asked for by [`Store::request_read`](super::Store::request_read).
    Bytes(&'a [u8]),
    /// The running CRC asked for by [`Store::request_crc`](super::Store::request_crc).
    Sum(u32),
    /// The bytes cannot be read.
    Failed,
}
