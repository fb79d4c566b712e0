//! Leaving the column below a vehicle that descends: a vehicle that waits there flies back along
//! its path until it is beside the column.
//!
//! A vehicle that left the plan and is still in the air is landed by its autopilot, which does not
//! avoid others. No vehicle waits nearer than the safety distance plus [`EVADE_MARGIN_M`] to the
//! column in which such a vehicle may come down (`Neighbours::visit_landing_column`). A vehicle
//! that is to wait at a place in the column waits at the nearest free place before that place on
//! its path; one that holds there already flies back. It came along that path, so the path is free
//! of walls. It comes no nearer to a vehicle behind it than the safety distance plus
//! [`TRAILING_VEHICLE_MARGIN_M`].
//!
//! ENU metres. Cost: [`MAX_SEARCH_COST`] a control step. A search takes one control step for the
//! column of one neighbour and a dozen for the most columns that there can be; in theory six for
//! each place that is compared, if each is inside another column.

use planner_core::detour::KeepOutZone;
use planner_core::flight::Path;
use planner_core::track::ReferenceState;
use planner_core::track::deconflict::Neighbour;
use planner_core::{Length, Point};

use crate::swarm::incremental_scan::IncrementalScan;

/// Drift of the vehicle that descends and sway of the one below, together, metres: kept beyond the
/// safety distance.
pub const EVADE_MARGIN_M: f32 = 0.6;
/// Margin beyond the safety distance to a vehicle behind on the path, metres: the path-tracking
/// errors of both vehicles together.
const TRAILING_VEHICLE_MARGIN_M: f32 = 0.6;
/// Spacing of the places along the path that are compared with the columns, metres.
const PLACE_STEP_M: f32 = 0.25;
/// Maximum number of steps of [`PLACE_STEP_M`] back along the path that one search takes.
const MAX_PLACES: u16 = 48;
/// Greatest cost of a search in one step: 1 for each neighbour and for each column, and
/// [`PLACE_COST`] for each place.
const MAX_SEARCH_COST: u16 = 96;
/// Cost in a search of comparing one place with the columns, the columns not counted.
const PLACE_COST: u16 = 4;
/// Greatest speed backward along a straight segment of the own path, m/s.
const MAX_EVADE_MPS: f32 = 1.5;
/// Greatest speed backward through a waypoint, m/s: at this speed the vehicle is up to 0.47 m off
/// the path in a right-angled corner.
const MAX_CORNER_MPS: f32 = 0.6;
/// Acceleration backward along the path, m/s².
const EVADE_MPS2: f32 = 1.0;
/// Deceleration of a vehicle that still flies forward, before it turns back, m/s².
const BRAKING_MPS2: f32 = 1.5;

/// Result of the search for a waiting place outside all landing columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EvadeTarget {
    /// The place where the vehicle would wait anyway is outside all columns.
    #[default]
    Here,
    /// The nearest place back along the path that is outside all columns: arc length, metres.
    Back(f32),
    /// No place within 12 m back along the path is outside all columns.
    Nowhere,
}

/// Whether a vehicle may make its next step back along the path, away from below one that descends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepBack {
    /// It can, or need not.
    Free,
    /// Its next step back is barred.
    Barred,
}

/// Search for the nearest waiting place that is outside all landing columns, over several steps.
#[derive(Clone, Debug, Default)]
pub struct EvadeSearch {
    /// Progress of the search along the path.
    scan: IncrementalScan,
    /// Place along the path where the search under way began, metres; `None` if there is none.
    search_from_m: Option<f32>,
    /// Number of places from `search_from_m` back that were found inside a column.
    places_inside_columns: u16,
    /// Result of the last search that has finished.
    pub last_target: EvadeTarget,
}

