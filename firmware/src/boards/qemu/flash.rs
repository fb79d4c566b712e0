//! Emulates bank 2 of the STM32H743's flash in memory that a warm reset leaves unchanged: 8 sectors
//! of 128 kB; words of 32 bytes that can be programmed once after an erasure; torn words that
//! cannot be read.
#![expect(unsafe_code, reason = "the emulated flash is memory that the linker knows nothing of")]

use companion::storage::store::{FlashFault, FlashLayout, ReadFlash, WORD_LEN};
use embassy_time::{Duration, Timer};

use super::memory::Bank2Use;
use crate::flash_lender::{FlashLender, LentFlash};

/// Address of the memory that holds the bank's bytes.
const BANK_ADDRESS: usize = 0x6000_0000;
/// Address of the word marks, one byte for each word: `ERASED`, `WHOLE` or `TORN`. Real flash finds
/// a torn word by its error-correcting code.
const WORD_MARKS_ADDRESS: usize = 0x6020_0000;
/// Address of the word that holds `MAGIC` once bank and marks are initialized; QEMU's memory is
/// zero at power-on.
const BANK_INITIALISED_ADDRESS: usize = 0x6030_0000;
/// Value at [`BANK_INITIALISED_ADDRESS`] once the bank has been initialised.
const MAGIC: u32 = 0x464c_4153;
/// Length of the bank, bytes.
const BANK_LEN: usize = LAYOUT.len() as usize;
/// Mark of a word that is erased.
const ERASED: u8 = 0;
/// Mark of a word that is programmed.
const WHOLE: u8 = 1;
/// Mark of a word whose erasure or programming was not completed: it cannot be read.
const TORN: u8 = 2;
/// Time to erase a sector of 128 kB; the data sheet gives 1.1 s (64-bit parallelism) to 4 s
/// (8-bit).
const ERASE_TIME: Duration = Duration::from_millis(1100);
/// Time to program a word of 32 bytes, by the data sheet.
const PROGRAM_TIME: Duration = Duration::from_micros(100);

/// Layout of the file store: as on the STM32H743.
pub const LAYOUT: FlashLayout = FlashLayout::H743;

/// Driver of the emulated bank; there is one instance.
pub struct Flash(FlashLender);

impl Flash {
    /// Creates the driver, once, at the start. After power-on this also sets the bank to erased.
    pub(super) fn new() -> Self {
        assert!(Bank2Use::Programmed.claim(), "bank 2 is read as it lies, for measurements");
        // SAFETY: memory of this board that no other code uses yet.
        unsafe {
            if (BANK_INITIALISED_ADDRESS as *const u32).read_volatile() != MAGIC {
                (BANK_ADDRESS as *mut u8).write_bytes(0xFF, BANK_LEN);
                (WORD_MARKS_ADDRESS as *mut u8).write_bytes(ERASED, BANK_LEN / WORD_LEN);
                (BANK_INITIALISED_ADDRESS as *mut u32).write_volatile(MAGIC);
            }
        }
        Self(FlashLender::new())
    }

    /// Lends `len` bytes at offset `at` of the bank, in place; they are not erased or programmed
    /// until given back. `None` where they reach beyond the bank, a word of them is torn, or other
    /// bytes are lent.
    pub fn lend(&mut self, at: u32, len: usize) -> Option<LentFlash> {
        let place = readable_address(at, len)?;
        // SAFETY: inside the bank, and this driver does not erase or program bytes that are lent.
        self.0.lend(at, unsafe { core::slice::from_raw_parts(place, len) })
    }

    /// Ends the loan: the bytes may be erased and programmed again.
    pub fn take_back(&mut self, lent: LentFlash) {
        self.0.take_back(lent);
    }
}

/// Address of `len` bytes at offset `at` of the bank; `None` where they reach beyond it, or a word
/// of them is torn.
fn readable_address(at: u32, len: usize) -> Option<*const u8> {
    let at = at as usize;
    let end = at.checked_add(len).filter(|end| *end <= BANK_LEN)?;
    let torn = (at / WORD_LEN..end.div_ceil(WORD_LEN)).any(|word| word_mark(word) == TORN);
    (!torn).then_some((BANK_ADDRESS + at) as *const u8)
}

impl crate::flash::Flash for Flash {
    async fn erase(&mut self, at: u32) -> Result<(), FlashFault> {
        let (allowed, at, len) =
            (self.0.allows(at, LAYOUT.sector_len), at as usize, LAYOUT.sector_len as usize);
        if !at.is_multiple_of(len) || at + len > BANK_LEN || !allowed {
            return Err(FlashFault);
        }
        // A reset during the erasure leaves all words of the sector torn.
        for word in at / WORD_LEN..(at + len) / WORD_LEN {
            set_mark(word, TORN);
        }
        Timer::after(ERASE_TIME).await;
        // SAFETY: inside the bank, and no byte of this sector is lent.
        unsafe { ((BANK_ADDRESS + at) as *mut u8).write_bytes(0xFF, len) };
        for word in at / WORD_LEN..(at + len) / WORD_LEN {
            set_mark(word, ERASED);
        }
        Ok(())
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        let (allowed, at) = (self.0.allows(at, bytes.len() as u32), at as usize);
        if !allowed
            || !at.is_multiple_of(WORD_LEN)
            || !bytes.len().is_multiple_of(WORD_LEN)
            || at + bytes.len() > BANK_LEN
        {
            return Err(FlashFault);
        }
        for (i, word) in bytes.chunks(WORD_LEN).enumerate() {
            let place = at / WORD_LEN + i;
            if word_mark(place) != ERASED {
                return Err(FlashFault);
            }
            set_mark(place, TORN);
            Timer::after(PROGRAM_TIME).await;
            // SAFETY: inside the bank, and this word is not lent.
            unsafe {
                ((BANK_ADDRESS + place * WORD_LEN) as *mut u8)
                    .copy_from_nonoverlapping(word.as_ptr(), WORD_LEN)
            };
            set_mark(place, WHOLE);
        }
        Ok(())
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let from = readable_address(at, out.len()).ok_or(FlashFault)?;
        // SAFETY: inside the bank, and `out` lies outside it.
        unsafe { out.as_mut_ptr().copy_from_nonoverlapping(from, out.len()) };
        Ok(())
    }
}

/// The mark of a word, by its number in the bank.
fn word_mark(word: usize) -> u8 {
    // SAFETY: callers pass the number of a word of the bank, and each word has a mark.
    unsafe { ((WORD_MARKS_ADDRESS + word) as *const u8).read_volatile() }
}

/// Sets the mark of a word, by its number in the bank.
fn set_mark(word: usize, mark: u8) {
    // SAFETY: as in `word_mark`.
    unsafe { ((WORD_MARKS_ADDRESS + word) as *mut u8).write_volatile(mark) }
}
