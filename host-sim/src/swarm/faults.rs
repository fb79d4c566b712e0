//! Plays the scenario's `[[faults]]`: begins each at its time on the vehicles that it strikes, and
//! ends it after its duration.
//!
//! | kind | strikes | ends after `duration_s` |
//! |---|---|---|
//! | `kill` | all power gone: silent, falls to the floor below and lies there | never |
//! | `radio-cut` | cannot send (`tx`), cannot hear (`rx`), or can do neither (`both`, if not given) | hears and sends again |
//! | `serial-stall` | no byte between companion and autopilot, either way | 3 s if not given |
//! | `serial-corrupt` | `CORRUPTED_SHARE` of all bytes change a bit | as before |
//! | `position-jump` | the estimate moves by `offset_m`, 5 m east if not given | jumps back |
//! | `origin-change` | the EKF origin moves by `offset_m`, `DEFAULT_ORIGIN_CHANGE_M` if not given | moves back |
//! | `gps-loss` | no position | position again |
//! | `battery-low` | `BATTERY_LEFT_SHARE` of the charge is left | never |
//! | `pilot-takeover` | Position or Brake mode by the pilot's switch | as `pilot-return` |
//! | `pilot-return` | Offboard or Guided by the pilot's switch, and the ground station commands the companion to continue | |
//! | `autopilot-reboot` | motors off, mode and streams reset, silent in its boot | 3 s if not given |
//! | `companion-reset` | the companion restarts, its clock at 0 | |
//! | `late-plan` | a request for a plan gets no answer | answered |
//! | `bad-roadmap` | plans are computed on a damaged roadmap | on the right one again |
//! | `pause-order` | the ground station commands a pause | commands to continue |
//! | `return-order` | the ground station commands to fly home | |
//! | `land-order` | the ground station commands to land | |
//! | `obstacle` | a sphere of `radius_m` at `position`, which the ground station sees and reports to all companions | the sphere is gone; companions still avoid it |
//!
//! A fault without a vehicle strikes all vehicles; an obstacle strikes none.

use planner_core::Point;
use planner_core::geo::frames::enu_to_geodetic;
use sim_autopilot::GpsFix;

use super::ground_station::{GroundStation, OperatorCommand};
use super::radio::{Radio, RadioOutage};
use super::simulated_vehicle::{PlanAnswer, SimulatedVehicle};
use crate::report::{Level, LogEvent};
use crate::scenario::{CompanionHost, FAULT_OBSTACLE, Fault, Scenario};

/// Share of bytes that `serial-corrupt` changes: half of all frames as long as a setpoint are lost.
const CORRUPTED_SHARE: f64 = 0.01;
/// Share of the charge that `battery-low` leaves: below the companions' limit, above the
/// autopilots'.
const BATTERY_LEFT_SHARE: f32 = 0.1;
/// By how much `position-jump` moves the estimate if the fault has no `offset_m`, ENU metres.
const DEFAULT_POSITION_JUMP_M: Point = Point::new(5.0, 0.0, 0.0);
/// By how much `origin-change` moves the EKF origin if the fault has no `offset_m`, ENU metres.
const DEFAULT_ORIGIN_CHANGE_M: Point = Point::new(40.0, -30.0, 5.0);
/// Duration of a serial stall or an autopilot's boot if the fault has no `duration_s`, seconds.
const DEFAULT_STALL_OR_BOOT_S: f32 = 3.0;

/// Refuses faults that the simulation cannot play: to reset a companion or disturb its planner, the
/// companion has to run in this process; a radio cut needs the simulated radio, a damaged roadmap a
/// roadmap or field file.
///
/// # Errors
/// Names the fault, and the vehicle that it cannot strike.
pub fn check(scenario: &Scenario) -> anyhow::Result<()> {
    let needs_no_file = scenario.area.as_ref().is_some_and(|area| area.terrain.is_none());
    for fault in &scenario.faults {
        anyhow::ensure!(
            !(needs_no_file && fault.kind == "bad-roadmap"),
            "no such fault here: {}: bad-roadmap has no file to damage: an area over level ground is planned without a roadmap or field",
            scenario.path
        );
        for vehicle in scenario.vehicles.iter().filter(|vehicle| fault.strikes(vehicle)) {
            let in_vain = match (&vehicle.companion, fault.kind) {
                (CompanionHost::InProcess { .. }, _) => false,
                (_, "companion-reset" | "late-plan" | "bad-roadmap") => true,
                (CompanionHost::Emulated { .. }, _) => false,
                (CompanionHost::Url { radio, .. }, kind) => kind == "radio-cut" && radio.is_none(),
            };
            anyhow::ensure!(
                !in_vain,
                "no such fault here: {}: {} cannot strike vehicle {}, whose companion is on a board or in another process",
                scenario.path,
                fault.kind,
                vehicle.id
            );
        }
    }
    Ok(())
}

