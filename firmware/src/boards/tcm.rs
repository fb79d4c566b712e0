//! Statics in the tightly coupled memory below the stack: the start code of `cortex-m-rt` zeroes `.bss` alone, so this
//! zeroes them before anything uses them.
#![expect(unsafe_code, reason = "memory that the start does not touch")]

use core::ptr::addr_of_mut;

unsafe extern "C" {
    static mut __sdtcm: u32;
    static mut __edtcm: u32;
}

/// Zeroes them.
///
/// # Safety
/// Only once, before any of these statics is used.
pub unsafe fn zero() {
    let (mut word, end) = (addr_of_mut!(__sdtcm), addr_of_mut!(__edtcm));
    while word < end {
        // SAFETY: between the linker's two symbols lie statics that nothing uses yet; both are aligned to 8 bytes.
        unsafe {
            word.write_volatile(0);
            word = word.add(1);
        }
    }
}
