//! Checks a stream of setpoints: records the motion that it demands, and whether it is fit to be
//! flown.
//!
//! Speed, acceleration and jerk are divided differences of the positions that were sent, in the
//! autopilot's frame. So they hold whatever feed-forward is sent too, and however the steps lie in
//! time: a curve whose third derivative is bounded has third divided differences within that bound.
//! A gap longer than `STREAM_GAP_S` begins another stream, and so does a setpoint that an autopilot
//! in another mode did not follow: it has to be finite and inside the fence all the same. A
//! setpoint that moves without a velocity of its own follows a vehicle that is flown by its pilot,
//! or is believed to be: it moves no faster than `MAX_FOLLOWING_MPS`.

use mavlink::dialects::ardupilotmega::SET_POSITION_TARGET_LOCAL_NED_DATA;
use nalgebra::Vector3;

/// Gap between two setpoints after which the next one begins another stream, seconds.
const STREAM_GAP_S: f32 = 0.3;
/// Movement above which a setpoint without velocity counts as following the vehicle, metres.
const STILL_M: f32 = 1e-4;
/// Greatest speed of setpoints that follow the vehicle, with room for rounding, m/s.
const MAX_FOLLOWING_MPS: f32 = 15.2;
/// Greatest jerk, m/s³: in general, then in a stop by the safety filter.
const MAX_JERK_MPS3: f32 = 4.0;
const MAX_URGENT_JERK_MPS3: f32 = 8.0;
/// Rounding error of a position of three f32 coordinates, as a fraction of the largest coordinate.
const ROUNDING_SHARE: f32 = 1.04e-7;
/// Bits of `type_mask` by which the position is ignored.
const MASK_NO_POSITION: u16 = 0b111;

/// Greatest values that a stream of setpoints demanded, and counts of its faults.
#[derive(Clone, Copy, Debug, Default)]
pub struct SetpointStats {
    /// Number of setpoints with a position.
    pub count: u64,
    /// Greatest distance from one setpoint to the next, metres.
    pub max_step_m: f32,
    /// Greatest speed between two setpoints, m/s.
    pub max_speed_mps: f32,
    /// Greatest acceleration, from three setpoints, m/s².
    pub max_accel_mps2: f32,
    /// Greatest jerk, from four setpoints, m/s³, less the part that rounding may cause.
    pub max_jerk_mps3: f32,
    /// As `max_jerk_mps3`, in stops by the safety filter.
    pub max_urgent_jerk_mps3: f32,
    /// Number of setpoints sent in stops by the safety filter.
    pub urgent_count: u64,
    /// Greatest difference between the velocity sent and that of the positions sent, m/s.
    pub max_velocity_mismatch_mps: f32,
    /// Number of setpoints with a number that is not finite.
    pub not_finite: u64,
    /// Number of setpoints outside the fence.
    pub outside_fence: u64,
    /// Number of setpoints with more jerk than allowed.
    pub too_jerky: u64,
    /// Number of setpoints further from the one before than [`SetpointLimits::max_speed_mps`]
    /// allows.
    pub too_far_apart: u64,
}

/// Limits that a stream of setpoints must keep.
#[derive(Clone, Copy, Debug)]
pub struct SetpointLimits {
    /// Greatest speed, m/s.
    pub max_speed_mps: f32,
    /// Lowest and highest corner of the fence in the autopilot's frame, metres; `None`: no fence.
    pub fence: Option<(Vector3<f32>, Vector3<f32>)>,
}

impl SetpointStats {
    /// Adds the statistics of another stream.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.max_step_m = self.max_step_m.max(other.max_step_m);
        self.max_speed_mps = self.max_speed_mps.max(other.max_speed_mps);
        self.max_accel_mps2 = self.max_accel_mps2.max(other.max_accel_mps2);
        self.max_jerk_mps3 = self.max_jerk_mps3.max(other.max_jerk_mps3);
        self.max_urgent_jerk_mps3 = self.max_urgent_jerk_mps3.max(other.max_urgent_jerk_mps3);
        self.urgent_count += other.urgent_count;
        self.max_velocity_mismatch_mps =
            self.max_velocity_mismatch_mps.max(other.max_velocity_mismatch_mps);
        self.not_finite += other.not_finite;
        self.outside_fence += other.outside_fence;
        self.too_jerky += other.too_jerky;
        self.too_far_apart += other.too_far_apart;
    }
}

