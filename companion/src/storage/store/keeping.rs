//! Writing the records of the journal, and its compaction into the other half when one is full.

use super::Store;
use super::flash::{
    CRC_START, ErasePermission, File, MAX_PROGRAM_LEN, WORD_LEN, continue_crc, crc32,
};
use super::flash_area::{AreaCondition, FlashArea, Seal};
use super::job::FlashJob;
use super::journal::{self, record_len};
use super::records::*;
use super::upload_state::{UploadError, UploadState};

impl Store {
    /// The job for the next record: of the compaction under way, else of what was changed. `None`
    /// if nothing is to be written, or the other half is not erased yet.
    pub(super) fn choose_record_job(&mut self, erasing: ErasePermission) -> Option<FlashJob> {
        if let Some(compaction) = self.journal.compacting.clone() {
            return Some(self.continue_compaction(compaction));
        }
        let closing = self.is_mission_upload_closing();
        if self.journal.consecutive_failures >= MAX_JOURNAL_TRIES {
            if closing {
                self.end_upload(Err(UploadError::Flash));
            }
            return None;
        }
        let (kind, len) = if closing {
            (RecordKind::Mission, self.reassembly.file_len())
        } else if self.journal.mission_removal_unsaved {
            (RecordKind::Mission, 0)
        } else if self.parameters_unsaved {
            (RecordKind::Parameters, journal::PARAMETERS_LEN as u32)
        } else if self.photographed_unsaved {
            (RecordKind::Photographed, self.photographed.len() as u32)
        } else {
            return None;
        };
        let fits = |active: usize| {
            self.journal.next_record_at + record_len(len)
                <= FlashArea::JournalHalf(active).end(&self.layout)
        };
        if !self.journal.active_half.is_some_and(fits) {
            return self.begin_compaction(erasing);
        }
        let at = self.journal.next_record_at;
        Some(FlashJob::Record(match kind {
            RecordKind::Parameters => self.make_parameters_record(at),
            RecordKind::Photographed => self.make_photographed_record(at),
            RecordKind::Mission => {
                let rest =
                    if len == 0 { &[] } else { self.reassembly.last_part().unwrap_or_default() };
                let crc = crc32(rest);
                let (step, source) = (RecordStep::Head, RecordSource::Window);
                JournalRecord { kind, at, len, crc, source, step, done: 0, sum: CRC_START }
            }
        }))
    }

    /// Whether an uploaded mission file is about to be stored.
    fn is_mission_upload_closing(&self) -> bool {
        self.upload == Some((File::Mission, UploadState::Closing))
    }

    /// The next step of a compaction.
    fn continue_compaction(&mut self, compaction: Compaction) -> FlashJob {
        let Compaction { half, at, step, mission } = compaction;
        match (step, self.journal.mission.clone()) {
            (0, _) => FlashJob::Record(self.make_parameters_record(at)),
            (1, _) if !self.photographed.is_empty() => {
                FlashJob::Record(self.make_photographed_record(at))
            }
            (1 | 2, Some(kept)) => FlashJob::Record(JournalRecord {
                kind: RecordKind::Mission,
                at,
                len: kept.end - kept.start,
                crc: self.journal.mission_record_crc,
                source: RecordSource::Flash(kept.start),
                step: RecordStep::Head,
                done: 0,
                sum: CRC_START,
            }),
            _ => {
                let number = |c: &AreaCondition| c.seal().map_or(0, |seal| seal.sequence);
                let newest = self.journal.halves.iter().map(number).max().unwrap_or(0);
                self.journal.compacting = Some(Compaction { half, at, step: 3, mission });
                let seal = Seal { sequence: newest + 1, len: 0, crc: 0, is_height_field: false };
                FlashJob::Seal(FlashArea::JournalHalf(half), seal)
            }
        }
    }

    /// The first job of a compaction: marking the other half as used, or erasing it before. `None`
    /// where it may not be erased; an upload of a mission file then fails, unless it may wait.
    fn begin_compaction(&mut self, erasing: ErasePermission) -> Option<FlashJob> {
        let half = usize::from(self.journal.active_half == Some(0));
        match self.journal.halves[half] {
            AreaCondition::Clean => Some(FlashJob::MarkUsed(FlashArea::JournalHalf(half))),
            _ => {
                let refused = match erasing {
                    _ if self.erasure_failed => UploadError::Flash,
                    ErasePermission::Allowed => {
                        return Some(self.erase_job(FlashArea::JournalHalf(half)));
                    }
                    ErasePermission::NotYet => return None,
                    ErasePermission::Forbidden => UploadError::Armed,
                };
                if self.is_mission_upload_closing() {
                    self.end_upload(Err(refused));
                }
                None
            }
        }
    }

