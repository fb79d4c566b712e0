//! The debug probe of a board in lock step: memory, and what is called in it while it stands still.

use std::time::Duration;

use anyhow::ensure;
use lock_step::ToBoard;

use super::bank::{BANK_MADE, BANK2, ERASED, TORN, WHOLE, WORD_MARKS};
use super::{EmulatedBoard, GrantResult};
use crate::flash::LAYOUT;
use companion::storage::store::WORD;

/// Bytes of memory in a message.
const MEMORY_CHUNK: usize = 32 << 10;
/// Address of the stack, as in the board's memory map.
const STACK_ADDRESS: u32 = 0x2008_A000;
/// Length of the stack, bytes.
pub const STACK_LEN: usize = 88 << 10;
/// Value of a byte that no stack has touched since the start.
const STACK_PAINT: u8 = 0xcc;

impl EmulatedBoard {
    /// Reads the board's memory from an address on.
    ///
    /// # Errors
    /// The board is gone.
    pub fn read_memory(&mut self, address: u32, length: usize) -> anyhow::Result<Vec<u8>> {
        let mut memory = Vec::new();
        while memory.len() < length {
            let len = (length - memory.len()).min(MEMORY_CHUNK) as u16;
            self.send(&ToBoard::Peek { address: address + memory.len() as u32, len }.to_bytes())?;
            memory.extend(self.finish_grant()?.memory);
        }
        Ok(memory)
    }

    /// Changes its memory.
    ///
    /// # Errors
    /// The board is gone.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) -> anyhow::Result<()> {
        for (i, bytes) in bytes.chunks(MEMORY_CHUNK).enumerate() {
            let head = ToBoard::Poke {
                address: address + (i * MEMORY_CHUNK) as u32,
                len: bytes.len() as u16,
            };
            self.send(&[&head.to_bytes(), bytes].concat())?;
            self.finish_grant()?;
        }
        Ok(())
    }

    /// Calls a function, above every task and at this moment of the board's time; what came of it
    /// is that the board waits again, or that it starts again.
    ///
    /// # Errors
    /// The board is gone, or hangs for longer than `patience`.
    pub fn call_function(
        &mut self,
        address: u32,
        argument: u32,
        patience: Duration,
    ) -> anyhow::Result<GrantResult> {
        self.send(&ToBoard::Call { address, argument }.to_bytes())?;
        self.finish_grant_within(patience)
    }

    /// Writes `bank` into the board's flash.
    ///
    /// # Errors
    /// The board is gone, or its flash has no such bank.
    pub fn load_flash(&mut self, bank: &[u8]) -> anyhow::Result<()> {
        ensure!(bank.len() == LAYOUT.len() as usize, "a bank has {} bytes", LAYOUT.len());
        let mark = |word: &[u8]| if word.iter().all(|byte| *byte == 0xFF) { ERASED } else { WHOLE };
        let marks: Vec<u8> = bank.chunks(WORD).map(mark).collect();
        self.write_memory(BANK2, bank)?;
        self.write_memory(WORD_MARKS, &marks)?;
        self.write_memory(BANK_MADE.0, &BANK_MADE.1.to_le_bytes())
    }

    /// Words of its flash that are being programmed or erased, in its order.
    ///
    /// # Errors
    /// The board is gone.
    pub fn torn_flash_words(&mut self) -> anyhow::Result<Vec<usize>> {
        let marks = self.read_memory(WORD_MARKS, LAYOUT.len() as usize / WORD)?;
        Ok((0..marks.len()).filter(|word| marks[*word] == TORN).collect())
    }

    /// Bytes of the stack that were used since the start.
    ///
    /// # Errors
    /// The board is gone.
    pub fn stack_used(&mut self) -> anyhow::Result<usize> {
        let stack = self.read_memory(STACK_ADDRESS, STACK_LEN)?;
        Ok(STACK_LEN - stack.iter().take_while(|byte| **byte == STACK_PAINT).count())
    }
}
