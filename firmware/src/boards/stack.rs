//! How deep the stack ever was: it is painted before the start (cortex-m-rt's `paint-stack`), and
//! what still has the paint was never used.
#![expect(unsafe_code, reason = "the stack is read as memory")]

use core::ops::Range;
use core::ptr::addr_of;

use super::limits::GUARD_LEN;

const PAINT: u32 = 0xcccc_cccc;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Bytes the stack has.
pub fn size_bytes() -> usize {
    addr_of!(_stack_start) as usize - addr_of!(_stack_end) as usize
}

/// Most bytes it has held since the start.
pub fn used_bytes() -> usize {
    let end = addr_of!(_stack_end);
    let words = size_bytes() / size_of::<u32>();
    let untouched = (0..words).take_while(|&word| {
        // SAFETY: between the linker's two symbols lies the stack, readable memory that the start
        // has painted.
        unsafe { end.add(word).read_volatile() == PAINT }
    });
    size_bytes() - untouched.count() * size_of::<u32>()
}

/// The memory below the stack that nothing may touch.
pub fn guard() -> Range<u32> {
    let end = addr_of!(_stack_end) as u32;
    end - GUARD_LEN..end
}
