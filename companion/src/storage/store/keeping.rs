//! Records written to the journal, and the journal written again where it is full.

use super::Store;
use super::area::{Area, Condition, Seal};
use super::flash::{CRC_START, Erasing, File, MAX_PROGRAM, WORD, crc_step, crc32};
use super::job::Job;
use super::journal::{self, record_len};
use super::records::*;
use super::upload_state::{UploadError, UploadState};

impl Store {
    /// The journal's next step.
    pub(super) fn choose_record(&mut self, erasing: Erasing) -> Option<Job> {
        if let Some(compaction) = self.journal.compacting.clone() {
            let Compaction { half, at, step, mission } = compaction;
            return Some(match (step, self.journal.mission.clone()) {
                (0, _) => Job::Record(self.parameters_record(at)),
                (1, _) if !self.photographed.is_empty() => Job::Record(self.photographed_record(at)),
                (1 | 2, Some(kept)) => Job::Record(Record {
                    kind: Kind::Mission,
                    at,
                    len: kept.end - kept.start,
                    crc: self.journal.mission_crc,
                    source: Source::Flash(kept.start),
                    step: Step::Head,
                    done: 0,
                    sum: CRC_START,
                }),
                _ => {
                    let number = |c: &Condition| c.seal().map_or(0, |seal| seal.sequence);
                    let newest = self.journal.halves.iter().map(number).max().unwrap_or(0);
                    self.journal.compacting = Some(Compaction { half, at, step: 3, mission });
                    Job::Seal(Area::Half(half), Seal { sequence: newest + 1, len: 0, crc: 0, field: false })
                }
            });
        }
        let closing = self.upload == Some((File::Mission, UploadState::Closing));
        if self.journal.failures >= MAX_JOURNAL_TRIES {
            if closing {
                self.end(Err(UploadError::Flash));
            }
            return None;
        }
        let (kind, len) = if closing {
            (Kind::Mission, self.window.file_len())
        } else if self.journal.removed {
            (Kind::Mission, 0)
        } else if self.unsaved {
            (Kind::Parameters, journal::PARAMETERS_LEN as u32)
        } else if self.unsaved_photographed {
            (Kind::Photographed, self.photographed.len() as u32)
        } else {
            return None;
        };
        let fits = |active: usize| self.journal.end + record_len(len) <= Area::Half(active).end(&self.layout);
        if !self.journal.active.is_some_and(fits) {
            return self.begin_compaction(erasing, closing);
        }
        let at = self.journal.end;
        Some(Job::Record(match kind {
            Kind::Parameters => self.parameters_record(at),
            Kind::Photographed => self.photographed_record(at),
            Kind::Mission => {
                let crc = if len == 0 { crc32(&[]) } else { crc32(self.window.rest().unwrap_or_default()) };
                let (step, source) = (Step::Head, Source::Window);
                Record { kind, at, len, crc, source, step, done: 0, sum: CRC_START }
            }
        }))
    }

    fn begin_compaction(&mut self, erasing: Erasing, closing: bool) -> Option<Job> {
        let half = usize::from(self.journal.active == Some(0));
        match self.journal.halves[half] {
            Condition::Clean => Some(Job::MarkUsed(Area::Half(half))),
            _ => {
                let refused = match erasing {
                    _ if self.erasure_failed => UploadError::Flash,
                    Erasing::Allowed => return Some(self.erase(Area::Half(half))),
                    Erasing::NotYet => return None,
                    Erasing::Forbidden => UploadError::Armed,
                };
                if closing {
                    self.end(Err(refused));
                }
                None
            }
        }
    }

    fn parameters_record(&mut self, at: u32) -> Record {
        let len = journal::PARAMETERS_LEN;
        self.buffer.fill(0xFF);
        self.buffer[..4].copy_from_slice(&self.forgotten.to_le_bytes());
        self.buffer[4..len].copy_from_slice(&self.parameters.to_bytes());
        self.unsaved = false;
        self.buffer_record(Kind::Parameters, at, len)
    }

    fn photographed_record(&mut self, at: u32) -> Record {
        let len = self.photographed.len();
        self.buffer.fill(0xFF);
        self.buffer[..len].copy_from_slice(&self.photographed);
        self.unsaved_photographed = false;
        self.buffer_record(Kind::Photographed, at, len)
    }

    /// A record of what is in the buffer.
    fn buffer_record(&self, kind: Kind, at: u32, len: usize) -> Record {
        Record {
            kind,
            at,
            len: len as u32,
            crc: crc32(&self.buffer[..len]),
            source: Source::Buffer,
            step: Step::Head,
            done: 0,
            sum: CRC_START,
        }
    }

    pub(super) fn record(&mut self, mut record: Record, bytes: &[u8]) {
        match (record.step, record.source) {
            (Step::Head, Source::Buffer) => record.step = Step::Data,
            (Step::Head, _) => record.step = Step::Load,
            (Step::Load, Source::Flash(_)) => {
                let count = bytes.len().min(MAX_PROGRAM);
                self.buffer.fill(0xFF);
                self.buffer[..count].copy_from_slice(&bytes[..count]);
                record.step = Step::Data;
                self.job = Job::Record(record);
                return;
            }
            (Step::Load | Step::Data, _) => {
                record.done = (record.done + MAX_PROGRAM as u32).min(record.len);
                record.step = if matches!(record.source, Source::Buffer) { Step::Data } else { Step::Load };
            }
            (Step::Verify, _) => {
                let head = if record.done == 0 { WORD } else { 0 };
                let Some((head, data)) = bytes.split_at_checked(head).filter(|_| !bytes.is_empty()) else {
                    return self.fail_record();
                };
                if !head.is_empty() && head != journal::head(record.kind, record.len, record.crc) {
                    return self.fail_record();
                }
                record.sum = crc_step(record.sum, data);
                record.done += bytes.len() as u32;
            }
        }
        if record.done < record.whole() {
            self.job = Job::Record(record);
        } else if record.step != Step::Verify {
            self.job = Job::Record(Record { step: Step::Verify, done: 0, ..record });
        } else if !record.sum != record.crc {
            self.fail_record();
        } else {
            self.finish_record(&record);
        }
    }

    fn finish_record(&mut self, record: &Record) {
        let data_at = record.at + WORD as u32;
        let held = (record.len > 0).then_some(data_at..data_at + record.len);
        let end = record.at + record_len(record.len);
        if let Some(compaction) = &mut self.journal.compacting {
            compaction.at = end;
            compaction.step = match record.kind {
                Kind::Parameters => 1,
                Kind::Photographed => 2,
                Kind::Mission => 3,
            };
            if record.kind == Kind::Mission {
                compaction.mission = held;
            }
            return;
        }
        self.journal.end = end;
        self.journal.failures = 0;
        if record.kind == Kind::Mission {
            self.journal.mission = held;
            self.journal.mission_crc = record.crc;
            self.journal.removed = false;
            if record.len > 0 {
                self.end(Ok(()));
            }
        }
    }

    /// A record did not come out whole: nothing more is written behind it.
    pub(super) fn fail_record(&mut self) {
        if let Some(compaction) = self.journal.compacting.clone() {
            return self.fail(Area::Half(compaction.half));
        }
        self.journal.failures += 1;
        (self.unsaved, self.unsaved_photographed) = (true, !self.photographed.is_empty());
        if let Some(active) = self.journal.active {
            self.journal.end = Area::Half(active).end(&self.layout);
        }
    }
}
