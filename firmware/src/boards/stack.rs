//! Measures the deepest use of the stack: cortex-m-rt fills the stack with a pattern at the start
//! (`paint-stack`), and words that still hold it were never used.
#![expect(unsafe_code, reason = "the stack is read as memory")]

use core::ops::Range;
use core::ptr::addr_of;

use super::limits::GUARD_LEN;

/// Word with which cortex-m-rt fills the stack.
const PAINT: u32 = 0xcccc_cccc;

unsafe extern "C" {
    // The linker's addresses: the stack grows from `_stack_start` down to `_stack_end`.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Size of the stack, bytes.
pub fn size_bytes() -> usize {
    addr_of!(_stack_start) as usize - addr_of!(_stack_end) as usize
}

/// Most bytes of the stack in use at once since the start.
pub fn max_used_bytes() -> usize {
    let end = addr_of!(_stack_end);
    let words = size_bytes() / size_of::<u32>();
    let untouched = (0..words).take_while(|&word| {
        // SAFETY: between the linker's two symbols lies the stack, readable memory that the start
        // has filled.
        unsafe { end.add(word).read_volatile() == PAINT }
    });
    size_bytes() - untouched.count() * size_of::<u32>()
}

/// Address range of the guard below the stack, where every access faults.
pub fn guard_range() -> Range<u32> {
    let end = addr_of!(_stack_end) as u32;
    end - GUARD_LEN..end
}
