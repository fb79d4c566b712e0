//! Checks the sizes that a point cloud states of its parts before its readers allocate memory for
//! them.
//!
//! LAS 1.4 specification, R15: the header; behind it variable length records (VLRs), each with a
//! header of 54 bytes; behind the returns extended ones (EVLRs), each with a header of 60 bytes.
//! LAZ: a table of chunks, whose offset stands before the returns or, where it could not be written
//! there, at the end of the file, and layers in each chunk.

use std::io::{self, Read, Seek, SeekFrom};

/// Most chunks of a compressed cloud: 64 MB of table entries.
const MAX_CHUNKS: u32 = 1 << 22;
/// Record id of the variable length record that describes the LAZ compressor.
const COMPRESSOR_RECORD: u64 = 22204;

/// Checks that no size for which a reader would take memory reaches beyond the file's end; the
/// inner error says which does. Leaves the file at its beginning.
pub(super) fn check_declared_sizes<R: Read + Seek>(
    file: &mut R,
) -> io::Result<Result<(), &'static str>> {
    let length = file.seek(SeekFrom::End(0))?;
    let outcome = check_sizes(file, length)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(outcome)
}

/// Reads little-endian numbers at byte offsets of a file.
struct NumberReader<'a, R> {
    file: &'a mut R,
    /// Length of the file, bytes.
    length: u64,
}

impl<R: Read + Seek> NumberReader<'_, R> {
    /// The number of `bytes` bytes at offset `at`; 0 beyond the end, which the cloud's readers
    /// detect.
    fn read_number(&mut self, at: u64, bytes: u64) -> io::Result<u64> {
        if at.checked_add(bytes).is_none_or(|end| end > self.length) {
            return Ok(0);
        }
        self.file.seek(SeekFrom::Start(at))?;
        let mut number = [0; 8];
        self.file.read_exact(&mut number[..bytes as usize])?;
        Ok(u64::from_le_bytes(number))
    }

    /// Length in bytes of a chunk's first point record, which is stored uncompressed, and number of
    /// layers of a chunk, by the file's LASzip record. `None` if its chunks have no layers.
    fn read_chunk_layout(&mut self) -> io::Result<Option<(u64, u64)>> {
        let (mut at, count) = (self.read_number(94, 2)?, self.read_number(100, 4)?);
        for _ in 0..count.min(self.length / 54) {
            let (id, size) = (self.read_number(at + 18, 2)?, self.read_number(at + 20, 2)?);
            if id == COMPRESSOR_RECORD {
                let items = self.read_number(at + 54 + 32, 2)?;
                let (mut first, mut layers) = (0, 0);
                for item in 0..items {
                    let item_at = at + 54 + 34 + 6 * item;
                    let (kind, bytes) =
                        (self.read_number(item_at, 2)?, self.read_number(item_at + 2, 2)?);
                    first += bytes;
                    layers += match kind {
                        10 => 9,
                        11 | 13 => 1,
                        12 => 2,
                        14 => bytes,
                        _ => 0,
                    };
                }
                return Ok((layers > 0).then_some((first, layers)));
            }
            at += 54 + size;
        }
        Ok(None)
    }
}

/// As [`check_declared_sizes`], for a file of `length` bytes; leaves it anywhere.
fn check_sizes<R: Read + Seek>(file: &mut R, length: u64) -> io::Result<Result<(), &'static str>> {
    let mut numbers = NumberReader { file, length };
    let (minor, returns_at, format) =
        (numbers.read_number(25, 1)?, numbers.read_number(96, 4)?, numbers.read_number(104, 1)?);
    if returns_at > length {
        return Ok(Err("its returns begin beyond its end"));
    }
    if minor >= 4 {
        let (mut at, count) = (numbers.read_number(235, 8)?, numbers.read_number(243, 4)?);
        if count > length / 60 {
            return Ok(Err("it has more records than bytes"));
        }
        for _ in 0..count {
            let size = numbers.read_number(at.saturating_add(20), 8)?;
            match at
                .checked_add(60)
                .and_then(|at| at.checked_add(size))
                .filter(|end| *end <= length)
            {
                Some(end) => at = end,
                None => return Ok(Err("a record behind its returns is longer than the file")),
            }
        }
    }
    if format & 0x80 == 0 {
        return Ok(Ok(()));
    }
    let mut table_at = numbers.read_number(returns_at, 8)?;
    if table_at as i64 <= returns_at as i64 {
        table_at = numbers.read_number(length.saturating_sub(8), 8)?;
    }
    let chunks = numbers.read_number(table_at.saturating_add(4), 4)?;
    if chunks > u64::from(MAX_CHUNKS) || chunks > length || table_at > length {
        return Ok(Err("it has more chunks than bytes"));
    }
    let Some((first, layers)) = numbers.read_chunk_layout()? else { return Ok(Ok(())) };
    let mut at = returns_at + 8;
    while at < table_at {
        // A chunk: its first point record, a count, the size of each layer, then the layers.
        let sizes_at = at + first + 4;
        at = sizes_at + 4 * layers;
        for layer in 0..layers {
            at = at.saturating_add(numbers.read_number(sizes_at + 4 * layer, 4)?);
        }
        if at > table_at {
            return Ok(Err("a chunk is longer than the file"));
        }
    }
    Ok(Ok(()))
}
