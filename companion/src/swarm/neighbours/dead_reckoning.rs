//! A neighbour as it was last heard, and where it may have got to since.

use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::flight::MAX_REPORTED_PROGRESS_LAG_M;
use planner_core::track::safety::PlaceOnPoints;
use planner_core::{Length, Point};

use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::config::UnevenGround;
use crate::link::intent::{BLOCKED, GROUNDED, LANDED, ON_DETOUR, OUT_OF_PLAN, WAITING};
use crate::margins::unheard_flight_by_delay_s;
use crate::time::{Duration, Instant};

/// Where and when silent vehicles come down in a coverage mission, and by how much two in the air
/// may be nearer than estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AreaGround {
    /// Heights of the ground, where it is not level; `None` where it is.
    pub(super) ground: Option<UnevenGround>,
    /// Silence after which a vehicle is on the ground.
    pub(super) down_after: Duration,
    /// Distance by which two vehicles in the air may be nearer than their estimates say, metres.
    pub(super) pair_position_error_m: f32,
}

impl NeighbourEntry {
    /// Whether the neighbour counts as dead: silent, by relays too, for [`LOST_AFTER`] and the time
    /// that it may fly on unheard. A stranger never counts as dead.
    // Not inlined, as other functions with many callers: a board has little flash.
    #[inline(never)]
    pub(super) fn is_dead(&self, now: Instant) -> bool {
        // Most neighbours are heard: no further work for these.
        let lost = |at: &Instant| now - *at >= LOST_AFTER && self.rank != RANK_OUTSIDE_ROSTER;
        let Some(heard_at) = self.heard_at.filter(lost) else { return false };
        let flight_ms = (1000.0 * self.unheard_flight_time_s()) as u32;
        let dead = Duration::from_millis(LOST_AFTER_MS + u64::from(flight_ms));
        now - heard_at >= dead && self.relayed_report_at.is_none_or(|at| now - at >= dead)
    }

    /// Whether the neighbour was last heard 3 s or more after its last valid position; false if it
    /// never reported one.
    pub(super) fn lacks_position(&self) -> bool {
        self.heard_at
            .zip(self.position_at)
            .is_some_and(|(heard, known)| heard - known >= MAY_LAND_AFTER)
    }

    /// Time that the neighbour may fly on unheard, through open gates, seconds; 0 where it stops at
    /// once.
    pub(super) fn unheard_flight_time_s(&self) -> f32 {
        match self.state.progress_m.filter(|_| self.flies_plan_unheard()) {
            Some(progress_m) => {
                let fly_s = (self.gates_open_up_to_m - progress_m) / self.min_unheard_progress_mps
                    + f32::from(self.unheard_flight_delay_s);
                fly_s.clamp(0.0, MAX_UNHEARD_FLIGHT_S)
            }
            None => 0.0,
        }
    }

    /// Whether the neighbour flies on along its plan while unheard: when last heard it was on the
    /// plan, at the edge of the radio's range, with open gates ahead.
    #[inline(never)]
    pub(super) fn flies_plan_unheard(&self) -> bool {
        self.state.progress_m.is_some_and(|progress_m| {
            self.at_range_edge
                && self.on_plan()
                && self.gates_open_up_to_m > progress_m + MIN_OPEN_PATH_M
        })
    }

    /// Progress of the vehicle along the shared plan, metres: as it reports it; unheard for a
    /// second, the greater of that and what others relayed. `None` if it was last heard off the
    /// plan.
    pub(super) fn heard_progress_m(&self, now: Instant) -> Option<f32> {
        let own_m = self.state.progress_m;
        if self.heard_within(now, HEARD_DIRECTLY_WITHIN)
            || (own_m.is_none() && self.intent_at.is_some())
        {
            return own_m;
        }
        match (own_m, self.relayed_progress_m) {
            (Some(own_m), Some(relayed_progress_m)) => Some(libm::fmaxf(own_m, relayed_progress_m)),
            (own_m, relayed_progress_m) => own_m.or(relayed_progress_m),
        }
    }

