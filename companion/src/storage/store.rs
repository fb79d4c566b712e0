//! The flash store of a companion: two slots, each for a roadmap or a field of heights, and a
//! journal with the mission file, the parameters and the photographed waypoints of an area.
//!
//! Flash is I/O: the store requests ([`Store::poll_request`]) that one sector be erased, one block
//! programmed or some bytes read, and gets the outcome later ([`Store::handle_flash_outcome`]). So
//! a slow erasure never delays setpoints, and the same code runs on a board's flash, an emulated
//! flash, or memory on the host.
//!
//! A file is either complete or absent. It is written into an erased area and read back; the area's
//! seal is written last ([`flash_area`]). A power loss at any byte leaves what was sealed before.
//! Areas not in use are erased ahead of time, once the vehicle is known to be disarmed, so that an
//! upload finds one ready. The crate `sequential-storage` was considered: its operations are
//! futures that own the flash driver, and cannot be executed one request at a time.
//!
//! A roadmap is used in place. So the slot that a companion uses since its start is not written
//! before the next start; a newer roadmap or mission takes effect then.

pub mod flash;
pub mod flash_area;
mod job;
mod jobs;
mod journal;
mod keeping;
mod mounting;
pub mod reassembly;
mod records;
mod upload;
mod upload_state;

use core::ops::Range;

pub(crate) use self::flash::crc32;
pub use self::flash::{
    ErasePermission, File, FlashFault, FlashLayout, FlashRequest, MAX_PROGRAM_LEN, MAX_READ_LEN,
    ReadFlash, ReadOutcome, WORD_LEN,
};
use self::flash_area::{AreaCondition, FlashArea, Seal};
use self::job::FlashJob;
use self::journal::Journal;
use self::reassembly::UploadReassembly;
pub use self::upload_state::{UploadError, UploadState};
use crate::config::parameters::Parameters;

/// Record of the photographed waypoints of an area, as [`crate::mission::photographed`] writes it.
pub(crate) type PhotographedRecord = heapless::Vec<u8, MAX_PROGRAM_LEN>;

/// State of the flash store.
#[derive(Clone, Debug)]
pub struct Store {
    /// Where slots and journal lie in the flash.
    layout: FlashLayout,
    /// Condition of each slot.
    slots: [AreaCondition; 2],
    /// Slot whose roadmap or field has been used since this start; `None` if there was none.
    slot_in_use: Option<usize>,
    /// The journal's halves and records.
    journal: Journal,
    /// The parameters in use.
    parameters: Parameters,
    /// Slots sealed with this sequence number or a lower one hold a removed file.
    removed_up_to_sequence: u32,
    /// Whether the parameters' record is still to be written.
    parameters_unsaved: bool,
    /// Record of the photographed waypoints, as stored or to be stored.
    photographed: PhotographedRecord,
    /// Whether the photographed waypoints' record is still to be written.
    photographed_unsaved: bool,
    /// Bytes of the upload that are not programmed yet.
    reassembly: UploadReassembly,
    /// The last upload, under way or ended; `None` before the first.
    upload: Option<(File, UploadState)>,
    /// The job under way.
    job: FlashJob,
    /// An erasure interrupted between two sectors, so that a read comes first.
    paused_erasure: FlashJob,
    /// Whether the shell executes a request whose outcome has not come yet.
    request_pending: bool,
    /// Data of a record, or the next bytes of a file to be programmed.
    buffer: [u8; MAX_PROGRAM_LEN],
    /// Mark, seal or record head to be programmed.
    program_word: [u8; WORD_LEN],
    /// Whether an erasure failed: nothing is erased until the next upload of a roadmap or field.
    erasure_failed: bool,
}

impl Store {
    /// Reads the flash: which slots hold complete files, and the last complete records of mission,
    /// parameters and photographed waypoints. It reads whole slots to check their CRC, so it takes
    /// milliseconds.
    pub fn mount(layout: FlashLayout, flash: &mut impl ReadFlash) -> Self {
        let slots = [0, 1].map(|i| flash_area::read_condition(&layout, FlashArea::Slot(i), flash));
        let mut store = Self {
            layout,
            slots,
            slot_in_use: None,
            journal: Journal::default(),
            parameters: Parameters::default(),
            removed_up_to_sequence: 0,
            parameters_unsaved: false,
            photographed: PhotographedRecord::new(),
            photographed_unsaved: false,
            reassembly: UploadReassembly::default(),
            upload: None,
            job: FlashJob::None,
            paused_erasure: FlashJob::None,
            request_pending: false,
            buffer: [0; MAX_PROGRAM_LEN],
            program_word: [0; WORD_LEN],
            erasure_failed: false,
        };
        store.mount_journal(flash);
        store.slot_in_use = store.newest_slot();
        store
    }

    /// Range of the roadmap or field in use since this start, in the storage bank; `None` if there
    /// is none. It is not written before the next start.
    pub fn map_range(&self) -> Option<Range<u32>> {
        let slot = self.slot_in_use?;
        let at = FlashArea::Slot(slot).data_offset(&self.layout);
        Some(at..at + self.slots[slot].seal()?.len)
    }

    /// Rejects the roadmap or field of this start, which is complete but cannot be used.
    /// [`Self::map_range`] is then the older one; returns whether there is one. To be
    /// called before any other use of the store.
    pub fn fall_back_to_older_roadmap(&mut self) -> bool {
        if let Some(slot) = self.slot_in_use {
            self.slots[slot] = AreaCondition::Dirty;
            self.slot_in_use = self.newest_slot();
        }
        self.slot_in_use.is_some()
    }

