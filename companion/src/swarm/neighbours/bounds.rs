//! Ages, speeds and distances by which neighbours are judged.

use planner_core::Point;

use crate::time::Duration;

/// Greatest speed of a hovering vehicle's sway, m/s.
pub(crate) const MAX_HOVER_MPS: f32 = 0.3;
/// Time by which a position is older than the one held: by less than this it is late; by more, its
/// sender was restarted.
pub(super) const RESTART_MS: u32 = 10_000;
/// Age within which a neighbour counts as heard: four positions and intents.
pub(super) const HEARD_WITHIN: Duration = Duration::from_millis(800);
/// Age of a position from which its sender may have fallen silent: no vehicle arms where that would
/// bar its climb.
pub(super) const UNHEARD_BEFORE_ARMING: Duration = Duration::from_millis(600);
/// Horizontal distance from its pad beyond which a vehicle on its plan is neither on the way up
/// from the pad nor on the way down to it, metres.
pub(super) const OVER_PAD_M: f32 = 10.0;
/// Silence after which a vehicle counts as lost. One that is unheard stops within 3 s (row
/// `NeighboursSilent`) and lands 20 s later; this leaves it 20 s to come down.
pub(super) const LOST_AFTER: Duration = Duration::from_millis(LOST_AFTER_MS);
/// [`LOST_AFTER`], milliseconds.
pub(super) const LOST_AFTER_MS: u64 = 45_000;
/// Share of the radio's range: a vehicle last heard further away than this that falls silent is out
/// of range.
pub(super) const RANGE_EDGE_SHARE: f32 = 0.7;
/// Least share of its nominal speed at which an unheard vehicle makes progress: it slows in corners
/// and where it lags.
pub(super) const RECKONED_SPEED_SHARE: f32 = 0.4;
/// Silence after which progress is reckoned at [`RECKONED_SPEED_SHARE`], seconds.
pub(super) const RECKONED_AFTER_S: f32 = 2.0;
/// Distance before a closed gate at which an unheard vehicle stands at most, metres.
pub(super) const STANDS_SHORT_M: f32 = 0.5;
/// Longest time for which a vehicle flies on unheard, seconds.
pub(super) const MAX_UNHEARD_FLIGHT_S: f32 = 75.0;
/// Time for which an unheard vehicle stands on its path before it lands.
pub(super) const UNHEARD_WAIT: Duration = Duration::from_secs(15);
/// Silence after which a vehicle is down from the highest floors too: 50 m at 1.5 m/s.
pub(super) const DOWN_AFTER: Duration = Duration::from_secs(75);
/// Silence after which the column of a vehicle that left the plan in the air over an area is free
/// again: the vehicle is down by then, whatever it flew there.
pub(super) const COLUMN_KEPT: Duration = Duration::from_secs(600);
/// Stretch of its path that an unheard vehicle may have flown, metres: the vehicle notices after
/// [`HEARD_WITHIN`] and 1 s, and stops. Over an area it flies on as long as its lease allows.
pub(super) const UNHEARD_STRETCH_M: f32 = 6.0;
/// Growth of [`UNHEARD_STRETCH_M`] for each second that a message takes to another vehicle and
/// back, m/s.
pub(super) const UNHEARD_STRETCH_PER_DELAY_MPS: f32 = 2.0;
/// Spacing of the places on the unheard stretch below which the vehicle may lie, metres.
pub(super) const UNHEARD_STRETCH_STEP_M: f32 = 1.0;
/// Over an area, a vehicle that has been silent for this long may land further along its path than
/// [`UNHEARD_STRETCH_M`]: its lease, and the time that row `Alone` waits. No vehicle leaves the
/// plan for that silence earlier.
pub(super) const LANDS_UNHEARD: Duration = Duration::from_secs(40);
/// Rounding of the length of a way of eight legs, metres.
pub(super) const LEGS_ROUNDING_M: f32 = 0.01;
/// Most spacings of the places on the unheard stretch over an area, where it is as long as the
/// lease allows: with eight corners a neighbour makes 17 keep-out zones.
pub(super) const STRETCH_PLACES: f32 = 8.0;
/// Height of the column below a vehicle that lies somewhere below, metres; the planner shortens the
/// column where it knows the ground.
pub(super) const MAX_COLUMN_M: f32 = 60.0;
/// Silence after which an airborne vehicle may land before it is heard again.
pub(super) const MAY_LAND_AFTER: Duration = Duration::from_secs(3);
/// How far the wind takes a vehicle aside that falls with its motors off, for each metre of height:
/// it falls at 10 m/s, and gusts of 3 m/s push it at half of that.
pub(super) const FALL_DRIFT_SHARE: f32 = 0.15;
/// Time for which such a vehicle goes on as fast as it was when it was last heard, seconds: a
/// second until it falls, and what its fall leaves of its speed.
pub(super) const FALL_CARRY_S: f32 = 2.0;
/// Greatest speed with which one that falls is carried on, m/s: whatever was reported.
pub(super) const MAX_FALL_CARRY_MPS: f32 = 20.0;
/// Greatest height that one falls from, metres, whatever was reported: none flies higher.
pub(super) const MAX_FALL_M: f32 = 150.0;
/// Height difference, metres: this vehicle has time while a vehicle of known height is further
/// above it.
pub(super) const FAR_BELOW_M: f32 = 15.0;
/// Fastest landing, m/s: the rate at which the column of a vehicle grows that does not know where
/// it is.
pub(super) const MAX_LANDING_MPS: f32 = 2.0;
/// Age from which a landing vehicle's reported place does not show how low the vehicle is, seconds.
pub(super) const MAX_HEIGHT_AGE_S: f32 = 1.0;
/// [`MAX_HEIGHT_AGE_S`] as a duration.
pub(super) const MAX_HEIGHT_AGE: Duration = Duration::from_secs(1);
/// Height difference up to which a vehicle below may be above in a moment, metres.
pub(super) const LEVEL_M: f32 = 1.0;
/// Position error of a vehicle whose own knowledge of its place is old, metres.
pub(super) const VAGUE_POSITION_M: f32 = 0.5;
/// Distance beside its path at which a vehicle may come down unheard, beyond the deviation that
/// counts beside a vehicle on the ground, metres: it leads its landing as at its goal, so it is
/// kept clear as the schedule keeps others off landed vehicles in announced gusts of 3 m/s.
pub(super) const UNHEARD_BESIDE_M: f32 = 0.15;
/// Stray of two vehicles in the air together, one of which hovers, metres.
pub(super) const PAIR_SWAY_M: f32 = 0.1;
/// Time for which an intent of our mission shows that the sender's positions are those of the
/// roster's vehicle: ten intents at the lowest rate.
pub(super) const MEMBERSHIP_LIFETIME: Duration = Duration::from_secs(5);
/// Most strangers that are kept; a full roster leaves room for one.
pub(super) const MAX_STRANGERS: usize = 4;
/// Silence after which a stranger is forgotten.
pub(super) const STRANGER_LIFETIME: Duration = Duration::from_secs(60);
/// Rank of a stranger: behind every vehicle of the roster.
pub(super) const STRANGER_RANK: u16 = u16::MAX;
/// Time of standing after which a vehicle is not about to continue.
pub(super) const STANDS_AFTER: Duration = Duration::from_secs(5);
/// Greatest delay of a message, seconds: progress is believed as if this much later, since messages
/// come up to a second late, and then at once.
pub(super) const MAX_MESSAGE_DELAY_S: f32 = 1.0;
/// Greatest jump of progress, metres: where a vehicle takes up its path again, its nearest point is
/// new.
pub(super) const MAX_PROGRESS_JUMP_M: f32 = 1.0;
/// Longest time for which a vehicle that no other vehicle hears flies on at the top of its climb,
/// seconds.
pub(super) const UNHEARD_BEYOND_TOP_S: f32 = 1.2;
/// Greatest horizontal distance from the vertical of a climb, metres.
pub(super) const CLIMB_BESIDE_M: f32 = 0.9;
/// A top at most this far above is reached, metres.
pub(super) const CLIMB_TOP_M: f32 = 0.3;
/// A place further away than any vehicle.
pub(super) const FAR_AWAY: Point = Point::new(1e6, 1e6, 1e6);
/// No place: no distance to it is small.
pub(super) const NO_PLACE: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);
/// Greatest height of one vehicle over another, metres.
pub(super) const MAX_HEIGHT_DIFFERENCE_M: f32 = 1000.0;
