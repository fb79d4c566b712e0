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
const HEADER_WORDS: usize = 5 + 2 * WORK_KINDS;
/// Number of kinds of [`FileWork`], without `None`.
const WORK_KINDS: usize = 3;
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
    /// An operator requested the restart.
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

/// A kind of work, and the checksum of the files it works on.
type Task = (FileWork, u32);

/// The record that is kept over a warm reset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CrashRecord {
    end: RunEnd,
    text: String<MAX_TEXT_LEN>,
    /// File work that runs now; `FileWork::None` while none runs.
    task: Task,
    /// For each kind of work: checksum of the files on which it crashed last, and number of starts
    /// in a row that it crashed.
    failed_work: [(u32, u32); WORK_KINDS],
    /// Bit mask of the kinds of work that ended without a crash in this run, on the files in
    /// `failed_work`; bit 0 is [`FileWork::CheckRoadmap`].
    completed_work: u32,
}

impl CrashRecord {
    /// Evaluates the record at a start: `kept` is the record found in memory, `cause` the chip's
    /// reset cause. Returns the record to keep from now on, and the STATUSTEXT about the end of the
    /// last run; `None` if there is nothing to report. After power-on `kept` is ignored.
    pub fn on_start(kept: Option<Self>, cause: ResetCause) -> (Self, Option<String<MAX_TEXT_LEN>>) {
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
        let (work, files) = kept.task;
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
        (kept.task, kept.completed_work, kept.end) = (Task::default(), 0, RunEnd::Runs);
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

    /// Notes that an operator requested the restart.
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
            self.task = (work, files);
        }
        may
    }

    /// Notes that the work that runs has ended without a crash.
    pub fn finish_work(&mut self) {
        let (work, files) = core::mem::take(&mut self.task);
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
            self.task.0 as u32,
            self.task.1,
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
            task: (work(words[2])?, words[3]),
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
mod tests {
    use super::*;

    /// The start that follows a run that left `kept`, encoded as words.
    fn start(kept: &CrashRecord, cause: ResetCause) -> (CrashRecord, Option<String<MAX_TEXT_LEN>>) {
        let words = kept.to_words();
        let read = CrashRecord::from_words(&words);
        assert_eq!(read.as_ref(), Some(kept), "as it was written");
        CrashRecord::on_start(read, cause)
    }

    #[test]
    fn any_flipped_bit_is_noticed_and_so_is_memory_of_one_kind() {
        let (mut kept, _) = CrashRecord::on_start(None, ResetCause::Unknown);
        kept.begin_work(FileWork::Plan, 7);
        kept.note_crash("Restarted: panic at machine.rs:123");
        let words = kept.to_words();
        for bit in 0..32 * RECORD_WORDS {
            let mut flipped = words;
            flipped[bit / 32] ^= 1 << (bit % 32);
            assert_eq!(CrashRecord::from_words(&flipped), None, "bit {bit}");
        }
        for word in [0, u32::MAX, 0xAAAA_AAAA, 0xcccc_cccc] {
            assert_eq!(CrashRecord::from_words(&[word; RECORD_WORDS]), None);
        }
    }

    #[test]
    fn each_end_is_said_as_it_was() {
        let (fresh, said) = CrashRecord::on_start(None, ResetCause::Unknown);
        assert_eq!(said, None, "nothing was before");
        let says = |kept: &CrashRecord, cause| start(kept, cause).1;
        let rows = [
            (ResetCause::Power, None),
            (ResetCause::BrownOut, Some("Restarted: brown-out")),
            (ResetCause::Key, Some("Restarted: reset key")),
            (ResetCause::Watchdog, Some("Restarted: watchdog")),
            (ResetCause::Request, Some("Restarted: debugger")),
            (ResetCause::Unknown, Some(UNKNOWN_RESTART)),
        ];
        for (cause, said) in rows {
            assert_eq!(says(&fresh, cause).as_deref(), said, "{cause:?}");
        }
        let mut asked = fresh.clone();
        asked.note_requested_restart();
        assert_eq!(
            (says(&asked, ResetCause::Request), says(&asked, ResetCause::Unknown)),
            (None, None)
        );
        let mut crashed = fresh;
        crashed.note_crash("Restarted: panic at a_file_whose_name_is_so_long.rs:12345");
        let cut = "Restarted: panic at a_file_whose_name_is_so_long.r";
        assert_eq!(says(&crashed, ResetCause::Request).as_deref(), Some(cut));
        assert_eq!(says(&crashed, ResetCause::Power), None, "memory of another day");
    }

    /// How a start ends while it plans.
    #[derive(Clone, Copy, PartialEq, Eq)]
    enum End {
        Panic,
        Reset,
    }

    /// A start that ends while it plans on these files; false if they are set aside.
    fn fails(kept: &mut CrashRecord, files: u32, cause: ResetCause, end: End) -> bool {
        let begun = kept.begin_work(FileWork::Plan, files);
        if end == End::Panic {
            kept.note_crash("Restarted: panic");
        }
        *kept = start(kept, cause).0;
        begun
    }

    #[test]
    fn files_that_bring_three_starts_in_a_row_down_are_set_aside() {
        for (cause, end) in [
            (ResetCause::Request, End::Panic),
            (ResetCause::Unknown, End::Panic),
            (ResetCause::Watchdog, End::Reset),
        ] {
            let mut kept = CrashRecord::on_start(None, ResetCause::Power).0;
            assert!((0..3).all(|_| fails(&mut kept, 7, cause, end)));
            assert!(!kept.begin_work(FileWork::Plan, 7), "three times");
            let again = start(&kept, ResetCause::Key).0;
            assert!(!again.clone().begin_work(FileWork::Plan, 7), "still after a reset");
            assert!(again.clone().begin_work(FileWork::Plan, 8), "others may be tried");
            assert!(again.clone().begin_work(FileWork::CheckRoadmap, 7), "and other work");
            assert!(
                start(&again, ResetCause::Power).0.begin_work(FileWork::Plan, 7),
                "not after the power was off"
            );
        }
    }

    #[test]
    fn a_roadmap_that_was_set_aside_stays_so_while_a_mission_fails() {
        let mut kept = CrashRecord::on_start(None, ResetCause::Power).0;
        for _ in 0..3 {
            assert!(kept.begin_work(FileWork::CheckRoadmap, 1));
            kept.note_crash("Restarted: fault");
            kept = start(&kept, ResetCause::Request).0;
        }
        for _ in 0..3 {
            assert!(!kept.begin_work(FileWork::CheckRoadmap, 1));
            assert!(kept.begin_work(FileWork::CheckRoadmap, 2));
            kept.finish_work();
            assert!(fails(&mut kept, 7, ResetCause::Request, End::Panic));
        }
        assert!(!kept.begin_work(FileWork::CheckRoadmap, 1) && !kept.begin_work(FileWork::Plan, 7));
    }

    #[test]
    fn only_starts_in_a_row_count_and_only_those_that_the_planner_brought_down() {
        let fail =
            |kept: &mut CrashRecord| assert!(fails(kept, 7, ResetCause::Request, End::Panic));
        let mut kept = CrashRecord::on_start(None, ResetCause::Power).0;
        (0..2).for_each(|_| fail(&mut kept));
        // A start without a plan leaves the count, and so does one ended by key, brown-out or
        // debugger.
        kept = start(&kept, ResetCause::Watchdog).0;
        for cause in [ResetCause::Key, ResetCause::BrownOut, ResetCause::Request] {
            assert!(fails(&mut kept, 7, cause, End::Reset));
        }
        // A plan that completes does not reset the count if another one then crashes the start.
        assert!(kept.begin_work(FileWork::Plan, 7));
        kept.finish_work();
        fail(&mut kept);
        assert!(!kept.clone().begin_work(FileWork::Plan, 7));
        // A start whose plans all complete resets the count.
        let mut kept = CrashRecord::on_start(None, ResetCause::Power).0;
        (0..2).for_each(|_| fail(&mut kept));
        assert!(kept.begin_work(FileWork::Plan, 7));
        kept.finish_work();
        kept.note_crash("Restarted: fault, not the planner's");
        kept = start(&kept, ResetCause::Request).0;
        (0..3).for_each(|_| fail(&mut kept));
        assert!(!kept.begin_work(FileWork::Plan, 7));
    }
}
