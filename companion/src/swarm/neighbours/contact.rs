//! One vehicle as it was last heard, and where it may be since.

use heapless::Vec;
use planner_core::Point;
use planner_core::deconflict::Neighbour;
use planner_core::detour::{KeepOff, Nature};
use planner_core::flight::PROGRESS_ERROR_M;
use planner_core::safety::Joint;

use super::bounds::*;
use crate::autopilot::telemetry::SequenceFilter;
use crate::config::Ground;
use crate::link::echo::Lateness;
use crate::link::intent::{BLOCKED, GROUNDED, LANDED, MAX_POINTS, ON_DETOUR, OUT_OF_PLAN, WAITING};
use crate::time::{Duration, Instant};

/// Ground of an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Field {
    /// Ground that is not level.
    pub(super) ground: Option<Ground>,
    /// After this silence a vehicle is down.
    pub(super) down: Duration,
    /// Distance by which two vehicles in the air may be nearer than they believe, metres.
    pub(super) stray_m: f32,
}

#[derive(Clone, Debug)]
pub(crate) struct Contact {
    pub(super) id: u8,
    pub(super) rank: u16,
    pub(super) sequence: SequenceFilter,
    pub(super) heard_at: Option<Instant>,
    pub(super) position_at: Option<Instant>,
    pub(super) boot_ms: u32,
    pub(super) flags: u8,
    /// Since when it has reported that it is out, with its place known.
    pub(super) out_at: Option<Instant>,
    pub(super) hears_us_at: Option<Instant>,
    /// Whom it hears, a bit for each rank.
    pub(super) hears: u32,
    /// Progress of the vehicle as others passed it on, metres.
    pub(super) relayed_m: Option<f32>,
    /// When that was so.
    pub(super) relayed_at: Option<Instant>,
    /// Sequence number of its last intent.
    pub(super) intent_sequence: u8,
    pub(super) late: Lateness,
    /// When an intent of our mission was last heard from it.
    pub(super) belongs_at: Option<Instant>,
    pub(super) points: Vec<Point, MAX_POINTS>,
    /// Number of the last of them that the vehicle flies to only where nobody hears it.
    pub(super) beyond: u8,
    /// Place of the vehicle on its reported points.
    pub(super) joint: Joint,
    /// Distance to which the points lead from the first of them, metres.
    pub(super) extent_m: f32,
    /// Length of its points from its place on, metres, where it flies to the last of them unheard: over an area, where it reports
    /// as many as its lease allows. Negative elsewhere.
    pub(super) way_m: f32,
    /// Whether it may come down from where it is, and the height of the ground below it; NaN where it never reported any.
    pub(super) column: bool,
    pub(super) floor_m: f32,
    /// Place along its path up to which the vehicle's gates were open, or would be, metres: the
    /// vehicle flies on to there unheard.
    pub(super) clear_m: f32,
    /// Seconds until the last of those is open.
    pub(super) clear_in_s: u8,
    /// Whether it was last heard where the radio may not reach.
    pub(super) at_edge: bool,
    /// Progress that an unheard vehicle makes at least, m/s.
    pub(super) reckoned_mps: f32,
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
    pub(super) avoided: Point,
    pub(super) state: Neighbour,
}

impl Contact {
    /// Notes where its position is on its points: to be called when either was heard, so that no step has to look for it.
    pub(super) fn join(&mut self) {
        self.joint = Joint::find(&self.state.position, self.near());
        if self.is_leased() {
            let mut at = self.state.position;
            let legs = self.points.iter().map(|next| next - core::mem::replace(&mut at, *next));
            self.way_m = legs.map(|leg| libm::sqrtf(leg.norm_squared())).sum();
        }
    }

    /// Whether it flies to the last of its points unheard.
    pub(crate) fn is_leased(&self) -> bool {
        self.way_m >= 0.0
    }

    /// Its points as far as it will go for now.
    pub(super) fn near(&self) -> &[Point] {
        &self.points[..self.points.len().saturating_sub(usize::from(self.beyond))]
    }

