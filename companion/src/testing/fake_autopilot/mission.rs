//! The mission of the test bench: one vehicle, or two, from a pad around a corner to a goal higher
//! up.

use planner_core::Point;
use planner_core::flight::{
    HeadingMode, Path, PicturePlan, Task, Trigger, VehiclePlan, WaypointRange,
};
use planner_core::geo::frames::Geodetic;
use planner_core::track::deconflict::Method;

use super::Plan;
use crate::planner::coverage::OPEN_FIELD_CLEARANCE_M;
use crate::{Config, RosterEntry};

/// Origin of the mission frame.
pub(crate) const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
/// EKF origin 300 m from the mission's origin and 20 m above it: code that confuses the two frames
/// flies into the ground.
pub(crate) const EKF_ORIGIN: Geodetic =
    Geodetic { lat_deg: 40.3350, lon_deg: -3.7640, alt_m: 720.0 };
/// System id of the vehicle.
pub(crate) const SYSTEM: u8 = 42;
/// Beginning of the vehicle's path, ENU metres.
pub(crate) const START: Point = Point::new(8.0, 12.0, 1.5);
/// End of the vehicle's path, ENU metres.
pub(crate) const GOAL: Point = Point::new(16.0, 12.0, 3.5);

/// Settings of a vehicle alone.
pub(crate) fn config() -> Config<4> {
    let mut config = Config::new(SYSTEM, START, ORIGIN);
    config.method = Method::Priority;
    config.mission_crc = 0xC0FFEE;
    config
}

/// Settings with vehicle 77 in the roster too.
pub(crate) fn two_vehicles() -> Config<4> {
    let mut config = config();
    config
        .roster
        .push(RosterEntry { system_id: 77, path_start: Point::new(8.0, 20.0, 1.5) })
        .unwrap();
    config
}

/// A plan from [`START`] to [`GOAL`].
pub(crate) fn plan() -> Plan {
    let mut path = Path::new();
    for point in [START, Point::new(16.0, 12.0, 1.5), GOAL] {
        path.push(point, 1.2).unwrap();
    }
    let gates = heapless::Vec::new();
    VehiclePlan {
        task: Task::Goto(0),
        path,
        climb_m: 1.5,
        descent_m: 3.5,
        depart_s: 0.0,
        gates,
        swarm_plan_crc: 5,
    }
}

/// The plan of a coverage mission with a single picture: to the layer, out, back, and down to the
/// pad.
pub(crate) fn field_plan() -> Plan {
    let mut path = Path::new();
    for point in [
        START,
        Point::new(10.0, 12.0, 1.5),
        Point::new(13.0, 12.0, 1.5),
        Point::new(16.0, 12.0, 1.5),
        GOAL,
        Point::new(START.x, START.y, GOAL.z),
        START,
    ] {
        path.push(point, OPEN_FIELD_CLEARANCE_M).unwrap();
    }
    let mut photographs = PicturePlan::new(2.0, HeadingMode::Ahead, Trigger::Distance);
    // A single picture, so that the stretch gives no heading.
    photographs.add_stretch(1, 1, WaypointRange { first: 0, end: 1 }).unwrap();
    VehiclePlan { task: Task::Photograph(photographs), path, descent_m: 1.5, ..plan() }
}

/// The plan with its path `up_m` metres higher; its pads stay.
pub(crate) fn raised(plan: Plan, up_m: f32) -> Plan {
    let mut path = Path::new();
    for waypoint in plan.path.waypoints() {
        path.push(waypoint.position + Point::new(0.0, 0.0, up_m), waypoint.leg_clearance_m)
            .unwrap();
    }
    VehiclePlan { path, climb_m: plan.climb_m + up_m, descent_m: plan.descent_m + up_m, ..plan }
}
