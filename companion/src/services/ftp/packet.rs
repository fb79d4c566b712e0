//! The FTP packet in a FILE_TRANSFER_PROTOCOL: a header of 12 bytes (sequence number u16, session,
//! opcode, size, opcode replied to, burst complete, 0, offset u32), then at most 239 bytes of data.

use crate::link::frame::Frame;
use crate::link::severity::Severity;
use crate::storage::store::{File, UploadError, crc32};

/// Most bytes of data in an FTP packet.
pub const MAX_DATA: usize = 239;

/// Bytes of an FTP packet's header.
pub const HEADER_LEN: usize = 12;
/// Opcode of a positive reply.
pub const ACK: u8 = 128;
/// Opcode of a negative reply.
pub const NAK: u8 = 129;

/// Opcodes of requests, as MAVLink numbers them.
pub mod op {
    /// `kCmdNone`: no operation, always acknowledged.
    pub const NONE: u8 = 0;
    pub const TERMINATE: u8 = 1;
    pub const RESET: u8 = 2;
    pub const LIST: u8 = 3;
    pub const OPEN_READ: u8 = 4;
    pub const READ: u8 = 5;
    pub const CREATE: u8 = 6;
    pub const WRITE: u8 = 7;
    pub const REMOVE: u8 = 8;
    pub const MAKE_DIRECTORY: u8 = 9;
    pub const REMOVE_DIRECTORY: u8 = 10;
    pub const OPEN_WRITE: u8 = 11;
    pub const TRUNCATE: u8 = 12;
    pub const RENAME: u8 = 13;
    pub const CRC32: u8 = 14;
    pub const BURST_READ: u8 = 15;
}

/// Error of a NAK, as MAVLink numbers them; [`NakError::Errno`] has an `errno` in addition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NakError {
    /// `FailErrno`, with this `errno`.
    Errno(u8),
    InvalidSize,
    InvalidSession,
    NoSessionsAvailable,
    EndOfFile,
    UnknownCommand,
    Protected,
    NotFound,
}

/// `errno` of an input or output error.
pub const EIO: u8 = 5;
/// `errno` of a file that is too large.
pub const EFBIG: u8 = 27;

impl From<UploadError> for NakError {
    fn from(why: UploadError) -> Self {
        match why {
            UploadError::Armed | UploadError::AwaitsRestart => Self::Protected,
            UploadError::Incomplete | UploadError::Damaged | UploadError::Flash => Self::Errno(EIO),
        }
    }
}

