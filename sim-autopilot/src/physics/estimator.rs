//! Errors of an autopilot's position estimate: a seeded random model for each estimator and
//! autopilot.
//!
//! An EKF's position error e follows its velocity error v, and GPS pulls it back: e' = v − e / T. v
//! is a first-order Gauss–Markov process with standard deviation σ and time constant τ, so e has
//! the standard deviation σ T √(τ / (τ + T)). A constant error of the height over the whole flight
//! is added, like that of the EKF origin's altitude of a recorded PX4. The parameters are fitted to
//! the recorded flights (`data/flights` of the shared data). The recorded errors, from arming to
//! disarming, metres and m/s:
//!
//! | | PX4 | ArduCopter |
//! |---|---|---|
//! | horizontal: RMS; greatest | 0.13–0.27; 0.26–0.72 | 0.02–0.04; 0.03–0.11 |
//! | drift in 10 s, horizontal: RMS; greatest | 0.20–0.41; 0.38–1.03 | 0.01–0.04; 0.03–0.11 |
//! | height: RMS; greatest | 0.11–0.51; 0.27–1.09 | 0.01–0.03; 0.02–0.08 |
//! | drift in 10 s, height: RMS; greatest | 0.11–0.57; 0.21–1.42 | 0.01–0.04; 0.02–0.08 |
//! | velocity: RMS on each horizontal axis; up | 0.14–0.26; 0.10–0.20 | 0.02; 0.00 |

use planner_core::Point;

use crate::physics::noise::{Gaussian, UPDATE_PERIOD_S};
use crate::{EstimatorErrors, SimulatedKind};

impl EstimatorErrors {
    /// Horizontal and vertical accuracy that ESTIMATOR_STATUS reports, metres. Recorded PX4s
    /// reported 0.02 to 0.29 and 0.07 to 0.3, whatever their error was.
    pub(crate) fn accuracy_m(self) -> [f32; 2] {
        match self {
            Self::Perfect | Self::Rtk => [0.02, 0.03],
            Self::Recorded => [0.2, 0.2],
        }
    }
}

/// Model of one axis.
#[derive(Clone, Copy, Debug)]
struct ErrorModel {
    /// Standard deviation of the velocity error, m/s.
    sigma_mps: f32,
    /// Time constant of the velocity error, seconds.
    tau_s: f32,
    /// Time constant with which GPS reduces the position error, seconds.
    gps_pull_tau_s: f32,
    /// Limit of the position error, metres; of both horizontal axes together.
    max_error_m: f32,
}

impl ErrorModel {
    /// No error.
    const NONE: Self = Self { sigma_mps: 0.0, tau_s: 1.0, gps_pull_tau_s: 1.0, max_error_m: 0.0 };
}

/// Models of the horizontal axes and of the height, and the range of the constant height error,
/// metres.
fn error_models(
    estimator: EstimatorErrors,
    autopilot: SimulatedKind,
) -> (ErrorModel, ErrorModel, [f32; 2]) {
    match (estimator, autopilot) {
        (EstimatorErrors::Perfect, _) => (ErrorModel::NONE, ErrorModel::NONE, [0.0, 0.0]),
        (EstimatorErrors::Rtk, _) => (
            ErrorModel { sigma_mps: 0.02, tau_s: 3.0, gps_pull_tau_s: 1.5, max_error_m: 0.1 },
            ErrorModel { sigma_mps: 0.03, tau_s: 3.0, gps_pull_tau_s: 1.5, max_error_m: 0.15 },
            [0.0, 0.0],
        ),
        (EstimatorErrors::Recorded, SimulatedKind::Px4) => (
            ErrorModel { sigma_mps: 0.23, tau_s: 3.5, gps_pull_tau_s: 0.75, max_error_m: 0.75 },
            ErrorModel { sigma_mps: 0.13, tau_s: 4.0, gps_pull_tau_s: 2.0, max_error_m: 0.7 },
            [-0.43, 0.34],
        ),
        (EstimatorErrors::Recorded, SimulatedKind::Ardupilot) => (
            ErrorModel { sigma_mps: 0.02, tau_s: 1.5, gps_pull_tau_s: 1.25, max_error_m: 0.11 },
            ErrorModel { sigma_mps: 0.005, tau_s: 6.0, gps_pull_tau_s: 6.0, max_error_m: 0.08 },
            [0.0, 0.0],
        ),
    }
}

/// Errors of one vehicle's estimate (estimated minus true).
#[derive(Clone, Debug)]
pub struct EstimateErrorState {
    random: Gaussian,
    /// Models of the axes: east, north, up.
    axes: [ErrorModel; 3],
    /// Position error without the constant height error, ENU metres.
    position_drift: Point,
    /// Constant error of the height, metres.
    height_bias_m: f32,
    /// Position error, ENU metres.
    pub position: Point,
    /// Velocity error, ENU m/s.
    pub velocity: Point,
    /// Rate of change of the position error, ENU m/s.
    pub position_rate: Point,
}

impl EstimateErrorState {
    /// Stationary errors: the first values have the same distribution as later ones.
    pub fn new(estimator: EstimatorErrors, autopilot: SimulatedKind, seed: u64) -> Self {
        let mut random = Gaussian::new(seed ^ 0x0E57_1A7E);
        let (across, up, height_m) = error_models(estimator, autopilot);
        // A random number within ±1.75 becomes a place in the range (0 to 1); larger ones, up to
        // ±3.46, are clamped to the ends.
        let share = (0.5 + random.sample() / 3.5).clamp(0.0, 1.0);
        let mut errors = Self {
            random,
            axes: [across, across, up],
            position_drift: Point::zeros(),
            height_bias_m: height_m[0] + share * (height_m[1] - height_m[0]),
            position: Point::zeros(),
            velocity: Point::zeros(),
            position_rate: Point::zeros(),
        };
        // After 30 s the start at zero has no effect any more.
        for _ in 0..(30.0 / UPDATE_PERIOD_S) as usize {
            errors.advance();
        }
        errors
    }

    /// Constant error of the height over the flight, metres.
    pub fn height_bias_m(&self) -> f32 {
        self.height_bias_m
    }

    /// Updates the errors by one period of [`UPDATE_PERIOD_S`].
    pub fn advance(&mut self) {
        for (k, axis) in self.axes.iter().enumerate() {
            let keep = libm::expf(-UPDATE_PERIOD_S / axis.tau_s);
            let kick = axis.sigma_mps * libm::sqrtf(1.0 - keep * keep);
            self.velocity[k] = keep * self.velocity[k] + kick * self.random.sample();
            self.position_rate[k] = self.velocity[k] - self.position_drift[k] / axis.gps_pull_tau_s;
            self.position_drift[k] += self.position_rate[k] * UPDATE_PERIOD_S;
        }
        let across = libm::sqrtf(
            self.position_drift.x * self.position_drift.x
                + self.position_drift.y * self.position_drift.y,
        );
        let most_m = self.axes[0].max_error_m;
        if across > most_m {
            self.position_drift.x *= most_m / across;
            self.position_drift.y *= most_m / across;
        }
        let up_m = self.axes[2].max_error_m;
        self.position_drift.z = self.position_drift.z.clamp(-up_m, up_m);
        self.position = self.position_drift + Point::new(0.0, 0.0, self.height_bias_m);
    }
}

#[cfg(test)]
mod tests;
