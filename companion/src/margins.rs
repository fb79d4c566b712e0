//! The margins to walls, added up in one place: hull + tracking + estimate + announced gust ≤
//! clearance.
//!
//! | what | value | unit | reason |
//! |---|---|---|---|
//! | hull | mission file | m | radius of the vehicle |
//! | clearance | mission file | m | required clearance, radius + safety margin: every edge of the roadmap was tested to be this far from obstacles |
//! | tracking, at cruise | [`CRUISE_TRACKING_ERROR_M`] | m | how far beside its path the vehicle flies, by its own estimate |
//! | tracking, at a crawl | [`CRAWL_TRACKING_ERROR_M`] | m | the same, at a speed at which the vehicle could as well hover |
//! | estimate | [`ACCURACY_FACTOR`] × the reported accuracy, at least `FLK_EST_M` | m | how far the estimate is from the truth |
//! | accuracy's age | [`MAX_ACCURACY_AGE`] | s | three reports of a stream at 1 Hz |
//! | gust | scenario | m | the host adds the distance by which an announced gust pushes the vehicle (in the caller of [`estimate_margin_m`]); on board it is part of the margin |
//!
//! The part of the clearance that is left for the estimate is compared with the bound of the
//! estimate's error. A bound above the part left at cruise refuses the start and slows the vehicle
//! in flight; one above the part left at a crawl stops it. A bound of at most
//! [`MIN_ESTIMATE_ERROR_BOUND_M`] refuses nothing: no receiver does better, and the operator chose
//! the margin. A mission whose margin is below that flies at the operator's risk.
//!
//! **What this cannot see.** The bound is only as honest as the estimator. In the recorded flights
//! PX4's SIH reported 0.25 m while the estimate was 0.7 m off: a receiver's bias and a barometer's
//! drift look to the filter like the truth. Three times the reported accuracy covers that case, and
//! no proof says that it covers the next. ArduCopter reports ratios and no metres: a consistent
//! estimate with a constant error looks sound. An operator who flies near walls vouches for the
//! receiver by `FLK_EST_M`.

use crate::time::Duration;

/// Time for which a vehicle of a coverage mission photographs on after a majority of the vehicles
/// that take part, or were lost, last reported that they hear it, seconds.
pub(crate) const LEASE_S: u64 = 20;
/// Longest time from when a vehicle was last heard until it notices that it is unheard, seconds:
/// others report for 0.8 s more that they hear it, and such a report counts for 1 s.
pub(crate) const UNHEARD_NOTICED_AFTER_S: f32 = 1.8;
/// Part of [`max_unheard_travel_m`] for drift, and for the last centimetres of a stop, metres.
pub(crate) const UNHEARD_TRAVEL_RESERVE_M: f32 = 0.67;
/// Time for which an unheard vehicle flies on at its speed from where it was last heard until it
/// brakes, seconds: after 1 s without any message it stops. A vehicle that still hears others
/// notices later; it flies back if it came further and its way back is free.
const UNHEARD_FLIGHT_S: f32 = 1.3;
/// Part of a message's delay, seconds: its wait for the receiver's next step. [`UNHEARD_FLIGHT_S`]
/// contains this part already.
const RECEIVER_STEP_DELAY_S: f32 = 0.05;
/// Deceleration with which an unheard vehicle is assumed to stop, m/s².
const UNHEARD_BRAKING_MPS2: f32 = 1.5;
/// Deceleration of the hardest stop of a vehicle that falls silent, m/s²: that of PX4's own modes.
const HARDEST_STOP_MPS2: f32 = 3.0;
/// Time for which a vehicle flies on before its hardest stop, seconds.
const DELAY_BEFORE_HARDEST_STOP_S: f32 = 0.3;
/// Least time that a vehicle without power takes to come down, seconds: it moves on meanwhile.
pub(crate) const MIN_FALL_TIME_S: f32 = 0.6;
/// Delay that is allowed for the messages by which a lease is renewed, seconds.
pub(crate) const LEASE_RENEWAL_DELAY_S: f32 = 2.0;
/// Time under a pilot's control after which a vehicle counts as having left the plan and the
/// mission: others fly around it and take over its part.
pub(crate) const PILOTED_OUT_OF_PLAN_AFTER: Duration = Duration::from_secs(20);
/// Lateral tracking error at cruise speed, by the vehicle's own estimate, metres.
pub const CRUISE_TRACKING_ERROR_M: f32 = 0.25;
/// Lateral tracking error at a crawl, metres.
pub const CRAWL_TRACKING_ERROR_M: f32 = 0.1;
/// Least bound of the position estimate's error, unless `FLK_EST_M` says otherwise: a receiver with
/// fixed RTK, metres.
pub const MIN_ESTIMATE_ERROR_BOUND_M: f32 = 0.1;
/// Ratio of the estimate's error bound to the accuracy that the autopilot reports, which is one
/// standard deviation.
pub const ACCURACY_FACTOR: f32 = 3.0;
/// Distance by which a bound of the estimate's error may exceed the margin left for it, metres:
/// rounding.
const ERROR_BOUND_ROUNDING_M: f32 = 1e-4;
/// Age from which a reported accuracy counts as unknown.
pub const MAX_ACCURACY_AGE: Duration = Duration::from_secs(3);

