//! Duplicate detection: the outcomes of requests that must not be executed twice.
//!
//! A repeated request is recognised by its whole content for [`REPETITION_WINDOW`]. MAVSDK repeats
//! with a new sequence number, up to 4 s later. So the outcome of closing a session is sent again
//! for [`CLOSED_SESSION_WINDOW`] whatever the sequence number, until the client opens the next
//! session.

use super::packet::{FtpRequest, NakError, RequestFingerprint, op, request_fingerprint};
use crate::time::{Duration, Instant};

/// Time for which a repetition of an answered request is recognised.
const REPETITION_WINDOW: Duration = Duration::from_secs(3);
/// Time for which a repeated TerminateSession gets the outcome of the closed session.
const CLOSED_SESSION_WINDOW: Duration = Duration::from_secs(10);
/// Most answered requests that are remembered.
const MAX_REMEMBERED: usize = 8;

/// Whether a request was granted, or with which error it was refused.
type Outcome = Result<(), NakError>;

/// The last answered requests and the last closed session, with their outcomes.
#[derive(Clone, Debug, Default)]
pub struct DuplicateDetection {
    /// The requests; `None` in an entry not used yet.
    answered: [Option<AnsweredRequest>; MAX_REMEMBERED],
    /// Index in `answered` of the entry that is replaced next, the oldest.
    next: usize,
    /// The session closed last; `None` before the first.
    closed: Option<ClosedSession>,
}

/// An answered request, and its outcome.
#[derive(Clone, Copy, Debug)]
struct AnsweredRequest {
    request: RequestFingerprint,
    outcome: Outcome,
    /// When the request was answered.
    at: Instant,
}

/// The session that was closed last, and the outcome of closing it.
#[derive(Clone, Copy, Debug)]
struct ClosedSession {
    /// System id and component id of the client.
    client: (u8, u8),
    /// Id of the session.
    session: u8,
    outcome: Outcome,
    /// When the session was closed.
    at: Instant,
}

impl DuplicateDetection {
    /// Remembers the outcome of a request: of TerminateSession by client and session, of any other
    /// request by its whole content.
    pub fn remember(&mut self, request: &FtpRequest, outcome: Outcome, at: Instant) {
        if request.opcode == op::TERMINATE {
            self.closed = Some(ClosedSession {
                client: request.client,
                session: request.session,
                outcome,
                at,
            });
        } else {
            self.answered[self.next] =
                Some(AnsweredRequest { request: request_fingerprint(request), outcome, at });
            self.next = (self.next + 1) % MAX_REMEMBERED;
        }
    }

    /// Outcome of this same request if it was answered within the last 3 s (`REPETITION_WINDOW`).
    pub fn previous_outcome(&self, request: &FtpRequest, now: Instant) -> Option<Outcome> {
        let print = request_fingerprint(request);
        let known =
            |done: &&AnsweredRequest| done.request == print && now - done.at < REPETITION_WINDOW;
        self.answered.iter().flatten().find(known).map(|done| done.outcome)
    }

    /// Outcome of closing the session that the request names, if that was within the last 10 s
    /// (`CLOSED_SESSION_WINDOW`).
    pub fn previous_close_outcome(&self, request: &FtpRequest, now: Instant) -> Option<Outcome> {
        let known = |closed: &&ClosedSession| {
            (closed.client, closed.session) == (request.client, request.session)
                && now - closed.at < CLOSED_SESSION_WINDOW
        };
        self.closed.as_ref().filter(known).map(|closed| closed.outcome)
    }

    /// Forgets the client's closed session, as it opens another one.
    pub fn forget_closed(&mut self, client: (u8, u8)) {
        self.closed.take_if(|closed| closed.client == client);
    }
}
