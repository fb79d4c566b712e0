//! Configuration of a simulated autopilot, and its checks.

use planner_core::Point;
use planner_core::geo::frames::{Geodetic, Projection};

use crate::physics::estimator::EstimateErrorState;
use crate::physics::vehicle::AirframeParameters;
use crate::{EstimatorErrors, SimulatedKind};

impl SimulatedKind {
    /// Factor on the airframe's drag. ArduCopter's factor is fitted to recorded flights of its
    /// simulated quadrotor.
    pub(super) fn drag_factor(self) -> f32 {
        match self {
            Self::Px4 => 1.0,
            Self::Ardupilot => 0.4,
        }
    }

    /// Factor on the acceleration that wind causes.
    pub(super) fn wind_factor(self) -> f32 {
        match self {
            Self::Px4 => 1.0,
            Self::Ardupilot => 0.2,
        }
    }

    /// Projection by which this autopilot converts latitude and longitude to NED about its EKF
    /// origin.
    pub fn projection(self) -> Projection {
        match self {
            Self::Px4 => Projection::Px4,
            Self::Ardupilot => Projection::ArduPilot,
        }
    }
}

/// Configuration of a simulated autopilot.
#[derive(Clone, Debug)]
pub struct AutopilotConfig {
    /// MAVLink system id, 1 to 255.
    pub system_id: u8,
    /// Which autopilot it simulates.
    pub autopilot: SimulatedKind,
    /// Origin of the mission's ENU frame.
    pub world_origin: Geodetic,
    /// Origin of the autopilot's own local NED frame.
    pub ekf_origin: Geodetic,
    /// Home position; `None`: the position at which it arms.
    pub home: Option<Geodetic>,
    /// Initial position of the centre of the vehicle's body, ENU metres.
    pub start: Point,
    /// Heading at the start, radians clockwise from north.
    pub heading_rad: f32,
    /// Size, limits and dynamics of the airframe.
    pub vehicle: AirframeParameters,
    /// Mean wind, ENU m/s.
    pub wind: Point,
    /// Largest speed of gusts beyond the mean wind, m/s.
    pub gust_peak_mps: f32,
    /// Standard deviation of a random error of the position estimate, metres.
    pub position_noise_m: f32,
    /// Error model of the estimator.
    pub estimator: EstimatorErrors,
    /// Whether PX4 has a distance sensor, as in the recordings: then it lands at `MPC_LAND_CRWL`
    /// over the last metre.
    pub distance_sensor: bool,
    /// Seed of gusts and estimate errors.
    pub seed: u64,
    /// UTC at boot, microseconds since 1970.
    pub boot_unix_us: u64,
    /// Time from boot until ArduCopter's estimator has a position, seconds. PX4's has one at once.
    pub estimator_ready_s: f32,
    /// Number of MAVLink ports without the ground station's, at least one; each has its own stream
    /// rates.
    pub ports: usize,
    /// Whether there is one more port, for a ground station, with its stream rates.
    pub ground_port: bool,
    /// Whether messages for other systems are forwarded from port to port.
    pub forwards_between_ports: bool,
}

impl Default for AutopilotConfig {
    /// PX4 as system 1, at rest on flat ground at the mission's origin, in still air, with a
    /// perfect estimate.
    fn default() -> Self {
        let origin = Geodetic { lat_deg: 47.397_742, lon_deg: 8.545_594, alt_m: 488.0 };
        let vehicle = AirframeParameters::default();
        Self {
            system_id: 1,
            autopilot: SimulatedKind::Px4,
            world_origin: origin,
            ekf_origin: origin,
            home: None,
            start: Point::new(0.0, 0.0, vehicle.radius_m),
            heading_rad: 0.0,
            vehicle,
            wind: Point::zeros(),
            gust_peak_mps: 0.0,
            position_noise_m: 0.0,
            estimator: EstimatorErrors::Perfect,
            distance_sensor: false,
            seed: 1,
            boot_unix_us: 1_767_225_600_000_000,
            estimator_ready_s: 40.0,
            ports: 1,
            ground_port: false,
            forwards_between_ports: false,
        }
    }
}

impl AutopilotConfig {
    /// Seed of all random numbers of this vehicle: the configured seed mixed with the system id.
    pub(super) fn vehicle_seed(&self) -> u64 {
        self.seed ^ (u64::from(self.system_id) << 32)
    }

    /// Constant error of the estimated height over the flight, metres. If the GPS receiver set the
    /// EKF origin, the origin's altitude has the same error.
    pub fn height_error_m(&self) -> f32 {
        EstimateErrorState::new(self.estimator, self.autopilot, self.vehicle_seed()).height_bias_m()
    }
}

/// Reason why an [`AutopilotConfig`] or a parameter's name is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AutopilotConfigError {
    /// A position with a latitude, longitude or altitude out of range.
    #[error(
        "{0} is no place on earth: latitude within ±90°, longitude within ±180°, finite altitude"
    )]
    InvalidGeodetic(&'static str),
    /// A number that is not finite, or negative where it must not be.
    #[error("{0} must be finite and not negative")]
    NotFiniteOrNegative(&'static str),
    /// The name given to [`crate::Autopilot::set_parameter`] is not that of an integer parameter
    /// that the autopilot has.
    #[error("no integer parameter `{0}`")]
    NoIntegerParameter(&'static str),
    /// System id 0, which MAVLink uses for broadcasts.
    #[error("system id 0 means everybody: choose 1 to 255")]
    SystemIdZero,
}

/// Checks a configuration; an error names the first invalid value.
pub(super) fn check(config: &AutopilotConfig) -> Result<(), AutopilotConfigError> {
    if config.system_id == 0 {
        return Err(AutopilotConfigError::SystemIdZero);
    }
    let home = config.home.unwrap_or(config.world_origin);
    for (name, place) in
        [("world origin", config.world_origin), ("EKF origin", config.ekf_origin), ("home", home)]
    {
        if !place.is_valid() {
            return Err(AutopilotConfigError::InvalidGeodetic(name));
        }
    }
    if !config.start.iter().chain(config.wind.iter()).all(|x| x.is_finite())
        || !config.heading_rad.is_finite()
    {
        return Err(AutopilotConfigError::NotFiniteOrNegative("start position, heading and wind"));
    }
    let v = &config.vehicle;
    let positive = [
        v.radius_m,
        v.speed_max_mps,
        v.climb_max_mps,
        v.descend_max_mps,
        v.acceleration_max_mps2,
        v.jerk_max_mps3,
        v.tilt_max_deg,
        v.lag_s,
        v.drag_per_s,
        v.wind_per_s,
        v.endurance_s,
        config.gust_peak_mps,
        config.position_noise_m,
        config.estimator_ready_s,
    ];
    if positive.iter().any(|x| !x.is_finite() || *x < 0.0) {
        return Err(AutopilotConfigError::NotFiniteOrNegative(
            "every vehicle limit, gust and noise",
        ));
    }
    Ok(())
}
