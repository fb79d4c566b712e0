//! Regions of the memory protection unit of a Cortex-M7 (ARMv7-M ARM, B3.5 "Protected Memory System
//! Architecture"), as values of MPU_RBAR and MPU_RASR.

/// How code may access a region, and whether its data are cached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionAccess {
    /// Every access is a fault, and the processor does no speculative reads.
    None,
    /// Read and write, not cached: data that DMA also writes, or flash words that may be
    /// unreadable.
    Uncached,
    /// Read only, cached.
    CachedReadOnly,
}

/// An MPU region: 2^`len_log2` bytes, at least 32, aligned to their length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Address of the first byte.
    pub base: u32,
    /// Binary logarithm of the length in bytes.
    pub len_log2: u32,
    /// Access that the region allows.
    pub access: RegionAccess,
    /// SRD bits: a set bit disables the region in that eighth of it. Only for regions of 256 bytes
    /// or more.
    pub disabled_eighths: u8,
}

impl Region {
    /// A region without disabled eighths.
    ///
    /// # Panics
    /// `len` is no power of two of at least 32, or `base` is no multiple of `len`.
    pub const fn new(base: u32, len: u32, access: RegionAccess) -> Self {
        assert!(
            len.is_power_of_two() && len >= 32,
            "a region's length is a power of two from 32 on"
        );
        assert!(base.is_multiple_of(len), "a region lies on a multiple of its length");
        Self { base, len_log2: len.trailing_zeros(), access, disabled_eighths: 0 }
    }

    /// Value of MPU_RBAR for region `number`: base address, VALID bit, region number.
    pub const fn rbar(&self, number: u32) -> u32 {
        self.base | 1 << 4 | number
    }

    /// Value of MPU_RASR: XN, AP, TEX, S, C, B, SRD, SIZE and ENABLE. Code is executed from no
    /// region.
    pub const fn rasr(&self) -> u32 {
        const XN: u32 = 1 << 28;
        const ENABLE: u32 = 1;
        let attributes = match self.access {
            // AP 0b000: no access; strongly ordered memory, so no speculative reads.
            RegionAccess::None => 0,
            // AP 0b011: read and write; TEX 0b001, C 0, B 0: normal memory, not cached; S: shared
            // with DMA.
            RegionAccess::Uncached => 0b011 << 24 | 0b001 << 19 | 1 << 18,
            // AP 0b110: read only; TEX 0b000, C 1, B 0: normal memory, write-through cache.
            RegionAccess::CachedReadOnly => 0b110 << 24 | 1 << 17,
        };
        XN | attributes | (self.disabled_eighths as u32) << 8 | (self.len_log2 - 1) << 1 | ENABLE
    }
}
