//! Motion of the vehicle: the acceleration that the controllers demand, and what follows from it.

use companion::Instant;
use companion::autopilot::AutopilotKind;
use companion::autopilot::{ardupilot, px4};
use nalgebra::Vector3;
use planner_core::Point;

use super::{ARDUPILOT_LOITER, Autopilot, Catch, PX4_POSITION, STEP_S};

/// Sink speed of the setpoint above which PX4's land detector can detect the ground, m/s.
const MIN_SINK_MPS: f32 = 0.275;
/// Amplitude of the swing of a vehicle in a net, metres, and its angular speed, 1/s: up to 0.7 m/s.
const SWING_M: f32 = 0.25;
/// Angular frequency of the swing, rad/s.
const SWING_RAD_PER_S: f32 = 2.8;
/// Speed at which the wind carries a vehicle off, m/s.
const WIND_MPS: f32 = 0.7;
/// Height above home to which a return climbs, metres.
const RETURN_CLIMB_M: f32 = 6.0;

impl Autopilot {
    /// The acceleration that its controllers demand in the present mode.
    fn demanded_acceleration(&self, now: Instant, floor_z: f32) -> Vector3<f32> {
        let kind = self.kind;
        let (position_gain, velocity_gain) = match kind {
            AutopilotKind::Px4 => (Point::new(0.95, 0.95, 1.0), Point::new(1.8, 1.8, 4.0)),
            AutopilotKind::ArduPilot => (Point::new(1.0, 1.0, 1.0), Point::new(2.5, 2.5, 4.0)),
        };
        let mut feed_forward = Point::zeros();
        let mut velocity = Point::zeros();
        let stale_s = if kind == AutopilotKind::Px4 { f32::INFINITY } else { self.guid_timeout_s };
        if self.mode == kind.setpoint_mode() {
            if let Some(z) = self.takeoff_z {
                velocity.z = (z - self.position.z).clamp(-0.5, 1.2);
            } else if let Some(target) = self.target.filter(|_| self.setpoint_age_s(now) < stale_s)
            {
                velocity = target.velocity;
                if let Some(place) = target.position {
                    velocity += (place - self.position).component_mul(&position_gain);
                    feed_forward = target.acceleration;
                }
            }
            if kind == AutopilotKind::Px4 {
                // The ramp of the vertical speed in PX4's take-off.
                let lifted_s = self.lifted_at.map_or(0.0, |at| (now - at).as_secs_f32());
                velocity.z = velocity.z.min(0.4 + 0.4 * lifted_s);
            }
        } else if self.mode == kind.land_mode() {
            velocity.z = -self.landing_descent_mps(floor_z);
        } else if self.mode == px4::RTL && kind == AutopilotKind::Px4
            || self.mode == ardupilot::RTL && kind == AutopilotKind::ArduPilot
        {
            let away = self.home - self.position;
            let across = away.xy();
            if across.norm() < 0.3 {
                velocity.z = -self.landing_descent_mps(floor_z);
            } else if self.position.z < self.home.z + RETURN_CLIMB_M - 0.3 && across.norm() > 1.0 {
                velocity.z = 1.0;
            } else {
                let speed = across.norm().min(3.0) / across.norm();
                velocity = Point::new(across.x * speed, across.y * speed, 0.0);
            }
        } else if self.mode == PX4_POSITION && kind == AutopilotKind::Px4
            || self.mode == ARDUPILOT_LOITER && kind == AutopilotKind::ArduPilot
        {
            velocity = self.pilot_velocity;
            if self.position.z < floor_z + 0.6 {
                velocity.z = velocity.z.max(0.3);
            }
        }
        bound_across(&mut velocity, 5.0);
        velocity.z = velocity.z.clamp(-1.5, 2.5);
        let mut wanted = (velocity - self.velocity).component_mul(&velocity_gain) + feed_forward;
        let (across_most, up_most, down_most) = match kind {
            AutopilotKind::Px4 => (5.0, 4.0, 3.0),
            AutopilotKind::ArduPilot => (2.5, 1.1, 1.1),
        };
        bound_across(&mut wanted, across_most);
        wanted.z = wanted.z.clamp(-down_most, up_most);
        wanted
    }

