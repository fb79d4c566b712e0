//! A vehicle that was carried away from its path, by its pilot or while it lands: it must not fly
//! from there to its path, since a wall may stand between.

use rand_core::Rng;
use rand_pcg::Pcg32;

use super::*;
use crate::PlanFailure;
use crate::link::intent::FLYING;

/// Farthest that a setpoint may be from where the vehicle was left, horizontally and upwards,
/// metres.
const MAX_SETPOINT_AWAY_M: f32 = 0.6;
/// Distance from places 0.1 m apart on its path beyond which no way there is known to be free,
/// metres: the clearance of its legs is 1.2 m.
const OFF_PATH_M: f32 = 1.25;
/// Horizontal distance from its start up to which a vehicle may fly there, metres: the default
/// `FLK_START_TOL`, and what counts as arrived.
const NEAR_START_M: f32 = 2.35;
/// Horizontal distance from its path up to which a vehicle that landed is in the column that it
/// came down, metres.
const COLUMN_M: f32 = 0.35;
/// Number of random flights.
const FLIGHTS: u64 = if cfg!(debug_assertions) { 150 } else { 1000 };

struct Draw(Pcg32);

impl Draw {
    fn real(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.0.next_u32() >> 8) as f32 / 16_777_216.0
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.next_u32() as usize % of.len()]
    }
}

/// Moves the vehicle by `by`, slowly enough not to count as a jump.
fn carry(b: &mut Bench, by: Point) {
    for _ in 0..80 {
        b.enu += by / 80.0;
        b.tick();
    }
}

/// A bench before its start, `beside` its pad, with another vehicle on the ground.
fn ready(draw: &mut Draw, beside: Point) -> Bench {
    let kind = draw.one(&[AutopilotKind::Px4, AutopilotKind::ArduPilot]);
    let mut b = match kind {
        AutopilotKind::Px4 => Bench::new(two_vehicles()),
        AutopilotKind::ArduPilot => Bench::ardupilot(two_vehicles()),
    };
    b.enu += beside;
    b.spool = Duration::from_millis(2000);
    b.neighbour = Some((Point::new(8.0, 20.0, 0.0), ON_PLAN | GROUNDED, 0.0, 5));
    b.run_until(State::Ready, 6.0);
    b.start();
    b.run_until(State::Arming, 20.0);
    while b.on_ground() {
        b.tick();
    }
    b
}

/// A bench that is flown until a random time, perhaps on a detour, and commanded to do something
/// or nothing.
fn flown(draw: &mut Draw) -> Bench {
    let mut b = ready(draw, Point::zeros());
    b.run(draw.real(0.0, 10.0));
    if draw.one(&[true, false, false]) {
        // Something lies on its path: it flies a detour from here.
        b.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
        b.run(draw.real(0.0, 12.0));
    }
    b.never_lands = true;
    let back = |b: &mut Bench| order(b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0);
    for order in [None, Some(pause as fn(&mut Bench) -> _), Some(land), Some(back)] {
        if let (Some(order), true) = (order, draw.one(&[true, false, false])) {
            order(&mut b);
            b.run(draw.real(0.0, 5.0));
        }
    }
    b
}

/// Places 0.1 m apart on the path of a plan, and its end.
fn places_on_path(plan: &Plan) -> impl Iterator<Item = Point> {
    let length_m = plan.path.length_m();
    let along = (0..=(length_m * 10.0) as usize).map(|step| step as f32 / 10.0).chain([length_m]);
    along.filter_map(|along_m| plan.path.point_at(along_m))
}

/// Whether a vehicle at `place` may fly to its path.
fn may_join(b: &Bench, place: &Point) -> bool {
    let Some(plan) = b.companion.mission.plan() else { return false };
    let near_start = (place - START).xy().norm() < NEAR_START_M;
    // Below the end of its path it descends in any case.
    let end = plan.path.point_at(plan.path.length_m());
    let in_descent = end.is_some_and(|end| (end - place).xy().norm() < COLUMN_M);
    near_start || in_descent || places_on_path(plan).any(|at| (at - place).norm() < OFF_PATH_M)
}

/// Whether `place` is in a column below or above the vehicle's path: one that lands there unaided
/// may fly back up.
fn is_in_column(b: &Bench, place: &Point) -> bool {
    let beside = |at: Point| (at - place).xy().norm() < COLUMN_M;
    b.companion.mission.plan().is_some_and(|plan| places_on_path(plan).any(beside))
}

