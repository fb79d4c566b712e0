//! Which senders may command the companion, and how often it answers each kind of sender.
//!
//! Senders are of three kinds: a ground station that the mission file names, a component of the
//! vehicle's own system on the autopilot's link, and everybody else. Only a ground station may
//! command, set parameters and move files. Each kind of sender has a token bucket for each kind of
//! answer on each link. So a flood of one request starves neither other kinds of answer nor the
//! answers to a ground station. A request without a token left is not answered: clients request
//! again.
//!
//! A system id proves no identity; `SECURITY.md` says what a forged one can do.

use crate::events::Link;
use crate::time::{Duration, Instant};

/// The kind of sender of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SenderKind {
    /// A system id that the mission file names as a ground station.
    GroundStation,
    /// A component of the vehicle's own system, heard on the autopilot's link.
    Autopilot,
    /// Any other sender.
    Other,
}

impl SenderKind {
    /// The kind of sender with the system id `system`, heard on `link` by the vehicle of system id
    /// `own`.
    pub(crate) fn from_system_id(link: Link, system: u8, own: u8, ground_stations: &[u8]) -> Self {
        if system != 0 && ground_stations.contains(&system) {
            Self::GroundStation
        } else if link == Link::Autopilot && system == own {
            Self::Autopilot
        } else {
            Self::Other
        }
    }
}

/// Kinds of answers to what others send; each has its own token bucket for each link and kind of
/// sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnswerKind {
    /// COMMAND_ACK.
    Ack,
    /// TIMESYNC.
    Timesync,
    /// PARAM_VALUE and PARAM_ERROR.
    Parameter,
    /// The message that a REQUEST_MESSAGE requests.
    Message,
    /// STATUSTEXT about something that a sender did.
    Text,
}

/// Number of kinds of sender, [`SenderKind`].
const SENDER_COUNT: usize = 3;
/// Number of kinds of answer, [`AnswerKind`].
const KIND_COUNT: usize = 5;
/// Number of links.
const LINK_COUNT: usize = 2;

/// Settings of a token bucket: it allows `burst` answers at once, then one each `every_ms`
/// milliseconds.
#[derive(Clone, Copy, Debug)]
struct TokenBucketConfig {
    /// Time in which one more answer becomes allowed, milliseconds.
    every_ms: u64,
    /// Number of answers that a full bucket allows at once.
    burst: u64,
}

/// The bucket with these settings.
const fn token_bucket(every_ms: u64, burst: u64) -> TokenBucketConfig {
    TokenBucketConfig { every_ms, burst }
}

/// Token buckets for each kind of sender, in the order of [`SenderKind`], and each kind of answer,
/// in the order of [`AnswerKind`]. Senders of kind `Other` can cause at most 22 + 30 + 19 + 20 + 6
/// bytes a second by radio, of the 250 that the radio's rate limit allows in flight. A burst of
/// `Parameter` holds a list of all parameters. PX4 sends TIMESYNC at 10 Hz, and flies without an
/// answer.
const TOKEN_BUCKETS: [[TokenBucketConfig; KIND_COUNT]; SENDER_COUNT] = [
    [
        token_bucket(100, 10),
        token_bucket(1000, 5),
        token_bucket(50, 32),
        token_bucket(100, 10),
        token_bucket(1000, 6),
    ],
    [
        token_bucket(200, 5),
        token_bucket(500, 5),
        token_bucket(200, 16),
        token_bucket(500, 4),
        token_bucket(10_000, 1),
    ],
    [
        token_bucket(1000, 2),
        token_bucket(1000, 3),
        token_bucket(2000, 10),
        token_bucket(2000, 2),
        token_bucket(10_000, 1),
    ],
];

/// The time at which each token bucket (link, kind of sender, kind of answer) is full again.
#[derive(Clone, Debug, Default)]
pub(crate) struct AnswerTokenBuckets {
    /// The times, by link, kind of sender and kind of answer.
    full_at: [[[Instant; KIND_COUNT]; SENDER_COUNT]; LINK_COUNT],
}

impl AnswerTokenBuckets {
    /// Takes a token for an answer; returns false, and takes none, if the bucket is empty.
    pub fn take_token(
        &mut self,
        now: Instant,
        link: Link,
        sender: SenderKind,
        kind: AnswerKind,
    ) -> bool {
        let TokenBucketConfig { every_ms, burst } = TOKEN_BUCKETS[sender as usize][kind as usize];
        let full_at = &mut self.full_at[link as usize][sender as usize][kind as usize];
        let next = (*full_at).max(now) + Duration::from_millis(every_ms);
        let allowed = next - now <= Duration::from_millis(every_ms * burst);
        if allowed {
            *full_at = next;
        }
        allowed
    }
}

#[cfg(test)]
mod tests;