/// Greatest estimated height above the plan's ground at which a landing detector's report of the
/// ground is believed, and greatest distance in height from the pad at which a vehicle takes off,
/// metres. On the ground real estimates were up to 1.1 m off.
pub(crate) const MAX_HEIGHT_ERROR_ON_GROUND_M: f32 = 1.5;

/// Distance by which two vehicles in a coverage mission may be nearer than their estimates say,
/// metres: for each of the two, the part of the clearance that is left for its estimate. Where no
/// gates separate them, this is added to the safety distance.
pub(crate) fn pair_position_error_m(clearance_m: f32, radius_m: f32) -> f32 {
    2.0 * libm::fmaxf(estimate_margin_m(clearance_m, radius_m, CRUISE_TRACKING_ERROR_M), 0.0)
}

/// The part of the clearance that the hull and the tracking error leave for the estimate's error
/// and for gusts, metres; negative where they leave nothing.
pub fn estimate_margin_m(clearance_m: f32, radius_m: f32, tracking_m: f32) -> f32 {
    clearance_m - radius_m - tracking_m
}

/// Whether a bound of the estimate's error, metres, is at most the margin left for it, and
/// `ERROR_BOUND_ROUNDING_M`.
pub fn is_error_bound_within(bound_m: f32, room_m: f32) -> bool {
    bound_m <= room_m + ERROR_BOUND_ROUNDING_M
}

/// Share of the cruise speed at which the estimate's error bound, metres, and the tracking error of
/// that speed fit into the clearance: 1 where they fit at cruise, 0 where they do not even fit at a
/// crawl.
pub fn speed_share_for_error_bound(bound_m: f32, clearance_m: f32, radius_m: f32) -> f32 {
    let (cruise_m, crawl_m) = (
        estimate_margin_m(clearance_m, radius_m, CRUISE_TRACKING_ERROR_M),
        estimate_margin_m(clearance_m, radius_m, CRAWL_TRACKING_ERROR_M),
    );
    if is_error_bound_within(bound_m, cruise_m) {
        return 1.0;
    }
    // A bound that is NaN or infinite stops the vehicle.
    if !is_error_bound_within(bound_m, crawl_m) {
        return 0.0;
    }
    // With a bound just within the crawl margin the vehicle still flies, at `MIN_SPEED_SHARE`, so
    // that it may reach a place where the estimate is better.
    ((crawl_m - bound_m) / (crawl_m - cruise_m)).clamp(MIN_SPEED_SHARE, 1.0)
}

/// Least share of the cruise speed at which a vehicle is flown; slower it stops.
const MIN_SPEED_SHARE: f32 = 0.1;

/// Greatest distance along its path, metres, from where an unheard vehicle was last heard to where
/// it comes to rest, in a mission whose fastest vehicle flies at `fastest_mps`: it notices, stops,
/// and flies back if it came further. Not in a coverage mission: there it flies on as long as its
/// lease allows.
pub(crate) fn max_unheard_travel_m(fastest_mps: f32) -> f32 {
    let stop_m = fastest_mps * fastest_mps / (2.0 * UNHEARD_BRAKING_MPS2);
    fastest_mps * UNHEARD_FLIGHT_S + stop_m + UNHEARD_TRAVEL_RESERVE_M
}

/// Time, seconds, for which an unheard vehicle flies on beyond [`max_unheard_travel_m`] where
/// messages take `delay_s`: those that it sent, and the reports that it is heard, are each late by
/// `delay_s`.
#[inline]
pub(crate) fn unheard_flight_by_delay_s(delay_s: f32) -> f32 {
    if delay_s > RECEIVER_STEP_DELAY_S { 2.0 * (delay_s - RECEIVER_STEP_DELAY_S) } else { 0.0 }
}

/// Least distance that a vehicle flies on, metres, from where it was last heard at this speed: the
/// shorter of its hardest stop and of a fall.
pub(crate) fn min_unheard_travel_m(speed_mps: f32) -> f32 {
    let flies_for_s = DELAY_BEFORE_HARDEST_STOP_S + speed_mps / (2.0 * HARDEST_STOP_MPS2);
    speed_mps * libm::fminf(flies_for_s, MIN_FALL_TIME_S)
}

#[cfg(test)]
mod tests;
