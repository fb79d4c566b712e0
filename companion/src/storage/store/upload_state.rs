//! How far an upload is, and why it failed.

/// Reason why an upload failed. The earlier file is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// An area would have to be erased, and the vehicle is armed.
    Armed,
    /// A roadmap waits for a restart, and the other slot is in use.
    Waiting,
    /// Pieces are missing.
    Incomplete,
    /// The file is of another kind, or damaged.
    Damaged,
    /// The flash failed.
    Flash,
}

/// Progress of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadState {
    /// The upload's area is being erased or marked.
    Opening,
    /// Pieces are taken.
    Taking,
    /// All was sent; it is written, read back and sealed.
    Closing,
    /// Over.
    Ended(Result<(), UploadError>),
}
