//! A neighbour as the safety filter sees it: where it is and what its set follows from, or that it is too far away to matter.

use planner_core::Point;
use planner_core::safety::{Bounds, Heard, OFF_M};

use super::*;

/// A neighbour as the safety filter sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met<'a> {
    pub(crate) id: u8,
    /// Whether the roster does not name it.
    pub(crate) stranger: bool,
    /// Whether it follows the shared plan.
    pub(crate) on_plan: bool,
    /// Whether it does so out of range, as others report.
    pub(crate) far: bool,
    /// Whether it knows that plan.
    pub(crate) shares_plan: bool,
    /// Whether it has stood for a while.
    pub(crate) stands: bool,
    /// Whether it stands until another vehicle moves.
    pub(crate) waits: bool,
    /// Whether it has been silent for so long that it counts as lost.
    pub(crate) lost: bool,
    /// What its set follows from.
    pub(crate) heard: Heard<'a>,
    /// Where it was last heard, if its set is that of a climb since: it may not have begun that.
    pub(crate) low: Option<Point>,
}

/// What a vehicle compares with its neighbours at first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach<'a> {
    /// Where it is.
    pub(crate) place: Point,
    /// How far its own set reaches, and what is kept at most, metres.
    pub(crate) within_m: f32,
    /// What is expected of them.
    pub(crate) bounds: &'a Bounds,
    /// So many seconds of their flight count as well.
    pub(crate) ahead_s: f32,
    /// Whether it follows the shared plan: gates keep it apart from those that do.
    pub(crate) on_plan: bool,
}

impl<const V: usize> Neighbours<V> {
    /// Whether contact `i` stays out of reach wherever it can be, or was never placed: what most of them do, seen without
    /// making a set of it. Never where [`Self::met`] and its reach say otherwise.
    pub(crate) fn is_beyond(&self, i: usize, now: Instant, reach: &Reach<'_>) -> bool {
        let Some((contact, placed_at)) = self.contacts.get(i).and_then(|c| Some((c, c.position_at?))) else {
            return true;
        };
        let grounded = contact.tells(GROUNDED | LANDED);
        let away = contact.state.position - reach.place;
        let across_sq = away.x * away.x + away.y * away.y;
        let mut heard = Heard {
            position: contact.state.position,
            velocity: contact.state.velocity,
            speed_mps: contact.speed_mps,
            age_s: 0.0,
            delay_s: if reach.on_plan && contact.on_plan() { 0.0 } else { contact.late.delay_s },
            points: &contact.points,
            extent_m: contact.extent_m,
            rests_within_m: 0.0,
            grounded,
            column_to_m: None,
        };
        let age = now - placed_at;
        if age <= FRESHLY {
            heard.age_s = age.secs_f32();
            let most_m = reach.within_m + heard.reach_m(reach.bounds, reach.ahead_s);
            let column = !grounded && (contact.column || contact.tells(OUT) || contact.floor_m.is_nan());
            let above_m = if column { 0.0 } else { away.z };
            return across_sq + above_m * above_m >= most_m * most_m;
        }
        // Silent, or known by its intents alone. Seen from above it is where it was, at the first of its points, or as far from
        // either as it can have flown.
        let told_sq = contact.points.first().map_or(f32::INFINITY, |p| (p - reach.place).xy().norm_squared());
        (heard.speed_mps, heard.points, heard.grounded) = (0.0, &[], false);
        let ball_m = reach.bounds.speed_max_mps * (reach.bounds.silent_s + 2.0 * contact.late.delay_s);
        heard.delay_s = contact.late.delay_s.max(BEYOND_TOP_S);
        let rests_m = heard.reach_m(reach.bounds, reach.ahead_s);
        let most_m =
            reach.within_m + ball_m.max(rests_m).max(contact.stretch_m() + OFF_M).max(contact.extent_m);
        across_sq.min(told_sq) >= most_m * most_m
    }

    /// Contact `i` as the safety filter sees it; none if its place was never heard.
    #[inline(always)]
    pub(crate) fn met(&self, i: usize, now: Instant) -> Option<Met<'_>> {
        let contact = self.contacts.get(i)?;
        let placed_s = (now - contact.position_at?).secs_f32();
        // Where positions are lost, an intent says as well where it is: at its setpoint.
        let told_at = contact.belongs_at.filter(|_| placed_s > OLD_S && !contact.points.is_empty());
        let told_s = told_at.map(|at| (now - at).secs_f32()).filter(|told_s| *told_s < OLD_S);
        let (by_intent, age_s) = (told_s.is_some(), told_s.unwrap_or(placed_s));
        // Silent, or without a position of its own, it rests by then where a reroute keeps off; later on the ground below.
        let unplaced_for = now - contact.position_at?;
        let unplaced = unplaced_for >= DEAD && !contact.is_far(now);
        let dead = (contact.is_dead(now) || unplaced) && !contact.points.is_empty();
        let down = unplaced_for >= self.down || (contact.tells(GROUNDED) && contact.is_vague());
        let lies = (dead || contact.tells(GROUNDED)) && down && !contact.floor_m.is_nan();
        let at = contact.points.first().filter(|_| by_intent);
        let mut here = at.copied().unwrap_or(contact.state.position);
        // Unheard in its climb it may have come to the top of it, and a little further.
        let top = contact.climbs_to().filter(|_| age_s > OLD_S && !lies);
        let highest_m = self.field().map_or(contact.floor_m, |field| contact.lies_at_most_m(field, &here));
        here.z = if lies { libm::fminf(highest_m, here.z) } else { top.unwrap_or(here.z) };
        let grounded = (contact.tells(GROUNDED | LANDED) && top.is_none()) || lies;
        let down = contact.column || contact.tells(OUT) || dead || contact.floor_m.is_nan();
        let floor_m = if contact.floor_m.is_nan() { here.z - COLUMN_M } else { contact.floor_m };
        let rests = dead || top.is_some();
        let heard = Heard {
            position: here,
            velocity: contact.state.velocity,
            speed_mps: if rests { 0.0 } else { contact.speed_mps },
            // A vehicle that flew along its points stopped on them, and rests where a reroute keeps off.
            age_s: if rests { 0.0 } else { age_s },
            delay_s: match (dead, top) {
                (false, Some(_)) => BEYOND_TOP_S,
                (true, _) => 0.0,
                _ => contact.late.delay_s,
            },
            points: if top.is_some() || lies { &[] } else { &contact.points },
            extent_m: contact.extent_m,
            rests_within_m: if dead && top.is_none() { contact.stretch_m() } else { 0.0 },
            grounded,
            column_to_m: (down && (!grounded || (lies && highest_m > floor_m))).then_some(floor_m),
        };
        Some(Met {
            id: contact.id,
            stranger: contact.rank == STRANGER,
            on_plan: contact.on_plan(),
            far: contact.is_far(now)
                || (contact.at_edge
                    && contact.on_plan()
                    && !contact.tells(GROUNDED)
                    && !contact.heard_within(now, FRESHLY)
                    && (contact.flies_on() || contact.heard_within(now, STANDS_UNHEARD))),
            shares_plan: contact.shares_plan,
            lost: dead,
            waits: contact.tells(WAITING) && contact.heard_within(now, LATELY),
            stands: grounded || (now - contact.moved_at >= STANDS && age_s < OLD_S),
            heard,
            low: top.map(|_| contact.state.position),
        })
    }
}
