//! Shaping functions of autopilots: approach a target value within limits of acceleration and jerk.

/// Rate at which an error is reduced (`sqrt_controller`): `gain` · error near zero, beyond that the
/// rate from which a deceleration of `limit` stops at zero.
pub fn approach_rate(error: f32, gain: f32, limit: f32) -> f32 {
    let linear = limit / (gain * gain);
    if error.abs() <= linear {
        return error * gain;
    }
    libm::copysignf(libm::sqrtf(2.0 * limit * (error.abs() - 0.5 * linear)), error)
}

/// Gain with which a [`JerkLimitedRate`] approaches its target at the end, 1/s.
const RAMP_END_GAIN_PER_S: f32 = 6.0;

/// A rate that changes within limits of its first and second derivative, as in PX4's
/// `VelocitySmoothing`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JerkLimitedRate {
    /// The rate, m/s.
    pub rate: f32,
    /// Derivative of the rate, m/s².
    pub derivative: f32,
}

impl JerkLimitedRate {
    /// Advances `dt` seconds towards `rate`, with at most `change` m/s² and `jerk` m/s³.
    pub fn advance(&mut self, rate: f32, change: f32, jerk: f32, dt: f32) {
        let wanted =
            approach_rate(rate - self.rate, RAMP_END_GAIN_PER_S, jerk).clamp(-change, change);
        self.derivative += (wanted - self.derivative).clamp(-jerk * dt, jerk * dt);
        self.rate += self.derivative * dt;
    }
}

#[cfg(test)]
mod tests;
