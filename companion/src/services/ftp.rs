//! MAVLink FTP server for `roadmap.bin` or `field.bin`, and `mission.bin`: list, read, write,
//! remove, CRC-32.
//!
//! Source: MAVLink guide, "File Transfer Protocol"; PX4, pymavlink's `mavftp` and MAVSDK for what
//! clients rely on: a reply has the request's sequence number plus one, its session and its offset;
//! the client chooses the session id (`mavftp` writes to it before the reply to its open); CRC-32
//! starts at 0 and is not inverted; the last packet of a burst is marked.
//!
//! Requests may be lost, repeated and overtaken. Requests that may safely be executed twice (read,
//! list, write of the same bytes at the same offset) are. The others (open, close, remove, reset)
//! are remembered, and a repetition only gets the same answer (`ftp/duplicates.rs`). A client that
//! opens its session again before it wrote keeps that session. A request that cannot be executed
//! now is not answered: the client repeats it. There is one session at a time, and one request at a
//! time; others wait in a short queue. A reply that needs the flash is sent when the flash is done.

mod burst;
mod duplicates;
mod packet;
mod reply;

use heapless::Deque;

use self::burst::{FtpBurst, request_of_next_packet};
use self::duplicates::DuplicateDetection;
#[cfg(test)]
pub(crate) use self::packet::FTP_TEXTS;
pub use self::packet::MAX_DATA;
use self::packet::{
    ACK, EFBIG, EIO, FILE_REMOVED, FtpRequest, HEADER_LEN, NakError, Text, chunk_len,
    format_decimal, op, opens_session, upload_text,
};
use crate::link::frame::Frame;
use crate::storage::store::reassembly::PieceOutcome;
use crate::storage::store::{ErasePermission, File, ReadOutcome, Store, UploadError, UploadState};
use crate::time::{Duration, Instant};

/// Message id of FILE_TRANSFER_PROTOCOL.
pub const MESSAGE_ID: u32 = 110;
/// Bytes of its payload: target network, system, component, then the FTP packet.
pub const PAYLOAD_LEN: usize = 254;

/// Whether a FILE_TRANSFER_PROTOCOL is a request to begin an upload or to remove a file.
pub(crate) fn changes_files(padded: &[u8; 255]) -> bool {
    matches!(padded[6], op::CREATE | op::OPEN_WRITE | op::REMOVE)
}

/// Most requests in the queue; `mavftp` has five under way.
const MAX_QUEUED_REQUESTS: usize = 6;
/// Time without a request after which another client may take over the session.
const SESSION_IDLE_AFTER: Duration = Duration::from_secs(10);

/// A reply that waits to be sent to the client.
#[derive(Clone, Copy, Debug)]
struct Reply {
    /// Index of the link on which the request came.
    link: usize,
    /// System id and component id of the client.
    client: (u8, u8),
    packet: [u8; HEADER_LEN + MAX_DATA],
}

/// What the client does with the file of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    Read,
    Write,
}

/// The open session: one file, used by one client (system id and component id).
#[derive(Clone, Copy, Debug)]
struct Session {
    id: u8,
    client: (u8, u8),
    file: File,
    access: Access,
    /// Whether no byte was written to the file yet.
    nothing_written: bool,
    /// The request that opened the session.
    opened_by: FtpRequest,
    last_used_at: Instant,
}

/// Operation that the server executes; the flag of `Read` and `Crc`: whether the store has accepted
/// the read.
#[derive(Clone, Copy, Debug)]
enum FtpOperation {
    Nothing,
    Read(FtpRequest, bool),
    Crc(FtpRequest, bool),
    /// Waits until the store has opened an upload.
    Open(FtpRequest),
    /// Waits until the store has ended the upload.
    Close(FtpRequest),
}

/// The FTP server. 4 kB, most of it queued requests.
#[derive(Clone, Debug)]
pub struct Ftp {
    queue: Deque<FtpRequest, MAX_QUEUED_REQUESTS>,
    reply: Option<Reply>,
    session: Option<Session>,
    operation: FtpOperation,
    burst: Option<FtpBurst>,
    duplicates: DuplicateDetection,
    text: Option<Text>,
    now: Instant,
}

impl Default for Ftp {
    fn default() -> Self {
        Self {
            queue: Deque::new(),
            reply: None,
            session: None,
            operation: FtpOperation::Nothing,
            burst: None,
            duplicates: DuplicateDetection::default(),
            text: None,
            now: Instant::ZERO,
        }
    }
}

