//! How far an upload is, and why it failed.

/// Why an upload came to nothing. What was there before is still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// An area would have to be erased, and the vehicle is armed.
    Armed,
    /// A roadmap waits for a restart, and the other slot is in use.
    Waiting,
    /// Pieces are missing.
    Incomplete,
    /// It is no such file, or damaged.
    Damaged,
    /// The flash failed.
    Flash,
}

/// How far an upload has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadState {
    /// Its area is being erased or marked.
    Opening,
    /// Pieces are taken.
    Taking,
    /// All was sent; it is written, read back and sealed.
    Closing,
    /// Over.
    Ended(Result<(), UploadError>),
}
