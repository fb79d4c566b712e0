//! Random meetings: which vehicle flies from where to where, by which plan, and what happens to them.

mod happenings;
mod passing;
mod ways;

use companion::autopilot::Kind;
use planner_core::Point;
use planner_core::flight::{Flight, VehiclePlan};
use planner_core::schedule::{self, ScheduleConfig, ScheduleWorkspace};

use self::happenings::happenings;
pub use self::passing::{PASSINGS, passing};
use self::ways::{KINDS, Shape, fits, flight, pads, way};
use super::autopilot::Failsafe;
use super::dice::Dice;

/// Waypoints of a path.
pub const WAYPOINTS: usize = 16;
/// Gates of a plan.
pub const GATES: usize = 128;
/// Vehicles of a meeting, at most.
pub const VEHICLES: usize = 8;
/// Distance between two vehicles' centres that is kept, metres.
pub const SAFETY_M: f32 = 1.5;
/// Speed along paths, m/s.
pub const CRUISE_MPS: f32 = 2.0;
/// Speed of climbs, m/s.
pub const CLIMB_MPS: f32 = 1.0;
/// Missions are started then, seconds.
pub const START_S: f32 = 6.0;
/// A platform reaches this far around its pad, metres.
pub const PLATFORM_M: f32 = 0.7;
/// The schedule of these vehicles, as a mission's.
pub const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: SAFETY_M + 0.5,
    parked_separation_m: SAFETY_M + 0.25,
    cruise_mps: 0.9 * CRUISE_MPS,
    vertical_mps: CLIMB_MPS,
};
/// No vehicle departs later, seconds.
const LATEST_S: f32 = 40.0;

/// A vehicle's plan.
pub type Plan = VehiclePlan<WAYPOINTS, GATES>;

/// One vehicle.
#[derive(Clone, Debug)]
pub struct Vehicle {
    /// System id.
    pub id: u8,
    /// Its autopilot.
    pub kind: Kind,
    /// Where it stands.
    pub pad: Point,
    /// What its planner answers.
    pub plan: Plan,
    /// Shift of its streams.
    pub phase: u64,
    /// What its autopilot does without setpoints.
    pub on_loss: Failsafe,
}

/// Something that happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// MISSION_START.
    Start,
    /// DO_PAUSE_CONTINUE 0.
    Pause,
    /// DO_PAUSE_CONTINUE 1.
    Resume,
    /// NAV_RETURN_TO_LAUNCH.
    Return,
    /// NAV_LAND.
    Land,
    /// The pilot takes over and flies with this velocity.
    PilotTakes(Point),
    /// The pilot gives Offboard or Guided back.
    PilotReturns,
    /// The pilot lands.
    PilotLands,
    /// The autopilot's failsafe.
    Fails(Failsafe),
    /// The companion ends.
    Dies,
    /// Its radio no longer sends, or receives.
    Cut {
        /// Sends nothing.
        sends: bool,
        /// Hears nothing.
        hears: bool,
    },
    /// Its radio works again.
    Healed,
}

/// What happens, when, and to which vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Happening {
    /// Seconds.
    pub at_s: f32,
    /// Index of the vehicle.
    pub vehicle: usize,
    /// What.
    pub what: What,
}

/// How a vehicle's reports are wrong.
#[derive(Clone, Copy, Debug)]
pub enum Lie {
    /// Its position is off by this.
    Position(Point),
    /// Its velocity is off by this.
    Velocity(Point),
    /// It reports no velocity.
    Still,
    /// Its progress is ahead by so many metres.
    Progress(f32),
    /// Its points are off by this.
    Points(Point),
}

/// A meeting.
#[derive(Clone, Debug)]
pub struct Scene {
    /// From which it follows.
    pub seed: u64,
    /// Its geometry.
    pub kind: &'static str,
    /// Whether the vehicles share a plan.
    pub on_plan: bool,
    /// The vehicles.
    pub vehicles: Vec<Vehicle>,
    /// What happens, by time.
    pub happenings: Vec<Happening>,
    /// Least and greatest delay of the radio, seconds.
    pub delay_s: (f32, f32),
    /// Share of frames lost.
    pub loss: f32,
    /// A vehicle whose reports are wrong.
    pub liar: Option<(usize, Lie)>,
}

