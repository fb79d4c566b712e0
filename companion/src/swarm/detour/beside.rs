//! Around what hovers or lies on a path over a field, and back to that path beyond it.
//!
//! The vehicle stops, asks its shell for the way to the first free place of its path behind what blocks that, flies it beside the
//! plan, and then asks for its own plan again, to go on from there. It keeps its part: no division follows, its progress stays
//! where it left its path until it is back, and others wait for it. It comes back no further than its gates are open.
//!
//! ENU metres. Constant work but for [`returns_m`], once an attempt: at most [`LOOKS`] looks at each of [`THINGS`] things.

use heapless::Vec;
use planner_core::Point;
use planner_core::detour::{KeepOff, Nature};

use crate::swarm::view::View;
use crate::time::{Duration, Instant};

/// What is further ahead along the path than this does not block it yet, metres: from 8 m/s a vehicle stops in less than half of
/// it.
pub(super) const FIELD_M: f32 = 60.0;
/// Beyond the safety distance, so that what strays a little does not block the way again, metres.
pub(super) const MARGIN_M: f32 = 0.5;
/// After no way was found the next is sought so much later.
const AGAIN: Duration = Duration::from_secs(30);
/// So often it flies around things in one plan.
const TURNS: u8 = 16;
/// Things that are looked at.
const THINGS: usize = 8;
/// Looks along the path, at most.
const LOOKS: usize = 100;
/// They are so far apart at least, metres.
const LOOK_M: f32 = 0.5;
/// What is to be kept off begins a little before what blocks the path, metres.
const FREE_M: f32 = 1.0;
/// It comes back so much further, metres: from the very edge the same thing would block it again.
const BEYOND_M: f32 = 0.5;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    /// It is on its path.
    #[default]
    Off,
    /// It seeks the way to this place of its path, metres.
    Seeks(f32),
    /// It flies it, and waits there for its plan.
    Flies(f32),
    /// It was stopped on the way there, and seeks another one.
    SeeksAgain(f32),
    /// Its plan has come.
    Back,
    /// There is none.
    Lost,
}

/// Where a vehicle is on its way around.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beside {
    phase: Phase,
    missed_at: Option<Instant>,
    turns: u8,
}

impl Beside {
    /// Starts to seek a path back to the plan: to the place that the vehicle was flying to if it was stopped on such a path, else to
    /// `back_m`, metres along the plan. False where there is no such place.
    pub(crate) fn seek(&mut self, back_m: Option<f32>) -> bool {
        self.phase = match self.phase {
            Phase::Flies(back_m) | Phase::SeeksAgain(back_m) => Phase::SeeksAgain(back_m),
            _ => back_m.map_or(Phase::Off, Phase::Seeks),
        };
        self.is_on()
    }

    /// The way there was not found. Whether one was sought.
    pub(crate) fn miss(&mut self, now: Instant) -> bool {
        let before = self.phase;
        self.phase = match before {
            Phase::SeeksAgain(back_m) => Phase::Flies(back_m),
            Phase::Seeks(_) => Phase::Off,
            other => other,
        };
        self.missed_at = Some(now);
        matches!(before, Phase::Seeks(_) | Phase::SeeksAgain(_))
    }

    /// It has come, or another one.
    pub(super) fn taken(self) -> Self {
        let phase = match self.phase {
            Phase::Seeks(back_m) | Phase::SeeksAgain(back_m) => Phase::Flies(back_m),
            _ => Phase::Off,
        };
        Self { phase, turns: self.turns.saturating_add(1), ..self }
    }

    /// What remains of it where the vehicle turns to something else.
    pub(crate) fn end(&mut self) {
        self.phase = Phase::Off;
    }

    /// Its own plan has come, or there is none.
    pub(super) fn answered(&mut self, came: bool) {
        self.phase = if came { Phase::Back } else { Phase::Lost };
    }

    /// Where it is to come back to its path, metres, while it seeks the way there or flies it.
    pub(crate) fn back_m(&self) -> Option<f32> {
        match self.phase {
            Phase::Seeks(back_m) | Phase::Flies(back_m) | Phase::SeeksAgain(back_m) => Some(back_m),
            _ => None,
        }
    }

    /// Whether it is beside its path, to come back to it.
    pub(crate) fn flies(&self) -> bool {
        matches!(self.phase, Phase::Flies(_) | Phase::SeeksAgain(_))
    }

    /// Whether its path is not that of its plan yet, or has not been taken up.
    pub(crate) fn is_on(&self) -> bool {
        self.phase != Phase::Off
    }

    /// Whether its plan has come.
    pub(crate) fn is_back(&self) -> bool {
        self.phase == Phase::Back
    }

    /// Whether there is none.
    pub(crate) fn is_lost(&self) -> bool {
        self.phase == Phase::Lost
    }

    /// Whether it may seek a way now.
    pub(super) fn may_seek(&self, now: Instant) -> bool {
        (!self.is_on() || self.flies())
            && self.turns < TURNS
            && self.missed_at.is_none_or(|at| now - at >= AGAIN)
    }
}

/// What other vehicles leave no room for over a field: where they are, and where those in the air off the plan may come down.
pub(super) fn others<const V: usize, const W: usize, const G: usize>(
    view: &View<'_, V, W, G>,
    tell: &mut dyn FnMut(KeepOff),
) {
    let apart_m = view.config.safety_distance_m + MARGIN_M;
    view.neighbours.places(view.now, [apart_m; 2], &mut *tell);
    let beside_m = apart_m + view.neighbours.stray_m();
    view.neighbours
        .landing_columns(view.now, beside_m, |column| tell(KeepOff { nature: Nature::Solid, ..column }));
}

/// The first free place of its path behind what blocks that, metres; none before its last descent, or before the gate that is
/// closed.
pub(super) fn returns_m<const V: usize, const W: usize, const G: usize>(
    view: &View<'_, V, W, G>,
    known: &[KeepOff],
) -> Option<f32> {
    let plan = view.mission.plan()?;
    let (from_m, here) = (view.guidance.along_m(), view.telemetry.position);
    let waypoints = plan.path.waypoints();
    let home_m = waypoints.iter().nth_back(1)?.along_m;
    let most_m = view.guidance.clear_m(&view.scene).min(home_m);
    let far_m = |thing: &KeepOff, place: &Point| {
        let (axis, away) = (thing.to - thing.from, place - thing.from);
        let share = (away.dot(&axis) / axis.norm_squared().max(1e-6)).clamp(0.0, 1.0);
        (away - axis * share).norm() - thing.radius_m
    };
    let mut things = Vec::<KeepOff, THINGS>::new();
    // Full beyond what may be near at once: the search for the way knows them all.
    let mut add = |thing: KeepOff| _ = (far_m(&thing, &here) < FIELD_M).then(|| things.push(thing));
    known.iter().for_each(|thing| add(*thing));
    others(view, &mut add);
    let (mut at_m, mut met) = (from_m, false);
    for _ in 0..LOOKS {
        let far = !met && at_m > from_m + FIELD_M + FREE_M;
        if far || at_m + BEYOND_M > most_m {
            return None;
        }
        let place = plan.path.point_at(at_m)?;
        // Nothing is nearer than that.
        let free_m = things.iter().map(|thing| far_m(thing, &place)).fold(FIELD_M, f32::min);
        if met && free_m > 0.0 {
            return Some(at_m + BEYOND_M);
        }
        met |= free_m <= 0.0;
        at_m += free_m.max(LOOK_M);
    }
    None
}
