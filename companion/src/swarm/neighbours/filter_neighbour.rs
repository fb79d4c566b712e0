//! Neighbours as the safety filter compares them: a cheap test that rules out most as too far away,
//! and for the others the inputs of their reachable sets.

use planner_core::Point;
use planner_core::track::safety::{
    MotionBounds, NeighbourMotion, OFF_REPORTED_PATH_M, OwnSet, PlaceOnPoints, ReportedPathReach,
};

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::link::intent::{GROUNDED, LANDED, OUT_OF_PLAN, WAITING};
use crate::margins::MIN_FALL_TIME_S;
use crate::time::{Duration, Instant};

/// State of a neighbour that the safety filter compares: its priority, and its reachable set's
/// inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterNeighbour<'a> {
    /// MAVLink system id.
    pub(crate) id: u8,
    /// Whether the roster does not name the neighbour, so that only its positions count.
    pub(crate) stranger: bool,
    /// Whether the neighbour was last heard to follow the shared plan.
    pub(crate) on_plan: bool,
    /// Whether the neighbour follows the shared plan out of radio range, by others' reports or by
    /// its last position.
    pub(crate) out_of_range: bool,
    /// Whether the neighbour's plan has our plan's CRC, even while it flies off that plan.
    pub(crate) shares_plan: bool,
    /// Whether the neighbour is on the ground, or has stood for 5 s.
    pub(crate) stands: bool,
    /// Whether the neighbour lately reported that it stands until another vehicle moves.
    pub(crate) waits: bool,
    /// Whether the neighbour has been silent for so long that it counts as lost.
    pub(crate) lost: bool,
    /// Inputs of the neighbour's reachable set.
    pub(crate) motion: NeighbourMotion<'a>,
    /// Last position of a neighbour, silent in its climb, whose set is at the top of the climb: it
    /// may not have begun to climb. `None` for any other.
    pub(crate) before_climb: Option<Point>,
}

impl<'a> FilterNeighbour<'a> {
    /// Marks the neighbour as silent for so long that it counts as lost.
    pub(crate) fn count_as_lost(&mut self) {
        self.lost = true;
    }

    /// Ignores the delay of the neighbour's messages on the radio; their age still counts.
    pub(crate) fn ignore_message_delay(&mut self) {
        self.motion.delay_s = 0.0;
    }

    /// Makes the neighbour count as one that has flown on, unheard, for `age_s` seconds.
    pub(crate) fn fly_on_for(&mut self, age_s: f32) {
        (self.motion.age_s, self.motion.grounded) = (age_s, false);
    }

    /// Makes the neighbour count as one that stands at `motion.position`.
    pub(crate) fn stop_at_last_position(&mut self) {
        (self.motion.age_s, self.motion.speed_mps, self.motion.reported_points) = (0.0, 0.0, &[]);
        self.motion.reported_path_reach = ReportedPathReach::UNBOUNDED;
        self.motion.rests_within_m = 0.0;
    }

    /// Limits the reachable set of the neighbour, whose entry is `entry`, to the points that it
    /// reported, if it has been silent for longer than a stop takes.
    pub(crate) fn limit_to_points(&mut self, entry: &'a NeighbourEntry, bounds: &MotionBounds) {
        entry.limit_to_points(&mut self.motion, bounds);
    }
}

/// Inputs of the first, cheap comparison of this vehicle with each neighbour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReachQuery<'a> {
    /// Reachable set of this vehicle.
    pub(crate) own: &'a OwnSet<'a>,
    /// Greatest distance to be kept from any neighbour, metres.
    pub(crate) within_m: f32,
    /// Limits within which neighbours are expected to fly.
    pub(crate) bounds: &'a MotionBounds,
    /// Time of flight that is added to each neighbour's set before it brakes, seconds.
    pub(crate) ahead_s: f32,
    /// Whether this vehicle follows the shared plan: gates keep it apart from those that do too.
    pub(crate) on_plan: bool,
    /// Whether this vehicle hears no other one: then the others are assumed to fly on.
    pub(crate) hears_nobody: bool,
    /// Whether this vehicle, which hears nobody, still holds its lease in a coverage mission: then
    /// a neighbour that was silent for `down_after` has landed.
    pub(crate) holds_lease: bool,
    /// Whether this vehicle lands, or descends in a coverage mission: then places where unheard
    /// vehicles may lie count too.
    pub(crate) lands: bool,
}

