//! Register values of the STM32H743, by RM0433 (reference manual), DS12110 (data sheet) and ES0392
//! (errata).

use super::ResetCause;
use super::mpu::{Region, RegionAccess};

/// Frequency of the external clock at OSC_IN of the NUCLEO-H743ZI: MCO output of the on-board
/// ST-LINK (UM1974, "OSC clock"), MHz.
pub const HSE_MHZ: u32 = 8;
/// Frequency of the chip's internal oscillator, MHz.
pub const HSI_MHZ: u32 = 64;

/// The oscillator that feeds PLL1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// HSE, the external clock of [`HSE_MHZ`].
    External,
    /// HSI, the chip's own oscillator of [`HSI_MHZ`].
    Internal,
}

/// Revision of the silicon: DBGMCU_IDC.REV_ID (RM0433, "DBGMCU identity code register").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Revision {
    /// Z or Y (0x1001, 0x1003), or unknown: at most 400 MHz, and the AXI SRAM needs its erratum's
    /// workaround.
    Old,
    /// X, V and later (0x2001, 0x2003): 480 MHz.
    New,
}

impl Revision {
    /// The revision that DBGMCU_IDC holds.
    pub const fn from_idcode(idc: u32) -> Self {
        if idc >> 16 >= 0x2000 { Self::New } else { Self::Old }
    }

    /// Clock of the processor, MHz (DS12110, "General operating conditions": 480 at VOS0; revision
    /// Y has only VOS1, 400).
    pub const fn core_mhz(self) -> u32 {
        match self {
            Self::Old => 400,
            Self::New => 480,
        }
    }

    /// Settings of PLL1 for [`Self::core_mhz`]: input divider and multiplication factor. The PLL
    /// makes twice the processor's clock, which divider P halves. The divided input is 8 MHz from
    /// HSE, else 16 MHz; the PLL's output is at most 960 MHz (RM0433, "PLL configuration").
    pub const fn pll_divider_and_factor(self, source: ClockSource) -> (u32, u32) {
        let (source_mhz, divider) = match source {
            ClockSource::External => (HSE_MHZ, 1),
            ClockSource::Internal => (HSI_MHZ, 4),
        };
        (divider, 2 * self.core_mhz() / (source_mhz / divider))
    }
}

/// Address of AXI_TARG7_FN_MOD. Without its bit READ_ISS_OVERRIDE revision Y may read wrong data
/// from AXI SRAM (ES0392, "Reading from AXI SRAM may lead to data read corruption").
pub const AXI_TARG7_FN_MOD: u32 = 0x5100_8108;
/// Bit READ_ISS_OVERRIDE of [`AXI_TARG7_FN_MOD`].
pub const READ_ISS_OVERRIDE: u32 = 1;

/// Bits of RCC_AHB2ENR that switch on the clocks of SRAM1, SRAM2 and SRAM3 (RM0433, "RCC AHB2 clock
/// register"); they are off after a reset.
pub const D2_SRAM_CLOCKS: u32 = 0b111 << 29;
/// Address of RCC_AHB2ENR.
pub const RCC_AHB2ENR: u32 = 0x5802_44DC;

/// Bit of RCC_RSR that clears all reset flags.
pub const RMVF: u32 = 1 << 16;

/// Reset cause by RCC_RSR (RM0433, "RCC reset status register", table of the reset sources). All
/// resets but a wake-up set the pin's flag too, and power-on sets the brown-out flag: so the flags
/// are tested in this order.
pub const fn reset_cause(rsr: u32) -> ResetCause {
    // Brown-out, reset pin, power-on.
    const BOR: u32 = 1 << 21;
    const PIN: u32 = 1 << 22;
    const POR: u32 = 1 << 23;
    const SOFTWARE: u32 = 1 << 24;
    /// IWDG1 and WWDG1.
    const WATCHDOGS: u32 = 1 << 26 | 1 << 28;
    match rsr {
        _ if rsr & POR != 0 => ResetCause::Power,
        _ if rsr & BOR != 0 => ResetCause::BrownOut,
        _ if rsr & WATCHDOGS != 0 => ResetCause::Watchdog,
        _ if rsr & SOFTWARE != 0 => ResetCause::Request,
        _ if rsr & PIN != 0 => ResetCause::Key,
        _ => ResetCause::Unknown,
    }
}

/// Brown-out reset level, FLASH_OPTSR_CUR.BOR_LEV (RM0433): 0 is off, 3 resets below 2.7 V. The
/// firmware only reads it: if the supply failed while option bytes are written, the chip might be
/// locked.
pub const fn brown_out_level(optsr: u32) -> u8 {
    (optsr >> 2 & 0b11) as u8
}

/// SRAM3, which the UARTs' DMA reads and writes: not cached.
pub const DMA: Region = Region::new(0x3004_0000, 32 << 10, RegionAccess::Uncached);
/// Bank 2 of the flash: not cached, because it is programmed at run time and torn words may be
/// unreadable.
pub const BANK2: Region = Region::new(0x0810_0000, 1 << 20, RegionAccess::Uncached);
/// The first 256 bytes of the address space (ITCM): no access, so null pointers fault.
pub const NULL: Region = Region::new(0, 256, RegionAccess::None);
/// Address range of external memory, 0x6000_0000 to 0xDFFF_FFFF, four eighths of the address space:
/// no access, else the processor might read speculatively from memory controllers that are off.
pub const EXTERNAL: Region =
    Region { base: 0, len_log2: 32, access: RegionAccess::None, disabled_eighths: 0b1000_0111 };

/// The sectors of bank 2 that hold a roadmap of `len` bytes at offset `at` of the bank: cached,
/// read only. An eighth of the bank is one sector of 128 kB, so SRD bits disable the other sectors.
pub const fn roadmap_region(at: u32, len: u32) -> Region {
    const SECTOR: u32 = 128 << 10;
    let (first, end) = (at / SECTOR, (at + len).div_ceil(SECTOR));
    let mut region =
        Region { access: RegionAccess::CachedReadOnly, disabled_eighths: 0xFF, ..BANK2 };
    let mut sector = first;
    while sector < end && sector < 8 {
        region.disabled_eighths &= !(1 << sector);
        sector += 1;
    }
    region
}
