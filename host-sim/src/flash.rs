//! The flash bank of a board, simulated on the host: bytes in memory, also written to a file if one
//! is given.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use anyhow::{Context, bail};
use companion::storage::store::{FlashFault, FlashLayout, FlashRequest, MAX_READ_LEN, ReadFlash};

use crate::files;
use crate::quote::printable_path;

/// Flash layout of a companion on the host: that of the STM32H743 board.
pub const HOST_FLASH_LAYOUT: FlashLayout = FlashLayout::H743;

/// A simulated flash bank.
pub struct HostFlash {
    /// Content of the bank.
    bytes: Vec<u8>,
    /// The file to which changes are written; `None` without one.
    file: Option<File>,
}

impl HostFlash {
    /// Opens the bank that `path` holds from an earlier run. A new or empty file, or no path, gives
    /// an erased bank (all 0xFF). Every change is written to the file at once.
    ///
    /// # Errors
    /// The file cannot be read or created, or its length is not that of the bank.
    pub fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let mut bytes = vec![0xFF; HOST_FLASH_LAYOUT.len() as usize];
        let Some(path) = path else { return Ok(Self { bytes, file: None }) };
        let failed = || format!("cannot keep a flash: {}", printable_path(path));
        if path.exists() {
            files::regular_file_len(path).with_context(failed)?;
        }
        let opened = File::options().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = opened.with_context(failed)?;
        match file.metadata().with_context(failed)?.len() {
            0 => file.write_all(&bytes).with_context(failed)?,
            length if length == u64::from(HOST_FLASH_LAYOUT.len()) => {
                file.read_exact(&mut bytes).with_context(failed)?;
            }
            length => {
                bail!(
                    "no flash image: {}: it has {length} bytes, not {}",
                    printable_path(path),
                    HOST_FLASH_LAYOUT.len()
                )
            }
        }
        Ok(Self { bytes, file: Some(file) })
    }

    /// Executes a companion's flash request: a read returns its bytes; an erasure or programming
    /// returns an empty slice.
    pub fn execute_request<'a>(
        &mut self,
        request: FlashRequest<'_>,
        read: &'a mut [u8; MAX_READ_LEN],
    ) -> Result<&'a [u8], FlashFault> {
        match request {
            FlashRequest::Read { at, len } => {
                let out = read.get_mut(..len).ok_or(FlashFault)?;
                self.read(at, out)?;
                return Ok(out);
            }
            FlashRequest::Erase { at } => {
                self.modify_range(at, HOST_FLASH_LAYOUT.sector_len as usize, |part| {
                    part.fill(0xFF);
                })?;
            }
            FlashRequest::Program { at, bytes } => self.modify_range(at, bytes.len(), |part| {
                // As in NOR flash, programming can only clear bits.
                part.iter_mut().zip(bytes).for_each(|(held, byte)| *held &= byte);
            })?,
        }
        Ok(&[])
    }

    /// Returns the bytes of the whole bank.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Changes `len` bytes from offset `at` of the bank on, in memory and in the file.
    fn modify_range(
        &mut self,
        at: u32,
        len: usize,
        change: impl FnOnce(&mut [u8]),
    ) -> Result<(), FlashFault> {
        let start = at as usize;
        let part = self.bytes.get_mut(start..start + len).ok_or(FlashFault)?;
        change(part);
        if let Some(file) = &mut self.file {
            let written =
                file.seek(SeekFrom::Start(u64::from(at))).and_then(|_| file.write_all(part));
            written.map_err(|_| FlashFault)?;
        }
        Ok(())
    }
}

impl ReadFlash for HostFlash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let start = at as usize;
        out.copy_from_slice(self.bytes.get(start..start + out.len()).ok_or(FlashFault)?);
        Ok(())
    }
}
