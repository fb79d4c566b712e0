//! What a companion keeps in flash: two slots for roadmaps or fields, and a journal with the mission file, the parameters
//! and what of an area is photographed.
//!
//! Flash is I/O: the store asks ([`Store::poll`]) for one sector to be erased, one block to be programmed or some bytes to be
//! read, and is given the result ([`Store::handle`]). So a slow erasure never stops the setpoints, and the same code keeps
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
pub mod flash;
mod job;
mod jobs;
mod journal;
mod keeping;
mod mounting;
mod records;
mod upload;
mod upload_state;
pub mod window;

use core::ops::Range;

use self::area::{Area, Condition, Seal};
pub(crate) use self::flash::crc32;
pub use self::flash::{
    Erasing, Fault, File, FlashRequest, Layout, MAX_PROGRAM, MAX_READ, ReadFlash, ReadOutcome, WORD,
};
use self::job::Job;
use self::journal::Journal;
pub use self::upload_state::{UploadError, UploadState};
use self::window::Window;
use crate::services::parameters::Parameters;

/// Photographed waypoints of an area, as the mission writes them.
pub(crate) type Photographed = heapless::Vec<u8, MAX_PROGRAM>;

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
    photographed: Photographed,
    unsaved_photographed: bool,
    window: Window,
    upload: Option<(File, UploadState)>,
    job: Job,
    /// An erasure that lets a read go first, between two sectors.
    paused: Job,
    /// Whether the shell is at work for us.
    asked: bool,
    buffer: [u8; MAX_PROGRAM],
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
            photographed: Photographed::new(),
            unsaved_photographed: false,
            window: Window::default(),
            upload: None,
            job: Job::None,
            paused: Job::None,
            asked: false,
            buffer: [0; MAX_PROGRAM],
            word: [0; WORD],
            erasure_failed: false,
        };
        store.mount_journal(flash);
        store.in_use = store.newest();
        store
    }

    /// Place of the roadmap or field that this start uses, in the storage bank. The place is not
    /// written until the next start.
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

    /// Place of the mission file, in the storage bank; the caller copies the file from there, since
    /// the journal moves.
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

    /// Photographed waypoints of an area as last kept.
    pub(crate) fn photographed(&self) -> &[u8] {
        &self.photographed
    }

    /// Keeps that when the flash has time.
    pub(crate) fn keep_photographed(&mut self, photographed: Photographed) {
        self.photographed = photographed;
        self.unsaved_photographed = true;
    }

    /// Length of a file; `None` where there is none.
    pub fn size(&self, file: File) -> Option<u32> {
        self.extent(file).map(|extent| extent.end - extent.start)
    }

    /// Removes a file: it is not there at the next start.
    pub fn remove(&mut self, file: File) {
        match file {
            File::Roadmap | File::Field => {
                if let Some((_, Seal { sequence, .. })) = self.newest_of(file) {
                    self.forgotten = sequence;
                    self.unsaved = true;
                }
            }
            File::Mission => {
                self.journal.removed |= self.journal.mission.take().is_some();
            }
        }
    }

    /// Asks for bytes of a file; false where others are under way. At most [`MAX_READ`] are given, fewer at its end.
    pub fn read(&mut self, file: File, offset: u32, len: usize) -> bool {
        let Some(extent) = self.extent(file).filter(|extent| offset < extent.end - extent.start) else {
            return false;
        };
        let at = extent.start + offset;
        let len = len.min(MAX_READ).min((extent.end - at) as usize);
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

    /// The newest sealed area, if it holds this file.
    fn newest_of(&self, file: File) -> Option<(usize, Seal)> {
        let slot = self.newest()?;
        let seal = self.slots[slot].seal()?;
        (seal.field == (file == File::Field)).then_some((slot, seal))
    }

    fn extent(&self, file: File) -> Option<Range<u32>> {
        match file {
            File::Roadmap | File::Field => {
                let (slot, seal) = self.newest_of(file)?;
                let at = Area::Slot(slot).data_at(&self.layout);
                Some(at..at + seal.len)
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