/// Height of the ground below a place: a platform under each pad and goal that is not on the floor.
pub fn floor_z(vehicles: &[Vehicle], place: &Point) -> f32 {
    let mut floor = 0.0_f32;
    for vehicle in vehicles {
        for pad in [vehicle.pad, landing(&vehicle.plan).unwrap_or(vehicle.pad)] {
            if pad.z > 0.0 && (pad - place).xy().norm() < PLATFORM_M && place.z > pad.z - 0.3 {
                floor = floor.max(pad.z);
            }
        }
    }
    floor
}

/// Where a plan ends, on the ground.
pub fn landing(plan: &Plan) -> Option<Point> {
    plan.path.waypoints().last().map(|w| w.position - Point::new(0.0, 0.0, plan.descent_m))
}

/// The scene of a seed.
pub fn scene(seed: u64) -> Scene {
    // A draw that leaves one vehicle alone is no meeting.
    (0..).find_map(|draw| drawn(seed, draw)).expect("some draw has room for two")
}

fn drawn(seed: u64, draw: u64) -> Option<Scene> {
    let mut dice = Dice::new(seed ^ draw << 48);
    let kind = KINDS[dice.below(KINDS.len())];
    let on_plan = dice.chance(0.6);
    let count = 2 + [0, 0, 0, 1, 1, 2, 3, 4][dice.below(8)];
    let angle = dice.real(0.0, core::f32::consts::TAU);
    let shape = Shape {
        middle: Point::new(12.0, 12.0, 0.0),
        along: Point::new(angle.cos(), angle.sin(), 0.0),
        angle,
        z: dice.real(1.5, 6.0),
    };
    let mut workspace = Box::new(ScheduleWorkspace::new());
    let mut flights: Vec<Flight<WAYPOINTS>> = Vec::new();
    for i in 0..count {
        for _ in 0..40 {
            let way = way(kind, i, &shape, &mut dice);
            let Some(mut next) = flight(i as u8 + 1, &way) else { continue };
            if !fits(&flights, &next) {
                continue;
            }
            if on_plan {
                let earliest =
                    schedule::earliest_departure(&SCHEDULE, &next, 0.0, flights.iter(), &mut workspace);
                let Ok(depart_s) = earliest else { continue };
                if depart_s > LATEST_S {
                    continue;
                }
                next.depart_s = depart_s;
            } else {
                next.depart_s = if dice.chance(0.5) { 0.0 } else { dice.real(0.0, 10.0) };
            }
            flights.push(next);
            break;
        }
    }
    if flights.len() < 2 {
        return None;
    }
    let vehicles = (0..flights.len()).map(|i| vehicle(&flights, i, on_plan, &mut workspace, &mut dice));
    let vehicles: Vec<_> = vehicles.collect();
    let happenings = happenings(&vehicles, &mut dice);
    let delay = if dice.chance(0.5) { dice.real(0.0, 0.15) } else { dice.real(0.0, 0.9) };
    let delay_s = (delay, (delay + dice.real(0.0, 0.3)).min(1.0));
    let loss = if dice.chance(0.5) { 0.0 } else { dice.real(0.0, 0.3) };
    let liar = seed.is_multiple_of(6).then(|| {
        let lie = match dice.below(6) {
            0 | 1 => Lie::Position(dice.direction() * 0.5),
            2 => Lie::Velocity(dice.direction() * 0.5),
            3 => Lie::Still,
            4 => Lie::Progress(dice.real(0.5, 20.0)),
            _ => Lie::Points(dice.direction() * dice.real(0.5, 3.0)),
        };
        (dice.below(vehicles.len()), lie)
    });
    Some(Scene { seed, kind, on_plan, vehicles, happenings, delay_s, loss, liar })
}

fn vehicle(
    flights: &[Flight<WAYPOINTS>],
    i: usize,
    on_plan: bool,
    workspace: &mut ScheduleWorkspace,
    dice: &mut Dice,
) -> Vehicle {
    let flight = &flights[i];
    let mut plan = Plan {
        goal: flight.goal,
        path: flight.path.clone(),
        climb_m: flight.climb_m,
        descent_m: flight.descent_m,
        depart_s: flight.depart_s,
        gates: heapless::Vec::new(),
        plan_crc: if on_plan { 5 } else { 100 + i as u32 },
    };
    if on_plan {
        schedule::gates(&SCHEDULE, flights, i, workspace, &mut plan.gates).expect("few gates");
    }
    Vehicle {
        id: flight.id,
        kind: if dice.chance(0.6) { Kind::Px4 } else { Kind::ArduPilot },
        pad: pads(flight)[0],
        plan,
        phase: dice.bits() % 40,
        on_loss: if dice.chance(0.5) { Failsafe::Land } else { Failsafe::Return },
    }
}
