//! The safety filter: the last word on every motion, whatever was planned, commanded or reported.
//!
//! In each step it compares what the vehicle can no longer take back with where each neighbour can be
//! ([`planner_core::safety`]). Where the two come too near, the vehicle stops. It goes on once the next metre of its way
//! is free. The vehicle that yields also waits until 3 s of the way of the other one are free, or that one stands.
//! In a descent it flies back up its own column. The filter knows no gates, no progress and no advice: it only asks the
//! gates which vehicle goes first where both have stopped.
//!
//! ENU metres. Cost: a bound for each neighbour, sets for those within it; more than six of those is a stop.

mod conflict;

use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::flight::{Path, VehiclePlan};
use planner_core::safety::{REACTION_S, Set};

use super::limits::bounds;
use super::{Guidance, Scene};
use crate::mission::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};

/// So much of the way has to be free before the vehicle goes on, metres.
const RESUME_M: f32 = 1.0;
/// And for so long.
const CLEAR: Duration = Duration::from_millis(300);
/// So much lower than below pad and goal the ground between may be, less than a storey, metres.
const LOWER_M: f32 = 2.0;
/// Before a vehicle that the roster does not name it stands no longer than this; then it goes on slowly.
const STRANGER: Duration = Duration::from_secs(10);
/// How fast.
const SLOW_SHARE: f32 = 0.15;
/// A setpoint slower than this may turn, m/s.
const TURNS_MPS: f32 = 0.05;
/// And where no more than this is left to the reference, metres.
const TURNS_M: f32 = 0.03;
/// A stop this near is a standstill, metres: a little more than the way that advice looks ahead.
const WAITS_M: f32 = 0.6;
/// What kept the vehicle from going on within this time still does.
const LATELY: Duration = Duration::from_millis(500);
/// A vehicle that flew on for so long was not kept from going on.
const FREE: Duration = Duration::from_secs(5);
/// The vehicle that yields in a descent flies back up after this.
const BACK_UP: Duration = Duration::from_secs(1);

/// What the filter found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Filter {
    /// Since when it keeps the vehicle stopped.
    stopped_since: Option<Instant>,
    /// Since when the way has been free again.
    clear_since: Option<Instant>,
    /// For which vehicle.
    blocker: u8,
    /// Whether this vehicle is the one that yields.
    yields: bool,
    /// Whether the other one rests for good, or is lost.
    rests: bool,
    stranger: bool,
    /// Whether the sets met in the last step.
    meets: bool,
    /// Whether it looked back along the path.
    back: bool,
    /// Since when the column is, or is not, free.
    column_clear: bool,
    column_since: Option<Instant>,
    /// Since when a landing has been waiting, now and then.
    held_since: Option<Instant>,
    /// Since when it has kept the vehicle from going on for good, and when it last did.
    hindered_since: Option<Instant>,
    hindered_at: Instant,
    /// How often it stopped the vehicle.
    activations: u32,
}

/// The way a vehicle is about to fly.
enum Way {
    Stands,
    /// Along the path, or back.
    Path {
        back: bool,
    },
    /// Straight up or down.
    Vertical {
        to_m: f32,
        speed_mps: f32,
    },
}

impl Filter {
    /// For how long it has kept the vehicle stopped.
    pub(crate) fn stopped_for(&self, now: Instant) -> Duration {
        self.stopped_since.map_or(Duration::default(), |at| now - at)
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped_since.is_some()
    }

    /// For how long it has kept the vehicle stopped although it goes first.
    pub(crate) fn blocked_for(&self, now: Instant) -> Duration {
        if self.yields { Duration::default() } else { self.hindered_for(now) }
    }

    /// For how long it has kept the vehicle from going on for one that rests.
    pub(crate) fn barred_for(&self, now: Instant) -> Duration {
        if self.rests { self.hindered_for(now) } else { Duration::default() }
    }

    /// For how long it has made the vehicle yield.
    pub(crate) fn yielded_for(&self, now: Instant) -> Duration {
        if self.yields { self.hindered_for(now) } else { Duration::default() }
    }

    /// Whether it looked back along the path in this step.
    pub(super) fn looks_back(&self) -> bool {
        self.back
    }

    /// Whether it stops the vehicle for one that goes first.
    pub(super) fn yields(&self) -> bool {
        self.yields
    }

    /// For which vehicle it stops; 0 for none.
    pub(crate) fn blocker(&self) -> u8 {
        if self.is_stopped() { self.blocker } else { 0 }
    }

