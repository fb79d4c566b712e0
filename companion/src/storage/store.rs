//! What a companion keeps in flash: two slots for roadmaps, and a journal with the mission file and the parameters.
//!
//! Flash is I/O: the store asks ([`Store::poll`]) for one sector to be erased, one block to be programmed or some bytes to be
//! read, and is told how that went ([`Store::handle`]). So a slow erasure never stops the setpoints, and the same code keeps
//! its files in a board's flash, an emulated one, or a desk's memory.
//!
//! A file is whole or not there: it is written into an area that was erased before, read back, and sealed last ([`area`]). A cut
//! at any byte leaves what was sealed before. The areas not in use are erased ahead of time, as soon as the vehicle is known
//! to be disarmed, so that an upload finds one ready. A small crate for such journals (`sequential-storage`) was looked at: its
//! operations are futures over a flash driver that they own, which cannot be asked for one step at a time.
//!
//! A roadmap is used in place, so the slot a companion started from is not written until the next start; the newest roadmap and
//! mission take effect then.

pub mod area;
mod jobs;
mod journal;
mod records;
mod upload;
pub mod window;

use core::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc};

use self::area::{Area, Condition, Seal};
use self::jobs::Job;
use self::journal::Journal;
pub use self::upload::{UploadError, UploadState};
use self::window::Window;
use crate::services::parameters::Parameters;

/// Bytes that are programmed at once and are whole or torn: the H743's flash word. Smaller ones divide it.
pub const WORD: usize = 32;
/// Most bytes of one request to program: a page of the RP2350's flash.
pub const BLOCK: usize = 256;
/// Most bytes of one request to read.
pub const READ: usize = 1024;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// State of a CRC-32 before its first byte.
pub(crate) const CRC_START: u32 = u32::MAX;

/// A running CRC-32 (ISO-HDLC without its last inversion) after some more bytes.
pub(crate) fn crc_step(state: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest_with_initial(state.reverse_bits());
    digest.update(bytes);
    !digest.finalize()
}

pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Where things are in the storage bank, counted from its first byte: two slots, then two halves of the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// What is erased at once, bytes.
    pub sector_len: u32,
    /// Length of a roadmap slot, whole sectors.
    pub slot_len: u32,
    /// Length of a half of the journal, whole sectors.
    pub half_len: u32,
    /// Whether nothing runs while it programs: then it does so on the ground alone.
    pub stalls: bool,
}

impl Layout {
    /// Bank 2 of the STM32H743: 8 sectors of 128 kB, roadmap slots in 0–2 and 3–5, journal in 6 and 7.
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

/// Flash did not do what it was asked for: an erasure or program failed, or what was to be read is torn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault;

/// Flash as it is read at the start, when nothing flies and waiting harms nobody.
pub trait ReadFlash {
    /// Reads bytes at an offset of the storage bank.
    ///
    /// # Errors
    /// They cannot be read: a word among them is torn.
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), Fault>;
}

/// What the shell is asked to do, at an offset of the storage bank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashRequest<'a> {
    /// Erase the sector that begins there.
    Erase {
        /// Its first byte.
        at: u32,
    },
    /// Program bytes: a multiple of [`WORD`] at a multiple of it, at most [`BLOCK`], all erased before.
    Program {
        /// The first byte.
        at: u32,
        /// What to put there.
        bytes: &'a [u8],
    },
    /// Read bytes, at most [`READ`].
    Read {
        /// The first byte.
        at: u32,
        /// How many.
        len: usize,
    },
}

/// Whether areas may be erased now: it may stall the processor for seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Erasing {
    /// Nothing flies.
    Allowed,
    /// The vehicle is armed, or about to be.
    Forbidden,
    /// The roadmap is planned on, or it is soon known whether there is an autopilot, and whether it is armed: what needs it
    /// waits.
    NotYet,
}

/// A file as ground tools see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum File {
    /// The roadmap.
    Roadmap,
    /// The mission.
    Mission,
}

impl File {
    /// Both, in the order of a listing.
    pub const ALL: [Self; 2] = [Self::Roadmap, Self::Mission];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Roadmap => "roadmap.bin",
            Self::Mission => "mission.bin",
        }
    }
}

/// What came of reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer<'a> {
    /// The bytes asked for by [`Store::read`].
    Bytes(&'a [u8]),
    /// The running CRC asked for by [`Store::sum`].
    Sum(u32),
    /// They cannot be read.
    Failed,
}

/// A companion's flash.
#[derive(Clone, Debug)]
pub struct Store {
    layout: Layout,
    slots: [Condition; 2],
    in_use: Option<usize>,
    journal: Journal,
    parameters: Parameters,
    /// Roadmaps up to this number were removed.
    forgotten: u32,
    unsaved: bool,
    window: Window,
    upload: Option<(File, UploadState)>,
    job: Job,
    /// An erasure that lets a read go first, between two sectors.
    paused: Job,
    /// Whether the shell is at work for us.
    asked: bool,
    buffer: [u8; BLOCK],
    word: [u8; WORD],
    erasure_failed: bool,
}