impl EvadeSearch {
    /// Continues the search, back along the path from `wait_m`, where the vehicle would wait.
    /// `visit` calls its second argument with each column of the neighbour with the given index,
    /// which is below `neighbours`.
    pub fn continue_search<const W: usize>(
        &mut self,
        path: &Path<W>,
        wait_m: f32,
        neighbours: usize,
        visit: impl Fn(usize, &mut dyn FnMut(KeepOutZone)),
    ) {
        // While the vehicle steps back, `wait_m` falls and the search goes on. Where `wait_m`
        // grows, the search begins there.
        let from_m = self
            .search_from_m
            .filter(|from_m| wait_m <= from_m + PLACE_STEP_M)
            .unwrap_or_else(|| {
                self.places_inside_columns = 0;
                self.scan.restart();
                wait_m
            });
        self.search_from_m = Some(from_m);
        let mut budget = MAX_SEARCH_COST;
        let found = loop {
            let along_m = from_m - f32::from(self.places_inside_columns) * PLACE_STEP_M;
            // The last place compared is the start of the path.
            let on_path = self.places_inside_columns == 0 || along_m > -PLACE_STEP_M;
            let along_m = along_m.max(0.0);
            let place = path.point_at(along_m).filter(|_| on_path);
            let Some(place) = place.filter(|_| self.places_inside_columns <= MAX_PLACES) else {
                break EvadeTarget::Nowhere;
            };
            budget = budget.saturating_sub(PLACE_COST);
            match self
                .scan
                .continue_scan(neighbours, &mut budget, 1, &visit, |column| column.contains(&place))
            {
                None => return,
                Some(true) => self.places_inside_columns += 1,
                Some(false) if self.places_inside_columns == 0 => break EvadeTarget::Here,
                Some(false) => break EvadeTarget::Back(along_m),
            }
        };
        (self.last_target, self.search_from_m) = (found, None);
    }

    /// Forgets the result, and a search under way.
    pub fn reset(&mut self) {
        (self.last_target, self.search_from_m) = (EvadeTarget::Here, None);
    }
}

/// One step of `dt_s` seconds back along the path towards `to_m`, after braking where the reference
/// still moves forward. Returns the new raw point; `None`, without a step, if a neighbour behind is
/// too near.
pub fn step_back<const W: usize>(
    path: &Path<W>,
    reference: &mut ReferenceState,
    to_m: f32,
    neighbours: &[Neighbour],
    safety_m: f32,
    dt_s: f32,
) -> Option<Point> {
    let here = path.point_at(reference.along_m)?;
    let back = path.point_at(reference.along_m - PLACE_STEP_M)?;
    if reference.speed_mps > 0.0 {
        // The reference still moves forward: it brakes first.
        reference.speed_mps = (reference.speed_mps - BRAKING_MPS2 * dt_s).max(0.0);
        reference.along_m = (reference.along_m + reference.speed_mps * dt_s).min(path.length_m());
        return point_at(path, reference);
    }
    let follows = |n: &&Neighbour| {
        let apart = |p: &Point| (n.position - p).length();
        !n.grounded
            && n.progress_m.is_some()
            && apart(&back) < (safety_m + TRAILING_VEHICLE_MARGIN_M).min(apart(&here))
    };
    if neighbours.iter().find(follows).is_some() {
        return None;
    }
    let corner_m =
        path.waypoints().iter().rev().map(|w| reference.along_m - w.along_m).find(|m| *m > 0.0);
    let allowed = |end: f32, left_m: f32| fpu::sqrtf(end * end + 2.0 * EVADE_MPS2 * left_m);
    let ahead = allowed(MAX_CORNER_MPS, corner_m.unwrap_or(0.0))
        .min(allowed(0.0, reference.along_m - to_m));
    // `speed_mps` is positive forward along the path, and negative on the way back.
    let speed = ahead.min(MAX_EVADE_MPS).min(EVADE_MPS2 * dt_s - reference.speed_mps.min(0.0));
    reference.speed_mps = -speed;
    reference.along_m = (reference.along_m - speed * dt_s).max(to_m);
    point_at(path, reference)
}

/// The point of the path at which the reference is.
fn point_at<const W: usize>(path: &Path<W>, reference: &ReferenceState) -> Option<Point> {
    path.point_at(reference.along_m)
}

#[cfg(test)]
mod tests;
