//! Protocol between host-sim and an emulated board in lock step: the board's time advances only as
//! far as the host grants it.
//!
//! The host sends a message: its length (`u32`, little endian, of the rest), then records. The
//! board executes the records in order and answers with records of which the last is
//! [`FromBoard::Waits`]. Between two messages the board is stopped: it waits in a semihosting read,
//! during which QEMU executes no instruction, and its timers and watchdog count instructions.
//!
//! ```text
//! host    Bytes(port, due) …, Bytes(port, due) …, Run(until)
//! board   Sent(port, at) …, Sent(port, at) …, Waits(now)
//! ```
//!
//! A board that starts, also after a reset, sends [`FromBoard::Started`] and waits for a message;
//! the unexecuted rest of the last message is dropped. [`ToBoard::Peek`], [`ToBoard::Poke`] and
//! [`ToBoard::Call`] act as a debug probe; the host sends them in a message without `Run`.
//!
//! A record is a header of 16 bytes, little endian (kind `u8`, port `u8`, payload length `u16`,
//! address `u32`, time or argument `u64`), followed by its payload. Times are microseconds since
//! the board's start.
#![no_std]
#![forbid(unsafe_code)]

/// The board runs in lock step if this is its whole command line (QEMU:
/// `-semihosting-config arg=…`).
pub const COMMAND_LINE: &str = "lock-step";
/// Bytes of a record's header.
pub const HEADER_LEN: usize = 16;
/// Longest message, bytes, without its length field.
pub const MAX_MESSAGE_LEN: usize = 256 << 10;

/// A record that the host sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToBoard {
    /// UART `port` receives the payload at time `due_us`.
    Bytes {
        /// 0 is the UART to the autopilot, 1 that to the radio.
        port: u8,
        /// Length of the payload, bytes.
        len: u16,
        /// Time at which the UART's driver receives the payload, microseconds since the board's
        /// start.
        due_us: u64,
    },
    /// Grants time: the board may run until `until_us`.
    Run {
        /// End of the grant, microseconds since the board's start.
        until_us: u64,
    },
    /// Asks for memory, which the board sends as [`FromBoard::Memory`].
    Peek {
        /// Address of the first byte.
        address: u32,
        /// Number of bytes.
        len: u16,
    },
    /// Writes the payload into memory.
    Poke {
        /// Address of the first byte.
        address: u32,
        /// Length of the payload, bytes.
        len: u16,
    },
    /// Calls a function with C calling convention, in an interrupt above every task.
    Call {
        /// Address of the function.
        address: u32,
        /// Argument of the call.
        argument: u32,
    },
}

/// A record that the board sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromBoard {
    /// The board has started.
    Started,
    /// UART `port` sent the payload at time `at_us`.
    Sent {
        /// 0 is the UART to the autopilot, 1 that to the radio.
        port: u8,
        /// Length of the payload, bytes.
        len: u16,
        /// Time at which the UART's driver took the bytes, microseconds since the board's start.
        at_us: u64,
    },
    /// The payload is the memory that [`ToBoard::Peek`] requested.
    Memory {
        /// Length of the payload, bytes.
        len: u16,
    },
    /// All records of the message are executed; the board waits for the next one.
    Waits {
        /// Time of the board, microseconds since its start.
        now_us: u64,
    },
}

/// Fields of a record's header: kind, port, payload length, address, time or argument.
type HeaderFields = (u8, u8, u16, u32, u64);

fn to_bytes((kind, port, len, address, time): HeaderFields) -> [u8; HEADER_LEN] {
    let mut head = [0; HEADER_LEN];
    (head[0], head[1]) = (kind, port);
    head[2..4].copy_from_slice(&len.to_le_bytes());
    head[4..8].copy_from_slice(&address.to_le_bytes());
    head[8..].copy_from_slice(&time.to_le_bytes());
    head
}

fn from_bytes(head: &[u8; HEADER_LEN]) -> HeaderFields {
    let [kind, port, l0, l1, a0, a1, a2, a3, time @ ..] = *head;
    (
        kind,
        port,
        u16::from_le_bytes([l0, l1]),
        u32::from_le_bytes([a0, a1, a2, a3]),
        u64::from_le_bytes(time),
    )
}

impl ToBoard {
    /// Encodes the record's header.
    pub fn to_bytes(self) -> [u8; HEADER_LEN] {
        to_bytes(match self {
            Self::Bytes { port, len, due_us } => (0, port, len, 0, due_us),
            Self::Run { until_us } => (1, 0, 0, 0, until_us),
            Self::Peek { address, len } => (2, 0, len, address, 0),
            Self::Poke { address, len } => (3, 0, len, address, 0),
            Self::Call { address, argument } => (4, 0, 0, address, u64::from(argument)),
        })
    }

    /// Decodes a record's header; `None` for an unknown kind.
    pub fn from_bytes(head: &[u8; HEADER_LEN]) -> Option<Self> {
        let (kind, port, len, address, time) = from_bytes(head);
        Some(match kind {
            0 => Self::Bytes { port, len, due_us: time },
            1 => Self::Run { until_us: time },
            2 => Self::Peek { address, len },
            3 => Self::Poke { address, len },
            4 => Self::Call { address, argument: time as u32 },
            _ => return None,
        })
    }

    /// Bytes of payload that follow the header.
    pub fn payload_len(self) -> usize {
        match self {
            Self::Bytes { len, .. } | Self::Poke { len, .. } => len.into(),
            Self::Run { .. } | Self::Peek { .. } | Self::Call { .. } => 0,
        }
    }
}

impl FromBoard {
    /// Encodes the record's header.
    pub fn to_bytes(self) -> [u8; HEADER_LEN] {
        to_bytes(match self {
            Self::Started => (0, 0, 0, 0, 0),
            Self::Sent { port, len, at_us } => (1, port, len, 0, at_us),
            Self::Memory { len } => (2, 0, len, 0, 0),
            Self::Waits { now_us } => (3, 0, 0, 0, now_us),
        })
    }

    /// Decodes a record's header; `None` for an unknown kind.
    pub fn from_bytes(head: &[u8; HEADER_LEN]) -> Option<Self> {
        let (kind, port, len, _, time) = from_bytes(head);
        Some(match kind {
            0 => Self::Started,
            1 => Self::Sent { port, len, at_us: time },
            2 => Self::Memory { len },
            3 => Self::Waits { now_us: time },
            _ => return None,
        })
    }

    /// Bytes of payload that follow the header.
    pub fn payload_len(self) -> usize {
        match self {
            Self::Sent { len, .. } | Self::Memory { len } => len.into(),
            Self::Started | Self::Waits { .. } => 0,
        }
    }
}

#[cfg(test)]
mod tests;
