//! How the store uses its flash, one request at a time: it chooses a job, makes its next request,
//! and continues with the outcome.

use super::Store;
use super::flash::{
    CRC_START, ErasePermission, File, FlashFault, FlashRequest, MAX_PROGRAM_LEN, MAX_READ_LEN,
    ReadOutcome, WORD_LEN, continue_crc,
};
use super::flash_area::{self, AreaCondition, FlashArea, Seal};
use super::job::FlashJob;
use super::journal;
use super::records::{Compaction, JournalRecord, RecordSource, RecordStep};
use super::upload_state::{UploadError, UploadState};

impl Store {
    /// The next request to the shell; [`Self::handle_flash_outcome`] must get its outcome before
    /// the next one. `None` if there is nothing to do or a request is open. `erasing` says whether
    /// areas may be erased. While `erasing` is `Forbidden`, a flash that stalls the processor is
    /// only read.
    pub fn poll_request(&mut self, erasing: ErasePermission) -> Option<FlashRequest<'_>> {
        if self.request_pending {
            return None;
        }
        let reads = matches!(self.job, FlashJob::Read { .. } | FlashJob::Crc { .. });
        if self.layout.stalls_processor && erasing == ErasePermission::Forbidden && !reads {
            return None;
        }
        if self.job == FlashJob::None {
            self.job = self.choose_job(erasing)?;
        }
        // An erasure is given up once it is no longer allowed.
        if matches!(self.job, FlashJob::Erase { .. }) && erasing != ErasePermission::Allowed {
            self.job = FlashJob::None;
            return None;
        }
        self.fill_buffer();
        self.request_pending = true;
        let layout = &self.layout;
        Some(match self.job {
            FlashJob::None | FlashJob::Abandoned => {
                self.request_pending = false;
                return None;
            }
            FlashJob::Read { at, len } => FlashRequest::Read { at, len },
            FlashJob::Crc { at, end, .. } => {
                FlashRequest::Read { at, len: MAX_READ_LEN.min((end - at) as usize) }
            }
            FlashJob::Erase { at, .. } => FlashRequest::Erase { at },
            FlashJob::MarkClean(_) | FlashJob::MarkUsed(_) | FlashJob::Seal(..) => {
                let (at, word) = match self.job {
                    FlashJob::MarkClean(area) => flash_area::clean_mark(layout, area),
                    FlashJob::Seal(area, seal) => flash_area::seal_mark(layout, area, &seal),
                    FlashJob::MarkUsed(area) => flash_area::used_mark(layout, area),
                    _ => return None,
                };
                self.program_word = word;
                FlashRequest::Program { at, bytes: &self.program_word }
            }
            FlashJob::Flush(slot) => FlashRequest::Program {
                at: slot.data_offset(layout) + self.reassembly.flushed_len(),
                bytes: &self.buffer,
            },
            FlashJob::FlushRest { slot, done } => {
                let at = self.reassembly.flushed_len() + done;
                let left = self.reassembly.file_len() - at;
                let count =
                    left.next_multiple_of(WORD_LEN as u32).min(MAX_PROGRAM_LEN as u32) as usize;
                FlashRequest::Program {
                    at: slot.data_offset(layout) + at,
                    bytes: &self.buffer[..count],
                }
            }
            FlashJob::CheckUploadCrc { slot, done, .. } => {
                let left = (self.reassembly.file_len() - done) as usize;
                FlashRequest::Read {
                    at: slot.data_offset(layout) + done,
                    len: left.min(MAX_READ_LEN),
                }
            }
            FlashJob::SealCheck(area, seal) => FlashRequest::Read {
                at: flash_area::seal_mark(layout, area, &seal).0,
                len: WORD_LEN,
            },
            FlashJob::Record(record) => {
                let data_at = record.at + WORD_LEN as u32 + record.done;
                let left = (record.step_len() - record.done) as usize;
                match (record.step, record.source) {
                    (RecordStep::Head, _) => {
                        self.program_word =
                            journal::record_head(record.kind, record.len, record.crc);
                        FlashRequest::Program { at: record.at, bytes: &self.program_word }
                    }
                    (RecordStep::NextData, RecordSource::Flash(from)) => FlashRequest::Read {
                        at: from + record.done,
                        len: left.min(MAX_PROGRAM_LEN),
                    },
                    (RecordStep::NextData | RecordStep::Data, _) => {
                        let count = left.next_multiple_of(WORD_LEN).min(MAX_PROGRAM_LEN);
                        FlashRequest::Program { at: data_at, bytes: &self.buffer[..count] }
                    }
                    (RecordStep::Verify, _) => FlashRequest::Read {
                        at: record.at + record.done,
                        len: left.min(MAX_READ_LEN),
                    },
                }
            }
        })
    }

    /// Fills the buffer with the bytes that the job programs next from the reassembly window.
    fn fill_buffer(&mut self) {
        let rest = match self.job {
            FlashJob::Flush(_) => self.reassembly.next_block().map(|block| &block[..]),
            FlashJob::FlushRest { done, .. } => {
                self.reassembly.last_part().and_then(|rest| rest.get(done as usize..))
            }
            FlashJob::Record(JournalRecord {
                step: RecordStep::NextData,
                source: RecordSource::Window,
                done,
                ..
            }) => self.reassembly.last_part().and_then(|rest| rest.get(done as usize..)),
            _ => return,
        };
        let rest = rest.unwrap_or_default();
        let count = rest.len().min(MAX_PROGRAM_LEN);
        self.buffer.fill(0xFF);
        self.buffer[..count].copy_from_slice(&rest[..count]);
    }

    /// The next job: for an upload, else for the journal, else an erasure ahead of time.
    fn choose_job(&mut self, erasing: ErasePermission) -> Option<FlashJob> {
        let may_erase = erasing == ErasePermission::Allowed;
        match self.upload {
            Some((File::Roadmap | File::Field, UploadState::Opening)) => {
                let slot = self.writable_slot()?;
                return match self.slots[slot] {
                    AreaCondition::Clean => Some(FlashJob::MarkUsed(FlashArea::Slot(slot))),
                    _ if self.erasure_failed => {
                        self.end_upload(Err(UploadError::Flash));
                        None
                    }
                    _ => match erasing {
                        ErasePermission::Allowed => Some(self.erase_job(FlashArea::Slot(slot))),
                        ErasePermission::NotYet => None,
                        ErasePermission::Forbidden => {
                            self.end_upload(Err(UploadError::Armed));
                            None
                        }
                    },
                };
            }
            Some((File::Roadmap | File::Field, state)) => {
                if let Some(slot) = self.open_slot() {
                    if self.reassembly.next_block().is_some() {
                        return Some(FlashJob::Flush(slot));
                    }
                    if state == UploadState::Closing {
                        let all = self.reassembly.flushed_len() >= self.reassembly.file_len();
                        return Some(if all {
                            self.crc_check_job(slot)
                        } else {
                            FlashJob::FlushRest { slot, done: 0 }
                        });
                    }
                }
            }
            _ => {}
        }
        if let Some(job) = self.choose_record_job(erasing) {
            return Some(job);
        }
        if let FlashJob::Erase { .. } = self.paused_erasure {
            return Some(core::mem::replace(&mut self.paused_erasure, FlashJob::None));
        }
        let uploads =
            matches!(self.upload, Some((_, UploadState::Receiving | UploadState::Closing)));
        let area =
            self.next_area_to_erase().filter(|_| may_erase && !uploads && !self.erasure_failed)?;
        Some(self.erase_job(area))
    }

    /// The job that reads an upload back and checks its CRC.
    fn crc_check_job(&self, slot: FlashArea) -> FlashJob {
        FlashJob::CheckUploadCrc { slot, done: 0, sum: CRC_START, tail: [0; 4] }
    }

    /// Marks an area as dirty, and returns the job that erases it.
    pub(super) fn erase_job(&mut self, area: FlashArea) -> FlashJob {
        *self.condition_mut(area) = AreaCondition::Dirty;
        self.paused_erasure = FlashJob::None;
        FlashJob::Erase { area, at: area.offset(&self.layout) }
    }

    /// Handles the outcome of the last request. Returns the outcome of a caller's read or CRC once
    /// that has ended.
    pub fn handle_flash_outcome<'a>(
        &mut self,
        outcome: Result<&'a [u8], FlashFault>,
    ) -> Option<ReadOutcome<'a>> {
        if !core::mem::take(&mut self.request_pending) {
            return None;
        }
        let job = core::mem::replace(&mut self.job, FlashJob::None);
        match (job, outcome) {
            (FlashJob::None | FlashJob::Abandoned, _) => {}
            (FlashJob::Read { .. }, Ok(bytes)) => return Some(ReadOutcome::Bytes(bytes)),
            (FlashJob::Read { .. } | FlashJob::Crc { .. }, Err(_)) => {
                return Some(ReadOutcome::Failed);
            }
            (FlashJob::Crc { at, end, sum }, Ok(bytes)) => {
                let (at, sum) = (at + bytes.len() as u32, continue_crc(sum, bytes));
                if bytes.is_empty() {
                    return Some(ReadOutcome::Failed);
                }
                if at >= end {
                    return Some(ReadOutcome::Crc(sum));
                }
                self.job = FlashJob::Crc { at, end, sum };
            }
            (FlashJob::Erase { .. } | FlashJob::MarkClean(_), Err(_)) => self.erasure_failed = true,
            (FlashJob::Erase { area, at }, Ok(_)) => {
                let at = at + self.layout.sector_len;
                let more = at < area.end(&self.layout);
                self.job =
                    if more { FlashJob::Erase { area, at } } else { FlashJob::MarkClean(area) };
            }
            (FlashJob::MarkClean(area), Ok(_)) => *self.condition_mut(area) = AreaCondition::Clean,
            (FlashJob::MarkUsed(area), Ok(_)) => self.handle_area_marked(area),
            (FlashJob::Flush(_), Ok(_)) => self.reassembly.drop_first_block(),
            (FlashJob::FlushRest { slot, done }, Ok(_)) => {
                let done = done + MAX_PROGRAM_LEN as u32;
                let more = self.reassembly.flushed_len() + done < self.reassembly.file_len();
                self.job = if more {
                    FlashJob::FlushRest { slot, done }
                } else {
                    self.crc_check_job(slot)
                };
            }
            (FlashJob::CheckUploadCrc { slot, done, sum, tail }, Ok(bytes)) => {
                self.check_upload_crc(slot, done, sum, tail, bytes);
            }
            (FlashJob::Seal(area, seal), Ok(_)) => self.job = FlashJob::SealCheck(area, seal),
            (FlashJob::SealCheck(area, seal), Ok(bytes)) => {
                if bytes == flash_area::seal_mark(&self.layout, area, &seal).1 {
                    self.handle_sealed(area, seal);
                } else {
                    self.discard_area(area);
                }
            }
            (FlashJob::Record(record), Ok(bytes)) => self.continue_record(record, bytes),
            (FlashJob::Record(_), Err(_)) => self.fail_record(),
            (
                FlashJob::MarkUsed(area) | FlashJob::Seal(area, _) | FlashJob::SealCheck(area, _),
                Err(_),
            ) => {
                self.discard_area(area);
            }
            (
                FlashJob::Flush(slot)
                | FlashJob::FlushRest { slot, .. }
                | FlashJob::CheckUploadCrc { slot, .. },
                Err(_),
            ) => {
                self.discard_area(slot);
            }
        }
        None
    }

    /// Continues after an area was marked as used: a slot takes an upload, a half of the journal a
    /// compaction.
    fn handle_area_marked(&mut self, area: FlashArea) {
        *self.condition_mut(area) = AreaCondition::Open;
        match area {
            FlashArea::Slot(_) => {
                self.upload = self.upload.map(|(file, _)| (file, UploadState::Receiving));
            }
            FlashArea::JournalHalf(half) => {
                let at = area.data_offset(&self.layout);
                self.journal.compacting = Some(Compaction { half, at, step: 0, mission: None });
            }
        }
    }

    /// Marks an area for erasure after a request to it failed. Ends its upload with an error, or
    /// counts a failed compaction.
    pub(super) fn discard_area(&mut self, area: FlashArea) {
        *self.condition_mut(area) = AreaCondition::Dirty;
        match area {
            FlashArea::Slot(_) => self.end_upload(Err(UploadError::Flash)),
            FlashArea::JournalHalf(_) => {
                self.journal.compacting = None;
                self.journal.consecutive_failures += 1;
                (self.parameters_unsaved, self.photographed_unsaved) =
                    (true, !self.photographed.is_empty());
            }
        }
    }

    /// Continues reading an upload back: `bytes` are those of the file from `done` on. Once all are
    /// read and the CRC is right, requests the slot's seal.
    fn check_upload_crc(
        &mut self,
        slot: FlashArea,
        done: u32,
        sum: u32,
        mut tail: [u8; 4],
        bytes: &[u8],
    ) {
        let len = self.reassembly.file_len();
        let is_height_field = matches!(self.upload, Some((File::Field, _)));
        if (done == 0 && !self.is_file_head(bytes, len)) || bytes.is_empty() {
            return self.end_upload(Err(UploadError::Damaged));
        }
        // The last four bytes of the file are the CRC-32 of all others.
        let covered = (len - 4).saturating_sub(done) as usize;
        let (body, end) = bytes.split_at(covered.min(bytes.len()));
        let sum = continue_crc(sum, body);
        let done = done + bytes.len() as u32;
        let at = 4 - (len - (done - end.len() as u32)).min(4) as usize;
        tail[at..at + end.len()].copy_from_slice(end);
        if done < len {
            self.job = FlashJob::CheckUploadCrc { slot, done, sum, tail };
            return;
        }
        let crc = u32::from_le_bytes(tail);
        if !sum != crc {
            return self.end_upload(Err(UploadError::Damaged));
        }
        let number = |c: &AreaCondition| c.seal().map_or(0, |seal| seal.sequence);
        let newest =
            self.slots.iter().map(number).max().unwrap_or(0).max(self.removed_up_to_sequence);
        self.job = FlashJob::Seal(slot, Seal { sequence: newest + 1, len, crc, is_height_field });
    }

    /// Continues after an area's seal was read back: an upload has succeeded, or a compaction.
    fn handle_sealed(&mut self, area: FlashArea, seal: Seal) {
        *self.condition_mut(area) = AreaCondition::Sealed(seal);
        match area {
            FlashArea::Slot(_) => self.end_upload(Ok(())),
            FlashArea::JournalHalf(half) => {
                if let Some(compaction) = self.journal.compacting.take() {
                    self.journal.active_half = Some(half);
                    self.journal.next_record_at = compaction.at;
                    self.journal.mission = compaction.mission;
                    self.journal.consecutive_failures = 0;
                }
            }
        }
    }

    /// Gives up the job that serves an upload; the outcome of an open request is then ignored.
    pub(super) fn drop_upload_job(&mut self) {
        match self.job {
            FlashJob::MarkUsed(area @ FlashArea::Slot(_)) => {
                *self.condition_mut(area) = AreaCondition::Dirty;
            }
            FlashJob::Flush(_) => {}
            _ => return,
        }
        self.job = if self.request_pending { FlashJob::Abandoned } else { FlashJob::None };
    }
}
