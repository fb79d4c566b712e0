//! A board's storage bank on the desk: bytes in memory, kept in a file if one is named.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use anyhow::{Context, bail};
use companion::storage::store::{FlashFault, FlashLayout, FlashRequest, MAX_READ, ReadFlash};

use crate::files;
use crate::quote::quoted_path;

/// Flash layout of a companion on the desk: the default board's bank.
pub const LAYOUT: FlashLayout = FlashLayout::H743;

/// The bank.
pub struct DeskFlash {
    bytes: Vec<u8>,
    file: Option<File>,
}

impl DeskFlash {
    /// An erased bank, or what a file holds of an earlier one; what changes is written to the file
    /// at once.
    ///
    /// # Errors
    /// The file cannot be read or made, or is no such bank.
    pub fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let mut bytes = vec![0xFF; LAYOUT.len() as usize];
        let Some(path) = path else { return Ok(Self { bytes, file: None }) };
        let failed = || format!("cannot keep a flash: {}", quoted_path(path));
        if path.exists() {
            files::regular_file_len(path).with_context(failed)?;
        }
        let opened = File::options().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = opened.with_context(failed)?;
        match file.metadata().with_context(failed)?.len() {
            0 => file.write_all(&bytes).with_context(failed)?,
            length if length == u64::from(LAYOUT.len()) => {
                file.read_exact(&mut bytes).with_context(failed)?;
            }
            length => {
                bail!(
                    "no flash image: {}: it has {length} bytes, not {}",
                    quoted_path(path),
                    LAYOUT.len()
                )
            }
        }
        Ok(Self { bytes, file: Some(file) })
    }

    /// Does what a companion asks; the bytes read, none for an erasure or a program.
    pub fn execute_request<'a>(
        &mut self,
        request: FlashRequest<'_>,
        read: &'a mut [u8; MAX_READ],
    ) -> Result<&'a [u8], FlashFault> {
        match request {
            FlashRequest::Read { at, len } => {
                let out = read.get_mut(..len).ok_or(FlashFault)?;
                self.read(at, out)?;
                return Ok(out);
            }
            FlashRequest::Erase { at } => {
                self.modify_range(at, LAYOUT.sector_len as usize, |part| part.fill(0xFF))?;
            }
            FlashRequest::Program { at, bytes } => self.modify_range(at, bytes.len(), |part| {
                // Programmed as flash does it: bits only fall.
                part.iter_mut().zip(bytes).for_each(|(held, byte)| *held &= byte);
            })?,
        }
        Ok(&[])
    }

    /// Content of the flash.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

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

impl ReadFlash for DeskFlash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let start = at as usize;
        out.copy_from_slice(self.bytes.get(start..start + out.len()).ok_or(FlashFault)?);
        Ok(())
    }
}
