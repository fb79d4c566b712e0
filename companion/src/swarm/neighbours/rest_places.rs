//! Where a neighbour that no vehicle hears comes to rest along the points that it reported.

use planner_core::track::safety::PlaceOnPoints;
use planner_core::{Length, Point};

use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::margins::{CRUISE_TRACKING_ERROR_M, min_unheard_travel_m};

impl NeighbourEntry {
    /// The points that the neighbour flies to next from its position: without those that it has
    /// passed, such as a setpoint behind it. All points in a coverage mission, or if it is not on
    /// its points.
    pub(super) fn next_points(&self) -> &[Point] {
        match self.place_on_points {
            PlaceOnPoints::On { leg_end: leg, .. } if !self.would_fly_all_points_unheard() => {
                self.points.get(usize::from(leg)..).unwrap_or(&self.points)
            }
            _ => &self.points,
        }
    }

    /// Where the points that the neighbour may fly unheard begin: its position, without the
    /// deviation from its points by which a gust carried it aside, since it comes to rest on them.
    /// The position itself in a coverage mission, where the neighbour climbs, descends or lands,
    /// where it may be on several legs, and with a greater deviation than that of a vehicle that
    /// flies along its points.
    fn start_of_unheard_stretch(&self) -> Point {
        let (here, points) = (self.state.position, &self.points);
        if self.would_fly_all_points_unheard() || self.has_column() {
            return here;
        }
        let PlaceOnPoints::On { leg_end, uncertainty_dm: 0 } = self.place_on_points else {
            return here;
        };
        let from = usize::from(leg_end).saturating_sub(1);
        let on_points = match points.get(from..) {
            Some([a, b, ..]) => {
                let (leg, away) = (b - a, here - a);
                a + leg * (away.dot(&leg) / leg.norm_squared().max(1e-6))
            }
            // It holds its place.
            Some([only]) => *only,
            _ => here,
        };
        const MOST_SQ_M2: f32 = CRUISE_TRACKING_ERROR_M * CRUISE_TRACKING_ERROR_M;
        if (here - on_points).norm_squared() <= MOST_SQ_M2 { on_points } else { here }
    }

    /// As [`Self::for_each_unheard_leg_from`], from [`Self::start_of_unheard_stretch`].
    pub(super) fn for_each_unheard_leg(
        &self,
        left_m: f32,
        each: &mut dyn FnMut([Point; 2], [f32; 2]),
    ) {
        self.for_each_unheard_leg_from(self.start_of_unheard_stretch(), left_m, each);
    }

    /// Calls `each` with the place `at`, as a leg of length 0, and with each leg from there along
    /// the neighbour's points that it may have flown unheard, `left_m` in all: both ends of the
    /// whole leg, then its length and that of its flown part, metres.
    #[inline(never)]
    pub(super) fn for_each_unheard_leg_from(
        &self,
        mut at: Point,
        mut left_m: f32,
        each: &mut dyn FnMut([Point; 2], [f32; 2]),
    ) {
        each([at; 2], [0.0; 2]);
        for next in self.next_points() {
            let leg_m = (next - at).length();
            if leg_m > left_m {
                return each([at, *next], [leg_m, left_m]);
            }
            left_m -= leg_m;
            each([core::mem::replace(&mut at, *next), *next], [leg_m; 2]);
        }
    }

    /// Calls `visit` with places along its points where the neighbour may rest unheard, from
    /// `from_m` to `to_m` along them, and with the greatest distance of a place where it may rest
    /// from the nearest of those visited, metres.
    #[inline(never)]
    pub(super) fn for_each_rest_place(
        &self,
        [from_m, to_m]: [f32; 2],
        visit: &mut dyn FnMut(Point, f32),
    ) {
        let step_m = libm::fmaxf(MIN_UNHEARD_STRETCH_SPACING_M, to_m / MAX_STRETCH_SPACINGS);
        let wider_m = if step_m > MIN_UNHEARD_STRETCH_SPACING_M { 0.5 * step_m } else { 0.0 };
        let (mut before_m, mut end) = (0.0, self.state.position);
        self.for_each_unheard_leg(to_m, &mut |[at, next], [leg_m, flown_m]| {
            let mut along_m = if from_m > before_m { from_m - before_m } else { step_m };
            while along_m < flown_m {
                visit(at + (next - at) * (along_m / leg_m), wider_m);
                along_m += step_m;
            }
            before_m += flown_m;
            // The end of the flown part too.
            end = if flown_m < leg_m { at + (next - at) * (flown_m / leg_m) } else { next };
            if from_m <= before_m {
                visit(end, wider_m);
            }
        });
        // Points that end sooner: the neighbour rests at their end.
        if before_m < from_m {
            visit(end, wider_m);
        }
    }

    /// Least distance along its points, metres, at which the neighbour comes to rest unheard: that
    /// of its hardest stop from the speed at which it was last heard, or of a fall. 0 in a coverage
    /// mission, off its points, and where it climbs, descends or lands.
    pub(super) fn min_rest_distance_m(&self) -> f32 {
        let far = |way: &Point| way.norm_squared() > MIN_COURSE_M * MIN_COURSE_M;
        let course = self.next_points().iter().map(|p| p - self.state.position).find(far);
        let flies = matches!(self.place_on_points, PlaceOnPoints::On { .. })
            && !self.would_fly_all_points_unheard()
            && !self.has_column();
        let Some(ahead) = course.filter(|_| flies) else { return 0.0 };
        let speed_mps = libm::fmaxf(self.state.velocity.dot(&ahead) / ahead.length(), 0.0);
        let stop_m = libm::fminf(min_unheard_travel_m(speed_mps), self.max_unheard_travel_m);
        let (mut points_m, mut at) = (0.0, self.start_of_unheard_stretch());
        for next in self.next_points() {
            points_m += (next - core::mem::replace(&mut at, *next)).length();
            if MIN_FLOWN_SHARE_OF_POINTS * points_m >= stop_m {
                return stop_m;
            }
        }
        MIN_FLOWN_SHARE_OF_POINTS * points_m
    }

    /// The place `least_m` along its points from the neighbour's position, the points from the
    /// beginning of that place's leg on, and where on these points it is. `None` if `least_m` is 0,
    /// if the points end sooner, or if the neighbour is not on them.
    pub(super) fn nearest_rest_place(
        &self,
        least_m: f32,
    ) -> Option<(Point, &[Point], PlaceOnPoints)> {
        let (mut left_m, mut at) = (least_m, self.state.position);
        let PlaceOnPoints::On { uncertainty_dm, .. } = self.place_on_points else { return None };
        let skipped = self.points.len() - self.next_points().len();
        for (i, next) in self.points.iter().enumerate().skip(skipped).filter(|_| least_m > 0.0) {
            let leg_m = (next - at).length();
            if leg_m > left_m {
                let rest = at + (next - at) * (left_m / leg_m);
                let from = i.saturating_sub(1);
                let leg_end = (i - from) as u8;
                let place = PlaceOnPoints::On { leg_end, uncertainty_dm };
                return Some((rest, &self.points[from..], place));
            }
            (at, left_m) = (*next, left_m - leg_m);
        }
        None
    }
}
