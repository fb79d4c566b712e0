//! How large files of heights may be.

/// Longest file read, bytes.
pub const MAX_BYTES: u64 = 1 << 28;
/// Most cells of a file or a grid: 128 MB of heights.
pub const MAX_CELLS: usize = 1 << 25;
