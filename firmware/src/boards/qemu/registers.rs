//! Memory-mapped device registers.
#![expect(unsafe_code, reason = "registers are memory")]

/// A 32-bit register of this board.
#[derive(Clone, Copy)]
pub struct Register(usize);

impl Register {
    /// The register `offset` bytes into the device at `base`, one of the addresses that application
    /// note AN500 gives.
    pub(super) const fn new(base: usize, offset: usize) -> Self {
        Self(base + offset)
    }

    /// Reads the register.
    pub fn read(self) -> u32 {
        // SAFETY: `new` is only given addresses of registers, which are aligned and always present.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    /// Writes the register.
    pub fn write(self, value: u32) {
        // SAFETY: as above; no register used here makes a device write to memory.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}
