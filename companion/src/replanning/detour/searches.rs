//! Requests for a path from the shell (detour, aside, home or back), and what follows from its
//! answer.
//!
//! Cost: a request lists every known keep-out zone.

use planner_core::detour::{DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::{VehiclePlan, Waypoint};
use planner_core::{Length, Point};

use super::beside::{self, BLOCKED_BEYOND_SAFETY_DISTANCE_M, DETOUR_MARGIN_M, REJOIN_SEARCH_PAUSE};
use super::homeward::HOME_SEARCH_PAUSE;
use super::path_kind::{DetourPurpose, PathKind, RejoinPlace};
use super::{
    Detours, EARLY_GIVE_UP_AFTER_S, MAX_FAILED_SEARCHES, MAX_SEARCH_PAUSE_S, STUCK_AFTER,
    TURN_DELAY_PER_VEHICLE_S,
};
use crate::guidance::evade;
use crate::replanning::view::DetourView;
use crate::state::State;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Time from a search that found no landing place aside to the next search, seconds.
const ASIDE_SEARCH_PAUSE_S: u64 = 30;
/// Time for which a landing was held, after which a vehicle that hears no other one seeks a landing
/// place aside.
const HELD_LANDING_SIDESTEP_AFTER: Duration = Duration::from_secs(60);
/// Distance along the path up to which two failed searches count as in one place, metres.
const SAME_SEARCH_PLACE_M: f32 = 1.0;
/// Distance within which a setpoint is on its path, metres.
const SETPOINT_ON_PATH_M: f32 = 0.1;

/// Whether a search that found no detour may succeed later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RetryOutlook {
    /// A silent vehicle may still be coming down; once on the ground it leaves more room.
    SilentVehicleComesDown,
    /// Another vehicle may still move.
    OthersMayMove,
    /// The search did not end, or its answer could not be used: another search may find a path.
    NotSearched,
    /// No other vehicle will move any more.
    NoneWillMove,
}

/// Ends of the leg on which the reference is: the one ahead, then the one behind.
fn reference_leg_ends<'a, const V: usize, const W: usize, const G: usize>(
    view: &DetourView<'a, V, W, G>,
) -> Option<[&'a Waypoint; 2]> {
    let points = view.mission.plan()?.path.waypoints();
    let along_m = view.guidance.reference_along_m();
    let last = points.len().saturating_sub(1);
    let next = points.iter().position(|w| w.along_m > along_m).unwrap_or(last);
    Some([points.get(next)?, points.get(next.saturating_sub(1))?])
}

impl Detours {
    /// Pause after a search that found no detour, seconds: each blocked vehicle has its turn in it,
    /// and before the third search a vehicle that waits counts as blocked (`DEAD_END_AFTER`), and
    /// may fly a detour. While all stand, nothing else changes what the next search finds.
    pub(super) fn search_pause_s<const V: usize, const W: usize, const G: usize>(
        view: &DetourView<'_, V, W, G>,
    ) -> u64 {
        let blocked = view.neighbours.blocked_count_below_id(u8::MAX);
        (TURN_DELAY_PER_VEHICLE_S * (blocked + 4)).min(MAX_SEARCH_PAUSE_S)
    }

    /// Whether a blocked vehicle in a coverage mission is no longer held by a gate or by the safety
    /// filter: what blocked its path has come down.
    pub(super) fn is_freed_over_area<const V: usize, const W: usize, const G: usize>(
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        view.config.lost_vehicle_down_after_s.is_some()
            && view.mission.state() == State::Blocked
            && view.guidance.advice.waiting_for_id == 0
            && view.guidance.filter.hindered_for(view.now) == Duration::default()
    }

