//! STM32H743: RM0433 (the reference manual), DS12110 (the data sheet), ES0392 (the errata).

use super::ResetCause;
use super::mpu::{Access, Region};

/// Frequency of the oscillator that drives OSC_IN of the NUCLEO-H743ZI: its ST-LINK's MCO (UM1974,
/// "OSC clock"), MHz.
pub const HSE_MHZ: u32 = 8;
/// Frequency of the chip's own oscillator, MHz.
pub const HSI_MHZ: u32 = 64;

/// Revision of the silicon: DBGMCU_IDC.REV_ID (RM0433, "DBGMCU identity code register").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Revision {
    /// Z or Y (0x1001, 0x1003), and what is not known: 400 MHz at most, and the AXI SRAM's erratum.
    Old,
    /// X, V and later (0x2001, 0x2003): 480 MHz.
    New,
}

impl Revision {
    /// Revision by the register.
    pub const fn from_idcode(idc: u32) -> Self {
        if idc >> 16 >= 0x2000 { Self::New } else { Self::Old }
    }

    /// The processor's clock (DS12110, "General operating conditions": VOS0, which Y does not have;
    /// else VOS1), MHz.
    pub const fn core_mhz(self) -> u32 {
        match self {
            Self::Old => 400,
            Self::New => 480,
        }
    }

    /// Settings of PLL1 for the processor's clock: divider before it, factor. Twice that clock is
    /// halved behind it. The input is 8 or 16 MHz, the output at most 960 (RM0433, "PLL
    /// configuration").
    pub const fn pll_divider_and_factor(self, has_hse: bool) -> (u32, u32) {
        let (source, divider) = if has_hse { (HSE_MHZ, 1) } else { (HSI_MHZ, 4) };
        (divider, 2 * self.core_mhz() / (source / divider))
    }
}

/// Register AXI_TARG7_FN_MOD, and its READ_ISS_OVERRIDE: without it Y may read wrong data from AXI
/// SRAM (ES0392, "Reading from AXI SRAM may lead to data read corruption").
pub const AXI_TARG7_FN_MOD: u32 = 0x5100_8108;
/// Bit READ_ISS_OVERRIDE of [`AXI_TARG7_FN_MOD`].
pub const READ_ISS_OVERRIDE: u32 = 1;

/// RCC_AHB2ENR's clocks of SRAM1, SRAM2 and SRAM3 (RM0433, "RCC AHB2 clock register"): off after a
/// reset.
pub const D2_SRAM: u32 = 0b111 << 29;
/// Address of RCC_AHB2ENR.
pub const RCC_AHB2ENR: u32 = 0x5802_44DC;

/// RCC_RSR's bit that clears the others.
pub const RMVF: u32 = 1 << 16;

/// Reason why it started: RCC_RSR (RM0433, "RCC reset status register", table of the reset
/// sources). All causes but a wake-up press the reset pin too, and the power's coming is also a
/// brown-out.
pub const fn reset_cause(rsr: u32) -> ResetCause {
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

/// The level of the brown-out reset, FLASH_OPTSR_CUR.BOR_LEV (RM0433): 0 is off, 3 resets below 2.7
/// V. The option bytes are not written by the firmware: a supply that fails meanwhile might lock
/// the chip.
pub const fn brown_out_level(optsr: u32) -> u8 {
    (optsr >> 2 & 0b11) as u8
}

/// Memory that the DMA reads and writes: SRAM3.
pub const DMA: Region = Region::new(0x3004_0000, 32 << 10, Access::Uncached);
/// Bank 2 of the flash: words of it may be torn, and others change.
pub const BANK2: Region = Region::new(0x0810_0000, 1 << 20, Access::Uncached);
/// The address 0, ITCM's first bytes.
pub const NULL: Region = Region::new(0, 256, Access::None);
/// Where external memory would be, 0x6000_0000 to 0xDFFF_FFFF: by default the processor may read
/// ahead there, from controllers that are off. Four eighths of all there is.
pub const EXTERNAL: Region =
    Region { base: 0, len_log2: 32, access: Access::None, without: 0b1000_0111 };

/// The sectors of bank 2 that a roadmap lies in, cached; the MPU then holds them read only. `at`
/// and `len` count from the bank's first byte. An eighth of the bank is a sector of 128 kB.
pub const fn roadmap_region(at: u32, len: u32) -> Region {
    const SECTOR: u32 = 128 << 10;
    let (first, end) = (at / SECTOR, (at + len).div_ceil(SECTOR));
    let mut region = Region { access: Access::CachedReadOnly, without: 0xFF, ..BANK2 };
    let mut sector = first;
    while sector < end && sector < 8 {
        region.without &= !(1 << sector);
        sector += 1;
    }
    region
}
