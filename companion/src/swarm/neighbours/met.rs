//! A neighbour as the safety filter sees it: the inputs of its reachable set; or that it is too far
//! away to matter.

use planner_core::Point;
use planner_core::safety::{
    MotionBounds, NeighbourMotion, OFF_REPORTED_PATH_M, OwnSet, PlaceOnPoints,
};

use super::*;

/// A neighbour as the safety filter sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterNeighbour<'a> {
    pub(crate) id: u8,
    /// Whether the roster does not name it, so that only its positions count.
    pub(crate) stranger: bool,
    /// Whether the neighbour was last heard to follow the shared plan.
    pub(crate) on_plan: bool,
    /// Whether the neighbour follows the shared plan out of radio range, as others relay or by its
    /// last position.
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
    /// Last position of a neighbour that may have climbed to its top since, where its set is: it
    /// may not have begun the climb.
    pub(crate) before_climb: Option<Point>,
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
    /// Flight time of the neighbours that has to be free as well, seconds.
    pub(crate) ahead_s: f32,
    /// Whether this vehicle follows the shared plan: gates keep it apart from those that do too.
    pub(crate) on_plan: bool,
    /// Whether this vehicle hears no other one: then the others are assumed to fly on.
    pub(crate) hears_nobody: bool,
    /// Whether this vehicle lands, or descends over an area: then places count where unheard
    /// vehicles may lie.
    pub(crate) lands: bool,
}

impl NeighbourEntry {
    /// `None` if the neighbour stays out of reach wherever it can be, as most do: found without
    /// computing its set. Else whether it counts as dead. Never `None` where the set of
    /// [`Neighbours::for_filter`] would come within reach.
    #[inline(always)]
    fn within_reach(&self, down: Duration, now: Instant, reach: &ReachQuery<'_>) -> Option<bool> {
        let placed_at = self.position_at?;
        let away = reach.own.away_from_box(&self.state.position);
        let across_sq = away.x * away.x + away.y * away.y;
        let age = now - placed_at;
        if age > MAX_HEIGHT_AGE {
            let lies = age >= down && !self.ground_m.is_nan();
            let dead = self.rests_silently(age, now);
            let beyond = self.is_silent_beyond(age, (dead, lies), across_sq, now, reach);
            return (!beyond).then_some(dead);
        }
        let heard = NeighbourMotion {
            position: self.state.position,
            velocity: self.state.velocity,
            speed_mps: self.speed_mps,
            age_s: age.as_secs_f32(),
            delay_s: if reach.on_plan && self.on_plan() { 0.0 } else { self.message_delay.delay_s },
            // Only the first point is read.
            points: &self.points,
            place_on_points: self.place_on_points,
            extent_m: self.extent_m,
            rests_within_m: 0.0,
            grounded: self.reports(GROUNDED | LANDED),
            column_to_m: None,
        };
        let most_m = reach.within_m + heard.reach_m(reach.bounds, reach.ahead_s);
        let column = !heard.grounded
            && (self.may_come_down || self.reports(OUT_OF_PLAN) || self.ground_m.is_nan());
        let above_m = if column { 0.0 } else { away.z };
        let beyond = across_sq + above_m * above_m >= most_m * most_m;
        (!beyond).then_some(false)
    }

