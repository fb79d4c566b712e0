//! Simulates a whole swarm on the host: companions and simulated autopilots, connected by emulated
//! serial links and a radio.
//!
//! Fixed steps of 4 ms, one thread, every random number from the scenario's seed: the same scenario
//! gives the same flight, bit for bit, in debug and release. Every byte between a companion and its
//! autopilot passes a [`serial::SerialLink`], every byte between companions a [`radio::Radio`]; the
//! [`referee::Referee`] sees the true motion and gives it to no companion.

pub mod board;
pub mod divisions;
mod ending;
pub mod faults;
pub mod gateway;
pub mod ground_station;
pub mod radio;
pub mod referee;
pub mod serial;
pub mod simulated_vehicle;
pub mod step;
pub mod vehicles;

use std::time::{Duration, Instant as Clock};

use anyhow::Context;
use companion::{PlanFailure, PlanKind, State};
use planner_core::Point;
use planner_core::flight::WaypointRange;
use planner_core::roadmap::RoadmapView;

use self::divisions::{DivisionLog, FlownDivision};
use self::faults::{FaultScript, FaultTargets};
use self::gateway::Gateway;
use self::ground_station::GroundStation;
use self::radio::{Radio, RadioConfig};
use self::referee::{DistanceSample, Referee};
use self::simulated_vehicle::{PlanAnswer, SimulatedVehicle, is_finished};
use self::step::STEP_US;
use self::vehicles::vehicles_on_pads;
use crate::coverage::check::Picture;
use crate::margins;
use crate::mission::planner::HostPlanner;
use crate::mission::{HostPlan, PreparedMission};
use crate::progress::Progress;
use crate::report::{self, Level};
use crate::result::{MissionResult, Safety, Totals, Unserved, VehicleResult, rounded};
use crate::scenario::CompanionHost;
use crate::shortage;

/// Distance from its goal within which a vehicle counts as having reached it, metres.
const GOAL_REACHED_WITHIN_M: f32 = 0.5;
/// Horizontal distance from its pad beyond which a vehicle has left it, metres.
const AWAY_FROM_PAD_M: f32 = 2.0;
/// Greatest lag behind the wall clock that the simulation makes up for; a longer lag remains. If
/// the simulation hurried, autopilots would pass seconds in which no companion in another process
/// can send anything.
const MAX_CLOCK_LAG: Duration = Duration::from_millis(200);

/// Outcome of a simulated flight.
pub struct SwarmFlight {
    /// `result.json`.
    pub result: MissionResult,
    /// True track of each vehicle: times in seconds, positions in ENU metres.
    pub tracks: Vec<Vec<(f32, Point)>>,
    /// When each vehicle lost its power, or its motors in the air, seconds; `None` for the others.
    pub power_lost_at_s: Vec<Option<f32>>,
    /// Smallest distances over time, one sample each 0.2 s.
    pub samples: Vec<DistanceSample>,
    /// Pictures taken, sorted by vehicle.
    pub pictures: Vec<Picture>,
    /// Events of the companions, the fault script and the referee.
    pub log: Vec<report::LogEvent>,
    /// Waypoints of a coverage mission that were photographed in earlier flights.
    pub photographed_before: Vec<WaypointRange>,
    /// Divisions that companions of a coverage mission agreed on, in order of time.
    pub divisions: Vec<FlownDivision>,
    /// Length of the simulated flight, seconds.
    pub simulated_s: f64,
    /// Time that the simulation took on this machine's clock, seconds.
    pub wall_time_s: f64,
}

/// How fast the simulation runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// As fast as the machine can; a board behind links still gets real time.
    #[default]
    Fastest,
    /// At the speed of the clock.
    RealTime,
}

/// Simulates the flight of a planned mission. Each companion requests a plan and gets its vehicle's
/// part of `plan`.
pub fn fly(
    mission: &PreparedMission,
    plan: &HostPlan,
    command: &'static str,
    pace: Pace,
    progress: &Progress,
) -> anyhow::Result<SwarmFlight> {
    simulate(mission, plan, command, pace, None, progress)
}

