//! Random meetings: which vehicle flies from where to where, by which plan, and what happens to them.

use companion::autopilot::Kind;
use planner_core::Point;
use planner_core::path::Path;
use planner_core::schedule::{self, Flight, ScheduleConfig, ScheduleWorkspace, VehiclePlan};

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
/// Nobody departs later, seconds.
const LATEST_S: f32 = 40.0;
/// Nobody flies longer, seconds.
const LONGEST_S: f32 = 60.0;

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

/// What happens, when and to whom.
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

const KINDS: [&str; 6] = ["crossing", "shared", "vertical", "beside", "corridor", "random"];

/// A way: ground of the pad, points of the path, ground of the goal.
struct Way {
    pad: Point,
    points: Vec<Point>,
    ground_z: f32,
}

fn at_height(place: Point, z: f32) -> Point {
    Point::new(place.x, place.y, z)
}

/// A way of vehicle `i` of `n` in a geometry whose numbers are in `shape`.
fn way(kind: &str, i: usize, shape: &Shape, dice: &mut Dice) -> Way {
    let up = |dice: &mut Dice| if dice.chance(0.2) { dice.real(1.0, 29.0) } else { dice.real(1.0, 5.0) };
    let (middle, z) = (shape.middle, shape.z);
    match kind {
        "crossing" => {
            let angle = shape.angle + dice.real(0.2, 2.9) * i as f32;
            let (reach, beyond) = (dice.real(4.0, 9.0), dice.real(4.0, 9.0));
            let direction = Point::new(angle.cos(), angle.sin(), 0.0);
            let level = z + dice.real(-0.4, 0.4);
            let from = at_height(middle - direction * reach, level);
            let to = at_height(middle + direction * beyond, level + dice.real(-0.5, 0.5));
            grounded(vec![from, at_height(middle, level), to], dice)
        }
        "shared" => {
            let mut points = vec![middle + Point::new(dice.real(-7.0, -3.0), dice.real(-5.0, 5.0), 0.0)];
            points.extend([middle, middle + shape.along * 7.0]);
            points.push(
                points[2] + Point::new(dice.real(2.0, 6.0), dice.real(-6.0, 6.0), dice.real(-0.5, 2.0)),
            );
            if dice.chance(0.25) {
                points.reverse();
            }
            points.iter_mut().for_each(|p| p.z = p.z.max(1.0) + 0.0);
            grounded(points, dice)
        }
        "vertical" => {
            // Above one another's pads and goals.
            let here = middle + Point::new(dice.real(-0.8, 0.8), dice.real(-0.8, 0.8), 0.0);
            let away = middle + Point::new(dice.real(-9.0, 9.0), dice.real(-9.0, 9.0), 0.0);
            let (low, high) = (up(dice), up(dice));
            let beside =
                |p: Point, dice: &mut Dice| p + Point::new(dice.real(2.0, 4.0), dice.real(2.0, 4.0), 0.0);
            match i % 3 {
                0 => grounded(vec![at_height(here, low), at_height(away, low + dice.real(-0.5, 2.0))], dice),
                1 => grounded(vec![at_height(away, high), at_height(here, high)], dice),
                _ => grounded(
                    vec![at_height(away, high), at_height(here, high), at_height(beside(here, dice), high)],
                    dice,
                ),
            }
        }
        "beside" => {
            // A path, and pads close to it.
            let across = Point::new(-shape.along.y, shape.along.x, 0.0);
            let line =
                |along: f32, off: f32, z: f32| at_height(middle + shape.along * along + across * off, z);
            if i == 0 {
                grounded(vec![line(-8.0, 0.0, z), line(8.0, 0.0, z)], dice)
            } else {
                let off = dice.real(1.6, 3.0) * if dice.chance(0.5) { 1.0 } else { -1.0 };
                let (along, top) = (dice.real(-5.0, 5.0), z + dice.real(-1.0, 3.0));
                let to = line(along + dice.real(-4.0, 4.0), off + off.signum() * dice.real(3.0, 8.0), top);
                let mut points = vec![line(along, off, top.max(1.0)), to];
                if dice.chance(0.5) {
                    points.reverse();
                }
                grounded(points, dice)
            }
        }
        "corridor" => {
            let along = shape.along;
            let end = dice.real(5.0, 9.0);
            let mut points = vec![
                at_height(
                    middle - along * end + Point::new(dice.real(-4.0, 4.0), dice.real(-4.0, 4.0), 0.0),
                    z,
                ),
                at_height(middle - along * 4.0, z),
                at_height(middle + along * 4.0, z),
                at_height(
                    middle + along * end + Point::new(dice.real(-4.0, 4.0), dice.real(-4.0, 4.0), 0.0),
                    z,
                ),
            ];
            if i % 2 == 1 {
                points.reverse();
            }
            grounded(points, dice)
        }
        _ => {
            let count = 2 + dice.below(3);
            let low = Point::new(middle.x - 8.0, middle.y - 8.0, 1.0);
            let high = Point::new(middle.x + 8.0, middle.y + 8.0, 6.0);
            grounded((0..count).map(|_| dice.point(low, high)).collect(), dice)
        }
    }
}