impl Store {
    /// Looks through the flash: which roadmap is the newest whole one, which mission and parameters were last kept. Reads a
    /// roadmap slot whole, so it takes milliseconds.
    pub fn mount(layout: Layout, flash: &mut impl ReadFlash) -> Self {
        let slots = [0, 1].map(|i| area::look(&layout, Area::Slot(i), flash));
        let mut store = Self {
            layout,
            slots,
            in_use: None,
            journal: Journal::default(),
            parameters: Parameters::default(),
            forgotten: 0,
            unsaved: false,
            window: Window::default(),
            upload: None,
            job: Job::None,
            paused: Job::None,
            asked: false,
            buffer: [0; BLOCK],
            word: [0; WORD],
            erasure_failed: false,
        };
        store.mount_journal(flash);
        store.in_use = store.newest();
        store
    }

    /// Where the roadmap that this start uses lies, in the storage bank. It is not written until the next start.
    pub fn roadmap(&self) -> Option<Range<u32>> {
        let slot = self.in_use?;
        let at = Area::Slot(slot).data_at(&self.layout);
        Some(at..at + self.slots[slot].seal()?.len)
    }

    /// The roadmap of this start cannot be used after all, whole as it is: [`Self::roadmap`] is the one before it, if that is still
    /// there; whether it is. To be called before anything else is done with the flash.
    pub fn refuse_roadmap(&mut self) -> bool {
        if let Some(slot) = self.in_use {
            self.slots[slot] = Condition::Dirty;
            self.in_use = self.newest();
        }
        self.in_use.is_some()
    }

    /// Where the mission file lies, in the storage bank; to be copied from there, since the journal moves.
    pub fn mission(&self) -> Option<Range<u32>> {
        self.extent(File::Mission)
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Sets a parameter; it is kept when the flash has time.
    ///
    /// # Errors
    /// As [`Parameters::set`].
    pub fn set_parameter(
        &mut self,
        index: usize,
        value: f32,
    ) -> Result<(), crate::services::parameters::Refused> {
        if self.parameters.set(index, value)? {
            self.unsaved = true;
        }
        Ok(())
    }

    /// Whether parameters wait to be kept.
    pub fn is_unsaved(&self) -> bool {
        self.unsaved
    }

    /// Length of a file; `None` where there is none.
    pub fn size(&self, file: File) -> Option<u32> {
        self.extent(file).map(|extent| extent.end - extent.start)
    }

    /// Removes a file: it is not there at the next start.
    pub fn remove(&mut self, file: File) {
        match file {
            File::Roadmap => {
                if let Some(Seal { sequence, .. }) = self.newest().and_then(|i| self.slots[i].seal()) {
                    self.forgotten = sequence;
                    self.unsaved = true;
                }
            }
            File::Mission => {
                self.journal.removed |= self.journal.mission.take().is_some();
            }
        }
    }

    /// Asks for bytes of a file; false where others are under way. At most [`READ`] are given, fewer at its end.
    pub fn read(&mut self, file: File, offset: u32, len: usize) -> bool {
        let Some(extent) = self.extent(file).filter(|extent| offset < extent.end - extent.start) else {
            return false;
        };
        let at = extent.start + offset;
        let len = len.min(READ).min((extent.end - at) as usize);
        self.read_at(Job::Read { at, len })
    }

    /// Asks for the running CRC of a whole file from a state; false where something else is under way.
    pub fn sum(&mut self, file: File, state: u32) -> bool {
        let Some(extent) = self.extent(file) else { return false };
        self.read_at(Job::Sum { at: extent.start, end: extent.end, sum: state })
    }

    fn read_at(&mut self, job: Job) -> bool {
        match self.job {
            Job::None => {}
            Job::Erase { .. } if !self.asked => self.paused = self.job,
            _ => return false,
        }
        self.job = job;
        true
    }

    /// The newest sealed roadmap that was not removed.
    fn newest(&self) -> Option<usize> {
        let number = |i: &usize| self.slots[*i].seal().map(|seal| seal.sequence);
        (0..2).filter(|i| number(i).is_some_and(|n| n > self.forgotten)).max_by_key(number)
    }

    fn extent(&self, file: File) -> Option<Range<u32>> {
        match file {
            File::Roadmap => {
                let slot = self.newest()?;
                let at = Area::Slot(slot).data_at(&self.layout);
                Some(at..at + self.slots[slot].seal()?.len)
            }
            File::Mission => self.journal.mission.clone(),
        }
    }

    fn condition(&mut self, area: Area) -> &mut Condition {
        match area {
            Area::Slot(i) => &mut self.slots[i],
            Area::Half(i) => &mut self.journal.halves[i],
        }
    }

    /// An area that is to be erased ahead of time: neither used nor the newest.
    fn stale(&self) -> Option<Area> {
        let newest = self.newest();
        let slot = (0..2).find(|&i| {
            let held = Some(i) == self.in_use || Some(i) == newest;
            !held && !matches!(self.slots[i], Condition::Clean | Condition::Open)
        });
        let half = (0..2).find(|&i| {
            let held = Some(i) == self.journal.active;
            !held && !matches!(self.journal.halves[i], Condition::Clean | Condition::Open)
        });
        half.map(Area::Half).or(slot.map(Area::Slot))
    }
}

#[cfg(test)]
mod tests;
