//! The crash record, kept in memory that a warm reset leaves unchanged: how the last run ended, and
//! how many starts in a row each kind of file work crashed. After power-on the memory may hold any
//! values, so the record carries a checksum.

use core::{array, str};

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::String;

use crate::chips::ResetCause;

/// Length of a STATUSTEXT's text, bytes.
pub const MAX_TEXT_LEN: usize = 50;
/// 32-bit words of the whole record: contents, then the checksum.
pub const RECORD_WORDS: usize = 25;
/// 32-bit words of the record's text.
const TEXT_WORDS: usize = MAX_TEXT_LEN.div_ceil(4);
/// 32-bit words of the record before the text.
const HEADER_WORDS: usize = 5 + 2 * WORK_KIND_COUNT;
/// Number of kinds of [`FileWork`], without `None`.
const WORK_KIND_COUNT: usize = 3;
/// Number of starts in a row that must crash amid work on the same files until these files are set
/// aside.
const MAX_CRASHED_STARTS: u32 = 3;
/// STATUSTEXT after a restart that left no crash record, on a chip that reports no cause.
const UNKNOWN_RESTART: &str = "Restarted: watchdog, reset key or brown-out";

/// Checksum of the crash record. It is computed over 96 bytes a few times a run, so it needs no
/// table.
static RECORD_CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// How a run of the firmware ended. The values are stored in RAM that survives a warm reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
enum RunEnd {
    /// No run before this one is recorded, as after power-on.
    #[default]
    None = 0,
    /// The firmware runs. If a start finds this, the run before was reset without recording why.
    Runs = 0x464c_4b22,
    /// The program ended by a panic or a fault.
    Crashed = 0x464c_4b21,
    /// The restart was requested, by an operator or by the shell.
    RestartRequested = 0x464c_4b23,
}

/// A kind of work on uploaded files that may crash because of their contents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum FileWork {
    /// No work on files.
    #[default]
    None = 0,
    /// Parsing and checking the roadmap or field.
    CheckRoadmap = 1,
    /// Parsing the mission file.
    ReadMission = 2,
    /// Planning from roadmap and mission.
    Plan = 3,
}

/// A kind of work that runs, and the checksum of the files that it works on.
type RunningWork = (FileWork, u32);

/// The record that is kept over a warm reset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CrashRecord {
    /// How the run ended; `Runs` until it ends.
    end: RunEnd,
    /// STATUSTEXT about a crash.
    text: String<MAX_TEXT_LEN>,
    /// File work that runs now; `FileWork::None` while none runs.
    running: RunningWork,
    /// For each kind of work: checksum of the files on which it crashed last, and number of starts
    /// in a row that it crashed.
    failed_work: [(u32, u32); WORK_KIND_COUNT],
    /// Bit mask of the kinds of work that ended without a crash in this run, on the files in
    /// `failed_work`; bit 0 is [`FileWork::CheckRoadmap`].
    completed_work: u32,
}

impl CrashRecord {
    /// Evaluates the record at a start: `kept` is the record found in memory, `cause` the chip's
    /// reset cause. Returns the record to keep from now on, and the STATUSTEXT about the end of the
    /// last run; `None` if there is nothing to report. After power-on `kept` is ignored.
    pub fn evaluate_on_start(
        kept: Option<Self>,
        cause: ResetCause,
    ) -> (Self, Option<String<MAX_TEXT_LEN>>) {
        let mut kept = kept.filter(|_| cause != ResetCause::Power).unwrap_or_default();
        let crashed = kept.end == RunEnd::Crashed;
        let said = match (kept.end, cause) {
            (RunEnd::Crashed, _) => kept.text.as_str(),
            (_, ResetCause::Watchdog) => "Restarted: watchdog",
            (_, ResetCause::BrownOut) => "Restarted: brown-out",
            (RunEnd::Runs, ResetCause::Key) => "Restarted: reset key",
            (RunEnd::Runs, ResetCause::Request) => "Restarted: debugger",
            (RunEnd::Runs, ResetCause::Unknown) => UNKNOWN_RESTART,
            _ => "",
        };
        let said = String::try_from(said).ok().filter(|said| !said.is_empty());
        let by_itself = matches!(cause, ResetCause::Watchdog | ResetCause::Unknown);
        let (work, files) = kept.running;
        for (i, failed) in kept.failed_work.iter_mut().enumerate() {
            if work as usize != i + 1 {
                // This kind of work ended without a crash in the last run: its count begins again.
                if kept.completed_work >> i & 1 == 1 {
                    failed.1 = 0;
                }
            } else if crashed || kept.end == RunEnd::Runs && by_itself {
                let before = if failed.0 == files { failed.1 } else { 0 };
                *failed = (files, before.saturating_add(1));
            }
        }
        (kept.running, kept.completed_work, kept.end) = (RunningWork::default(), 0, RunEnd::Runs);
        (kept, said)
    }

