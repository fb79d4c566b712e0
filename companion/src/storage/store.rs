//! What a companion keeps in flash: two slots for roadmaps or fields, and a journal with the
//! mission file, the parameters and what of an area is photographed.
//!
//! Flash is I/O: the store asks ([`Store::poll_request`]) for one sector to be erased, one block to
//! be programmed or some bytes to be read, and is given the result ([`Store::handle_outcome`]). So
//! a slow erasure never stops the setpoints, and the same code keeps its files in a board's flash,
//! an emulated one, or a desk's memory.
//!
//! A file is whole or not there: it is written into an area that was erased before, read back, and
//! sealed last ([`area`]). A cut at any byte leaves what was sealed before. The areas not in use
//! are erased ahead of time, as soon as the vehicle is known to be disarmed, so that an upload
//! finds one ready. A small crate for such journals (`sequential-storage`) was checked: its
//! operations are futures over a flash driver that they own, which cannot be asked for one step at
//! a time.
//!
//! A roadmap is used in place, so the slot a companion started from is not written until the next
//! start; the newest roadmap and mission take effect then.

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

use self::area::{AreaCondition, FlashArea, Seal};
pub(crate) use self::flash::crc32;
pub use self::flash::{
    ErasePermission, File, FlashFault, FlashLayout, FlashRequest, MAX_PROGRAM, MAX_READ, ReadFlash,
    ReadOutcome, WORD,
};
use self::job::FlashJob;
use self::journal::Journal;
pub use self::upload_state::{UploadError, UploadState};
use self::window::UploadReassembly;
use crate::services::parameters::Parameters;

/// Photographed waypoints of an area, as the mission writes them.
pub(crate) type Photographed = heapless::Vec<u8, MAX_PROGRAM>;

/// A companion's flash.
#[derive(Clone, Debug)]
pub struct Store {
    layout: FlashLayout,
    slots: [AreaCondition; 2],
    in_use: Option<usize>,
    journal: Journal,
    parameters: Parameters,
    /// Roadmaps up to this number were removed.
    forgotten: u32,
    unsaved: bool,
    photographed: Photographed,
    unsaved_photographed: bool,
    reassembly: UploadReassembly,
    upload: Option<(File, UploadState)>,
    job: FlashJob,
    /// An erasure that lets a read go first, between two sectors.
    paused_job: FlashJob,
    /// Whether the shell is at work for us.
    request_pending: bool,
    buffer: [u8; MAX_PROGRAM],
    program_word: [u8; WORD],
    erasure_failed: bool,
}