    /// How often it stopped the vehicle.
    pub(crate) fn activations(&self) -> u32 {
        self.activations
    }

    /// For how long the column has not been free.
    pub(crate) fn column_blocked_for(&self, now: Instant) -> Duration {
        self.column_since.filter(|_| !self.column_clear).map_or(Duration::default(), |at| now - at)
    }

    /// For how long the column has been free.
    pub(crate) fn column_clear_for(&self, now: Instant) -> Duration {
        self.column_since.filter(|_| self.column_clear).map_or(Duration::default(), |at| now - at)
    }

    /// For how long a landing has been waiting, now and then.
    fn held_for(&self, now: Instant) -> Duration {
        self.held_since.map_or(Duration::default(), |at| now - at)
    }

    /// For how long it has kept the vehicle from going on, stops and short flights between them together.
    pub(crate) fn hindered_for(&self, now: Instant) -> Duration {
        let since = self.hindered_since.filter(|_| now - self.hindered_at < LATELY);
        since.map_or(Duration::default(), |at| now - at)
    }

    /// Whether the column to the ground was free in the last step.
    pub(crate) fn column_clear(&self) -> bool {
        self.column_clear
    }

    pub(super) fn reset(&mut self) {
        *self = Self { activations: self.activations, ..Self::default() };
    }

    /// Whether it stops the vehicle now.
    pub(super) fn stops(&self, now: Instant) -> bool {
        self.is_stopped() && (self.meets || !self.passes_stranger(now))
    }

    /// Share of the nominal speed that it leaves.
    pub(super) fn speed_share(&self, now: Instant) -> f32 {
        if self.passes_stranger(now) { SLOW_SHARE } else { 1.0 }
    }

    fn passes_stranger(&self, now: Instant) -> bool {
        self.stranger && self.stopped_for(now) >= STRANGER
    }

    /// Whether the vehicle flies back up its column.
    pub(super) fn backs_up(&self, now: Instant) -> bool {
        self.yields && self.stopped_for(now) >= BACK_UP
    }
}