#[test]
fn a_carried_vehicle_never_flies_to_its_path() {
    let (mut held, mut off_path) = (0, 0);
    for seed in 0..FLIGHTS {
        let mut draw = Draw(Pcg32::new(seed, 1));
        let mut b = flown(&mut draw);
        let by = Point::new(draw.real(-1.0, 1.0), draw.real(-6.0, 6.0), draw.real(-2.0, 2.0));
        let by = by * draw.one(&[0.2, 0.5, 1.0, 1.0]);
        let by = Point::new(by.x, by.y, by.z.max(0.5 - b.enu.z));
        let sticks =
            b.state() == State::Land && b.mode == b.kind.land_mode() && draw.one(&[true, false]);
        if sticks {
            // The autopilot lets its pilot's sticks move a vehicle that lands.
            carry(&mut b, by);
        } else {
            // A request for the landing mode may cross the pilot's switch once.
            while b.state() != State::PilotControl {
                b.mode = pilot_mode(b.kind);
                b.run(0.2);
            }
            carry(&mut b, by);
            b.mode = b.kind.setpoint_mode();
            b.run_until(State::PilotReturned, 3.0);
        }
        b.neighbour = Some((b.enu - Point::new(0.8, 0.0, 2.2), FLYING | ON_PLAN, 0.0, 5));
        b.answer_detour = draw.one(&[Some(Ok(())), Some(Err(PlanFailure::Unreachable))]);
        b.run(1.0);
        let (left_at, sent) = (b.enu, b.setpoints.len());
        let may_join = may_join(&b, &left_at) || (sticks && is_in_column(&b, &left_at));
        for _ in 0..draw.one(&[1, 2, 5, 9]) {
            match draw.one(&[0, 1, 2, 3, 4, 5]) {
                0 => _ = land(&mut b),
                1 => _ = pause(&mut b),
                2 => _ = order(&mut b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
                3 => b.battery = draw.one(&[80, 10]),
                _ => _ = resume(&mut b),
            }
            b.run(draw.real(0.1, 30.0));
        }
        resume(&mut b);
        b.run(40.0);
        held += usize::from(b.texts.iter().any(|text| text == "Vehicle below: landing stopped"));
        if may_join {
            continue;
        }
        off_path += 1;
        let away = |at: &Point| (at - left_at).xy().norm().max(at.z - left_at.z);
        let most_m = b.setpoints[sent..].iter().map(|s| away(&s.1)).fold(0.0, f32::max);
        assert!(most_m < MAX_SETPOINT_AWAY_M, "flight {seed}: {most_m} m: {:?}", b.texts);
        assert_ne!(b.state(), State::Follow, "flight {seed} waits for nothing: {:?}", b.texts);
    }
    assert!(held > FLIGHTS as usize / 4 && off_path > FLIGHTS as usize / 4, "{held}, {off_path}");
}

/// One that took off beside its start joins its path, the way back or a detour from there, whatever
/// interrupts it first.
#[test]
fn a_vehicle_that_took_off_beside_its_start_joins_its_path() {
    for seed in 0..FLIGHTS / 2 {
        let mut draw = Draw(Pcg32::new(seed, 2));
        let (angle, away_m) = (draw.real(-3.1, 3.1), draw.real(0.0, 1.9));
        let beside = Point::new(libm::cosf(angle), libm::sinf(angle), 0.0) * away_m;
        let mut b = ready(&mut draw, beside);
        b.run(draw.real(0.0, 4.0));
        for _ in 0..draw.one(&[1, 2, 4]) {
            let over = b.enu - Point::new(0.8, 0.0, b.enu.z.min(2.2));
            b.neighbour = draw.one(&[
                b.neighbour,
                Some((over, FLYING | ON_PLAN, 0.0, 5)),
                Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5)),
            ]);
            match draw.one(&[0, 1, 2, 3, 4]) {
                0 => _ = land(&mut b),
                1 => _ = pause(&mut b),
                2 => _ = order(&mut b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
                _ => _ = resume(&mut b),
            }
            b.run(draw.real(0.1, 25.0));
        }
        resume(&mut b);
        b.neighbour = Some((Point::new(8.0, 20.0, 0.0), ON_PLAN | GROUNDED, 0.0, 5));
        b.run(200.0);
        let barred = b.texts.iter().any(|text| text == "No free way to the path: landing");
        assert!(!barred, "flight {seed}: {:?}", b.texts);
        assert_ne!(b.state(), State::Follow, "flight {seed} waits for nothing: {:?}", b.texts);
    }
}
