//! Missions by latitude and longitude, anywhere on earth, flown by autopilots that share neither
//! origin nor home nor projection: every vehicle's position is right in the mission frame, and so
//! is its goal.
//!
//! A mission's number is its seed; a failing one is printed.

use companion::Instant;
use companion::link::frame::Framer;
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;
use host_sim::swarm::ground_station::GroundStation;
use host_sim::swarm::radio::{Radio, RadioConfig};
use host_sim::swarm::simulated_vehicle::{SimulatedVehicle, is_finished};
use host_sim::swarm::step::STEP_US;
use host_sim::swarm::vehicles::vehicles_on_pads;
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use planner_core::Point;
use planner_core::geo::frames::{Geodetic, enu_to_geodetic, geodetic_to_enu};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const MISSIONS: u64 = 200;
/// Greatest position error, metres: 0.1 m, and the error of the estimate, 0.1 m horizontal and 0.15
/// m vertical.
const RIGHT_M: f32 = 0.1 + 0.18;
/// Greatest age of a broadcast position, µs: it is the last one received from the autopilot, and
/// the radio adds a delay.
const AGE_US: u64 = 200_000;
/// Time limit of a mission, simulated seconds: ArduCopter's estimator takes 40 of it.
const LIMIT_S: u64 = 120;

fn uniform(rng: &mut Pcg32, low: f64, high: f64) -> f64 {
    low + f64::from(rng.next_u32()) * 2f64.powi(-32) * (high - low)
}

/// A place up to `reach_m` away, and up to 60 m higher or lower.
fn around(rng: &mut Pcg32, of: &Geodetic, reach_m: f64) -> Geodetic {
    let (bearing, far) =
        (uniform(rng, 0.0, std::f64::consts::TAU), reach_m * uniform(rng, 0.0, 1.0).sqrt());
    let up = uniform(rng, -60.0, 60.0);
    enu_to_geodetic(
        of,
        &Point::new((far * bearing.cos()) as f32, (far * bearing.sin()) as f32, up as f32),
    )
}

fn toml(place: &Geodetic) -> String {
    let Geodetic { lat_deg, lon_deg, alt_m } = place;
    format!("{{ lat_deg = {lat_deg:.10}, lon_deg = {lon_deg:.10}, alt_m = {alt_m:.4} }}")
}

/// Two vehicles cross the lobby of the building, wherever on earth it stands.
fn scenario_text(rng: &mut Pcg32) -> String {
    let origin = Geodetic {
        lat_deg: uniform(rng, -65.0, 65.0),
        lon_deg: uniform(rng, -180.0, 180.0),
        alt_m: uniform(rng, -50.0, 2500.0),
    };
    let by_degrees = |point: Point| toml(&enu_to_geodetic(&origin, &point));
    let mut text = format!(
        "seed = {}\n[map]\nfile = 'builtin:building'\nresolution_m = 0.5\norigin = {}\n[roadmap]\nnodes = 200\n",
        rng.next_u32(),
        toml(&origin)
    );
    let lanes = [3.0, 6.0];
    let shift = |rng: &mut Pcg32| uniform(rng, -0.5, 0.5) as f32;
    let goals = lanes.map(|y| by_degrees(Point::new(14.0 + shift(rng), y + shift(rng), 1.8)));
    text += &format!("[mission]\ngoals = [{}]\n", goals.join(", "));
    let first = 1 + rng.next_u32() % 250;
    let ids = [first, 1 + (first + rng.next_u32() % 249) % 250];
    for (lane, id) in lanes.iter().zip(ids) {
        let start = by_degrees(Point::new(10.0 + shift(rng), lane + shift(rng), 1.5));
        let (ekf_origin, home) = (around(rng, &origin, 2000.0), around(rng, &origin, 1000.0));
        let autopilot = if rng.next_u32().is_multiple_of(2) { "px4" } else { "ardupilot" };
        text += &format!(
            "[[vehicles]]\nid = {id}\nstart = {start}\npersonality = '{autopilot}'\nekf_origin = {}\nhome = {}\n",
            toml(&ekf_origin),
            toml(&home)
        );
    }
    text
}

/// Greatest errors of one mission, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Error of the position that the companion has when it receives it.
    known_m: f32,
    /// Distance of a broadcast position from the vehicle's track of the last [`AGE_US`].
    broadcast_m: f32,
    /// Smallest distance of a vehicle's true position from its goal.
    goal_m: f32,
}

impl Errors {
    fn worst(self, other: Self) -> Self {
        Self {
            known_m: self.known_m.max(other.known_m),
            broadcast_m: self.broadcast_m.max(other.broadcast_m),
            goal_m: self.goal_m.max(other.goal_m),
        }
    }
}