    /// Progress along the shared plan that the neighbour has surely made, metres: silent at the
    /// edge of the radio's range, or without a known position, it is assumed to fly on as far as
    /// its gates were open.
    pub(super) fn min_progress_m(&self, now: Instant) -> Option<f32> {
        let known_m = self.heard_progress_m(now)?;
        let Some(known_at) = self.intent_at.max(self.relayed_report_at) else {
            return Some(known_m);
        };
        let after_s = UNHEARD_PROGRESS_GROWS_AFTER_S + f32::from(self.unheard_flight_delay_s);
        let silent_s = (now - known_at).as_secs_f32() - after_s;
        let beyond = self.at_range_edge || self.position_at.is_none();
        if silent_s <= 0.0 || !beyond || self.reports_any(ON_DETOUR | OUT_OF_PLAN) {
            return Some(known_m);
        }
        let reckoned_m = known_m + self.min_unheard_progress_mps * silent_s;
        Some(libm::fmaxf(
            known_m,
            libm::fminf(reckoned_m, self.gates_open_up_to_m - MAX_REPORTED_PROGRESS_LAG_M),
        ))
    }

    /// Seconds until the neighbour has surely passed the place `until_m` along its path, heard or
    /// not; `None` where its gates may stop it before, or it is off the plan.
    pub(super) fn time_until_passed_s(&self, until_m: f32, now: Instant) -> Option<f32> {
        let known_m =
            self.heard_progress_m(now).filter(|_| !self.reports_any(ON_DETOUR | OUT_OF_PLAN))?;
        let known_at = self.intent_at.max(self.relayed_report_at)?;
        let fly_s = (until_m - known_m) / self.min_unheard_progress_mps;
        let after_s = UNHEARD_PROGRESS_GROWS_AFTER_S + f32::from(self.unheard_flight_delay_s)
            - (now - known_at).as_secs_f32();
        (until_m <= self.gates_open_up_to_m - MAX_REPORTED_PROGRESS_LAG_M)
            .then(|| libm::fmaxf(fly_s + after_s, 0.0))
    }

    /// Whether the neighbour last reported that it is out of the plan, or counts as dead.
    pub(super) fn is_out_of_plan(&self, now: Instant) -> bool {
        self.reports_any(OUT_OF_PLAN) || self.is_dead(now)
    }

    /// Whether the neighbour is on the ground: reported; or dead, silent for `down`, and not last
    /// heard out of the plan.
    pub(super) fn is_on_ground(&self, now: Instant, down: Duration) -> bool {
        self.reports_any(GROUNDED)
            || (!self.reports_any(OUT_OF_PLAN)
                && self.is_dead(now)
                && !self.heard_within(now, down))
    }

    /// Whether the neighbour is out of the plan, or lately reported that it has landed or stands
    /// until another vehicle moves, or descends at the end of a detour.
    pub(super) fn is_waiting_or_out_of_plan(&self, now: Instant) -> bool {
        self.is_out_of_plan(now)
            || (self.reports_any(WAITING | LANDED) && self.heard_within(now, HEARD_WITHIN))
            || self.is_landing_after_detour(now)
    }

    /// Whether the neighbour descends straight down at the end of a detour.
    pub(super) fn is_landing_after_detour(&self, now: Instant) -> bool {
        self.reports_any(ON_DETOUR)
            && !self.reports_any(GROUNDED)
            && self.may_come_down
            && self.points_to_stop().last().is_some_and(|low| low.z < self.state.position.z)
            && self.state.velocity.xy().norm_squared() < MAX_HOVER_MPS * MAX_HOVER_MPS
            && self.heard_within(now, HEARD_WITHIN)
    }

    /// Whether the neighbour claims the turn to fly a detour: blocked, hovering, not waiting.
    pub(super) fn claims_turn(&self, now: Instant) -> bool {
        self.reports_any(BLOCKED)
            && !self.is_waiting_or_out_of_plan(now)
            && self.heard_within(now, HEARD_WITHIN)
            && self.state.velocity.length() < MAX_HOVER_MPS
    }

