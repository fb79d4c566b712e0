//! What the desk and an emulated board say to each other in lock step: the board's time advances
//! only as the desk grants it.
//!
//! The desk sends a message: its length (`u32`, little endian, of what follows), then records. The
//! board does what the records say, in order, and answers with records of which the last is
//! [`FromBoard::Waits`]. Between two messages the board stands still: it waits in one read of its
//! host, which takes none of its instructions, and its timers and its watchdog count instructions.
//!
//! ```text
//! desk    Bytes(port, due) …, Bytes(port, due) …, Run(until)
//! board   Sent(port, at) …, Sent(port, at) …, Waits(now)
//! ```
//!
//! A board that starts, for whatever reason, says [`FromBoard::Started`] and waits for a message;
//! what it had left of the message before is dropped. [`ToBoard::Peek`], [`ToBoard::Poke`] and
//! [`ToBoard::Call`] are its debug probe; they travel in a message without `Run`.
//!
//! A record is 16 bytes, little endian (kind `u8`, port `u8`, length `u16`, address `u32`, time or
//! argument `u64`), and the bytes that its length counts. Times are microseconds since the board's
//! start.
#![no_std]
#![forbid(unsafe_code)]

/// The board runs in lock step if this is its whole command line (QEMU:
/// `-semihosting-config arg=…`).
pub const COMMAND_LINE: &str = "lock-step";
/// Bytes of a record before those that it carries.
pub const HEAD: usize = 16;
/// Longest message without its length.
pub const LONGEST: usize = 256 << 10;

/// A record from the desk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToBoard {
    /// A port receives the bytes that follow.
    Bytes {
        /// 0 to the autopilot, 1 to the radio.
        port: u8,
        /// How many.
        len: u16,
        /// When.
        due_us: u64,
    },
    /// The board's time may pass.
    Run {
        /// Up to there.
        until_us: u64,
    },
    /// Answer with [`FromBoard::Memory`].
    Peek {
        /// Where.
        address: u32,
        /// How many bytes.
        len: u16,
    },
    /// Put the bytes that follow into memory.
    Poke {
        /// Where.
        address: u32,
        /// How many.
        len: u16,
    },
    /// Call a function of C's convention, above every task.
    Call {
        /// Address of the function.
        address: u32,
        /// Argument of the call.
        argument: u32,
    },
}

/// A record from the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromBoard {
    /// It starts.
    Started,
    /// A port sent the bytes that follow.
    Sent {
        /// As in [`ToBoard::Bytes`].
        port: u8,
        /// How many.
        len: u16,
        /// When its driver took them.
        at_us: u64,
    },
    /// The bytes that follow are in its memory.
    Memory {
        /// How many.
        len: u16,
    },
    /// The message is done.
    Waits {
        /// The board's time.
        now_us: u64,
    },
}

/// Kind, port, length, address, time.
type HeaderFields = (u8, u8, u16, u32, u64);

fn to_bytes((kind, port, len, address, time): HeaderFields) -> [u8; HEAD] {
    let mut head = [0; HEAD];
    (head[0], head[1]) = (kind, port);
    head[2..4].copy_from_slice(&len.to_le_bytes());
    head[4..8].copy_from_slice(&address.to_le_bytes());
    head[8..].copy_from_slice(&time.to_le_bytes());
    head
}

fn from_bytes(head: &[u8; HEAD]) -> HeaderFields {
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
    /// The bytes of the record header.
    pub fn to_bytes(self) -> [u8; HEAD] {
        to_bytes(match self {
            Self::Bytes { port, len, due_us } => (0, port, len, 0, due_us),
            Self::Run { until_us } => (1, 0, 0, 0, until_us),
            Self::Peek { address, len } => (2, 0, len, address, 0),
            Self::Poke { address, len } => (3, 0, len, address, 0),
            Self::Call { address, argument } => (4, 0, 0, address, u64::from(argument)),
        })
    }

    /// The record that these bytes encode; `None` for bytes of no record.
    pub fn from_bytes(head: &[u8; HEAD]) -> Option<Self> {
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

    /// Number of payload bytes that follow the header.
    pub fn payload_len(self) -> usize {
        match self {
            Self::Bytes { len, .. } | Self::Poke { len, .. } => len.into(),
            Self::Run { .. } | Self::Peek { .. } | Self::Call { .. } => 0,
        }
    }
}

impl FromBoard {
    /// The bytes of the record header.
    pub fn to_bytes(self) -> [u8; HEAD] {
        to_bytes(match self {
            Self::Started => (0, 0, 0, 0, 0),
            Self::Sent { port, len, at_us } => (1, port, len, 0, at_us),
            Self::Memory { len } => (2, 0, len, 0, 0),
            Self::Waits { now_us } => (3, 0, 0, 0, now_us),
        })
    }

    /// The record that these bytes encode; `None` for bytes of no record.
    pub fn from_bytes(head: &[u8; HEAD]) -> Option<Self> {
        let (kind, port, len, _, time) = from_bytes(head);
        Some(match kind {
            0 => Self::Started,
            1 => Self::Sent { port, len, at_us: time },
            2 => Self::Memory { len },
            3 => Self::Waits { now_us: time },
            _ => return None,
        })
    }

    /// Number of payload bytes that follow the header.
    pub fn payload_len(self) -> usize {
        match self {
            Self::Sent { len, .. } | Self::Memory { len } => len.into(),
            Self::Started | Self::Waits { .. } => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_arrive_as_they_were_sent() {
        let (port, len, address) = (1, 513, 0x6000_0001);
        for record in [
            ToBoard::Bytes { port, len, due_us: 1 << 40 },
            ToBoard::Run { until_us: 3 << 33 },
            ToBoard::Peek { address, len },
            ToBoard::Poke { address, len },
            ToBoard::Call { address, argument: 7 },
        ] {
            assert_eq!(ToBoard::from_bytes(&record.to_bytes()), Some(record));
        }
        for record in [
            FromBoard::Started,
            FromBoard::Sent { port, len, at_us: 5 << 34 },
            FromBoard::Memory { len },
            FromBoard::Waits { now_us: u64::MAX },
        ] {
            assert_eq!(FromBoard::from_bytes(&record.to_bytes()), Some(record));
        }
        assert_eq!(ToBoard::from_bytes(&[9; HEAD]), None);
        assert_eq!(FromBoard::from_bytes(&[9; HEAD]), None);
    }
}