/// A STATUSTEXT for the operator: its severity, and the text.
pub type Text = (Severity, &'static str);

/// All STATUSTEXTs of the FTP server. A field is the file with the heights of the ground.
pub const FTP_TEXTS: [Text; 9] = [
    (Severity::Info, "Roadmap stored: used from the next start"),
    (Severity::Info, "Mission stored: used from the next start"),
    (Severity::Info, "File removed from the next start on"),
    (Severity::Warning, "Upload refused: armed"),
    (Severity::Warning, "Upload refused: restart to use the last one"),
    (Severity::Warning, "Upload incomplete: old file kept"),
    (Severity::Warning, "Upload is no such file or damaged: old file kept"),
    (Severity::Warning, "Flash failed: old file kept"),
    (Severity::Info, "Field stored: used from the next start"),
];

/// STATUSTEXT after a file was removed.
pub const FILE_REMOVED: Text = FTP_TEXTS[2];

/// STATUSTEXT after an upload has ended with this result.
pub fn upload_text(file: File, result: Result<(), UploadError>) -> Text {
    FTP_TEXTS[match (file, result) {
        (File::Roadmap, Ok(())) => 0,
        (File::Field, Ok(())) => 8,
        (File::Mission, Ok(())) => 1,
        (_, Err(UploadError::Armed)) => 3,
        (_, Err(UploadError::AwaitsRestart)) => 4,
        (_, Err(UploadError::Incomplete)) => 5,
        (_, Err(UploadError::Damaged)) => 6,
        (_, Err(UploadError::Flash)) => 7,
    }]
}

/// A client's request, decoded.
#[derive(Clone, Copy, Debug)]
pub struct FtpRequest {
    /// Index of the link on which the request came.
    pub link: usize,
    /// System id and component id.
    pub client: (u8, u8),
    /// FTP sequence number.
    pub sequence: u16,
    /// Id of the session.
    pub session: u8,
    /// Opcode, as MAVLink numbers them.
    pub opcode: u8,
    /// Number of bytes of `data`, or that are to be read.
    pub size: u8,
    /// Offset in the file, bytes.
    pub offset: u32,
    /// The data; beyond `size` of no meaning.
    pub data: [u8; MAX_DATA],
}

impl FtpRequest {
    /// Decodes a FILE_TRANSFER_PROTOCOL frame that came on this link.
    pub fn from_frame(link: usize, frame: &Frame) -> Self {
        let p = &frame.padded_payload()[3..];
        let mut data = [0; MAX_DATA];
        data.copy_from_slice(&p[HEADER_LEN..HEADER_LEN + MAX_DATA]);
        Self {
            link,
            client: (frame.system, frame.component),
            sequence: u16::from_le_bytes([p[0], p[1]]),
            session: p[2],
            opcode: p[3],
            size: p[4],
            offset: u32::from_le_bytes([p[8], p[9], p[10], p[11]]),
            data,
        }
    }

    /// Whether the other request is a repetition of this one, or this one of the other.
    pub fn is_same_request(&self, other: &Self) -> bool {
        request_fingerprint(self) == request_fingerprint(other)
    }

    /// The first `size` bytes of the data; all of it if `size` is too large.
    pub fn bytes(&self) -> &[u8] {
        &self.data[..usize::from(self.size).min(MAX_DATA)]
    }

    /// The path that the request names, up to a zero byte, without a leading `.` or slashes.
    pub fn path(&self) -> &[u8] {
        let path = self.bytes().split(|b| *b == 0).next().unwrap_or_default();
        let path = path
            .strip_prefix(b".")
            .filter(|rest| rest.first().is_none_or(|b| *b == b'/'))
            .unwrap_or(path);
        let start = path.iter().position(|b| *b != b'/').unwrap_or(path.len());
        &path[start..]
    }

    /// The file that the request names; `None` if there is no such file.
    pub fn requested_file(&self) -> Option<File> {
        File::ALL.into_iter().find(|file| file.name().as_bytes() == self.path())
    }
}

/// Whether the request opens a session.
pub fn opens_session(request: &FtpRequest) -> bool {
    matches!(request.opcode, op::OPEN_READ | op::CREATE | op::OPEN_WRITE)
}

/// The fields by which a repeated request is recognised. Two programs under one client's ids may
/// both begin at the same sequence number: session and data can distinguish them.
pub type RequestFingerprint = ((u8, u8), u16, (u8, u8), u32, u32);

/// What distinguishes a request from others: client, sequence number, session and opcode, offset,
/// CRC-32 of the data.
pub fn request_fingerprint(request: &FtpRequest) -> RequestFingerprint {
    let FtpRequest { client, sequence, session, opcode, offset, .. } = *request;
    (client, sequence, (session, opcode), offset, crc32(request.bytes()))
}

/// Bytes of data that each packet of a read or burst is to have; size 0 means the most possible.
pub fn chunk_len(request: &FtpRequest) -> usize {
    match usize::from(request.size) {
        0 => MAX_DATA,
        size => size.min(MAX_DATA),
    }
}

/// The number in decimal digits, written to the end of `digits`.
pub fn format_decimal(mut number: u32, digits: &mut [u8; 10]) -> &[u8] {
    let mut at = digits.len();
    loop {
        at -= 1;
        digits[at] = b'0' + (number % 10) as u8;
        number /= 10;
        if number == 0 {
            return &digits[at..];
        }
    }
}
