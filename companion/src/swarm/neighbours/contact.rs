//! One vehicle as it was last heard, and where it may be since.

use heapless::Vec;
use planner_core::deconflict::Neighbour;
use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::flight::PROGRESS_ERROR_M;
use planner_core::safety::PlaceOnPoints;
use planner_core::{Length, Point};

use super::bounds::*;
use crate::autopilot::telemetry::SequenceFilter;
use crate::config::Ground;
use crate::link::echo::MessageDelay;
use crate::link::intent::{BLOCKED, GROUNDED, LANDED, MAX_POINTS, ON_DETOUR, OUT_OF_PLAN, WAITING};
use crate::time::{Duration, Instant};

/// Ground of an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AreaGround {
    /// Ground that is not level.
    pub(super) ground: Option<Ground>,
    /// After this silence a vehicle is down.
    pub(super) down: Duration,
    /// Distance by which two vehicles in the air may be nearer than they believe, metres.
    pub(super) pair_position_error_m: f32,
}

#[derive(Clone, Debug)]
pub(crate) struct NeighbourEntry {
    pub(super) id: u8,
    pub(super) rank: u16,
    pub(super) sequence: SequenceFilter,
    pub(super) heard_at: Option<Instant>,
    pub(super) position_at: Option<Instant>,
    pub(super) boot_ms: u32,
    pub(super) flags: u8,
    /// Since when it has reported that it is out, with its place known.
    pub(super) out_since: Option<Instant>,
    pub(super) hears_us_at: Option<Instant>,
    /// Whom it hears, a bit for each rank.
    pub(super) heard_bits: u32,
    /// Progress of the vehicle as others passed it on, metres.
    pub(super) relayed_m: Option<f32>,
    /// When that was so.
    pub(super) relayed_at: Option<Instant>,
    /// Sequence number of its last intent.
    pub(super) intent_sequence: u8,
    pub(super) message_delay: MessageDelay,
    /// When an intent of our mission was last heard from it.
    pub(super) intent_at: Option<Instant>,
    pub(super) points: Vec<Point, MAX_POINTS>,
    /// Number of the last of them that the vehicle flies to only where no other vehicle hears it.
    pub(super) first_unheard_point: u8,
    /// Place of the vehicle on its reported points.
    pub(super) place_on_points: PlaceOnPoints,
    /// Distance to which the points lead from the first of them, metres.
    pub(super) extent_m: f32,
    /// Length of its points from its place on, metres, where it flies to the last of them unheard:
    /// over an area, where it reports as many as its lease allows. Negative elsewhere.
    pub(super) unheard_way_m: f32,
    /// Whether it may come down from where it is, and the height of the ground below it; NaN where
    /// it never reported any.
    pub(super) may_come_down: bool,
    pub(super) ground_m: f32,
    /// Place along its path up to which the vehicle's gates were open, or would be, metres: the
    /// vehicle flies on to there unheard.
    pub(super) gates_open_up_to_m: f32,
    /// Seconds by which that flight is delayed.
    pub(super) unheard_delay_s: u8,
    /// Whether it was last heard where the radio may not reach.
    pub(super) at_range_edge: bool,
    /// Progress that an unheard vehicle makes at least, m/s.
    pub(super) assumed_speed_mps: f32,
    /// How fast it was when its position was heard, m/s.
    pub(super) speed_mps: f32,
    /// Whether its plan is ours, whether it follows it or not.
    pub(super) shares_plan: bool,
    /// Whether it follows another plan of our mission.
    pub(super) other_plan: bool,
    /// When it was last known to move.
    pub(super) moved_at: Instant,
    /// The furthest it can have come, metres along its path, and when that was.
    pub(super) furthest: Option<(f32, Instant)>,
    /// Place of the vehicle before it took off: its autopilot may fly it back there.
    pub(super) pad: Option<Point>,
    /// Place where the vehicle rested when a detour was planned; NaN where none was.
    pub(super) avoided_at: Point,
    pub(super) state: Neighbour,
}

