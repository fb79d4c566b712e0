//! An autopilot that believes its own false report of the ground accepts disarming, and the vehicle
//! falls: disarming is requested of a vehicle on the ground only.

use std::string::String;

use super::*;
use crate::link::intent::{FLYING, Intent};

/// A name, and what makes the vehicle fall or come down.
type Cause = (&'static str, fn(&mut Fall));

/// Causes of a landing or of an aborted mission.
const CAUSES: &[Cause] = &[
    ("nothing: it lands at its goal", |_| {}),
    ("NAV_LAND", |f| _ = land(&mut f.b)),
    ("return", |f| _ = order(&mut f.b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0)),
    ("battery low", |f| f.b.battery = 10),
    ("battery critical", |f| f.b.battery = 4),
    ("paused", |f| {
        pause(&mut f.b);
        f.run(30.0);
        resume(&mut f.b);
    }),
    ("paused, then NAV_LAND", |f| {
        pause(&mut f.b);
        f.run(5.0);
        land(&mut f.b);
    }),
    ("no position", |f| f.b.no_position = true),
    ("no position for a while", |f| {
        f.b.no_position = true;
        f.run(3.0);
        f.b.no_position = false;
    }),
    ("a jump", |f| f.b.enu.y += 4.0),
    ("autopilot lost while it lands", |f| {
        land(&mut f.b);
        f.run(2.0);
        f.b.silent = true;
        f.b.never_lands = true;
        f.run(125.0);
        (f.b.silent, f.b.never_lands) = (false, false);
        f.b.mode = f.b.kind.setpoint_mode();
    }),
    ("autopilot lost", |f| {
        f.b.silent = true;
        f.run(64.0);
        f.b.silent = false;
    }),
    ("the pilot", |f| {
        f.b.mode = pilot_mode(f.b.kind);
        f.run(3.0);
        f.b.enu.y += 4.0;
        f.b.mode = f.b.kind.setpoint_mode();
        f.run(3.0);
        resume(&mut f.b);
    }),
    ("the landing mode is refused", |f| {
        land(&mut f.b);
        f.b.refused = std::vec![SET_MODE];
        f.run(30.0);
        f.b.refused.clear();
    }),
    ("no way around", |f| {
        f.b.answer_detour = Some(Err(crate::PlanFailure::Unreachable));
        let ahead = f.b.enu + Point::new(3.0, 0.0, 0.0);
        obstacle(&mut f.b, ahead);
    }),
    ("not followed", |f| {
        f.b.stuck = true;
        f.run(25.0);
        f.b.stuck = false;
    }),
];

/// A bench whose path lies `up_m` higher than usual, and whose estimated height is wrong.
fn high_bench(kind: AutopilotKind, up_m: f32, error_m: f32) -> Bench {
    let usual = config();
    let start = START + Point::new(0.0, 0.0, up_m);
    let config = Config {
        method: usual.method,
        mission_crc: usual.mission_crc,
        ..Config::new(SYSTEM, start, ORIGIN)
    };
    let mut b = match kind {
        AutopilotKind::Px4 => Bench::new(config),
        AutopilotKind::ArduPilot => Bench::ardupilot(config),
    };
    b.spool = Duration::from_millis(2000);
    (b.height_error_m, b.answer_plan) = (error_m, Some(Ok(raised(plan(), up_m))));
    b.run_until(State::Ready, 6.0);
    b
}

/// A flight whose landing detector reports ground, at any height, from `ground_from` on.
struct Fall {
    /// The companion and its autopilot.
    b: Bench,
    /// From when on ground is reported.
    ground_from: Instant,
    /// Distance that the vehicle sinks in one tick of the landing mode, metres.
    sinks_m: f32,
    /// Number of the companion's commands seen so far.
    seen: usize,
    /// What happened so far, for the message of a failure.
    log: Vec<String>,
}

impl Fall {
    fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds * 20.0) as u32 {
            self.tick();
        }
    }

    fn tick(&mut self) {
        let b = &mut self.b;
        b.false_ground = b.now >= self.ground_from;
        let lands = b.mode == b.kind.land_mode();
        b.step_m = if lands { self.sinks_m } else { 0.1 };
        // A landing vehicle is not held in the air.
        b.stuck &= !lands;
        let (before, armed) = (b.state(), b.armed);
        b.tick();
        if b.state() != before {
            let t = b.now.as_micros() as f32 * 1e-6;
            self.log.push(format!("{t:.2} s {before:?} → {:?} at {:.2} m", b.state(), b.enu.z));
        }
        let disarms = b.commands[self.seen..].iter().any(|c| (c.0, c.1) == (ARM, 0.0));
        self.seen = b.commands.len();
        assert!(
            !(disarms && armed && b.enu.z > HARMLESS_M),
            "falls from {} m in {:?}: {:#?} {:?}",
            b.enu.z,
            b.state(),
            self.log,
            b.texts
        );
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(
        if cfg!(debug_assertions) { 60 } else { 600 }
    ))]
    #[test]
    fn disarming_is_requested_on_the_ground_only(
        px4 in proptest::prelude::any::<bool>(),
        up_m in 0.0f32..28.0,
        error_m in -1.1f32..1.1,
        sinks_mps in 0.3f32..2.0,
        cause in 0..CAUSES.len(),
        at_s in 0.0f32..50.0,
        ground_from_s in 0.0f32..60.0,
    ) {
        let kind = if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let mut b = high_bench(kind, up_m, error_m);
        b.start();
        let ground_from = b.now + Duration::from_millis((ground_from_s * 1e3) as u64);
        let log = std::vec![format!("{}", CAUSES[cause].0)];
        let mut f = Fall { b, ground_from, sinks_m: sinks_mps * 0.05, seen: 0, log };
        f.run(at_s);
        CAUSES[cause].1(&mut f);
        f.run(150.0);
        // A vehicle that still waits in the air is commanded to land.
        for _ in 0..8 {
            f.run(20.0);
            land(&mut f.b);
        }
        let down = f.b.enu.z <= HARMLESS_M && !f.b.armed;
        proptest::prop_assert!(
            down,
            "{:?} {} at {} m: {:#?} {:?}",
            f.b.state(), f.b.mode, f.b.enu.z, f.log, f.b.texts
        );
    }
}

