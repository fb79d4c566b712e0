//! Place of the setpoint along its path, at any speed and on lanes near each other: the points of
//! the intent and those of the safety filter begin there.

use planner_core::flight::Path;
use proptest::prelude::*;

use super::*;

/// Raw steps that one setpoint may depend on: both windows of the smoother's averages at their
/// longest, and the spline.
const RAW_STEPS: usize = 52;
/// Greatest error of the place along the path in a corner that the setpoint rounds, metres. Where
/// the path turns straight back, the setpoint passes the same points twice.
const CORNER_M: f32 = 0.8;
/// Setpoints further from the path than this are not checked: they are on their way to it, metres.
const BESIDE_M: f32 = 0.4;

/// What interrupts the flight.
#[derive(Clone, Copy, Debug)]
enum Interruption {
    /// A pause by the operator.
    Pause,
    /// The vehicle stops this far ahead, metres.
    Halt(f32),
    /// The pilot takes over, moves the vehicle along its path by this many seconds of cruise
    /// flight, and gives it back.
    Pilot(f32),
    /// The position is lost for this many ticks; the vehicle flies on meanwhile, braking.
    Lost(u32),
}

fn interruption() -> impl Strategy<Value = Interruption> {
    prop_oneof![
        3 => Just(Interruption::Pause),
        3 => (0f32..60.0).prop_map(Interruption::Halt),
        1 => (-0.3f32..1.0).prop_map(Interruption::Pilot),
        1 => (10u32..50).prop_map(Interruption::Lost),
    ]
}

/// How the last leg of a transit is flown.
#[derive(Clone, Copy, PartialEq)]
enum LastLeg {
    Once,
    BackAndForth,
}

/// A path of straight legs: a transit with corners of any angle, then lanes back and forth.
fn random_path(
    turns: &[(f32, f32)],
    last_leg: LastLeg,
    (lanes, long_m, apart_m): (usize, f32, f32),
) -> Path<WAYPOINTS> {
    let mut path = Path::new();
    let (mut at, mut heading) = (START, 0f32);
    path.push(at, 10.0).unwrap();
    for (turn, leg_m) in turns {
        heading += turn;
        at += Point::new(heading.cos(), heading.sin(), 0.0) * *leg_m;
        path.push(at, 10.0).unwrap();
    }
    if let ([.., before, _], LastLeg::BackAndForth) = (path.waypoints(), last_leg) {
        let back = before.position + (at - before.position) * 0.3;
        path.push(back, 10.0).unwrap();
        path.push(at, 10.0).unwrap();
    }
    for lane in 0..lanes {
        let (from, to) = if lane % 2 == 0 { (0.0, long_m) } else { (long_m, 0.0) };
        for along_m in [from, to] {
            let place = at + Point::new(5.0 + along_m, apart_m * lane as f32, 0.0);
            path.push(place, 10.0).unwrap();
        }
    }
    path
}

/// Places along the path that the reference has passed, metres. The setpoint's place must be the
/// nearest of those that the raw steps on which it depends have passed.
struct Reference {
    places: Vec<f32>,
}

impl Reference {
    fn note(&mut self, along_m: f32) {
        // Without progress of the reference no raw step is noted.
        if self.places.last() != Some(&along_m) {
            self.places.push(along_m);
        }
    }

    /// First and last of the places nearest to the point `place`, metres along the path, and the
    /// distance to them.
    fn nearest(&self, path: &Path<WAYPOINTS>, place: &Point) -> Option<(f32, f32, f32)> {
        let last = *self.places.last()?;
        // The reference may go back: when it stops it is set back to the setpoint.
        let lately = &self.places[self.places.len().saturating_sub(RAW_STEPS)..];
        let first = lately.iter().fold(last, |least, along_m| least.min(*along_m));
        let steps = ((last - first) / 0.05) as usize + 1;
        let apart = |i: usize| {
            let along_m = first + (last - first) * i as f32 / steps as f32;
            (along_m, (path.point_at(along_m).unwrap() - place).norm())
        };
        let least_m = (0..=steps).map(|i| apart(i).1).fold(f32::INFINITY, f32::min);
        let mut near = (0..=steps).map(apart).filter(|at| at.1 < least_m + 0.06).map(|at| at.0);
        let first_m = near.next()?;
        Some((first_m, near.next_back().unwrap_or(first_m), least_m))
    }
}

/// A flight, and the greatest errors of the place of its setpoint, metres.
struct Flight {
    bench: Bench,
    path: Path<WAYPOINTS>,
    reference: Reference,
    /// Greatest error ahead.
    early_m: f32,
    /// Greatest error behind.
    late_m: f32,
    /// Greatest change of the place in a step beyond the distance flown at cruise speed, metres.
    jump_m: f32,
    /// Number of steps checked.
    checked: u32,
}