impl std::fmt::Display for SetpointStats {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} setpoints: step {:.3} m, {:.2} m/s, {:.2} m/s², {:.1} m/s³, velocity off by {:.2} m/s; {} in stops by \
             the safety filter: {:.1} m/s³; {} jumps, {} jerky, {} outside, {} not finite",
            self.count,
            self.max_step_m,
            self.max_speed_mps,
            self.max_accel_mps2,
            self.max_jerk_mps3,
            self.max_velocity_mismatch_mps,
            self.urgent_count,
            self.max_urgent_jerk_mps3,
            self.too_far_apart,
            self.too_jerky,
            self.outside_fence,
            self.not_finite
        )
    }
}

/// The last setpoint, and what it and those before it without a gap demanded.
#[derive(Clone, Copy, Debug)]
struct LastSetpoint {
    /// When it came, seconds.
    at_s: f64,
    /// Time from the setpoint before to this one, and the time between the two before, seconds.
    dt_s: [f32; 2],
    /// Place, NED metres.
    position: Vector3<f32>,
    /// Velocity, NED m/s; `None` if it gives none.
    velocity: Option<Vector3<f32>>,
    /// Acceleration, NED m/s²; `None` if it gives none.
    accel: Option<Vector3<f32>>,
    jerk_mps3: f32,
    /// Number of setpoints since the last one in a stop by the safety filter; 0 in the stop.
    since_urgent: u8,
    /// Greatest rounding error of the position, metres.
    rounded_m: f32,
}

/// Checks one stream of setpoints.
#[derive(Clone, Debug)]
pub struct SetpointCheck {
    limits: SetpointLimits,
    last: Option<LastSetpoint>,
    /// Whether the safety filter stops the vehicle now; the caller sets it.
    pub in_urgent_stop: bool,
    /// Whether setpoints follow a vehicle that its pilot flies; the caller sets it.
    pub follows_vehicle: bool,
    /// Rounding of positions on their way to the checker, metres, in addition to that of their own
    /// f32; the caller sets it.
    pub extra_rounding_m: f32,
    /// Statistics of all setpoints so far.
    pub stats: SetpointStats,
    /// The first eight faults: time in seconds and text.
    pub faults: Vec<(f64, String)>,
}

impl SetpointCheck {
    /// A checker that has seen no setpoint.
    pub fn new(limits: SetpointLimits) -> Self {
        Self {
            limits,
            last: None,
            in_urgent_stop: false,
            follows_vehicle: false,
            extra_rounding_m: 0.0,
            stats: SetpointStats::default(),
            faults: Vec::new(),
        }
    }

    /// Jerk at the last setpoint, m/s³.
    pub fn last_jerk_mps3(&self) -> f32 {
        self.last.map_or(0.0, |last| last.jerk_mps3)
    }

    fn note_fault(&mut self, at_s: f64, what: String) {
        if self.faults.len() < 8 {
            self.faults.push((at_s, what));
        }
    }

    /// Begins another stream with the next setpoint: the last one was not followed.
    pub fn begin_stream(&mut self) {
        self.last = None;
    }

    /// Checks one setpoint sent at `at_s`.
    pub fn check_setpoint(&mut self, at_s: f64, data: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        let fields = [
            data.x, data.y, data.z, data.vx, data.vy, data.vz, data.afx, data.afy, data.afz,
            data.yaw,
        ];
        if fields.iter().any(|field| !field.is_finite()) {
            self.stats.not_finite += 1;
            self.note_fault(at_s, format!("not finite: {fields:?}"));
            return;
        }
        if data.type_mask.bits() & MASK_NO_POSITION != 0 {
            self.last = None;
            return;
        }
        let position = Vector3::new(data.x, data.y, data.z);
        self.stats.count += 1;
        if let Some((low, high)) = self.limits.fence
            && (0..3).any(|axis| position[axis] < low[axis] || position[axis] > high[axis])
        {
            self.stats.outside_fence += 1;
            self.note_fault(at_s, format!("outside the fence: {position:?}"));
        }
        let before = self.last.filter(|last| ((at_s - last.at_s) as f32) < STREAM_GAP_S);
        let calm = if self.in_urgent_stop {
            0
        } else {
            before.map_or(u8::MAX, |last| last.since_urgent.saturating_add(1))
        };
        self.stats.urgent_count += u64::from(self.in_urgent_stop);
        // The smoother sums in f32 too, so its rounding counts as much again.
        let rounded_m = self.extra_rounding_m + 2.0 * rounding_m(data);
        let mut next = LastSetpoint {
            at_s,
            dt_s: [0.0; 2],
            position,
            velocity: None,
            accel: None,
            jerk_mps3: 0.0,
            since_urgent: calm,
            rounded_m,
        };
        if let Some(before) = before {
            self.check_step(&before, &mut next, data);
        }
        self.last = Some(next);
    }

