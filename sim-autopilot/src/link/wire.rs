//! Reads MAVLink payloads field by field.
//!
//! The `mavlink` crate's types reject a whole message for one unknown enum value (such as a
//! COMMAND_LONG with an unknown command), but such a command must be answered UNSUPPORTED. So
//! fields are read at their byte offsets in wire order (sorted by size, extensions last). Zeros
//! that MAVLink 2 cut from the payload's end read as zero.

use crate::link::frame::CheckedFrame;

/// A payload padded with zeros to 255 bytes.
pub struct PayloadReader<'a>(&'a [u8; 255]);

impl<'a> PayloadReader<'a> {
    /// The payload of `frame`.
    pub fn new(frame: &'a CheckedFrame) -> Self {
        Self(frame.padded_payload())
    }

    /// `N` bytes from index `at` on.
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.0[at..at + N]);
        bytes
    }

    /// The byte at an offset.
    pub fn u8(&self, at: usize) -> u8 {
        self.0[at]
    }

    /// The little-endian `u16` at an offset.
    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    /// The little-endian `u32` at an offset.
    pub fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    /// The little-endian `i32` at an offset.
    pub fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.bytes(at))
    }

    /// The little-endian `i64` at an offset.
    pub fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.bytes(at))
    }

    /// The little-endian `u64` at an offset.
    pub fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    /// The little-endian `f32` at an offset.
    pub fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }

    /// A text of at most `N` bytes that ends at its first zero byte; `None` if it is not UTF-8.
    pub fn text<const N: usize>(&self, at: usize) -> Option<&str> {
        let bytes = &self.0[at..at + N];
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(N);
        core::str::from_utf8(&bytes[..end]).ok()
    }
}