    pub(super) fn heard_within(&self, now: Instant, span: Duration) -> bool {
        self.heard_at.is_some_and(|at| now - at < span)
    }

    // The contact has one copy of this and of other common calls: a board has little room.
    #[inline(never)]
    pub(super) fn is_dead(&self, now: Instant) -> bool {
        // Most are heard.
        let dead = Duration::from_millis(LOST_AFTER_MS + (1000.0 * self.flies_on_s()) as u64);
        let silent = |at: Option<Instant>| at.is_some_and(|at| now - at >= dead);
        self.rank != STRANGER_RANK && silent(self.heard_at) && silent(self.known_at())
    }

    /// Whether it speaks, but has not known for long where it is.
    pub(super) fn is_vague(&self) -> bool {
        self.heard_at.zip(self.position_at).is_some_and(|(heard, known)| heard - known >= MAY_LAND_AFTER)
    }

    /// Whether it follows the shared plan, as last heard.
    pub(super) fn on_plan(&self) -> bool {
        self.state.progress_m.is_some() && !self.tells(ON_DETOUR | OUT_OF_PLAN)
    }

    /// Time that an unheard vehicle may take for what its gates left it, seconds.
    pub(super) fn flies_on_s(&self) -> f32 {
        match self.state.progress_m.filter(|_| self.flies_on()) {
            Some(progress_m) => {
                let fly_s = (self.clear_m - progress_m) / self.reckoned_mps + f32::from(self.clear_in_s);
                fly_s.clamp(0.0, MAX_UNHEARD_FLIGHT_S)
            }
            None => 0.0,
        }
    }

    /// Whether it flies its plan unheard, or did.
    #[inline(never)]
    pub(super) fn flies_on(&self) -> bool {
        self.state
            .progress_m
            .is_some_and(|progress_m| self.at_edge && self.on_plan() && self.clear_m > progress_m + 0.5)
    }

    /// Progress of the vehicle along the shared plan for sure, metres: unheard the vehicle flies on
    /// as far as its gates were open.
    pub(super) fn passed_m(&self, now: Instant) -> Option<f32> {
        let known_m = self.progress_m(now)?;
        let Some(known_at) = self.belongs_at.max(self.relayed_at) else { return Some(known_m) };
        let after_s = RECKONED_AFTER_S + f32::from(self.clear_in_s);
        let silent_s = (now - known_at).secs_f32() - after_s;
        let beyond = self.at_edge || self.position_at.is_none();
        if silent_s <= 0.0 || !beyond || self.tells(ON_DETOUR | OUT_OF_PLAN) {
            return Some(known_m);
        }
        let reckoned_m = known_m + self.reckoned_mps * silent_s;
        Some(libm::fmaxf(known_m, libm::fminf(reckoned_m, self.clear_m - PROGRESS_ERROR_M)))
    }

    /// Seconds until it has come past `until_m` for sure; none where that is open.
    pub(super) fn passes_in_s(&self, until_m: f32, now: Instant) -> Option<f32> {
        let known_m = self.progress_m(now).filter(|_| !self.tells(ON_DETOUR | OUT_OF_PLAN))?;
        let known_at = self.belongs_at.max(self.relayed_at)?;
        let fly_s = (until_m - known_m) / self.reckoned_mps;
        let after_s = RECKONED_AFTER_S + f32::from(self.clear_in_s) - (now - known_at).secs_f32();
        (until_m <= self.clear_m - PROGRESS_ERROR_M).then(|| libm::fmaxf(fly_s + after_s, 0.0))
    }

