//! Reads recorded MAVLink: `.tlog` files, where big-endian microseconds precede each frame, and
//! plain streams of frames.

use std::path::{Path, PathBuf};

use crate::shared_data;

/// One record of a log: time, and the bytes of its frame, as many as its header states.
#[derive(Clone, Debug)]
pub struct LogRecord {
    /// Time stamp, microseconds; 0 in a plain stream.
    pub at_us: u64,
    /// Bytes of the frame; its checksum is not checked.
    pub bytes: Vec<u8>,
}

/// Paths of all logs of the shared data, sorted; empty, with a printed line, if these are absent.
pub fn all_logs() -> Vec<PathBuf> {
    let Some(folder) = shared_data("mavlink") else { return Vec::new() };
    let entries = std::fs::read_dir(folder).expect("a folder can be read");
    let mut logs: Vec<_> = entries.map(|entry| entry.expect("its entries too").path()).collect();
    logs.sort();
    logs
}

/// The records of a log, up to the first incomplete one.
///
/// # Panics
/// The file cannot be read.
pub fn read_log(path: &Path) -> Vec<LogRecord> {
    let file = std::fs::read(path).expect("a log can be read");
    let stamp = if path.extension().is_some_and(|extension| extension == "tlog") { 8 } else { 0 };
    let mut rest = file.as_slice();
    let mut records = Vec::new();
    while let Some(length) = rest.get(stamp..).and_then(frame_length)
        && let Some(bytes) = rest.get(stamp..stamp + length)
    {
        let at_us = rest[..stamp].iter().fold(0, |us, &byte| us << 8 | u64::from(byte));
        records.push(LogRecord { at_us, bytes: bytes.to_vec() });
        rest = &rest[stamp + length..];
    }
    records
}

/// Length of a frame by its header, MAVLink 1 or 2; `None` if it does not begin with a start byte.
fn frame_length(bytes: &[u8]) -> Option<usize> {
    match *bytes {
        [0xFE, payload, ..] => Some(8 + usize::from(payload)),
        [0xFD, payload, flags, ..] => {
            Some(12 + usize::from(payload) + if flags & 1 == 0 { 0 } else { 13 })
        }
        _ => None,
    }
}
