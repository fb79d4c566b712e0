//! Regions of the memory protection unit of a Cortex-M7 (ARMv7-M ARM, B3.5 "Protected Memory System
//! Architecture"), as values of MPU_RBAR and MPU_RASR.

/// Access to a region, and how its data are cached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// No access: any access is a fault, and the processor fetches nothing ahead of time.
    None,
    /// Data that others write beside the processor, or that may not be readable: no cache.
    Uncached,
    /// Data that are read only, cached.
    CachedReadOnly,
}

/// A region: `len` bytes from `base` on, a power of two of at least 32, on a multiple of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First byte.
    pub base: u32,
    /// Bytes, as a power of two.
    pub len_log2: u32,
    /// Access to the region.
    pub access: Access,
    /// A bit for each eighth of it to which it does not apply; only from 256 bytes on.
    pub without: u8,
}

impl Region {
    /// A whole region.
    ///
    /// # Panics
    /// It cannot be one: too small, or not on a multiple of its length.
    pub const fn new(base: u32, len: u32, access: Access) -> Self {
        assert!(
            len.is_power_of_two() && len >= 32,
            "a region's length is a power of two from 32 on"
        );
        assert!(base.is_multiple_of(len), "a region lies on a multiple of its length");
        Self { base, len_log2: len.trailing_zeros(), access, without: 0 }
    }

    /// MPU_RBAR for region `number`: its address, VALID and the number.
    pub const fn rbar(&self, number: u32) -> u32 {
        self.base | 1 << 4 | number
    }

    /// MPU_RASR: XN, AP, TEX S C B, SRD, SIZE and ENABLE. Nothing is executed from any region.
    pub const fn rasr(&self) -> u32 {
        const XN: u32 = 1 << 28;
        const ENABLE: u32 = 1;
        let attributes = match self.access {
            // AP 0b000; strongly ordered, so nothing is read ahead.
            Access::None => 0,
            // AP 0b011 read and write; TEX 0b001, C 0, B 0: normal memory, not cached; S, as others
            // share it.
            Access::Uncached => 0b011 << 24 | 0b001 << 19 | 1 << 18,
            // AP 0b110 read only; TEX 0b000, C 1, B 0: normal memory, write-through.
            Access::CachedReadOnly => 0b110 << 24 | 1 << 17,
        };
        XN | attributes | (self.without as u32) << 8 | (self.len_log2 - 1) << 1 | ENABLE
    }
}