impl Ftp {
    /// Queues a request. One that is in the queue or being executed is dropped. So is one that
    /// finds the queue full: the client repeats it.
    pub fn queue_request(&mut self, link: usize, now: Instant, frame: &Frame) {
        self.now = now;
        let request = FtpRequest::from_frame(link, frame);
        let same = |held: &FtpRequest| held.is_same_request(&request);
        let at_work = match &self.operation {
            FtpOperation::Nothing => false,
            FtpOperation::Read(held, _)
            | FtpOperation::Crc(held, _)
            | FtpOperation::Open(held)
            | FtpOperation::Close(held) => same(held),
        };
        if !at_work && !self.queue.iter().any(same) {
            // A full queue drops the request: the client sends it again.
            let _ = self.queue.push_back(request);
        }
    }

    /// The reply to be sent on a link: the whole payload of a FILE_TRANSFER_PROTOCOL.
    pub fn poll_reply(&mut self, link: usize) -> Option<[u8; PAYLOAD_LEN]> {
        let Reply { client, packet, .. } = self.reply.take_if(|reply| reply.link == link)?;
        let mut payload = [0; PAYLOAD_LEN];
        (payload[1], payload[2]) = client;
        payload[3..].copy_from_slice(&packet);
        Some(payload)
    }

    /// The STATUSTEXT for the operator, with its severity; each is returned once.
    pub fn take_text(&mut self) -> Option<Text> {
        self.text.take()
    }

    /// Executes queued requests until a reply is to be sent, or the current one waits for the
    /// flash.
    pub fn continue_work(&mut self, store: &mut Store, now: Instant, erasing: ErasePermission) {
        self.now = now;
        while self.reply.is_none() {
            if !matches!(self.operation, FtpOperation::Nothing) {
                self.continue_operation(store);
                return;
            }
            if let Some(request) = self.queue.pop_front() {
                self.begin_request(&request, store, erasing);
            } else {
                self.send_next_burst_packet(store);
                return;
            }
        }
    }

    /// Handles the store's outcome of a read or CRC that the current operation requested.
    pub fn handle_read_outcome(&mut self, answer: ReadOutcome<'_>) {
        match (core::mem::replace(&mut self.operation, FtpOperation::Nothing), answer) {
            (FtpOperation::Read(request, true), ReadOutcome::Bytes(bytes)) => match self.burst {
                Some(stream) if stream.first_request().is_same_request(&request) => {
                    let due = request_of_next_packet(&request, Some(&stream));
                    self.burst = stream.advanced_by(bytes.len());
                    self.set_reply(&due, ACK, u8::from(self.burst.is_none()), bytes);
                }
                _ => self.ack(&request, bytes),
            },
            (FtpOperation::Crc(request, true), ReadOutcome::Crc(sum)) => {
                self.ack(&request, &sum.to_le_bytes());
            }
            (FtpOperation::Read(request, true) | FtpOperation::Crc(request, true), _) => {
                let due = request_of_next_packet(&request, self.burst.take().as_ref());
                self.nak(&due, NakError::Errno(EIO));
            }
            (other, _) => self.operation = other,
        }
    }

    /// Continues the current operation: requests its read from the store, or checks whether its
    /// upload is open or ended.
    fn continue_operation(&mut self, store: &mut Store) {
        match &mut self.operation {
            FtpOperation::Nothing | FtpOperation::Read(_, true) | FtpOperation::Crc(_, true) => {}
            FtpOperation::Read(request, asked) => {
                let due = request_of_next_packet(request, self.burst.as_ref());
                let file = self.session.map(|session| session.file);
                let within =
                    |file: &File| store.file_size(*file).is_some_and(|size| due.offset < size);
                if let Some(file) = file.filter(within) {
                    *asked = store.request_read(file, due.offset, chunk_len(&due));
                } else {
                    (self.operation, self.burst) = (FtpOperation::Nothing, None);
                    self.nak(&due, NakError::EndOfFile);
                }
            }
            FtpOperation::Crc(request, asked) => {
                match request.requested_file().filter(|file| store.file_size(*file).is_some()) {
                    Some(file) => *asked = store.request_crc(file, 0),
                    None => {
                        let request = *request;
                        self.operation = FtpOperation::Nothing;
                        self.nak(&request, NakError::NotFound);
                    }
                }
            }
            FtpOperation::Open(request) => {
                let request = *request;
                match store.upload_state() {
                    Some(UploadState::Opening) => {}
                    Some(UploadState::Ended(Err(why))) => self.end_upload(&request, Err(why)),
                    _ => {
                        self.operation = FtpOperation::Nothing;
                        // The erasure for this session may have taken longer than
                        // [`SESSION_IDLE_AFTER`].
                        self.session = self
                            .session
                            .map(|session| Session { last_used_at: self.now, ..session });
                        self.reply_and_remember(&request, Ok(()));
                    }
                }
            }
            FtpOperation::Close(request) => {
                let request = *request;
                match store.upload_state() {
                    Some(UploadState::Ended(result)) => self.end_upload(&request, result),
                    Some(_) => {}
                    None => self.end_upload(&request, Err(UploadError::Incomplete)),
                }
            }
        }
    }

