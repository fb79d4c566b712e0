//! Ages, speeds and distances by which neighbours are judged.

use planner_core::Point;

use crate::time::Duration;

/// Speed below which a vehicle counts as hovering, m/s: it sways no faster.
pub(crate) const MAX_HOVER_MPS: f32 = 0.3;
/// Difference of `time_boot_ms` to that of the last position, milliseconds. A position older by
/// less is late and is dropped; if it is older by more, its sender has restarted.
pub(super) const SENDER_RESTARTED_STEP_BACK_MS: u32 = 10_000;
/// Age of its last message within which a neighbour counts as heard: four positions and
/// intents at the default rate.
pub(super) const HEARD_WITHIN: Duration = Duration::from_millis(800);
/// Age of a neighbour's position from which it may have fallen silent: no vehicle arms beside it,
/// since a silent one would bar the climb.
pub(super) const NO_ARMING_BESIDE_SILENT_AFTER: Duration = Duration::from_millis(600);
/// Horizontal distance from its pad beyond which a vehicle on its plan is neither on the way up
/// from the pad nor on the way down to it, metres.
pub(super) const MAX_OVER_PAD_M: f32 = 10.0;
/// Silence after which a neighbour counts as lost. An unheard vehicle stops within 3 s (row
/// `NeighboursSilent`) and lands 20 s later; this leaves it 20 s to come down.
pub(super) const LOST_AFTER: Duration = Duration::from_millis(LOST_AFTER_MS);
/// [`LOST_AFTER`], milliseconds.
pub(super) const LOST_AFTER_MS: u64 = 45_000;
/// Share of the radio's range beyond which a neighbour that falls silent is taken to be out of
/// range, not failed.
pub(super) const RANGE_EDGE_SHARE: f32 = 0.7;
/// Least share of the slowest vehicle's cruise at which an unheard vehicle makes progress: it slows
/// in corners and where it lags.
pub(super) const MIN_UNHEARD_SPEED_SHARE: f32 = 0.4;
/// Silence after which a vehicle's progress is assumed to grow at [`MIN_UNHEARD_SPEED_SHARE`],
/// seconds.
pub(super) const UNHEARD_PROGRESS_GROWS_AFTER_S: f32 = 2.0;
/// Greatest distance before a closed gate at which an unheard vehicle stands, metres.
pub(super) const MAX_STAND_BEFORE_GATE_M: f32 = 0.5;
/// Least length of path with open gates ahead of a vehicle that falls silent for it to be assumed
/// to fly on, metres: with less ahead it may be standing there already.
pub(super) const MIN_OPEN_PATH_M: f32 = 0.5;
/// Longest time for which an unheard vehicle is assumed to fly on through open gates, seconds.
pub(super) const MAX_UNHEARD_FLIGHT_S: f32 = 75.0;
/// Silence of a vehicle at the edge of the radio's range, with no open gates ahead, up to which it
/// counts as out of range: it stands on its path and does not land yet.
pub(super) const MAX_OUT_OF_RANGE_WAIT: Duration = Duration::from_secs(15);
/// Silence after which a lost vehicle is on the ground, from the highest floors too: 50 m at 1.5
/// m/s.
pub(super) const DOWN_AFTER: Duration = Duration::from_secs(75);
/// Silence after which the column of a vehicle that left the plan in the air in a coverage mission
/// is free again: the vehicle is down by then, whatever it flew there.
pub(super) const COLUMN_KEPT_FOR: Duration = Duration::from_secs(600);
/// Additional time until a vehicle that still hears others notices that none hears it, compared
/// with a vehicle that hears nobody, seconds.
pub(super) const UNHEARD_NOTICED_LATER_S: f32 = 0.8;
/// Least share of the length of its reported points that a vehicle flies once it is unheard: it may
/// be braking for their end already.
pub(super) const MIN_FLOWN_SHARE_OF_POINTS: f32 = 0.8;
/// Least distance of a reported point from the vehicle for the direction to that point to count as
/// the vehicle's course, metres.
pub(super) const MIN_COURSE_M: f32 = 0.5;
/// Least spacing of the sampled places on the unheard stretch, the part of its points that a
/// vehicle may have flown unheard, metres: below any of them the vehicle may lie.
pub(super) const MIN_UNHEARD_STRETCH_SPACING_M: f32 = 1.0;
/// Silence after which a vehicle in a coverage mission may have landed further along its path than
/// `max_unheard_travel_m`: its lease, and the time that row `SwarmLinkLost` waits. No vehicle
/// counts as out of the plan for a shorter silence.
pub(super) const UNHEARD_LANDING_AFTER: Duration = Duration::from_secs(40);
/// Rounding of the length of a path of eight legs, metres.
pub(super) const LEGS_ROUNDING_M: f32 = 0.01;
/// Maximum number of spacings of the places on the unheard stretch, which is long at a high speed,
/// and in a coverage mission as long as the lease allows: with eight corners the stretch makes at
/// most 17 keep-out zones, and the pad one more.
pub(super) const MAX_STRETCH_SPACINGS: f32 = 8.0;
/// Height of the column below a neighbour's place in which it may lie on the ground, metres; the
/// planner shortens the column where it knows the ground.
pub(super) const DEFAULT_COLUMN_DEPTH_M: f32 = 60.0;
/// Silence after which a vehicle in the air may land before it is heard again.
pub(super) const MAY_LAND_AFTER: Duration = Duration::from_secs(3);
/// Distance by which the wind carries a vehicle aside that falls with its motors off, for each
/// metre of height: it falls at 10 m/s, and gusts of 3 m/s push it at half of that.
pub(super) const FALL_DRIFT_PER_HEIGHT: f32 = 0.15;
/// Time for which a falling vehicle is taken to fly on at its last heard speed, seconds: one second
/// until it falls, and one for the way that it makes while drag slows it.
pub(super) const FALL_CARRY_S: f32 = 2.0;
/// Greatest speed at which a falling vehicle is assumed to fly on, m/s, whatever it reported.
pub(super) const MAX_FALL_CARRY_MPS: f32 = 20.0;
/// Greatest height from which a vehicle is assumed to fall, metres, whatever it reported: none
/// flies higher.
pub(super) const MAX_FALL_M: f32 = 150.0;
/// Depth below a vehicle of known height to which its landing column reaches, metres: a vehicle
/// further below has time to leave later.
pub(super) const LANDING_COLUMN_DEPTH_M: f32 = 15.0;
/// Greatest speed of a landing, m/s: the rate at which a landing column grows downwards while the
/// vehicle's height is unknown.
pub(super) const MAX_LANDING_MPS: f32 = 2.0;
/// Age of a neighbour's position from which its height is unknown if it lands, and from which the
/// safety filter counts the neighbour as silent, seconds.
pub(super) const SILENT_AFTER_POSITION_AGE_S: f32 = 1.0;
/// [`SILENT_AFTER_POSITION_AGE_S`] as a duration.
pub(super) const SILENT_AFTER_POSITION_AGE: Duration = Duration::from_secs(1);
/// Height by which a landing column begins above the vehicle that lands, metres: another vehicle
/// that is above it by less may be below it in a moment.
pub(super) const COLUMN_TOP_ABOVE_M: f32 = 1.0;
/// Position error that is allowed for a neighbour that comes down, or that counts as dead, metres:
/// added to the radius of its keep-out zones.
pub(super) const STALE_POSITION_ERROR_M: f32 = 0.5;
/// A neighbour out of the plan that has moved by less than this is still avoided by the present
/// detour, metres.
pub(super) const AVOIDED_WITHIN_M: f32 = 0.5;
/// Distance beside its path at which a vehicle may come down unheard, beyond the deviation allowed
/// beside a vehicle on the ground, metres. Its landing is guided as at its goal, so the distance is
/// the one that the schedule keeps from landed vehicles in announced gusts of 3 m/s.
pub(super) const MAX_UNHEARD_LANDING_OFFSET_M: f32 = 0.15;
/// Acceleration by which the safety filter widens the set of a vehicle that is off the points that
/// it reports, m/s², with the default `FLK_ACCEL`. Detours stay clear of that set; with a greater
/// `FLK_ACCEL` the filter may stop a detour.
pub(super) const OFF_POINTS_ACCEL_MPS2: f32 = 1.5;
/// Age of a vehicle's last position that is seldom exceeded, without the delay of its message,
/// seconds: five are sent a second.
pub(super) const MAX_USUAL_POSITION_AGE_S: f32 = 0.3;
/// Sum of the deviations of two vehicles in the air, one of which hovers, metres.
pub(super) const PAIR_SWAY_M: f32 = 0.1;
/// Time for which an intent of our mission shows that the sender's positions are those of the
/// roster's vehicle: ten intents at the lowest rate.
pub(super) const MEMBERSHIP_LIFETIME: Duration = Duration::from_secs(5);
/// Maximum number of strangers that are kept; a full roster leaves room for one.
pub(super) const MAX_STRANGERS: usize = 4;
/// Silence after which a stranger is forgotten.
pub(super) const STRANGER_LIFETIME: Duration = Duration::from_secs(60);
/// Marks a stranger, which has no rank. It is greater than all ranks of the roster, so that by
/// Algorithm 2 every vehicle slows down near a stranger.
pub(super) const RANK_OUTSIDE_ROSTER: u16 = u16::MAX;
/// Time of standing after which a neighbour is not expected to fly on at once.
pub(super) const STANDS_AFTER: Duration = Duration::from_secs(5);
/// Greatest delay of a message, seconds: a punctual report right after a late one may show progress
/// of that much more time.
pub(super) const MAX_MESSAGE_DELAY_S: f32 = 1.0;
/// Greatest jump of a reported progress that is believed, metres: a vehicle that resumes its path
/// has a new nearest point.
pub(super) const MAX_PROGRESS_JUMP_M: f32 = 1.0;
/// Longest time for which an unheard vehicle flies on beyond the top of its climb, seconds.
pub(super) const MAX_UNHEARD_BEYOND_TOP_S: f32 = 1.2;
/// Greatest horizontal distance of a climbing vehicle from the vertical of its climb, metres.
pub(super) const MAX_CLIMB_DRIFT_M: f32 = 0.9;
/// A climb whose top is at most this far above the vehicle is done, metres.
pub(super) const CLIMB_DONE_BELOW_TOP_M: f32 = 0.3;
/// Stands for the position of a vehicle that never reported one: further away than any vehicle.
pub(super) const FAR_AWAY: Point = Point::new(1e6, 1e6, 1e6);
/// Stands for no place: NaN, to which no distance is small.
pub(super) const NO_PLACE: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);
/// Greatest height of one vehicle over another, metres.
pub(super) const MAX_HEIGHT_DIFFERENCE_M: f32 = 1000.0;
/// Age of a vehicle's own last message up to which relayed reports of that vehicle are ignored.
pub(super) const HEARD_DIRECTLY_WITHIN: Duration = Duration::from_secs(1);
/// Difference up to which a reported height of the ground is that of the area's lowest, metres:
/// the reporting vehicle computes it from heights above it.
pub(super) const GROUND_ROUNDING_M: f32 = 0.01;