/// A vehicle in `Follow` whose landing detector reports ground from then on.
fn flying(kind: AutopilotKind, up_m: f32) -> Bench {
    let mut b = high_bench(kind, up_m, 0.0);
    b.start();
    b.run_until(State::Follow, 60.0);
    b.run(1.0);
    b.false_ground = true;
    b.run(1.0);
    b
}

/// Flags of the intent that the bench last sent.
fn reported(b: &Bench) -> u8 {
    let intent = b.swarm.iter().rev().find_map(|f| Intent::decode(f.padded_payload(), SYSTEM));
    intent.expect("an intent").flags
}

#[test]
fn a_vehicle_in_the_air_is_not_reported_on_the_ground() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for up_m in [0.0, 10.0] {
            let mut b = flying(kind, up_m);
            let flies = |b: &Bench| reported(b) & (FLYING | GROUNDED | OUT_OF_PLAN) == FLYING;
            assert!(flies(&b), "{kind:?}");
            (b.never_lands, b.step_m) = (up_m > 0.0, 0.02);
            assert_eq!(land(&mut b), Some(ACCEPTED));
            b.run_until(State::Land, 8.0);
            b.run(if up_m > 0.0 { 20.0 } else { 0.0 });
            assert!(up_m == 0.0 || flies(&b), "{kind:?}: {:?}", b.texts);
            (b.never_lands, b.false_ground) = (false, false);
            b.run_until(State::Aborted, 60.0);
            b.run(2.0);
            assert_eq!(reported(&b) & (FLYING | GROUNDED | OUT_OF_PLAN), GROUNDED | OUT_OF_PLAN);
        }
    }
}

#[test]
fn an_aborted_mission_lands_a_vehicle_whose_autopilot_is_heard_again_in_the_air() {
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        let mut b = flying(kind, 10.0);
        b.silent = true;
        b.run_until(State::Land, 70.0);
        b.run_until(State::Aborted, 130.0);
        b.silent = false;
        b.run_until(State::Land, 2.0);
        b.run_until(State::Aborted, 60.0);
        assert!(b.on_ground() && !b.armed);
    }
}

#[test]
fn on_ground_higher_than_planned_the_autopilot_disarms_and_an_estimate_off_by_a_metre_is_on_ground()
{
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for (error_m, disarms) in [(3.0, false), (1.1, true), (-1.1, true)] {
            let mut b = high_bench(kind, 5.0, 0.0);
            b.start();
            b.run_until(State::Follow, 60.0);
            assert_eq!(land(&mut b), Some(ACCEPTED));
            (b.height_error_m, b.stays_armed) = (error_m, true);
            b.run(60.0);
            let asked = b.commands.iter().any(|c| (c.0, c.1) == (ARM, 0.0));
            assert_eq!(asked, disarms, "{kind:?} {error_m}: {:?}", b.texts);
            b.stays_armed = false;
            b.run_until(State::Aborted, 5.0);
            b.run(0.5);
            assert_eq!(reported(&b) & OUT_OF_PLAN, OUT_OF_PLAN);
        }
    }
}
