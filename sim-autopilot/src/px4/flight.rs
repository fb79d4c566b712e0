//! The demand of each of PX4's flight modes to the position controller.

use planner_core::Point;

use super::params::Px4Tuning;
use super::smoothed_approach::{self, SmoothedApproach};
use super::{CRAWL_FACTOR, Commander, Px4Mode, ReturnLeg, SensorReadings};
use crate::physics::shaping::JerkLimitedRate;
use crate::physics::vehicle::Demand;
use crate::services::mission_flight::{MissionLeg, interpolate_height};

/// Least height of a setpoint above the vehicle that counts as a demand to climb, metres; a
/// velocity or acceleration of [`MIN_CLIMB_DEMAND_MPS`] counts too.
const MIN_CLIMB_DEMAND_M: f32 = 0.15;
/// Least commanded upward velocity (m/s) or acceleration (m/s²) that counts as a demand to climb.
const MIN_CLIMB_DEMAND_MPS: f32 = 0.05;
/// Distance, horizontal or vertical, within which an automatic mode has reached its target, metres.
const ARRIVED_M: f32 = 0.5;
/// Horizontal distance to a mission's waypoint beyond which the vehicle faces the waypoint, metres.
const TURN_BEYOND_M: f32 = 2.0;
/// Largest descent rate seen in Land, m/s, although `MPC_Z_V_AUTO_DN` is 1.5. It is the rate of
/// change of the height, which PX4 controls in Land; the velocity reported meanwhile reached 1.6.
const MAX_LAND_DESCENT_MPS: f32 = 1.3;
/// Lag of the measured distance to the ground, seconds: PX4 starts to crawl at 0.85 m, not at
/// `MPC_LAND_ALT3` (1 m).
const GROUND_DISTANCE_LAG_S: f32 = 0.2;

impl Commander {
    /// Initialises a mode that is entered: stopping point, heading, first leg of a return.
    pub(super) fn enter_mode(&mut self, mode: Px4Mode, sensors: &SensorReadings) {
        self.hold_point = sensors.position + smoothed_approach::stopping_offset(&sensors.velocity);
        self.approach = SmoothedApproach::new(sensors.now_us, &sensors.position, &sensors.velocity);
        self.hold_heading = sensors.heading;
        self.return_leg = ReturnLeg::Climb { up: f32::NAN };
        self.descent = None;
        if mode == Px4Mode::Takeoff {
            (self.hold_point.x, self.hold_point.y) = (sensors.position.x, sensors.position.y);
        }
    }

    /// Whether the demand makes a vehicle on the ground take off. Hold, Return and Land never do.
    pub(super) fn demands_lift_off(&self, sensors: &SensorReadings, demand: &Demand) -> bool {
        match self.mode() {
            Px4Mode::Takeoff => true,
            Px4Mode::Mission => demand.position.z - sensors.position.z > MIN_CLIMB_DEMAND_M,
            Px4Mode::Offboard => {
                demand.position.z - sensors.position.z > MIN_CLIMB_DEMAND_M
                    || demand.velocity.z > MIN_CLIMB_DEMAND_MPS
                    || demand.acceleration.z > MIN_CLIMB_DEMAND_MPS
            }
            _ => false,
        }
    }