/// Puts pads under a path: mostly on the floor, some on a platform.
fn grounded(mut points: Vec<Point>, dice: &mut Dice) -> Way {
    points.iter_mut().for_each(|p| p.z = p.z.max(0.8));
    let mut ground = |top: f32| {
        let most = (top - 0.8).max(0.0);
        if dice.chance(0.2) { dice.real(0.0, most) } else { 0.0 }
    };
    let (first, last) = (points[0], points[points.len() - 1]);
    Way { pad: at_height(first, ground(first.z)), ground_z: ground(last.z), points }
}

struct Shape {
    middle: Point,
    along: Point,
    angle: f32,
    z: f32,
}

fn flight(id: u8, way: &Way) -> Option<Flight<WAYPOINTS>> {
    let mut path = Path::new();
    for point in &way.points {
        path.push(*point, 2.0).ok()?;
    }
    let first = way.points.first()?;
    let climb_m = first.z - way.pad.z;
    path.label(climb_m / SCHEDULE.vertical_mps, SCHEDULE.cruise_mps);
    let descent_m = way.points.last()?.z - way.ground_z;
    let length_s = path.length_m() / SCHEDULE.cruise_mps + climb_m + descent_m;
    (path.length_m() > 2.0 && climb_m > 0.5 && descent_m > 0.5 && length_s < LONGEST_S).then_some(Flight {
        id,
        goal: Some(u16::from(id)),
        path,
        climb_m,
        descent_m,
        depart_s: 0.0,
        piece_m: schedule::PIECE_M,
    })
}

fn pads(flight: &Flight<WAYPOINTS>) -> [Point; 2] {
    let down = |length| Point::new(0.0, 0.0, length);
    let points = flight.path.waypoints();
    [points[0].position - down(flight.climb_m), points[points.len() - 1].position - down(flight.descent_m)]
}

