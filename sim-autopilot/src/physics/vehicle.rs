//! The simulated multicopter: position controller and motion.
//!
//! The controller is the cascade of PX4's `mc_pos_control`: P on position, PID on velocity
//! (integral with anti-windup, derivative of the measured acceleration); tilt and thrust limit the
//! acceleration that it commands. The airframe responds to the commanded acceleration with a jerk
//! limit and a first-order lag (attitude and motors together); drag acts on it. Drag is not fed
//! forward, so a commanded velocity is flown 10–20 % too slow until the integral has compensated,
//! as in recordings of PX4.
//!
//! ENU, metres, seconds. One step takes about a hundred floating-point operations, none of them
//! trigonometric.

use nalgebra::Vector3;
use planner_core::Point;

use crate::status::{AutopilotFlags, MotorState};

/// Standard gravity, m/s².
pub const GRAVITY: f32 = 9.806_65;
/// Height above its resting position below which a vehicle counts as touching the ground, metres.
const GROUND_CONTACT_M: f32 = 0.002;

/// Factor on the vertical acceleration by wind, relative to the horizontal: rotors have little area
/// against vertical air.
const VERTICAL_WIND_SHARE: f32 = 0.2;

/// Size, limits and dynamics of the airframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirframeParameters {
    /// Radius of the body, metres: at rest its centre is this high above the ground.
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
    /// Time constant of the response to commanded acceleration (attitude and motors), seconds.
    pub lag_s: f32,
    /// Drag: deceleration for each m/s of velocity, 1/s.
    pub drag_per_s: f32,
    /// Acceleration for each m/s of wind, 1/s.
    pub wind_per_s: f32,
    /// Time to hover from full to empty battery, seconds.
    pub endurance_s: f32,
}

impl Default for AirframeParameters {
    /// PX4's quadrotor defaults, with the drag of its simulator SIH (`SIH_KDV` 1 N s/m at
    /// `SIH_MASS` 1 kg): with it a replay of the recorded flights stays within 0.2 m. Real vehicles
    /// have less drag. So wind accelerates half as much as drag would suggest, still rather too
    /// much: PX4's estimator assumes 0.17 1/s at 3 m/s (`EKF2_MCOEF` 0.15 1/s beside `EKF2_BCOEF_X`
    /// 100 kg/m²); a light racer was measured at 0.39 and 0.54 1/s (Faessler, Franchi and
    /// Scaramuzza 2018).
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
    /// Velocity, ENU m/s.
    pub velocity: Point,
    /// Acceleration, ENU m/s²; zero while the ground carries the vehicle.
    pub acceleration: Point,
    /// Heading, radians clockwise from north.
    pub heading_rad: f32,
    /// Rate of turn, rad/s clockwise.
    pub heading_rate: f32,
    /// Whether the body touches the ground.
    pub touching: bool,
    /// Whether the autopilot is armed.
    pub armed: bool,
    /// Whether the autopilot's land detector reports the vehicle on the ground.
    pub landed: bool,
    /// Remaining battery charge, 0 to 1.
    pub battery: f32,
}

/// What a flight mode demands of the position controller, ENU. NaN on an axis: no demand, as in
/// PX4's `trajectory_setpoint`.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// Demanded position, metres.
    pub position: Point,
    /// Demanded velocity, m/s; feed-forward on axes with a demanded position.
    pub velocity: Point,
    /// Acceleration feed-forward, m/s².
    pub acceleration: Point,
    /// Demanded heading, radians clockwise from north; NaN: `heading_rate` counts.
    pub heading: f32,
    /// Demanded rate of turn if `heading` is NaN, rad/s.
    pub heading_rate: f32,
    /// Limit of horizontal speed, m/s.
    pub speed_max: f32,
    /// Limit of the climb rate, m/s; a negative one keeps the vehicle on the ground.
    pub climb_max: f32,
    /// Limit of the descent rate, m/s.
    pub descend_max: f32,
    /// Upward acceleration that replaces the vertical control, m/s²; NaN: the cascade controls the
    /// height.
    pub lift_off_acceleration: f32,
    /// Least thrust, as a fraction of the weight.
    pub min_thrust_per_weight: f32,
    /// Weight (0 to 1) of the height's rate of change in the climb rate that is controlled; the
    /// rest is the estimated velocity.
    pub height_rate_weight: f32,
}

