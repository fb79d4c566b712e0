//! What the store does with its flash, one request at a time: which job is next, what it asks for, what follows.

use super::Store;
use super::area::{self, Area, Condition, Seal};
use super::flash::{
    CRC_START, Erasing, Fault, File, FlashRequest, MAX_PROGRAM, MAX_READ, ReadOutcome, WORD, crc_step,
};
use super::job::Job;
use super::journal;
use super::records::{Compaction, Record, Source, Step};
use super::upload_state::{UploadError, UploadState};

impl Store {
    /// The shell's next request, once; its result goes to [`Self::handle`]. Areas are erased only
    /// where that is allowed; a flash that stalls the processor only reads where it is forbidden.
    pub fn poll(&mut self, erasing: Erasing) -> Option<FlashRequest<'_>> {
        if self.asked {
            return None;
        }
        let reads = matches!(self.job, Job::Read { .. } | Job::Sum { .. });
        if self.layout.stalls && erasing == Erasing::Forbidden && !reads {
            return None;
        }
        if self.job == Job::None {
            self.job = self.choose(erasing)?;
        }
        // An erasure goes on only while it may.
        if matches!(self.job, Job::Erase { .. }) && erasing != Erasing::Allowed {
            self.job = Job::None;
            return None;
        }
        self.prepare();
        self.asked = true;
        let layout = &self.layout;
        Some(match self.job {
            Job::None | Job::Ignored => {
                self.asked = false;
                return None;
            }
            Job::Read { at, len } => FlashRequest::Read { at, len },
            Job::Sum { at, end, .. } => FlashRequest::Read { at, len: MAX_READ.min((end - at) as usize) },
            Job::Erase { at, .. } => FlashRequest::Erase { at },
            Job::MarkClean(_) | Job::MarkUsed(_) | Job::Seal(..) => {
                let (at, word) = match self.job {
                    Job::MarkClean(area) => area::clean(layout, area),
                    Job::Seal(area, seal) => area::seal(layout, area, &seal),
                    Job::MarkUsed(area) => area::used(layout, area),
                    _ => return None,
                };
                self.word = word;
                FlashRequest::Program { at, bytes: &self.word }
            }
            Job::Flush(slot) => {
                FlashRequest::Program { at: slot.data_at(layout) + self.window.front(), bytes: &self.buffer }
            }
            Job::FlushRest { slot, done } => {
                let at = self.window.front() + done;
                let left = self.window.file_len() - at;
                let count = left.next_multiple_of(WORD as u32).min(MAX_PROGRAM as u32) as usize;
                FlashRequest::Program { at: slot.data_at(layout) + at, bytes: &self.buffer[..count] }
            }
            Job::Check { slot, done, .. } => {
                let left = (self.window.file_len() - done) as usize;
                FlashRequest::Read { at: slot.data_at(layout) + done, len: left.min(MAX_READ) }
            }
            Job::SealCheck(area, seal) => {
                FlashRequest::Read { at: area::seal(layout, area, &seal).0, len: WORD }
            }
            Job::Record(record) => {
                let data_at = record.at + WORD as u32 + record.done;
                let left = (record.whole() - record.done) as usize;
                match (record.step, record.source) {
                    (Step::Head, _) => {
                        self.word = journal::head(record.kind, record.len, record.crc);
                        FlashRequest::Program { at: record.at, bytes: &self.word }
                    }
                    (Step::Load, Source::Flash(from)) => {
                        FlashRequest::Read { at: from + record.done, len: left.min(MAX_PROGRAM) }
                    }
                    (Step::Load | Step::Data, _) => {
                        let count = left.next_multiple_of(WORD).min(MAX_PROGRAM);
                        FlashRequest::Program { at: data_at, bytes: &self.buffer[..count] }
                    }
                    (Step::Verify, _) => {
                        FlashRequest::Read { at: record.at + record.done, len: left.min(MAX_READ) }
                    }
                }
            }
        })
    }

    /// Fills the buffer for what is programmed next.
    fn prepare(&mut self) {
        let rest = match self.job {
            Job::Flush(_) => self.window.block().map(|block| &block[..]),
            Job::FlushRest { done, .. } => self.window.rest().and_then(|rest| rest.get(done as usize..)),
            Job::Record(Record { step: Step::Load, source: Source::Window, done, .. }) => {
                self.window.rest().and_then(|rest| rest.get(done as usize..))
            }
            _ => return,
        };
        let rest = rest.unwrap_or_default();
        let count = rest.len().min(MAX_PROGRAM);
        self.buffer.fill(0xFF);
        self.buffer[..count].copy_from_slice(&rest[..count]);
    }

    fn choose(&mut self, erasing: Erasing) -> Option<Job> {
        let may_erase = erasing == Erasing::Allowed;
        match self.upload {
            Some((File::Roadmap | File::Field, UploadState::Opening)) => {
                let slot = self.target()?;
                return match self.slots[slot] {
                    Condition::Clean => Some(Job::MarkUsed(Area::Slot(slot))),
                    _ if self.erasure_failed => {
                        self.end(Err(UploadError::Flash));
                        None
                    }
                    _ => match erasing {
                        Erasing::Allowed => Some(self.erase(Area::Slot(slot))),
                        Erasing::NotYet => None,
                        Erasing::Forbidden => {
                            self.end(Err(UploadError::Armed));
                            None
                        }
                    },
                };
            }
            Some((File::Roadmap | File::Field, state)) => {
                if let Some(slot) = self.open_slot() {
                    if self.window.block().is_some() {
                        return Some(Job::Flush(slot));
                    }
                    if state == UploadState::Closing {
                        let all = self.window.front() >= self.window.file_len();
                        return Some(if all {
                            self.begin_check(slot)
                        } else {
                            Job::FlushRest { slot, done: 0 }
                        });
                    }
                }
            }
            _ => {}
        }
        if let Some(job) = self.choose_record(erasing) {
            return Some(job);
        }
        if let Job::Erase { .. } = self.paused {
            return Some(core::mem::replace(&mut self.paused, Job::None));
        }
        let uploads = matches!(self.upload, Some((_, UploadState::Taking | UploadState::Closing)));
        let area = self.stale().filter(|_| may_erase && !uploads && !self.erasure_failed)?;
        Some(self.erase(area))
    }

    fn begin_check(&self, slot: Area) -> Job {
        Job::Check { slot, done: 0, sum: CRC_START, tail: [0; 4] }
    }

    pub(super) fn erase(&mut self, area: Area) -> Job {
        *self.condition(area) = Condition::Dirty;
        self.paused = Job::None;
        Job::Erase { area, at: area.at(&self.layout) }
    }

    /// Takes in how the last request went; `Ok` of an erasure or a program holds no bytes.
    pub fn handle<'a>(&mut self, outcome: Result<&'a [u8], Fault>) -> Option<ReadOutcome<'a>> {
        if !core::mem::take(&mut self.asked) {
            return None;
        }
        let job = core::mem::replace(&mut self.job, Job::None);
        match (job, outcome) {
            (Job::None | Job::Ignored, _) => {}
            (Job::Read { .. }, Ok(bytes)) => return Some(ReadOutcome::Bytes(bytes)),
            (Job::Read { .. } | Job::Sum { .. }, Err(Fault)) => return Some(ReadOutcome::Failed),
            (Job::Sum { at, end, sum }, Ok(bytes)) => {
                let (at, sum) = (at + bytes.len() as u32, crc_step(sum, bytes));
                if bytes.is_empty() {
                    return Some(ReadOutcome::Failed);
                }
                if at >= end {
                    return Some(ReadOutcome::Sum(sum));
                }
                self.job = Job::Sum { at, end, sum };
            }
            (Job::Erase { .. } | Job::MarkClean(_), Err(Fault)) => self.erasure_failed = true,
            (Job::Erase { area, at }, Ok(_)) => {
                let at = at + self.layout.sector_len;
                let more = at < area.end(&self.layout);
                self.job = if more { Job::Erase { area, at } } else { Job::MarkClean(area) };
            }
            (Job::MarkClean(area), Ok(_)) => *self.condition(area) = Condition::Clean,
            (Job::MarkUsed(area), Ok(_)) => self.begin(area),
            (Job::Flush(_), Ok(_)) => self.window.advance(),
            (Job::FlushRest { slot, done }, Ok(_)) => {
                let done = done + MAX_PROGRAM as u32;
                let more = self.window.front() + done < self.window.file_len();
                self.job = if more { Job::FlushRest { slot, done } } else { self.begin_check(slot) };
            }
            (Job::Check { slot, done, sum, tail }, Ok(bytes)) => {
                self.check_upload_crc(slot, done, sum, tail, bytes);
            }
            (Job::Seal(area, seal), Ok(_)) => self.job = Job::SealCheck(area, seal),
            (Job::SealCheck(area, seal), Ok(bytes)) => {
                if bytes == area::seal(&self.layout, area, &seal).1 {
                    self.sealed(area, seal);
                } else {
                    self.fail(area);
                }
            }
            (Job::Record(record), Ok(bytes)) => self.record(record, bytes),
            (Job::Record(_), Err(Fault)) => self.fail_record(),
            (Job::MarkUsed(area) | Job::Seal(area, _) | Job::SealCheck(area, _), Err(Fault)) => {
                self.fail(area);
            }
            (Job::Flush(slot) | Job::FlushRest { slot, .. } | Job::Check { slot, .. }, Err(Fault)) => {
                self.fail(slot);
            }
        }
        None
    }

    /// An area is marked as used: what goes into it may come.
    fn begin(&mut self, area: Area) {
        *self.condition(area) = Condition::Open;
        match area {
            Area::Slot(_) => self.upload = self.upload.map(|(file, _)| (file, UploadState::Taking)),
            Area::Half(half) => {
                let at = area.data_at(&self.layout);
                self.journal.compacting = Some(Compaction { half, at, step: 0, mission: None });
            }
        }
    }

    /// A request to an area failed: the area is to be erased.
    pub(super) fn fail(&mut self, area: Area) {
        *self.condition(area) = Condition::Dirty;
        match area {
            Area::Slot(_) => self.end(Err(UploadError::Flash)),
            Area::Half(_) => {
                self.journal.compacting = None;
                self.journal.failures += 1;
                (self.unsaved, self.unsaved_photographed) = (true, !self.photographed.is_empty());
            }
        }
    }

    fn check_upload_crc(&mut self, slot: Area, done: u32, sum: u32, mut tail: [u8; 4], bytes: &[u8]) {
        let len = self.window.file_len();
        let field = matches!(self.upload, Some((File::Field, _)));
        if (done == 0 && !Self::declares(field, bytes, len)) || bytes.is_empty() {
            return self.end(Err(UploadError::Damaged));
        }
        // The file's own CRC is its last four bytes, and covers all others.
        let covered = (len - 4).saturating_sub(done) as usize;
        let (body, end) = bytes.split_at(covered.min(bytes.len()));
        let sum = crc_step(sum, body);
        let done = done + bytes.len() as u32;
        let at = 4 - (len - (done - end.len() as u32)).min(4) as usize;
        tail[at..at + end.len()].copy_from_slice(end);
        if done < len {
            self.job = Job::Check { slot, done, sum, tail };
            return;
        }
        let crc = u32::from_le_bytes(tail);
        if !sum != crc {
            return self.end(Err(UploadError::Damaged));
        }
        let number = |c: &Condition| c.seal().map_or(0, |seal| seal.sequence);
        let newest = self.slots.iter().map(number).max().unwrap_or(0).max(self.forgotten);
        self.job = Job::Seal(slot, Seal { sequence: newest + 1, len, crc, field });
    }

    fn sealed(&mut self, area: Area, seal: Seal) {
        *self.condition(area) = Condition::Sealed(seal);
        match area {
            Area::Slot(_) => self.end(Ok(())),
            Area::Half(half) => {
                if let Some(compaction) = self.journal.compacting.take() {
                    self.journal.active = Some(half);
                    self.journal.end = compaction.at;
                    self.journal.mission = compaction.mission;
                    self.journal.failures = 0;
                }
            }
        }
    }

    /// Gives up what was being done for an upload.
    pub(super) fn drop_job(&mut self) {
        match self.job {
            Job::MarkUsed(area @ Area::Slot(_)) => *self.condition(area) = Condition::Dirty,
            Job::Flush(_) => {}
            _ => return,
        }
        self.job = if self.asked { Job::Ignored } else { Job::None };
    }
}
