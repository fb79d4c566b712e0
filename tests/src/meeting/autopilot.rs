//! A light simulated autopilot: PX4 or ArduCopter as far as a companion sees it, and an airframe
//! with a lag and bounded acceleration.
//!
//! It is not the simulated autopilot of the crate `sim-autopilot`, which is more faithful and
//! slower. Units are ENU metres, steps last [`STEP_S`].

mod flight;
mod inbox;
mod reports;

use std::collections::BTreeSet;

use companion::Instant;
use companion::autopilot::AutopilotKind;
use companion::autopilot::{ardupilot, px4};
use companion::link::frame::Framer;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

use crate::setpoints::SetpointCheck;

/// Time step of physics and telemetry, seconds.
pub const STEP_S: f32 = 0.025;
/// PX4's custom mode in which a pilot flies: POSCTL.
const PX4_POSITION: u32 = 0x0003_0000;
/// ArduCopter's custom mode in which a pilot flies: LOITER.
const ARDUPILOT_LOITER: u32 = 5;
/// Age of the last setpoint at which PX4 counts the stream as lost, seconds (`COM_OF_LOSS_T`).
const PX4_SETPOINT_LOSS_S: f32 = 1.0;

/// What the autopilot does by itself after a loss of setpoints, or in a failsafe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// Lands where it is.
    Land,
    /// Flies home and lands.
    Return,
}

/// What catches a vehicle: it holds the vehicle, or carries it off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Catch {
    /// A wall: the vehicle moves only up and down.
    Wall,
    /// A ledge: the vehicle rests on it and does not move any more.
    Ledge,
    /// A net: the vehicle hangs in it and swings.
    Net,
    /// A wind too strong for the vehicle carries it off.
    Wind,
}

/// What controls the vehicle at this moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlSource {
    /// The companion, by setpoints.
    Setpoints,
    /// The autopilot, by a command of the companion: a landing or a take-off.
    Commanded,
    /// The pilot, or the autopilot on its own decision.
    Other,
}

/// A setpoint, and when it came: ENU metres, m/s and m/s².
#[derive(Clone, Copy, Debug)]
struct Target {
    at: Instant,
    /// Place; `None` if the setpoint gives none.
    position: Option<Point>,
    velocity: Point,
    acceleration: Point,
}

/// One autopilot with its simulated vehicle.
#[derive(Clone, Debug)]
pub struct Autopilot {
    /// Which autopilot it is.
    pub kind: AutopilotKind,
    /// System id of the vehicle.
    id: u8,
    mission_origin: Geodetic,
    ekf_origin: Geodetic,
    /// True position of the vehicle, ENU metres.
    pub position: Point,
    /// True velocity of the vehicle, ENU m/s.
    pub velocity: Point,
    /// True acceleration of the vehicle, ENU m/s².
    acceleration: Point,
    /// The vehicle's pad, ENU metres.
    home: Point,
    /// Custom mode of HEARTBEAT.
    pub mode: u32,
    /// Whether the motors are on.
    pub armed: bool,
    /// Whether a failsafe flies the vehicle.
    in_failsafe: bool,
    /// Whether the companion has commanded the mode of landing.
    landing_commanded: bool,
    /// What the autopilot does after a loss of setpoints.
    pub on_setpoint_loss: Failsafe,
    /// Whether lost setpoints started the failsafe, which the next setpoint then ends (PX4).
    setpoints_lost: bool,
    /// Velocity that the pilot commands, ENU m/s.
    pub pilot_velocity: Point,
    /// Where its pilot gave the vehicle back last; `None` if nowhere.
    pub given_back_at: Option<Point>,
    /// The last setpoint.
    target: Option<Target>,
    /// Height to which a commanded take-off climbs, ENU metres; `None` without one.
    takeoff_z: Option<f32>,
    airborne: bool,
    /// When the vehicle last left the ground; `None` if not since it was armed.
    lifted_at: Option<Instant>,
    /// Since when the vehicle rests on the ground as the land detector detects it.
    grounded_since: Option<Instant>,
    /// When the motors were last armed.
    armed_at: Instant,
    /// What holds the vehicle, and where; `None`: it is free.
    caught: Option<(Catch, Point)>,
    /// Value of `GUID_TIMEOUT`, seconds.
    guid_timeout_s: f32,
    /// Ids of the messages that the companion requested as streams.
    streams: BTreeSet<u16>,
    /// Sequence number of the next frame.
    sequence: u8,
    framer: Framer,
    /// Shift of the telemetry streams, in steps of 25 ms.
    stream_phase: u64,
    /// Checks the setpoints that the autopilot received.
    pub setpoint_check: SetpointCheck,
    /// Number of times it was armed.
    pub armings: u32,
}

