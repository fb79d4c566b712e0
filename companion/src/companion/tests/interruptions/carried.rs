//! A vehicle that was carried away from its path, by its pilot or while it lands: it must not fly
//! from there to its path, since a wall may stand between.

use rand_core::Rng;
use rand_pcg::Pcg32;

use super::*;
use crate::link::intent::FLYING;

/// Farthest that a setpoint may be from where the vehicle was left, metres.
const MAX_SETPOINT_AWAY_M: f32 = 1.0;
/// Number of random flights.
const FLIGHTS: u64 = if cfg!(debug_assertions) { 100 } else { 1000 };

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

/// A bench that is flown until a random time, and commanded to do something or nothing.
fn flown(draw: &mut Draw) -> Bench {
    let kind = draw.one(&[AutopilotKind::Px4, AutopilotKind::ArduPilot]);
    let mut b = match kind {
        AutopilotKind::Px4 => Bench::new(two_vehicles()),
        AutopilotKind::ArduPilot => Bench::ardupilot(two_vehicles()),
    };
    b.spool = Duration::from_millis(2000);
    b.neighbour = Some((Point::new(8.0, 20.0, 0.0), ON_PLAN | GROUNDED, 0.0, 5));
    b.run_until(State::Ready, 6.0);
    b.start();
    b.run_until(State::Arming, 20.0);
    while b.on_ground() {
        b.tick();
    }
    b.run(draw.real(0.0, 10.0));
    b.never_lands = true;
    if let Some(order) = draw.one(&[None, Some(pause as fn(&mut Bench) -> _), Some(land)]) {
        order(&mut b);
        b.run(draw.real(0.0, 5.0));
    }
    b
}

#[test]
fn a_carried_vehicle_never_flies_to_its_path() {
    let mut held = 0;
    for seed in 0..FLIGHTS {
        let mut draw = Draw(Pcg32::new(seed, 1));
        let mut b = flown(&mut draw);
        let by = Point::new(draw.real(-1.0, 1.0), draw.real(3.0, 6.0), draw.real(0.2, 2.0));
        let sticks = b.state() == State::Land && b.mode == b.kind.land_mode();
        if sticks && draw.one(&[true, false]) {
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
        b.run(1.0);
        let (left_at, sent) = (b.enu, b.setpoints.len());
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
        let away = |at: &Point| (at - left_at).xy().norm();
        let most_m = b.setpoints[sent..].iter().map(|s| away(&s.1)).fold(0.0, f32::max);
        assert!(most_m < MAX_SETPOINT_AWAY_M, "flight {seed}: {most_m} m: {:?}", b.texts);
    }
    assert!(held > FLIGHTS as usize / 2, "held {held}");
}