    /// Whether a neighbour whose position is older than [`MAX_HEIGHT_AGE`] stays out of reach, seen
    /// from above. It is at its last position or, by a newer intent, at the first of its points; or
    /// as far from there as it can have flown: at full speed for as long as it may not have noticed
    /// that no vehicle hears it; in a climb to its top and a little further; once dead, along its
    /// points alone. A vehicle that lies on the ground moves no more.
    fn is_silent_beyond(
        &self,
        age: Duration,
        (dead, lies): (bool, bool),
        across_sq: f32,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> bool {
        let delay_s = self.message_delay.delay_s;
        let mut most_m = 0.0;
        let mut reaches = |far_m: f32| most_m = if far_m > most_m { far_m } else { most_m };
        if reach.hears_nobody || !dead {
            let silent_s = reach.bounds.silent_s;
            let age_s = if reach.hears_nobody { silent_s } else { age.as_secs_f32().min(silent_s) };
            reaches(reach.bounds.speed_max_mps * (age_s + 2.0 * delay_s));
        }
        let flies_on = self.is_leased() && !(reach.on_plan && self.on_plan());
        if reach.lands && self.is_leased() {
            reaches(FALL_CARRY_S * self.speed_mps + self.fall_aside_m());
        }
        if reach.lands || (dead && !lies) || (flies_on && !dead) {
            reaches(
                self.unheard_distance_m()
                    + self.place_on_points.flown_beyond_m()
                    + OFF_REPORTED_PATH_M,
            );
        }
        if reach.lands || self.climb_top_m().is_some() {
            reaches(self.rest_radius_m(reach));
        }
        let mut away_sq = across_sq;
        let told = self.intent_at.is_some_and(|at| now - at <= MAX_HEIGHT_AGE);
        if let Some(first) = self.points.first().filter(|_| told) {
            away_sq = away_sq.min(reach.own.away_from_box(first).xy().norm_squared());
            reaches(if self.is_leased() { self.unheard_distance_m() } else { self.extent_m });
        }
        most_m += reach.within_m;
        away_sq >= most_m * most_m
    }

    /// Points along which it may have flown, all of them once it is dead; and an upper bound of the
    /// distance from the first to any other of them, metres.
    fn points_flown(&self, dead: bool) -> (&[Point], f32) {
        match dead {
            true if self.is_leased() => (&self.points, self.unheard_distance_m()),
            true => (&self.points, self.extent_m),
            false => (self.points_for_now(), self.extent_m),
        }
    }

    /// Over an area: for a vehicle silent for longer than a stop takes, replaces the ball around
    /// its last position by the part of its points that it may have flown since.
    pub(crate) fn follow_unheard<'a>(
        &'a self,
        heard: &mut NeighbourMotion<'a>,
        bounds: &MotionBounds,
    ) {
        let stopped_s = bounds.silent_s + 2.0 * heard.delay_s;
        let follows =
            !heard.points.is_empty() && matches!(self.place_on_points, PlaceOnPoints::On { .. });
        if !follows || heard.age_s <= stopped_s || heard.grounded {
            return;
        }
        let fastest_mps = libm::fmaxf(bounds.speed_max_mps, heard.speed_mps);
        let flown_m =
            fastest_mps * (heard.age_s + heard.delay_s) + bounds.braking.stop_m(fastest_mps);
        (heard.age_s, heard.delay_s, heard.speed_mps) = (0.0, 0.0, 0.0);
        (heard.points, heard.place_on_points, heard.extent_m) =
            (&self.points, self.place_on_points, f32::INFINITY);
        heard.rests_within_m = libm::fminf(flown_m, self.unheard_distance_m());
    }

    /// Greatest distance of the vehicle's set from the place where it stopped unheard, metres.
    #[inline(never)]
    fn rest_radius_m(&self, reach: &ReachQuery<'_>) -> f32 {
        let rests = NeighbourMotion {
            position: self.state.position,
            velocity: self.state.velocity,
            speed_mps: 0.0,
            age_s: 0.0,
            delay_s: self.message_delay.delay_s.max(UNHEARD_BEYOND_TOP_S),
            points: &[],
            place_on_points: PlaceOnPoints::Beside,
            extent_m: 0.0,
            rests_within_m: 0.0,
            grounded: false,
            column_to_m: None,
        };
        rests.reach_m(reach.bounds, reach.ahead_s)
    }

    /// Whether the neighbour follows the plan out of radio range, as others relay or by its last
    /// position.
    fn is_out_of_range(&self, now: Instant) -> bool {
        let silent = !self.reports(GROUNDED) && !self.heard_within(now, MAX_HEIGHT_AGE);
        let unheard = silent && self.at_range_edge && self.on_plan();
        let flies_on = || self.flies_plan_unheard() || self.heard_within(now, UNHEARD_WAIT);
        self.is_reported_out_of_range(now) || (unheard && flies_on())
    }