    /// Range of the mission file in the storage bank; the caller must copy the file, since the
    /// journal moves it.
    pub fn mission_range(&self) -> Option<Range<u32>> {
        self.file_range(File::Mission)
    }

    /// The values of the parameters, as set or as restored from flash.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Sets a parameter; it is written to flash by a later request.
    ///
    /// # Errors
    /// As [`Parameters::set`].
    pub fn set_parameter(
        &mut self,
        index: usize,
        value: f32,
    ) -> Result<(), crate::config::parameters::ParameterError> {
        if self.parameters.set(index, value)? {
            self.parameters_unsaved = true;
        }
        Ok(())
    }

    /// Whether the record of the parameters is still to be written: a parameter was set, a roadmap
    /// or field was removed, which the same record states, or the journal failed.
    pub fn has_unsaved_parameters(&self) -> bool {
        self.parameters_unsaved
    }

    /// The record of photographed waypoints, as last set or restored from flash.
    pub(crate) fn photographed_record(&self) -> &[u8] {
        &self.photographed
    }

    /// Sets the record of photographed waypoints; it is written to flash by a later request.
    pub(crate) fn set_photographed_record(&mut self, photographed: PhotographedRecord) {
        self.photographed = photographed;
        self.photographed_unsaved = true;
    }

    /// Length of a file, bytes; `None` if there is no such file.
    pub fn file_size(&self, file: File) -> Option<u32> {
        self.file_range(file).map(|extent| extent.end - extent.start)
    }

    /// Removes a file from listings and from the next start on; a roadmap in use stays in use until
    /// then.
    pub fn remove_file(&mut self, file: File) {
        match file {
            File::Roadmap | File::Field => {
                if let Some((_, Seal { sequence, .. })) = self.newest_slot_of(file) {
                    self.removed_up_to_sequence = sequence;
                    self.parameters_unsaved = true;
                }
            }
            File::Mission => {
                self.journal.mission_removal_unsaved |= self.journal.mission.take().is_some();
            }
        }
    }

    /// Starts reading up to `len` bytes of a file (at most [`MAX_READ_LEN`], fewer at the file's
    /// end). False if the file ends before `offset`, or if the store is at work: in that case it is
    /// to be called again.
    pub fn request_read(&mut self, file: File, offset: u32, len: usize) -> bool {
        let Some(extent) =
            self.file_range(file).filter(|extent| offset < extent.end - extent.start)
        else {
            return false;
        };
        let at = extent.start + offset;
        let len = len.min(MAX_READ_LEN).min((extent.end - at) as usize);
        self.start_read(FlashJob::Read { at, len })
    }

    /// Starts computing the CRC-32 of a whole file, beginning with `state`. False if there is no
    /// such file, or if the store is at work: in that case it is to be called again.
    pub fn request_crc(&mut self, file: File, state: u32) -> bool {
        let Some(extent) = self.file_range(file) else { return false };
        self.start_read(FlashJob::Crc { at: extent.start, end: extent.end, sum: state })
    }

    /// Starts a job that reads; an erasure pauses for it. False while any other job is under way.
    fn start_read(&mut self, job: FlashJob) -> bool {
        match self.job {
            FlashJob::None => {}
            FlashJob::Erase { .. } if !self.request_pending => self.paused_erasure = self.job,
            _ => return false,
        }
        self.job = job;
        true
    }

    /// The slot with the newest complete roadmap or field that was not removed.
    fn newest_slot(&self) -> Option<usize> {
        let number = |i: &usize| self.slots[*i].seal().map(|seal| seal.sequence);
        (0..2)
            .filter(|i| number(i).is_some_and(|n| n > self.removed_up_to_sequence))
            .max_by_key(number)
    }

    /// The newest slot and its seal, if it holds `file`; of roadmap and field only the newer one
    /// counts.
    fn newest_slot_of(&self, file: File) -> Option<(usize, Seal)> {
        let slot = self.newest_slot()?;
        let seal = self.slots[slot].seal()?;
        (seal.is_height_field == (file == File::Field)).then_some((slot, seal))
    }

    /// Range of a file in the storage bank; `None` if there is no such file.
    fn file_range(&self, file: File) -> Option<Range<u32>> {
        match file {
            File::Roadmap | File::Field => {
                let (slot, seal) = self.newest_slot_of(file)?;
                let at = FlashArea::Slot(slot).data_offset(&self.layout);
                Some(at..at + seal.len)
            }
            File::Mission => self.journal.mission.clone(),
        }
    }

    /// Condition of a slot or of a half of the journal.
    fn condition_mut(&mut self, area: FlashArea) -> &mut AreaCondition {
        match area {
            FlashArea::Slot(i) => &mut self.slots[i],
            FlashArea::JournalHalf(i) => &mut self.journal.halves[i],
        }
    }

    /// An area to be erased ahead of time: neither in use, nor the newest, nor erased or being
    /// written.
    fn next_area_to_erase(&self) -> Option<FlashArea> {
        let newest = self.newest_slot();
        let slot = (0..2).find(|&i| {
            let held = Some(i) == self.slot_in_use || Some(i) == newest;
            !held && !matches!(self.slots[i], AreaCondition::Clean | AreaCondition::Open)
        });
        let half = (0..2).find(|&i| {
            let held = Some(i) == self.journal.active_half;
            !held && !matches!(self.journal.halves[i], AreaCondition::Clean | AreaCondition::Open)
        });
        half.map(FlashArea::JournalHalf).or(slot.map(FlashArea::Slot))
    }
}

#[cfg(test)]
mod tests;
