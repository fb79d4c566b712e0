//! Where others are and may come to be, as the search for a detour asks for it.

use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::{Length, Point};

use super::contact::{AreaGround, NeighbourEntry};
use super::{
    LANDS_UNHEARD, MAX_HEIGHT_DIFFERENCE_M, NO_PLACE, Neighbours, ON_PLAN, VAGUE_POSITION_M,
};
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// Distance by which vehicles in the air, off the plan, may be nearer than they believe,
    /// metres: 0 where walls leave no room for it.
    pub(crate) fn pair_position_error_m(&self) -> f32 {
        self.pair_position_error_m
    }

    /// The ground, where the mission is an area.
    pub(super) fn area_ground(&self) -> Option<AreaGround> {
        self.fleet.is_some().then_some(AreaGround {
            ground: self.ground,
            down: self.down,
            pair_position_error_m: self.pair_position_error_m,
        })
    }

    /// Distance along its points that a contact may have come unheard, metres. A vehicle that hears
    /// no other vehicle has lost its own radio rather: the others fly on, nobody knows where.
    #[inline(never)]
    fn unheard_progress_m(&self, contact: &NeighbourEntry, now: Instant) -> f32 {
        let lands = !contact.heard_within(now, LANDS_UNHEARD);
        let far = lands && contact.may_fly_on(now) && !self.hears_nobody(now);
        if far { contact.unheard_distance_m() } else { contact.unheard_stop_m() }
    }

    /// Keep-out zones of contact `i` where it lies, stands or hovers and neither the plan nor its
    /// detour says so: `apart_m` away from it is far enough.
    pub fn for_each_zone_of(
        &self,
        i: usize,
        now: Instant,
        apart_m: f32,
        mut tell: impl FnMut(KeepOutZone),
    ) {
        let avoided =
            |c: &NeighbourEntry| (c.avoided_at - c.state.position).length() < VAGUE_POSITION_M;
        let unknown =
            |c: &&NeighbourEntry| c.position_at.is_some() && c.is_out_of_plan(now) && !avoided(c);
        if let Some(contact) = self.contacts.get(i).filter(unknown) {
            contact.keep_out_zones(
                now,
                [apart_m, self.unheard_progress_m(contact, now)],
                self.area_ground(),
                &mut tell,
            );
        }
    }

    /// Notes that every vehicle out of the plan at time `at` was checked and none blocks the path.
    pub fn mark_path_clear(&mut self, at: Instant) {
        self.clear_at = at;
    }

    /// Whether the path was found clear at `at` or later.
    pub fn is_path_clear_since(&self, at: Instant) -> bool {
        self.clear_at >= at
    }

    /// Places of the other vehicles of the roster while they stand, those out of the plan among
    /// them: `apart_m` away from one in the air is far enough, and `lying_m` from one that lies,
    /// and no longer deviates.
    pub fn for_each_place(&self, now: Instant, apart: [f32; 2], mut tell: impl FnMut(KeepOutZone)) {
        (0..self.roster).for_each(|i| self.places_of(i, now, apart, &mut tell));
    }

    /// The places of contact `i`.
    pub(crate) fn places_of(
        &self,
        i: usize,
        now: Instant,
        [apart_m, lying_m]: [f32; 2],
        tell: &mut dyn FnMut(KeepOutZone),
    ) {
        let rostered = self.contacts[..self.roster].get(i);
        if let Some(contact) = rostered.filter(|c| c.position_at.is_some()) {
            let far_m = if contact.is_on_ground(now, self.down) { lying_m } else { apart_m };
            let reach = [far_m, self.unheard_progress_m(contact, now)];
            contact.keep_out_zones(now, reach, self.area_ground(), tell);
        }
    }

    /// Columns in which vehicles that land without looking may come nearer than `apart_m`.
    pub fn for_each_landing_column(
        &self,
        now: Instant,
        apart_m: f32,
        mut tell: impl FnMut(KeepOutZone),
    ) {
        (0..self.len()).for_each(|i| self.landing_column(i, now, apart_m, &mut tell));
    }

    /// The columns of contact `i`.
    pub fn landing_column(
        &self,
        i: usize,
        now: Instant,
        apart_m: f32,
        mut tell: impl FnMut(KeepOutZone),
    ) {
        let landing = |c: &&NeighbourEntry| c.position_at.is_some() && c.may_land_unseen(now);
        if let Some(contact) = self.contacts.get(i).filter(landing) {
            contact.landing_columns(
                now,
                [apart_m, self.unheard_progress_m(contact, now)],
                &mut tell,
            );
        }
    }

    /// Zones in which a landing would end within `apart_m` of a vehicle that is there: a path may
    /// lead over them, and not end there. Over an area a silent one may come down anywhere on its
    /// way, or at its pad: that bars places at `height_m`.
    pub fn for_each_landing_zone(
        &self,
        now: Instant,
        [apart_m, height_m]: [f32; 2],
        mut tell: impl FnMut(KeepOutZone),
    ) {
        for contact in self.contacts.iter().filter(|c| c.position_at.is_some()) {
            let mut zone = |from: Point, to: Point, radius_m: f32| {
                tell(KeepOutZone { from, to, radius_m, kind: ZoneKind::Descending });
            };
            let from = contact.state.position;
            zone(from, from + Point::new(0.0, 0.0, MAX_HEIGHT_DIFFERENCE_M), apart_m);
            // A place to land at is sought at one height, and as far away as the landing keeps.
            let level = |at: Point| Point::new(at.x, at.y, height_m);
            let mut bar = |[a, b]: [Point; 2], wider_m: f32| {
                zone(level(a), level(b), apart_m + self.pair_position_error_m + wider_m);
            };
            if contact.may_fly_on(now) {
                contact.for_each_leg(contact.unheard_distance_m(), &mut |leg, _| bar(leg, 0.0));
            }
            // Whoever is in the air comes down at its pad, or off its plan below where it is, or at
            // the end of its way.
            if contact.is_leased() && contact.is_under_way() {
                contact.pad.into_iter().for_each(|pad| bar([pad; 2], 0.0));
                if !contact.reports(ON_PLAN) {
                    bar([from; 2], 0.0);
                    contact.points.last().into_iter().for_each(|end| bar([*end; 2], 0.0));
                }
            }
            if let Some((leg, aside_m)) = contact.fall(now) {
                bar(leg, aside_m);
            }
        }
    }

    /// Everything above where contact `i` was last heard, within `apart_m` of its vertical, and as
    /// near beside it.
    pub fn column_above(&self, i: usize, apart_m: f32, mut tell: impl FnMut(KeepOutZone)) {
        if let Some(contact) = self.contacts.get(i).filter(|c| c.position_at.is_some()) {
            let from = contact.state.position;
            let to = from + Point::new(0.0, 0.0, MAX_HEIGHT_DIFFERENCE_M);
            tell(KeepOutZone { from, to, radius_m: apart_m, kind: ZoneKind::Static });
        }
    }

    /// Whether contact `i`, unheard in flight, may have come down within `apart_m` of the column
    /// from `place` down to the ground at `floor_m`: from where it may have come along its path it
    /// comes down, never up. At the time `fallen`, if that is given, it may have fallen too, and
    /// not straight down.
    pub(crate) fn may_lie_below(
        &self,
        i: usize,
        place: &Point,
        floor_m: f32,
        apart_m: f32,
        fallen: Option<Instant>,
    ) -> bool {
        let Some(contact) = self.contacts.get(i).filter(|c| c.is_under_way()) else { return false };
        let (mut below, low_m) = (false, floor_m - apart_m);
        let mut near = |a: Point, b: Point, apart_m: f32| {
            let (leg, away) = ((b - a).xy(), (place - a).xy());
            let share = (away.dot(&leg) / leg.norm_squared().max(1e-6)).clamp(0.0, 1.0);
            let high = a.z > low_m || b.z > low_m;
            below |= high && (away - leg * share).norm_squared() < apart_m * apart_m;
        };
        contact.for_each_leg(contact.unheard_distance_m(), &mut |[at, next], [leg_m, flown_m]| {
            near(
                at,
                if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next },
                apart_m,
            );
        });
        if let Some(([from, to], aside_m)) = fallen.and_then(|now| contact.fall(now)) {
            near(from, to, apart_m + aside_m);
        }
        below
    }

    /// Whether a neighbour was last heard lower than `position` and within `within_m` of its
    /// vertical.
    pub fn any_below(&self, position: &Point, within_m: f32) -> bool {
        let under = |p: &Point| p.z < position.z && (p - position).xy().length() < within_m;
        self.contacts.iter().any(|c| c.position_at.is_some() && under(&c.state.position))
    }

    /// Marks the vehicles that now rest: a detour around them was planned.
    pub fn mark_avoided(&mut self, now: Instant) {
        for contact in &mut self.contacts {
            contact.avoided_at =
                if contact.is_out_of_plan(now) { contact.state.position } else { NO_PLACE };
        }
    }

    /// Vehicles that a detour led around count again.
    pub(crate) fn forget_avoided(&mut self) {
        self.contacts.iter_mut().for_each(|contact| contact.avoided_at = NO_PLACE);
    }
}

#[cfg(test)]
mod tests;