/// What may have become of a silent neighbour.
#[derive(Clone, Copy, Debug)]
struct SilentFate {
    /// Whether it counts as lost, at rest on its points ([`NeighbourEntry::is_lost_on_points`]).
    lost_on_points: bool,
    /// Whether it has been silent for so long that it lies on the ground.
    lies: bool,
    /// Whether it may fly on though it counts as lost, since this vehicle hears nobody.
    may_fly_on: bool,
}

impl NeighbourEntry {
    /// Whether the neighbour counts as lost ([`Self::is_lost_on_points`]), if it may come within
    /// reach; `None` if it stays out of reach wherever it can be, or has no position. Most are far
    /// away: this test needs no reachable set. Never `None` for a neighbour that is within reach
    /// after [`Neighbours::apply_silence`].
    #[inline(always)]
    fn lost_if_within_reach(
        &self,
        down: Duration,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> Option<bool> {
        let placed_at = self.position_at?;
        let away = reach.own.box_distances(&self.state.position);
        let across_sq = away.x * away.x + away.y * away.y;
        let age = now - placed_at;
        if age > SILENT_AFTER_POSITION_AGE {
            let fate = SilentFate {
                lost_on_points: self.is_lost_on_points(age, now),
                lies: age >= down && !self.ground_m.is_nan(),
                may_fly_on: self.may_fly_on_though_lost(down, now, reach),
            };
            let beyond = self.is_silent_out_of_reach(age, fate, across_sq, now, reach);
            return (!beyond).then_some(fate.lost_on_points);
        }
        let heard = NeighbourMotion {
            position: self.state.position,
            velocity: self.state.velocity,
            speed_mps: self.speed_mps,
            age_s: age.as_secs_f32(),
            delay_s: if reach.on_plan && self.on_plan() { 0.0 } else { self.message_delay.delay_s },
            // `max_reach_m` does not read the points.
            reported_points: &[],
            place_on_points: PlaceOnPoints::Unknown,
            reported_path_reach: self.reported_path_reach,
            rests_within_m: 0.0,
            grounded: self.reports_any(GROUNDED | LANDED),
            column_bottom_z_m: None,
        };
        let most_m = reach.within_m + heard.max_reach_m(reach.bounds, reach.ahead_s);
        let above_m = if !heard.grounded && self.has_column() { 0.0 } else { away.z };
        let beyond = across_sq + above_m * above_m >= most_m * most_m;
        (!beyond).then_some(false)
    }

    /// Whether the neighbour may fly on although it counts as lost: this vehicle hears nobody, so
    /// that its own receiver may have failed. Not once the neighbour has been silent for `down`, in
    /// which a vehicle without a lease lands, while this vehicle holds its lease. A neighbour out
    /// of the plan needs no lease: its pilot may keep it in the air.
    #[inline(always)]
    pub(crate) fn may_fly_on_though_lost(
        &self,
        down: Duration,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> bool {
        let must_have_landed = reach.holds_lease && !self.heard_within(now, down);
        reach.hears_nobody && (!must_have_landed || self.reports_any(OUT_OF_PLAN))
    }

    /// Whether a neighbour whose position is older than [`SILENT_AFTER_POSITION_AGE`] stays out of
    /// reach, seen from above. The neighbour is at its last position or, by a newer intent, at the
    /// first of its points; or as far from there as it can have flown: at full speed for as long as
    /// it may not have noticed that no vehicle hears it; in a climb to its top and a little
    /// further; once lost, along its points alone. A vehicle that lies on the ground moves no more.
    fn is_silent_out_of_reach(
        &self,
        age: Duration,
        SilentFate { lost_on_points, lies, may_fly_on }: SilentFate,
        across_sq: f32,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> bool {
        let delay_s = self.message_delay.delay_s;
        let mut most_m = 0.0;
        let mut reaches = |far_m: f32| most_m = if far_m > most_m { far_m } else { most_m };
        if may_fly_on || !lost_on_points {
            let silent_s = reach.bounds.stopped_when_unheard_for_s;
            let age_s = if may_fly_on { silent_s } else { age.as_secs_f32().min(silent_s) };
            reaches(reach.bounds.speed_max_mps * (age_s + 2.0 * delay_s));
        }
        let flies_on = self.would_fly_all_points_unheard() && !(reach.on_plan && self.on_plan());
        if reach.lands && self.would_fly_all_points_unheard() {
            reaches(FALL_CARRY_S * self.speed_mps + self.max_fall_drift_m());
        }
        if reach.lands || (lost_on_points && !lies) || (flies_on && !lost_on_points) {
            let beyond_m = self.reported_path_reach.added_reach_m + OFF_REPORTED_PATH_M;
            reaches(self.max_unheard_distance_m() + beyond_m);
        }
        if lost_on_points {
            reaches(MIN_FALL_TIME_S * self.speed_mps);
        }
        if reach.lands || self.climb_top_m().is_some() {
            reaches(self.rest_radius_m(reach));
        }
        let mut away_sq = across_sq;
        let reported = self.intent_at.is_some_and(|at| now - at <= SILENT_AFTER_POSITION_AGE);
        if let Some(first) = self.points.first().filter(|_| reported) {
            away_sq = away_sq.min(reach.own.box_distances(first).xy().norm_squared());
            reaches(if self.would_fly_all_points_unheard() {
                self.max_unheard_distance_m()
            } else {
                self.points_extent_m
            });
        }
        most_m += reach.within_m;
        away_sq >= most_m * most_m
    }

    /// Whether the neighbour may come down from where it is, so that the column below it counts.
    #[inline]
    pub(super) fn has_column(&self) -> bool {
        self.may_come_down || self.reports_any(OUT_OF_PLAN) || self.ground_m.is_nan()
    }

    /// Height of the lower end of the neighbour's column, ENU metres: the ground below it or, where
    /// that is unknown, [`DEFAULT_COLUMN_DEPTH_M`] below `height_m`.
    #[inline]
    fn column_bottom_m(&self, height_m: f32) -> f32 {
        if self.ground_m.is_nan() { height_m - DEFAULT_COLUMN_DEPTH_M } else { self.ground_m }
    }

    /// Age of the neighbour's last intent, seconds, if it is fresh and reports points.
    fn fresh_intent_age_s(&self, now: Instant) -> Option<f32> {
        let heard_at = self.intent_at.filter(|_| !self.points.is_empty());
        heard_at
            .map(|at| (now - at).as_secs_f32())
            .filter(|heard_s| *heard_s < SILENT_AFTER_POSITION_AGE_S)
    }

    /// Age of the neighbour's position; if it never had one, the time since the companion's start.
    #[inline(always)]
    fn position_age(&self, now: Instant) -> Duration {
        now - self.position_at.unwrap_or(Instant::ZERO)
    }

    /// The neighbour for the safety filter, as its last reports describe it. If it counts as
    /// lost, [`FilterNeighbour::count_as_lost`] has to follow; then, if its position is old,
    /// [`Neighbours::apply_silence`].
    #[inline(always)]
    pub(crate) fn filter_neighbour(&self, now: Instant) -> FilterNeighbour<'_> {
        let grounded = self.reports_any(GROUNDED | LANDED);
        let comes_down = !grounded && self.has_column();
        FilterNeighbour {
            id: self.id,
            stranger: self.rank == RANK_OUTSIDE_ROSTER,
            on_plan: self.on_plan(),
            out_of_range: false,
            shares_plan: self.shares_plan,
            lost: false,
            waits: self.reports_any(WAITING) && self.heard_within(now, HEARD_WITHIN),
            stands: grounded || now - self.moved_at >= STANDS_AFTER,
            motion: NeighbourMotion {
                position: self.state.position,
                velocity: self.state.velocity,
                speed_mps: self.speed_mps,
                age_s: self.position_age(now).as_secs_f32(),
                delay_s: self.message_delay.delay_s,
                reported_points: self.points_to_stop(),
                place_on_points: self.place_on_points,
                reported_path_reach: self.reported_path_reach,
                rests_within_m: 0.0,
                grounded,
                column_bottom_z_m: comes_down.then(|| self.column_bottom_m(self.state.position.z)),
            },
            before_climb: None,
        }
    }

    /// For a neighbour silent for longer than a stop takes, replaces the ball around its last
    /// position by the part of its points that it may have flown since. To be called only in a
    /// coverage mission.
    fn limit_to_points<'a>(&'a self, heard: &mut NeighbourMotion<'a>, bounds: &MotionBounds) {
        let stopped_s = bounds.stopped_when_unheard_for_s + 2.0 * heard.delay_s;
        let follows = !heard.reported_points.is_empty()
            && matches!(self.place_on_points, PlaceOnPoints::On { .. });
        if !follows || heard.age_s <= stopped_s || heard.grounded {
            return;
        }
        let fastest_mps = libm::fmaxf(bounds.speed_max_mps, heard.speed_mps);
        let flown_m = fastest_mps * (heard.age_s + heard.delay_s)
            + bounds.braking.stop_distance_m(fastest_mps);
        (heard.age_s, heard.delay_s, heard.speed_mps) = (0.0, 0.0, 0.0);
        (heard.reported_points, heard.place_on_points) = (&self.points, self.place_on_points);
        heard.reported_path_reach.max_reach_m = f32::INFINITY;
        heard.rests_within_m = libm::fminf(flown_m, self.max_unheard_distance_m());
    }

    /// Greatest extent of the neighbour's set around the place where it stopped unheard, metres.
    #[inline(never)]
    fn rest_radius_m(&self, reach: &ReachQuery<'_>) -> f32 {
        let rests = NeighbourMotion {
            position: self.state.position,
            velocity: self.state.velocity,
            speed_mps: 0.0,
            age_s: 0.0,
            delay_s: self.message_delay.delay_s.max(MAX_UNHEARD_BEYOND_TOP_S),
            reported_points: &[],
            place_on_points: PlaceOnPoints::Beside,
            reported_path_reach: ReportedPathReach::UNBOUNDED,
            rests_within_m: 0.0,
            grounded: false,
            column_bottom_z_m: None,
        };
        rests.max_reach_m(reach.bounds, reach.ahead_s)
    }

    /// Whether the neighbour follows the plan out of radio range, as others relay or by its last
    /// position.
    fn is_out_of_range(&self, now: Instant) -> bool {
        let silent =
            !self.reports_any(GROUNDED) && !self.heard_within(now, SILENT_AFTER_POSITION_AGE);
        let unheard = silent && self.at_range_edge && self.on_plan();
        let flies_on =
            || self.flies_plan_unheard() || self.heard_within(now, MAX_OUT_OF_RANGE_WAIT);
        self.is_reported_out_of_range(now) || (unheard && flies_on())
    }

    /// Whether the filter counts the neighbour as lost, at rest on its points: its position has
    /// this age, [`LOST_AFTER`] or more, it reported points, and it is dead ([`Self::is_dead`]) or
    /// not reported out of range ([`Self::is_reported_out_of_range`]).
    #[inline(never)]
    pub(super) fn is_lost_on_points(&self, age: Duration, now: Instant) -> bool {
        age >= LOST_AFTER
            && !self.points.is_empty()
            && (self.is_dead(now) || !self.is_reported_out_of_range(now))
    }
}

impl<const V: usize> Neighbours<V> {
    /// System id of a vehicle in flight, not out of the plan, within `apart_m` of the vertical
    /// through `pad` whose positions have been missing for 0.6 to 3 s: three or more were lost, or
    /// it has fallen silent.
    #[inline(never)]
    pub(crate) fn missed_vehicle_beside(
        &self,
        pad: &Point,
        apart_m: f32,
        now: Instant,
    ) -> Option<u8> {
        let missed = |c: &&NeighbourEntry| {
            let flies = !c.reports_any(GROUNDED | LANDED | OUT_OF_PLAN) && !c.at_range_edge;
            let beside = (c.state.position - pad).xy().norm_squared() < apart_m * apart_m;
            let lately =
                |at: Instant| now - at > NO_ARMING_BESIDE_SILENT_AFTER && now - at < MAY_LAND_AFTER;
            flies && beside && c.position_at.is_some_and(lately)
        };
        self.entries[..self.roster_count].iter().find(missed).map(|c| c.id)
    }

