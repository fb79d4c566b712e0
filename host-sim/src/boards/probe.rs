//! A debug probe for a board in lock step: reads and writes its memory and calls its functions
//! while the board stands still.

use std::time::Duration;

use anyhow::ensure;
use lock_step::ToBoard;

use super::flash_image::{
    BANK_IMAGE_MARK, BANK_IMAGE_MARK_ADDRESS, ERASED, FLASH_BANK2_ADDRESS, PROGRAMMED, TORN,
    WORD_MARKS_ADDRESS,
};
use super::{EmulatedBoard, GrantResult, STACK_LEN};
use crate::flash::HOST_FLASH_LAYOUT;
use companion::storage::store::WORD_LEN;

/// Most bytes of memory in one message.
const MEMORY_CHUNK: usize = 32 << 10;
/// Address of the stack in the memory map of the firmware for `qemu`.
const STACK_ADDRESS: u32 = 0x2008_A000;
/// Value with which the firmware fills the stack at its start; a byte that still has it was never
/// used.
const STACK_PAINT: u8 = 0xcc;

impl EmulatedBoard {
    /// Reads `length` bytes of the board's memory from `address` on.
    ///
    /// # Errors
    /// The QEMU process has ended.
    pub fn read_memory(&mut self, address: u32, length: usize) -> anyhow::Result<Vec<u8>> {
        let mut memory = Vec::new();
        while memory.len() < length {
            let len = (length - memory.len()).min(MEMORY_CHUNK) as u16;
            self.send(&ToBoard::Peek { address: address + memory.len() as u32, len }.to_bytes())?;
            memory.extend(self.wait_for_grant_end()?.memory);
        }
        Ok(memory)
    }

    /// Overwrites the board's memory from `address` on.
    ///
    /// # Errors
    /// The QEMU process has ended.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) -> anyhow::Result<()> {
        for (i, bytes) in bytes.chunks(MEMORY_CHUNK).enumerate() {
            let head = ToBoard::Poke {
                address: address + (i * MEMORY_CHUNK) as u32,
                len: bytes.len() as u16,
            };
            self.send(&[&head.to_bytes(), bytes].concat())?;
            self.wait_for_grant_end()?;
        }
        Ok(())
    }

    /// Calls a function in the board, at the highest priority and at the board's current time.
    /// Returns when the board waits for the host again, or has reset.
    ///
    /// # Errors
    /// The QEMU process has ended, or the board does not answer within `timeout` of wall-clock
    /// time.
    pub fn call_function(
        &mut self,
        address: u32,
        argument: u32,
        timeout: Duration,
    ) -> anyhow::Result<GrantResult> {
        self.send(&ToBoard::Call { address, argument }.to_bytes())?;
        self.wait_for_grant_end_within(timeout)
    }

    /// Writes the image `bank` into the board's flash bank, marks each word as erased or
    /// programmed, and sets the mark by which the firmware knows that the bank holds an image.
    ///
    /// # Errors
    /// The QEMU process has ended, or the image has not the length of a bank.
    pub fn load_flash(&mut self, bank: &[u8]) -> anyhow::Result<()> {
        ensure!(
            bank.len() == HOST_FLASH_LAYOUT.len() as usize,
            "a bank has {} bytes",
            HOST_FLASH_LAYOUT.len()
        );
        let mark =
            |word: &[u8]| if word.iter().all(|byte| *byte == 0xFF) { ERASED } else { PROGRAMMED };
        let marks: Vec<u8> = bank.chunks(WORD_LEN).map(mark).collect();
        self.write_memory(FLASH_BANK2_ADDRESS, bank)?;
        self.write_memory(WORD_MARKS_ADDRESS, &marks)?;
        self.write_memory(BANK_IMAGE_MARK_ADDRESS, &BANK_IMAGE_MARK.to_le_bytes())
    }

    /// Indices of the flash words whose programming or erasure has begun and not ended: it runs
    /// now, or a reset cut it off.
    ///
    /// # Errors
    /// The QEMU process has ended.
    pub fn torn_flash_words(&mut self) -> anyhow::Result<Vec<usize>> {
        let marks =
            self.read_memory(WORD_MARKS_ADDRESS, HOST_FLASH_LAYOUT.len() as usize / WORD_LEN)?;
        Ok((0..marks.len()).filter(|word| marks[*word] == TORN).collect())
    }

    /// Greatest depth of the stack since the board's start, bytes.
    ///
    /// # Errors
    /// The QEMU process has ended.
    pub fn max_stack_used(&mut self) -> anyhow::Result<usize> {
        let stack = self.read_memory(STACK_ADDRESS, STACK_LEN)?;
        Ok(STACK_LEN - stack.iter().take_while(|byte| **byte == STACK_PAINT).count())
    }
}
