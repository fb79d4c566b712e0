//! The crash record in memory that a warm reset leaves unchanged ([`kept`](crate::kept)): written
//! at a panic or fault, reported at the next start.
#![expect(unsafe_code, reason = "memory that the start does not touch")]

use core::fmt::Write;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use heapless::String;

use super::{chosen, stack};
use crate::chips::{ResetCause, fault};
use crate::crash_record::{CrashRecord, FileWork, MAX_TEXT_LEN, RECORD_WORDS};

/// The crash record's words; after power-on they hold any values.
#[unsafe(link_section = ".crash")]
static mut RECORD: MaybeUninit<[u32; RECORD_WORDS]> = MaybeUninit::uninit();

/// Reads the crash record; `None` if its checksum is wrong. To be called with interrupts off, since
/// tasks and fault handlers use it.
fn read_record() -> Option<CrashRecord> {
    // SAFETY: interrupts are off, and any bytes are valid `u32`s.
    CrashRecord::from_words(&unsafe {
        (&raw const RECORD).cast::<[u32; RECORD_WORDS]>().read_volatile()
    })
}

/// Writes the record to the memory that outlasts a restart.
fn write_record(kept: &CrashRecord) {
    // SAFETY: as in `read_record`.
    unsafe { (&raw mut RECORD).cast::<[u32; RECORD_WORDS]>().write_volatile(kept.to_words()) };
}

/// Reads the crash record, changes it by `change` and writes it back, with interrupts off.
fn update_record<T>(change: impl FnOnce(&mut CrashRecord) -> T) -> T {
    critical_section::with(|_| {
        let mut kept = read_record().unwrap_or_default();
        let result = change(&mut kept);
        write_record(&kept);
        result
    })
}

/// Evaluates the crash record at the start. Returns the STATUSTEXT about the last run's end; `None`
/// if there is nothing to report, as after power-on. To be called once.
pub fn take_report(cause: ResetCause) -> Option<String<MAX_TEXT_LEN>> {
    critical_section::with(|_| {
        let (kept, said) = CrashRecord::evaluate_on_start(read_record(), cause);
        write_record(&kept);
        said
    })
}

/// Whether `work` on the files with checksum `files` may begin: false if it crashed three starts in
/// a row.
pub fn may_begin(work: FileWork, files: u32) -> bool {
    update_record(|kept| kept.may_begin(work, files))
}

/// Records that `work` on `files` begins; false, and nothing is recorded, if it crashed three
/// starts in a row. Then it must not be done.
pub fn begin_work(work: FileWork, files: u32) -> bool {
    update_record(|kept| kept.begin_work(work, files))
}

/// Records that the work on files that [`begin_work`] recorded has ended without a crash.
pub fn finish_work() {
    update_record(CrashRecord::finish_work);
}

/// Restarts the board on request; the next start reports no crash.
pub fn restart() -> ! {
    cortex_m::interrupt::disable();
    update_record(CrashRecord::note_requested_restart);
    chosen::reset()
}

/// Records `text`, logs it and restarts the board. It is recorded before it is logged, and logged
/// only once a run, because the log itself may be what crashes.
fn record_and_restart(text: &str) -> ! {
    cortex_m::interrupt::disable();
    let ended = update_record(|kept| {
        let ended = kept.has_crashed();
        if !ended {
            kept.note_crash(text);
        }
        ended
    });
    if !ended {
        defmt::error!("{=str}", text);
    }
    chosen::reset()
}

/// Handles a panic: records file and line, and restarts the board. Interrupts are off from here on,
/// so no task runs any more.
pub fn panicked(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let mut text = String::<200>::new();
    if let Some(place) = info.location() {
        let file = place.file().rsplit('/').next().unwrap_or_default();
        // Text that does not fit is cut.
        let _ = write!(text, "Restarted: panic at {file}:{}", place.line());
    }
    record_and_restart(&text)
}

/// Handles a hard fault: records the program counter `pc`, or a stack overflow, and restarts the
/// board.
pub fn faulted(pc: u32) -> ! {
    // SAFETY: fault registers, which are only read.
    let scb = unsafe { &*SCB::PTR };
    let (cfsr, mmfar) = (scb.cfsr.read(), scb.mmfar.read());
    if fault::is_stack_overflow(cfsr, mmfar, &stack::guard_range()) {
        // The program counter is not reported: it lies on the stack that overflowed.
        record_and_restart("Restarted: stack overflow")
    }
    let mut text = String::<MAX_TEXT_LEN>::new();
    // Cannot fail: the text has room.
    let _ = write!(text, "Restarted: fault at {pc:#010x}");
    record_and_restart(&text)
}
