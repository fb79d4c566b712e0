//! What each flight mode asks of the position controller.

use planner_core::Point;

use super::params::Tuning;
use super::reference::Reference;
use super::setpoint::Goal;
use super::{Copter, Mode, ReturnLeg, micros};
use crate::autopilot::body::Sense;
use crate::autopilot::vehicle::Demand;

const NONE: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);
/// The take-off is done this near its height, metres: landed_state 2 came 9.3 s after the command to 10 m.
const TAKEN_OFF_M: f32 = 0.12;
/// Climb with which it leaves the ground, m/s: then 9.5 m are reached when they were seen to be.
const LIFT_OFF_MPS: f32 = 0.3;
/// A leg of the return is at its end within this distance, metres.
const ARRIVED_M: f32 = 0.5;

/// A demand for nothing.
pub(super) fn nothing(tuning: &Tuning) -> Demand {
    Demand {
        position: NONE,
        velocity: NONE,
        acceleration: NONE,
        heading: f32::NAN,
        heading_rate: f32::NAN,
        // The reference keeps the limits; the controller may correct beyond them.
        speed_max: 1.5 * tuning.speed,
        climb_max: 1.5 * tuning.speed_up,
        descend_max: 1.5 * tuning.speed_down.max(tuning.stick_sink),
    }
}

impl Copter {
    /// What the mode asks for now.
    pub(super) fn demand(&mut self, sense: &Sense, dt: f32) -> Demand {
        let mut tuning = self.tuning;
        tuning.speed = self.speed.unwrap_or(tuning.speed);
        let goal = match self.mode {
            Mode::Guided if self.takeoff.is_some() => self.take_off_goal(),
            Mode::Guided => self.guided_goal(sense.now_us, dt),
            Mode::Brake => Goal::STOP,
            Mode::Stabilize | Mode::AltHold | Mode::Loiter => {
                tuning.speed_down = tuning.stick_sink;
                Goal { velocity: Point::new(0.0, 0.0, -tuning.stick_sink), ..Goal::STOP }
            }
            Mode::Rtl => self.return_goal(sense),
            Mode::Land => self.landing_goal(sense),
        };
        self.reference.advance(&goal, &tuning, dt);
        // Without a position there is nothing to hold across.
        let across = self.position_known(sense.now_us);
        let (p, v, a) = (self.reference.position, self.reference.velocity, self.reference.acceleration);
        let position =
            Point::new(if across { p.x } else { f32::NAN }, if across { p.y } else { f32::NAN }, p.z);
        if sense.touching && v.z < 0.0 {
            // The ground is in the way: the reference does not run on below it.
            self.reference.position.z = sense.position.z;
        }
        Demand {
            position,
            velocity: v,
            acceleration: a,
            heading: goal.heading,
            heading_rate: goal.heading_rate,
            ..nothing(&tuning)
        }
    }

    fn take_off_goal(&mut self) -> Goal {
        let Some(takeoff) = self.takeoff else { return Goal::STOP };
        let at = self.reference.position;
        let goal = Goal::hold(Point::new(at.x, at.y, takeoff.up));
        if takeoff.up - at.z < TAKEN_OFF_M {
            self.takeoff = None;
            self.goal = goal;
        } else if self.reference.velocity == Point::zeros() {
            self.reference.velocity.z = LIFT_OFF_MPS;
        }
        goal
    }

    /// Velocities end with `GUID_TIMEOUT`; until then they carry a position with them.
    fn guided_goal(&mut self, now_us: u64, dt: f32) -> Goal {
        let age_us = now_us.saturating_sub(self.goal_us);
        if self.goal.expires && age_us > micros(self.tuning.guided_timeout_s) {
            self.goal = Goal { velocity: Point::zeros(), acceleration: Point::zeros(), ..self.goal };
            self.goal.heading_rate = f32::NAN;
        }
        if let Some(position) = &mut self.goal.position {
            *position += self.goal.velocity * dt;
        }
        self.goal
    }

    /// Sinks at `WPNAV_SPEED_DN`, and at `LAND_SPEED` below `LAND_ALT_LOW` above home: without a rangefinder it knows no
    /// other ground.
    fn landing_goal(&self, sense: &Sense) -> Goal {
        let above_home = sense.position.z - sense.home.z;
        let slow = above_home < self.tuning.land_slow_below;
        let sink = if slow { self.tuning.land_speed } else { self.tuning.speed_down };
        Goal { velocity: Point::new(0.0, 0.0, -sink), ..Goal::STOP }
    }

    fn return_goal(&mut self, sense: &Sense) -> Goal {
        let home = sense.home;
        let at = self.reference.position;
        let away = libm::hypotf(home.x - sense.position.x, home.y - sense.position.y);
        if let ReturnLeg::Climb { up } = &mut self.leg
            && up.is_nan()
        {
            // Near home the climb is cut by the cone `RTL_CONE_SLOPE`.
            let height = self.tuning.return_height.min(away * self.tuning.return_cone);
            *up = (home.z + height).max(sense.position.z);
        }
        match self.leg {
            ReturnLeg::Climb { up } => {
                if up - sense.position.z < ARRIVED_M {
                    self.leg = ReturnLeg::Cross { up };
                }
                Goal::hold(Point::new(at.x, at.y, up))
            }
            ReturnLeg::Cross { up } => {
                if away < ARRIVED_M {
                    self.leg = ReturnLeg::Wait { since_us: sense.now_us, up };
                }
                Goal::hold(Point::new(home.x, home.y, up))
            }
            ReturnLeg::Wait { since_us, up } => {
                if sense.now_us - since_us >= micros(self.tuning.return_loiter_s) {
                    self.leg = ReturnLeg::Land;
                    self.reference = Reference::new(at, self.reference.velocity);
                }
                Goal::hold(Point::new(home.x, home.y, up))
            }
            ReturnLeg::Land => self.landing_goal(sense),
        }
    }
}