impl NeighbourEntry {
    /// Notes where its position is on its points: to be called when either was heard, so that no
    /// step has to look for it.
    pub(super) fn update_place_on_points(&mut self) {
        self.place_on_points = PlaceOnPoints::find(&self.state.position, self.points_for_now());
        if self.is_leased() {
            let mut at = self.state.position;
            let legs = self.points.iter().map(|next| next - core::mem::replace(&mut at, *next));
            self.unheard_way_m = legs.map(|leg| fpu::sqrtf(leg.norm_squared())).sum();
        }
    }

    /// Whether it flies to the last of its points unheard.
    pub(crate) fn is_leased(&self) -> bool {
        self.unheard_way_m >= 0.0
    }

    /// Its points as far as it will go for now.
    pub(super) fn points_for_now(&self) -> &[Point] {
        &self.points[..self.points.len().saturating_sub(usize::from(self.first_unheard_point))]
    }

    pub(super) fn heard_within(&self, now: Instant, span: Duration) -> bool {
        self.heard_at.is_some_and(|at| now - at < span)
    }

    // The contact has one copy of this and of other common calls: a board has little room.
    #[inline(never)]
    pub(super) fn is_dead(&self, now: Instant) -> bool {
        // Most are heard.
        let lost = |at: &Instant| now - *at >= LOST_AFTER && self.rank != STRANGER_RANK;
        let Some(heard_at) = self.heard_at.filter(lost) else { return false };
        let flight_ms = (1000.0 * self.unheard_flight_time_s()) as u32;
        let dead = Duration::from_millis(LOST_AFTER_MS + u64::from(flight_ms));
        now - heard_at >= dead && self.relayed_at.is_none_or(|at| now - at >= dead)
    }

    /// Whether it is heard, but has had no valid position for long.
    pub(super) fn is_imprecise(&self) -> bool {
        self.heard_at
            .zip(self.position_at)
            .is_some_and(|(heard, known)| heard - known >= MAY_LAND_AFTER)
    }

    /// Whether it follows the shared plan, as last heard.
    pub(super) fn on_plan(&self) -> bool {
        self.state.progress_m.is_some() && !self.reports(ON_DETOUR | OUT_OF_PLAN)
    }

    /// Time that an unheard vehicle may take for what its gates left it, seconds.
    pub(super) fn unheard_flight_time_s(&self) -> f32 {
        match self.state.progress_m.filter(|_| self.flies_plan_unheard()) {
            Some(progress_m) => {
                let fly_s = (self.gates_open_up_to_m - progress_m) / self.assumed_speed_mps
                    + f32::from(self.unheard_delay_s);
                fly_s.clamp(0.0, MAX_UNHEARD_FLIGHT_S)
            }
            None => 0.0,
        }
    }

    /// Whether it flies its plan while unheard, or did so.
    #[inline(never)]
    pub(super) fn flies_plan_unheard(&self) -> bool {
        self.state.progress_m.is_some_and(|progress_m| {
            self.at_range_edge && self.on_plan() && self.gates_open_up_to_m > progress_m + 0.5
        })
    }

    /// Progress of the vehicle along the shared plan for sure, metres: unheard the vehicle flies on
    /// as far as its gates were open.
    pub(super) fn passed_m(&self, now: Instant) -> Option<f32> {
        let known_m = self.progress_m(now)?;
        let Some(known_at) = self.intent_at.max(self.relayed_at) else { return Some(known_m) };
        let after_s = RECKONED_AFTER_S + f32::from(self.unheard_delay_s);
        let silent_s = (now - known_at).as_secs_f32() - after_s;
        let beyond = self.at_range_edge || self.position_at.is_none();
        if silent_s <= 0.0 || !beyond || self.reports(ON_DETOUR | OUT_OF_PLAN) {
            return Some(known_m);
        }
        let reckoned_m = known_m + self.assumed_speed_mps * silent_s;
        Some(libm::fmaxf(
            known_m,
            libm::fminf(reckoned_m, self.gates_open_up_to_m - PROGRESS_ERROR_M),
        ))
    }

