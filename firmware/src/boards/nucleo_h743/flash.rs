//! Driver of bank 2 of the STM32H743's flash: 8 sectors of 128 kB, words of 32 bytes, each with an
//! error-correcting code.
//!
//! A torn word, whose programming a reset interrupted, has a code that does not match. A load from
//! it raises a bus error (RM0433, "Error code correction": double error detection), which would end
//! in a hard fault. So all reads use the method by which ARM probes memory (ARMv7-M manual,
//! `CCR.BFHFNMIGN`): with FAULTMASK set this code runs at priority −1, where that bit makes the
//! processor ignore a load's bus error and only record it in CFSR. During one word, about a
//! microsecond, no interrupt but NMI is taken. A load's bus error is precise, so an error in CFSR
//! between the barriers belongs to this word. The flash's own error flag is not used: a speculative
//! load may have set it.
//!
//! embassy-stm32 0.6 takes an erasure or programming for failed while an old error flag of the
//! flash is set: it clears the flags by FLASH_SR2, which is read-only on this chip; they are
//! cleared by FLASH_CCR2. So this driver clears them before each operation. embassy-stm32 also
//! leaves PSIZE at 8 bits after programming, with which a sector erases slowest (DS12110, "Flash
//! memory programming"): so this driver sets it to 64 bits before an erasure.
//!
//! The bank is not cached: a bus error belongs to a load of this code, and a read returns what was
//! programmed. Only the sectors of the roadmap in use are cached; the MPU makes them read only
//! meanwhile.
//!
//! No chip has run this yet.
#![expect(unsafe_code, reason = "flash is memory, and its errors are faults")]

use core::arch::asm;

use companion::storage::store::{FlashFault, FlashLayout, ReadFlash, WORD_LEN};
use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::SCB;
use embassy_stm32::flash::{Async, Flash as Device};
use embassy_stm32::pac;

use super::super::mpu;
use crate::chips::h743;
use crate::flash_lender::{FlashLender, LentFlash};

/// Offset of bank 2 from the start of the flash, as embassy-stm32 counts.
const BANK2_OFFSET: u32 = 1 << 20;
/// Address of bank 2 in the memory map.
const BANK2_ADDRESS: usize = 0x0810_0000;
/// Values that are written to FLASH_KEYR2, one after the other, to unlock FLASH_CR2.
const UNLOCK_KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Value of `FLASH_CR2.PSIZE` for a parallelism of 64 bits.
const PSIZE_64: u8 = 3;
/// Bit `CCR.BFHFNMIGN`: code that runs at priority −1 or −2 ignores bus errors of its loads.
const BFHFNMIGN: u32 = 1 << 8;
/// The bus fault byte of `CFSR`; writing ones clears it.
const BUS_FAULTS: u32 = 0xFF00;
/// Number of the MPU region of the roadmap in use: above that of the whole bank, so that it takes
/// precedence, and below the stack guard's.
const ROADMAP_REGION: u32 = 3;

/// Layout of the file store, which is all of bank 2.
pub const LAYOUT: FlashLayout = FlashLayout::H743;

/// Driver of bank 2; there is one instance.
pub struct Flash {
    device: Device<'static, Async>,
    /// Keeps track of the lent range.
    lender: FlashLender,
}

impl Flash {
    pub(super) fn new(device: Device<'static, Async>) -> Self {
        Self { device, lender: FlashLender::new() }
    }

    /// Lends `len` bytes at offset `at` of the bank, in place and cached; they are not erased or
    /// programmed until given back. `None` where they reach beyond the bank, or other bytes are
    /// lent. The store asks only for bytes that it has read whole by [`ReadFlash::read`], so no
    /// word of them is torn.
    pub fn lend(&mut self, at: u32, len: usize) -> Option<LentFlash> {
        let address = bank2_address(at, len)?;
        // SAFETY: inside the bank, and this driver does not erase or program bytes that are lent.
        let lent = self
            .lender
            .lend(at, unsafe { core::slice::from_raw_parts(address as *const u8, len) })?;
        // SAFETY: the region makes the sectors read only, and nothing writes to them.
        unsafe { mpu::set_region(ROADMAP_REGION, Some(&h743::roadmap_region(at, len as u32))) };
        Some(lent)
    }