fn fly(seed: u64) -> Errors {
    let mut rng = Pcg32::seed_from_u64(seed);
    let text = scenario_text(&mut rng);
    let scenario =
        scenario::parse(&text, "mixed frames").unwrap_or_else(|e| panic!("mission {seed}: {e}"));
    let mut mission =
        PreparedMission::prepare(scenario, &Progress::hidden()).expect("the lobby is free");
    let plan = mission.plan().expect("they fly side by side");
    let mut vehicles = vehicles_on_pads(&mission).expect("good vehicles");
    // The radio has one station more than vehicles, which only listens.
    let listener = vehicles.len();
    let config = RadioConfig { range_m: 1e6, loss_probability: 0.0, delay_s: 0.05 };
    let mut radio = Radio::new(config, listener + 1, seed);
    let (mut framer, mut ground_station, mut log) =
        (Framer::new(), GroundStation::new(255), Vec::new());
    let mut places: Vec<Point> =
        vehicles.iter().map(|v| v.autopilot.true_state().position).collect();
    places.push(Point::zeros());
    let mut tracks: Vec<Vec<Point>> = vec![Vec::new(); vehicles.len()];
    let mut nearest_m = vec![f32::INFINITY; vehicles.len()];
    let (mut errors, mut heard) = (Errors::default(), 0);
    let origin = mission.scenario.map.origin;
    for step in 0..LIMIT_S * 1_000_000 / STEP_US {
        let now_us = (step + 1) * STEP_US;
        for (i, vehicle) in vehicles.iter_mut().enumerate() {
            vehicle
                .step(step, i, &mission, &mut radio, &places, &mut log)
                .expect("it has no board");
            if let Some(wanted) = vehicle.take_plan_request() {
                let own = mission.own_plan(&plan, i).expect("few gates");
                vehicle.hand_over_plan(now_us, wanted, Ok(&own));
            }
            let truth = vehicle.autopilot.true_state().position;
            places[i] = truth;
            tracks[i].push(truth);
            let telemetry = vehicle.companion.telemetry();
            if telemetry.position_at == Some(Instant::from_micros(now_us)) {
                errors.known_m = errors.known_m.max((telemetry.position - truth).norm());
            }
            let goal =
                mission.goals[usize::from(plan.flights[i].task.goal().expect("a goal for each"))];
            nearest_m[i] = nearest_m[i].min((truth - goal).norm());
        }
        ground_station.step(now_us, &mut vehicles, &mut radio, &places);
        while let Some(packet) = radio.receive(now_us, listener) {
            let mut bytes = &packet[..];
            while let Some(frame) = framer.next(Instant::from_micros(now_us), &mut bytes) {
                let Some(said) = frame.decode::<GLOBAL_POSITION_INT_DATA>() else { continue };
                let i = vehicles
                    .iter()
                    .position(|v| v.system_id() == frame.system)
                    .expect("one of ours");
                let place = Geodetic {
                    lat_deg: f64::from(said.lat) * 1e-7,
                    lon_deg: f64::from(said.lon) * 1e-7,
                    alt_m: f64::from(said.alt) * 1e-3,
                };
                let place = geodetic_to_enu(&origin, &place);
                let lately = tracks[i].iter().rev().take((AGE_US / STEP_US) as usize);
                let error_m = lately.map(|was| (was - place).norm()).fold(f32::INFINITY, f32::min);
                errors.broadcast_m = errors.broadcast_m.max(error_m);
                heard += 1;
            }
        }
        if vehicles.iter().all(|v| is_finished(v.companion.state())) {
            break;
        }
    }
    errors.goal_m = nearest_m.into_iter().fold(0.0, f32::max);
    let log: Vec<_> =
        log.iter().map(|e| format!("{:.1} s {:?}: {}", e.t_s, e.vehicle, e.text)).collect();
    let ends: Vec<_> = vehicles.iter().map(SimulatedVehicle::describe_end).collect();
    assert!(
        ends.iter().all(|end| end == "Done"),
        "mission {seed}: {ends:?}\n{text}\n{}",
        log.join("\n")
    );
    assert!(heard > 100, "mission {seed}: {heard} positions heard");
    assert!(
        errors.known_m < RIGHT_M && errors.broadcast_m < RIGHT_M,
        "mission {seed}: {errors:?}\n{text}"
    );
    errors
}

#[test]
fn every_vehicle_is_where_the_mission_frame_says() {
    let worst = (0..MISSIONS).into_par_iter().map(fly).reduce(Errors::default, Errors::worst);
    println!("{MISSIONS} missions: {worst:?}");
    assert!(worst.goal_m < RIGHT_M, "{worst:?}");
}