    /// Seconds until it has come past `until_m` for sure; none where that is open.
    pub(super) fn time_until_passed_s(&self, until_m: f32, now: Instant) -> Option<f32> {
        let known_m = self.progress_m(now).filter(|_| !self.reports(ON_DETOUR | OUT_OF_PLAN))?;
        let known_at = self.intent_at.max(self.relayed_at)?;
        let fly_s = (until_m - known_m) / self.assumed_speed_mps;
        let after_s =
            RECKONED_AFTER_S + f32::from(self.unheard_delay_s) - (now - known_at).as_secs_f32();
        (until_m <= self.gates_open_up_to_m - PROGRESS_ERROR_M)
            .then(|| libm::fmaxf(fly_s + after_s, 0.0))
    }

    pub(super) fn reports(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    pub(super) fn is_out_of_plan(&self, now: Instant) -> bool {
        self.reports(OUT_OF_PLAN) || self.is_dead(now)
    }

    /// The part of a reported progress that is believed, metres: no more than the vehicle can have
    /// flown since the report before, at `fastest_mps`. The rest comes by and by, a landing that
    /// reports the whole way at once too. Less than before is believed: it opens no gate. The first
    /// report of a plan is taken as it is, that of a vehicle that was restarted too.
    pub(super) fn plausible_progress_m(
        &mut self,
        progress_m: f32,
        fastest_mps: f32,
        now: Instant,
    ) -> f32 {
        let furthest =
            self.furthest.map(|(at_m, at)| at_m + fastest_mps * (now - at).as_secs_f32());
        let believed_m =
            furthest.map_or(progress_m, |furthest_m| libm::fminf(progress_m, furthest_m));
        let late_m = believed_m + fastest_mps * MAX_MESSAGE_DELAY_S + MAX_PROGRESS_JUMP_M;
        self.furthest =
            Some((furthest.map_or(late_m, |furthest_m| libm::fminf(furthest_m, late_m)), now));
        believed_m
    }

    /// Whether it is on the ground: as it reports, or after so long a silence.
    pub(super) fn is_on_ground(&self, now: Instant, down: Duration) -> bool {
        self.reports(GROUNDED)
            || (!self.reports(OUT_OF_PLAN) && self.is_dead(now) && !self.heard_within(now, down))
    }

    /// Whether it is out of the plan, or lately reported that it stands until another vehicle
    /// moves.
    pub(super) fn is_waiting(&self, now: Instant) -> bool {
        self.is_out_of_plan(now)
            || (self.reports(WAITING | LANDED) && self.heard_within(now, HEARD_WITHIN))
            || self.is_landing_after_detour(now)
    }

    /// Whether it flew around and comes down at the end of that.
    pub(super) fn is_landing_after_detour(&self, now: Instant) -> bool {
        self.reports(ON_DETOUR)
            && !self.reports(GROUNDED)
            && self.may_come_down
            && self.points_for_now().last().is_some_and(|low| low.z < self.state.position.z)
            && self.state.velocity.xy().norm_squared() < MAX_HOVER_MPS * MAX_HOVER_MPS
            && self.heard_within(now, HEARD_WITHIN)
    }

    /// Whether it claims the turn: it is blocked, hovers, and is about to fly a detour.
    pub(super) fn claims_turn(&self, now: Instant) -> bool {
        self.reports(BLOCKED)
            && !self.is_waiting(now)
            && self.heard_within(now, HEARD_WITHIN)
            && self.state.velocity.length() < MAX_HOVER_MPS
    }

    /// Whether it will land where it is without looking, or may: it is in the air off the plan, or
    /// unheard.
    pub(super) fn may_land_unseen(&self, now: Instant) -> bool {
        let silent = !self.heard_within(now, MAY_LAND_AFTER)
            && !self.is_reported_out_of_range(now)
            && !self.flies_plan_unheard();
        self.rank != STRANGER_RANK
            && !self.reports(GROUNDED | LANDED)
            && !self.is_out_of_plan(now)
            && (silent || (self.state.progress_m.is_none() && !self.reports(ON_DETOUR)))
    }

    /// The columns it may come down in, `apart_m` around it; unheard it has come as far as `upto_m`
    /// along its points.
    pub(super) fn landing_columns(
        &self,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        tell: &mut dyn FnMut(KeepOutZone),
    ) {
        let here = self.state.position;
        let up = |height_m: f32| Point::new(0.0, 0.0, height_m);
        if !self.heard_within(now, MAY_LAND_AFTER) {
            return self.for_each_place(upto_m, &mut |place, wider_m| {
                let radius_m = fpu::sqrtf(apart_m * apart_m + wider_m * wider_m);
                let (from, to) = (place + up(LEVEL_M), place - up(self.column_depth_m(&place)));
                tell(KeepOutZone { from, to, radius_m, kind: ZoneKind::Descending });
            });
        }
        let mut column = |from: Point, below_m: f32, nature: ZoneKind| {
            tell(KeepOutZone {
                from: from + up(LEVEL_M),
                to: from - up(below_m),
                radius_m: apart_m,
                kind: nature,
            });
        };
        let age_s = self.position_at.map_or(0.0, |at| (now - at).as_secs_f32());
        let fallen_m = (MAX_LANDING_MPS * age_s).min(MAX_COLUMN_M);
        if age_s < MAX_HEIGHT_AGE_S {
            column(here, (FAR_BELOW_M + fallen_m).min(MAX_COLUMN_M), ZoneKind::Descending);
        } else {
            // The vehicle may be anywhere down to there by now, and comes down from there.
            column(here, fallen_m, ZoneKind::Static);
            column(here - up(fallen_m), FAR_BELOW_M, ZoneKind::Descending);
        }
    }

    /// Depth of the column below a place on its path, metres: over an area at least to the ground.
    pub(super) fn column_depth_m(&self, place: &Point) -> f32 {
        // NaN counts as none.
        if self.is_leased() {
            libm::fmaxf(MAX_COLUMN_M, place.z - self.ground_m)
        } else {
            MAX_COLUMN_M
        }
    }

    /// Height of the top of its climb, if it climbs or is about to.
    pub(super) fn climb_top_m(&self) -> Option<f32> {
        let (top, here) = (self.points_for_now().last()?, self.state.position);
        let beside = (top - here).xy().norm_squared();
        let climbs = self.may_come_down
            && !self.reports(LANDED | OUT_OF_PLAN)
            && beside < CLIMB_BESIDE_M * CLIMB_BESIDE_M;
        (climbs && top.z > here.z + CLIMB_TOP_M).then_some(top.z)
    }

    /// Stretch of its path that the vehicle may fly unheard, metres: over an area as far as its
    /// points lead; elsewhere further where messages are late, its own and those by which it learns
    /// that no vehicle hears it.
    pub(super) fn unheard_distance_m(&self) -> f32 {
        // Rounding does not take away the last corner.
        libm::fmaxf(self.unheard_way_m + LEGS_ROUNDING_M, self.unheard_stop_m())
    }

    /// The stretch of a vehicle that stops where it notices that no other vehicle hears it, metres.
    pub(super) fn unheard_stop_m(&self) -> f32 {
        UNHEARD_STRETCH_M + UNHEARD_STRETCH_PER_DELAY_MPS * 2.0 * self.message_delay.delay_s
    }

    /// Whether it is in the air, or about to be, as it reported last.
    pub(super) fn is_under_way(&self) -> bool {
        !self.reports(GROUNDED | LANDED) || self.first_unheard_point > 0
    }

    /// Whether it is silent, and continues over an area as long as its lease allows, or as its
    /// autopilot takes it.
    pub(super) fn may_fly_on(&self, now: Instant) -> bool {
        self.is_leased()
            && self.is_under_way()
            && !self.reports(OUT_OF_PLAN)
            && !self.heard_within(now, MAY_LAND_AFTER)
    }

    /// Where it may have fallen, its motors off, if it is silent over an area: from its place as
    /// far as its speed took it, and so much aside, metres.
    #[inline(never)]
    pub(super) fn fall(&self, now: Instant) -> Option<([Point; 2], f32)> {
        let silent =
            self.is_leased() && self.is_under_way() && !self.heard_within(now, MAY_LAND_AFTER);
        let (here, velocity) = (self.state.position, self.state.velocity);
        let fast_mps = velocity.xy().norm().max(MAX_FALL_CARRY_MPS);
        let carried = Point::new(velocity.x, velocity.y, 0.0)
            * (FALL_CARRY_S * MAX_FALL_CARRY_MPS / fast_mps);
        silent.then(|| ([here, here + carried], self.fall_aside_m()))
    }

    /// How far aside from where its speed takes it it may fall, metres.
    #[inline(always)]
    pub(super) fn fall_aside_m(&self) -> f32 {
        let high_m = self.state.position.z - self.ground_m;
        // NaN counts as none.
        if high_m > 0.0 { FALL_DRIFT_SHARE * high_m.min(MAX_FALL_M) } else { 0.0 }
    }

    /// Whether it may yet be taken home, to its pad nearer than `apart_m` to the vertical of a
    /// place. No pads are as near to each other.
    pub(crate) fn comes_home(&self, now: Instant, place: &Point, apart_m: f32) -> bool {
        let near = |pad: Point| (pad - place).xy().norm_squared() < apart_m * apart_m;
        self.may_fly_on(now) && self.pad.is_some_and(near)
    }

    /// Legs of its path for `left_m`, as far as it may come unheard, each with its length and the
    /// part that counts, metres; the first is the place where it was heard.
    #[inline(never)]
    pub(super) fn for_each_leg(&self, mut left_m: f32, tell: &mut dyn FnMut([Point; 2], [f32; 2])) {
        let mut at = self.state.position;
        tell([at; 2], [0.0; 2]);
        for next in &self.points {
            let leg_m = (next - at).length();
            if leg_m > left_m {
                return tell([at, *next], [leg_m, left_m]);
            }
            left_m -= leg_m;
            tell([core::mem::replace(&mut at, *next), *next], [leg_m; 2]);
        }
    }

    /// Places along its path for `upto_m`, as far as it may come unheard, and how much further than
    /// from one of them it may be from the nearest of them.
    #[inline(never)]
    pub(super) fn for_each_place(&self, upto_m: f32, tell: &mut dyn FnMut(Point, f32)) {
        let step_m = if upto_m > self.unheard_stop_m() {
            upto_m / STRETCH_PLACES
        } else {
            UNHEARD_STRETCH_STEP_M
        };
        let wider_m = if step_m > UNHEARD_STRETCH_STEP_M { 0.5 * step_m } else { 0.0 };
        self.for_each_leg(upto_m, &mut |[at, next], [leg_m, flown_m]| {
            for step in 1..=(flown_m / step_m) as u32 {
                let along_m = step as f32 * step_m;
                tell(at + (next - at) * (along_m / leg_m), wider_m);
            }
            // The end too: it may have come as far.
            tell(
                if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next },
                wider_m,
            );
        });
    }