    /// Whether the neighbour, in the air, may land without avoiding others: it is silent, or off
    /// the plan without a detour.
    pub(super) fn may_land_without_avoiding(&self, now: Instant) -> bool {
        let silent = !self.heard_within(now, MAY_LAND_AFTER)
            && !self.is_reported_out_of_range(now)
            && !self.flies_plan_unheard();
        self.rank != RANK_OUTSIDE_ROSTER
            && !self.reports_any(GROUNDED | LANDED)
            && !self.is_out_of_plan(now)
            && (silent || (self.state.progress_m.is_none() && !self.reports_any(ON_DETOUR)))
    }

    /// Calls `visit` with the columns, of radius `apart_m`, in which the neighbour may come down;
    /// after 3 s of silence, those below all places up to `upto_m` along its points.
    pub(super) fn visit_landing_columns(
        &self,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        visit: &mut dyn FnMut(KeepOutZone),
    ) {
        let here = self.state.position;
        let up = |height_m: f32| Point::new(0.0, 0.0, height_m);
        if !self.heard_within(now, MAY_LAND_AFTER) {
            return self.for_each_rest_place([0.0, upto_m], &mut |place, wider_m| {
                let radius_m = fpu::sqrtf(apart_m * apart_m + wider_m * wider_m);
                let (from, to) =
                    (place + up(COLUMN_TOP_ABOVE_M), place - up(self.column_depth_m(&place)));
                visit(KeepOutZone { from, to, radius_m, kind: ZoneKind::LandingColumn });
            });
        }
        let mut column = |from: Point, below_m: f32, nature: ZoneKind| {
            visit(KeepOutZone {
                from: from + up(COLUMN_TOP_ABOVE_M),
                to: from - up(below_m),
                radius_m: apart_m,
                kind: nature,
            });
        };
        let age_s = self.position_at.map_or(0.0, |at| (now - at).as_secs_f32());
        let fallen_m = (MAX_LANDING_MPS * age_s).min(DEFAULT_COLUMN_DEPTH_M);
        if age_s < SILENT_AFTER_POSITION_AGE_S {
            column(
                here,
                (LANDING_COLUMN_DEPTH_M + fallen_m).min(DEFAULT_COLUMN_DEPTH_M),
                ZoneKind::LandingColumn,
            );
        } else {
            // The neighbour may be anywhere down to `fallen_m` below by now, and descends on.
            column(here, fallen_m, ZoneKind::Static);
            column(here - up(fallen_m), LANDING_COLUMN_DEPTH_M, ZoneKind::LandingColumn);
        }
    }

    /// Depth of the column below a place on its path, metres: [`DEFAULT_COLUMN_DEPTH_M`]; in a
    /// coverage mission to the ground if that is deeper.
    pub(super) fn column_depth_m(&self, place: &Point) -> f32 {
        // NaN, a ground never reported, counts as none.
        if self.would_fly_all_points_unheard() {
            libm::fmaxf(DEFAULT_COLUMN_DEPTH_M, place.z - self.ground_m)
        } else {
            DEFAULT_COLUMN_DEPTH_M
        }
    }

    /// Height of the top of the neighbour's climb, ENU up, metres; `None` without a climb.
    pub(super) fn climb_top_m(&self) -> Option<f32> {
        let (top, here) = (self.points_to_stop().last()?, self.state.position);
        let beside = (top - here).xy().norm_squared();
        let climbs = self.may_come_down
            && !self.reports_any(LANDED | OUT_OF_PLAN)
            && beside < MAX_CLIMB_DRIFT_M * MAX_CLIMB_DRIFT_M;
        (climbs && top.z > here.z + CLIMB_DONE_BELOW_TOP_M).then_some(top.z)
    }

    /// Distance along its points that the neighbour may fly unheard, metres: that of a stop
    /// ([`Self::unheard_stopping_distance_m`]); in a coverage mission all of them, if longer.
    #[inline]
    pub(super) fn max_unheard_distance_m(&self) -> f32 {
        // The slack keeps rounding from cutting off the last corner.
        let all_m = self.points_length_m + LEGS_ROUNDING_M;
        let stops_m = self.unheard_stopping_distance_m();
        if all_m > stops_m { all_m } else { stops_m }
    }