/// The parts of the simulation that a fault acts on.
pub struct FaultTargets<'a> {
    /// The vehicles, in the order of the scenario.
    pub vehicles: &'a mut [SimulatedVehicle],
    /// Radio of the swarm.
    pub radio: &'a mut Radio,
    /// The ground station, which commands vehicles and reports obstacles.
    pub ground_station: &'a mut GroundStation,
    /// Spherical obstacles that are in no map: centre and radius, metres.
    pub obstacles: &'a mut Vec<(Point, f32)>,
}

/// Whether a fault has begun, and whether it is over.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FaultStage {
    /// The fault has not begun.
    Pending,
    /// The fault acts.
    Active,
    /// The fault is over.
    Ended,
}

/// The scenario's faults, which of them act or are over, and which vehicles they have struck.
pub struct FaultScript<'a> {
    scenario: &'a Scenario,
    /// Stage of each fault.
    stages: Vec<FaultStage>,
    /// Whether each vehicle was struck by a fault so far.
    struck: Vec<bool>,
}

impl<'a> FaultScript<'a> {
    /// A script of which no fault has begun.
    pub fn new(scenario: &'a Scenario) -> Self {
        Self {
            scenario,
            stages: vec![FaultStage::Pending; scenario.faults.len()],
            struck: vec![false; scenario.vehicles.len()],
        }
    }

    /// Whether a fault has struck the vehicle.
    pub fn was_struck(&self, vehicle: usize) -> bool {
        self.struck[vehicle]
    }

    /// Whether every fault is over, or acts and has no end.
    pub fn has_no_change_left(&self) -> bool {
        let ends = |fault: &Fault| fault.duration_s.is_some();
        let mut pairs = self.scenario.faults.iter().zip(&self.stages);
        pairs.all(|(fault, stage)| {
            *stage == FaultStage::Ended || (*stage == FaultStage::Active && !ends(fault))
        })
    }

    /// Begins and ends the faults that are due at `now_us`, and logs each.
    pub fn step(
        &mut self,
        now_us: u64,
        world: &mut FaultTargets<'_>,
        log: &mut Vec<LogEvent>,
    ) -> anyhow::Result<()> {
        let t_s = (now_us as f64 * 1e-6) as f32;
        for (fault, stage) in self.scenario.faults.iter().zip(&mut self.stages) {
            let ends_s = fault.duration_s.map_or(f32::INFINITY, |lasts_s| fault.at_s + lasts_s);
            let next = match *stage {
                FaultStage::Pending if t_s >= fault.at_s => FaultStage::Active,
                FaultStage::Active if t_s >= ends_s => FaultStage::Ended,
                _ => continue,
            };
            *stage = next;
            if let (FAULT_OBSTACLE, Some(place), Some(radius_m)) =
                (fault.kind, fault.obstacle_position, fault.obstacle_radius_m)
            {
                let done = if next == FaultStage::Active {
                    world.obstacles.push((place, radius_m));
                    let centre = enu_to_geodetic(&self.scenario.map.origin, &place);
                    world.ground_station.report_obstacle(centre, radius_m);
                    "begins"
                } else {
                    world.obstacles.retain(|obstacle| *obstacle != (place, radius_m));
                    "ends"
                };
                let text = format!("fault {done}: {}", fault.kind);
                log.push(LogEvent { t_s, vehicle: None, level: Level::Warning, text });
                continue;
            }
            for (i, vehicle) in self.scenario.vehicles.iter().enumerate() {
                if !fault.strikes(vehicle) {
                    continue;
                }
                let done = if next == FaultStage::Active {
                    self.struck[i] = true;
                    begin_fault(fault, i, now_us, world)?;
                    "begins"
                } else {
                    end_fault(
                        fault,
                        i,
                        now_us,
                        world,
                        f64::from(self.scenario.simulation.serial_corruption_per_byte),
                    );
                    "ends"
                };
                let text = format!("fault {done}: {}", fault.kind);
                log.push(LogEvent { t_s, vehicle: Some(vehicle.id), level: Level::Warning, text });
            }
        }
        Ok(())
    }
}