    /// The first neighbour from index `from` on, inclusive, that has a position and may be within
    /// reach: its index, its entry, and whether it counts as lost.
    pub(crate) fn next_within_reach(
        &self,
        from: usize,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> Option<(usize, &NeighbourEntry, bool)> {
        // A loop: a board takes a third longer for the chain of iterators.
        for (i, entry) in self.entries.iter().enumerate().skip(from) {
            if let Some(lost_on_points) = entry.lost_if_within_reach(self.down_after, now, reach) {
                return Some((i, entry, lost_on_points));
            }
        }
        None
    }

    /// Whether a neighbour may fly on although it counts as lost
    /// ([`NeighbourEntry::may_fly_on_though_lost`]).
    pub(crate) fn may_fly_on_though_lost(
        &self,
        entry: &NeighbourEntry,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> bool {
        entry.may_fly_on_though_lost(self.down_after, now, reach)
    }

    /// Changes `met`, made by [`NeighbourEntry::filter_neighbour`], if the neighbour's position is
    /// older than [`SILENT_AFTER_POSITION_AGE`]. A call of its own: a board takes long to copy what
    /// one call would return.
    #[inline(always)]
    pub(crate) fn apply_silence<'a>(
        &'a self,
        entry: &'a NeighbourEntry,
        now: Instant,
        met: &mut FilterNeighbour<'a>,
    ) {
        let position_age = entry.position_age(now);
        // Most are heard.
        if position_age >= SILENT_AFTER_POSITION_AGE {
            self.change_to_silent(entry, position_age, now, met);
        }
    }

    /// Changes `met` to what a neighbour with a position this old may have done since: stopped on
    /// its points, climbed on, or come down.
    #[inline(never)]
    fn change_to_silent<'a>(
        &'a self,
        entry: &'a NeighbourEntry,
        position_age: Duration,
        now: Instant,
        met: &mut FilterNeighbour<'a>,
    ) {
        let (motion, lost) = (&mut met.motion, met.lost);
        let placed_s = motion.age_s;
        let is_old = |age_s: f32| age_s > SILENT_AFTER_POSITION_AGE_S;
        // If only an intent is fresh, its first point, the setpoint, stands for the position.
        let heard_s = entry.fresh_intent_age_s(now).filter(|_| is_old(placed_s));
        let (by_intent, age_s) = (heard_s.is_some(), heard_s.unwrap_or(placed_s));
        // Silent for `down_after`, or grounded without a position of its own, the neighbour lies on
        // the ground below; before that it rests in the zone that detours stay clear of.
        let down = position_age >= self.down_after
            || (entry.reports_any(GROUNDED) && entry.lacks_position());
        let lies = down && (lost || entry.reports_any(GROUNDED)) && !entry.ground_m.is_nan();
        let least_m = if lost && !by_intent { entry.min_rest_distance_m() } else { 0.0 };
        let rest = entry.nearest_rest_place(least_m);
        let heard = entry.points.first().filter(|_| by_intent).copied();
        motion.position = heard.or(rest.map(|(at, ..)| at)).unwrap_or(motion.position);
        // A neighbour silent in its climb may have flown to the climb's top, or just above it.
        let top = if is_old(age_s) && !lies { entry.climb_top_m() } else { None };
        let mut highest_m = entry.ground_m;
        if lies {
            let field = self.area_ground();
            highest_m = field.map_or(entry.ground_m, |g| entry.max_ground_m(g, &motion.position));
            motion.position.z = libm::fminf(highest_m, motion.position.z);
        } else if let Some(top) = top {
            motion.position.z = top;
        }
        motion.grounded = (motion.grounded && top.is_none()) || lies;
        let bottom_m = entry.column_bottom_m(motion.position.z);
        // A lost neighbour that flew along its points stopped on them, and rests in the zone that
        // detours stay clear of.
        motion.age_s = age_s;
        if lost || top.is_some() {
            (motion.speed_mps, motion.age_s) = (0.0, 0.0);
            motion.delay_s = if lost { 0.0 } else { MAX_UNHEARD_BEYOND_TOP_S };
        }
        if lost {
            motion.reported_points = rest.map_or(&entry.points, |(_, points, _)| points);
            if top.is_none() {
                motion.rests_within_m = entry.max_unheard_distance_m() - least_m;
            }
        }
        if top.is_some() || lies {
            motion.reported_points = &[];
        }
        let flies = !(by_intent || lies || top.is_some());
        let moved = match rest {
            _ if !flies => Some(PlaceOnPoints::Unknown),
            Some((.., place)) => Some(place),
            None => None,
        };
        moved.into_iter().for_each(|place| put_on_points(motion, place, entry.points_extent_m));
        if lost && flies {
            motion.reported_path_reach.max_reach_m = f32::INFINITY;
        }
        let column =
            (lost || entry.has_column()) && (!motion.grounded || (lies && highest_m > bottom_m));
        motion.column_bottom_z_m = column.then_some(bottom_m);
        met.out_of_range = entry.is_out_of_range(now);
        let stands = now - entry.moved_at >= STANDS_AFTER && age_s < SILENT_AFTER_POSITION_AGE_S;
        met.stands = motion.grounded || stands;
        met.before_climb = top.map(|_| entry.state.position);
    }
}

/// Sets the place on its points, and their reach, of a neighbour whose position or points were
/// replaced.
fn put_on_points(motion: &mut NeighbourMotion<'_>, place: PlaceOnPoints, extent_m: f32) {
    motion.place_on_points = place;
    motion.reported_path_reach =
        ReportedPathReach::new(&motion.position, motion.reported_points, &place, extent_m);
}
