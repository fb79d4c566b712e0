//! Seeded random disturbances: gusts of wind and a random error of the estimator.
//!
//! All disturbances are Ornstein–Uhlenbeck processes (first-order Gauss–Markov; a Dryden gust is
//! one process on each axis with τ = L / V). They are updated every 20 ms and constant in between,
//! since nothing they model changes faster.
//!
//! A gust is specified by its peak beyond the mean wind, as in weather reports and MIL-F-8785C's
//! discrete gust, not by a standard deviation: the peak is `GUST_PEAK_FACTOR` deviations, and gusts
//! are clamped to it.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use planner_core::Point;

/// Period at which the random processes are updated, seconds.
pub const UPDATE_PERIOD_S: f32 = 0.02;
/// Time constant of gusts, seconds: a turbulence length of 20 m at 8 m/s.
const GUST_TAU_S: f32 = 2.5;
/// Ratio of a gust's peak to its standard deviation: about 3 for gusts of 3 s in 10 minutes (WMO,
/// Harper, Kepert and Ginger, Guidelines for converting between various wind averaging periods,
/// 2010, §2).
const GUST_PEAK_FACTOR: f32 = 3.0;
/// Ratio of vertical to horizontal gusts near the ground (MIL-F-8785C, low altitude).
const VERTICAL_GUST_SHARE: f32 = 0.5;
/// Time constant of the slow position error, seconds: GPS multipath and ionosphere.
const BIAS_TAU_S: f32 = 60.0;
/// Time constant of the fast position error, seconds: GPS noise that the estimator does not filter
/// out.
const JITTER_TAU_S: f32 = 1.0;
/// Standard deviation of the velocity error for each metre of that of the position error, 1/s:
/// PX4's estimate drifts by 0.1 m/s where it is 0.5 m wrong.
const VELOCITY_ERROR_PER_METRE: f32 = 0.2;

/// Generator of Gaussian numbers. It sums four uniform 16-bit numbers (Irwin–Hall): mean 0,
/// variance 1, no value beyond 3.5 σ, and no transcendental function whose result could differ
/// between machines.
#[derive(Clone, Debug)]
pub struct Gaussian(Pcg64Mcg);

impl Gaussian {
    /// A generator whose numbers depend on the seed alone.
    pub fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// One sample of N(0, 1).
    pub fn sample(&mut self) -> f32 {
        let bits = self.0.next_u64();
        let sum = (0..4).map(|k| (bits >> (16 * k)) & 0xffff).sum::<u64>();
        // The sum has mean 2 · 65535 and standard deviation 65536 / √3.
        (sum as f32 - 131_070.0) * (1.732_050_8 / 65_536.0)
    }

    /// Three samples of N(0, 1).
    fn sample_vector(&mut self) -> Point {
        Point::new(self.sample(), self.sample(), self.sample())
    }
}

/// An Ornstein–Uhlenbeck process on three axes, stationary from its first value on.
#[derive(Clone, Debug)]
struct OrnsteinUhlenbeck {
    /// Value now.
    value: Point,
    /// Factor on the value in each update.
    decay: f32,
    /// Standard deviation of the random part that each update adds.
    noise_gain: Point,
}

impl OrnsteinUhlenbeck {
    fn new(sigma: Point, tau_s: f32, random: &mut Gaussian) -> Self {
        let keep = libm::expf(-UPDATE_PERIOD_S / tau_s);
        let kick = sigma * libm::sqrtf(1.0 - keep * keep);
        Self { value: random.sample_vector().component_mul(&sigma), decay: keep, noise_gain: kick }
    }

    fn advance(&mut self, random: &mut Gaussian) {
        self.value =
            self.value * self.decay + random.sample_vector().component_mul(&self.noise_gain);
    }
}

/// Random wind and estimate errors of one vehicle.
#[derive(Clone, Debug)]
pub struct Disturbance {
    /// Source of all random numbers.
    random: Gaussian,
    /// Gusts, ENU m/s, before they are clamped; `None` without gusts.
    gust: Option<OrnsteinUhlenbeck>,
    /// Largest gust beyond the mean wind, m/s.
    gust_peak_mps: f32,
    /// Slow position error, fast position error (metres), and velocity error (m/s). `None` without
    /// noise.
    errors: Option<[OrnsteinUhlenbeck; 3]>,
    /// Mean wind, ENU m/s.
    mean_wind: Point,
    /// Wind now: mean and gust, ENU m/s.
    pub wind: Point,
    /// Error of the position estimate (estimated minus true), ENU metres.
    pub position_error: Point,
    /// Error of the velocity estimate (estimated minus true), ENU m/s.
    pub velocity_error: Point,
}

impl Disturbance {
    /// Disturbances with this mean wind (ENU m/s), largest gust beyond it (m/s) and standard
    /// deviation of the position estimate (m). 0 switches gusts or errors off.
    pub fn new(mean_wind: Point, gust_peak_mps: f32, position_noise_m: f32, seed: u64) -> Self {
        let mut random = Gaussian::new(seed);
        let sigma = gust_peak_mps / GUST_PEAK_FACTOR;
        let sigma = Point::new(sigma, sigma, VERTICAL_GUST_SHARE * sigma);
        let gust =
            (gust_peak_mps > 0.0).then(|| OrnsteinUhlenbeck::new(sigma, GUST_TAU_S, &mut random));
        let errors = (position_noise_m > 0.0).then(|| {
            let half = position_noise_m * core::f32::consts::FRAC_1_SQRT_2;
            let all = |s: f32| Point::new(s, s, s);
            [
                OrnsteinUhlenbeck::new(all(half), BIAS_TAU_S, &mut random),
                OrnsteinUhlenbeck::new(all(half), JITTER_TAU_S, &mut random),
                OrnsteinUhlenbeck::new(
                    all(VELOCITY_ERROR_PER_METRE * position_noise_m),
                    JITTER_TAU_S,
                    &mut random,
                ),
            ]
        });
        let mut new = Self {
            random,
            gust,
            gust_peak_mps,
            errors,
            mean_wind,
            wind: mean_wind,
            position_error: Point::zeros(),
            velocity_error: Point::zeros(),
        };
        new.update_outputs();
        new
    }

    /// Updates every process by one period of [`UPDATE_PERIOD_S`].
    pub fn advance(&mut self) {
        if let Some(gust) = &mut self.gust {
            gust.advance(&mut self.random);
        }
        for wander in self.errors.iter_mut().flatten() {
            wander.advance(&mut self.random);
        }
        self.update_outputs();
    }

    /// Computes wind and errors from the processes' values.
    fn update_outputs(&mut self) {
        if let Some(gust) = &self.gust {
            self.wind = self.mean_wind + clamp_gust(&gust.value, self.gust_peak_mps);
        }
        if let Some([bias, jitter, velocity]) = &self.errors {
            self.position_error = bias.value + jitter.value;
            self.velocity_error = velocity.value;
        }
    }

    /// A random number for sensor noise: mean 0, standard deviation 1.
    pub fn unit_sensor_noise(&mut self) -> f32 {
        self.random.sample()
    }
}

/// The gust clamped to its peak: as a vector horizontally, and by [`VERTICAL_GUST_SHARE`] of it
/// vertically.
fn clamp_gust(gust: &Point, peak_mps: f32) -> Point {
    let across = libm::sqrtf(gust.x * gust.x + gust.y * gust.y);
    let share = if across > peak_mps { peak_mps / across } else { 1.0 };
    let up = VERTICAL_GUST_SHARE * peak_mps;
    Point::new(gust.x * share, gust.y * share, gust.z.clamp(-up, up))
}

#[cfg(test)]
mod tests;