    pub(super) fn tells(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    pub(super) fn is_out(&self, now: Instant) -> bool {
        self.tells(OUT_OF_PLAN) || self.is_dead(now)
    }

    /// The part of a reported progress that is believed, metres: no more than the vehicle can have
    /// flown since the report before, at `fastest_mps`. The rest comes by and by, a landing that
    /// reports the whole way at once too. Less than before is believed: it opens no gate. The first
    /// report of a plan is taken as it is, that of a vehicle that was restarted too.
    pub(super) fn believed_m(&mut self, progress_m: f32, fastest_mps: f32, now: Instant) -> f32 {
        let furthest = self.furthest.map(|(at_m, at)| at_m + fastest_mps * (now - at).secs_f32());
        let believed_m = furthest.map_or(progress_m, |furthest_m| libm::fminf(progress_m, furthest_m));
        let late_m = believed_m + fastest_mps * MAX_MESSAGE_DELAY_S + MAX_PROGRESS_JUMP_M;
        self.furthest = Some((furthest.map_or(late_m, |furthest_m| libm::fminf(furthest_m, late_m)), now));
        believed_m
    }

    /// Whether it is on the ground: as it reports, or after so long a silence.
    pub(super) fn lies(&self, now: Instant, down: Duration) -> bool {
        self.tells(GROUNDED)
            || (!self.tells(OUT_OF_PLAN) && self.is_dead(now) && !self.heard_within(now, down))
    }

    /// Whether it is out of the plan, or was lately heard to stand until somebody else moves.
    pub(super) fn waits(&self, now: Instant) -> bool {
        self.is_out(now)
            || (self.tells(WAITING | LANDED) && self.heard_within(now, HEARD_WITHIN))
            || self.lands(now)
    }

    /// Whether it flew around and comes down at the end of that.
    pub(super) fn lands(&self, now: Instant) -> bool {
        self.tells(ON_DETOUR)
            && !self.tells(GROUNDED)
            && self.column
            && self.near().last().is_some_and(|low| low.z < self.state.position.z)
            && self.state.velocity.xy().norm_squared() < MAX_HOVER_MPS * MAX_HOVER_MPS
            && self.heard_within(now, HEARD_WITHIN)
    }

    /// Whether it claims the turn: it is blocked, hovers, and is about to fly a detour.
    pub(super) fn claims(&self, now: Instant) -> bool {
        self.tells(BLOCKED)
            && !self.waits(now)
            && self.heard_within(now, HEARD_WITHIN)
            && self.state.velocity.norm() < MAX_HOVER_MPS
    }

    /// Whether it will land where it is without looking, or may: it is in the air off the plan, or unheard.
    pub(super) fn comes_down(&self, now: Instant) -> bool {
        let silent = !self.heard_within(now, MAY_LAND_AFTER) && !self.is_far(now) && !self.flies_on();
        self.rank != STRANGER_RANK
            && !self.tells(GROUNDED | LANDED)
            && !self.is_out(now)
            && (silent || (self.state.progress_m.is_none() && !self.tells(ON_DETOUR)))
    }

    /// The columns it may come down in, `apart_m` around it; unheard it has come as far as `upto_m` along its points.
    pub(super) fn columns(&self, now: Instant, [apart_m, upto_m]: [f32; 2], tell: &mut dyn FnMut(KeepOff)) {
        let here = self.state.position;
        let up = |height_m: f32| Point::new(0.0, 0.0, height_m);
        if !self.heard_within(now, MAY_LAND_AFTER) {
            return self.stretch(upto_m, &mut |place, wider_m| {
                let radius_m = libm::hypotf(apart_m, wider_m);
                let (from, to) = (place + up(LEVEL_M), place - up(self.deep_m(&place)));
                tell(KeepOff { from, to, radius_m, nature: Nature::Landing });
            });
        }
        let mut column = |from: Point, below_m: f32, nature: Nature| {
            tell(KeepOff { from: from + up(LEVEL_M), to: from - up(below_m), radius_m: apart_m, nature });
        };
        let age_s = self.position_at.map_or(0.0, |at| (now - at).secs_f32());
        let fallen_m = (MAX_LANDING_MPS * age_s).min(MAX_COLUMN_M);
        if age_s < MAX_HEIGHT_AGE_S {
            column(here, (FAR_BELOW_M + fallen_m).min(MAX_COLUMN_M), Nature::Landing);
        } else {
            // The vehicle may be anywhere down to there by now, and comes down from there.
            column(here, fallen_m, Nature::Solid);
            column(here - up(fallen_m), FAR_BELOW_M, Nature::Landing);
        }
    }

    /// Depth of the column below a place on its path, metres: over an area at least to the ground.
    pub(super) fn deep_m(&self, place: &Point) -> f32 {
        // NaN counts as none.
        if self.is_leased() { libm::fmaxf(MAX_COLUMN_M, place.z - self.floor_m) } else { MAX_COLUMN_M }
    }

    /// Height of the top of its climb, if it climbs or is about to.
    pub(super) fn climbs_to(&self) -> Option<f32> {
        let (top, here) = (self.near().last()?, self.state.position);
        let beside = (top - here).xy().norm_squared();
        let climbs =
            self.column && !self.tells(LANDED | OUT_OF_PLAN) && beside < CLIMB_BESIDE_M * CLIMB_BESIDE_M;
        (climbs && top.z > here.z + CLIMB_TOP_M).then_some(top.z)
    }

    /// Stretch of its path that the vehicle may fly unheard, metres: over an area as far as its points lead; elsewhere further
    /// where messages are late, its own and those by which it learns that no vehicle hears it.
    pub(super) fn stretch_m(&self) -> f32 {
        // Rounding does not take away the last corner.
        libm::fmaxf(self.way_m + LEGS_ROUNDING_M, self.stops_m())
    }

    /// The stretch of a vehicle that stops where it notices that nobody hears it, metres.
    pub(super) fn stops_m(&self) -> f32 {
        UNHEARD_STRETCH_M + UNHEARD_STRETCH_MPS * 2.0 * self.late.delay_s
    }

    /// Whether it is in the air, or about to be, as it reported last.
    pub(super) fn is_under_way(&self) -> bool {
        !self.tells(GROUNDED | LANDED) || self.beyond > 0
    }

    /// Whether it is silent, and goes on over an area as long as its lease allows, or as its autopilot takes it.
    pub(super) fn may_fly_on(&self, now: Instant) -> bool {
        self.is_leased()
            && self.is_under_way()
            && !self.tells(OUT_OF_PLAN)
            && !self.heard_within(now, MAY_LAND_AFTER)
    }

    /// Whether it may yet be taken home, to its pad nearer than `apart_m` to the vertical of a place. No pads are as near to each other.
    pub(crate) fn comes_home(&self, now: Instant, place: &Point, apart_m: f32) -> bool {
        let near = |pad: Point| (pad - place).xy().norm_squared() < apart_m * apart_m;
        self.may_fly_on(now) && self.pad.is_some_and(near)
    }

    /// Legs of its path for `left_m`, as far as it may come unheard, each with its length and the part that counts, metres; the first is the
    /// place where it was heard.
    pub(super) fn legs(&self, mut left_m: f32, tell: &mut dyn FnMut([Point; 2], [f32; 2])) {
        let mut at = self.state.position;
        tell([at; 2], [0.0; 2]);
        for next in &self.points {
            let leg_m = (next - at).norm();
            if leg_m > left_m {
                return tell([at, *next], [leg_m, left_m]);
            }
            left_m -= leg_m;
            tell([core::mem::replace(&mut at, *next), *next], [leg_m; 2]);
        }
    }

    /// Places along its path for `upto_m`, as far as it may come unheard, and how much further than from one of them it may be from the
    /// nearest of them.
    pub(super) fn stretch(&self, upto_m: f32, tell: &mut dyn FnMut(Point, f32)) {
        let step_m = if upto_m > self.stops_m() { upto_m / STRETCH_PLACES } else { UNHEARD_STRETCH_STEP_M };
        let wider_m = if step_m > UNHEARD_STRETCH_STEP_M { 0.5 * step_m } else { 0.0 };
        self.legs(upto_m, &mut |[at, next], [leg_m, flown_m]| {
            for step in 1..=(flown_m / step_m) as u32 {
                let along_m = step as f32 * step_m;
                tell(at + (next - at) * (along_m / leg_m), wider_m);
            }
            if flown_m >= leg_m {
                tell(next, wider_m);
            }
        });
    }

    /// How high it lies at most, once it came down from a place: on the ground that it reported, which away from pads is the
    /// lowest there is. Then it is below what it flew along, which is over the ground by [`Ground::height_m`] but for what it
    /// strayed; above its pad, and where it came down already, that is not known.
    pub(super) fn lies_at_most_m(&self, field: Field, place: &Point) -> f32 {
        let Some(ground) = field.ground.filter(|ground| self.floor_m <= ground.low_m) else {
            return self.floor_m;
        };
        let away = self.pad.is_some_and(|pad| (pad - place).xy().norm() > OVER_PAD_M);
        let below_m = if away && !self.tells(ON_DETOUR | OUT_OF_PLAN) && !self.column {
            ground.height_m / 2.0
        } else {
            0.0
        };
        libm::fmaxf(self.floor_m, libm::fminf(ground.high_m, place.z - below_m))
    }

    /// Keep-out zones of the places where the vehicle may be from now on, `apart_m` around it, which unheard has come as far as
    /// `upto_m` along its points. Over a field it lies on the ground that it reported.
    pub(super) fn obstacles(
        &self,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        field: Option<Field>,
        tell: &mut dyn FnMut(KeepOff),
    ) {
        let here = self.state.position;
        // The zone is for vehicles in the air: those on the ground lie beside each other's pads.
        let wide_m = apart_m + field.map_or(0.0, |field| field.stray_m);
        let place = |radius_m: f32| KeepOff { from: here, to: here, radius_m, nature: Nature::Solid };
        let column = |from: Point, nature: Nature| {
            let to = from - Point::new(0.0, 0.0, self.deep_m(&from));
            KeepOff { from, to, radius_m: apart_m + VAGUE_POSITION_M, nature }
        };
        if self.tells(GROUNDED) && self.tells(OUT_OF_PLAN) && self.is_vague() {
            tell(column(here, Nature::Lying));
        } else if self.tells(GROUNDED) && (self.tells(OUT_OF_PLAN | WAITING | LANDED) || !self.is_dead(now)) {
            tell(place(apart_m));
        } else if self.tells(OUT_OF_PLAN) && (field.is_none() || self.heard_within(now, COLUMN_KEPT)) {
            let below = column(here, Nature::Solid);
            tell(KeepOff { radius_m: libm::fmaxf(below.radius_m, wide_m), ..below });
            // The place of the vehicle may not be approached from above or the side, whatever its
            // column leaves.
            tell(place(wide_m + PAIR_SWAY_M));
        } else if self.is_dead(now) && self.flies_on() {
            // The vehicle is where the plan has it.
        } else if self.is_dead(now) {
            if let Some(pad) = self.pad {
                tell(KeepOff { from: pad, to: pad, ..place(apart_m) });
            }
            let down = !self.heard_within(now, field.map_or(DOWN_AFTER, |field| field.down));
            if let Some(field) = field.filter(|_| down && !self.floor_m.is_nan()) {
                // No lane and no layer comes as low: as thin as it lies, and below that at corners alone.
                let low = |at: Point, height_m| Point::new(at.x, at.y, height_m);
                let high = |at: Point| low(at, self.lies_at_most_m(field, &at));
                return self.legs(upto_m, &mut |[at, next], [leg_m, flown_m]| {
                    let next = if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next };
                    let (from, lies) = (high(next), place(apart_m + VAGUE_POSITION_M));
                    tell(KeepOff { from, to: high(at), ..lies });
                    if from.z > self.floor_m {
                        tell(KeepOff { from, to: low(next, self.floor_m), ..lies });
                    }
                });
            }
            let nature = if down { Nature::Lying } else { Nature::Solid };
            let beside_m = if field.is_some() { VAGUE_POSITION_M } else { UNHEARD_BESIDE_M };
            self.stretch(upto_m, &mut |at, wider_m| {
                let radius_m = libm::hypotf(apart_m + beside_m, wider_m);
                tell(KeepOff { radius_m, ..column(at, nature) });
            });
        } else {
            if self.lands(now) {
                tell(column(here, Nature::Solid));
            }
            tell(place(wide_m + PAIR_SWAY_M));
        }
    }
}
