//! Errors that all our file formats have in common, and the CRC-32 at their end. Each file has a
//! magic number, a version, lengths and a header.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};

/// CRC-32 as in zip and PNG (ISO-HDLC): polynomial 0x04C11DB7 reflected, initial value and final
/// xor 0xFFFFFFFF. All file formats and plans share this one instance, so its tables exist once.
pub static CRC32: Crc<u32, CrcTable> = Crc::<u32, CrcTable>::new(&CRC_32_ISO_HDLC);

/// Lookup tables of [`CRC32`]: one table (1 kB) on a board, sixteen (16 kB) on a desktop, with
/// which sixteen bytes are processed at once.
#[cfg(target_os = "none")]
type CrcTable = crc::Table<1>;
#[cfg(not(target_os = "none"))]
type CrcTable = crc::Table<16>;

/// Reason why bytes are not a valid file. Its `Display` text has at most 41 characters, so that it
/// fits into a STATUSTEXT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileError {
    /// The bytes end before the end of the header, or before the length that the header states.
    Truncated,
    /// The first eight bytes are not the expected magic number.
    Magic,
    /// The format version is not one that this code reads.
    Version(u16),
    /// The lengths and counts in the header contradict one another, or do not fit the number of
    /// bytes.
    Length,
    /// The CRC-32 at the end is not that of the bytes before it.
    Crc,
    /// The named header field has an unknown value, or is not a finite number inside its range.
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
