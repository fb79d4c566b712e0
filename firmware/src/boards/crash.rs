//! What brought the firmware down, kept in memory that a warm reset leaves alone
//! ([`kept`](crate::kept)), and reported at the next start.
#![expect(unsafe_code, reason = "memory that the start does not touch")]

use core::fmt::Write;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use heapless::String;

use super::{chosen, stack};
use crate::chips::{ResetCause, fault};
use crate::kept::{CrashRecord, FileWork, RECORD_WORDS, TEXT};

#[unsafe(link_section = ".crash")]
static mut RECORD: MaybeUninit<[u32; RECORD_WORDS]> = MaybeUninit::uninit();

/// Reads the kept record. Interrupts are off: tasks and the end of the program use it.
fn read_record() -> Option<CrashRecord> {
    // SAFETY: nobody else runs, and any bytes are words.
    CrashRecord::from_words(&unsafe {
        (&raw const RECORD).cast::<[u32; RECORD_WORDS]>().read_volatile()
    })
}

fn write_record(kept: &CrashRecord) {
    // SAFETY: as above.
    unsafe { (&raw mut RECORD).cast::<[u32; RECORD_WORDS]>().write_volatile(kept.to_words()) };
}

/// Changes what is kept.
fn update_record<T>(change: impl FnOnce(&mut CrashRecord) -> T) -> T {
    critical_section::with(|_| {
        let mut kept = read_record().unwrap_or_default();
        let result = change(&mut kept);
        write_record(&kept);
        result
    })
}

/// Text that the last start left, once; none after the power came.
pub fn take_report(cause: ResetCause) -> Option<String<TEXT>> {
    critical_section::with(|_| {
        let (kept, said) = CrashRecord::on_start(read_record(), cause);
        write_record(&kept);
        said
    })
}

/// Whether work with files may begin.
pub fn may_begin(work: FileWork, files: u32) -> bool {
    update_record(|kept| kept.may_begin(work, files))
}

/// Begins work with files; false if it brought three starts in a row down, and is not to be done.
pub fn begin_work(work: FileWork, files: u32) -> bool {
    update_record(|kept| kept.begin_work(work, files))
}

/// Notes that the work has ended.
pub fn finish_work() {
    update_record(CrashRecord::finish_work);
}

/// Restarts on request: there is no crash to report.
pub fn restart() -> ! {
    cortex_m::interrupt::disable();
    update_record(CrashRecord::note_requested_restart);
    chosen::reset()
}

/// Keeps what happened, logs it and restarts. Kept first, and logged once: what is wrong may be the
/// log.
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

/// Records where the panic was, and restarts the board: no task or interrupt of higher priority
/// runs on after a panic.
pub fn panicked(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let mut text = String::<200>::new();
    if let Some(place) = info.location() {
        let file = place.file().rsplit('/').next().unwrap_or_default();
        // Text that does not fit is left out.
        let _ = write!(text, "Restarted: panic at {file}:{}", place.line());
    }
    record_and_restart(&text)
}

/// Keeps the program counter of a fault and restarts.
pub fn faulted(pc: u32) -> ! {
    // SAFETY: registers that are read.
    let scb = unsafe { &*SCB::PTR };
    let (cfsr, mmfar) = (scb.cfsr.read(), scb.mmfar.read());
    if fault::is_overflow(cfsr, mmfar, &stack::guard()) {
        // The place of the overflow lies on the stack that was too small.
        record_and_restart("Restarted: stack overflow")
    }
    let mut text = String::<TEXT>::new();
    // The text fits.
    let _ = write!(text, "Restarted: fault at {pc:#010x}");
    record_and_restart(&text)
}
