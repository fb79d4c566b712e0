//! A vehicle that no other vehicle hears any more: in a coverage mission it stays where its last
//! intent says that it may be, in others it comes to rest on the stretch of its path where others
//! expect it.

use super::State::*;
use super::divisions::over_a_field;
use super::*;
use crate::link::frame::Frame;
use crate::link::intent::{GROUNDED, Intent, ON_PLAN};
use crate::margins::{max_unheard_travel_m, unheard_flight_by_delay_s};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use planner_core::flight::{Gate, Path};
use planner_core::geo::frames::{self, Geodetic};
use proptest::prelude::ProptestConfig;

/// Horizontal distance of a place from the path that an intent reports, beginning at `from`,
/// metres.
fn beside_m(intent: &Intent, from: &Point, place: &Point) -> f32 {
    let legs = core::iter::once(from).chain(&intent.points).zip(&intent.points);
    legs.fold((from - place).xy().norm(), |least, (a, b)| {
        let (leg, away) = ((b - a).xy(), (place - a).xy());
        let share = (away.dot(&leg) / leg.norm_squared().max(1e-6)).clamp(0.0, 1.0);
        least.min((away - leg * share).norm())
    })
}

/// Whenever its radio fails, also in the climb, the vehicle stays on the path of its last intent
/// until it stands.
#[test]
fn an_unheard_vehicle_stays_on_the_way_that_it_reported_last() {
    let (mut furthest_m, mut beyond) = (0.0_f32, 0);
    for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
        for tenths in (2..280).step_by(13) {
            let mut bench = over_a_field(kind);
            bench.start();
            while !matches!(bench.state(), TakeOff | Climb | Follow) {
                bench.run(0.1);
            }
            bench.run(tenths as f32 * 0.1);
            let reported =
                bench.swarm.iter().rev().find_map(|f| Intent::decode(f.padded_payload(), SYSTEM));
            let (reported, from) = (reported.expect("five a second"), bench.enu);
            bench.neighbour = None;
            beyond += usize::from(reported.unheard_flight_point_count > 0);
            for _ in 0..500 {
                bench.run(0.1);
                if !matches!(bench.state(), TakeOff | Climb | Follow) {
                    break;
                }
                let off_m = beside_m(&reported, &from, &bench.enu);
                assert!(
                    off_m < 1.0,
                    "{off_m} m off, {tenths}: {reported:?} from {from:?}, {:?}",
                    bench.enu
                );
                furthest_m = furthest_m.max((bench.enu - from).norm());
            }
        }
    }
    assert!(furthest_m > 8.0 && beyond > 4, "{furthest_m} m, {beyond}");
}

/// Where the vehicle was by its last position on the radio, metres beyond its start along x, and
/// its speed by the last two, m/s.
fn last_report(bench: &Bench) -> (f32, f32) {
    let mut sent =
        bench.swarm.iter().rev().filter(|f| f.message_id == GLOBAL_POSITION_INT_DATA::ID);
    let mut next = || {
        let frame = sent.next().expect("five a second");
        let at = frame.decode::<GLOBAL_POSITION_INT_DATA>().expect("its own frame");
        let place = Geodetic {
            lat_deg: f64::from(at.lat) * 1e-7,
            lon_deg: f64::from(at.lon) * 1e-7,
            alt_m: f64::from(at.alt) * 1e-3,
        };
        (frames::geodetic_to_enu(&ORIGIN, &place).x - START.x, at.time_boot_ms)
    };
    let ((x, at_ms), (before, before_ms)) = (next(), next());
    (x, (x - before) / (1e-3 * (at_ms - before_ms) as f32))
}

/// Runs the bench for 4 s in which the neighbour, whose messages take `delay` times 0.1 s, hears
/// the vehicle no more. The neighbour reports for `reports_s` longer that it hears the vehicle, and
/// echoes for 2.5 s the last intent that arrived.
fn hear_no_more(bench: &mut Bench, delay: usize, reports_s: f32) {
    let count = |bench: &Bench| {
        let of_intent = |f: &&Frame| Intent::decode(f.padded_payload(), SYSTEM).is_some();
        bench.swarm.iter().filter(of_intent).count()
    };
    let before = count(bench);
    for step in 0..80 {
        let late_s = 0.05 * step as f32 - 0.2 * delay as f32;
        let missed = count(bench) - before;
        bench.neighbour_echoes = (late_s < 2.5).then_some(delay.max(missed));
        bench.neighbour_held = 20 * missed.saturating_sub(delay).min(12) as u8;
        if late_s >= reports_s {
            bench.neighbour_hears = 0;
        }
        bench.run(0.05);
    }
}

