//! Replies to MAVLink FTP requests: the packets of ACK and NAK.

use super::packet::{ACK, FtpRequest, HEADER_LEN, MAX_DATA, NAK, NakError};
use super::{Ftp, Reply};

impl Ftp {
    /// Sets ACK or NAK as the reply to `request`, and remembers `result`: a repetition of the
    /// request is answered alike, not executed again.
    pub(super) fn reply_and_remember(
        &mut self,
        request: &FtpRequest,
        result: Result<(), NakError>,
    ) {
        self.duplicates.remember(request, result, self.now);
        self.respond(request, result);
    }

    /// Answers with an ACK without data, or with a NAK.
    pub(super) fn respond(&mut self, request: &FtpRequest, result: Result<(), NakError>) {
        match result {
            Ok(()) => self.ack(request, &[]),
            Err(error) => self.nak(request, error),
        }
    }

    /// Answers with an ACK and these data.
    pub(super) fn ack(&mut self, request: &FtpRequest, data: &[u8]) {
        self.set_reply(request, ACK, 0, data);
    }

    /// Answers with a NAK.
    pub(super) fn nak(&mut self, request: &FtpRequest, error: NakError) {
        let code = match error {
            NakError::Errno(errno) => return self.set_reply(request, NAK, 0, &[2, errno]),
            NakError::InvalidSize => 3,
            NakError::InvalidSession => 4,
            NakError::NoSessionsAvailable => 5,
            NakError::EndOfFile => 6,
            NakError::UnknownCommand => 7,
            NakError::Protected => 9,
            NakError::NotFound => 10,
        };
        self.set_reply(request, NAK, 0, &[code]);
    }

    /// Sets the reply to `request` that is sent next: `opcode` is ACK or NAK.
    pub(super) fn set_reply(
        &mut self,
        request: &FtpRequest,
        opcode: u8,
        burst_complete: u8,
        data: &[u8],
    ) {
        let data = &data[..data.len().min(MAX_DATA)];
        let mut packet = [0; HEADER_LEN + MAX_DATA];
        packet[..2].copy_from_slice(&request.sequence.wrapping_add(1).to_le_bytes());
        packet[2..8].copy_from_slice(&[
            request.session,
            opcode,
            data.len() as u8,
            request.opcode,
            burst_complete,
            0,
        ]);
        packet[8..12].copy_from_slice(&request.offset.to_le_bytes());
        packet[HEADER_LEN..HEADER_LEN + data.len()].copy_from_slice(data);
        self.reply = Some(Reply { link: request.link, client: request.client, packet });
    }
}
