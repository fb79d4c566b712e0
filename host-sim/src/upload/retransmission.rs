//! Decides when a request without an answer is sent again, and how many requests are under way at
//! once.
//!
//! Source: RFC 6298 (retransmission timeout) and RFC 5681 (congestion window). The air radio link
//! gives files 250 bytes a second: four answers take longer on it than any fixed timeout that suits
//! a cable. Each request repeated too early is answered too, which delays the next answer further.
//! So the timeout follows the round trips of this link, measured on requests that were sent only
//! once (Karn's algorithm). Where no answer comes the timeout doubles and the window halves, until
//! answers come in time.

use std::time::{Duration, Instant as Clock};

/// First and shortest timeout, seconds: a companion that is planning answers late.
const MIN_TIMEOUT_S: f32 = 0.4;
/// Longest timeout, seconds: MAVLink FTP servers recognise a repeated request for a few seconds,
/// the companion's for at least three.
const MAX_TIMEOUT_S: f32 = 2.0;
/// Weight of a new round trip time in the smoothed one (RFC 6298, section 2).
const ROUND_TRIP_GAIN: f32 = 0.125;
/// Weight of a new round trip's deviation in the smoothed deviation.
const DEVIATION_GAIN: f32 = 0.25;
/// Number of smoothed deviations that the timeout is longer than the smoothed round trip.
const TIMEOUT_DEVIATIONS: f32 = 4.0;
/// Most requests under way at once: the companion queues six.
const MAX_UNDER_WAY: usize = 4;

/// Retransmission timeout and window of one link.
pub struct Retransmission {
    /// Smoothed round trip time and its deviation, seconds; `None` before the first one.
    round_trip: Option<(f32, f32)>,
    /// Time without an answer after which a request is sent again.
    timeout: Duration,
    /// When the timeout last doubled: requests sent before that do not double it again.
    doubled_at: Clock,
    /// Most requests under way at once.
    window: usize,
}

impl Retransmission {
    /// Timeout and window of a link on which no request was answered yet.
    pub fn new(now: Clock) -> Self {
        Self {
            round_trip: None,
            timeout: Duration::from_secs_f32(MIN_TIMEOUT_S),
            doubled_at: now,
            window: MAX_UNDER_WAY,
        }
    }

    /// Number of requests that may be under way at once.
    pub fn window(&self) -> usize {
        self.window
    }

    /// Whether a request sent at `sent_at` has timed out. If so the timeout doubles and the window
    /// halves, once for all requests sent before.
    pub fn back_off_if_timed_out(&mut self, sent_at: Clock, now: Clock) -> bool {
        let over = now.saturating_duration_since(sent_at) > self.timeout;
        if over && sent_at >= self.doubled_at {
            self.timeout = (2 * self.timeout).min(Duration::from_secs_f32(MAX_TIMEOUT_S));
            self.doubled_at = now;
            self.window = (self.window / 2).max(1);
        }
        over
    }

    /// Adapts timeout and window to the round trip time of a request that was sent only once.
    pub fn note_round_trip(&mut self, time: Duration) {
        let time_s = time.as_secs_f32();
        let (smoothed_s, deviation_s) = match self.round_trip {
            None => (time_s, 0.5 * time_s),
            Some((smoothed_s, deviation_s)) => (
                smoothed_s + ROUND_TRIP_GAIN * (time_s - smoothed_s),
                deviation_s + DEVIATION_GAIN * ((time_s - smoothed_s).abs() - deviation_s),
            ),
        };
        self.round_trip = Some((smoothed_s, deviation_s));
        let wait_s =
            (smoothed_s + TIMEOUT_DEVIATIONS * deviation_s).clamp(MIN_TIMEOUT_S, MAX_TIMEOUT_S);
        self.timeout = Duration::from_secs_f32(wait_s);
        self.window = (self.window + 1).min(MAX_UNDER_WAY);
    }
}

#[cfg(test)]
mod tests;