    /// Length of path until the neighbour has noticed that it is unheard, and stopped, metres, with
    /// what delays add: of its own messages and of those by which it learns that it is unheard.
    #[inline]
    pub(super) fn unheard_stopping_distance_m(&self) -> f32 {
        self.max_unheard_travel_m
            + self.fastest_vehicle_mps * unheard_flight_by_delay_s(self.message_delay.delay_s)
    }

    /// Whether the neighbour was in the air, or about to take off, when it was last heard.
    pub(super) fn is_under_way(&self) -> bool {
        !self.reports_any(GROUNDED | LANDED) || self.unheard_flight_point_count > 0
    }

    /// Whether the neighbour, silent for 3 s in a coverage mission, may fly on: while its lease
    /// lasts, or flown home by its autopilot.
    pub(super) fn may_fly_on_silent(&self, now: Instant) -> bool {
        self.would_fly_all_points_unheard()
            && self.is_under_way()
            && !self.reports_any(OUT_OF_PLAN)
            && !self.heard_within(now, MAY_LAND_AFTER)
    }

    /// Where the neighbour, silent in a coverage mission, may have fallen without power: the line
    /// from its position to where its speed carried it, and the greatest distance from that line,
    /// metres.
    #[inline(never)]
    pub(super) fn fall_line(&self, now: Instant) -> Option<([Point; 2], f32)> {
        let silent = self.would_fly_all_points_unheard()
            && self.is_under_way()
            && !self.heard_within(now, MAY_LAND_AFTER);
        let (here, velocity) = (self.state.position, self.state.velocity);
        let fast_mps = velocity.xy().norm().max(MAX_FALL_CARRY_MPS);
        let carried = Point::new(velocity.x, velocity.y, 0.0)
            * (FALL_CARRY_S * MAX_FALL_CARRY_MPS / fast_mps);
        silent.then(|| ([here, here + carried], self.max_fall_drift_m()))
    }

    /// Distance by which the wind may carry the neighbour aside while it falls, metres.
    #[inline(always)]
    pub(super) fn max_fall_drift_m(&self) -> f32 {
        let high_m = self.state.position.z - self.ground_m;
        // NaN, a ground never reported, counts as none.
        if high_m > 0.0 { FALL_DRIFT_PER_HEIGHT * high_m.min(MAX_FALL_M) } else { 0.0 }
    }

    /// Whether the neighbour may still fly to its pad, and that is within `apart_m` of the vertical
    /// through `place`. No two pads are that near to each other.
    pub(crate) fn may_return_to_pad_near(&self, now: Instant, place: &Point, apart_m: f32) -> bool {
        let near = |pad: Point| (pad - place).xy().norm_squared() < apart_m * apart_m;
        self.may_fly_on_silent(now) && self.pad.is_some_and(near)
    }

    /// Greatest height at which the neighbour may lie after coming down from `place`, ENU up,
    /// metres: the ground that it reported, unless that is just the area's lowest. In that case the
    /// area's highest ground; but at least half of [`UnevenGround::min_height_above_ground_m`]
    /// below `place` if the neighbour was on its plan away from its pad.
    pub(super) fn max_ground_m(&self, field: AreaGround, place: &Point) -> f32 {
        let lowest = |ground: &UnevenGround| self.ground_m <= ground.low_m + GROUND_ROUNDING_M;
        let Some(ground) = field.ground.filter(lowest) else {
            return self.ground_m;
        };
        let away = self.pad.is_some_and(|pad| (pad - place).xy().length() > MAX_OVER_PAD_M);
        let below_m = if away && !self.reports_any(ON_DETOUR | OUT_OF_PLAN) && !self.may_come_down {
            ground.min_height_above_ground_m / 2.0
        } else {
            0.0
        };
        libm::fmaxf(self.ground_m, libm::fminf(ground.high_m, place.z - below_m))
    }

    /// Distance, metres, by which the safety filter keeps further away from a neighbour that is not
    /// on the points that it reports, or reports none: by what it may fly aside in its messages'
    /// age. 0 on its points.
    fn off_points_reach_m(&self) -> f32 {
        let age_s = self.message_delay.delay_s + MAX_USUAL_POSITION_AGE_S;
        match self.place_on_points {
            PlaceOnPoints::Beside => 0.5 * OFF_POINTS_ACCEL_MPS2 * age_s * age_s,
            PlaceOnPoints::On { .. } | PlaceOnPoints::Unknown => 0.0,
        }
    }