    /// Whether the neighbour counts as dead and rests on its points, with a position of this age.
    #[inline(never)]
    pub(super) fn rests_silently(&self, age: Duration, now: Instant) -> bool {
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
    pub(crate) fn missed_beside(&self, pad: &Point, apart_m: f32, now: Instant) -> Option<u8> {
        let missed = |c: &&NeighbourEntry| {
            let flies = !c.reports(GROUNDED | LANDED | OUT_OF_PLAN) && !c.at_range_edge;
            let beside = (c.state.position - pad).xy().norm_squared() < apart_m * apart_m;
            let lately =
                |at: Instant| now - at > UNHEARD_BEFORE_ARMING && now - at < MAY_LAND_AFTER;
            flies && beside && c.position_at.is_some_and(lately)
        };
        self.contacts[..self.roster].iter().find(missed).map(|c| c.id)
    }

    /// The first contact from index `from` on that was placed and may be within reach: its index,
    /// and whether it counts as dead.
    pub(crate) fn next_within(
        &self,
        from: usize,
        now: Instant,
        reach: &ReachQuery<'_>,
    ) -> Option<(usize, &NeighbourEntry, bool)> {
        // A loop: a board takes a third longer for the chain of iterators.
        for (i, contact) in self.contacts.iter().enumerate().skip(from) {
            if let Some(dead) = contact.within_reach(self.down, now, reach) {
                return Some((i, contact, dead));
            }
        }
        None
    }

    /// A contact as the safety filter sees it, `dead` or not; one without a position counts as last
    /// heard at the shell's start.
    #[inline(always)]
    pub(crate) fn for_filter<'a>(
        &'a self,
        contact: &'a NeighbourEntry,
        dead: bool,
        now: Instant,
    ) -> FilterNeighbour<'a> {
        let placed_for = now - contact.position_at.unwrap_or(Instant::ZERO);
        let placed_s = placed_for.as_secs_f32();
        // Most neighbours are heard: then nothing of what follows for silent ones applies.
        let silent = placed_for >= MAX_HEIGHT_AGE;
        // Where positions are lost, a newer intent gives the place: that of its setpoint.
        let told_at = contact
            .intent_at
            .filter(|_| silent && placed_s > MAX_HEIGHT_AGE_S && !contact.points.is_empty());
        let told_s =
            told_at.map(|at| (now - at).as_secs_f32()).filter(|told_s| *told_s < MAX_HEIGHT_AGE_S);
        let (by_intent, age_s) = (told_s.is_some(), told_s.unwrap_or(placed_s));
        // Silent for `down`, or on the ground without a valid position, a vehicle lies on the
        // ground below its last position.
        let down = silent
            && (placed_for >= self.down || (contact.reports(GROUNDED) && contact.is_imprecise()));
        let lies = down && (dead || contact.reports(GROUNDED)) && !contact.ground_m.is_nan();
        let at = contact.points.first().filter(|_| by_intent);
        let mut here = at.copied().unwrap_or(contact.state.position);
        // Unheard in its climb the neighbour may have come to the top, and a little further.
        let top =
            if silent && age_s > MAX_HEIGHT_AGE_S && !lies { contact.climb_top_m() } else { None };
        let mut highest_m = contact.ground_m;
        if lies {
            highest_m =
                self.area_ground().map_or(contact.ground_m, |g| contact.max_ground_m(g, &here));
            here.z = libm::fminf(highest_m, here.z);
        } else if let Some(top) = top {
            here.z = top;
        }
        let grounded = (contact.reports(GROUNDED | LANDED) && top.is_none()) || lies;
        let down = dead
            || contact.may_come_down
            || contact.reports(OUT_OF_PLAN)
            || contact.ground_m.is_nan();
        let floor_m =
            if contact.ground_m.is_nan() { here.z - MAX_COLUMN_M } else { contact.ground_m };
        let (rests, unknown) = (dead || top.is_some(), by_intent || lies || top.is_some());
        let (points, extent_m) = contact.points_flown(dead);
        let heard = NeighbourMotion {
            position: here,
            velocity: contact.state.velocity,
            speed_mps: if rests { 0.0 } else { contact.speed_mps },
            // A dead vehicle stopped on its points, or climbed to its top, and rests there: no ball
            // grows around it.
            age_s: if rests { 0.0 } else { age_s },
            delay_s: match (dead, top) {
                (false, Some(_)) => UNHEARD_BEYOND_TOP_S,
                (true, _) => 0.0,
                _ => contact.message_delay.delay_s,
            },
            points: if top.is_some() || lies { &[] } else { points },
            place_on_points: if unknown { PlaceOnPoints::Unknown } else { contact.place_on_points },
            extent_m,
            rests_within_m: if dead && top.is_none() { contact.unheard_distance_m() } else { 0.0 },
            grounded,
            column_to_m: (down && (!grounded || (lies && highest_m > floor_m))).then_some(floor_m),
        };
        FilterNeighbour {
            id: contact.id,
            stranger: contact.rank == STRANGER_RANK,
            on_plan: contact.on_plan(),
            out_of_range: silent && contact.is_out_of_range(now),
            shares_plan: contact.shares_plan,
            lost: dead,
            waits: contact.reports(WAITING) && contact.heard_within(now, HEARD_WITHIN),
            stands: grounded
                || (now - contact.moved_at >= STANDS_AFTER && age_s < MAX_HEIGHT_AGE_S),
            motion: heard,
            before_climb: top.map(|_| contact.state.position),
        }
    }
}
