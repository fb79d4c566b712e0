//! Random flights at the limits of the mission and of the autopilot's parameters: a vehicle holds
//! for a division where it promised, stops at closed gates, and keeps to its path. Vehicle 78
//! leaves the mission, 77 is far away unless a test says otherwise.

use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_VALUE_DATA};
use planner_core::Length as _;
use planner_core::flight::{Gate, Path};
use proptest::prelude::ProptestConfig;

use super::State::*;
use super::divisions::{bytes, own_roster};
use super::*;
use crate::link::intent::{FLYING, GROUNDED, ON_PLAN, OUT_OF_PLAN};
use crate::link::roster::{RosterReportEntry, ShareStatus};
use crate::planner::coverage::OPEN_FIELD_CLEARANCE_M;
use crate::swarm::fleet::Fleet;
use crate::{Link, RosterEntry};

/// Vehicle 77, far away from every path.
const FAR: Option<(Point, u8, f32, u32)> = Some((Point::new(8.0, 1200.0, 1.5), ON_PLAN, 0.0, 5));

/// `count` lanes, `long_m` metres long and `apart_m` apart, with pictures, and the way home.
fn lanes(long_m: f32, apart_m: f32, count: usize) -> Plan {
    let mut path = Path::new();
    let mut push = |x: f32, y: f32, z: f32| {
        path.push(Point::new(START.x + x, START.y + y, START.z + z), OPEN_FIELD_CLEARANCE_M)
            .unwrap();
    };
    push(0.0, 0.0, 0.0);
    for lane in 0..count {
        let y = apart_m * lane as f32;
        let xs = if lane.is_multiple_of(2) { [10.0, long_m] } else { [long_m, 10.0] };
        xs.into_iter().for_each(|x| push(x, y, 0.0));
    }
    let (x, y) =
        (if count.is_multiple_of(2) { 10.0 } else { long_m }, apart_m * (count - 1) as f32);
    push(x, y, 2.0);
    push(0.0, 0.0, 2.0);
    push(0.0, 0.0, 0.0);
    let mut photographs = PicturePlan::new(2.0, HeadingMode::Ahead, Trigger::Distance);
    photographs.add_stretch(1, 1, WaypointRange { first: 0, end: 1 }).unwrap();
    VehiclePlan { task: Task::Photograph(photographs), path, descent_m: 1.5, ..plan() }
}

/// A vehicle that follows this path of a coverage mission, at this speed and acceleration, with an
/// autopilot that has these values of `MPC_JERK_AUTO`, `MPC_ACC_HOR` and `MPC_ACC_DOWN_MAX`.
fn following(
    plan: Plan,
    [cruise_mps, accel_mps2]: [f32; 2],
    limits: Option<(f32, f32, f32)>,
) -> Bench {
    let mut config = two_vehicles();
    let roster = &mut config.roster;
    roster.push(RosterEntry { system_id: 78, path_start: Point::new(8.0, 28.0, 1.5) }).unwrap();
    config.lost_vehicle_down_after_s = Some(60.0);
    (config.cruise_mps, config.accel_mps2) = (cruise_mps, accel_mps2);
    (config.fastest_vehicle_mps, config.slowest_vehicle_mps) = (cruise_mps, cruise_mps);
    let mut bench = Bench::new(config);
    bench.step_m = cruise_mps.max(1.7) * 0.06;
    bench.answer_plan = Some(Ok(plan));
    bench.neighbour = FAR;
    bench.run_until(Ready, 6.0);
    if let Some((jerk, across, down)) = limits {
        let names = ["MPC_JERK_AUTO", "MPC_ACC_HOR", "MPC_ACC_DOWN_MAX"];
        for (name, param_value) in names.into_iter().zip([jerk, across, down]) {
            let mut id = [0u8; 16];
            id[..name.len()].copy_from_slice(name.as_bytes());
            bench.send(&PARAM_VALUE_DATA {
                param_id: id.into(),
                param_value,
                param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
                param_count: 1,
                param_index: 0,
            });
        }
        bench.run(1.0);
    }
    bench.start();
    bench.run_until(Follow, 60.0);
    bench
}

/// The path that the vehicle flies.
fn path_of(bench: &Bench) -> Path<WAYPOINTS> {
    bench.companion.mission.plan().map(|plan| plan.path.clone()).expect("a plan")
}

