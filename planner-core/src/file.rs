//! What can be wrong with any of our files: a magic number, a version, lengths, a header and a
//! CRC-32 are common to all.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};

/// CRC-32 as in zip and PNG (ISO-HDLC): polynomial 0x04C11DB7 reflected, initial value and final
/// xor 0xFFFFFFFF. One set of tables serves every file and record.
pub static CRC32: Crc<u32, CrcTable> = Crc::<u32, CrcTable>::new(&CRC_32_ISO_HDLC);

/// Lookup tables: one (1 kB) on a board; sixteen (16 kB) on a desk, which process sixteen bytes at
/// once.
#[cfg(target_os = "none")]
type CrcTable = crc::Table<1>;
#[cfg(not(target_os = "none"))]
type CrcTable = crc::Table<16>;

/// Reason why bytes are not a whole file of any kind. Its text has at most 41 characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileError {
    /// The bytes end before the header, or before the length the header gives.
    Truncated,
    /// The first eight bytes are not the magic number.
    Magic,
    /// A version this code does not know.
    Version(u16),
    /// The lengths and counts in the header contradict one another.
    Length,
    /// The CRC-32 over the file does not match.
    Crc,
    /// The named header field is not known, or not a finite number inside its range.
    Header(&'static str),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated => write!(f, "it ends too early"),
            Self::Magic => write!(f, "it does not begin as one"),
            Self::Version(version) => write!(f, "its version {version} is not known here"),
            Self::Length => write!(f, "its lengths contradict one another"),
            Self::Crc => write!(f, "its CRC-32 does not match: it is damaged"),
            Self::Header(field) => write!(f, "its {field} is out of range"),
        }
    }
}