impl Store {
    /// Looks through the flash: which roadmap is the newest whole one, which mission and parameters
    /// were last kept. Reads a roadmap slot whole, so it takes milliseconds.
    pub fn mount(layout: FlashLayout, flash: &mut impl ReadFlash) -> Self {
        let slots = [0, 1].map(|i| area::read_condition(&layout, FlashArea::Slot(i), flash));
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
            reassembly: UploadReassembly::default(),
            upload: None,
            job: FlashJob::None,
            paused_job: FlashJob::None,
            request_pending: false,
            buffer: [0; MAX_PROGRAM],
            program_word: [0; WORD],
            erasure_failed: false,
        };
        store.mount_journal(flash);
        store.in_use = store.newest_slot();
        store
    }

    /// Place of the roadmap or field that this start uses, in the storage bank. The place is not
    /// written until the next start.
    pub fn roadmap(&self) -> Option<Range<u32>> {
        let slot = self.in_use?;
        let at = FlashArea::Slot(slot).data_offset(&self.layout);
        Some(at..at + self.slots[slot].seal()?.len)
    }

    /// The roadmap of this start cannot be used after all, whole as it is: [`Self::roadmap`] is the
    /// one before it, if that is still there; whether it is. To be called before anything else is
    /// done with the flash.
    pub fn refuse_roadmap(&mut self) -> bool {
        if let Some(slot) = self.in_use {
            self.slots[slot] = AreaCondition::Dirty;
            self.in_use = self.newest_slot();
        }
        self.in_use.is_some()
    }

    /// Place of the mission file, in the storage bank; the caller copies the file from there, since
    /// the journal moves.
    pub fn mission(&self) -> Option<Range<u32>> {
        self.file_range(File::Mission)
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
    ) -> Result<(), crate::services::parameters::ParameterError> {
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
    pub(crate) fn store_photographed(&mut self, photographed: Photographed) {
        self.photographed = photographed;
        self.unsaved_photographed = true;
    }

    /// Length of a file; `None` where there is none.
    pub fn file_size(&self, file: File) -> Option<u32> {
        self.file_range(file).map(|extent| extent.end - extent.start)
    }

    /// Removes a file: it is not there at the next start.
    pub fn remove_file(&mut self, file: File) {
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

    /// Asks for bytes of a file; false where others are under way. At most [`MAX_READ`] are given,
    /// fewer at its end.
    pub fn request_read(&mut self, file: File, offset: u32, len: usize) -> bool {
        let Some(extent) =
            self.file_range(file).filter(|extent| offset < extent.end - extent.start)
        else {
            return false;
        };
        let at = extent.start + offset;
        let len = len.min(MAX_READ).min((extent.end - at) as usize);
        self.start_read(FlashJob::Read { at, len })
    }

    /// Asks for the running CRC of a whole file from a state; false where something else is under
    /// way.
    pub fn request_crc(&mut self, file: File, state: u32) -> bool {
        let Some(extent) = self.file_range(file) else { return false };
        self.start_read(FlashJob::Sum { at: extent.start, end: extent.end, sum: state })
    }

    fn start_read(&mut self, job: FlashJob) -> bool {
        match self.job {
            FlashJob::None => {}
            FlashJob::Erase { .. } if !self.request_pending => self.paused_job = self.job,
            _ => return false,
        }
        self.job = job;
        true
    }

    /// The newest sealed roadmap that was not removed.
    fn newest_slot(&self) -> Option<usize> {
        let number = |i: &usize| self.slots[*i].seal().map(|seal| seal.sequence);
        (0..2).filter(|i| number(i).is_some_and(|n| n > self.forgotten)).max_by_key(number)
    }

    /// The newest sealed area, if it holds this file.
    fn newest_of(&self, file: File) -> Option<(usize, Seal)> {
        let slot = self.newest_slot()?;
        let seal = self.slots[slot].seal()?;
        (seal.field == (file == File::Field)).then_some((slot, seal))
    }

    fn file_range(&self, file: File) -> Option<Range<u32>> {
        match file {
            File::Roadmap | File::Field => {
                let (slot, seal) = self.newest_of(file)?;
                let at = FlashArea::Slot(slot).data_offset(&self.layout);
                Some(at..at + seal.len)
            }
            File::Mission => self.journal.mission.clone(),
        }
    }

    fn condition_mut(&mut self, area: FlashArea) -> &mut AreaCondition {
        match area {
            FlashArea::Slot(i) => &mut self.slots[i],
            FlashArea::Half(i) => &mut self.journal.halves[i],
        }
    }

    /// An area that is to be erased ahead of time: neither used nor the newest.
    fn next_area_to_erase(&self) -> Option<FlashArea> {
        let newest = self.newest_slot();
        let slot = (0..2).find(|&i| {
            let held = Some(i) == self.in_use || Some(i) == newest;
            !held && !matches!(self.slots[i], AreaCondition::Clean | AreaCondition::Open)
        });
        let half = (0..2).find(|&i| {
            let held = Some(i) == self.journal.active;
            !held && !matches!(self.journal.halves[i], AreaCondition::Clean | AreaCondition::Open)
        });
        half.map(FlashArea::Half).or(slot.map(FlashArea::Slot))
    }
}

#[cfg(test)]
mod tests;
