//! Makes the vehicles of a simulation: for each vehicle of the scenario a simulated autopilot and
//! the settings of its companion.

use companion::Config;
use companion::config::REACHES_ALL_M;
use planner_core::Point;
use planner_core::coverage::flights::PLANNED_ACCEL_MPS2;
use planner_core::geo::frames::enu_to_geodetic;
use sim_autopilot as autopilot;

use super::board::RemoteCompanion;
use super::serial::SimulatedSerialConfig;
use super::simulated_vehicle::SimulatedVehicle;
use crate::capacity::MAX_VEHICLES;
use crate::flash::HostFlash;
use crate::mission::PreparedMission;
use crate::scenario::{AutopilotKind, CompanionHost, PositionErrors, VehicleSection};

/// Least radio range that a companion's settings may have, metres.
const MIN_RADIO_RANGE_M: f32 = 1.0;

/// The vehicles of a mission on their pads, in the order of the scenario.
///
/// # Errors
/// Names the vehicle's setting that is wrong.
pub fn vehicles_on_pads(mission: &PreparedMission) -> anyhow::Result<Vec<SimulatedVehicle>> {
    let scenario = &mission.scenario;
    let settings = &scenario.simulation;
    let serial = SimulatedSerialConfig {
        baud: settings.serial_baud,
        latency_s: 0.001,
        corruption_per_byte: f64::from(settings.serial_corruption_per_byte),
        transmit_buffer_len: 4096,
    };
    scenario
        .vehicles
        .iter()
        .zip(&mission.tasks)
        .map(|(vehicle, task)| {
            let config = autopilot_config(mission, vehicle, task.climb_m);
            let companion = companion_config(mission, vehicle.id)?;
            let mut simulated = SimulatedVehicle::new(&config, companion, serial, scenario.seed)?;
            simulated.autopilot.set_land_on_offboard_loss();
            match &vehicle.companion {
                CompanionHost::InProcess { flash: None } => {}
                CompanionHost::InProcess { flash: Some(file) } => {
                    simulated.attach_flash(HostFlash::open(Some(file))?)?;
                }
                CompanionHost::Url { autopilot, radio } => {
                    simulated.attach_board(RemoteCompanion::open(autopilot, radio.as_ref())?);
                }
                CompanionHost::Emulated { program, log } => {
                    let (roadmap, file) = (&mission.roadmap_or_field_file, &mission.mission_file);
                    simulated.attach_board(RemoteCompanion::emulate(program, log, roadmap, file)?);
                }
            }
            Ok(simulated)
        })
        .collect()
}

/// The settings of a vehicle's autopilot; the vehicle's path begins `climb_m` above its pad.
fn autopilot_config(
    mission: &PreparedMission,
    vehicle: &VehicleSection,
    climb_m: f32,
) -> autopilot::AutopilotConfig {
    let scenario = &mission.scenario;
    let settings = &scenario.simulation;
    let pad = vehicle.start - Point::new(0.0, 0.0, climb_m);
    let airframe = autopilot::AirframeParameters {
        radius_m: vehicle.radius_m,
        speed_max_mps: vehicle.speed_max_mps,
        endurance_s: vehicle.battery_hover_s(),
        ..autopilot::AirframeParameters::default()
    };
    let mut config = autopilot::AutopilotConfig {
        system_id: vehicle.id,
        autopilot: simulated_kind(vehicle.autopilot),
        world_origin: scenario.map.origin,
        // The EKF origin is where the autopilot was switched on, unless the scenario says
        // otherwise: no two vehicles share it.
        ekf_origin: vehicle
            .ekf_origin
            .unwrap_or_else(|| enu_to_geodetic(&scenario.map.origin, &pad)),
        home: vehicle.home,
        start: pad,
        vehicle: airframe,
        wind: Point::new(settings.mean_wind_mps, 0.0, 0.0),
        gust_peak_mps: settings.gust_peak_mps,
        position_noise_m: settings.position_noise_sd_m,
        estimator: estimator_errors(settings.estimator),
        seed: scenario.seed,
        ..autopilot::AutopilotConfig::default()
    };
    if vehicle.ekf_origin.is_none() {
        // The GNSS receiver set this origin, so it has the receiver's height error.
        config.ekf_origin.alt_m += f64::from(config.height_error_m());
    }
    config
}

/// The simulated autopilot of a kind.
pub fn simulated_kind(kind: AutopilotKind) -> autopilot::SimulatedKind {
    match kind {
        AutopilotKind::Px4 => autopilot::SimulatedKind::Px4,
        AutopilotKind::ArduPilot => autopilot::SimulatedKind::Ardupilot,
    }
}

/// The simulated autopilot's errors of a scenario's error model.
fn estimator_errors(errors: PositionErrors) -> autopilot::EstimatorErrors {
    match errors {
        PositionErrors::Perfect => autopilot::EstimatorErrors::Perfect,
        PositionErrors::Rtk => autopilot::EstimatorErrors::Rtk,
        PositionErrors::Recorded => autopilot::EstimatorErrors::Recorded,
    }
}

/// Settings of one vehicle's companion: those of the mission file, with the scenario's fence,
/// method and radio range; the same in a swarm simulation and for a companion alone.
pub fn companion_config(mission: &PreparedMission, id: u8) -> anyhow::Result<Config<MAX_VEHICLES>> {
    mission.index_of(id)?;
    let config = mission.mission_view().companion_config(id);
    let config =
        config.map_err(|e| anyhow::anyhow!("no companion: {}: {e}", mission.scenario.path))?;
    // The same plan may be flown by another method and inside another fence than its mission file
    // has.
    let scenario = &mission.scenario;
    let geofence = scenario.mission.geofence.as_ref().map(|fence| (fence.min, fence.max));
    // The operator sets this radio range.
    let radio_range_m = match scenario.has_short_radio() {
        true => scenario.simulation.radio_range_m.max(MIN_RADIO_RANGE_M),
        false => REACHES_ALL_M,
    };
    let method = scenario.deconfliction.method;
    Ok(Config { accel_mps2: PLANNED_ACCEL_MPS2, method, geofence, radio_range_m, ..config })
}

#[cfg(test)]
mod tests;
