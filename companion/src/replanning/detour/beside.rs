//! Detours in a coverage mission: around an obstacle or vehicle on the path, and back to the path
//! beyond it.
//!
//! The vehicle stops, requests from its shell the way to the first free place of its path beyond
//! the obstacle, and flies it beside the plan. Then it requests its own plan again, to continue
//! from there. It keeps its part of the area: until it is back, its progress stays where it left
//! its path, and others wait for it. It rejoins no further on than its gates are open. From below a
//! vehicle that descends it first flies aside, and seeks the way back from there: to where it left
//! its path, or to beyond the block if that place stays barred.
//!
//! ENU metres. Constant work except for [`is_barred`], which visits the zones of all others, and
//! [`first_rejoin_m`], called once for each attempt: at most [`MAX_SAMPLES`] places on the path,
//! each compared with [`MAX_REJOIN_ZONES`] zones.

use heapless::Vec;
use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::{Length, Point};

use crate::replanning::view::DetourView;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Deviation of a vehicle from its path, metres: a neighbour that is nearer to the path than the
/// safety distance plus this blocks it.
pub(super) const BLOCKED_BEYOND_SAFETY_DISTANCE_M: f32 = 0.25;
/// Distance beyond where the vehicle can stop within which a keep-out zone blocks its path, metres.
/// The vehicle photographs the path up to its stop; the detour leaves out up to this much of the
/// path before the zone, and what the zone covers. It is the distance flown at 15 m/s while the
/// zones of 32 vehicles are compared with the path.
pub(super) const BLOCKED_BEYOND_STOP_M: f32 = 8.0;
/// Added to [`BLOCKED_BEYOND_STOP_M`] once the path is blocked, metres: the vehicle may have
/// stopped a little sooner than expected.
const BEYOND_STOP_HYSTERESIS_M: f32 = 4.0;
/// What counts as a block of the path, metres: a zone this near to it, in addition to the safety
/// distance, and no further along it from where the vehicle can stop.
pub(super) const BLOCKED_BESIDE_AND_BEYOND_STOP_M: [f32; 2] =
    [BLOCKED_BEYOND_SAFETY_DISTANCE_M, BLOCKED_BEYOND_STOP_M];
/// As [`BLOCKED_BESIDE_AND_BEYOND_STOP_M`], once the path is blocked, metres: both are greater,
/// since a hovering vehicle sways and may have stopped sooner than expected.
pub(super) const STAYS_BLOCKED_BESIDE_AND_BEYOND_STOP_M: [f32; 2] =
    [DETOUR_MARGIN_M, BLOCKED_BEYOND_STOP_M + BEYOND_STOP_HYSTERESIS_M];
/// Reach of the search for the place where a detour returns to the path, metres: from the vehicle
/// to zones that count, and along the path.
const LOOK_AHEAD_M: f32 = 60.0;
/// Margin beyond the safety distance on a detour, metres: a zone that deviates a little does not
/// block the detour again.
pub(super) const DETOUR_MARGIN_M: f32 = 0.5;
/// Time from a search that found no detour to the next search.
pub(super) const REJOIN_SEARCH_PAUSE: Duration = Duration::from_secs(30);
/// Maximum number of detours while one plan is flown.
const MAX_DETOURS_PER_PLAN: u8 = 16;
/// Maximum number of keep-out zones that are compared with the path.
const MAX_REJOIN_ZONES: usize = 8;
/// Maximum number of places on the path that are compared with the zones.
const MAX_SAMPLES: usize = 100;
/// Least spacing of the places on the path that are compared with the zones, metres.
const MIN_SAMPLE_SPACING_M: f32 = 0.5;
/// Distance beyond [`LOOK_AHEAD_M`] up to which the start of a block is searched, metres.
const BLOCK_SEARCH_BEYOND_M: f32 = 1.0;
/// Distance beyond the last blocked sample at which a detour returns to the path, metres: at the
/// very edge the same zone would block the path again.
const DETOUR_RETURNS_BEYOND_M: f32 = 0.5;

/// Searches of a vehicle for detours that lead back to its path in a coverage mission: how many
/// succeeded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct AreaDetourSearches {
    /// Number of paths that the planner has found while this plan is flown.
    found: u8,
}

impl AreaDetourSearches {
    /// Counts a detour that the planner has found.
    pub(super) fn count_found(&mut self) {
        self.found = self.found.saturating_add(1);
    }

    /// Whether a detour may be sought now: not within [`REJOIN_SEARCH_PAUSE`] of a failure, and
    /// [`MAX_DETOURS_PER_PLAN`] times at most.
    pub(super) fn may_seek_rejoin(&self, now: Instant, timers: &Timers) -> bool {
        self.found < MAX_DETOURS_PER_PLAN && timers.is_due(Timer::RejoinSearch, now)
    }
}

