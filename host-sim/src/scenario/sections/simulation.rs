//! Reads the tables of how a mission is flown: deconfliction, simulation, faults.

use companion::config::SAFETY_DISTANCE_M;
use planner_core::Point;
use planner_core::track::deconflict::Method;

use super::values::{MAX_VEHICLE_ID, read_point};
use crate::scenario::error::ScenarioError;
use crate::scenario::reader::{Result, Table, TomlValue};
use crate::scenario::types::{
    Deconfliction, FAULT_OBSTACLE, Fault, PositionErrors, Simulation, VEHICLE_FAULT_KINDS,
};

/// Most obstacles that a companion keeps: `MAX_OBSTACLES` of companion/src/replanning/obstacles.rs.
const MAX_KNOWN_OBSTACLES: usize = 16;
/// Greatest radius of an obstacle that companions accept, metres: `MAX_OBSTACLE_RADIUS_M` of
/// companion/src/replanning/obstacles.rs.
const MAX_REPORTED_RADIUS_M: f32 = 20.0;

/// Reads `[deconfliction]`. The default of `separation_m` is the safety distance plus
/// `pair_error_m`, by which two vehicles together deviate from their paths, metres.
pub(super) fn read_deconfliction(table: &Table<'_>, pair_error_m: f32) -> Result<Deconfliction> {
    let methods =
        [("priority", Method::Priority), ("algorithm2", Method::Algorithm2), ("off", Method::Off)];
    let method = table.one_of("method", Method::Priority, &methods)?;
    // A safety distance of 0 is refused by companions.
    let safety_distance_m = table.f32("safety_distance_m", SAFETY_DISTANCE_M, 0.01..=1000.0)?;
    let separation_m = table.f32(
        "separation_m",
        safety_distance_m + pair_error_m,
        f64::from(safety_distance_m)..=1000.0,
    )?;
    let deconfliction = Deconfliction { method, safety_distance_m, separation_m };
    table.refuse_unknown_keys()?;
    Ok(deconfliction)
}

/// Reads `[simulation]`; `limit_s` is the default of `time_limit_s`, seconds.
pub(super) fn read_simulation(table: &Table<'_>, limit_s: f32) -> Result<Simulation> {
    let simulation = Simulation {
        mean_wind_mps: table.f32("wind_mps", 0.0, 0.0..=50.0)?,
        gust_peak_mps: table.f32("gust_mps", 0.0, 0.0..=50.0)?,
        position_noise_sd_m: table.f32("position_noise_m", 0.0, 0.0..=100.0)?,
        estimator: table.one_of(
            "estimator",
            PositionErrors::Rtk,
            &[("rtk", PositionErrors::Rtk), ("recorded", PositionErrors::Recorded)],
        )?,
        serial_baud: table.integer_in_range("serial_baud", 921_600, 1200..=100_000_000)? as u32,
        serial_corruption_per_byte: table.f32("serial_corruption", 0.0, 0.0..=1.0)?,
        radio_loss: table.f32("radio_loss", 0.0, 0.0..=1.0)?,
        radio_delay_s: table.f32("radio_delay_s", 0.05, 0.0..=60.0)?,
        radio_range_m: table.f32("radio_range_m", 500.0, 0.0..=1e6)?,
        time_limit_s: table.f32("time_limit_s", limit_s, 0.1..=1e6)?,
    };
    table.refuse_unknown_keys()?;
    Ok(simulation)
}

/// Reads one of `[[faults]]`; its vehicle, if given, must be among `ids`.
pub(super) fn read_fault(table: &Table<'_>, ids: &[u8]) -> Result<Fault> {
    let words: Vec<(&str, &'static str)> =
        VEHICLE_FAULT_KINDS.iter().chain([&FAULT_OBSTACLE]).map(|&kind| (kind, kind)).collect();
    let kind = table.required("kind", "what happens, for example \"kill\"")?.one_of(&words)?;
    let at_s = table.required("at_s", "when it strikes, in seconds")?.f64(&(0.0..=1e6))? as f32;
    let vehicle = table.get("vehicle");
    if let Some(value) = &vehicle
        && !ids.contains(&(value.integer_in_range(1..=MAX_VEHICLE_ID)? as u8))
    {
        return Err(value.error("is no vehicle's id"));
    }
    let vehicle =
        vehicle.map(|v| v.integer_in_range(1..=MAX_VEHICLE_ID).map(|id| id as u8)).transpose()?;
    let direction =
        table.get("direction").map(|v| v.one_of(&[("tx", "tx"), ("rx", "rx"), ("both", "both")]));
    let fault = Fault {
        at_s,
        duration_s: table.optional_f32("duration_s", 0.0..=1e6)?,
        vehicle,
        kind,
        radio_cut_direction: direction.transpose()?.map(str::to_owned),
        offset_m: table.get("offset_m").map(|v| read_point(&v)).transpose()?,
        obstacle_position: table.get("position").map(|v| read_point(&v)).transpose()?,
        obstacle_radius_m: read_obstacle_radius(table)?,
    };
    table.refuse_unknown_keys()?;
    if fault.kind == FAULT_OBSTACLE
        && (fault.obstacle_position.is_none() || fault.obstacle_radius_m.is_none())
    {
        return Err(table
            .text
            .error(&table.span, "a fault of kind \"obstacle\" needs position and radius_m"));
    }
    Ok(fault)
}

/// Reads the radius of an obstacle, metres, which companions accept up to
/// [`MAX_REPORTED_RADIUS_M`]; `None` if it is not given.
fn read_obstacle_radius(table: &Table<'_>) -> Result<Option<f32>> {
    let hint = "companions take obstacles of up to 20 m: give several in place of a larger one";
    table
        .optional_f32("radius_m", 0.001..=f64::from(MAX_REPORTED_RADIUS_M))
        .map_err(|error| ScenarioError { hint: Some(hint.to_owned()), ..error })
}

/// Refuses more obstacles than a companion keeps; `items` are the faults in the scenario. An
/// obstacle that appears where one was, no larger, is the same to a companion: it takes no place.
pub(super) fn check_obstacle_count(faults: &[Fault], items: &[TomlValue<'_>]) -> Result<()> {
    let obstacle = |(index, fault): (usize, &Fault)| {
        Some((index, fault.at_s, fault.obstacle_position?, fault.obstacle_radius_m?))
            .filter(|_| fault.kind == FAULT_OBSTACLE)
    };
    let mut appearing: Vec<_> = faults.iter().enumerate().filter_map(obstacle).collect();
    appearing.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut known: Vec<(usize, Point, f32)> = Vec::new();
    for (index, _, place, radius_m) in appearing {
        if !known.iter().any(|(_, centre, known_m)| *centre == place && *known_m >= radius_m) {
            known.push((index, place, radius_m));
        }
    }
    let Some((first_lost, ..)) = known.get(MAX_KNOWN_OBSTACLES) else { return Ok(()) };
    let fault = &items[*first_lost];
    let why =
        format!("faults holds {} obstacles; a companion keeps {MAX_KNOWN_OBSTACLES}", known.len());
    let hint = "leave this one out, or give fewer and larger ones";
    Err(fault.text.error_with_hint(&fault.span, why, hint))
}

#[cfg(test)]
mod tests;
