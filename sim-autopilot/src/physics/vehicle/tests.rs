use super::*;

pub(crate) const GAINS: Gains = Gains {
    position: [0.95, 1.0],
    velocity_p: [1.8, 4.0],
    velocity_i: [0.4, 2.0],
    velocity_d: [0.2, 0.0],
    tilt_max_tan: 1.0,
    heading_rate_max: 1.0,
};
const NONE: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);
const DT: f32 = 0.004;

fn demand() -> Demand {
    Demand {
        position: NONE,
        velocity: NONE,
        acceleration: NONE,
        heading: 0.0,
        heading_rate: 0.0,
        speed_max: 12.0,
        climb_max: 3.0,
        descend_max: 1.5,
        lift_off_acceleration: f32::NAN,
        min_thrust_per_weight: 0.15,
        height_rate_weight: 0.0,
    }
}

fn fly(vehicle: &mut Multicopter, demand: &Demand, wind: Point, seconds: f32) -> (f32, f32) {
    let (mut fastest, mut worst_jerk) = (0.0_f32, 0.0_f32);
    for _ in 0..(seconds / DT) as usize {
        let (p, v, before) =
            (vehicle.state().position, vehicle.state().velocity, vehicle.thrust_minus_gravity);
        vehicle.control(demand, &GAINS, &p, &v, DT);
        vehicle.advance(MotorState::Lifting, &wind, 0.0, DT);
        fastest = fastest.max(vehicle.state().velocity.norm());
        worst_jerk = worst_jerk.max((vehicle.thrust_minus_gravity - before).norm() / DT);
    }
    (fastest, worst_jerk)
}

fn airborne() -> Multicopter {
    Multicopter::new(AirframeParameters::default(), Point::new(0.0, 0.0, 5.0))
}

#[test]
fn a_position_step_of_ten_metres_settles_as_the_recording_did() {
    let mut v = airborne();
    let d = Demand { position: Point::new(10.0, 0.0, 5.0), ..demand() };
    let (fastest, _) = fly(&mut v, &d, Point::zeros(), 4.0);
    // PX4 SITL: 4.8 m/s at most, 10.4 m after four seconds.
    assert!((4.0..6.0).contains(&fastest), "fastest {fastest}");
    assert!((9.5..11.0).contains(&v.state().position.x), "at {}", v.state().position);
    fly(&mut v, &d, Point::zeros(), 20.0);
    assert!((v.state().position - d.position).norm() < 0.05, "at {}", v.state().position);
}

#[test]
fn velocity_is_tracked_loosely() {
    let mut v = airborne();
    let d = Demand { velocity: Point::new(0.0, 2.0, 0.0), ..demand() };
    fly(&mut v, &d, Point::zeros(), 4.0);
    let flown = v.state().velocity.y;
    assert!((1.6..1.95).contains(&flown), "2 m/s asked, {flown} flown");
}

#[test]
fn wind_is_held_against() {
    let mut v = airborne();
    let d = Demand { position: Point::new(0.0, 0.0, 5.0), ..demand() };
    fly(&mut v, &d, Point::new(8.0, 0.0, 0.0), 30.0);
    assert!(v.state().position.x.abs() < 0.1, "blown to {}", v.state().position);
}

#[test]
fn jerk_and_speed_limits_hold() {
    let mut v = airborne();
    let d = Demand { position: Point::new(-300.0, 0.0, 5.0), speed_max: 4.0, ..demand() };
    let (fastest, jerk) = fly(&mut v, &d, Point::zeros(), 15.0);
    assert!(fastest < 4.4, "fastest {fastest}");
    assert!(jerk <= AirframeParameters::default().jerk_max_mps3 * 1.001, "jerk {jerk}");
}

#[test]
fn it_falls_without_lift_and_rests_on_the_ground() {
    let mut v = airborne();
    for _ in 0..2000 {
        v.advance(MotorState::Idle, &Point::zeros(), 1.0, DT);
    }
    let radius = AirframeParameters::default().radius_m;
    assert_eq!(v.state().position.z, 1.0 + radius);
    assert!(v.state().touching && v.state().velocity == Point::zeros());
}

#[test]
fn a_parked_vehicle_is_not_blown_away() {
    let mut v = Multicopter::new(AirframeParameters::default(), Point::new(1.0, 2.0, 0.3));
    for _ in 0..500 {
        v.advance(MotorState::Idle, &Point::new(15.0, 0.0, 0.0), 0.0, DT);
    }
    assert_eq!(v.state().position, Point::new(1.0, 2.0, 0.3));
}

#[test]
fn hovering_drains_the_battery_in_its_endurance() {
    let mut v = airborne();
    let d = Demand { position: Point::new(0.0, 0.0, 5.0), ..demand() };
    fly(&mut v, &d, Point::zeros(), 12.0);
    let used = 1.0 - v.state().battery;
    assert!((0.0095..0.0115).contains(&used), "12 of 1200 s used {used}");
}
