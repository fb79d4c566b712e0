//! What the server remembers of requests that it must not obey twice.
//!
//! A repeated request is known for [`DUPLICATE_WINDOW`] by all that is in it. MAVSDK repeats under
//! a new sequence number, after up to 4 s: so what closing a session came to is answered for
//! [`CLOSED_SESSION_WINDOW`] under any number, until its client opens the next.

use super::packet::{NakError, Request, RequestFingerprint, op, request_fingerprint};
use crate::time::{Duration, Instant};

/// Time for which a repeated request is recognised as a duplicate.
const DUPLICATE_WINDOW: Duration = Duration::from_secs(3);
/// Time for which the result of the last session is still answered.
const CLOSED_SESSION_WINDOW: Duration = Duration::from_secs(10);
/// Most requests remembered for duplicate detection.
const MAX_REMEMBERED: usize = 8;

type Outcome = Result<(), NakError>;

/// The memory.
#[derive(Clone, Debug, Default)]
pub struct DuplicateDetection {
    done: [Option<AnsweredRequest>; MAX_REMEMBERED],
    next: usize,
    closed: Option<ClosedSession>,
}

#[derive(Clone, Copy, Debug)]
struct AnsweredRequest {
    request: RequestFingerprint,
    outcome: Outcome,
    at: Instant,
}

/// The last session that was closed.
#[derive(Clone, Copy, Debug)]
struct ClosedSession {
    client: (u8, u8),
    session: u8,
    outcome: Outcome,
    at: Instant,
}

impl DuplicateDetection {
    /// Remembers the outcome of a request: TerminateSession by its session, any other request by
    /// its whole content.
    pub fn remember(&mut self, request: &Request, outcome: Outcome, at: Instant) {
        if request.opcode == op::TERMINATE {
            self.closed = Some(ClosedSession {
                client: request.client,
                session: request.session,
                outcome,
                at,
            });
        } else {
            self.done[self.next] =
                Some(AnsweredRequest { request: request_fingerprint(request), outcome, at });
            self.next = (self.next + 1) % MAX_REMEMBERED;
        }
    }

    /// Outcome of the same request if it was answered a short time ago.
    pub fn previous_outcome(&self, request: &Request, now: Instant) -> Option<Outcome> {
        let print = request_fingerprint(request);
        let known =
            |done: &&AnsweredRequest| done.request == print && now - done.at < DUPLICATE_WINDOW;
        self.done.iter().flatten().find(known).map(|done| done.outcome)
    }

    /// Outcome of closing the session that a request is of.
    pub fn previous_close_outcome(&self, request: &Request, now: Instant) -> Option<Outcome> {
        let known = |closed: &&ClosedSession| {
            (closed.client, closed.session) == (request.client, request.session)
                && now - closed.at < CLOSED_SESSION_WINDOW
        };
        self.closed.as_ref().filter(known).map(|closed| closed.outcome)
    }

    /// A client opens a session: the one before it is forgotten.
    pub fn forget_closed(&mut self, client: (u8, u8)) {
        self.closed.take_if(|closed| closed.client == client);
    }
}
