//! How closely a simulated autopilot flies what a real one flew: recorded setpoints and commands
//! are replayed into it, and its estimated position is compared with the recorded *estimate*, from
//! arming to disarming.
//!
//! Two things in a PX4 recording are no property of the autopilot. First, the drift of its estimate
//! moves the vehicle: a replay imposes the recorded errors (estimate minus truth) on the simulated
//! estimate, or those of another flight, or flies without any ([`EstimateErrors`]). Second, the
//! companion answered that drift in the accelerations it sent: a replay sends either those, or what
//! the same control law gives for the simulated vehicle ([`Correction`]).
//!
//! The recordings are `data/flights/*.csv` of the shared data, described by the README beside them.
//! Positions are NED metres from the vehicle's EKF origin, times are seconds of the wall clock.

mod read;
mod recording;
mod replay;

use nalgebra::{Vector2, Vector3};

use self::read::read;
pub use self::recording::{Recording, Sample};
use crate::shared_data;

/// A horizontal vector, metres: east and north.
type Horizontal = Vector2<f64>;

/// Names of the recorded runs.
pub const RECORDED_RUNS: [&str; 15] = [
    "a_demo",
    "a_lobby",
    "px4_c1_demo",
    "px4_d4_lobby",
    "x_drift_demo",
    "x_drift_demo_1",
    "x_rearm_lobby",
    "ap_b_demo",
    "ap_b_lobby",
    "ap_c1_demo",
    "ap_d1_demo",
    "apx_drift_demo",
    "apx_landearly_lobby",
    "apx_rearm_lobby",
    "f_ppa",
];
/// Which errors the simulated estimate has in a replay.
#[derive(Clone, Copy, Debug)]
pub enum EstimateErrors<'a> {
    /// No errors: the estimate is the truth.
    Perfect,
    /// The recorded errors of the same flight.
    Recorded,
    /// The errors recorded in another flight at the same times: independent of this one.
    Of(&'a Recording),
}

/// Which vehicle's estimate the accelerations of the replayed setpoints correct for.
///
/// The recorded companion added to each setpoint for PX4 an acceleration back to its reference, in
/// proportion to the distance of the *recorded* estimate from it. So the drift of the real
/// estimator is in those accelerations: replayed as they are, they push a vehicle that did not
/// drift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// The recorded vehicle's: the setpoints as they were sent.
    Recorded,
    /// The simulated vehicle's, by the same control law: no part of the recorded estimate is left.
    Simulated,
}

/// Allowed RMS difference of a flight's replay, metres, under the recorded errors and with the
/// setpoints as they were sent; `None` for a flight that is not judged, such as one in which a
/// person or a failsafe took the vehicle.
pub fn allowed_rms_m(recording: &Recording) -> Option<f64> {
    match recording.run.as_str() {
        "a_demo" => Some(0.45),
        "a_lobby" | "x_rearm_lobby" => Some(0.30),
        // Vehicle 2 landed from 24 m, faster than its estimator reported it to sink.
        "f_ppa" => match recording.vehicle {
            1 => Some(0.45),
            2 => None,
            _ => Some(0.15),
        },
        "ap_b_demo" | "ap_b_lobby" | "ap_c1_demo" | "apx_rearm_lobby" | "apx_landearly_lobby" => {
            Some(0.15)
        }
        _ => None,
    }
}

/// Reads the flights of a run's vehicles; empty, with a printed line, if the shared data are
/// absent.
///
/// # Panics
/// A recording exists but cannot be read.
pub fn recordings(run: &str) -> Vec<Recording> {
    let Some(path) = shared_data(&format!("flights/{run}.csv")) else { return Vec::new() };
    let vehicles = if run == "f_ppa" { 3 } else { 1 };
    (1..=vehicles).map(|vehicle| read(&path, run, vehicle)).collect()
}

impl Recording {
    /// The recorded estimates between arming and disarming.
    pub fn flown_estimates(&self) -> impl Iterator<Item = &Sample> {
        self.estimate
            .iter()
            .filter(|s| (self.armed_span_s.0..=self.armed_span_s.1).contains(&s.t_s))
    }

    /// Recorded estimate minus setpoint, metres, at each estimate's time since the start of Follow.
    fn tracking_errors(&self) -> Vec<(f64, Vector3<f64>)> {
        let mut later = self.setpoints.as_slice();
        let mut errors = Vec::new();
        for seen in self
            .estimate
            .iter()
            .filter(|s| s.t_s >= self.follow_span_s.0 && s.t_s < self.follow_span_s.1)
        {
            while later.len() > 1 && later[1].t_s <= seen.t_s {
                later = &later[1..];
            }
            let asked = Vector3::from(later[0].position.map(f64::from));
            errors.push((seen.t_s - self.follow_span_s.0, seen.position - asked));
        }
        errors
    }