/// As [`fly`], in real time, with a real ground station connected by `gateway`.
///
/// # Errors
/// The link to the ground station is gone.
pub fn fly_with_ground_station(
    mission: &PreparedMission,
    plan: &HostPlan,
    command: &'static str,
    gateway: Gateway,
    progress: &Progress,
) -> anyhow::Result<SwarmFlight> {
    simulate(mission, plan, command, Pace::RealTime, Some(gateway), progress)
}

/// A simulation under way.
struct SimulationRun<'a> {
    mission: &'a PreparedMission,
    plan: &'a HostPlan,
    planner: HostPlanner<'a>,
    vehicles: Vec<SimulatedVehicle>,
    radio: Radio,
    referee: Referee<'a>,
    ground_station: GroundStation,
    /// Link to a ground station outside; `None` without one.
    gateway: Option<Gateway>,
    divisions: DivisionLog,
    script: FaultScript<'a>,
    log: Vec<report::LogEvent>,
    /// Waypoints that earlier flights have photographed.
    photographed_before: Vec<WaypointRange>,
    /// True position of each vehicle after its last step, in the order of `vehicles`, ENU metres.
    true_positions: Vec<Point>,
    /// Smallest distance of each vehicle from its goal so far; in a coverage mission horizontally
    /// from its pad since it last came back there. Metres.
    nearest_to_end_m: Vec<f32>,
    /// Simulated time so far, seconds.
    t_s: f64,
    /// When some vehicle was last seen armed, or the start or a fault was still awaited, seconds.
    last_active_s: f64,
    /// When the simulation ends, seconds; infinite until that is known.
    ends_at_s: f64,
}

fn simulate(
    mission: &PreparedMission,
    plan: &HostPlan,
    command: &'static str,
    pace: Pace,
    gateway: Option<Gateway>,
    progress: &Progress,
) -> anyhow::Result<SwarmFlight> {
    let mut run = SimulationRun::new(mission, plan, gateway)?;
    let settings = &mission.scenario.simulation;
    // A board behind links runs by its own clock, so the simulation runs in real time.
    let by_clock =
        mission.scenario.vehicles.iter().any(|v| matches!(v.companion, CompanionHost::Url { .. }));
    let steps = (f64::from(settings.time_limit_s) * 1e6 / STEP_US as f64) as u64;
    let bar = progress.begin_counted_stage("flight", settings.time_limit_s as u64);
    let began = Clock::now();
    let mut put_off = Duration::ZERO;
    for step in 0..steps {
        let now_us = (step + 1) * STEP_US;
        run.step(step, now_us)?;
        if step % 250 == 0 {
            bar.set_position(run.t_s as u64);
            run.update_end();
        }
        if run.t_s >= run.ends_at_s {
            break;
        }
        if pace == Pace::RealTime || by_clock {
            let due = Duration::from_micros(now_us) + put_off;
            put_off += began.elapsed().saturating_sub(due + MAX_CLOCK_LAG);
            std::thread::sleep(due.saturating_sub(began.elapsed()));
        }
    }
    let wall_time_s = began.elapsed().as_secs_f64();
    run.vehicles.iter_mut().try_for_each(SimulatedVehicle::print_stack_use)?;
    let result = run.result(command);
    run.log_trouble_and_incidents(&result);
    let tracks = (0..run.vehicles.len()).map(|i| run.referee.track(i).to_vec()).collect();
    let power_lost_at_s =
        run.vehicles.iter().map(|v| v.power_lost_at_s.map(|t_s| t_s as f32)).collect();
    let pictures = run.vehicles.iter_mut().flat_map(SimulatedVehicle::drain_pictures).collect();
    let SimulationRun { referee, log, photographed_before, divisions, t_s, .. } = run;
    let divisions = divisions.into_divisions();
    Ok(SwarmFlight {
        result,
        tracks,
        power_lost_at_s,
        samples: referee.samples,
        pictures,
        log,
        photographed_before,
        divisions,
        simulated_s: t_s,
        wall_time_s,
    })
}

