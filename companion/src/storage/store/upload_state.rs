//! States of an upload, and reasons why one fails.

/// Why an upload failed. The earlier file stays as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// An area would have to be erased or programmed, and the vehicle is armed.
    Armed,
    /// No slot is free: one is in use, and the other has a newer file that waits for a restart; or
    /// the file of the upload before is still being stored.
    AwaitsRestart,
    /// Bytes of the file are missing.
    Incomplete,
    /// The file is of another kind than its name, has no bytes, or its CRC is wrong.
    Damaged,
    /// The flash failed to erase, program or read.
    Flash,
}

/// State of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadState {
    /// A slot for the upload is being erased or marked as used.
    Opening,
    /// Pieces of the file are accepted.
    Receiving,
    /// All pieces were sent; the file is being written, read back and sealed.
    Closing,
    /// The upload has ended: the file is stored, or an error says why not.
    Ended(Result<(), UploadError>),
}
