//! Bank 2 of the STM32H743's flash, emulated in memory that a warm reset leaves alone: 8 sectors of
//! 128 kB, words of 32 bytes that are programmed once between two erasures, and torn ones that
//! cannot be read.
#![expect(unsafe_code, reason = "the emulated flash is memory that the linker knows nothing of")]

use companion::storage::store::{FlashFault, FlashLayout, ReadFlash, WORD};
use embassy_time::{Duration, Timer};

use super::memory::Bank2;
use crate::lent::{FlashLender, LentFlash};

/// Address of the bank.
const BANK_ADDRESS: usize = 0x6000_0000;
/// Address of the marks, a byte for each word: the state of that word. Real flash keeps a checksum
/// there.
const WORD_MARKS: usize = 0x6020_0000;
/// Address of the mark that bank and marks were made; memory is zero when the power comes.
const BANK_MADE: usize = 0x6030_0000;
const MAGIC: u32 = 0x464c_4153;
const LEN: usize = LAYOUT.len() as usize;
const ERASED: u8 = 0;
const WHOLE: u8 = 1;
const TORN: u8 = 2;
/// Time to erase a sector of 128 kB, by the data sheet between 1.1 and 4 s at 8 and 64 bit
/// parallelism.
const ERASE_TIME: Duration = Duration::from_millis(1100);
/// Time to program a word, by the data sheet.
const PROGRAM_TIME: Duration = Duration::from_micros(100);

/// The emulated bank is the real one's size.
pub const LAYOUT: FlashLayout = FlashLayout::H743;

/// The bank; there is one.
pub struct Flash(FlashLender);

impl Flash {
    /// To be called once, at the start: the bank is empty if the power was off.
    pub(super) fn new() -> Self {
        assert!(Bank2::Programmed.claim(), "bank 2 is read as it lies, for measurements");
        // SAFETY: memory of this board; nobody else uses it yet.
        unsafe {
            if (BANK_MADE as *const u32).read_volatile() != MAGIC {
                (BANK_ADDRESS as *mut u8).write_bytes(0xFF, LEN);
                (WORD_MARKS as *mut u8).write_bytes(ERASED, LEN / WORD);
                (BANK_MADE as *mut u32).write_volatile(MAGIC);
            }
        }
        Self(FlashLender::new())
    }

    /// A roadmap as it lies in the bank, not to be changed until it is given back; `None` where it
    /// cannot be read, or another one is lent.
    pub fn lend(&mut self, at: u32, len: usize) -> Option<LentFlash> {
        let place = readable_address(at, len)?;
        // SAFETY: inside the bank, which nobody erases or programs there as long as it is lent.
        self.0.lend(at, unsafe { core::slice::from_raw_parts(place, len) })
    }

    /// The lent range is not used any more.
    pub fn take_back(&mut self, lent: LentFlash) {
        self.0.take_back(lent);
    }
}

/// Address of these bytes; `None` where they would reach beyond the bank, or a word of them is
/// torn.
fn readable_address(at: u32, len: usize) -> Option<*const u8> {
    let at = at as usize;
    let end = at.checked_add(len).filter(|end| *end <= LEN)?;
    let torn = (at / WORD..end.div_ceil(WORD)).any(|word| word_mark(word) == TORN);
    (!torn).then_some((BANK_ADDRESS + at) as *const u8)
}

impl crate::flash::Flash for Flash {
    async fn erase(&mut self, at: u32) -> Result<(), FlashFault> {
        let (allowed, at, len) =
            (self.0.allows(at, LAYOUT.sector_len), at as usize, LAYOUT.sector_len as usize);
        if !at.is_multiple_of(len) || at + len > LEN || !allowed {
            return Err(FlashFault);
        }
        // A cut while it lasts leaves words that are neither.
        for word in at / WORD..(at + len) / WORD {
            set_mark(word, TORN);
        }
        Timer::after(ERASE_TIME).await;
        // SAFETY: inside the bank, and nothing of this sector is lent.
        unsafe { ((BANK_ADDRESS + at) as *mut u8).write_bytes(0xFF, len) };
        for word in at / WORD..(at + len) / WORD {
            set_mark(word, ERASED);
        }
        Ok(())
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        let (allowed, at) = (self.0.allows(at, bytes.len() as u32), at as usize);
        if !allowed
            || !at.is_multiple_of(WORD)
            || !bytes.len().is_multiple_of(WORD)
            || at + bytes.len() > LEN
        {
            return Err(FlashFault);
        }
        for (i, word) in bytes.chunks(WORD).enumerate() {
            let place = at / WORD + i;
            if word_mark(place) != ERASED {
                return Err(FlashFault);
            }
            set_mark(place, TORN);
            Timer::after(PROGRAM_TIME).await;
            // SAFETY: inside the bank, and this word is not lent.
            unsafe {
                ((BANK_ADDRESS + place * WORD) as *mut u8)
                    .copy_from_nonoverlapping(word.as_ptr(), WORD)
            };
            set_mark(place, WHOLE);
        }
        Ok(())
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let from = readable_address(at, out.len()).ok_or(FlashFault)?;
        // SAFETY: inside the bank, and `out` is not.
        unsafe { out.as_mut_ptr().copy_from_nonoverlapping(from, out.len()) };
        Ok(())
    }
}

fn word_mark(word: usize) -> u8 {
    // SAFETY: the callers keep `word` below the number of words, and each has a mark.
    unsafe { ((WORD_MARKS + word) as *const u8).read_volatile() }
}

fn set_mark(word: usize, mark: u8) {
    // SAFETY: as above.
    unsafe { ((WORD_MARKS + word) as *mut u8).write_volatile(mark) }
}