impl<'a> SimulationRun<'a> {
    fn new(
        mission: &'a PreparedMission,
        plan: &'a HostPlan,
        gateway: Option<Gateway>,
    ) -> anyhow::Result<Self> {
        let scenario = &mission.scenario;
        let settings = &scenario.simulation;
        let mut vehicles = vehicles_on_pads(mission)?;
        let mut radio = Radio::new(
            RadioConfig {
                range_m: settings.radio_range_m,
                loss_probability: f64::from(settings.radio_loss),
                delay_s: f64::from(settings.radio_delay_s),
            },
            vehicles.len(),
            scenario.seed,
        );
        if let Some(gateway) = &gateway {
            gateway.add_ground_ports(&mut vehicles);
        }
        if gateway.is_some() || scenario.covers_area() {
            radio.start_recording();
        }
        let ids_and_radii: Vec<(u8, f32)> =
            scenario.vehicles.iter().map(|v| (v.id, v.radius_m)).collect();
        let safety_distance_m = scenario.deconfliction.safety_distance_m;
        let mut referee = Referee::new(
            mission.map.grid(),
            mission.clearance_field(),
            safety_distance_m,
            &ids_and_radii,
        );
        referee.terrain =
            scenario.area.as_ref().and_then(|area| area.terrain.as_ref()).map(|t| &*t.grid);
        referee.area_obstacles = scenario.area.as_ref().and_then(|area| area.obstacles.as_deref());
        // Lanes of two vehicles may lie side by side, and one vehicle waits for as long as the
        // other one is on its lanes: that is no deadlock.
        referee.retracts_ended_deadlocks = !scenario.faults.is_empty() || scenario.covers_area();
        referee.retracts_out_of_range_waits = scenario.has_short_radio();
        Ok(Self {
            mission,
            plan,
            planner: HostPlanner::new(mission, plan),
            radio,
            referee,
            ground_station: GroundStation::new(scenario.mission.ground_stations[0]),
            gateway,
            divisions: DivisionLog::default(),
            script: FaultScript::new(scenario),
            log: Vec::new(),
            photographed_before: Vec::new(),
            true_positions: vehicles.iter().map(|v| v.autopilot.true_state().position).collect(),
            nearest_to_end_m: vec![f32::INFINITY; vehicles.len()],
            vehicles,
            t_s: 0.0,
            last_active_s: 0.0,
            ends_at_s: f64::INFINITY,
        })
    }

    /// One step of 4 ms, from 0; `now_us` is the time at its end.
    fn step(&mut self, step: u64, now_us: u64) -> anyhow::Result<()> {
        let Self { mission, plan, planner, vehicles, radio, true_positions: places, log, .. } =
            self;
        self.t_s = now_us as f64 * 1e-6;
        let mut world = FaultTargets {
            vehicles,
            radio,
            ground_station: &mut self.ground_station,
            obstacles: &mut self.referee.sphere_obstacles,
        };
        self.script.step(now_us, &mut world, log)?;
        for (i, vehicle) in vehicles.iter_mut().enumerate() {
            vehicle.step(step, i, mission, radio, places, log)?;
            if let Some(wanted) = vehicle.take_plan_request() {
                let own = match vehicle.plan_answer {
                    PlanAnswer::BadRoadmap => {
                        Err(plan_failure_on_damaged_roadmap(&mission.roadmap_or_field_file))
                    }
                    _ => planner.answer(i, wanted, &mut vehicle.companion),
                };
                if wanted == PlanKind::Mission {
                    self.photographed_before = vehicle.companion.excluded_waypoints().to_vec();
                }
                vehicle.hand_over_plan(now_us, wanted, own);
            }
            places[i] = vehicle.autopilot.true_state().position;
            let flight = &plan.flights[i];
            // A vehicle without a part of an area may get one later: it too comes back to its pad.
            let end = match flight.task.leaves_pad() {
                true => flight.path.waypoints().last().map(|end| end.position),
                false => Some(mission.scenario.vehicles[i].start),
            };
            if let Some(end) = end {
                let off = places[i] - end;
                let nearest_m = &mut self.nearest_to_end_m[i];
                *nearest_m = match flight.task.goal() {
                    Some(_) => nearest_m.min(off.norm()),
                    // A flight in a coverage mission ends above its own pad, so the distance counts
                    // from its return on.
                    None if off.xy().norm() > AWAY_FROM_PAD_M => f32::INFINITY,
                    None => nearest_m.min(off.xy().norm()),
                };
            }
        }
        self.ground_station.step(now_us, vehicles, radio, places);
        let overheard = radio.take_recorded();
        self.divisions.handle_packets(self.t_s as f32, &overheard);
        if let Some(gateway) = &mut self.gateway {
            gateway
                .step(now_us, vehicles, radio, places, &overheard)
                .context("link lost: --qgc")?;
        }
        let seen: Vec<_> = vehicles.iter().map(SimulatedVehicle::observation).collect();
        self.referee.observe(self.t_s, &seen);
        Ok(())
    }