    /// Whether this vehicle may search for a landing place beside its path: its task leaves the
    /// pad; it hears another vehicle, all others have landed or are out of the plan, or its landing
    /// has been held for [`HELD_LANDING_SIDESTEP_AFTER`]; and no search aside failed within
    /// [`ASIDE_SEARCH_PAUSE_S`].
    pub(crate) fn may_seek_landing_aside<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let retries = |at: Instant| view.now - at >= Duration::from_secs(ASIDE_SEARCH_PAUSE_S);
        view.mission.plan().is_some_and(|plan| plan.task.leaves_pad())
            && (!view.neighbours.hears_nobody(view.now)
                || view.neighbours.are_all_landed_or_out()
                || view.guidance.filter.column_blocked_for(view.now) >= HELD_LANDING_SIDESTEP_AFTER)
            && self.aside_search_failed_at.is_none_or(retries)
    }

    /// Whether this vehicle seeks no further detour: enough searches failed, or enough detours led
    /// nowhere.
    pub(crate) fn has_given_up_detours(&self) -> bool {
        self.no_retry
            || self.failed_searches.saturating_add(self.detours_without_progress)
                >= MAX_FAILED_SEARCHES
    }

    /// Time for which this vehicle has waited below a vehicle that lands, unable to leave along its
    /// path; zero while its setpoint is not at the reference, and for [`MAX_SEARCH_PAUSE_S`] after
    /// a search aside failed.
    pub(crate) fn time_trapped_below_landing<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Duration {
        let retries = |at: Instant| view.now - at >= Duration::from_secs(MAX_SEARCH_PAUSE_S);
        let may_seek_aside = |_: &Instant| {
            view.guidance.is_setpoint_at_reference()
                && self.aside_search_failed_at.is_none_or(retries)
        };
        let trapped = view.guidance.trapped_below_since().filter(may_seek_aside);
        trapped.map_or(Duration::default(), |at| view.now - at)
    }

    /// Notes that a path for this purpose is requested from the shell. Unless that path only makes
    /// room for another vehicle ([`DetourPurpose::Aside`]) or leads back to the plan's path, the
    /// vehicle gives up returning to the plan's path.
    pub(crate) fn note_request(&mut self, purpose: DetourPurpose) {
        if !matches!(purpose, DetourPurpose::Aside(_) | DetourPurpose::Rejoin(_)) {
            self.path_kind = self.path_kind.without_rejoin();
        }
        (self.requested_purpose, self.request_read) = (Some(purpose), false);
        self.obstacles.mark_requested();
        self.detour_ready = false;
    }

    /// Notes that the shell reads the request: its next answer belongs to it.
    pub(crate) fn note_request_read(&mut self) {
        self.request_read = self.requested_purpose.is_some();
    }

    /// Whether the shell has read the request.
    pub(crate) fn is_request_read(&self) -> bool {
        self.request_read
    }

    /// Whether the last failed search was at least `pause_s` seconds ago. A delay by the number of
    /// failures is not enough: that number stops growing while a silent vehicle comes down.
    pub(super) fn may_search_again(&self, pause_s: u64, now: Instant) -> bool {
        now - self.failed_at >= Duration::from_secs(pause_s)
    }

    /// Where the requested path begins: at the reference, or for a landing aside where the setpoint
    /// stands. A vehicle that is held far from its reference may not be able to fly there first.
    /// But further from the path than its clearance allows, only the search in a coverage mission
    /// checks the way from the setpoint: elsewhere the path then begins at the reference.
    pub(crate) fn start_of_detour<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> Option<Point> {
        let (guidance, config) = (view.guidance, view.config);
        let spare_m = reference_leg_ends(view)?[0].leg_clearance_m - config.required_clearance_m;
        let checked = config.lost_vehicle_down_after_s.is_some()
            || guidance.setpoint_off_path_m(&view.guidance_inputs)
                <= spare_m.max(SETPOINT_ON_PATH_M);
        match checked && self.seeks_landing_aside() && guidance.is_setpoint_still() {
            true => Some(guidance.setpoint_position()),
            false => view.mission.plan()?.path.point_at(guidance.reference_along_m()),
        }
    }

    /// The request for the shell's planner; `None` without a plan or a request. `visit` is called
    /// with each keep-out zone.
    pub(crate) fn detour_request<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
        mut visit: impl FnMut(KeepOutZone),
    ) -> Option<DetourRequest> {
        let (requested, plan) = (self.requested_purpose?, view.mission.plan()?);
        let along_m = view.guidance.reference_along_m();
        let [ahead, behind] = reference_leg_ends(view)?;
        let apart_m = view.config.safety_distance_m;
        let z_m = view.telemetry.position.z;
        self.obstacles.all().iter().for_each(|obstacle| {
            // A place above an obstacle is none to land at.
            let above_m = libm::fmaxf(z_m - obstacle.from.z, 0.0);
            let to = obstacle.from + Point::new(0.0, 0.0, above_m);
            visit(match requested == DetourPurpose::LandingAside && above_m > 0.0 {
                true => KeepOutZone { to, kind: ZoneKind::LandingColumn, ..*obstacle },
                false => *obstacle,
            });
        });
        match view.config.lost_vehicle_down_after_s {
            Some(_) if !requested.is_aside() => beside::visit_zones_of_others(view, &mut visit),
            _ => {
                let apart = self.keep_out_radii_m(requested, along_m, apart_m);
                view.neighbours.for_each_keep_out_zone(view.now, apart, &mut visit);
            }
        }
        if requested.is_aside() {
            view.neighbours.for_each_landing_column(
                view.now,
                apart_m + evade::EVADE_MARGIN_M,
                &mut visit,
            );
        }
        if requested == DetourPurpose::LandingAside {
            let height_m = plan.path.point_at(along_m)?.z;
            view.neighbours.for_each_landing_zone(
                view.now,
                [apart_m + DETOUR_MARGIN_M, height_m],
                visit,
            );
        }
        let here = self.start_of_detour(view)?;
        let (goal, descent_m) = goal_and_descent_m(requested, view, plan)?;
        let off_m = plan.path.point_at(along_m).map_or(0.0, |on| (on - here).length());
        let over_area = view.config.lost_vehicle_down_after_s.is_some();
        // From beside the leg the first way to its end has that much less room.
        let off_m = if over_area || off_m <= SETPOINT_ON_PATH_M { 0.0 } else { off_m };
        Some(DetourRequest {
            land_aside: requested.is_aside(),
            here,
            leg: [ahead.position, behind.position],
            leg_clearance_m: ahead.leg_clearance_m - off_m,
            goal,
            descent_m,
            required_clearance_m: view.config.required_clearance_m,
            fence: view.config.geofence,
        })
    }

    /// Puts the path that has come for `purpose` in place of the path flown so far; the mission
    /// table begins it, see [`Self::is_detour_ready`]. `progress_m` is the progress on the path
    /// before, which last grew at `progress_at`. If the path before was a detour and its progress
    /// last grew longer than [`STUCK_AFTER`] ago, it counts as a detour without progress.
    pub(crate) fn adopt_detour(
        &mut self,
        purpose: DetourPurpose,
        progress_m: f32,
        now: Instant,
        progress_at: Instant,
        timers: &mut Timers,
    ) {
        let on_detour = self.path_kind.is_detour();
        let stuck = on_detour && now - progress_at > STUCK_AFTER;
        let fruitless = if stuck { self.detours_without_progress.saturating_add(1) } else { 0 };
        self.obstacles.mark_requested_avoided();
        let Self { mut home, area_searches: mut field_searches, .. } = *self;
        home.end();
        field_searches.count_found();
        *self = Self {
            obstacles: core::mem::take(&mut self.obstacles),
            left_plan: self.left_plan || !purpose.returns_to_plan(),
            left_at_m: if on_detour { self.left_at_m } else { progress_m },
            path_kind: PathKind::Detour(purpose),
            detour_ready: true,
            detours_without_progress: fruitless,
            home,
            area_searches: field_searches,
            ..Self::default()
        };
        timers.set(Timer::PathScan, now);
    }

    /// Notes that there is no free place on the plan's path to return to, so that no detour can be
    /// requested.
    pub(crate) fn note_no_rejoin_place(now: Instant, timers: &mut Timers) {
        timers.set(Timer::RejoinSearch, now + REJOIN_SEARCH_PAUSE);
    }

    /// Radius of the zones of vehicles in the air, of those among them that are heard and on plan,
    /// and of those on the ground, with the safety distance `apart_m`, metres. Between two that
    /// hover, the full margin may leave no way: a search after one that found none from about the
    /// same place keeps a smaller margin from them until another vehicle moves. On the ground a
    /// zone is only as wide as what blocks a path, so that a goal planned beside it can be reached.
    pub(super) fn keep_out_radii_m(
        &self,
        requested: DetourPurpose,
        along_m: f32,
        apart_m: f32,
    ) -> [f32; 3] {
        let [aloft_m, grounded_m] =
            [DETOUR_MARGIN_M, BLOCKED_BEYOND_SAFETY_DISTANCE_M].map(|m| apart_m + m);
        let found_none_here = |at_m: &f32| (along_m - at_m).abs() <= SAME_SEARCH_PLACE_M;
        let nearer = self.no_path_found_at_m.filter(found_none_here).is_some();
        match requested == DetourPurpose::Goal && nearer {
            true => [aloft_m, grounded_m, grounded_m],
            false => [aloft_m, aloft_m, grounded_m],
        }
    }

    /// Notes that the shell found no path from `along_m` metres along the path, and whether to
    /// search again.
    pub(crate) fn note_failure(
        &mut self,
        along_m: f32,
        outlook: RetryOutlook,
        now: Instant,
        timers: &mut Timers,
    ) {
        match self.requested_purpose {
            // The path home is sought again after a while.
            Some(DetourPurpose::Home) => {
                return timers.set(Timer::HomeSearch, now + HOME_SEARCH_PAUSE);
            }
            // A failed search for a path aside does not count as a failed search for a detour.
            Some(DetourPurpose::Aside(_) | DetourPurpose::LandingAside) => {
                self.aside_search_failed_at = Some(now);
                return;
            }
            Some(DetourPurpose::Rejoin(_)) => return Self::note_no_rejoin_place(now, timers),
            Some(DetourPurpose::Goal) | None => {}
        }
        self.failed_at = now;
        if outlook == RetryOutlook::SilentVehicleComesDown {
            // Each failure delays the next request, but alone never ends the search: once the
            // silent vehicle is on the ground, a detour may be found.
            self.failed_searches =
                self.failed_searches.saturating_add(1).min(MAX_FAILED_SEARCHES - 1);
            return;
        }
        if (along_m - self.failed_at_m).abs() > SAME_SEARCH_PLACE_M {
            (self.failed_searches_here, self.failed_at_m) = (0, along_m);
        }
        if self.failed_searches_here == 0 {
            self.failed_since = now;
        }
        if outlook == RetryOutlook::OthersMayMove {
            self.no_path_found_at_m = Some(along_m);
        }
        self.failed_searches = self.failed_searches.saturating_add(1);
        self.failed_searches_here = self.failed_searches_here.saturating_add(1);
        let long = now - self.failed_since >= Duration::from_secs(EARLY_GIVE_UP_AFTER_S);
        let often = long && self.failed_searches_here >= MAX_FAILED_SEARCHES - 1;
        self.no_retry = often || outlook == RetryOutlook::NoneWillMove;
    }
}

/// The goal of the path requested, and the depth of the descent from there, metres; `None` if there
/// is no goal. The place where a path aside ends is known only once the path is.
fn goal_and_descent_m<const V: usize, const W: usize, const G: usize>(
    requested: DetourPurpose,
    view: &DetourView<'_, V, W, G>,
    plan: &VehiclePlan<W, G>,
) -> Option<(DetourGoal, f32)> {
    let (home, home_descent_m) = view.mission.home_goal();
    if view.config.lost_vehicle_down_after_s.is_none() {
        return match plan.task.goal() {
            Some(goal) => Some((DetourGoal::RoadmapGoal(goal), home_descent_m)),
            // The flight ends over the vehicle's own pad.
            None => plan.task.leaves_pad().then_some((home, home_descent_m)),
        };
    }
    let Some(RejoinPlace { position: over, .. }) = requested.rejoin_place() else {
        return Some((home, home_descent_m));
    };
    let above_m = over.z - view.guidance.planned_ground_m(plan);
    Some((DetourGoal::Point { end: over, layer_z_m: over.z }, libm::fmaxf(above_m, 0.0)))
}
