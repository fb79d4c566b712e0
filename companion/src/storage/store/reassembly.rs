//! Reassembly of an upload: the bytes received that are not in flash yet. Pieces may come in any
//! order within a window of 4 kB.

use super::flash::MAX_PROGRAM_LEN;

/// Bytes of the reassembly window: a mission file fits in it, a roadmap passes through. With one
/// mark bit per byte the reassembly takes 4.5 kB.
pub const WINDOW_LEN: usize = 4096;

/// What became of a piece of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceOutcome {
    /// The piece was stored, or had been received before.
    Stored,
    /// The window cannot take the piece yet: the client must send it again.
    RetryLater,
    /// The file would be longer than its slot or the window.
    TooLarge,
}

/// The reassembly window. All zero when new.
#[derive(Clone, Debug)]
pub struct UploadReassembly {
    /// Content of the window; of no meaning where nothing was received.
    bytes: [u8; WINDOW_LEN],
    /// One bit for each byte of the window: whether it was received.
    received_bits: [u64; WINDOW_LEN / 64],
    /// Offset in the file of the window's first byte; a multiple of [`MAX_PROGRAM_LEN`].
    window_start: u32,
    /// End of the furthest piece received, as an offset in the file.
    received_end: u32,
}

impl Default for UploadReassembly {
    fn default() -> Self {
        Self {
            bytes: [0; WINDOW_LEN],
            received_bits: [0; WINDOW_LEN / 64],
            window_start: 0,
            received_end: 0,
        }
    }
}

impl UploadReassembly {
    /// Begins with an empty file.
    pub fn reset(&mut self) {
        self.received_bits.fill(0);
        (self.window_start, self.received_end) = (0, 0);
    }

    /// Number of leading bytes of the file that are in flash already.
    pub fn flushed_len(&self) -> u32 {
        self.window_start
    }

    /// End of the furthest piece received, bytes from the file's start: the file's length once all
    /// pieces were sent.
    pub fn file_len(&self) -> u32 {
        self.received_end
    }

    /// Stores a piece of a file of at most `most` bytes.
    pub fn insert(&mut self, offset: u32, piece: &[u8], most: u32) -> PieceOutcome {
        let Some(end) = offset.checked_add(piece.len() as u32).filter(|end| *end <= most) else {
            return PieceOutcome::TooLarge;
        };
        if end > self.window_start + WINDOW_LEN as u32 {
            return PieceOutcome::RetryLater;
        }
        self.received_end = self.received_end.max(end);
        // The part of the piece before the window is in flash already.
        let skipped = self.window_start.saturating_sub(offset).min(piece.len() as u32);
        let at = (offset + skipped - self.window_start.min(offset + skipped)) as usize;
        let piece = &piece[skipped as usize..];
        self.bytes[at..at + piece.len()].copy_from_slice(piece);
        for i in at..at + piece.len() {
            self.received_bits[i / 64] |= 1 << (i % 64);
        }
        PieceOutcome::Stored
    }

    /// Number of bytes received without a gap from the window's first byte on, at most `most`.
    fn contiguous_len(&self, most: usize) -> usize {
        let gap = self.received_bits.iter().position(|bits| *bits != u64::MAX);
        let run =
            gap.map_or(WINDOW_LEN, |i| 64 * i + self.received_bits[i].trailing_ones() as usize);
        run.min(most)
    }

    /// The window's first block of [`MAX_PROGRAM_LEN`] bytes; `None` until it is received
    /// completely.
    pub fn next_block(&self) -> Option<&[u8; MAX_PROGRAM_LEN]> {
        if self.contiguous_len(MAX_PROGRAM_LEN) < MAX_PROGRAM_LEN {
            None
        } else {
            self.bytes.first_chunk()
        }
    }

    /// The bytes from the window to the file's end; `None` if one of them is missing.
    pub fn last_part(&self) -> Option<&[u8]> {
        let len = (self.received_end - self.window_start.min(self.received_end)) as usize;
        (len <= WINDOW_LEN && self.contiguous_len(len) == len).then(|| &self.bytes[..len])
    }

    /// Drops the window's first block, which is in flash now.
    pub fn drop_first_block(&mut self) {
        self.bytes.copy_within(MAX_PROGRAM_LEN.., 0);
        self.received_bits.copy_within(MAX_PROGRAM_LEN / 64.., 0);
        self.received_bits[(WINDOW_LEN - MAX_PROGRAM_LEN) / 64..].fill(0);
        self.window_start += MAX_PROGRAM_LEN as u32;
    }
}

#[cfg(test)]
mod tests;