    fn result(&self, command: &'static str) -> MissionResult {
        let Self { mission, plan, vehicles, referee, .. } = self;
        let scenario = &mission.scenario;
        let results: Vec<_> = (0..vehicles.len()).map(|i| self.vehicle_result(i)).collect();
        let served = results.iter().filter(|v| v.goal.is_some()).count();
        let all_served = served == mission.goals.len().min(vehicles.len());
        let clean = referee.wall_contacts == 0 && referee.violations == 0 && referee.deadlocks == 0;
        let finite = |m: f32| m.is_finite().then(|| rounded(m));
        let last_landing_s = vehicles.iter().filter_map(|v| v.landed_s).fold(0.0, f64::max);
        MissionResult {
            command,
            scenario: scenario.path.clone(),
            seed: scenario.seed,
            complete: clean
                && all_served
                && results
                    .iter()
                    .enumerate()
                    .all(|(i, v)| self.has_completed_task(i, v) || self.is_disabled_by_fault(i)),
            vehicles: results,
            totals: Totals {
                path_m: rounded(plan.total_path_m() as f32),
                makespan_s: (last_landing_s - self.ground_station.start_commanded_s()).max(0.0),
            },
            safety: Safety {
                wall_contacts: referee.wall_contacts,
                wall_contacts_under_pilot: referee.wall_contacts_under_pilot(),
                min_clearance_m: finite(referee.min_clearance_m),
                min_separation_m: finite(referee.min_separation_m),
                safety_distance_m: rounded(scenario.deconfliction.safety_distance_m),
                violations: referee.violations,
                deadlocks: referee.deadlocks,
            },
            roadmap: mission.roadmap_counts(),
            unserved: Unserved {
                reasons: shortage::shortage_lines(mission, plan),
                ..mission.unserved(plan)
            },
            coverage: None,
        }
    }

    fn vehicle_result(&self, i: usize) -> VehicleResult {
        let scenario = &self.mission.scenario;
        // The vehicle cannot correct the error of its position estimate, so that error is
        // subtracted.
        let error_m = margins::estimate_error_margin_m(
            scenario.simulation.estimator,
            scenario.vehicles[i].autopilot,
        );
        let nearest_to_end_m = self.nearest_to_end_m[i] - error_m;
        let flown_m = self.referee.flown_m(i);
        let flight = &self.plan.flights[i];
        vehicle_result(&self.vehicles[i], flight, flown_m, nearest_to_end_m, self.t_s)
    }

    /// Whether the vehicle flew to the end of its path and landed, or had no flight to make.
    fn has_completed_task(&self, i: usize, vehicle: &VehicleResult) -> bool {
        let flight = &self.plan.flights[i];
        !has_flight_to_make(&self.vehicles[i], flight) || (vehicle.reached && vehicle.landed)
    }