/// Gains and limits of the controller, read from the parameters named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Position gains, horizontal and vertical: `MPC_XY_P`, `MPC_Z_P`, 1/s.
    pub position: [f32; 2],
    /// Proportional gains of velocity: `MPC_XY_VEL_P_ACC`, `MPC_Z_VEL_P_ACC`, 1/s.
    pub velocity_p: [f32; 2],
    /// Integral gains of velocity: `MPC_XY_VEL_I_ACC`, `MPC_Z_VEL_I_ACC`, 1/s².
    pub velocity_i: [f32; 2],
    /// Derivative gains of velocity: `MPC_XY_VEL_D_ACC`, `MPC_Z_VEL_D_ACC`.
    pub velocity_d: [f32; 2],
    /// Tangent of the largest tilt, `MPC_TILTMAX_AIR`.
    pub tilt_max_tan: f32,
    /// Largest rate of turn, `MPC_YAWRAUTO_MAX`, rad/s.
    pub heading_rate_max: f32,
}

/// One simulated airframe with its position controller and true state.
#[derive(Clone, Debug)]
pub struct Multicopter {
    airframe: AirframeParameters,
    state: TrueState,
    /// `state.position` in double precision.
    position: Vector3<f64>,
    /// Acceleration by thrust and gravity together, ENU m/s²: zero in a hover.
    thrust_minus_gravity: Point,
    /// Integral part of the velocity controller's output, ENU m/s².
    integral: Point,
    /// Velocity that the cascade commands, ENU m/s; for telemetry.
    pub velocity_setpoint: Point,
    /// Acceleration that the cascade commands, ENU m/s²; for telemetry and the airframe.
    pub acceleration_setpoint: Point,
}

