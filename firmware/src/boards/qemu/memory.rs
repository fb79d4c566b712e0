//! Memory of the emulated board outside the program's own, for measurements.
#![expect(unsafe_code, reason = "memory that the linker knows nothing of")]

use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Address at which QEMU's `-device loader` puts an occupancy map for measurements; the firmware
/// uses no memory there.
const MAP_ADDRESS: usize = 0x6080_0000;
/// Bytes of the map's header: three dimensions, minimum corner's three coordinates, resolution,
/// number of words.
const MAP_HEADER_LEN: usize = 32;
/// Address of memory that nothing else uses.
const SPARE_MEMORY_ADDRESS: usize = 0x6040_0000;
/// Address of the emulated flash bank 2.
const BANK2_ADDRESS: usize = 0x6000_0000;
/// Length of bank 2, bytes.
pub const BANK2_LEN: usize = 1 << 20;

/// The two uses of bank 2, which exclude each other until a reset: read in place as a slice, or
/// programmed by the flash driver.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Bank2Use {
    /// Read in place as a slice.
    Read = 1,
    /// Programmed by the flash driver.
    Programmed,
}

impl Bank2Use {
    /// Claims the bank for this use; false if it was claimed for the other use before.
    pub(super) fn claim(self) -> bool {
        static CLAIMED: AtomicU8 = AtomicU8::new(0);
        let before = CLAIMED.compare_exchange(0, self as u8, Ordering::Relaxed, Ordering::Relaxed);
        before.map_or_else(|claimed| claimed == self as u8, |_| true)
    }
}

/// All of bank 2 as a slice, for measurements.
///
/// # Panics
/// The flash driver was created before, which may program the bank.
pub fn bank2() -> &'static [u8] {
    assert!(Bank2Use::Read.claim(), "bank 2 belongs to the flash's driver");
    // SAFETY: readable memory that nothing writes to: the flash driver cannot be created any more.
    unsafe { core::slice::from_raw_parts(BANK2_ADDRESS as *const u8, BANK2_LEN) }
}

/// The map for measurements: its header and its words.
pub fn measurement_map() -> ([u8; MAP_HEADER_LEN], &'static [u64]) {
    // SAFETY: readable, aligned memory that nothing writes to.
    let head = unsafe { *(MAP_ADDRESS as *const [u8; MAP_HEADER_LEN]) };
    let words = u32::from_le_bytes([head[28], head[29], head[30], head[31]]) as usize;
    // SAFETY: as above; the memory there is at least 8 MB long.
    let words = unsafe {
        core::slice::from_raw_parts(
            (MAP_ADDRESS + MAP_HEADER_LEN) as *const u64,
            words.min(1 << 19),
        )
    };
    (head, words)
}

/// Memory as long as bank 2, for a flash without delays in measurements; `None` at a second call.
pub fn take_spare_memory() -> Option<&'static mut [u8]> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: memory of this board that nothing else uses, handed out once.
    Some(unsafe { core::slice::from_raw_parts_mut(SPARE_MEMORY_ADDRESS as *mut u8, BANK2_LEN) })
}