    /// Ends the loan: the bytes may be erased and programmed again, and are not cached any more.
    pub fn take_back(&mut self, lent: LentFlash) {
        // SAFETY: disables a region that only this driver uses; after the start no other code
        // maintains the cache.
        unsafe {
            mpu::set_region(ROADMAP_REGION, None);
            let mut core = cortex_m::Peripherals::steal();
            core.SCB.clean_invalidate_dcache(&mut core.CPUID);
        }
        self.lender.take_back(lent);
    }
}

/// Address of `len` bytes at offset `at` of the bank; `None` where they reach beyond it.
fn bank2_address(at: u32, len: usize) -> Option<usize> {
    let end = (at as usize).checked_add(len)?;
    (end <= LAYOUT.len() as usize).then_some(BANK2_ADDRESS + at as usize)
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let mut address = bank2_address(at, out.len()).ok_or(FlashFault)?;
        let mut rest = out;
        while !rest.is_empty() {
            let (piece, after) = rest.split_at_mut(rest.len().min(WORD_LEN - address % WORD_LEN));
            // SAFETY: inside the bank, as `bank2_address` checked, and inside one word.
            unsafe { read_tolerating_bus_errors(address as *const u8, piece) }?;
            address += piece.len();
            rest = after;
        }
        Ok(())
    }
}

/// Reads bytes of one flash word. Returns [`FlashFault`] if a load raised a bus error, as a torn
/// word does; then `out` holds no data.
///
/// # Safety
/// `from` points to flash bytes of `out`'s length; their word may be torn.
unsafe fn read_tolerating_bus_errors(from: *const u8, out: &mut [u8]) -> Result<(), FlashFault> {
    // SAFETY: only this function and the fault handler use CCR and CFSR, and that handler never
    // returns.
    let scb = unsafe { &*SCB::PTR };
    // SAFETY: FAULTMASK and BFHFNMIGN are set for the loads alone and cleared after; they were
    // clear before. Nothing in between panics; `out` is not in the flash, so only the loads can
    // fail.
    unsafe {
        asm!("cpsid f", options(nostack, preserves_flags));
        scb.ccr.modify(|ccr| ccr | BFHFNMIGN);
        scb.cfsr.write(BUS_FAULTS);
        dsb();
        isb();
        for (i, byte) in out.iter_mut().enumerate() {
            *byte = from.add(i).read_volatile();
        }
        dsb();
        isb();
        let torn = scb.cfsr.read() & BUS_FAULTS != 0;
        scb.cfsr.write(BUS_FAULTS);
        scb.ccr.modify(|ccr| ccr & !BFHFNMIGN);
        dsb();
        isb();
        asm!("cpsie f", options(nostack, preserves_flags));
        if torn { Err(FlashFault) } else { Ok(()) }
    }
}

/// Clears the error flags of bank 2 (its index is 1) that earlier reads and operations have left.
fn clear_errors() {
    pac::FLASH.bank(1).ccr().write(|w| {
        w.set_clr_wrperr(true);
        w.set_clr_pgserr(true);
        w.set_clr_strberr(true);
        w.set_clr_incerr(true);
        w.set_clr_operr(true);
        w.set_clr_rdperr(true);
        w.set_clr_rdserr(true);
        w.set_clr_sneccerr(true);
        w.set_clr_dbeccerr(true);
    });
}

/// Sets PSIZE of bank 2 to 64 bits, the value after a reset, so that erasing is fast.
fn restore_erase_width() {
    let bank = pac::FLASH.bank(1);
    if bank.cr().read().lock() {
        UNLOCK_KEYS.into_iter().for_each(|key| bank.keyr().write_value(key));
    }
    bank.cr().modify(|w| w.set_psize(PSIZE_64));
}

impl crate::flash::Flash for Flash {
    async fn erase(&mut self, at: u32) -> Result<(), FlashFault> {
        if !self.lender.allows(at, LAYOUT.sector_len) {
            return Err(FlashFault);
        }
        clear_errors();
        restore_erase_width();
        self.device
            .erase(BANK2_OFFSET + at, BANK2_OFFSET + at + LAYOUT.sector_len)
            .await
            .map_err(|_| FlashFault)
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        if !self.lender.allows(at, bytes.len() as u32) {
            return Err(FlashFault);
        }
        clear_errors();
        self.device.write(BANK2_OFFSET + at, bytes).await.map_err(|_| FlashFault)
    }
}