impl Multicopter {
    /// A vehicle at rest at `position`, disarmed, with a full battery.
    pub fn new(airframe: AirframeParameters, position: Point) -> Self {
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
            airframe,
            state,
            position: position.cast::<f64>(),
            thrust_minus_gravity: Point::zeros(),
            integral: Point::zeros(),
            velocity_setpoint: Point::zeros(),
            acceleration_setpoint: Point::zeros(),
        }
    }

    /// The true state.
    pub fn state(&self) -> &TrueState {
        &self.state
    }

    /// True position in double precision, ENU metres.
    pub fn position(&self) -> &Vector3<f64> {
        &self.position
    }

    /// Size, limits and dynamics of the airframe.
    pub fn airframe(&self) -> &AirframeParameters {
        &self.airframe
    }

    /// Acceleration by thrust alone, without gravity, ENU m/s²: it points along the body's vertical
    /// axis.
    pub fn specific_force(&self) -> Point {
        Point::new(
            self.thrust_minus_gravity.x,
            self.thrust_minus_gravity.y,
            self.thrust_minus_gravity.z + GRAVITY,
        )
    }

    /// Records what the autopilot reports.
    pub fn set_flags(&mut self, flags: AutopilotFlags) {
        self.state.armed = flags.armed;
        self.state.landed = flags.landed;
    }

    /// Sets the heading of a vehicle at rest, radians clockwise from north.
    pub fn set_heading(&mut self, heading_rad: f32) {
        self.state.heading_rad = wrap_pi_once(heading_rad);
    }

    /// Sets the remaining battery charge, 0 to 1.
    pub fn set_battery(&mut self, charge: f32) {
        self.state.battery = charge.clamp(0.0, 1.0);
    }

    /// Sets the velocity controller's integral to zero, as PX4 does on the ground.
    pub fn reset_integral(&mut self) {
        self.integral = Point::zeros();
    }

    /// Sets the integral to the commanded acceleration minus the true one.
    pub fn match_integral_to_demand(&mut self) {
        self.integral = self.acceleration_setpoint - self.state.acceleration;
    }

    /// Computes commanded velocity, acceleration and heading for one step of `dt` seconds.
    /// `position` and `velocity` are those of the estimate.
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
        if demand.lift_off_acceleration.is_finite() {
            asked.z = demand.lift_off_acceleration;
            self.integral.z = 0.0;
            error.z = 0.0;
        }
        // Thrust is at least the demand's minimum and at most twice the weight, since hovering
        // takes half throttle.
        let bounded_z = asked.z.clamp((demand.min_thrust_per_weight - 1.0) * GRAVITY, GRAVITY);
        let across = libm::sqrtf(asked.x * asked.x + asked.y * asked.y);
        let across_max =
            ((bounded_z + GRAVITY) * gains.tilt_max_tan).min(self.airframe.acceleration_max_mps2);
        let saturated_z = bounded_z != asked.z;
        let saturated_xy = across > across_max;
        asked.z = bounded_z;
        if saturated_xy {
            asked.x *= across_max / across;
            asked.y *= across_max / across;
        }
        for axis in 0..3 {
            let saturated = if axis == 2 { saturated_z } else { saturated_xy };
            // Anti-windup: while the limit is reached, only an error that reduces the output is
            // integrated.
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

    /// Turns the heading towards the demand for `dt` seconds.
    fn update_heading(&mut self, demand: &Demand, gains: &Gains, dt: f32) {
        let max = gains.heading_rate_max;
        let rate = if demand.heading.is_nan() {
            if demand.heading_rate.is_nan() { 0.0 } else { demand.heading_rate.clamp(-max, max) }
        } else {
            // Gain `MC_YAW_P` 2.8; the filter below stands for the attitude controller.
            (2.8 * wrap_pi_once(demand.heading - self.state.heading_rad)).clamp(-max, max)
        };
        self.state.heading_rate += (rate - self.state.heading_rate) * (dt / (dt + 0.1));
        self.state.heading_rad =
            wrap_pi_once(self.state.heading_rad + self.state.heading_rate * dt);
    }

    /// Moves the body for one step of `dt` seconds. `ground_up_m` is the height of the ground below
    /// the body, metres ENU.
    pub fn advance(&mut self, motors: MotorState, wind: &Point, ground_up_m: f32, dt: f32) {
        let lift = motors == MotorState::Lifting;
        let rest = f64::from(ground_up_m + self.airframe.radius_m);
        let clearance = (self.position.z - rest) as f32;
        let target = if lift { self.acceleration_setpoint } else { Point::new(0.0, 0.0, -GRAVITY) };
        let blend = dt / (dt + self.airframe.lag_s);
        let step = (target - self.thrust_minus_gravity) * blend;
        let most = self.airframe.jerk_max_mps3 * dt;
        let norm = step.norm_squared();
        self.thrust_minus_gravity +=
            if lift && norm > most * most { step * (most / libm::sqrtf(norm)) } else { step };

        let push = wind.component_mul(&Point::new(1.0, 1.0, VERTICAL_WIND_SHARE))
            * self.airframe.wind_per_s;
        let mut acceleration =
            self.thrust_minus_gravity + push - self.state.velocity * self.airframe.drag_per_s;
        if clearance <= GROUND_CONTACT_M && acceleration.z <= 0.0 {
            // The ground carries the weight that thrust does not, and friction prevents sliding.
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
        self.drain_battery(motors, dt);
    }

    /// Discharges the battery. Power grows with the upward acceleration and slightly with speed;
    /// idle motors and electronics take 4 % of the hover power.
    fn drain_battery(&mut self, motors: MotorState, dt: f32) {
        let load = match motors {
            MotorState::Lifting => {
                power_ratio_at_speed(self.state.velocity.norm())
                    + 0.1 * self.thrust_minus_gravity.z.max(0.0)
            }
            MotorState::Idle => 0.04,
        };
        self.state.battery = (self.state.battery - load * dt / self.airframe.endurance_s).max(0.0);
    }
}

/// The angle within ±π. Correct for angles within ±3π, such as the difference of two wrapped
/// angles, or a wrapped angle plus the turn of one step.
pub fn wrap_pi_once(angle: f32) -> f32 {
    use core::f32::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

/// Power that a vehicle draws while it moves at `speed_mps`, as a multiple of its power in a hover.
pub fn power_ratio_at_speed(speed_mps: f32) -> f32 {
    1.0 + 0.004 * speed_mps * speed_mps
}

#[cfg(test)]
mod tests;