    /// Whether a fault struck the vehicle and its flight is over: it has no power, never took off,
    /// is finished, or is left to its pilot.
    fn is_disabled_by_fault(&self, i: usize) -> bool {
        let vehicle = &self.vehicles[i];
        self.script.was_struck(i)
            && (vehicle.is_powerless()
                || vehicle.took_off_s.is_none()
                || is_finished(vehicle.state())
                || is_left_to_pilot(vehicle))
    }

    /// Logs the fault of the serial link of each vehicle that did not complete its task, and the
    /// referee's incidents.
    fn log_trouble_and_incidents(&mut self, result: &MissionResult) {
        let scenario = &self.mission.scenario;
        for (i, (vehicle, outcome)) in self.vehicles.iter().zip(&result.vehicles).enumerate() {
            if let (false, Some(text)) =
                (self.has_completed_task(i, outcome), vehicle.link_trouble(self.t_s))
            {
                let (t_s, level) = (self.t_s as f32, Level::Error);
                self.log.push(report::LogEvent { t_s, vehicle: Some(outcome.id), level, text });
            }
        }
        self.log.extend(self.referee.incidents.iter().map(|seen| report::LogEvent {
            t_s: seen.t_s as f32,
            vehicle: Some(scenario.vehicles[seen.vehicle].id),
            level: if seen.retracted { Level::Warning } else { Level::Error },
            text: seen.text.clone(),
        }));
    }
}

/// Whether a pilot controls the vehicle or has just given it back: this may last for any time.
fn is_left_to_pilot(vehicle: &SimulatedVehicle) -> bool {
    vehicle.state().is_left_to_pilot()
}

/// How planning fails on the roadmap file with one bit changed.
fn plan_failure_on_damaged_roadmap(file: &[u8]) -> PlanFailure {
    let mut damaged = file.to_vec();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    match RoadmapView::parse(&damaged) {
        Err(_) => PlanFailure::RoadmapUnusable,
        // Not reached: the CRC detects every single changed bit.
        Ok(_) => PlanFailure::Invalid,
    }
}

/// Whether the vehicle took off, or the plan gives it a flight that earlier flights did not
/// complete.
fn has_flight_to_make(
    vehicle: &SimulatedVehicle,
    flight: &planner_core::flight::Flight<{ crate::capacity::MAX_WAYPOINTS }>,
) -> bool {
    let stays = !flight.task.leaves_pad() || vehicle.state() == State::Done;
    vehicle.took_off_s.is_some() || !stays
}

fn vehicle_result(
    vehicle: &SimulatedVehicle,
    flight: &planner_core::flight::Flight<{ crate::capacity::MAX_WAYPOINTS }>,
    flown_m: f64,
    nearest_to_end_m: f32,
    now_s: f64,
) -> VehicleResult {
    // A flight in a coverage mission ends where it began: only a landing shows that it is over.
    let landed = vehicle.landed_s.is_some();
    let reached =
        nearest_to_end_m <= GOAL_REACHED_WITHIN_M && (landed || flight.task.goal().is_some());
    let end = match (has_flight_to_make(vehicle, flight), vehicle.state()) {
        (false, _) => "no goal".to_owned(),
        // Its estimate was at the goal, its true position was not.
        (_, State::Done) if !reached => "Aborted: Landed beside its goal".to_owned(),
        _ => vehicle.describe_end(),
    };
    let flight_time_s =
        vehicle.took_off_s.map_or(0.0, |from| vehicle.back_on_ground_s.unwrap_or(now_s) - from);
    VehicleResult {
        id: flight.vehicle_id,
        goal: flight.task.goal(),
        reached,
        landed,
        path_m: rounded(flight.path.length_m()),
        flown_m: rounded(flown_m as f32),
        flight_time_s: rounded(flight_time_s as f32),
        end,
    }
}