/// Begins a fault on vehicle `i`.
fn begin_fault(
    fault: &Fault,
    i: usize,
    now_us: u64,
    world: &mut FaultTargets<'_>,
) -> anyhow::Result<()> {
    let vehicle = &mut world.vehicles[i];
    let until_us = now_us + (fault.duration_s.unwrap_or(DEFAULT_STALL_OR_BOOT_S) * 1e6) as u64;
    match fault.kind {
        "kill" => {
            world.radio.set_outage(i, RadioOutage { tx_failed: true, rx_failed: true });
            vehicle.cut_power();
        }
        "radio-cut" => {
            let way = fault.radio_cut_direction.as_deref().unwrap_or("both");
            world
                .radio
                .set_outage(i, RadioOutage { tx_failed: way != "rx", rx_failed: way != "tx" });
        }
        "serial-stall" => vehicle.stall_serial(until_us),
        "serial-corrupt" => vehicle.set_serial_corruption(CORRUPTED_SHARE),
        "position-jump" => {
            vehicle
                .autopilot
                .jump_estimated_position(&fault.offset_m.unwrap_or(DEFAULT_POSITION_JUMP_M));
        }
        "origin-change" => {
            vehicle.autopilot.move_ekf_origin(&fault.offset_m.unwrap_or(DEFAULT_ORIGIN_CHANGE_M));
        }
        "gps-loss" => vehicle.autopilot.set_gps_fix(GpsFix::Lost),
        "battery-low" => vehicle.autopilot.set_battery(BATTERY_LEFT_SHARE),
        "pilot-takeover" => vehicle.autopilot.take_over_by_pilot(),
        "pilot-return" => return_from_pilot(i, now_us, world),
        "autopilot-reboot" => vehicle.reboot_autopilot(until_us),
        "companion-reset" => vehicle.reset_companion(now_us)?,
        "late-plan" => vehicle.plan_answer = PlanAnswer::Withheld,
        "bad-roadmap" => vehicle.plan_answer = PlanAnswer::BadRoadmap,
        "pause-order" => world.ground_station.set_command(now_us, i, OperatorCommand::Pause),
        "return-order" => world.ground_station.set_command(now_us, i, OperatorCommand::Return),
        "land-order" => world.ground_station.set_command(now_us, i, OperatorCommand::Land),
        kind => anyhow::bail!("no fault of this kind can be played: {kind}"),
    }
    Ok(())
}

/// Ends a fault on vehicle `i`; `corruption` is the scenario's share of corrupted serial bytes.
fn end_fault(fault: &Fault, i: usize, now_us: u64, world: &mut FaultTargets<'_>, corruption: f64) {
    let vehicle = &mut world.vehicles[i];
    match fault.kind {
        "radio-cut" => world.radio.set_outage(i, RadioOutage::default()),
        "serial-corrupt" => vehicle.set_serial_corruption(corruption),
        "position-jump" => {
            vehicle
                .autopilot
                .jump_estimated_position(&-fault.offset_m.unwrap_or(DEFAULT_POSITION_JUMP_M));
        }
        "origin-change" => {
            vehicle.autopilot.move_ekf_origin(&-fault.offset_m.unwrap_or(DEFAULT_ORIGIN_CHANGE_M));
        }
        "gps-loss" => vehicle.autopilot.set_gps_fix(GpsFix::Held),
        "pilot-takeover" => return_from_pilot(i, now_us, world),
        "late-plan" | "bad-roadmap" => vehicle.plan_answer = PlanAnswer::Correct,
        "pause-order" => world.ground_station.set_command(now_us, i, OperatorCommand::Resume),
        // All other faults end by themselves or never.
        _ => {}
    }
}

/// The pilot gives vehicle `i` back, and the ground station commands its companion to continue.
fn return_from_pilot(i: usize, now_us: u64, world: &mut FaultTargets<'_>) {
    world.vehicles[i].autopilot.return_from_pilot();
    world.ground_station.set_command(now_us, i, OperatorCommand::Resume);
}

#[cfg(test)]
mod tests;
