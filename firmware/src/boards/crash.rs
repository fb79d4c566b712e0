//! What brought the firmware down, kept in memory that a warm reset leaves alone, and told at the next start; so is that it ran
//! and ended without a word.
#![expect(unsafe_code, reason = "memory that the start does not touch")]

use core::fmt::Write;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use heapless::String;

/// Longest text of a STATUSTEXT.
const TEXT: usize = 50;
/// Says that a record was written.
const CRASHED: u32 = 0x464c_4b21;
/// Says that the firmware ran, and did not end by itself.
const RUNS: u32 = 0x464c_4b22;
/// What is told of that.
const UNANNOUNCED: &str = "Restarted: watchdog, reset key or brown-out";

#[derive(Clone, Copy)]
#[repr(C)]
struct Record {
    magic: u32,
    len: u32,
    text: [u8; TEXT],
}

#[unsafe(link_section = ".crash")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// What the last start left, once; nothing after the power came.
pub fn take() -> Option<String<TEXT>> {
    let record = &raw mut RECORD;
    // SAFETY: called once at the start, when nothing else runs; any bytes are a `Record`.
    let found = unsafe {
        let found = record.cast::<Record>().read_volatile();
        record.cast::<Record>().write_volatile(Record { magic: RUNS, ..found });
        found
    };
    if found.magic == RUNS {
        return String::try_from(UNANNOUNCED).ok();
    }
    let text = found.text.get(..found.len as usize).filter(|_| found.magic == CRASHED)?;
    String::try_from(core::str::from_utf8(text).ok()?).ok()
}

/// Starts anew, as somebody asked for: there is nothing to tell.
pub fn restart() -> ! {
    cortex_m::interrupt::disable();
    write(Record { magic: 0, len: 0, text: [0; TEXT] });
    cortex_m::peripheral::SCB::sys_reset()
}

/// Keeps what happened, logs it and starts anew. Kept first, and logged once: what is wrong may be the log.
fn end(text: &str) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts are off.
    let ended = unsafe { (&raw const RECORD).cast::<Record>().read_volatile() }.magic == CRASHED;
    if !ended {
        let mut record = Record { magic: CRASHED, len: 0, text: [0; TEXT] };
        let bytes = text.as_bytes();
        let len = bytes.len().min(TEXT);
        record.text[..len].copy_from_slice(&bytes[..len]);
        record.len = len as u32;
        write(record);
        defmt::error!("{=str}", text);
    }
    cortex_m::peripheral::SCB::sys_reset()
}

/// To be called with interrupts off.
fn write(record: Record) {
    let to = &raw mut RECORD;
    // SAFETY: nobody else runs, and who calls this starts anew.
    unsafe { to.cast::<Record>().write_volatile(record) };
}

/// Keeps where it was and starts anew. What runs above it does not go on in a program that is wrong.
pub fn panicked(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let mut text = String::<200>::new();
    if let Some(place) = info.location() {
        let file = place.file().rsplit('/').next().unwrap_or_default();
        // What does not fit is left out.
        let _ = write!(text, "Restarted: panic at {file}:{}", place.line());
    }
    end(&text)
}

/// Keeps the program counter of a fault and starts anew.
pub fn faulted(pc: u32) -> ! {
    let mut text = String::<TEXT>::new();
    // It fits.
    let _ = write!(text, "Restarted: fault at {pc:#010x}");
    end(&text)
}
