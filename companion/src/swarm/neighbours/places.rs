//! Keep-out zones where the other vehicles are or may get to, for the search for a detour.

use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::{Length, Point};

use super::dead_reckoning::AreaGround;
use super::entry::NeighbourEntry;
use super::{
    AVOIDED_WITHIN_M, GROUNDED, LANDED, MAX_HEIGHT_DIFFERENCE_M, NO_PLACE, Neighbours, ON_PLAN,
    OUT_OF_PLAN, SILENT_AFTER_POSITION_AGE, SILENT_AFTER_POSITION_AGE_S, UNHEARD_LANDING_AFTER,
};
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// Distance by which two vehicles in the air, one of them off the plan, may be nearer than
    /// their estimates say, metres; 0 outside coverage missions, where walls leave no room for it.
    pub(crate) fn pair_position_error_m(&self) -> f32 {
        self.pair_position_error_m
    }

    /// Ground and landing time in a coverage mission; `None` in other missions.
    pub(super) fn area_ground(&self) -> Option<AreaGround> {
        self.fleet.is_some().then_some(AreaGround {
            ground: self.ground,
            down_after: self.down_after,
            pair_position_error_m: self.pair_position_error_m,
        })
    }

    /// Distance along its points that a neighbour may have flown since it was last heard, metres,
    /// from the first place on them where it may have been: that of a stop; in a coverage mission,
    /// after [`UNHEARD_LANDING_AFTER`] of silence, all of them. If this vehicle hears nobody, its
    /// own radio has more likely failed: then the others fly on to places that this vehicle does
    /// not know, and only a stop is assumed.
    #[inline(never)]
    fn max_unheard_flown_m(&self, entry: &NeighbourEntry, now: Instant) -> f32 {
        let lands = !entry.heard_within(now, UNHEARD_LANDING_AFTER);
        let far = lands && entry.may_fly_on_silent(now) && !self.hears_nobody(now);
        let flown_m = match far {
            true => entry.max_unheard_distance_m(),
            false => entry.unheard_stopping_distance_m(),
        };
        flown_m + entry.place_on_points.place_uncertainty_m()
    }

    /// Calls `visit` with the keep-out zones, of radius `apart_m`, of neighbour `i` of the table if
    /// it is out of the plan, unless the present detour already avoids its place.
    pub fn for_each_unavoided_zone_of(
        &self,
        i: usize,
        now: Instant,
        apart_m: f32,
        mut visit: impl FnMut(KeepOutZone),
    ) {
        let avoided =
            |c: &NeighbourEntry| (c.avoided_place - c.state.position).length() < AVOIDED_WITHIN_M;
        let unknown =
            |c: &&NeighbourEntry| c.position_at.is_some() && c.is_out_of_plan(now) && !avoided(c);
        if let Some(entry) = self.entries.get(i).filter(unknown) {
            entry.visit_keep_out_zones(
                now,
                [apart_m, self.max_unheard_flown_m(entry, now)],
                self.area_ground(),
                &mut visit,
            );
        }
    }

    /// Notes that a scan begun at time `at` has found no vehicle out of the plan on the path.
    pub fn mark_path_clear(&mut self, at: Instant) {
        self.path_clear_at = at;
    }

    /// Whether a scan begun at `at` or later has found the path clear.
    pub fn is_path_clear_since(&self, at: Instant) -> bool {
        self.path_clear_at >= at
    }

    /// Calls `visit` with the keep-out zones of the roster's other vehicles where they stand now,
    /// or rest out of the plan. `apart`: radius for one in the air; for one of these that is heard
    /// and not out of the plan, which keeps its place; and for one on the ground, which no longer
    /// deviates.
    pub fn for_each_keep_out_zone(
        &self,
        now: Instant,
        apart: [f32; 3],
        mut visit: impl FnMut(KeepOutZone),
    ) {
        (0..self.roster_count).for_each(|i| self.for_each_zone_of(i, now, apart, &mut visit));
    }

    /// Calls `visit` with the keep-out zones of neighbour `i` of the roster where it stands or
    /// rests: of radius `grounded_m` if it is on the ground, `heard_in_air_m` if it is heard and
    /// not out of the plan, else `apart_m`.
    pub(crate) fn for_each_zone_of(
        &self,
        i: usize,
        now: Instant,
        [apart_m, heard_in_air_m, grounded_m]: [f32; 3],
        visit: &mut dyn FnMut(KeepOutZone),
    ) {
        let rostered = self.entries[..self.roster_count].get(i);
        if let Some(entry) = rostered.filter(|c| c.position_at.is_some()) {
            let heard = entry.heard_within(now, SILENT_AFTER_POSITION_AGE);
            let far_m = match (entry.is_on_ground(now, self.down_after), heard) {
                (true, _) => grounded_m,
                (false, true) if !entry.reports_any(OUT_OF_PLAN) => heard_in_air_m,
                (false, _) => apart_m,
            };
            let reach = [far_m, self.max_unheard_flown_m(entry, now)];
            entry.visit_keep_out_zones(now, reach, self.area_ground(), visit);
            if self.fleet.is_none() && !heard {
                self.visit_silent_zones(entry, now, reach, visit);
            }
        }
    }

    /// Calls `visit` with zones around a silent neighbour in the air that the safety filter lets no
    /// vehicle enter: along its path once it counts as dead; before that a ball, smaller than the
    /// filter's, if this vehicle hears others. Without these zones the search would find, again and
    /// again, a detour that the filter stops.
    // Not inlined, as other calls that a board seldom makes.
    #[inline(never)]
    fn visit_silent_zones(
        &self,
        entry: &NeighbourEntry,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        visit: &mut dyn FnMut(KeepOutZone),
    ) {
        let kind = ZoneKind::Static;
        if entry.reports_any(GROUNDED | LANDED | OUT_OF_PLAN)
            || entry.is_on_ground(now, self.down_after)
            || entry.flies_plan_unheard()
        {
            return;
        }
        if entry.is_dead(now) {
            entry.for_each_unheard_leg(upto_m, &mut |[from, next], [leg_m, flown_m]| {
                let share = if flown_m < leg_m { flown_m / leg_m } else { 1.0 };
                let to = from + (next - from) * share;
                visit(KeepOutZone { from, to, radius_m: apart_m, kind });
            });
        } else if !self.hears_nobody(now) {
            let from = entry.state.position;
            let far_s = SILENT_AFTER_POSITION_AGE_S + 2.0 * entry.message_delay.delay_s;
            let radius_m = apart_m + self.max_progress_mps * far_s;
            visit(KeepOutZone { from, to: from, radius_m, kind });
        }
    }

    /// Calls `visit` with the columns, of radius `apart_m`, in which vehicles may come down that
    /// land without avoiding others.
    pub fn for_each_landing_column(
        &self,
        now: Instant,
        apart_m: f32,
        mut visit: impl FnMut(KeepOutZone),
    ) {
        (0..self.len()).for_each(|i| self.visit_landing_column(i, now, apart_m, &mut visit));
    }

    /// Calls `visit` with the columns, of radius `apart_m`, in which neighbour `i` may come down,
    /// if it may land without avoiding others.
    pub fn visit_landing_column(
        &self,
        i: usize,
        now: Instant,
        apart_m: f32,
        mut visit: impl FnMut(KeepOutZone),
    ) {
        let landing =
            |c: &&NeighbourEntry| c.position_at.is_some() && c.may_land_without_avoiding(now);
        if let Some(entry) = self.entries.get(i).filter(landing) {
            entry.visit_landing_columns(
                now,
                [apart_m, self.max_unheard_flown_m(entry, now)],
                &mut visit,
            );
        }
    }

    /// Calls `visit` with the zones in which a landing would end within `apart_m` of another
    /// vehicle: a path may lead through them, but not end there. In a coverage mission a silent
    /// vehicle may come down anywhere along its points, or at its pad: that bars places at height
    /// `height_m`.
    pub fn for_each_landing_zone(
        &self,
        now: Instant,
        [apart_m, height_m]: [f32; 2],
        mut visit: impl FnMut(KeepOutZone),
    ) {
        for entry in self.entries.iter().filter(|c| c.position_at.is_some()) {
            let mut zone = |from: Point, to: Point, radius_m: f32| {
                visit(KeepOutZone { from, to, radius_m, kind: ZoneKind::LandingColumn });
            };
            let from = entry.state.position;
            zone(from, from + Point::new(0.0, 0.0, MAX_HEIGHT_DIFFERENCE_M), apart_m);
            // Landing places are sought at one height, so there a zone is as wide as the distance
            // that a landing keeps.
            let level = |at: Point| Point::new(at.x, at.y, height_m);
            let mut bar = |[a, b]: [Point; 2], wider_m: f32| {
                zone(level(a), level(b), apart_m + self.pair_position_error_m + wider_m);
            };
            if entry.may_fly_on_silent(now) {
                entry.for_each_unheard_leg(entry.max_unheard_distance_m(), &mut |leg, _| {
                    bar(leg, 0.0);
                });
            }
            // A vehicle in the air may come down at its pad; off its plan also below its place, or
            // at the end of its points.
            if entry.would_fly_all_points_unheard() && entry.is_under_way() {
                entry.pad.into_iter().for_each(|pad| bar([pad; 2], 0.0));
                if !entry.reports_any(ON_PLAN) {
                    bar([from; 2], 0.0);
                    entry.points.last().into_iter().for_each(|end| bar([*end; 2], 0.0));
                }
            }
            if let Some((leg, aside_m)) = entry.fall_line(now) {
                bar(leg, aside_m);
            }
        }
    }

    /// Calls `visit` with the column above the last position of neighbour `i`, of radius `apart_m`:
    /// there this vehicle might come down on it.
    pub fn visit_column_above(&self, i: usize, apart_m: f32, mut visit: impl FnMut(KeepOutZone)) {
        if let Some(entry) = self.entries.get(i).filter(|c| c.position_at.is_some()) {
            let from = entry.state.position;
            let to = from + Point::new(0.0, 0.0, MAX_HEIGHT_DIFFERENCE_M);
            visit(KeepOutZone { from, to, radius_m: apart_m, kind: ZoneKind::Static });
        }
    }

    /// Whether neighbour `i`, silent in flight, may have come down within `apart_m` of the column
    /// from `place` to the ground at `floor_m`: below any leg that it may have flown along its
    /// points, except legs `apart_m` or more below that ground. With the present time in `fallen`
    /// it may also have fallen, and not straight down.
    pub(crate) fn may_lie_below(
        &self,
        i: usize,
        place: &Point,
        floor_m: f32,
        apart_m: f32,
        fallen: Option<Instant>,
    ) -> bool {
        let Some(entry) = self.entries.get(i).filter(|c| c.is_under_way()) else { return false };
        let (mut below, low_m) = (false, floor_m - apart_m);
        let mut near = |a: Point, b: Point, apart_m: f32| {
            let (leg, away) = ((b - a).xy(), (place - a).xy());
            let share = (away.dot(&leg) / leg.norm_squared().max(1e-6)).clamp(0.0, 1.0);
            let high = a.z > low_m || b.z > low_m;
            below |= high && (away - leg * share).norm_squared() < apart_m * apart_m;
        };
        // From its position, not the place on its points beside it: it may have fallen.
        entry.for_each_unheard_leg_from(
            entry.state.position,
            entry.max_unheard_distance_m() + entry.place_on_points.place_uncertainty_m(),
            &mut |[at, next], [leg_m, flown_m]| {
                near(
                    at,
                    if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next },
                    apart_m,
                );
            },
        );
        if let Some(([from, to], aside_m)) = fallen.and_then(|now| entry.fall_line(now)) {
            near(from, to, apart_m + aside_m);
        }
        below
    }

    /// Whether a neighbour's last position is lower than `position` and within `within_m` of its
    /// vertical.
    pub fn any_below(&self, position: &Point, within_m: f32) -> bool {
        let under = |p: &Point| p.z < position.z && (p - position).xy().length() < within_m;
        self.entries.iter().any(|c| c.position_at.is_some() && under(&c.state.position))
    }

    /// Notes where the vehicles out of the plan rest now: the detour that begins now avoids
    /// these places.
    pub fn mark_out_of_plan_avoided(&mut self, now: Instant) {
        for entry in &mut self.entries {
            entry.avoided_place =
                if entry.is_out_of_plan(now) { entry.state.position } else { NO_PLACE };
        }
    }

    /// Forgets the places that a detour avoided: they may block the path again.
    pub(crate) fn forget_avoided(&mut self) {
        self.entries.iter_mut().for_each(|entry| entry.avoided_place = NO_PLACE);
    }
}

#[cfg(test)]
mod tests;
