//! Bank 2 of the STM32H743's flash: 8 sectors of 128 kB, words of 32 bytes with an error-correcting
//! code each.
//!
//! A word whose programming was cut by a reset has a code that fits nothing. Reading one is
//! answered by a bus error (RM0433, "Error code correction": double error detection), which would
//! end in a hard fault. So all is read as memory is probed (ARMv7-M manual, `CCR.BFHFNMIGN`): with
//! FAULTMASK set this code runs at priority −1, where that bit has a load's bus error ignored and
//! noted in CFSR alone. For the time of one word, about a microsecond, no interrupt is taken but
//! NMI. A load's error belongs to the load that made it, so what is found in CFSR between the
//! barriers is this word's. The flag that the flash itself keeps is not asked: a load that the
//! processor made ahead of time, and dropped, may have set it.
//!
//! Those flags stay until they are cleared in FLASH_CCR2, and as long as one stands
//! embassy-stm32 0.6 takes every erasure and program for failed: it clears them by FLASH_SR2, which
//! on this chip is read-only for them. So they are cleared before. It leaves PSIZE at 8 bits when
//! it has programmed, as which a sector is erased at the slowest (DS12110, "Flash memory
//! programming"): so that is widened before.
//!
//! The bank is not cached, so a load that fails is this code's own, and what was programmed is what
//! is read. Only the sectors of the roadmap in use are: the MPU holds them read only for as long.
//!
//! None of this has run on a chip.
#![expect(unsafe_code, reason = "flash is memory, and its errors are faults")]

use core::arch::asm;

use companion::storage::store::{FlashFault, FlashLayout, ReadFlash, WORD};
use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::SCB;
use embassy_stm32::flash::{Async, Flash as Device};
use embassy_stm32::pac;

use super::super::mpu;
use crate::chips::h743;
use crate::lent::{FlashLender, LentFlash};

/// Offset of bank 2 from the start of the flash.
const BANK2_OFFSET: u32 = 1 << 20;
/// Address of bank 2.
const BANK2_ADDRESS: usize = 0x0810_0000;
/// Values that FLASH_KEYR2 takes, one after the other, to unlock FLASH_CR2.
const UNLOCK_KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// `CR.PSIZE` of 64 bits.
const PSIZE_64: u8 = 3;
/// `CCR.BFHFNMIGN`: at priority −1 and above, bus errors of loads are ignored.
const BFHFNMIGN: u32 = 1 << 8;
/// `CFSR`'s byte of bus faults; ones clear it.
const BUS_FAULTS: u32 = 0xFF00;

/// Bank 2.
pub const LAYOUT: FlashLayout = FlashLayout::H743;

/// Bank 2; there is one.
pub struct Flash {
    device: Device<'static, Async>,
    lender: FlashLender,
}

impl Flash {
    pub(super) fn new(device: Device<'static, Async>) -> Self {
        Self { device, lender: FlashLender::new() }
    }

    /// A roadmap as it lies in the bank, cached, and not to be changed until it is given back;
    /// `None` where it would reach beyond, or another one is lent. The store gives only what it has
    /// read whole, by [`ReadFlash::read`]: no word of it is torn.
    pub fn lend(&mut self, at: u32, len: usize) -> Option<LentFlash> {
        let address = bank_address(at, len)?;
        // SAFETY: inside the bank, which nobody erases or programs there as long as it is lent.
        let lent = self
            .lender
            .lend(at, unsafe { core::slice::from_raw_parts(address as *const u8, len) })?;
        // SAFETY: nobody writes there.
        unsafe { mpu::set(super::ROADMAP_REGION, Some(&h743::roadmap_region(at, len as u32))) };
        Some(lent)
    }

    /// The lent range is not used any more, and nothing of it stays in the cache.
    pub fn take_back(&mut self, lent: LentFlash) {
        // SAFETY: a region less; and the cache's maintenance, which nobody else does after the
        // start.
        unsafe {
            mpu::set(super::ROADMAP_REGION, None);
            let mut core = cortex_m::Peripherals::steal();
            core.SCB.clean_invalidate_dcache(&mut core.CPUID);
        }
        self.lender.take_back(lent);
    }
}

/// The address of bytes of the bank; `None` where they would reach beyond.
fn bank_address(at: u32, len: usize) -> Option<usize> {
    let end = (at as usize).checked_add(len)?;
    (end <= LAYOUT.len() as usize).then_some(BANK2_ADDRESS + at as usize)
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let mut address = bank_address(at, out.len()).ok_or(FlashFault)?;
        let mut rest = out;
        while !rest.is_empty() {
            let (piece, after) = rest.split_at_mut(rest.len().min(WORD - address % WORD));
            // SAFETY: inside the bank, by `bank_address`; and inside one word.
            unsafe { read_tolerating_bus_errors(address as *const u8, piece) }?;
            address += piece.len();
            rest = after;
        }
        Ok(())
    }
}

/// Reads bytes that may raise a bus error; then their values mean nothing.
///
/// # Safety
/// They have to be memory, whole or torn.
unsafe fn read_tolerating_bus_errors(from: *const u8, out: &mut [u8]) -> Result<(), FlashFault> {
    // SAFETY: no other code of the firmware uses CCR and CFSR but the fault handler, which does not
    // come back.
    let scb = unsafe { &*SCB::PTR };
    // SAFETY: FAULTMASK and BFHFNMIGN are set for the loads alone, and put back: they were not set
    // before. Nothing in between may panic; `out` is not in the flash, so only the loads can fail.
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

/// Clears what earlier loads and operations have left.
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

/// Has bank 2 erased 64 bits at a time, as after a reset.
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
