//! Replays a recording's setpoints and commands into a simulated autopilot.

use companion::link::frame::{self, Header};
use mavlink::dialects::ardupilotmega::{
    MavFrame, MavParamType, PARAM_SET_DATA, PositionTargetTypemask,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use nalgebra::Vector3;
use planner_core::Point;
use sim_autopilot::{Autopilot, AutopilotConfig, SimulatedKind};

use super::recording::{Message, Recording, Sample, Setpoint};
use super::{Correction, EstimateErrors};

/// Simulated seconds per second of the wall clock: PX4's SIH ran 0.4 to 1.1 % slow when recorded.
const PX4_CLOCK_RATE: f64 = 0.9925;
/// Time of a step, seconds.
const STEP_S: f64 = 0.004;
/// Simulated time before the first record, seconds: by then ArduCopter has booted and has a
/// position.
const WARM_UP_S: f64 = 8.0;
const COMMAND_LONG: (u32, u8) = (76, 152);
/// Control law of the recorded companion (8314848, `guidance::correction`): acceleration for each
/// metre and for each m/s off the reference, 1/s² and 1/s, and its bound, m/s². From the recorded
/// estimate it gives the recorded accelerations to within 0.02 m/s².
const POSITION_GAIN_PER_S2: f64 = 3.0;
const VELOCITY_GAIN_PER_S: f64 = 1.5;
const MAX_CORRECTION_MPS2: f64 = 1.5;
/// Bound on the acceleration of that companion's reference, m/s².
const MAX_REFERENCE_ACCEL_MPS2: f64 = 2.0;

impl Recording {
    /// Where the vehicle stood in the second before it armed, by its estimate, NED metres.
    fn start_ned(&self) -> Vector3<f64> {
        let before = || {
            self.estimate
                .iter()
                .filter(|s| s.t_s < self.armed_span_s.0 && s.t_s > self.armed_span_s.0 - 1.0)
        };
        before().map(|s| s.position).sum::<Vector3<f64>>() / before().count().max(1) as f64
    }

    fn config(&self) -> AutopilotConfig {
        let ned = self.start_ned();
        AutopilotConfig {
            autopilot: self.autopilot,
            world_origin: self.ekf_origin,
            ekf_origin: self.ekf_origin,
            start: Point::new(ned.y as f32, ned.x as f32, -ned.z as f32),
            estimator_ready_s: 1.0,
            distance_sensor: true,
            ..AutopilotConfig::default()
        }
    }

    /// Errors of the recorded estimate, estimated minus true: ENU metres and m/s, at the times of
    /// the recorded truth.
    pub fn estimate_errors(&self) -> Vec<(f64, Point, Point)> {
        let enu = |v: Vector3<f64>| Point::new(v.y as f32, v.x as f32, -v.z as f32);
        let mut errors = Vec::new();
        let mut later = self.estimate.as_slice();
        for truth in &self.truth {
            while later.len() > 1 && later[1].t_s <= truth.t_s {
                later = &later[1..];
            }
            let [a, b, ..] = later else { break };
            if a.t_s > truth.t_s || b.t_s - a.t_s > 0.3 {
                continue;
            }
            let share = (truth.t_s - a.t_s) / (b.t_s - a.t_s);
            let position = a.position.lerp(&b.position, share) - truth.position;
            let velocity = a.velocity.lerp(&b.velocity, share) - truth.velocity;
            errors.push((truth.t_s, enu(position), enu(velocity)));
        }
        errors
    }

    /// The position error that the replay counts as zero: the mean in the second before arming, as
    /// for [`Self::start_ned`], or the first error if none is known in that second.
    fn zero_error(&self, errors: &[(f64, Point, Point)]) -> Point {
        let before = || {
            errors.iter().filter(|e| e.0 < self.armed_span_s.0 && e.0 > self.armed_span_s.0 - 1.0)
        };
        let first = errors.first().map_or(Point::zeros(), |e| e.1);
        let n = before().count();
        if n > 0 { before().map(|e| e.1).sum::<Point>() / n as f32 } else { first }
    }

    /// Flies the recorded setpoints and commands; returns the simulated estimates at the times of
    /// the recorded ones, from arming to disarming.
    ///
    /// # Panics
    /// Does not panic for a recording that [`super::recordings`] has read.
    pub fn replay(&self, estimator: EstimateErrors<'_>, correction: Correction) -> Vec<Sample> {
        let errors = match estimator {
            EstimateErrors::Perfect => Vec::new(),
            EstimateErrors::Recorded => self.estimate_errors(),
            EstimateErrors::Of(other) => other.estimate_errors(),
        };
        let zero = self.zero_error(&errors);
        let mut errors = errors.iter().peekable();
        let mut last = (0.0, Point::zeros());
        let config = self.config();
        let mut autopilot = Autopilot::new(&config).expect("a recorded place is one");
        autopilot.set_land_on_offboard_loss();
        let ground_m = config.start.z - config.vehicle.radius_m;
        let clock = if self.autopilot == SimulatedKind::Px4 { PX4_CLOCK_RATE } else { 1.0 };
        let (mut setpoints, mut messages) =
            (self.setpoints.iter().peekable(), self.messages.iter().peekable());
        let (mut sequence, mut buffer) = (0_u8, [0; 512]);
        let begin_s = self.armed_span_s.0 - 4.0;
        // Messages before the replayed part set the autopilot up, so they are sent at once.
        while let Some((_, message)) = messages.next_if(|(t_s, _)| *t_s < begin_s) {
            feed_message(&mut autopilot, message, &mut sequence);
        }
        while setpoints.next_if(|s| s.t_s < begin_s).is_some() {}
        let mut last_setpoint: Option<Setpoint> = None;
        let mut flown = Vec::new();
        for seen in self.flown_estimates() {
            let due_us = |t_s: f64| ((WARM_UP_S + (t_s - begin_s) * clock) * 1e6) as u64;
            while autopilot.time_us() < due_us(seen.t_s) {
                let now_us = autopilot.time_us();
                while let Some((_, message)) = messages.next_if(|(t_s, _)| due_us(*t_s) <= now_us) {
                    feed_message(&mut autopilot, message, &mut sequence);
                }
                while let Some(setpoint) = setpoints.next_if(|s| due_us(s.t_s) <= now_us) {
                    let mut sent = *setpoint;
                    if let (Correction::Simulated, Some(last)) = (correction, last_setpoint) {
                        correct_acceleration(&mut sent, &last, &autopilot);
                    }
                    last_setpoint = Some(*setpoint);
                    feed_setpoint(&mut autopilot, &sent, &mut sequence);
                }
                while let Some((t_s, position, velocity)) =
                    errors.next_if(|e| due_us(e.0) <= now_us)
                {
                    let (was_s, was) = core::mem::replace(&mut last, (*t_s, *position));
                    let rate = (position.z - was.z) / (t_s - was_s).max(0.02) as f32;
                    let rate = if t_s - was_s < 0.2 { rate } else { 0.0 };
                    autopilot.set_estimate_error(&(position - zero), velocity, rate);
                }
                autopilot.step(STEP_S as f32, ground_m);
                while autopilot.poll_transmit(&mut buffer) > 0 {}
            }
            let [position, velocity] = autopilot.estimate().map(|enu| ned(&enu));
            flown.push(Sample { t_s: seen.t_s, position, velocity });
        }
        flown
    }
}

/// The NED place of an ENU one.
fn ned(enu: &Point) -> Vector3<f64> {
    Vector3::new(f64::from(enu.y), f64::from(enu.x), -f64::from(enu.z))
}

/// Replaces a setpoint's horizontal acceleration by what the recorded companion would send for the
/// simulated vehicle: the change of its reference's speed, and the correction back to it. A
/// setpoint without acceleration (on the ground, under a pilot) stays as it is.
fn correct_acceleration(setpoint: &mut Setpoint, last: &Setpoint, autopilot: &Autopilot) {
    let [north, east, _] = setpoint.acceleration;
    if north == 0.0 && east == 0.0 {
        return;
    }
    let wide = |v: [f32; 3]| Vector3::from(v.map(f64::from));
    let [position, velocity] = autopilot.estimate().map(|enu| ned(&enu));
    let mut off = (wide(setpoint.position) - position) * POSITION_GAIN_PER_S2
        + (wide(setpoint.velocity) - velocity) * VELOCITY_GAIN_PER_S;
    off.z = 0.0;
    off *= MAX_CORRECTION_MPS2 / off.norm().max(MAX_CORRECTION_MPS2);
    let (speed, was) = (wide(setpoint.velocity).norm(), wide(last.velocity).norm());
    let change = (speed - was) / (setpoint.t_s - last.t_s).max(0.02);
    let along = wide(setpoint.velocity) / speed.max(0.01);
    let sent = off + along * change.clamp(-MAX_REFERENCE_ACCEL_MPS2, MAX_REFERENCE_ACCEL_MPS2);
    (setpoint.acceleration[0], setpoint.acceleration[1]) = (sent.x as f32, sent.y as f32);
}

fn send(autopilot: &mut Autopilot, bytes: &[u8], sequence: &mut u8) {
    autopilot.handle_bytes(bytes);
    *sequence = sequence.wrapping_add(1);
}

fn feed_message(autopilot: &mut Autopilot, message: &Message, sequence: &mut u8) {
    let mut buffer = [0; 300];
    let length = match message {
        Message::Command(system, component, command, params) => {
            let mut payload = [0; 33];
            for (k, param) in params.iter().enumerate() {
                payload[4 * k..4 * k + 4].copy_from_slice(&param.to_le_bytes());
            }
            payload[28..30].copy_from_slice(&command.to_le_bytes());
            (payload[30], payload[31]) = (1, 1);
            let header = Header { system: *system, component: *component, sequence: *sequence };
            frame::encode_raw(header, COMMAND_LONG.0, COMMAND_LONG.1, &payload, &mut buffer)
        }
        Message::GuidedTimeout(value) => {
            let header = Header { system: 1, component: 191, sequence: *sequence };
            let set = PARAM_SET_DATA {
                param_value: *value,
                target_system: 1,
                target_component: 1,
                param_id: "GUID_TIMEOUT".into(),
                param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            };
            frame::encode(header, &set, &mut buffer)
        }
    };
    send(autopilot, &buffer[..length], sequence);
}

fn feed_setpoint(autopilot: &mut Autopilot, setpoint: &Setpoint, sequence: &mut u8) {
    let message = SET_POSITION_TARGET_LOCAL_NED_DATA {
        time_boot_ms: (autopilot.time_us() / 1000) as u32,
        target_system: 1,
        target_component: 1,
        // The recorded companion sends no other frame.
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
        type_mask: PositionTargetTypemask::from_bits_truncate(setpoint.mask),
        x: setpoint.position[0],
        y: setpoint.position[1],
        z: setpoint.position[2],
        vx: setpoint.velocity[0],
        vy: setpoint.velocity[1],
        vz: setpoint.velocity[2],
        afx: setpoint.acceleration[0],
        afy: setpoint.acceleration[1],
        afz: setpoint.acceleration[2],
        yaw: setpoint.yaw,
        yaw_rate: 0.0,
    };
    let mut buffer = [0; 300];
    let header = Header { system: 1, component: 191, sequence: *sequence };
    let length = frame::encode(header, &message, &mut buffer);
    send(autopilot, &buffer[..length], sequence);
}
