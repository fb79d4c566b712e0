//! The store's interface to the shell: layout of the storage bank, requests to the flash and their
//! outcomes, the files.

use planner_core::file::CRC32;

/// Bytes of a flash word of the H743: programmed together, and after a power loss complete or torn.
/// The words of other boards' flash are smaller, and their length divides this one.
pub const WORD_LEN: usize = 32;
/// Most bytes that one request programs: a page of the RP2350's flash.
pub const MAX_PROGRAM_LEN: usize = 256;
/// Most bytes that one request reads.
pub const MAX_READ_LEN: usize = 1024;

/// State of a running CRC-32 before its first byte.
pub(crate) const CRC_START: u32 = u32::MAX;

/// Continues a running CRC-32 (ISO-HDLC without its last inversion) with more bytes.
pub(crate) fn continue_crc(state: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC32.digest_with_initial(state.reverse_bits());
    digest.update(bytes);
    !digest.finalize()
}

/// CRC-32 (ISO-HDLC) of all the bytes.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    CRC32.checksum(bytes)
}

/// Layout of the storage bank from its first byte: two slots, then the journal's two halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashLayout {
    /// Length of a sector, the unit of an erasure, bytes.
    pub sector_len: u32,
    /// Length of a slot, bytes: whole sectors.
    pub slot_len: u32,
    /// Length of a half of the journal, bytes: whole sectors.
    pub journal_half_len: u32,
    /// Whether the processor stands still while the flash is programmed: then it is erased and
    /// programmed only where [`ErasePermission`] is not `Forbidden`, on the ground.
    pub stalls_processor: bool,
}

impl FlashLayout {
    /// Bank 2 of the STM32H743: 8 sectors of 128 kB, slots in 0–2 and 3–5, journal in 6 and 7.
    pub const H743: Self = Self {
        sector_len: 128 << 10,
        slot_len: 384 << 10,
        journal_half_len: 128 << 10,
        stalls_processor: false,
    };
    /// 832 kB of the RP2350's external flash, in sectors of 4 kB.
    pub const PICO2: Self = Self {
        sector_len: 4 << 10,
        slot_len: 384 << 10,
        journal_half_len: 32 << 10,
        stalls_processor: true,
    };

    /// Length of the storage bank, bytes.
    pub const fn len(&self) -> u32 {
        2 * self.slot_len + 2 * self.journal_half_len
    }

    /// Whether the storage bank has length 0.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A request to the flash failed: an erase or program error, or a torn word on reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFault;

/// Direct reads of the flash while the board starts: nothing flies yet that would have to wait.
pub trait ReadFlash {
    /// Reads bytes from an offset of the storage bank.
    ///
    /// # Errors
    /// The bytes cannot be read: one of their words is torn.
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault>;
}

/// Request of the store to the shell; offsets count from the storage bank's first byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashRequest<'a> {
    /// Erase one sector.
    Erase {
        /// Offset of the sector's first byte.
        at: u32,
    },
    /// Program a multiple of [`WORD_LEN`] bytes, at most [`MAX_PROGRAM_LEN`], at a multiple of
    /// [`WORD_LEN`]; they were erased before.
    Program {
        /// Offset of the first byte.
        at: u32,
        /// Bytes to program.
        bytes: &'a [u8],
    },
    /// Read bytes, at most [`MAX_READ_LEN`].
    Read {
        /// Offset of the first byte.
        at: u32,
        /// Number of bytes.
        len: usize,
    },
}

/// Whether the store may erase areas now: an erasure may stall the processor for seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErasePermission {
    /// The vehicle is on the ground and disarmed.
    Allowed,
    /// The vehicle is armed, or about to arm: what needs an erasure fails.
    Forbidden,
    /// The roadmap is in use by a planner, or the autopilot's state is not known yet: what needs an
    /// erasure waits.
    NotYet,
}

/// A file of the store, as ground stations see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum File {
    /// The roadmap of a building.
    Roadmap,
    /// The field of heights of uneven ground. It shares the slots with the roadmap: only the newer
    /// of the two exists.
    Field,
    /// The mission file.
    Mission,
}

impl File {
    /// All files, in the order of a listing.
    pub const ALL: [Self; 3] = [Self::Roadmap, Self::Field, Self::Mission];

    /// Name of the file in MAVLink FTP.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Roadmap => "roadmap.bin",
            Self::Field => "field.bin",
            Self::Mission => "mission.bin",
        }
    }
}

/// Outcome of a read or a CRC that a caller of the store started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadOutcome<'a> {
    /// The bytes requested by [`Store::request_read`](super::Store::request_read).
    Bytes(&'a [u8]),
    /// The running CRC-32 requested by [`Store::request_crc`](super::Store::request_crc).
    Crc(u32),
    /// The flash could not read the bytes.
    Failed,
}