    /// The demand of the mode in this step.
    pub(super) fn demand(&mut self, sensors: &SensorReadings, tuning: &Px4Tuning) -> Demand {
        let held = Demand {
            position: self.hold_point,
            heading: self.hold_heading,
            speed_max: self
                .commanded_cruise_speed
                .unwrap_or(tuning.cruise_speed)
                .min(tuning.speed_max),
            climb_max: tuning.auto_climb_max.min(tuning.climb_max),
            descend_max: tuning.auto_descend_max.min(tuning.descend_max),
            ..tuning.default_demand()
        };
        match self.mode() {
            Px4Mode::Offboard => match self.setpoint {
                Some(s) => Demand {
                    position: s.position,
                    velocity: s.velocity,
                    acceleration: s.acceleration,
                    heading: s.heading,
                    heading_rate: s.heading_rate,
                    ..tuning.default_demand()
                },
                None => held,
            },
            Px4Mode::Takeoff => {
                let up = self.takeoff_up;
                let up = if up.is_nan() { sensors.home.z + tuning.takeoff_height } else { up };
                if !self.landed && sensors.position.z > up - ARRIVED_M {
                    // The height is reached: PX4 continues in Hold at this height.
                    self.intended_mode = Px4Mode::Hold;
                    self.mode_after_disarm = Px4Mode::Hold;
                    self.takeoff_up = f32::NAN;
                    self.hold_point.z = up;
                    self.approach =
                        SmoothedApproach::new(sensors.now_us, &self.hold_point, &Point::zeros());
                }
                let position = Point::new(self.hold_point.x, self.hold_point.y, up);
                Demand { position, climb_max: tuning.takeoff_speed.min(held.climb_max), ..held }
            }
            Px4Mode::Mission => self.mission_demand(sensors, tuning, held),
            Px4Mode::Land => {
                let across = self.approach_demand(sensors, tuning, &held);
                let down = self.landing_demand(sensors, tuning, held);
                with_vertical(across, &down)
            }
            Px4Mode::Hold => self.approach_demand(sensors, tuning, &held),
            Px4Mode::Return => self.return_demand(sensors, tuning, held),
            _ => held,
        }
    }

    /// Demand to hold at `hold_point`: the horizontal approach is smoothed as in PX4's automatic
    /// modes.
    fn approach_demand(
        &mut self,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
        held: &Demand,
    ) -> Demand {
        self.approach.advance(sensors.now_us, &self.hold_point, held.speed_max, tuning.auto_jerk);
        let SmoothedApproach { position, ramps: [east, north], .. } = self.approach;
        let up = f32::NAN;
        Demand {
            position: Point::new(position.x, position.y, held.position.z),
            velocity: Point::new(east.rate, north.rate, up),
            acceleration: Point::new(east.derivative, north.derivative, up),
            ..*held
        }
    }

    /// Demand of the mission's current leg. Without a heading in the item the vehicle faces its
    /// direction of flight (`MPC_YAW_MODE` 0).
    fn mission_demand(
        &mut self,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
        held: Demand,
    ) -> Demand {
        match self.mission.leg {
            Some(MissionLeg::TakeOff { up }) => {
                self.hold_point.z = up;
                let climb_max = tuning.takeoff_speed.min(held.climb_max);
                Demand { position: self.hold_point, climb_max, ..held }
            }
            Some(MissionLeg::FlyTo { at, heading, .. }) => {
                let off = at - sensors.position;
                if heading.is_finite() {
                    self.hold_heading = heading;
                } else if libm::hypotf(off.x, off.y) > TURN_BEYOND_M {
                    self.hold_heading = libm::atan2f(off.x, off.y);
                }
                self.hold_point = at;
                let (up, rate) = interpolate_height(
                    &self.mission.leg_start,
                    &at,
                    &sensors.position,
                    &sensors.velocity,
                );
                let (position, velocity) = (Point::new(at.x, at.y, up), Point::new(0.0, 0.0, rate));
                Demand { position, velocity, heading: self.hold_heading, ..held }
            }
            Some(MissionLeg::Land { at }) => {
                if let Some([east, north]) = at {
                    (self.hold_point.x, self.hold_point.y) = (east, north);
                    if libm::hypotf(east - sensors.position.x, north - sensors.position.y)
                        > ARRIVED_M
                    {
                        return Demand { position: self.hold_point, ..held };
                    }
                }
                self.landing_demand(sensors, tuning, held)
            }
            Some(MissionLeg::Wait(_) | MissionLeg::Return) | None => held,
        }
    }

