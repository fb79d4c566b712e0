//! Random settings and plans of the measured flights.

use companion::{Config, RosterEntry};
use firmware::capacity::{GATES, VEHICLES, WAYPOINTS};
use heapless::Vec;
use planner_core::Point;
use planner_core::flight::{
    Gate, HeadingMode, Path, PicturePlan, Task, Trigger, VehiclePlan, WaypointOrder, WaypointRange,
};
use planner_core::geo::frames::Geodetic;
use rand_pcg::Pcg32;

use crate::cases::{random_below, random_between, random_point};

/// Origin of the mission frame, and EKF origin, of every flight.
pub const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
/// Cruise speed, m/s: so fast that many corners lie within the braking distance of 8 m.
pub const CRUISE_MPS: f32 = 5.0;
pub(super) const OWN_ID: u8 = 1;
pub(super) const MISSION_CRC: u32 = 0xC0FFEE;
pub(super) const PLAN_CRC: u32 = 5;
/// Time after its last message until a lost vehicle is assumed on the ground, seconds.
const LOST_VEHICLE_GROUNDED_AFTER_S: f32 = 60.0;
/// Distance between pictures along a lane, metres.
const PICTURE_SPACING_M: f32 = 1.0;
/// Pictures on one lane.
const PICTURES_PER_LANE: u32 = 4;
/// Pictures of the whole area.
const TOTAL_PICTURES: u32 = 200;

/// Settings of vehicle 1 in the largest swarm that the board holds.
pub fn config() -> Config<VEHICLES> {
    let start = Point::new(0.0, 0.0, 10.0);
    let mut config = Config::new(OWN_ID, start, ORIGIN);
    config.mission_crc = MISSION_CRC;
    config.cruise_mps = CRUISE_MPS;
    for id in 2..=VEHICLES as u8 {
        config
            .roster
            .push(RosterEntry { system_id: id, path_start: start })
            .expect("there is room");
    }
    config
}

/// A random path of 4, 8 or [`WAYPOINTS`] waypoints: legs of 0.2, 1 or 5 m, either nearly straight
/// on or in random directions.
pub fn random_path(rng: &mut Pcg32) -> Path<WAYPOINTS> {
    let leg_m = [0.2, 1.0, 5.0][random_below(rng, 3)];
    let onward = random_point(rng, leg_m);
    let straight = random_below(rng, 2) == 0;
    let mut path = Path::new();
    let mut at = Point::new(0.0, 0.0, 10.0);
    for _ in 0..[4, 8, WAYPOINTS][random_below(rng, 3)] {
        path.push(at, random_between(rng, 0.4, 2.0)).expect("there is room");
        at += if straight {
            onward + random_point(rng, 0.01 * leg_m)
        } else {
            random_point(rng, leg_m)
        };
    }
    path
}

/// A random plan with as many gates as a plan holds.
pub fn random_plan(rng: &mut Pcg32) -> VehiclePlan<WAYPOINTS, GATES> {
    let path = random_path(rng);
    let length_m = path.length_m();
    let mut gates: Vec<_, GATES> = (0..GATES)
        .map(|_| Gate {
            at_m: random_between(rng, 0.0, length_m),
            wait_for_id: 2 + random_below(rng, VEHICLES) as u8,
            open_from_progress_m: random_between(rng, 0.0, 60.0),
        })
        .collect();
    gates.sort_unstable_by(|a, b| a.at_m.total_cmp(&b.at_m));
    VehiclePlan {
        task: Task::Goto(0),
        path,
        climb_m: 1.0,
        descent_m: 1.0,
        depart_s: 0.0,
        gates,
        swarm_plan_crc: PLAN_CRC,
    }
}

/// Settings of a coverage mission whose work is divided again when a vehicle is lost.
pub fn area_config() -> Config<VEHICLES> {
    Config { lost_vehicle_down_after_s: Some(LOST_VEHICLE_GROUNDED_AFTER_S), ..config() }
}

/// A random plan of a coverage mission: every second leg is a lane with pictures.
pub fn random_area_plan(rng: &mut Pcg32) -> VehiclePlan<WAYPOINTS, GATES> {
    let mut plan = random_plan(rng);
    let mut photographs =
        PicturePlan::new(PICTURE_SPACING_M, HeadingMode::Ahead, Trigger::Distance)
            .with_area_waypoints(TOTAL_PICTURES, WaypointOrder::Rising);
    for (lane, from) in (1..plan.path.waypoints().len() - 1).step_by(2).enumerate() {
        let first = PICTURES_PER_LANE * lane as u32;
        photographs
            .add_stretch(from, from + 1, WaypointRange { first, end: first + PICTURES_PER_LANE })
            .expect("there is room");
    }
    plan.task = Task::Photograph(photographs);
    plan
}