    /// How differently this and another recorded flight of the same mission kept to their
    /// setpoints: RMS, metres.
    pub fn tracking_difference_m(&self, other: &Self) -> f64 {
        let (own, others) = (self.tracking_errors(), other.tracking_errors());
        let (mut squares, mut n, mut at) = (0.0, 0_u32, 0);
        for (t_s, error) in &own {
            while at + 1 < others.len() && others[at + 1].0 <= *t_s {
                at += 1;
            }
            if at + 1 < others.len() {
                squares += (others[at].1 - error).norm_squared();
                n += 1;
            }
        }
        (squares / f64::from(n)).sqrt()
    }

    /// How far errors of the estimate alone move a replay: RMS, metres. A replay without these
    /// errors is that far off the recording, however well the autopilot is simulated.
    pub fn moved_by_errors_m(&self, errors: EstimateErrors<'_>, correction: Correction) -> f64 {
        let [with, without] =
            [errors, EstimateErrors::Perfect].map(|errors| self.replay(errors, correction));
        Difference::of(with.iter().zip(&without).map(|(a, b)| (a.position - b.position).norm()))
            .rms_m
    }

    /// Correlation coefficient of the horizontal estimate errors of two flights at the same times.
    /// PX4's SIH draws its sensor noise from `rand()` without a seed: the noise repeats in another
    /// flight, unless threads draw in another order.
    pub fn error_correlation(&self, other: &Self) -> f64 {
        let (own, others) = (self.estimate_errors(), other.estimate_errors());
        let mut later = others.as_slice();
        let mut pairs = Vec::new();
        for (t_s, error, _) in &own {
            while later.len() > 1 && later[1].0 <= *t_s {
                later = &later[1..];
            }
            if later.first().is_some_and(|(at_s, ..)| (t_s - at_s).abs() < 0.1) {
                pairs.push((error.xy().cast::<f64>(), later[0].1.xy().cast::<f64>()));
            }
        }
        let n = pairs.len() as f64;
        let mean = |of: &dyn Fn(&(Horizontal, Horizontal)) -> Horizontal| {
            pairs.iter().map(of).sum::<Horizontal>() / n
        };
        let (a, b) = (mean(&|p| p.0), mean(&|p| p.1));
        let product =
            |of: &dyn Fn(&(Horizontal, Horizontal)) -> f64| pairs.iter().map(of).sum::<f64>();
        let both = product(&|p| (p.0 - a).dot(&(p.1 - b)));
        both / (product(&|p| (p.0 - a).norm_squared()) * product(&|p| (p.1 - b).norm_squared()))
            .sqrt()
    }

    /// Replays the recorded setpoints and commands into a simulated autopilot, with these errors of
    /// its estimate, and compares its estimated positions with the recorded ones.
    pub fn compare(&self, estimator: EstimateErrors<'_>, correction: Correction) -> Comparison {
        let simulated = self.replay(estimator, correction);
        let pairs: Vec<_> = self.flown_estimates().zip(&simulated).collect();
        let apart = |(a, b): &(&Sample, &Sample)| (a.position - b.position).norm();
        let in_follow = |s: &Sample| s.t_s >= self.follow_span_s.0 && s.t_s < self.follow_span_s.1;
        let height = |(a, b): &(&Sample, &Sample)| (a.position.z - b.position.z).abs();
        let part = |pick: &dyn Fn(&Sample) -> bool, of: &dyn Fn(&(&Sample, &Sample)) -> f64| {
            Difference::of(pairs.iter().filter(|(a, _)| pick(a)).map(of))
        };
        Comparison {
            whole: part(&|_| true, &apart),
            follow: part(&in_follow, &apart),
            lift_off: part(&|s| s.t_s < self.follow_span_s.0, &height),
            landing: part(&|s| s.t_s >= self.follow_span_s.1, &height),
        }
    }
}

/// RMS and maximum of the differences between simulated and recorded estimates over a part of a
/// flight, metres; NaN if nothing was compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Root of the mean square, metres.
    pub rms_m: f64,
    /// Greatest difference, metres.
    pub max_m: f64,
}

impl Difference {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut squares, mut max, mut n) = (0.0, f64::NAN, 0_u32);
        for value in values {
            squares += value * value;
            max = value.max(max);
            n += 1;
        }
        Self { rms_m: (squares / f64::from(n)).sqrt(), max_m: max }
    }
}

/// Differences between simulated and recorded estimates, by part of the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Distance of the positions, from arming to disarming.
    pub whole: Difference,
    /// Distance of the positions, while the mission followed its path.
    pub follow: Difference,
    /// Difference of the heights, from arming to the start of the path.
    pub lift_off: Difference,
    /// Difference of the heights, from the command to land to disarming.
    pub landing: Difference,
}
