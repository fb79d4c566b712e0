//! The multicopter itself: what its controller demands and how it moves.
//!
//! The controller is the cascade of PX4's `mc_pos_control`: position P, velocity PID (integral with
//! anti-windup, derivative on measured acceleration), and the acceleration it asks for bounded by
//! tilt and thrust. The airframe answers through a jerk limit and a first-order lag (attitude and
//! motors together), and drag towards the wind. Because drag is not fed forward, a velocity asked
//! for is flown 10–20 % slow until the integral has caught up, as PX4 was seen to do.
//!
//! ENU, metres, seconds. One step is about a hundred floating-point operations; no trigonometry.

use nalgebra::Vector3;
use planner_core::Point;

/// Standard gravity, m/s².
pub const GRAVITY: f32 = 9.806_65;
/// Height over its resting place below which a vehicle touches the ground, metres.
const GROUND_CONTACT_M: f32 = 0.002;

/// Vertical push of wind as a share of the horizontal push: rotors meet the air edge-on when it
/// comes from the side.
const VERTICAL_WIND_SHARE: f32 = 0.2;

/// Limits of the airframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleLimits {
    /// Radius of the body, metres: it rests with its centre this far above the ground.
    pub radius_m: f32,
    /// Horizontal speed limit, m/s (`MPC_XY_VEL_MAX`).
    pub speed_max_mps: f32,
    /// Climb limit, m/s (`MPC_Z_VEL_MAX_UP`).
    pub climb_max_mps: f32,
    /// Descent limit, m/s (`MPC_Z_VEL_MAX_DN`).
    pub descend_max_mps: f32,
    /// Horizontal acceleration limit, m/s².
    pub acceleration_max_mps2: f32,
    /// Limit on the change of acceleration, m/s³.
    pub jerk_max_mps3: f32,
    /// Tilt limit, degrees (`MPC_TILTMAX_AIR`).
    pub tilt_max_deg: f32,
    /// Time constant of attitude and motors, seconds.
    pub lag_s: f32,
    /// Drag: acceleration for each m/s flown in still air, 1/s.
    pub drag_per_s: f32,
    /// Acceleration for each m/s of wind, 1/s.
    pub wind_per_s: f32,
    /// Time in the hover from full to empty, seconds.
    pub endurance_s: f32,
}

impl Default for VehicleLimits {
    /// PX4's quadrotor defaults, and the drag of its SIH (`SIH_KDV` 1 N s/m at `SIH_MASS` 1 kg),
    /// with which the recorded flights are flown again to 0.2 m. No real vehicle has that much, so
    /// wind moves it half as much, and still rather too much: PX4's estimator assumes 0.17 1/s at 3
    /// m/s (`EKF2_MCOEF` 0.15 1/s beside `EKF2_BCOEF_X` 100 kg/m²); a light racer was measured
    /// at 0.39 and 0.54 1/s (Faessler, Franchi and Scaramuzza 2018).
    fn default() -> Self {
        Self {
            radius_m: 0.3,
            speed_max_mps: 12.0,
            climb_max_mps: 3.0,
            descend_max_mps: 1.5,
            acceleration_max_mps2: 9.0,
            jerk_max_mps3: 60.0,
            tilt_max_deg: 45.0,
            lag_s: 0.15,
            drag_per_s: 1.0,
            wind_per_s: 0.5,
            endurance_s: 1200.0,
        }
    }
}

/// True position and motion of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueState {
    /// Centre of the body, ENU metres.
    pub position: Point,
    /// ENU, m/s.
    pub velocity: Point,
    /// Acceleration without gravity's share carried by the ground, ENU, m/s².
    pub acceleration: Point,
    /// Heading, radians clockwise from north.
    pub heading_rad: f32,
    /// Change of heading, rad/s.
    pub heading_rate: f32,
    /// Whether the body touches the ground.
    pub touching: bool,
    /// Motors on.
    pub armed: bool,
    /// The autopilot believes to be on the ground.
    pub landed: bool,
    /// Battery charge left, 0 to 1.
    pub battery: f32,
}

