//! What lies in memory beside the program.
#![expect(unsafe_code, reason = "memory that the linker knows nothing of")]

use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Address at which `-device loader` puts a map for measurements: beyond all that the firmware
/// uses.
const MAP_ADDRESS: usize = 0x6080_0000;
/// Bytes before the map's words: three dimensions, three coordinates of the minimum corner, the
/// resolution, the number of words.
const MAP_HEADER_LEN: usize = 32;
/// Address at which nothing lies.
const UNUSED_ADDRESS: usize = 0x6040_0000;
/// Bank 2 of the flash.
const BANK2: usize = 0x6000_0000;
/// Length of bank 2, bytes.
pub const BANK2_LEN: usize = 1 << 20;

/// Use of bank 2, for good: it is either read as a whole, or programmed by the flash's driver.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Bank2 {
    Read = 1,
    Programmed,
}

impl Bank2 {
    /// Claims the bank for this use. Returns false if it was claimed for the other one.
    pub(super) fn claim(self) -> bool {
        static CLAIMED: AtomicU8 = AtomicU8::new(0);
        let before = CLAIMED.compare_exchange(0, self as u8, Ordering::Relaxed, Ordering::Relaxed);
        before.map_or_else(|claimed| claimed == self as u8, |_| true)
    }
}

/// Bank 2, for measurements.
///
/// # Panics
/// The flash's driver was started: it programs the bank.
pub fn bank2() -> &'static [u8] {
    assert!(Bank2::Read.claim(), "bank 2 belongs to the flash's driver");
    // SAFETY: readable memory that nobody writes to: the flash's driver does not start any more.
    unsafe { core::slice::from_raw_parts(BANK2 as *const u8, BANK2_LEN) }
}

/// The map for measurements: its head and its words.
pub fn measurement_map() -> ([u8; MAP_HEADER_LEN], &'static [u64]) {
    // SAFETY: readable, aligned memory; nobody writes to it.
    let head = unsafe { *(MAP_ADDRESS as *const [u8; MAP_HEADER_LEN]) };
    let words = u32::from_le_bytes([head[28], head[29], head[30], head[31]]) as usize;
    // SAFETY: as above; the memory there is 8 MB long.
    let words = unsafe {
        core::slice::from_raw_parts(
            (MAP_ADDRESS + MAP_HEADER_LEN) as *const u64,
            words.min(1 << 19),
        )
    };
    (head, words)
}

/// Memory as long as bank 2 and a place for a flash that programs and erases in no time, for
/// measurements; once.
pub fn take_spare_memory() -> Option<&'static mut [u8]> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: memory of this board that nothing else uses, given out once.
    Some(unsafe { core::slice::from_raw_parts_mut(UNUSED_ADDRESS as *mut u8, BANK2_LEN) })
}
