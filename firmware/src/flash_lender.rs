//! Flash that is read in place as a slice. While a range is lent, the flash driver refuses to erase
//! or program it, so the bytes cannot change under a reference.

use core::ops::{Deref, Range};

/// A range of flash bytes that cannot change. If it is dropped instead of given back to
/// [`FlashLender::take_back`], the range stays lent until the next start.
#[derive(Debug)]
pub struct LentFlash(&'static [u8]);

impl Deref for LentFlash {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0
    }
}

/// Keeps track of the lent range of a flash; at most one range is lent at a time.
#[derive(Debug, Default)]
pub struct FlashLender {
    /// Offsets of the lent bytes in the flash; `None` while none are lent.
    lent: Option<Range<u32>>,
}

impl FlashLender {
    /// A lender that has lent nothing.
    pub const fn new() -> Self {
        Self { lent: None }
    }

    /// Lends `bytes`, which lie at offset `at` of the flash; `None` while another range is lent.
    pub fn lend(&mut self, at: u32, bytes: &'static [u8]) -> Option<LentFlash> {
        if self.lent.is_some() {
            return None;
        }
        self.lent = Some(at..at + bytes.len() as u32);
        Some(LentFlash(bytes))
    }

    /// Ends the loan: the range may be erased and programmed again.
    pub fn take_back(&mut self, _lent: LentFlash) {
        self.lent = None;
    }

    /// Whether `len` bytes at offset `at` may be erased or programmed: none of them is lent.
    pub fn allows(&self, at: u32, len: u32) -> bool {
        let meets = |lent: &Range<u32>| at < lent.end && lent.start < at.saturating_add(len);
        !self.lent.as_ref().is_some_and(meets)
    }
}

#[cfg(test)]
mod tests;