/// Demand of a flight mode to the controller, ENU. NaN on an axis demands nothing of it, as in
/// PX4's `trajectory_setpoint`.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// Position, metres.
    pub position: Point,
    /// Velocity, or the feed-forward beside a position, m/s.
    pub velocity: Point,
    /// Acceleration feed-forward, m/s².
    pub acceleration: Point,
    /// Heading, radians clockwise from north.
    pub heading: f32,
    /// Change of heading where no heading is asked for, rad/s.
    pub heading_rate: f32,
    /// Bound on horizontal speed, m/s.
    pub speed_max: f32,
    /// Bound on climbing, m/s; below zero it keeps the vehicle pressed to the ground.
    pub climb_max: f32,
    /// Bound on sinking, m/s.
    pub descend_max: f32,
    /// Acceleration up that is flown whatever else is asked for, m/s²; NaN leaves height to the
    /// cascade.
    pub lift_off: f32,
    /// Least thrust as a share of the weight.
    pub thrust_min: f32,
    /// Share of the change of the height in the rate of climb that is controlled, 0 to 1; the rest
    /// is the estimated velocity.
    pub height_rate_share: f32,
}

/// Gains and bounds, from the parameters of the same name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// `MPC_XY_P`, `MPC_Z_P`, 1/s.
    pub position: [f32; 2],
    /// `MPC_XY_VEL_P_ACC`, `MPC_Z_VEL_P_ACC`, 1/s.
    pub velocity_p: [f32; 2],
    /// `MPC_XY_VEL_I_ACC`, `MPC_Z_VEL_I_ACC`, 1/s².
    pub velocity_i: [f32; 2],
    /// `MPC_XY_VEL_D_ACC`, `MPC_Z_VEL_D_ACC`.
    pub velocity_d: [f32; 2],
    /// Tangent of `MPC_TILTMAX_AIR`.
    pub tilt_tan: f32,
    /// `MPC_YAWRAUTO_MAX`, rad/s.
    pub heading_rate_max: f32,
}

/// One simulated airframe with its position controller.
#[derive(Clone, Debug)]
pub struct Vehicle {
    limits: VehicleLimits,
    state: TrueState,
    position: Vector3<f64>,
    thrust: Point,
    integral: Point,
    /// Velocity the cascade asks for, for telemetry.
    pub velocity_setpoint: Point,
    /// Acceleration the cascade asks for, for telemetry.
    pub acceleration_setpoint: Point,
}

impl Vehicle {
    /// A vehicle at rest.
    pub fn new(limits: VehicleLimits, position: Point) -> Self {
        let state = TrueState {
            position,
            velocity: Point::zeros(),
            acceleration: Point::zeros(),
            heading_rad: 0.0,
            heading_rate: 0.0,
            touching: true,
            armed: false,
            landed: true,
            battery: 1.0,
        };
        Self {
            limits,
            state,
            position: position.cast::<f64>(),
            thrust: Point::zeros(),
            integral: Point::zeros(),
            velocity_setpoint: Point::zeros(),
            acceleration_setpoint: Point::zeros(),
        }
    }

    /// The truth.
    pub fn state(&self) -> &TrueState {
        &self.state
    }

    /// Position in full precision, ENU metres.
    pub fn position(&self) -> &Vector3<f64> {
        &self.position
    }

    /// Limits of the airframe.
    pub fn limits(&self) -> &VehicleLimits {
        &self.limits
    }

    /// Acceleration of thrust and gravity, m/s²: it points as the tilted body does.
    pub fn specific_force(&self) -> Point {
        Point::new(self.thrust.x, self.thrust.y, self.thrust.z + GRAVITY)
    }

    /// Sets the armed and landed flags that the autopilot's state machine decided.
    pub fn set_flags(&mut self, armed: bool, landed: bool) {
        self.state.armed = armed;
        self.state.landed = landed;
    }

    /// Turns the vehicle at rest, radians clockwise from north.
    pub fn set_heading(&mut self, heading_rad: f32) {
        self.state.heading_rad = wrap_pi(heading_rad);
    }

    /// Sets the charge left, 0 to 1.
    pub fn set_battery(&mut self, charge: f32) {
        self.state.battery = charge.clamp(0.0, 1.0);
    }

    /// Forgets the integral, as PX4 does on the ground.
    pub fn reset_integral(&mut self) {
        self.integral = Point::zeros();
    }

