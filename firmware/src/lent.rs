//! Flash that is used where it lies: as long as bytes are lent nobody erases or programs them, so
//! they may be read as memory.

use core::ops::{Deref, Range};

/// Bytes of the flash that stay as they are. If this is dropped, they stay lent for good.
#[derive(Debug)]
pub struct LentFlash(&'static [u8]);

impl Deref for LentFlash {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0
    }
}

/// The ranges that a flash has lent: one at a time.
#[derive(Debug, Default)]
pub struct FlashLender {
    lent: Option<Range<u32>>,
}

impl FlashLender {
    /// A flash that has lent nothing.
    pub const fn new() -> Self {
        Self { lent: None }
    }

    /// Lends the bytes at this offset of the flash; `None` where others are lent.
    pub fn lend(&mut self, at: u32, bytes: &'static [u8]) -> Option<LentFlash> {
        if self.lent.is_some() {
            return None;
        }
        self.lent = Some(at..at + bytes.len() as u32);
        Some(LentFlash(bytes))
    }

    /// The lent bytes are not used any more.
    pub fn take_back(&mut self, _lent: LentFlash) {
        self.lent = None;
    }

    /// Whether these bytes may be erased or programmed.
    pub fn allows(&self, at: u32, len: u32) -> bool {
        let meets = |lent: &Range<u32>| at < lent.end && lent.start < at.saturating_add(len);
        !self.lent.as_ref().is_some_and(meets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lent_is_not_changed_until_it_is_given_back() {
        static BYTES: [u8; 100] = [0; 100];
        let mut lender = FlashLender::new();
        assert!(lender.allows(0, u32::MAX));
        let lent = lender.lend(1000, &BYTES).expect("nothing else is lent");
        assert_eq!(lent.len(), 100);
        for (at, len, allowed) in [
            (0, 1000, true),
            (0, 1001, false),
            (1050, 1, false),
            (1099, 1, false),
            (1100, 50, true),
            (0, u32::MAX, false),
        ] {
            assert_eq!(lender.allows(at, len), allowed, "{at} {len}");
        }
        assert!(lender.lend(0, &BYTES).is_none(), "one at a time");
        lender.take_back(lent);
        assert!(lender.allows(0, u32::MAX) && lender.lend(0, &BYTES).is_some());
    }
}