    /// Notes that this run ends by a panic or a fault; the next start reports `text`.
    pub fn note_crash(&mut self, text: &str) {
        self.end = RunEnd::Crashed;
        self.text.clear();
        // A text longer than 50 bytes is cut.
        let _ = text.chars().try_for_each(|c| self.text.push(c));
    }

    /// Whether [`Self::note_crash`] was called in this run.
    pub fn has_crashed(&self) -> bool {
        self.end == RunEnd::Crashed
    }

    /// Notes that the restart was requested, by an operator or by the shell.
    pub fn note_requested_restart(&mut self) {
        self.end = RunEnd::RestartRequested;
    }

    /// Whether `work` on the files with checksum `files` may begin: false if it crashed three
    /// starts in a row.
    pub fn may_begin(&self, work: FileWork, files: u32) -> bool {
        let failed = (work as usize).checked_sub(1).map(|i| self.failed_work[i]);
        failed.is_none_or(|(of, times)| of != files || times < MAX_CRASHED_STARTS)
    }

    /// Notes that `work` on `files` begins. False, and nothing is noted, if it crashed three starts
    /// in a row.
    pub fn begin_work(&mut self, work: FileWork, files: u32) -> bool {
        let may = self.may_begin(work, files);
        if may {
            self.running = (work, files);
        }
        may
    }

    /// Notes that the work that runs has ended without a crash.
    pub fn finish_work(&mut self) {
        let (work, files) = core::mem::take(&mut self.running);
        if let Some(i) = (work as usize).checked_sub(1)
            && self.failed_work[i].0 == files
        {
            self.completed_work |= 1 << i;
        }
    }

    /// Encodes the record as words, the checksum last.
    pub fn to_words(&self) -> [u32; RECORD_WORDS] {
        let mut text = [0; 4 * TEXT_WORDS];
        text[..self.text.len()].copy_from_slice(self.text.as_bytes());
        let mut words = [0; RECORD_WORDS];
        let head = [
            self.end as u32,
            self.text.len() as u32,
            self.running.0 as u32,
            self.running.1,
            self.completed_work,
        ];
        let failed = self.failed_work.iter().flat_map(|(files, times)| [*files, *times]);
        let text = text.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let all = head.into_iter().chain(failed).chain(text);
        words.iter_mut().zip(all).for_each(|(word, value)| *word = value);
        words[RECORD_WORDS - 1] = checksum(&words);
        words
    }

    /// Decodes a record; `None` where the checksum is wrong or a field has no valid value.
    pub fn from_words(words: &[u32; RECORD_WORDS]) -> Option<Self> {
        let end = [RunEnd::None, RunEnd::Runs, RunEnd::Crashed, RunEnd::RestartRequested]
            .into_iter()
            .find(|e| *e as u32 == words[0])?;
        if checksum(words) != words[RECORD_WORDS - 1] {
            return None;
        }
        let work = |word: u32| {
            let all =
                [FileWork::None, FileWork::CheckRoadmap, FileWork::ReadMission, FileWork::Plan];
            all.into_iter().find(|work| *work as u32 == word)
        };
        let mut bytes = [0; 4 * TEXT_WORDS];
        for (to, word) in bytes.chunks_exact_mut(4).zip(&words[HEADER_WORDS..]) {
            to.copy_from_slice(&word.to_le_bytes());
        }
        let text = str::from_utf8(bytes.get(..words[1] as usize)?).ok()?;
        Some(Self {
            end,
            text: String::try_from(text).ok()?,
            running: (work(words[2])?, words[3]),
            failed_work: array::from_fn(|i| (words[5 + 2 * i], words[6 + 2 * i])),
            completed_work: words[4],
        })
    }
}

/// CRC-32 of all words but the last.
fn checksum(words: &[u32; RECORD_WORDS]) -> u32 {
    let mut digest = RECORD_CRC.digest();
    words[..RECORD_WORDS - 1].iter().for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

const _: () = assert!(HEADER_WORDS + TEXT_WORDS + 1 == RECORD_WORDS, "the text has room");

#[cfg(test)]
mod tests;