    /// How high it lies at most, once it came down from a place: on the ground that it reported,
    /// which away from pads is the lowest there is. Then it is below what it flew along, which is
    /// over the ground by [`Ground::height_m`] but for what it deviated; above its pad, and where
    /// it came down already, that is not known.
    pub(super) fn max_ground_m(&self, field: AreaGround, place: &Point) -> f32 {
        let Some(ground) = field.ground.filter(|ground| self.ground_m <= ground.low_m) else {
            return self.ground_m;
        };
        let away = self.pad.is_some_and(|pad| (pad - place).xy().length() > OVER_PAD_M);
        let below_m = if away && !self.reports(ON_DETOUR | OUT_OF_PLAN) && !self.may_come_down {
            ground.height_m / 2.0
        } else {
            0.0
        };
        libm::fmaxf(self.ground_m, libm::fminf(ground.high_m, place.z - below_m))
    }

    /// Keep-out zones of the places where the vehicle may be from now on, `apart_m` around it,
    /// which unheard has come as far as `upto_m` along its points. Over a field it lies on the
    /// ground that it reported.
    pub(super) fn keep_out_zones(
        &self,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        field: Option<AreaGround>,
        tell: &mut dyn FnMut(KeepOutZone),
    ) {
        let here = self.state.position;
        // The zone is for vehicles in the air: those on the ground lie beside each other's pads.
        let wide_m = apart_m + field.map_or(0.0, |field| field.pair_position_error_m);
        let place =
            |radius_m: f32| KeepOutZone { from: here, to: here, radius_m, kind: ZoneKind::Static };
        let column = |from: Point, nature: ZoneKind| {
            let to = from - Point::new(0.0, 0.0, self.column_depth_m(&from));
            KeepOutZone { from, to, radius_m: apart_m + VAGUE_POSITION_M, kind: nature }
        };
        if self.reports(GROUNDED) && self.reports(OUT_OF_PLAN) && self.is_imprecise() {
            tell(column(here, ZoneKind::Grounded));
        } else if self.reports(GROUNDED)
            && (self.reports(OUT_OF_PLAN | WAITING | LANDED) || !self.is_dead(now))
        {
            tell(place(apart_m));
        } else if self.reports(OUT_OF_PLAN)
            && (field.is_none() || self.heard_within(now, COLUMN_KEPT))
        {
            let below = column(here, ZoneKind::Static);
            tell(KeepOutZone { radius_m: libm::fmaxf(below.radius_m, wide_m), ..below });
            // The place of the vehicle may not be approached from above or the side, whatever its
            // column leaves.
            tell(place(wide_m + PAIR_SWAY_M));
        } else if self.is_dead(now) && self.flies_plan_unheard() {
            // The vehicle is where the plan has it.
        } else if self.is_dead(now) {
            if let Some(pad) = self.pad {
                tell(KeepOutZone { from: pad, to: pad, ..place(apart_m) });
            }
            let down = !self.heard_within(now, field.map_or(DOWN_AFTER, |field| field.down));
            if let Some(field) = field.filter(|_| down && !self.ground_m.is_nan()) {
                // No lane and no layer comes as low: as thin as it lies, and below that at corners
                // alone.
                let low = |at: Point, height_m| Point::new(at.x, at.y, height_m);
                let high = |at: Point| low(at, self.max_ground_m(field, &at));
                return self.for_each_leg(upto_m, &mut |[at, next], [leg_m, flown_m]| {
                    let next =
                        if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next };
                    let (from, lies) = (high(next), place(apart_m + VAGUE_POSITION_M));
                    tell(KeepOutZone { from, to: high(at), ..lies });
                    if from.z > self.ground_m {
                        tell(KeepOutZone { from, to: low(next, self.ground_m), ..lies });
                    }
                });
            }
            let nature = if down { ZoneKind::Grounded } else { ZoneKind::Static };
            let beside_m = if field.is_some() { VAGUE_POSITION_M } else { UNHEARD_BESIDE_M };
            self.for_each_place(upto_m, &mut |at, wider_m| {
                let far_m = apart_m + beside_m;
                let radius_m = fpu::sqrtf(far_m * far_m + wider_m * wider_m);
                tell(KeepOutZone { radius_m, ..column(at, nature) });
            });
        } else {
            if self.is_landing_after_detour(now) {
                tell(column(here, ZoneKind::Static));
            }
            tell(place(wide_m + PAIR_SWAY_M));
        }
    }
}