    /// The step from the setpoint before this one.
    fn check_step(
        &mut self,
        before: &LastSetpoint,
        next: &mut LastSetpoint,
        data: &SET_POSITION_TARGET_LOCAL_NED_DATA,
    ) {
        let at_s = next.at_s;
        let dt_s = ((at_s - before.at_s) as f32).max(1e-3);
        let moved = next.position - before.position;
        let velocity = moved / dt_s;
        next.dt_s = [dt_s, before.dt_s[0]];
        let stats = &mut self.stats;
        let sent = Vector3::new(data.vx, data.vy, data.vz);
        let follows = self.follows_vehicle || (sent == Vector3::zeros() && moved.norm() > STILL_M);
        let jumps =
            velocity.norm() > if follows { MAX_FOLLOWING_MPS } else { self.limits.max_speed_mps };
        if jumps {
            stats.too_far_apart += 1;
            self.note_fault(at_s, format!("a step of {:.2} m in {dt_s:.3} s", moved.norm()));
        }
        if follows {
            return;
        }
        let stats = &mut self.stats;
        stats.max_step_m = stats.max_step_m.max(moved.norm());
        stats.max_speed_mps = stats.max_speed_mps.max(velocity.norm());
        stats.max_velocity_mismatch_mps =
            stats.max_velocity_mismatch_mps.max((sent - velocity).norm());
        next.velocity = Some(velocity);
        let too_jerky = self.check_accel_and_jerk(before, next);
        if let Some(what) = too_jerky.filter(|_| !jumps) {
            self.note_fault(at_s, what);
        }
    }

    /// Checks acceleration and jerk, from this setpoint and up to three before it. Returns what the
    /// jerk is if it is too large.
    fn check_accel_and_jerk(
        &mut self,
        before: &LastSetpoint,
        next: &mut LastSetpoint,
    ) -> Option<String> {
        let (dt_s, stats) = (next.dt_s[0], &mut self.stats);
        let (velocity, velocity_before) = (next.velocity?, before.velocity?);
        let accel = (velocity - velocity_before) / (0.5 * (dt_s + before.dt_s[0]));
        next.accel = Some(accel);
        stats.max_accel_mps2 = stats.max_accel_mps2.max(accel.norm());
        if let Some(accel_before) = before.accel {
            let over_s = (dt_s + before.dt_s[0] + before.dt_s[1]) / 3.0;
            let shortest_s = dt_s.min(before.dt_s[0]).min(before.dt_s[1]);
            let rounding = 8.0 * next.rounded_m.max(before.rounded_m) / shortest_s.powi(3);
            let jerk_mps3 = (((accel - accel_before) / over_s).norm() - rounding).max(0.0);
            next.jerk_mps3 = jerk_mps3;
            // The third difference reaches three setpoints back, so those after a stop count as in
            // it.
            let (worst, most_mps3) = if next.since_urgent <= 3 {
                (&mut stats.max_urgent_jerk_mps3, MAX_URGENT_JERK_MPS3)
            } else {
                (&mut stats.max_jerk_mps3, MAX_JERK_MPS3)
            };
            *worst = worst.max(jerk_mps3);
            // A thousandth more for the rounding of the sums.
            if jerk_mps3 > most_mps3 * 1.001 {
                stats.too_jerky += 1;
                return Some(format!("{jerk_mps3:.1} m/s³ of {most_mps3}"));
            }
        }
        None
    }
}

/// Rounding error of the setpoint's position from its f32 coordinates, metres.
pub fn rounding_m(data: &SET_POSITION_TARGET_LOCAL_NED_DATA) -> f32 {
    ROUNDING_SHARE * data.x.abs().max(data.y.abs()).max(data.z.abs())
}