    /// Sets the integral to what was asked of the airframe beyond what it does.
    pub fn match_integral_to_demand(&mut self) {
        self.integral = self.acceleration_setpoint - self.state.acceleration;
    }

    /// Runs the cascade for one step from the *estimated* position and velocity.
    pub fn control(
        &mut self,
        demand: &Demand,
        gains: &Gains,
        position: &Point,
        velocity: &Point,
        dt: f32,
    ) {
        let mut wanted = Point::zeros();
        for axis in 0..3 {
            let gain = gains.position[usize::from(axis == 2)];
            let feed = demand.velocity[axis];
            let error = demand.position[axis] - position[axis];
            wanted[axis] = if error.is_nan() { 0.0 } else { error * gain }
                + if feed.is_nan() { 0.0 } else { feed };
        }
        let speed = libm::sqrtf(wanted.x * wanted.x + wanted.y * wanted.y);
        if speed > demand.speed_max {
            wanted.x *= demand.speed_max / speed;
            wanted.y *= demand.speed_max / speed;
        }
        wanted.z = wanted.z.max(-demand.descend_max).min(demand.climb_max);
        self.velocity_setpoint = wanted;

        let mut asked = Point::zeros();
        let mut error = Point::zeros();
        for axis in 0..3 {
            let k = usize::from(axis == 2);
            error[axis] = wanted[axis] - velocity[axis];
            let feed = demand.acceleration[axis];
            asked[axis] = gains.velocity_p[k] * error[axis] + self.integral[axis]
                - gains.velocity_d[k] * self.state.acceleration[axis]
                + if feed.is_nan() { 0.0 } else { feed };
        }
        if demand.lift_off.is_finite() {
            asked.z = demand.lift_off;
            self.integral.z = 0.0;
            error.z = 0.0;
        }
        // Thrust never reverses and gives at most twice the weight (hover at half throttle).
        let bounded_z = asked.z.clamp((demand.thrust_min - 1.0) * GRAVITY, GRAVITY);
        let across = libm::sqrtf(asked.x * asked.x + asked.y * asked.y);
        let across_max =
            ((bounded_z + GRAVITY) * gains.tilt_tan).min(self.limits.acceleration_max_mps2);
        let saturated_z = bounded_z != asked.z;
        let saturated_xy = across > across_max;
        asked.z = bounded_z;
        if saturated_xy {
            asked.x *= across_max / across;
            asked.y *= across_max / across;
        }
        for axis in 0..3 {
            let saturated = if axis == 2 { saturated_z } else { saturated_xy };
            // Anti-windup: while saturated only what shrinks the integral is added.
            if !saturated || error[axis] * asked[axis] < 0.0 {
                let k = usize::from(axis == 2);
                self.integral[axis] = (self.integral[axis]
                    + gains.velocity_i[k] * error[axis] * dt)
                    .clamp(-GRAVITY, GRAVITY);
            }
        }
        self.acceleration_setpoint = asked;
        self.update_heading(demand, gains, dt);
    }

    fn update_heading(&mut self, demand: &Demand, gains: &Gains, dt: f32) {
        let max = gains.heading_rate_max;
        let rate = if demand.heading.is_nan() {
            if demand.heading_rate.is_nan() { 0.0 } else { demand.heading_rate.clamp(-max, max) }
        } else {
            // MC_YAW_P 2.8, eased as the attitude loop eases it.
            (2.8 * wrap_pi(demand.heading - self.state.heading_rad)).clamp(-max, max)
        };
        self.state.heading_rate += (rate - self.state.heading_rate) * (dt / (dt + 0.1));
        self.state.heading_rad = wrap_pi(self.state.heading_rad + self.state.heading_rate * dt);
    }

