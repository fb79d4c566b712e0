//! What lies in memory beside the program.
#![expect(unsafe_code, reason = "memory that the linker knows nothing of")]

use core::sync::atomic::{AtomicBool, Ordering};

/// Where `-device loader` puts a map for measurements: beyond all that the firmware uses.
const MAP: usize = 0x6080_0000;
/// Bytes before its words: three dimensions, three coordinates of the minimum corner, the resolution, the number of words.
const MAP_HEAD: usize = 32;
/// Where nothing lies.
const SPARE: usize = 0x6040_0000;
/// Bank 2 of the flash.
const BANK2: usize = 0x6000_0000;
/// Its length.
pub const BANK2_LEN: usize = 1 << 20;

/// Bank 2, while nobody writes to it.
pub fn bank2() -> &'static [u8] {
    // SAFETY: readable memory; only `measure` calls this, and writes nothing there.
    unsafe { core::slice::from_raw_parts(BANK2 as *const u8, BANK2_LEN) }
}

/// The map for measurements: its head and its words.
pub fn map() -> ([u8; MAP_HEAD], &'static [u64]) {
    // SAFETY: readable, aligned memory; nobody writes to it.
    let head = unsafe { *(MAP as *const [u8; MAP_HEAD]) };
    let words = u32::from_le_bytes([head[28], head[29], head[30], head[31]]) as usize;
    // SAFETY: as above; the memory there is 8 MB long.
    let words = unsafe { core::slice::from_raw_parts((MAP + MAP_HEAD) as *const u64, words.min(1 << 19)) };
    (head, words)
}

/// Memory as long as bank 2 and a place for a flash that programs and erases in no time, for
/// measurements; once.
pub fn spare() -> Option<&'static mut [u8]> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: memory of this board that nothing else uses, given out once.
    Some(unsafe { core::slice::from_raw_parts_mut(SPARE as *mut u8, BANK2_LEN) })
}