impl Flight {
    fn new(cruise_mps: f32, path: Path<WAYPOINTS>) -> Self {
        let mut config = config();
        config.cruise_mps = cruise_mps;
        let mut bench = Bench::new(config);
        bench.answer_plan =
            Some(Ok(VehiclePlan { path: path.clone(), descent_m: START.z, ..plan() }));
        bench.step_m = cruise_mps * 0.06;
        bench.run_until(State::Ready, 6.0);
        bench.start();
        bench.run_until(State::Follow, 20.0);
        let reference = Reference { places: Vec::new() };
        Self { bench, path, reference, early_m: 0.0, late_m: 0.0, jump_m: 0.0, checked: 0 }
    }

    fn tick(&mut self) {
        // The place of a step is that of the setpoint before it.
        let guidance = &self.bench.companion.guidance;
        let (place, before_m) = (guidance.smoother.position(), guidance.setpoint_along_m);
        self.bench.tick();
        let guidance = &self.bench.companion.guidance;
        if !self.bench.state().is_on_path() || guidance.is_in_descent() {
            self.reference.places.clear();
            return;
        }
        let found = self.reference.nearest(&self.path, &place);
        self.reference.note(guidance.reference_along_m());
        // The first step after an interruption seeks the place again.
        let Some((first_m, last_m, _)) = found.filter(|found| found.2 < BESIDE_M) else { return };
        let at_m = guidance.setpoint_along_m;
        (self.early_m, self.late_m) =
            (self.early_m.max(at_m - last_m), self.late_m.max(first_m - at_m));
        let step_m = guidance.cruise_mps() * 0.05;
        self.jump_m = self.jump_m.max((at_m - before_m).abs() - step_m);
        self.checked += 1;
    }

    fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    fn order(&mut self, go: f32) {
        let id = crate::COMPANION_COMPONENT;
        self.bench.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, go, SYSTEM, id);
    }

    /// Moves the vehicle along its path within two seconds, by `by_s` seconds of cruise flight.
    fn drift(&mut self, by_s: f32) {
        let guidance = &self.bench.companion.guidance;
        let by_m = by_s * guidance.cruise_mps();
        let from_m = self.path.project(&self.bench.enu, guidance.setpoint_along_m, 3.0);
        for tick in 0..40 {
            let left = 1.0 - (tick + 1) as f32 / 40.0;
            self.bench.enu = self.path.point_at(from_m + by_m * (1.0 - left * left)).unwrap();
            self.tick();
        }
    }

    fn interrupt(&mut self, by: Interruption, ticks: u32) {
        match by {
            Interruption::Pause => {
                self.order(0.0);
                self.run(ticks);
                self.order(1.0);
            }
            Interruption::Halt(ahead_m) => {
                let along_m = self.bench.companion.guidance.reference_along_m();
                self.bench.companion.guidance.set_division_hold_m(along_m + ahead_m);
                self.run(ticks);
                self.bench.companion.guidance.set_division_hold_m(f32::INFINITY);
            }
            Interruption::Pilot(by_s) => {
                self.bench.mode = 0x0003_0000;
                self.drift(by_s);
                self.run(20);
                self.bench.mode = px4::OFFBOARD;
                self.run(30);
                self.order(1.0);
            }
            Interruption::Lost(ticks) => {
                self.bench.no_position = true;
                self.run(ticks);
                self.bench.no_position = false;
                self.run(20);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 30 } else { 300 }))]
    #[test]
    fn the_place_of_the_setpoint_is_where_it_is_at_any_speed(
        cruise_mps in 1f32..15.0,
        turns in proptest::collection::vec((-1f32..1.0, 5f32..60.0), 0..6),
        lanes in (1usize..8, 10f32..120.0, 0.6f32..10.0),
        back in any::<bool>(),
        events in proptest::collection::vec((1u32..160, interruption(), 1u32..160), 1..6),
    ) {
        let last_leg = if back { LastLeg::BackAndForth } else { LastLeg::Once };
        let mut flight = Flight::new(cruise_mps, random_path(&turns, last_leg, lanes));
        for (flown, by, stopped) in events {
            flight.run(flown);
            // On a leg that is flown back and forth a resumed flight may skip the turn.
            let resumes = !matches!(by, Interruption::Halt(_));
            if flight.bench.state() == State::Follow && !(back && resumes) {
                flight.interrupt(by, stopped);
            }
        }
        flight.run(200);
        prop_assert!(flight.early_m < CORNER_M, "{} m early at {cruise_mps} m/s", flight.early_m);
        prop_assert!(flight.late_m < CORNER_M, "{} m late at {cruise_mps} m/s", flight.late_m);
        prop_assert!(flight.jump_m < CORNER_M, "jump of {} m at {cruise_mps} m/s", flight.jump_m);
    }
}
