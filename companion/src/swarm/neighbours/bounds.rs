//! Ages, speeds and distances by which neighbours are judged.

use planner_core::Point;

use crate::time::Duration;

/// A hovering vehicle sways more slowly, m/s.
pub(crate) const STANDING_MPS: f32 = 0.3;
/// A position older than the one held by less than this is late; by more, the sender was restarted.
pub(super) const RESTART_MS: u32 = 10_000;
/// Heard within this time counts as heard: four positions and intents.
pub(super) const LATELY: Duration = Duration::from_millis(800);
/// Further from its pad, seen from above, a vehicle on its plan is not on the way up from it or down to it, metres.
pub(super) const OVER_PAD_M: f32 = 10.0;
/// After this silence a vehicle counts as dead. One that is unheard stops within 3 s (row `NeighboursSilent`) and lands
/// 20 s later; this leaves it 20 s to come down.
pub(super) const DEAD: Duration = Duration::from_millis(DEAD_MS);
pub(super) const DEAD_MS: u64 = 45_000;
/// Last heard further away than this share of the radio's range, a vehicle that falls silent is out of range.
pub(super) const EDGE_SHARE: f32 = 0.7;
/// An unheard vehicle makes progress at this share of its nominal speed at least: it slows in corners and where it lags.
pub(super) const RECKONED_SHARE: f32 = 0.4;
/// That counts once it has been unheard for so long, seconds.
pub(super) const RECKONED_AFTER_S: f32 = 2.0;
/// For so long at most a vehicle flies on unheard, seconds.
pub(super) const FLIES_ON_S: f32 = 75.0;
/// An unheard vehicle stands on its path for so long before it lands.
pub(super) const STANDS_UNHEARD: Duration = Duration::from_secs(15);
/// After this silence it is down from the highest floors too: 50 m at 1.5 m/s.
pub(super) const DOWN: Duration = Duration::from_secs(75);
/// Over an area the column of a vehicle that left the plan in the air is kept off for so long after it was last heard: then it is
/// down, whatever it flew there.
pub(super) const COLUMN_KEPT: Duration = Duration::from_secs(600);
/// How far along its path an unheard vehicle may have come, metres: it notices after [`LATELY`] and 1 s, and stops.
pub(super) const STRETCH_M: f32 = 6.0;
/// And by so much for each second that messages are late, m/s.
pub(super) const STRETCH_MPS: f32 = 2.0;
/// Spacing of the places on that stretch below which it may lie, metres.
pub(super) const STRETCH_STEP_M: f32 = 1.0;
/// Height of the column below a vehicle that lies somewhere below, metres; the planner shortens it where it knows the
/// ground.
pub(super) const COLUMN_M: f32 = 60.0;
/// An airborne vehicle of which nothing is heard for this long may land before more is heard.
pub(super) const SILENT: Duration = Duration::from_secs(3);
/// Further below a vehicle whose height is known there is time until it is nearer, metres.
pub(super) const BELOW_M: f32 = 15.0;
/// Fastest landing, m/s: how the column of a vehicle that does not know where it is grows.
pub(super) const LANDS_MPS: f32 = 2.0;
/// A place older than this does not show how low a vehicle is that lands, seconds.
pub(super) const OLD_S: f32 = 1.0;
/// The same: what was heard within this time is no older.
pub(super) const FRESHLY: Duration = Duration::from_secs(1);
/// A vehicle this little below may yet be above in a moment, metres.
pub(super) const LEVEL_M: f32 = 1.0;
/// What may be missing on the place of a vehicle whose own knowledge of it is old, metres.
pub(super) const VAGUE_M: f32 = 0.5;
/// What two vehicles in the air may stray together, one of which hovers, metres.
pub(super) const PAIR_SWAY_M: f32 = 0.1;
/// A position counts as the vehicle's of the roster if an intent of our mission was heard from it within this time: ten intents
/// at the lowest rate.
pub(super) const BELONGS: Duration = Duration::from_secs(5);
/// Most strangers that are kept; a full roster leaves room for one.
pub(super) const STRANGERS: usize = 4;
/// A stranger that was not heard for this long is forgotten.
pub(super) const STRANGER_STAYS: Duration = Duration::from_secs(60);
/// Rank of a stranger: behind everyone.
pub(super) const STRANGER: u16 = u16::MAX;
/// A vehicle that stood for so long is not about to go on.
pub(super) const STANDS: Duration = Duration::from_secs(5);
/// Progress is believed as if it were that of so much later, seconds: messages come up to a second late, and then at once.
pub(super) const LATE_S: f32 = 1.0;
/// What progress may jump, metres: where a vehicle takes up its path again, its nearest point is new.
pub(super) const STRIDE_M: f32 = 1.0;
/// For so long a vehicle that nobody hears may fly on at the top of its climb, seconds.
pub(super) const BEYOND_TOP_S: f32 = 1.2;
/// A climb leads straight up, this little beside, metres.
pub(super) const CLIMB_BESIDE_M: f32 = 0.9;
/// A top this little above is reached, metres.
pub(super) const TOP_M: f32 = 0.3;
/// Further away than any vehicle.
pub(super) const NOWHERE: Point = Point::new(1e6, 1e6, 1e6);
/// Nobody flies higher over another than this, metres.
pub(super) const SKY_M: f32 = 1000.0;