/// Lets vehicle 77 report that 78 has left and that it agrees, calls `each` before each of `ticks`
/// ticks, and returns the distance of the setpoint from the promised place once this vehicle holds
/// for the division; `None` if it does not come to that.
fn hold_error_m(
    bench: &mut Bench,
    ticks: u32,
    mut each: impl FnMut(&mut Bench, u32),
) -> Option<f32> {
    let path = path_of(bench);
    let (mut promise_m, mut sequence, mut held) = (None, 0u8, 0);
    for tick in 0..ticks {
        each(bench, tick);
        bench.tick();
        sequence = sequence.wrapping_add(1);
        if sequence.is_multiple_of(4) {
            let mut known = own_roster(bench);
            known.entries[1] = RosterReportEntry {
                commitment_dm: Some(50),
                holds: true,
                agrees: true,
                ..known.entries[1]
            };
            known.entries[2].status = ShareStatus::Left;
            bench.companion.handle_bytes(Link::Swarm, bench.now, &bytes(&known, sequence));
            bench.drain();
        }
        let fleet = bench.companion.neighbours.fleet().expect("an area");
        promise_m = promise_m.or(fleet.commitment_dm().map(|dm| f32::from(dm) / 10.0));
        held += u32::from(bench.state() == Dividing);
        // After 3 s in `Dividing` the setpoint has come to rest.
        if let (60.., Some(promise_m)) = (held, promise_m) {
            let place = path.point_at(promise_m).expect("on the path");
            return Some((bench.companion.guidance.setpoint_position() - place).length());
        }
        if bench.companion.mission.division_count() > 0 {
            let place = path.point_at(promise_m?).expect("on the path");
            return Some((bench.companion.guidance.setpoint_position() - place).length());
        }
    }
    None
}

const CASES: u32 = if cfg!(debug_assertions) { 40 } else { 400 };