    /// Demand to land: descends at `MPC_Z_V_AUTO_DN` (at most [`MAX_LAND_DESCENT_MPS`]) down to
    /// `MPC_LAND_ALT1`, slower from there to `MPC_LAND_ALT2`, then at `MPC_LAND_SPEED`; these
    /// heights count from home. If a distance sensor shows the ground nearer than `MPC_LAND_ALT3`,
    /// the vehicle crawls ([`CRAWL_FACTOR`] · `MPC_LAND_CRWL`). The descent rate changes within
    /// `MPC_ACC_DOWN_MAX` and `MPC_JERK_AUTO`.
    fn landing_demand(
        &mut self,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
        held: Demand,
    ) -> Demand {
        let [high, low] = tuning.land_slow_below;
        let height = sensors.position.z - sensors.home.z;
        let share = ((height - low) / (high - low).max(0.1)).clamp(0.0, 1.0);
        let mut sink = MAX_LAND_DESCENT_MPS
            .min(tuning.land_speed + share * (tuning.auto_descend_max - tuning.land_speed));
        if sensors.ground_distance - sensors.velocity.z * GROUND_DISTANCE_LAG_S
            < tuning.land_crawl_below
        {
            sink = CRAWL_FACTOR * tuning.land_crawl_speed;
        }
        let descent = match &mut self.descent {
            Some((at_us, ramp)) => {
                let dt = sensors.now_us.saturating_sub(core::mem::replace(at_us, sensors.now_us))
                    as f32
                    * 1e-6;
                ramp.advance(sink, tuning.auto_acceleration_down, tuning.auto_jerk, dt);
                *ramp
            }
            begin => {
                let ramp = JerkLimitedRate { rate: -sensors.velocity.z, derivative: 0.0 };
                *begin = Some((sensors.now_us, ramp));
                ramp
            }
        };
        Demand {
            position: Point::new(self.hold_point.x, self.hold_point.y, f32::NAN),
            velocity: Point::new(f32::NAN, f32::NAN, -descent.rate),
            acceleration: Point::new(f32::NAN, f32::NAN, -descent.derivative),
            // The rate of change of the height has less bias than the estimated velocity
            // (`z_deriv`).
            height_rate_weight: (descent.rate.abs() / tuning.land_speed.max(0.01)).min(1.0),
            ..held
        }
    }

    /// Demand of Return: climbs, flies home, descends and lands.
    fn return_demand(
        &mut self,
        sensors: &SensorReadings,
        tuning: &Px4Tuning,
        held: Demand,
    ) -> Demand {
        let away =
            libm::hypotf(sensors.home.x - sensors.position.x, sensors.home.y - sensors.position.y);
        if let ReturnLeg::Climb { up } = &mut self.return_leg
            && up.is_nan()
        {
            let mut height = tuning.return_height;
            if away <= tuning.return_min_distance {
                // Near home the cone `RTL_CONE_ANG` limits the climb.
                height = height.min(away / tuning.return_cone_tan.max(0.01));
            }
            *up = (sensors.home.z + height).max(sensors.position.z);
        }
        match self.return_leg {
            ReturnLeg::Climb { up } => {
                if sensors.position.z > up - ARRIVED_M {
                    self.return_leg = ReturnLeg::Cross { up };
                }
                Demand { position: Point::new(self.hold_point.x, self.hold_point.y, up), ..held }
            }
            ReturnLeg::Cross { up } => {
                if away < ARRIVED_M {
                    self.return_leg = ReturnLeg::Descend;
                    (self.hold_point.x, self.hold_point.y) = (sensors.home.x, sensors.home.y);
                }
                Demand { position: Point::new(sensors.home.x, sensors.home.y, up), ..held }
            }
            ReturnLeg::Descend => {
                let up = sensors.home.z + tuning.return_descend_height;
                if sensors.position.z < up + ARRIVED_M {
                    self.return_leg = ReturnLeg::Land;
                }
                Demand { position: Point::new(self.hold_point.x, self.hold_point.y, up), ..held }
            }
            ReturnLeg::Land => self.landing_demand(sensors, tuning, held),
        }
    }
}

/// The demand `across` with the vertical part of `up`.
fn with_vertical(across: Demand, up: &Demand) -> Demand {
    let both = |a: Point, z: f32| Point::new(a.x, a.y, z);
    Demand {
        position: both(across.position, up.position.z),
        velocity: both(across.velocity, up.velocity.z),
        acceleration: both(across.acceleration, up.acceleration.z),
        height_rate_weight: up.height_rate_weight,
        ..across
    }
}