impl Guidance {
    /// Compares the way ahead with all neighbours; to be called once a step, before the reference moves.
    pub(super) fn filter<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) {
        let priority = self.deconflict.method == Method::Priority;
        let Some(plan) = scene.plan.filter(|_| priority) else {
            self.filter = Filter { column_clear: true, ..Filter::default() };
            return;
        };
        let position = &scene.telemetry.position;
        let ground_m = self.ground_m(plan).min(position.z);
        // Between pad and goal the ground may be lower than below either.
        let lands = matches!(state, State::Land | State::LandingHeld);
        let between = lands && self.on_path && !self.reached_end(&plan.path);
        let ground_m = if between { ground_m - LOWER_M } else { ground_m };
        let top_m = plan.path.point_at(0.0).map_or(position.z, |p| p.z);
        let way = match state {
            State::Scheduled => Way::Vertical { to_m: top_m, speed_mps: 0.0 },
            State::Land | State::LandingHeld => Way::Vertical { to_m: ground_m, speed_mps: 0.0 },
            State::Climb => Way::Vertical { to_m: top_m, speed_mps: self.door.velocity().z.max(0.0) },
            State::Follow if self.descends() => {
                Way::Vertical { to_m: ground_m, speed_mps: (-self.door.velocity().z).max(0.0) }
            }
            State::Follow
            | State::Paused
            | State::Alone
            | State::Blocked
            | State::Replanning
            | State::Stopping
                if self.on_path =>
            {
                Way::Path { back: self.flies_back(&plan.path) }
            }
            _ => Way::Stands,
        };
        if !matches!(state, State::Scheduled | State::Land | State::LandingHeld) {
            (self.filter.column_clear, self.filter.column_since) = (true, None);
            self.filter.held_since = self.filter.held_since.filter(|_| state == State::Replanning);
        }
        if matches!(way, Way::Stands) {
            self.filter.reset();
            return;
        }
        let whole_column = matches!(state, State::Scheduled | State::Land | State::LandingHeld);
        let back = matches!(way, Way::Path { back: true });
        if back != self.filter.back {
            self.filter.reset_stop();
            self.filter.back = back;
        }
        let stopped = self.filter.is_stopped();
        let extra_m = if stopped { RESUME_M } else { 0.0 };
        let bounds = bounds(&self.track);
        let own = match way {
            Way::Vertical { to_m, .. } if whole_column => Set::vertical(*position, to_m),
            Way::Vertical { to_m, speed_mps } => {
                let speed_mps = if stopped { 0.0 } else { speed_mps };
                let stop_m = if stopped { 0.0 } else { self.door.braking_m(true) };
                let braking_m = bounds.braking.stop_m(speed_mps).max(stop_m);
                let fly_m = speed_mps * REACTION_S + braking_m + extra_m;
                let down = to_m < position.z;
                let reference_m = self.door.position().z;
                let end_m = if down {
                    (reference_m - fly_m).max(to_m).min(reference_m)
                } else {
                    (reference_m + fly_m).min(to_m).max(reference_m)
                };
                Set::vertical(Point::new(position.x, position.y, reference_m), end_m)
            }
            Way::Path { back } => self.own_set(&plan.path, scene.telemetry, &bounds, extra_m, back),
            Way::Stands => return,
        };
        let found = self.first_conflict(state, scene, neighbours, &own, &bounds, now);
        if whole_column {
            self.filter.note_column(found.is_none(), now);
            self.filter.reset_stop();
            self.filter.blocker = found.map_or(0, |found| found.id);
            return;
        }
        self.filter.meets = found.is_some();
        match found {
            Some(found) => {
                if !stopped {
                    self.filter.stopped_since = Some(now);
                    self.filter.activations = self.filter.activations.wrapping_add(1);
                }
                self.filter.clear_since = None;
                // A stranger hinders it for good only where the hull would touch it.
                if !found.stranger || self.filter.passes_stranger(now) {
                    self.filter.hinder(now);
                }
                (self.filter.blocker, self.filter.yields) = (found.id, found.yields);
                (self.filter.stranger, self.filter.rests) = (found.stranger, found.rests);
            }
            None if stopped => {
                let since = *self.filter.clear_since.get_or_insert(now);
                // Past a stranger it goes on in the same stop, slowly.
                let clear_for = if self.filter.passes_stranger(now) { STRANGER } else { CLEAR };
                if now - since >= clear_for {
                    self.filter.reset_stop();
                }
            }
            None => self.count_standstill(state, scene, neighbours, now),
        }
    }

    /// Whether the vehicle flies back along its path, or stands and is about to. What is still to be flown forward counts first: a
    /// reference that turns back leaves the setpoint on its way.
    fn flies_back<const W: usize>(&self, path: &Path<W>) -> bool {
        let along_m = self.tracker.along_m;
        let velocity = self.door.velocity();
        let beside = |by_m: f32| path.point_at((self.setpoint_m + by_m).clamp(0.0, path.length_m()));
        let onward = match (beside(-TURNS_M), beside(TURNS_M)) {
            (Some(from), Some(to)) => velocity.dot(&(to - from)),
            _ => 0.0,
        };
        let moves = velocity.norm_squared() > TURNS_MPS * TURNS_MPS;
        if along_m > self.setpoint_m + TURNS_M || (moves && onward > 0.0) {
            return false;
        }
        (moves && onward < 0.0) || self.tracker.speed_mps < 0.0 || self.back_to_m.is_some()
    }

    /// A standstill before a vehicle that no gate waits for counts as one of the filter's.
    fn count_standstill<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &Scene<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) {
        let id = self.advice.waiting_for;
        let along_m = self.tracker.along_m;
        let gate = |plan: &VehiclePlan<W, G>| {
            let near = |at_m: f32| (along_m - WAITS_M..along_m + WAITS_M).contains(&at_m);
            plan.gates.iter().any(|gate| gate.id == id && near(gate.at_m))
        };
        if matches!(state, State::Follow | State::Blocked | State::Replanning)
            && id != 0
            && self.advice.stop_within_m.min(self.waits_m) < WAITS_M
            && !scene.plan.is_some_and(gate)
        {
            self.filter.hinder(now);
            (self.filter.yields, self.filter.rests) = (id < scene.id, neighbours.rests(id, now));
        }
    }
}

impl Filter {
    fn hinder(&mut self, now: Instant) {
        if now - self.hindered_at > FREE {
            self.hindered_since = None;
        }
        self.hindered_since.get_or_insert(now);
        self.hindered_at = now;
    }

    fn note_column(&mut self, clear: bool, now: Instant) {
        if !clear {
            self.held_since.get_or_insert(now);
        }
        if clear != self.column_clear || self.column_since.is_none() {
            (self.column_clear, self.column_since) = (clear, Some(now));
        }
    }

    fn reset_stop(&mut self) {
        (self.stopped_since, self.clear_since) = (None, None);
        (self.yields, self.stranger, self.rests) = (false, false, false);
    }
}
