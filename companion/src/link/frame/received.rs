//! A received frame, and its message.

use mavlink::{MavlinkVersion, MessageData};

use super::encode::{Header, encode_raw, extra_crc};

/// A received frame with a correct CRC.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// MAVLink version of the frame, 1 or 2.
    pub version: MavlinkVersion,
    /// Sequence number that the sender gave it on its link.
    pub sequence: u8,
    /// System id of the sender.
    pub system: u8,
    /// Component id of the sender.
    pub component: u8,
    /// Message id.
    pub message_id: u32,
    /// Whether the frame has a signature; it is not verified.
    pub signed: bool,
    /// Length of the payload as received, bytes.
    pub(super) len: u8,
    /// The payload, padded with zeros beyond `len`.
    pub(super) payload: [u8; 255],
}

impl Frame {
    /// The payload as received: V2 senders cut trailing zeros.
    pub fn payload(&self) -> &[u8] {
        &self.payload[..usize::from(self.len)]
    }

    /// The payload filled up with zeros to 255 bytes: V2 senders cut trailing zeros.
    pub fn padded_payload(&self) -> &[u8; 255] {
        &self.payload
    }

    /// Writes the frame as V2 with its original sender and sequence number, to forward it, without
    /// its signature. Returns the bytes written, 0 if `out` is too small or the dialect does not
    /// know the message id.
    pub fn encode(&self, out: &mut [u8]) -> usize {
        let Some(extra) = extra_crc(self.message_id) else { return 0 };
        let header =
            Header { system: self.system, component: self.component, sequence: self.sequence };
        encode_raw(header, self.message_id, extra, self.payload(), out)
    }

    /// The message, if the frame has the message id of `M` and the crate knows all its enum values.
    pub fn decode<M: MessageData>(&self) -> Option<M> {
        if self.message_id != M::ID {
            return None;
        }
        M::deser(self.version, self.payload()).ok()
    }
}