    /// Moves the body for one step. `lift` is false while the motors idle or are off; the ground
    /// under the body lies at `ground_up_m`.
    pub fn advance(&mut self, lift: bool, wind: &Point, ground_up_m: f32, dt: f32) {
        let rest = f64::from(ground_up_m + self.limits.radius_m);
        let clearance = (self.position.z - rest) as f32;
        let target = if lift { self.acceleration_setpoint } else { Point::new(0.0, 0.0, -GRAVITY) };
        let blend = dt / (dt + self.limits.lag_s);
        let step = (target - self.thrust) * blend;
        let most = self.limits.jerk_max_mps3 * dt;
        let norm = step.norm_squared();
        self.thrust +=
            if lift && norm > most * most { step * (most / libm::sqrtf(norm)) } else { step };

        let push =
            wind.component_mul(&Point::new(1.0, 1.0, VERTICAL_WIND_SHARE)) * self.limits.wind_per_s;
        let mut acceleration = self.thrust + push - self.state.velocity * self.limits.drag_per_s;
        if clearance <= GROUND_CONTACT_M && acceleration.z <= 0.0 {
            // The ground carries what thrust does not, and friction holds the feet.
            acceleration = Point::zeros();
            self.state.velocity = Point::zeros();
            self.position.z = rest;
            self.state.touching = true;
        } else {
            self.state.velocity += acceleration * dt;
            self.position += self.state.velocity.cast::<f64>() * f64::from(dt);
            self.state.touching = false;
            if self.position.z <= rest {
                self.position.z = rest;
                self.state.velocity.z = self.state.velocity.z.max(0.0);
                self.state.touching = true;
            }
        }
        self.state.acceleration = acceleration;
        self.state.position = self.position.cast::<f32>();
        self.drain_battery(lift, dt);
    }

    /// Power grows with the acceleration beyond hovering and, slightly, with speed; idle motors and
    /// the board take 4 %.
    fn drain_battery(&mut self, lift: bool, dt: f32) {
        let load = if lift {
            power_ratio_at_speed(self.state.velocity.norm()) + 0.1 * self.thrust.z.max(0.0)
        } else {
            0.04
        };
        self.state.battery = (self.state.battery - load * dt / self.limits.endurance_s).max(0.0);
    }
}

/// The angle within ±π; exact for one turn too many either way, which is all that adding bounded
/// rates can cause.
pub fn wrap_pi(angle: f32) -> f32 {
    use core::f32::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

/// Power at this speed, as a multiple of that in a hover.
pub fn power_ratio_at_speed(speed_mps: f32) -> f32 {
    1.0 + 0.004 * speed_mps * speed_mps
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const GAINS: Gains = Gains {
        position: [0.95, 1.0],
        velocity_p: [1.8, 4.0],
        velocity_i: [0.4, 2.0],
        velocity_d: [0.2, 0.0],
        tilt_tan: 1.0,
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
            lift_off: f32::NAN,
            thrust_min: 0.15,
            height_rate_share: 0.0,
        }
    }

    fn fly(vehicle: &mut Vehicle, demand: &Demand, wind: Point, seconds: f32) -> (f32, f32) {
        let (mut fastest, mut worst_jerk) = (0.0_f32, 0.0_f32);
        for _ in 0..(seconds / DT) as usize {
            let (p, v, before) =
                (vehicle.state().position, vehicle.state().velocity, vehicle.thrust);
            vehicle.control(demand, &GAINS, &p, &v, DT);
            vehicle.advance(true, &wind, 0.0, DT);
            fastest = fastest.max(vehicle.state().velocity.norm());
            worst_jerk = worst_jerk.max((vehicle.thrust - before).norm() / DT);
        }
        (fastest, worst_jerk)
    }

    fn airborne() -> Vehicle {
        Vehicle::new(VehicleLimits::default(), Point::new(0.0, 0.0, 5.0))
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
        assert!(jerk <= VehicleLimits::default().jerk_max_mps3 * 1.001, "jerk {jerk}");
    }

    #[test]
    fn it_falls_without_lift_and_rests_on_the_ground() {
        let mut v = airborne();
        for _ in 0..2000 {
            v.advance(false, &Point::zeros(), 1.0, DT);
        }
        let radius = VehicleLimits::default().radius_m;
        assert_eq!(v.state().position.z, 1.0 + radius);
        assert!(v.state().touching && v.state().velocity == Point::zeros());
    }

    #[test]
    fn a_parked_vehicle_is_not_blown_away() {
        let mut v = Vehicle::new(VehicleLimits::default(), Point::new(1.0, 2.0, 0.3));
        for _ in 0..500 {
            v.advance(false, &Point::new(15.0, 0.0, 0.0), 0.0, DT);
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
}