/// Whether the flights leave one another's platforms room, and their pads lie apart.
fn fits(flights: &[Flight<WAYPOINTS>], next: &Flight<WAYPOINTS>) -> bool {
    let own = pads(next);
    let over = |pads: &[Point; 2], path: &Path<WAYPOINTS>| {
        let steps = (path.length_m() / 0.3) as usize;
        path.points_from(0.0, 0.3)
            .take(steps + 1)
            .any(|p| pads.iter().any(|pad| (pad - p).xy().norm() < 1.2 && p.z < pad.z + 0.7))
    };
    !over(&own, &next.path)
        && flights.iter().all(|other| {
            let theirs = pads(other);
            let apart = own.iter().zip(&theirs).all(|(a, b)| {
                (a - b).norm() > SAFETY_M + 0.5 && ((a - b).xy().norm() > 1.6 || (a.z - b.z).abs() < 0.1)
            });
            let crossed = (own[0] - theirs[1]).norm().min((own[1] - theirs[0]).norm()) > SAFETY_M + 0.3;
            apart && crossed && !over(&theirs, &next.path) && !over(&own, &other.path)
        })
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

/// How two vehicles pass in [`passing`].
pub const PASSINGS: [&str; 6] = ["opposite", "alongside", "overhead", "climb beside", "crossing", "lane"];

/// Two vehicles of one plan that pass at exactly the separation of the schedule, or one after the other; nothing else happens.
/// The radio loses 30 % and takes 0.3 s.
pub fn passing(seed: u64) -> Scene {
    let mut dice = Dice::new(seed ^ 0xFA15E);
    let kind = PASSINGS[seed as usize % PASSINGS.len()];
    let angle = dice.real(0.0, core::f32::consts::TAU);
    let along = Point::new(angle.cos(), angle.sin(), 0.0);
    let across = Point::new(-along.y, along.x, 0.0);
    let z = dice.real(1.5, 5.0);
    // What is a hair nearer would get a gate.
    let apart_m = SCHEDULE.separation_m + 1e-3;
    let place = |x: f32, y: f32, z: f32| at_height(Point::new(12.0, 12.0, 0.0) + along * x + across * y, z);
    let (a, b) = (dice.real(5.0, 9.0), dice.real(5.0, 9.0));
    let first = vec![place(-a, 0.0, z), place(b, 0.0, z)];
    let second = match kind {
        "opposite" => vec![place(b + dice.real(-2.0, 2.0), apart_m, z), place(-a + 1.0, apart_m, z)],
        "alongside" => {
            let shift = dice.real(-2.0, 2.0);
            vec![place(-a + shift, apart_m, z), place(b + shift, apart_m, z)]
        }
        "overhead" => vec![place(0.0, -a, z + apart_m), place(0.0, b, z + apart_m)],
        "climb beside" => {
            let x = dice.real(-2.0, 2.0);
            let mut points = vec![place(x, apart_m, z + dice.real(1.0, 10.0)), place(x, 8.0, z + 2.0)];
            points[1].z = points[0].z;
            if dice.chance(0.5) {
                points.reverse();
            }
            points
        }
        "crossing" => vec![place(0.0, -a, z), place(0.0, b, z)],
        _ => {
            vec![place(-a, 4.0, z), place(-a + 2.0, 0.0, z), place(b - 3.0, 0.0, z), place(b - 3.0, -5.0, z)]
        }
    };
    let mut workspace = Box::new(ScheduleWorkspace::new());
    let mut flights: Vec<Flight<WAYPOINTS>> = Vec::new();
    for (i, points) in [first, second].into_iter().enumerate() {
        let pad = at_height(points[0], 0.0);
        let way = Way { pad, points, ground_z: 0.0 };
        let mut flight = flight(i as u8 + 1, &way).expect("a short flight");
        let departs = schedule::earliest_departure(&SCHEDULE, &flight, 0.0, flights.iter(), &mut workspace);
        flight.depart_s = departs.expect("room for two");
        flights.push(flight);
    }
    let vehicles = (0..2).map(|i| vehicle(&flights, i, true, &mut workspace, &mut dice)).collect();
    let start = |vehicle| Happening { at_s: START_S, vehicle, what: What::Start };
    Scene {
        seed,
        kind,
        on_plan: true,
        vehicles,
        happenings: vec![start(0), start(1)],
        delay_s: (0.3, 0.3),
        loss: 0.3,
        liar: None,
    }
}

/// Starts, and what else happens.
fn happenings(vehicles: &[Vehicle], dice: &mut Dice) -> Vec<Happening> {
    let mut out = Vec::new();
    let mut ended = vec![false; vehicles.len()];
    for vehicle in 0..vehicles.len() {
        out.push(Happening { at_s: START_S, vehicle, what: What::Start });
        out.push(Happening { at_s: START_S + 1.5, vehicle, what: What::Start });
    }
    let events = [0, 1, 1, 1, 2, 2, 3][dice.below(7)];
    let mut busy_until = vec![START_S + 2.0; vehicles.len()];
    for _ in 0..events {
        let vehicle = dice.below(vehicles.len());
        if ended[vehicle] {
            continue;
        }
        let at_s = busy_until[vehicle].max(START_S + dice.real(2.0, 40.0));
        let lasts_s = dice.real(1.0, 20.0);
        let until = at_s + lasts_s;
        let mut push = |at_s, what| out.push(Happening { at_s, vehicle, what });
        let how = if dice.chance(0.5) { Failsafe::Land } else { Failsafe::Return };
        match dice.below(10) {
            0 | 1 => {
                push(at_s, What::Pause);
                match dice.below(4) {
                    0 => push(until, What::Return),
                    1 => push(until, What::Land),
                    _ => {
                        push(until, What::Resume);
                        push(until + 3.0, What::Resume);
                    }
                }
                // A command that is refused then comes again.
                push(at_s + 40.0, What::Resume);
            }
            2 => push(at_s, What::Return),
            3 => push(at_s, What::Land),
            4 | 5 => {
                let mut velocity = dice.direction() * dice.real(0.0, 1.5);
                velocity.z *= 0.5;
                push(at_s, What::PilotTakes(velocity));
                if dice.chance(0.5) {
                    push(at_s + 0.5 * lasts_s, What::PilotTakes(Point::zeros()));
                    push(until, What::PilotReturns);
                    (1..5).for_each(|i| push(until + 1.5 * i as f32, What::Resume));
                    // A vehicle that cannot go on is landed.
                    push(until + 40.0, What::Land);
                } else {
                    push(until, What::PilotLands);
                    ended[vehicle] = true;
                }
            }
            6 => {
                push(at_s, What::Fails(how));
                ended[vehicle] = true;
            }
            7 => {
                push(at_s, What::Dies);
                // An ArduCopter hovers for ever: its pilot lands it.
                push(at_s + 20.0, What::PilotLands);
                ended[vehicle] = true;
            }
            _ => {
                let (sends, hears) = [(true, false), (false, true), (true, true)][dice.below(3)];
                push(at_s, What::Cut { sends, hears });
                if dice.chance(0.7) {
                    push(at_s + dice.real(1.0, 25.0), What::Healed);
                }
            }
        }
        busy_until[vehicle] = until + 8.0;
    }
    out.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    out
}