impl Autopilot {
    /// A disarmed vehicle on its pad. `phase` shifts its telemetry streams in time.
    pub fn new(
        kind: AutopilotKind,
        id: u8,
        origins: (Geodetic, Geodetic),
        pad: Point,
        phase: u64,
        check: SetpointCheck,
    ) -> Self {
        Self {
            kind,
            id,
            mission_origin: origins.0,
            ekf_origin: origins.1,
            position: pad,
            velocity: Point::zeros(),
            acceleration: Point::zeros(),
            home: pad,
            mode: if kind == AutopilotKind::Px4 { px4::HOLD } else { 0 },
            armed: false,
            in_failsafe: false,
            landing_commanded: false,
            on_setpoint_loss: Failsafe::Land,
            setpoints_lost: false,
            pilot_velocity: Point::zeros(),
            given_back_at: None,
            target: None,
            takeoff_z: None,
            airborne: false,
            lifted_at: None,
            grounded_since: None,
            armed_at: Instant::ZERO,
            caught: None,
            guid_timeout_s: 3.0,
            streams: BTreeSet::new(),
            sequence: 0,
            framer: Framer::new(),
            stream_phase: phase,
            setpoint_check: check,
            armings: 0,
        }
    }

    /// Whether the vehicle is off the ground, as the land detector has it: from a height of 0.12 m
    /// on, until the detector has found it at rest on the ground for 0.6 s.
    pub fn is_airborne(&self) -> bool {
        self.airborne
    }

    /// What controls the vehicle now.
    pub fn control_source(&self) -> ControlSource {
        if self.mode == self.kind.setpoint_mode() {
            if self.takeoff_z.is_some() {
                ControlSource::Commanded
            } else {
                ControlSource::Setpoints
            }
        } else if self.mode == self.kind.land_mode() && self.landing_commanded && !self.in_failsafe
        {
            ControlSource::Commanded
        } else {
            ControlSource::Other
        }
    }

    /// Position of the last setpoint; `None` without one.
    pub fn last_setpoint_position(&self) -> Option<Point> {
        self.target?.position
    }

    /// The pilot takes over by the mode switch, and flies with `velocity`.
    pub fn pilot_takes_over(&mut self, velocity: Point) {
        self.enter_mode(if self.kind == AutopilotKind::Px4 {
            PX4_POSITION
        } else {
            ARDUPILOT_LOITER
        });
        self.pilot_velocity = velocity;
    }

    /// The pilot switches back to Offboard or Guided; PX4 accepts that only while setpoints arrive.
    pub fn pilot_gives_back(&mut self, now: Instant) {
        if self.kind == AutopilotKind::ArduPilot || self.setpoint_age_s(now) < 0.5 {
            self.given_back_at = Some(self.position);
            self.enter_mode(self.kind.setpoint_mode());
        }
    }

    /// The pilot switches to the mode of landing.
    pub fn pilot_lands(&mut self) {
        self.enter_mode(self.kind.land_mode());
    }

    /// The autopilot enters a failsafe of its own.
    pub fn enter_failsafe(&mut self, how: Failsafe) {
        self.enter_mode(match how {
            Failsafe::Land => self.kind.land_mode(),
            Failsafe::Return if self.kind == AutopilotKind::Px4 => px4::RTL,
            Failsafe::Return => ardupilot::RTL,
        });
        self.in_failsafe = true;
    }

    /// From now on something holds the vehicle where it is, or carries it off from there.
    pub fn catch(&mut self, how: Catch) {
        self.caught = Some((how, self.position));
    }

    /// Whether something has caught the vehicle.
    pub fn is_caught(&self) -> bool {
        self.caught.is_some()
    }

    fn enter_mode(&mut self, mode: u32) {
        if mode != self.mode {
            // The setpoints sent in the mode before were not followed.
            self.setpoint_check.begin_stream();
        }
        (self.mode, self.in_failsafe, self.setpoints_lost, self.landing_commanded) =
            (mode, false, false, false);
        self.takeoff_z = None;
    }

    /// Time since the last setpoint, seconds; infinite before the first.
    fn setpoint_age_s(&self, now: Instant) -> f32 {
        self.target.map_or(f32::INFINITY, |target| (now - target.at).as_secs_f32())
    }

    /// One step of flight and telemetry; the messages that it sends are appended to `out`.
    pub fn step(&mut self, now: Instant, floor_z: f32, out: &mut Vec<u8>) {
        if self.kind == AutopilotKind::Px4
            && self.mode == px4::OFFBOARD
            && self.armed
            && self.setpoint_age_s(now) > PX4_SETPOINT_LOSS_S
        {
            self.enter_failsafe(self.on_setpoint_loss);
            self.setpoints_lost = true;
        }
        self.fly(now, floor_z);
        self.report(now, out);
    }
}