    /// Ends the operation and the session of an upload, answers its request, and keeps a text for
    /// the operator.
    fn end_upload(&mut self, request: &FtpRequest, result: Result<(), UploadError>) {
        self.operation = FtpOperation::Nothing;
        if let Some(session) = self.session.take() {
            self.text = Some(upload_text(session.file, result));
        }
        self.reply_and_remember(request, result.map_err(NakError::from));
    }

    /// Answers a request, or begins the operation that answers it; a repetition gets the old
    /// answer.
    fn begin_request(&mut self, request: &FtpRequest, store: &mut Store, erasing: ErasePermission) {
        if let Some(done) = self.duplicates.previous_outcome(request, self.now) {
            if !opens_session(request) || done.is_err() {
                self.respond(request, done);
            } else if let Some(session) =
                self.session.filter(|session| session.opened_by.is_same_request(request))
            {
                // The first reply was lost. If another file was opened since, that one stays open.
                self.repeat_open_ack(request, &session, store);
            }
            return;
        }
        if opens_session(request) {
            self.duplicates.forget_closed(request.client);
        }
        if matches!(
            request.opcode,
            op::TERMINATE | op::RESET | op::BURST_READ | op::READ | op::OPEN_READ
        ) {
            self.burst = None;
        }
        match request.opcode {
            op::NONE => self.ack(request, &[]),
            op::TERMINATE => match self.session_of(request) {
                Ok(Session { access: Access::Write, .. }) => {
                    store.finish_upload();
                    self.operation = FtpOperation::Close(*request);
                }
                Ok(_) => {
                    self.session = None;
                    self.reply_and_remember(request, Ok(()));
                }
                Err(no) => {
                    let closed = self.duplicates.previous_close_outcome(request, self.now);
                    self.respond(request, closed.unwrap_or(Err(no)));
                }
            },
            op::RESET => {
                if self.session.is_some_and(|session| {
                    session.client == request.client || self.is_idle(&session)
                }) {
                    self.drop_session(store);
                }
                self.reply_and_remember(request, Ok(()));
            }
            op::LIST => self.handle_list(request, store),
            op::OPEN_READ => {
                match request.requested_file().and_then(|file| Some((file, store.file_size(file)?)))
                {
                    None => self.nak(request, NakError::NotFound),
                    Some((file, size)) => {
                        if self.open_session(request, file, Access::Read, store) {
                            self.duplicates.remember(request, Ok(()), self.now);
                            self.ack(request, &size.to_le_bytes());
                        }
                    }
                }
            }
            op::READ | op::BURST_READ => match self.session_of(request) {
                Ok(Session { access: Access::Write, .. }) => {
                    self.nak(request, NakError::InvalidSession);
                }
                Ok(_) => {
                    self.burst = (request.opcode == op::BURST_READ).then(|| FtpBurst::new(request));
                    self.operation = FtpOperation::Read(*request, false);
                }
                Err(error) => self.nak(request, error),
            },
            op::CREATE | op::OPEN_WRITE => self.handle_open(request, store, erasing),
            op::WRITE => self.handle_write(request, store),
            op::REMOVE => {
                match request.requested_file().filter(|file| store.file_size(*file).is_some()) {
                    Some(file) => {
                        store.remove_file(file);
                        self.text = Some(FILE_REMOVED);
                        self.reply_and_remember(request, Ok(()));
                    }
                    None => self.nak(request, NakError::NotFound),
                }
            }
            op::CRC32 => self.operation = FtpOperation::Crc(*request, false),
            op::TRUNCATE | op::RENAME
                if request.requested_file().is_none_or(|file| store.file_size(file).is_none()) =>
            {
                self.nak(request, NakError::NotFound);
            }
            op::MAKE_DIRECTORY | op::REMOVE_DIRECTORY | op::TRUNCATE | op::RENAME => {
                self.nak(request, NakError::Protected);
            }
            _ => self.nak(request, NakError::UnknownCommand),
        }
    }