    /// Keeps a caught vehicle at its place; returns the height of the ledge that it rests on, if
    /// any.
    fn keep_caught(&mut self, now: Instant) -> Option<f32> {
        let (how, place) = self.caught?;
        let ledge = how == Catch::Ledge;
        let t_s = (now - self.lifted_at?).as_secs_f32();
        let (away_m, speed_mps) = match how {
            Catch::Wall | Catch::Ledge => (0.0, 0.0),
            // A vehicle that reached the ground does not swing any more.
            Catch::Net if self.grounded_since.is_some() => (self.position.x - place.x, 0.0),
            Catch::Net => (
                SWING_M * (SWING_RAD_PER_S * t_s).sin(),
                SWING_M * SWING_RAD_PER_S * (SWING_RAD_PER_S * t_s).cos(),
            ),
            Catch::Wind => (self.position.x - place.x + WIND_MPS * STEP_S, WIND_MPS),
        };
        (self.position.x, self.position.y) = (place.x + away_m, place.y);
        (self.velocity.x, self.velocity.y) = (speed_mps, 0.0);
        if ledge {
            (self.position.z, self.velocity.z) = (place.z, 0.0);
        }
        ledge.then_some(place.z)
    }

    /// Whether the land detector may detect the ground: PX4's does only while the setpoint's
    /// velocity sinks faster than 1.1 times `LNDMC_Z_VEL_MAX` (`MulticopterLandDetector`).
    fn may_detect_ground(&self) -> bool {
        self.kind != AutopilotKind::Px4
            || self.mode != self.kind.setpoint_mode()
            || self.lifted_at.is_none()
            || self.target.is_none_or(|target| target.velocity.z < -MIN_SINK_MPS)
    }

    fn landing_descent_mps(&self, floor_z: f32) -> f32 {
        let height = self.position.z - floor_z;
        match self.kind {
            AutopilotKind::Px4 if height > 7.0 => 1.5,
            AutopilotKind::Px4 if height > 3.0 => 1.05,
            AutopilotKind::Px4 => 0.8,
            AutopilotKind::ArduPilot if height > 10.0 => 0.9,
            AutopilotKind::ArduPilot => 0.5,
        }
    }

    pub(super) fn fly(&mut self, now: Instant, floor_z: f32) {
        if !self.armed {
            (self.velocity, self.acceleration) = (Point::zeros(), Point::zeros());
            return;
        }
        let wanted = self.demanded_acceleration(now, floor_z);
        self.acceleration += (wanted - self.acceleration) * (STEP_S / 0.12);
        self.velocity += self.acceleration * STEP_S;
        self.position += self.velocity * STEP_S;
        let floor_z = self.keep_caught(now).unwrap_or(floor_z);
        // A floor stops the vehicle from above only.
        if self.position.z <= floor_z && self.position.z > floor_z - 0.3 {
            self.position.z = floor_z;
            self.velocity = Point::new(0.0, 0.0, self.velocity.z.max(0.0));
            self.acceleration = Point::new(0.0, 0.0, self.acceleration.z.max(0.0));
        }
        let height = self.position.z - floor_z;
        if height > 0.12 && !self.airborne {
            self.airborne = true;
            self.lifted_at = Some(now);
        }
        let rests =
            (-0.3..0.03).contains(&height) && self.velocity.z < 0.05 && self.may_detect_ground();
        self.grounded_since = if rests { self.grounded_since.or(Some(now)) } else { None };
        let rested_s = self.grounded_since.map_or(0.0, |at| (now - at).as_secs_f32());
        if rested_s > 0.6 {
            self.airborne = false;
        }
        let flew = self.lifted_at.is_some();
        let after_s = match self.kind {
            AutopilotKind::Px4 if flew => 2.8,
            AutopilotKind::ArduPilot if flew && self.mode != ardupilot::GUIDED => 1.4,
            _ => 10.0,
        };
        if rested_s > after_s && (now - self.armed_at).as_secs_f32() > after_s {
            self.armed = false;
        }
    }
}

/// Shortens the horizontal part of a vector to at most `most`.
fn bound_across(vector: &mut Point, most: f32) {
    let across = vector.xy().norm();
    if across > most {
        (vector.x, vector.y) = (vector.x * most / across, vector.y * most / across);
    }
}