proptest::proptest! {
    #![proptest_config(ProptestConfig::with_cases(CASES))]
    /// What makes the others divide, a vehicle that has come down, may block the path too.
    #[test]
    fn a_vehicle_that_is_being_blocked_holds_where_it_promised(
        cruise_mps in 1f32..12.0, beyond_m in 0f32..8.0, ticks in 0u32..80,
    ) {
        let mut b = following(lanes(300.0, 20.0, 4), [cruise_mps, 1.5], None);
        b.run(12.0);
        let path = path_of(&b);
        let stops_m = b.companion.guidance.stopping_point_m(&path);
        let lies = path.point_at(stops_m + beyond_m).unwrap();
        b.neighbour = Some((Point::new(lies.x, lies.y, 0.6), GROUNDED | OUT_OF_PLAN, 0.0, 5));
        b.run_until(Blocked, 10.0);
        (0..ticks).for_each(|_| b.tick());
        let off_m = hold_error_m(&mut b, 2000, |_, _| {});
        proptest::prop_assert!(off_m.is_some_and(|m| m < 0.35), "{off_m:?} m at {cruise_mps} m/s");
    }

    #[test]
    fn a_vehicle_before_which_another_appears_holds_where_it_promised(
        cruise_mps in 1f32..12.0, near_m in 3f32..40.0,
    ) {
        let mut b = following(lanes(300.0, 20.0, 4), [cruise_mps, 1.5], None);
        b.run(12.0);
        let at_m = b.companion.guidance.reference_along_m() + near_m;
        b.neighbour = Some((path_of(&b).point_at(at_m).unwrap(), FLYING | OUT_OF_PLAN, 0.0, 5));
        b.run(0.2);
        let off_m = hold_error_m(&mut b, 2000, |b, tick| {
            if tick == 5 {
                b.neighbour = FAR;
            }
        });
        proptest::prop_assert!(off_m.is_some_and(|m| m < 0.35), "{off_m:?} m at {cruise_mps} m/s");
    }

    #[test]
    fn what_lies_beyond_the_promised_place_keeps_no_vehicle_from_it(
        cruise_mps in 1f32..12.0, beyond_m in 2.5f32..12.0,
    ) {
        let mut b = following(lanes(500.0, 20.0, 2), [cruise_mps, 1.5], None);
        b.run(12.0);
        let off_m = hold_error_m(&mut b, 1200, |b, _| {
            let fleet = b.companion.neighbours.fleet();
            let promise = fleet.and_then(Fleet::commitment_dm);
            if let (Some(dm), true) = (promise, b.neighbour == FAR) {
                let lies = path_of(b).point_at(f32::from(dm) / 10.0 + beyond_m).unwrap();
                let lies = Point::new(lies.x, lies.y, 0.6);
                b.neighbour = Some((lies, GROUNDED | OUT_OF_PLAN, 0.0, 5));
            }
        });
        proptest::prop_assert!(off_m.is_some_and(|m| m < 0.35), "{off_m:?} m at {cruise_mps} m/s");
    }

    /// A vehicle that lags, or does not know its position well, stops before it is at the promised
    /// place.
    #[test]
    fn a_vehicle_holds_only_where_its_setpoint_is_at_the_promised_place(
        cruise_mps in 1f32..12.0, accel_mps2 in 0.7f32..2.4, ticks in 0u32..240,
        lags in proptest::prelude::any::<bool>(),
    ) {
        let mut b = following(lanes(500.0, 20.0, 2), [cruise_mps, accel_mps2], None);
        b.run(12.0);
        let step_m = b.step_m;
        let off_m = hold_error_m(&mut b, 4000, |b, tick| {
            if tick == ticks {
                if lags { b.step_m = 0.001 } else { b.accuracy_m = Some(0.6) }
            } else if tick == ticks + 300 {
                (b.step_m, b.accuracy_m) = (step_m, Some(0.02));
            }
        });
        proptest::prop_assert!(off_m.is_none_or(|m| m < 0.35), "{off_m:?} m at {cruise_mps} m/s");
    }

    /// A vehicle that takes more than the 10 s of a commitment to stop promises the place at which
    /// it can stop.
    #[test]
    fn a_vehicle_that_brakes_slowly_promises_to_hold_at_cruise_too(
        cruise_mps in 2f32..12.0, accel_mps2 in 0.2f32..0.8,
    ) {
        let mut b = following(lanes(2000.0, 20.0, 2), [cruise_mps, accel_mps2], None);
        b.run(2.0 * cruise_mps / accel_mps2);
        let end_m = path_of(&b).waypoints()[2].along_m;
        let braking_m = cruise_mps * cruise_mps / (2.0 * accel_mps2);
        proptest::prop_assume!(
            b.companion.guidance.reference_along_m() + 2.0 * braking_m + 100.0 < end_m
        );
        hold_error_m(&mut b, 20, |_, _| {});
        let fleet = b.companion.neighbours.fleet().expect("an area");
        proptest::prop_assert!(fleet.commitment_dm().is_some(), "{cruise_mps} {accel_mps2}");
    }

    /// Where lanes turn back on themselves, the setpoint cuts the corner.
    #[test]
    fn a_vehicle_holds_beyond_a_sharp_turn(
        cruise_mps in 1f32..4.0, accel_mps2 in 1.5f32..5.0, apart_m in 0.05f32..1.0,
        ticks in 0u32..400,
    ) {
        let mut b = following(lanes(22.0, apart_m, 4), [cruise_mps, accel_mps2], None);
        (0..ticks).for_each(|_| b.tick());
        proptest::prop_assume!(b.state() == Follow);
        let off_m = hold_error_m(&mut b, 2000, |_, _| {});
        let fleet = b.companion.neighbours.fleet().expect("an area");
        let promised = fleet.commitment_dm().is_some() || off_m.is_some();
        proptest::prop_assert!(
            !promised || off_m.is_some_and(|m| m < 0.5), "{off_m:?} m at {cruise_mps} m/s"
        );
    }

    #[test]
    fn a_closed_gate_is_not_passed_whatever_the_limits(
        cruise_mps in 1f32..12.0, accel_mps2 in 0.5f32..5.0,
        limits in (1.0f32..4.0, 0.5f32..3.0, 0.5f32..3.0),
    ) {
        let mut plan = lanes(400.0, 20.0, 2);
        let gate = Gate { at_m: 200.0, wait_for_id: 77, open_from_progress_m: 6.0 };
        plan.gates.push(gate).unwrap();
        let mut b = following(plan, [cruise_mps, accel_mps2], Some(limits));
        b.run(200.0 / cruise_mps + 40.0);
        let over_m = b.companion.guidance.reference_along_m() - gate.at_m;
        proptest::prop_assert!(over_m < 0.1, "{over_m} m beyond its closed gate");
    }

    #[test]
    fn the_setpoint_stays_near_its_path_whatever_the_limits(
        cruise_mps in 1f32..12.0, accel_mps2 in 0.2f32..5.0, across_mps2 in 0.2f32..3.0,
    ) {
        let limits = Some((4.0, across_mps2, 3.0));
        let mut b = following(lanes(60.0, 20.0, 4), [cruise_mps, accel_mps2], limits);
        let path = path_of(&b);
        for _ in 0..(300.0 / cruise_mps * 20.0) as u32 {
            b.tick();
            let place = b.companion.guidance.setpoint_position();
            let off_m = paces::beside_m(&path, &place);
            proptest::prop_assert!(b.state() != Follow || off_m < 0.8, "{off_m} m beside");
        }
    }
}
