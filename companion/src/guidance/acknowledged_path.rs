//! What other vehicles know of this vehicle's way along its path. Once no vehicle hears it, it
//! lands where the others expect it, though gates may have let it fly further.

use crate::margins::{UNHEARD_TRAVEL_RESERVE_M, max_unheard_travel_m, min_unheard_travel_m};
use crate::time::{Duration, Instant};

/// Age below which another vehicle's report that it hears this one counts as new: two steps.
pub(super) const MAX_NEW_REPORT_AGE: Duration = Duration::from_millis(100);
/// A vehicle no further than this beyond the part of its path that others know does not fly back,
/// metres.
pub(super) const MAX_BEYOND_KNOWN_M: f32 = 0.3;
/// Time by which a vehicle follows behind its reference, seconds.
const LAG_BEHIND_REFERENCE_S: f32 = 0.5;
/// An unheard vehicle flies back to this distance before the end of the stretch on which others
/// expect it, metres. Up to [`MAX_BEYOND_KNOWN_M`] beyond that place it does not fly back, and it
/// may drift.
const FLY_BACK_BEFORE_TRAVEL_END_M: f32 = UNHEARD_TRAVEL_RESERVE_M + 0.33;
/// Time after the last report that another vehicle hears this one, after which no further echo can
/// come of an intent that has arrived: an intent is echoed within 2.54 s.
const ECHOED_WITHIN: Duration = Duration::from_secs(3);
/// Longest time from the sending of a vehicle's last intent that arrives to the last report that it
/// is heard, seconds, without the delay of messages: others report for 0.8 s that they hear it, and
/// all send intents, which carry the reports, each 0.2 s.
const HEARD_REPORTED_FOR_S: f32 = 1.2;
/// Longest delay of messages with which a vehicle knows which of its intents arrived last, seconds:
/// with a longer delay the last echo may be of an intent that was sent seconds before the last that
/// arrived.
const MAX_DELAY_TO_KNOW_LAST_ARRIVAL_S: f32 = 0.5;

/// Part of a vehicle's path that others know by the intents that they acknowledged, and by their
/// reports that they hear it, metres along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AcknowledgedPath {
    /// The first place where others may expect the vehicle: where it was at their last report that
    /// they hear it, plus the least distance that it flies on from there. `None` where no vehicle
    /// has heard it on this path.
    expected_from_m: Option<f32>,
    /// Place where the vehicle was when it sent the last acknowledged intent; ∞ where none was
    /// acknowledged.
    sent_from_m: f32,
    /// Place to which the points of the last acknowledged intent lead; −∞ where none was
    /// acknowledged.
    points_end_m: f32,
    /// When this vehicle sent the last acknowledged intent.
    intent_sent_at: Instant,
    /// When another vehicle last reported that it hears this one.
    reported_heard_at: Instant,
    /// When the path was begun: intents sent earlier are of another path.
    path_begun_at: Instant,
}

impl AcknowledgedPath {
    /// For a path that begins now, of which others know nothing.
    pub const fn of_new_path(now: Instant) -> Self {
        Self {
            expected_from_m: None,
            sent_from_m: f32::INFINITY,
            points_end_m: f32::NEG_INFINITY,
            intent_sent_at: now,
            reported_heard_at: now,
            path_begun_at: now,
        }
    }

    /// Begins to follow the path: so far, others have heard the vehicle nowhere on it.
    pub fn start_following(&mut self, now: Instant) {
        *self = Self { points_end_m: self.points_end_m, ..Self::of_new_path(now) };
    }

    /// Notes a new report that another vehicle hears this one, whose reference is at `along_m`
    /// along its path.
    pub fn note_reported_heard(&mut self, along_m: f32, speed_mps: f32, now: Instant) {
        self.reported_heard_at = now;
        let heard_m = along_m - speed_mps * LAG_BEHIND_REFERENCE_S;
        self.expected_from_m = Some(heard_m + min_unheard_travel_m(speed_mps));
    }

    /// Notes that another vehicle has acknowledged the intent sent at `sent_at` from `at_m` along
    /// the path, whose points lead to `to_m` along it.
    pub fn note_acknowledged(&mut self, sent_at: Instant, at_m: f32, to_m: f32) {
        if sent_at > self.path_begun_at {
            (self.sent_from_m, self.points_end_m, self.intent_sent_at) = (at_m, to_m, sent_at);
        }
    }

    /// The first and the last place at which others expect the vehicle once they hear it no more:
    /// it must have passed what lies before, and flies back from beyond. The last place is no
    /// further than it could report, though gates may have opened since, nor than
    /// [`FLY_BACK_BEFORE_TRAVEL_END_M`] before the end of the stretch from where it sent the last
    /// acknowledged intent.
    ///
    /// Others report for a while longer that they hear it than they do, so the first place is one
    /// that it has passed if they heard it until then. A vehicle that hears others, by messages
    /// that take up to `delay_s`, knows after a while which of its intents arrived last. Then the
    /// last place takes precedence where it lies before the first; until then the first does.
    pub fn expected_first_and_last_m(
        &self,
        fastest_mps: f32,
        delay_s: Option<f32>,
        now: Instant,
    ) -> [f32; 2] {
        let stretch_ends_m =
            self.sent_from_m + max_unheard_travel_m(fastest_mps) - FLY_BACK_BEFORE_TRAVEL_END_M;
        let Some(first_m) = self.expected_from_m else { return [f32::INFINITY, stretch_ends_m] };
        let last_m = self.points_end_m.min(stretch_ends_m);
        // The last acknowledged intent is the last that arrived if the reports that others hear
        // this vehicle ended soon after it.
        let knows = self.sent_from_m.is_finite()
            && now - self.reported_heard_at > ECHOED_WITHIN
            && delay_s.is_some_and(|delay_s| {
                let reported_s = (self.reported_heard_at - self.intent_sent_at).as_secs_f32();
                delay_s < MAX_DELAY_TO_KNOW_LAST_ARRIVAL_S
                    && reported_s < HEARD_REPORTED_FOR_S + 2.0 * delay_s
            });
        if knows { [first_m.min(last_m), last_m] } else { [first_m, last_m.max(first_m)] }
    }
}
