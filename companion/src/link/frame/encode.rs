//! Frames from messages, and the CRC of frames.

use crc::{CRC_16_MCRF4XX, Crc, Table};
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message, MessageData};

/// Start byte of a MAVLink 2 frame.
pub(super) const V2_START: u8 = 0xFD;
/// A deprecated message, the only one of the dialect whose CRC_EXTRA is 0.
const COMPONENT_INFORMATION: u32 = 395;

/// Lookup tables of a frame's CRC: one (512 B) on a board, where sixteen took 8.2 kB more flash and
/// were no faster in a frame; sixteen (8 kB) on a desktop, with which sixteen bytes are processed
/// at once: among many simulated vehicles the CRC is most of a crowded radio's work, and the
/// `mavlink` crate computes it byte by byte.
#[cfg(target_os = "none")]
type CrcTable = Table<1>;
#[cfg(not(target_os = "none"))]
type CrcTable = Table<16>;

/// CRC-16/MCRF4XX of a frame without its start byte, then of its message's CRC_EXTRA. Inlined
/// into everything that sends, it would take 1.6 kB.
#[inline(never)]
pub(super) fn calculate_crc(frame: &[u8], extra_crc: u8) -> u16 {
    const CRC: Crc<u16, CrcTable> = Crc::<u16, CrcTable>::new(&CRC_16_MCRF4XX);
    let mut digest = CRC.digest();
    digest.update(frame);
    digest.update(&[extra_crc]);
    digest.finalize()
}

/// CRC_EXTRA of a message id; `None` if the dialect does not know the id. The crate returns 0 for
/// unknown ids, which is also the CRC_EXTRA of COMPONENT_INFORMATION.
pub fn extra_crc(message_id: u32) -> Option<u8> {
    let extra = MavMessage::extra_crc(message_id);
    (extra != 0 || message_id == COMPONENT_INFORMATION).then_some(extra)
}

/// Sender and sequence number of a frame to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// System id of the sender.
    pub system: u8,
    /// Component id of the sender.
    pub component: u8,
    /// Sequence number of the frame on its link.
    pub sequence: u8,
}

/// Writes a message as a V2 frame without trailing zeros. Returns the bytes written, 0 if `out` is
/// too small; [`MAX_FRAME_LEN`](super::MAX_FRAME_LEN) is always enough.
pub fn encode<M: MessageData>(header: Header, message: &M, out: &mut [u8]) -> usize {
    let mut payload = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut payload);
    encode_raw(header, M::ID, M::EXTRA_CRC, &payload[..len], out)
}

/// As [`encode`], for any message of the dialect. It links every message's encoder, so it is not
/// for boards.
pub fn encode_message(header: Header, message: &MavMessage, out: &mut [u8]) -> usize {
    let mut payload = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut payload);
    let id = message.message_id();
    encode_raw(header, id, MavMessage::extra_crc(id), &payload[..len], out)
}

/// As [`encode`], for a payload of at most 255 bytes that the caller has encoded, since the crate's
/// types cannot hold it (such as TUNNEL's private payload types). Trailing zeros are cut.
pub fn encode_raw(
    header: Header,
    message_id: u32,
    extra_crc: u8,
    payload: &[u8],
    out: &mut [u8],
) -> usize {
    let used = payload.iter().rposition(|&b| b != 0).map_or(1, |last| last + 1).min(payload.len());
    let total = 12 + used;
    if used > 255 || out.len() < total {
        return 0;
    }
    let id = message_id.to_le_bytes();
    let Header { system, component, sequence } = header;
    out[..10].copy_from_slice(&[
        V2_START, used as u8, 0, 0, sequence, system, component, id[0], id[1], id[2],
    ]);
    out[10..10 + used].copy_from_slice(&payload[..used]);
    let crc = calculate_crc(&out[1..10 + used], extra_crc);
    out[10 + used..total].copy_from_slice(&crc.to_le_bytes());
    total
}