    /// Calls `visit` with the keep-out zones, of radius `apart_m`, of all places where the
    /// neighbour may be from now on; if it counts as dead, those up to `upto_m` along its points.
    pub(super) fn visit_keep_out_zones(
        &self,
        now: Instant,
        [apart_m, upto_m]: [f32; 2],
        field: Option<AreaGround>,
        visit: &mut dyn FnMut(KeepOutZone),
    ) {
        let here = self.state.position;
        // Wider in the air only: vehicles on the ground lie beside each other's pads.
        let wide_m = apart_m + field.map_or(0.0, |field| field.pair_position_error_m);
        let place =
            |radius_m: f32| KeepOutZone { from: here, to: here, radius_m, kind: ZoneKind::Static };
        let column = |from: Point, nature: ZoneKind| {
            let to = from - Point::new(0.0, 0.0, self.column_depth_m(&from));
            KeepOutZone { from, to, radius_m: apart_m + STALE_POSITION_ERROR_M, kind: nature }
        };
        if self.reports_any(GROUNDED) && self.reports_any(OUT_OF_PLAN) && self.lacks_position() {
            visit(column(here, ZoneKind::Grounded));
        } else if self.reports_any(GROUNDED)
            && (self.reports_any(OUT_OF_PLAN | WAITING | LANDED) || !self.is_dead(now))
        {
            visit(place(apart_m));
        } else if self.reports_any(OUT_OF_PLAN)
            && (field.is_none() || self.heard_within(now, COLUMN_KEPT_FOR))
        {
            let below = column(here, ZoneKind::Static);
            visit(KeepOutZone { radius_m: libm::fmaxf(below.radius_m, wide_m), ..below });
            // The neighbour's place is not to be approached from above or the side either, which
            // the column below it does not cover.
            visit(place(wide_m + PAIR_SWAY_M));
        } else if self.is_dead(now) && self.flies_plan_unheard() {
            // The neighbour is where its gates let it fly: gates keep it apart, no zone.
        } else if self.is_dead(now) {
            if let Some(pad) = self.pad {
                visit(KeepOutZone { from: pad, to: pad, ..place(apart_m) });
            }
            let down = !self.heard_within(now, field.map_or(DOWN_AFTER, |field| field.down_after));
            if let Some(field) = field.filter(|_| down && !self.ground_m.is_nan()) {
                // No lane or layer is as low: the zone is as thin as a vehicle that lies, and
                // reaches down to the reported ground at corners of its path only.
                let low = |at: Point, height_m| Point::new(at.x, at.y, height_m);
                let high = |at: Point| low(at, self.max_ground_m(field, &at));
                return self.for_each_unheard_leg(upto_m, &mut |[at, next], [leg_m, flown_m]| {
                    let next =
                        if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next };
                    let (from, lies) = (high(next), place(apart_m + STALE_POSITION_ERROR_M));
                    visit(KeepOutZone { from, to: high(at), ..lies });
                    if from.z > self.ground_m {
                        visit(KeepOutZone { from, to: low(next, self.ground_m), ..lies });
                    }
                });
            }
            let nature = if down { ZoneKind::Grounded } else { ZoneKind::Static };
            let beside_m =
                if field.is_some() { STALE_POSITION_ERROR_M } else { MAX_UNHEARD_LANDING_OFFSET_M };
            self.for_each_rest_place([self.min_rest_distance_m(), upto_m], &mut |at, wider_m| {
                let far_m = apart_m + beside_m;
                let radius_m = fpu::sqrtf(far_m * far_m + wider_m * wider_m);
                visit(KeepOutZone { radius_m, ..column(at, nature) });
            });
        } else {
            if self.is_landing_after_detour(now) {
                visit(column(here, ZoneKind::Static));
            }
            visit(place(wide_m + PAIR_SWAY_M + self.off_points_reach_m()));
        }
    }
}