    fn handle_list(&mut self, request: &FtpRequest, store: &Store) {
        if !request.path().is_empty() {
            return self.nak(request, NakError::NotFound);
        }
        let mut entries = heapless::Vec::<u8, MAX_DATA>::new();
        let held = File::ALL.iter().filter_map(|file| Some((file.name(), store.file_size(*file)?)));
        for (name, size) in held.skip(request.offset as usize) {
            let mut digits = [0; 10];
            // Names and sizes are short: the packet has room for all.
            let _ = entries.push(b'F');
            let _ = entries.extend_from_slice(name.as_bytes());
            let _ = entries.push(b'\t');
            let _ = entries.extend_from_slice(format_decimal(size, &mut digits));
            let _ = entries.push(0);
        }
        if entries.is_empty() {
            self.nak(request, NakError::EndOfFile);
        } else {
            self.ack(request, &entries);
        }
    }

    fn handle_open(&mut self, request: &FtpRequest, store: &mut Store, erasing: ErasePermission) {
        let Some(file) = request.requested_file() else {
            return self.nak(request, NakError::Protected);
        };
        let same = |session: &&mut Session| {
            (session.client, session.id, session.file) == (request.client, request.session, file)
                && session.nothing_written
        };
        if let Some(session) = self.session.as_mut().filter(same) {
            (session.opened_by, session.last_used_at) = (*request, self.now);
            return self.ack(request, &[]);
        }
        if !self.open_session(request, file, Access::Write, store) {
            return;
        }
        match store.open_upload(file, erasing) {
            Ok(()) => self.operation = FtpOperation::Open(*request),
            Err(why) => {
                self.session = None;
                self.text = Some(upload_text(file, Err(why)));
                self.nak(request, why.into());
            }
        }
    }

    fn handle_write(&mut self, request: &FtpRequest, store: &mut Store) {
        match self.session_of(request) {
            Ok(Session { access: Access::Write, .. }) => {}
            Ok(_) => return self.nak(request, NakError::Protected),
            Err(no) => return self.nak(request, no),
        }
        if usize::from(request.size) > MAX_DATA || request.size == 0 {
            return self.nak(request, NakError::InvalidSize);
        }
        if let Some(UploadState::Ended(Err(why))) = store.upload_state() {
            return self.nak(request, why.into());
        }
        match store.take_piece(request.offset, request.bytes()) {
            PieceOutcome::Stored => {
                self.session =
                    self.session.map(|session| Session { nothing_written: false, ..session });
                self.ack(request, &[]);
            }
            PieceOutcome::TooLarge => self.nak(request, NakError::Errno(EFBIG)),
            PieceOutcome::RetryLater => {}
        }
    }

    /// Sends again the ACK with which the session was opened.
    fn repeat_open_ack(&mut self, request: &FtpRequest, session: &Session, store: &Store) {
        match store.file_size(session.file) {
            Some(size) if session.access == Access::Read => self.ack(request, &size.to_le_bytes()),
            _ => self.ack(request, &[]),
        }
    }

    /// The client's open session; a request sent before that session was opened is refused.
    fn session_of(&mut self, request: &FtpRequest) -> Result<Session, NakError> {
        let now = self.now;
        match &mut self.session {
            Some(session) if session.client == request.client && session.id == request.session => {
                if (request.sequence.wrapping_sub(session.opened_by.sequence) as i16) < 0 {
                    return Err(NakError::InvalidSession);
                }
                session.last_used_at = now;
                Ok(*session)
            }
            _ => Err(NakError::InvalidSession),
        }
    }

    fn is_idle(&self, session: &Session) -> bool {
        self.now - session.last_used_at > SESSION_IDLE_AFTER
    }

    /// Opens a session in place of the client's own or an idle one. False, with a NAK, if another
    /// client uses the session.
    fn open_session(
        &mut self,
        request: &FtpRequest,
        file: File,
        access: Access,
        store: &mut Store,
    ) -> bool {
        let held = |session: &Session| session.client != request.client && !self.is_idle(session);
        if self.session.as_ref().is_some_and(held) {
            self.nak(request, NakError::NoSessionsAvailable);
            return false;
        }
        self.drop_session(store);
        let FtpRequest { client, session: id, .. } = *request;
        let (opened_by, nothing_written) = (*request, access == Access::Write);
        self.session = Some(Session {
            id,
            client,
            file,
            access,
            nothing_written,
            opened_by,
            last_used_at: self.now,
        });
        true
    }

    /// Ends the session without an answer; an unfinished upload is given up.
    fn drop_session(&mut self, store: &mut Store) {
        if self.session.take().is_some_and(|session| session.access == Access::Write) {
            store.abandon_upload();
        }
    }

    /// Reads the next packet of the burst, if one is under way.
    fn send_next_burst_packet(&mut self, store: &mut Store) {
        if let Some(stream) = self.burst {
            self.operation = FtpOperation::Read(stream.first_request(), false);
            self.continue_operation(store);
        }
    }
}

#[cfg(test)]
mod tests;