proptest::proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 60 } else { 600 }))]
    /// An unheard vehicle rests where others expect it, whatever its speed, and whether its radio
    /// still receives or not. Messages take `delay_s`: those of others that were under way as its
    /// radio failed arrive later, or never. The others report for 0.8 s that they heard it; it
    /// receives a share of these reports. Its gate may open meanwhile: others do not know that it
    /// flies on.
    #[test]
    fn an_unheard_vehicle_rests_where_others_expect_it(
        cruise_mps in 0.5f32..15.0,
        flown_s in 0.2f32..15.0,
        reports_heard in proptest::option::of(0f32..1.0),
        receives in proptest::bool::ANY,
        delay in 0usize..11,
        gate_m in proptest::option::of(5f32..60.0),
        opens in proptest::bool::ANY,
    ) {
        // A vehicle that is faster overshoots by more than it flies back before it lands; with
        // longer delays it does not know which of its intents arrived last.
        let opens = opens && cruise_mps < 4.0 && delay < 4;
        // An intent is sent each 0.2 s: each intent by which the echo is behind adds 0.1 s each
        // way.
        let delay_s = 0.1 * delay as f32;
        let mut config = Config { cruise_mps, ..two_vehicles() };
        (config.slowest_vehicle_mps, config.fastest_vehicle_mps) = (cruise_mps, cruise_mps);
        let mut bench = Bench::new(config);
        bench.step_m = cruise_mps * 0.06;
        bench.neighbour_echoes = Some(delay);
        let mut path = Path::new();
        for x in [0.0, 40.0, 300.0] {
            path.push(START + Point::new(x, 0.0, 0.0), 1.2).unwrap();
        }
        let mut plan = VehiclePlan { path, ..plan() };
        if let Some(at_m) = gate_m {
            plan.gates.push(Gate { at_m, wait_for_id: 77, open_from_progress_m: 100.0 }).unwrap();
        }
        bench.answer_plan = Some(Ok(plan));
        bench.neighbour = Some((Point::new(8.0, 60.0, 0.0), GROUNDED | ON_PLAN, 99.0, 5));
        bench.run_until(State::Ready, 6.0);
        bench.start();
        bench.run_until(State::Follow, 60.0);
        bench.run(flown_s);
        // What the others heard last is up to 0.2 s old when the radio fails.
        let (heard_m, speed_mps) = last_report(&bench);
        let estimated_s = bench.companion.neighbours.max_message_delay_s();
        match reports_heard {
            Some(share) => {
                if let Some((.., progress_m, _)) = bench.neighbour.as_mut().filter(|_| opens) {
                    *progress_m = 100.0;
                }
                hear_no_more(&mut bench, delay, 0.8 * share);
            }
            None => {
                bench.neighbour_echoes = None;
                bench.run(if receives { delay_s } else { 0.0 });
                bench.neighbour = None;
            }
        }
        bench.run_until(State::Land, 60.0);
        let rests_m = bench.enu.x - START.x - heard_m;
        let most_m = max_unheard_travel_m(cruise_mps)
            + cruise_mps * unheard_flight_by_delay_s(estimated_s);
        // The reported points end at the gate.
        let gate_on_m = gate_m.map_or(f32::INFINITY, |at_m| (at_m - heard_m).max(0.0) + 0.6);
        let most_m = most_m.min(gate_on_m);
        proptest::prop_assert!(rests_m < most_m, "{rests_m} m on at {speed_mps} m/s, {most_m}");
        let least_m = speed_mps * (0.3 + speed_mps / 6.0).min(0.6);
        let stops_m = gate_m.map_or(f32::INFINITY, |at_m| 0.8 * (at_m - heard_m).max(0.0));
        proptest::prop_assert!(
            rests_m > least_m.min(stops_m) - 0.3,
            "{rests_m} m on at {speed_mps} m/s, at least {least_m}, {stops_m}"
        );
    }
}

/// A gate opens as the vehicle's transmitter fails: the vehicle flies on, and back. Heard again, it
/// reports no progress that it has yet to make.
#[test]
fn a_vehicle_heard_again_reports_no_progress_that_it_has_yet_to_make() {
    for cruise_mps in [1.0, 2.0, 3.0] {
        for lost_s in [6.0, 8.0, 10.0, 12.0] {
            let mut config = Config { cruise_mps, ..two_vehicles() };
            (config.slowest_vehicle_mps, config.fastest_vehicle_mps) = (cruise_mps, cruise_mps);
            let mut bench = Bench::new(config);
            bench.step_m = cruise_mps * 0.06;
            bench.neighbour_echoes = Some(0);
            let mut path = Path::new();
            for x in [0.0, 40.0, 300.0] {
                path.push(START + Point::new(x, 0.0, 0.0), 1.2).unwrap();
            }
            let mut plan = VehiclePlan { path, ..plan() };
            plan.gates
                .push(Gate { at_m: 10.0, wait_for_id: 77, open_from_progress_m: 100.0 })
                .unwrap();
            bench.answer_plan = Some(Ok(plan));
            bench.neighbour = Some((Point::new(8.0, 60.0, 0.0), GROUNDED | ON_PLAN, 99.0, 5));
            bench.run_until(State::Ready, 6.0);
            bench.start();
            bench.run_until(State::Follow, 60.0);
            bench.run(20.0);
            bench.neighbour.as_mut().expect("it flies").2 = 100.0;
            hear_no_more(&mut bench, 0, 0.8);
            bench.run(lost_s - 4.0);
            bench.neighbour_held = 0;
            (bench.neighbour_hears, bench.neighbour_echoes) = (u32::MAX, Some(0));
            for _ in 0..60 {
                bench.run(0.05);
                let mut sent = bench.swarm.iter().rev();
                let intent = sent.find_map(|f| Intent::decode(f.padded_payload(), SYSTEM));
                let intent = intent.filter(|intent| intent.flags & ON_PLAN != 0);
                let reported_m = intent.map_or(0.0, |intent| intent.progress_m);
                let at_m = bench.enu.x - START.x;
                assert!(reported_m < at_m + 0.6, "{reported_m} at {at_m}, {cruise_mps} {lost_s}");
            }
        }
    }
}