    /// Makes the parameters' record for offset `at`; they count as saved unless writing fails.
    fn make_parameters_record(&mut self, at: u32) -> JournalRecord {
        let len = journal::PARAMETERS_LEN;
        self.buffer.fill(0xFF);
        self.buffer[..4].copy_from_slice(&self.removed_up_to_sequence.to_le_bytes());
        self.buffer[4..len].copy_from_slice(&self.parameters.to_bytes());
        self.parameters_unsaved = false;
        self.buffer_record(RecordKind::Parameters, at, len)
    }

    /// Makes the photographed waypoints' record for offset `at`, as
    /// [`Self::make_parameters_record`].
    fn make_photographed_record(&mut self, at: u32) -> JournalRecord {
        let len = self.photographed.len();
        self.buffer.fill(0xFF);
        self.buffer[..len].copy_from_slice(&self.photographed);
        self.photographed_unsaved = false;
        self.buffer_record(RecordKind::Photographed, at, len)
    }

    /// Record whose data is the first `len` bytes of the buffer.
    fn buffer_record(&self, kind: RecordKind, at: u32, len: usize) -> JournalRecord {
        JournalRecord {
            kind,
            at,
            len: len as u32,
            crc: crc32(&self.buffer[..len]),
            source: RecordSource::Buffer,
            step: RecordStep::Head,
            done: 0,
            sum: CRC_START,
        }
    }

    /// Continues a record after a request succeeded; `bytes` are those that were read, if any.
    pub(super) fn continue_record(&mut self, mut record: JournalRecord, bytes: &[u8]) {
        match (record.step, record.source) {
            (RecordStep::Head, RecordSource::Buffer) => record.step = RecordStep::Data,
            (RecordStep::Head, _) => record.step = RecordStep::NextData,
            (RecordStep::NextData, RecordSource::Flash(_)) => {
                let count = bytes.len().min(MAX_PROGRAM_LEN);
                self.buffer.fill(0xFF);
                self.buffer[..count].copy_from_slice(&bytes[..count]);
                record.step = RecordStep::Data;
                self.job = FlashJob::Record(record);
                return;
            }
            (RecordStep::NextData | RecordStep::Data, _) => {
                record.done = (record.done + MAX_PROGRAM_LEN as u32).min(record.len);
                record.step = if matches!(record.source, RecordSource::Buffer) {
                    RecordStep::Data
                } else {
                    RecordStep::NextData
                };
            }
            (RecordStep::Verify, _) => {
                let head = if record.done == 0 { WORD_LEN } else { 0 };
                let Some((head, data)) = bytes.split_at_checked(head).filter(|_| !bytes.is_empty())
                else {
                    return self.fail_record();
                };
                if !head.is_empty()
                    && head != journal::record_head(record.kind, record.len, record.crc)
                {
                    return self.fail_record();
                }
                record.sum = continue_crc(record.sum, data);
                record.done += bytes.len() as u32;
            }
        }
        if record.done < record.step_len() {
            self.job = FlashJob::Record(record);
        } else if record.step != RecordStep::Verify {
            self.job =
                FlashJob::Record(JournalRecord { step: RecordStep::Verify, done: 0, ..record });
        } else if !record.sum != record.crc {
            self.fail_record();
        } else {
            self.finish_record(&record);
        }
    }

    /// Continues after a record was read back correctly.
    fn finish_record(&mut self, record: &JournalRecord) {
        let data_at = record.at + WORD_LEN as u32;
        let held = (record.len > 0).then_some(data_at..data_at + record.len);
        let end = record.at + record_len(record.len);
        if let Some(compaction) = &mut self.journal.compacting {
            compaction.at = end;
            compaction.step = match record.kind {
                RecordKind::Parameters => 1,
                RecordKind::Photographed => 2,
                RecordKind::Mission => 3,
            };
            if record.kind == RecordKind::Mission {
                compaction.mission = held;
            }
            return;
        }
        self.journal.next_record_at = end;
        self.journal.consecutive_failures = 0;
        if record.kind == RecordKind::Mission {
            self.journal.mission = held;
            self.journal.mission_record_crc = record.crc;
            self.journal.mission_removal_unsaved = false;
            if record.len > 0 {
                self.end_upload(Ok(()));
            }
        }
    }

    /// Handles a record that was not written correctly: nothing is written behind it in its half,
    /// and the records are written again in the other half.
    pub(super) fn fail_record(&mut self) {
        if let Some(compaction) = self.journal.compacting.clone() {
            return self.discard_area(FlashArea::JournalHalf(compaction.half));
        }
        self.journal.consecutive_failures += 1;
        (self.parameters_unsaved, self.photographed_unsaved) =
            (true, !self.photographed.is_empty());
        if let Some(active) = self.journal.active_half {
            self.journal.next_record_at = FlashArea::JournalHalf(active).end(&self.layout);
        }
    }
}
