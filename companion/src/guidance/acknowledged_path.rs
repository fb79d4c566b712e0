//! What other vehicles know of this vehicle's way along its path: once no vehicle hears it, it
//! lands where they expect it, though gates may have let it fly further.

use crate::margins::{UNHEARD_STRETCH_SPARE_M, least_unheard_rest_m, unheard_stretch_m};
use crate::time::{Duration, Instant};

/// Age below which another vehicle's report that it hears this one counts as new: two steps.
pub(super) const NEW_REPORT_AGE: Duration = Duration::from_millis(100);
/// A vehicle this little beyond the part of its path that others know does not fly back, metres.
pub(super) const BEYOND_KNOWN_M: f32 = 0.3;
/// Time by which a vehicle follows behind its reference, seconds.
const BEHIND_REFERENCE_S: f32 = 0.5;
/// Distance before the end of the stretch on which others expect an unheard vehicle, to which it
/// flies back, metres: it does not from [`BEYOND_KNOWN_M`] further on, and may drift.
const BEFORE_STRETCH_END_M: f32 = UNHEARD_STRETCH_SPARE_M + 0.33;
/// Time after the last report that another vehicle hears this one from which no echo can come that
/// acknowledges a later intent: an intent is echoed within 2.54 s.
const ECHOED_WITHIN: Duration = Duration::from_secs(3);
/// Time from a vehicle's last intent that arrives until the last report that it is heard, seconds,
/// without the delay of messages: others report so for 0.8 s, and both are sent each 0.2 s.
const REPORTS_HEARD_FOR_S: f32 = 1.2;
/// Longest delay of messages with which a vehicle knows which of its intents arrived last, seconds:
/// longer, an echo that comes seldom may be of one that is seconds older.
const MAX_KNOWN_DELAY_S: f32 = 0.5;

/// Part of a vehicle's path that others know by the intents that they acknowledged, and by their
/// reports that they hear it, metres along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AcknowledgedPath {
    /// The first place where others may expect the vehicle: where it was at their last report that
    /// they hear it, and the least distance that it flies on from there. `None` where no vehicle
    /// has heard it on this path.
    first_m: Option<f32>,
    /// Place where the vehicle was when it sent the last acknowledged intent; ∞ where none was
    /// acknowledged.
    at_m: f32,
    /// Place to which the points of the last acknowledged intent lead; −∞ where none was
    /// acknowledged.
    to_m: f32,
    /// When this vehicle sent the last acknowledged intent.
    sent_at: Instant,
    /// When another vehicle last reported that it hears this one.
    heard_at: Instant,
    /// When the path was begun: intents sent earlier are of another path.
    since: Instant,
}

impl AcknowledgedPath {
    /// For a path that begins now, of which others know nothing.
    pub const fn of_new_path(now: Instant) -> Self {
        Self {
            first_m: None,
            at_m: f32::INFINITY,
            to_m: f32::NEG_INFINITY,
            sent_at: now,
            heard_at: now,
            since: now,
        }
    }

    /// Begins to follow the path: so far, others have heard the vehicle nowhere on it.
    pub fn start_following(&mut self, now: Instant) {
        *self = Self { to_m: self.to_m, ..Self::of_new_path(now) };
    }

    /// Notes a new report that another vehicle hears this one, whose reference is at `along_m`
    /// along its path.
    pub fn note_heard(&mut self, along_m: f32, speed_mps: f32, now: Instant) {
        self.heard_at = now;
        let heard_m = along_m - speed_mps * BEHIND_REFERENCE_S;
        self.first_m = Some(heard_m + least_unheard_rest_m(speed_mps));
    }

    /// Notes that another vehicle has acknowledged the intent sent at `sent_at` from `at_m` along
    /// the path, whose points lead to `to_m` along it.
    pub fn note_acknowledged(&mut self, sent_at: Instant, at_m: f32, to_m: f32) {
        if sent_at > self.since {
            (self.at_m, self.to_m, self.sent_at) = (at_m, to_m, sent_at);
        }
    }

    /// The first and the last place at which others expect the vehicle once they hear it no more:
    /// it must have passed what lies before, and flies back from beyond. The last place is no
    /// further than it could report, though gates may have opened since, nor than
    /// [`BEFORE_STRETCH_END_M`] before the end of the stretch from where it sent the last
    /// acknowledged intent.
    ///
    /// Others report for a while longer that they hear it than they do, so the first place is one
    /// that it has passed if they heard it until then. A vehicle that hears others, by messages
    /// that take up to `delay_s`, knows after a while which of its intents arrived last, and then
    /// the last place counts.
    pub fn expected(&self, fastest_mps: f32, delay_s: Option<f32>, now: Instant) -> [f32; 2] {
        let stretch_ends_m = self.at_m + unheard_stretch_m(fastest_mps) - BEFORE_STRETCH_END_M;
        let Some(first_m) = self.first_m else { return [f32::INFINITY, stretch_ends_m] };
        let last_m = self.to_m.min(stretch_ends_m);
        // The last acknowledged intent is the last that arrived if reports of that ended with it.
        let knows = self.at_m.is_finite()
            && now - self.heard_at > ECHOED_WITHIN
            && delay_s.is_some_and(|delay_s| {
                let reported_s = (self.heard_at - self.sent_at).as_secs_f32();
                delay_s < MAX_KNOWN_DELAY_S && reported_s < REPORTS_HEARD_FOR_S + 2.0 * delay_s
            });
        if knows { [first_m.min(last_m), last_m] } else { [first_m, last_m.max(first_m)] }
    }
}