/// Number of values of `index` for [`visit_neighbour_zones`]: two for each neighbour.
fn neighbour_zone_index_count<const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'_, V, W, G>,
) -> usize {
    2 * view.neighbours.len()
}

/// Passes to `visit` the keep-out zones number `index` in a coverage mission. With n neighbours
/// these are, below n, the zones where neighbour `index` stands or rests; from n on the columns in
/// which neighbour `index − n`, in the air, may land without avoiding others: it is silent for 3 s,
/// or off the plan without a detour (not if it has left the plan for good or counts as dead).
/// Reported obstacles are not among them.
fn visit_neighbour_zones<const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'_, V, W, G>,
    index: usize,
    visit: &mut dyn FnMut(KeepOutZone),
) {
    let apart_m = view.config.safety_distance_m + DETOUR_MARGIN_M;
    match index.checked_sub(view.neighbours.len()) {
        None => view.neighbours.for_each_zone_of(index, view.now, [apart_m; 3], visit),
        Some(i) => {
            let beside_m = apart_m + view.neighbours.pair_position_error_m();
            view.neighbours.visit_landing_column(i, view.now, beside_m, |column| {
                visit(KeepOutZone { kind: ZoneKind::Static, ..column });
            });
        }
    }
}

/// Passes the keep-out zones of all other vehicles in a coverage mission to `visit`.
pub(super) fn visit_zones_of_others<const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'_, V, W, G>,
    visit: &mut dyn FnMut(KeepOutZone),
) {
    (0..neighbour_zone_index_count(view))
        .for_each(|index| visit_neighbour_zones(view, index, visit));
}

/// Distance of a place from the surface of a zone, metres; negative inside.
fn distance_to_zone_m(zone: &KeepOutZone, place: &Point) -> f32 {
    let (axis, away) = (zone.to - zone.from, place - zone.from);
    let share = (away.dot(&axis) / axis.norm_squared().max(1e-6)).clamp(0.0, 1.0);
    (away - axis * share).length() - zone.radius_m
}

/// Whether a place is inside a zone of another vehicle, or of a `known` obstacle.
pub(super) fn is_barred<const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'_, V, W, G>,
    known: &[KeepOutZone],
    place: &Point,
) -> bool {
    let mut barred = known.iter().any(|zone| distance_to_zone_m(zone, place) <= 0.0);
    visit_zones_of_others(view, &mut |zone| barred |= distance_to_zone_m(&zone, place) <= 0.0);
    barred
}

/// First free place along the path, metres, beyond the first stretch ahead that zones block; `None`
/// if none is blocked ahead, or none is free before the last descent and the first closed gate.
pub(super) fn first_rejoin_m<const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'_, V, W, G>,
    known: &[KeepOutZone],
) -> Option<f32> {
    let plan = view.mission.plan()?;
    let (from_m, here) = (view.guidance.reference_along_m(), view.telemetry.position);
    let waypoints = plan.path.waypoints();
    let home_m = waypoints.iter().nth_back(1)?.along_m;
    let most_m = view.guidance.gates_open_up_to_m(&view.guidance_inputs).min(home_m);
    let mut things = Vec::<KeepOutZone, MAX_REJOIN_ZONES>::new();
    let add = |thing: KeepOutZone, things: &mut Vec<_, MAX_REJOIN_ZONES>| {
        _ = (distance_to_zone_m(&thing, &here) < LOOK_AHEAD_M).then(|| things.push(thing));
    };
    known.iter().for_each(|thing| add(*thing, &mut things));
    for index in 0..neighbour_zone_index_count(view) {
        // Zones beyond the list's capacity are left out here: the shell's search for the detour
        // knows all of them.
        if things.is_full() {
            break;
        }
        visit_neighbour_zones(view, index, &mut |thing| add(thing, &mut things));
    }
    let (mut at_m, mut met) = (from_m, false);
    for _ in 0..MAX_SAMPLES {
        let far = !met && at_m > from_m + LOOK_AHEAD_M + BLOCK_SEARCH_BEYOND_M;
        if far || at_m + DETOUR_RETURNS_BEYOND_M > most_m {
            return None;
        }
        let place = plan.path.point_at(at_m)?;
        // Distance to the nearest zone: nothing blocks the path up to this far on.
        let free_m = things
            .iter()
            .map(|thing| distance_to_zone_m(thing, &place))
            .fold(LOOK_AHEAD_M, f32::min);
        if met && free_m > 0.0 {
            return Some(at_m + DETOUR_RETURNS_BEYOND_M);
        }
        met |= free_m <= 0.0;
        at_m += free_m.max(MIN_SAMPLE_SPACING_M);
    }
    None
}
