//! Sources of the random numbers from which frames are forged.

use crate::meeting::dice::Dice;

/// A source of random numbers: a seeded generator, or a fuzzer's bytes, which end.
pub trait Entropy {
    /// The next bits.
    fn bits(&mut self) -> u64;
    /// Whether no random numbers are left.
    fn is_spent(&self) -> bool {
        false
    }
}

impl Entropy for Dice {
    fn bits(&mut self) -> u64 {
        Self::bits(self)
    }
}

/// A fuzzer's bytes.
#[derive(Debug)]
pub struct FuzzBytes<'a>(pub &'a [u8]);

impl Entropy for FuzzBytes<'_> {
    fn bits(&mut self) -> u64 {
        let mut word = [0; 8];
        let length = self.0.len().min(8);
        word[..length].copy_from_slice(&self.0[..length]);
        self.0 = &self.0[length..];
        u64::from_le_bytes(word)
    }

    fn is_spent(&self) -> bool {
        self.0.is_empty()
    }
}
