//! Limits on the size of files of heights.

/// Longest file of heights that is read, bytes.
pub const MAX_BYTES: u64 = 1 << 28;
/// Most cells of a file or a grid: 128 MB of heights.
pub const MAX_CELLS: usize = 1 << 25;
