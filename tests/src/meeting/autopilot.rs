//! A light autopilot: PX4 or ArduCopter as far as a companion sees it, and a vehicle with a lag and
//! bounded acceleration.
//!
//! It is not the simulated autopilot of `host-sim`, which is truer and slower. ENU metres, steps of
//! [`STEP_S`].

mod flight;
mod inbox;
mod reports;

use std::collections::BTreeSet;

use companion::Instant;
use companion::autopilot::AutopilotKind;
use companion::autopilot::{ardupilot, px4};
use companion::link::frame::Framer;
use planner_core::Point;
use planner_core::frames::Geodetic;

use crate::setpoints::SetpointCheck;

/// Physics and telemetry advance by this, seconds.
pub const STEP_S: f32 = 0.025;
/// The pilot's mode: POSCTL.
const PX4_POSITION: u32 = 0x0003_0000;
/// The pilot's mode: LOITER.
const ARDUPILOT_LOITER: u32 = 5;
/// Setpoints older than this are lost, seconds (`COM_OF_LOSS_T`).
const PX4_LOSS_S: f32 = 1.0;

/// What the autopilot does by itself after a loss of setpoints, or in a failsafe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// Lands where it is.
    Land,
    /// Flies home and lands.
    Return,
}

/// What a vehicle is caught by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Catch {
    /// A wall: it goes nowhere but up and down.
    Wall,
    /// It rests on something, and moves no more.
    Ledge,
    /// It hangs in something and swings.
    Net,
    /// A wind stronger than it carries it off.
    Wind,
}

/// What flies the vehicle at this moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flown {
    /// The companion, by setpoints.
    Setpoints,
    /// The autopilot, by a command of the companion: a landing or a take-off.
    Commanded,
    /// The pilot, or the autopilot by itself.
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Target {
    at: Instant,
    position: Option<Point>,
    velocity: Point,
    acceleration: Point,
}

/// One autopilot with its vehicle.
#[derive(Clone, Debug)]
pub struct Autopilot {
    /// Which it is.
    pub kind: AutopilotKind,
    id: u8,
    mission_origin: Geodetic,
    ekf_origin: Geodetic,
    /// Truth.
    pub position: Point,
    /// Truth.
    pub velocity: Point,
    acceleration: Point,
    home: Point,
    /// Custom mode of HEARTBEAT.
    pub mode: u32,
    /// Motors on.
    pub armed: bool,
    critical: bool,
    /// The companion asked for the mode of landing.
    landing_commanded: bool,
    /// What a loss of setpoints leads to.
    pub on_loss: Failsafe,
    lost: bool,
    /// Velocity that the pilot asks for.
    pub pilot: Point,
    target: Option<Target>,
    takeoff_z: Option<f32>,
    airborne: bool,
    lifted_at: Option<Instant>,
    grounded_since: Option<Instant>,
    armed_at: Instant,
    /// What it is caught by, and where.
    caught: Option<(Catch, Point)>,
    guid_timeout_s: f32,
    streams: BTreeSet<u16>,
    sequence: u8,
    framer: Framer,
    phase: u64,
    /// What it was sent.
    pub check: SetpointCheck,
    /// Times it was armed.
    pub armings: u32,
}

impl Autopilot {
    /// On its pad, disarmed. `phase` shifts its streams in time.
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
            critical: false,
            landing_commanded: false,
            on_loss: Failsafe::Land,
            lost: false,
            pilot: Point::zeros(),
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
            phase,
            check,
            armings: 0,
        }
    }

    /// Off the ground.
    pub fn is_airborne(&self) -> bool {
        self.airborne
    }

    /// What flies it.
    pub fn flown(&self) -> Flown {
        if self.mode == self.kind.setpoint_mode() {
            if self.takeoff_z.is_some() { Flown::Commanded } else { Flown::Setpoints }
        } else if self.mode == self.kind.land_mode() && self.landing_commanded && !self.critical {
            Flown::Commanded
        } else {
            Flown::Other
        }
    }

    /// Where the last setpoint asked it to be.
    pub fn asked(&self) -> Option<Point> {
        self.target?.position
    }

    /// The pilot's switch.
    pub fn take_over(&mut self, velocity: Point) {
        self.enter(if self.kind == AutopilotKind::Px4 { PX4_POSITION } else { ARDUPILOT_LOITER });
        self.pilot = velocity;
    }

    /// The pilot gives Offboard or Guided back; PX4 only while setpoints come.
    pub fn give_back(&mut self, now: Instant) {
        if self.kind == AutopilotKind::ArduPilot || self.age_s(now) < 0.5 {
            self.enter(self.kind.setpoint_mode());
        }
    }

    /// The pilot lands it.
    pub fn pilot_lands(&mut self) {
        self.enter(self.kind.land_mode());
    }

    /// A failsafe of its own.
    pub fn fail(&mut self, how: Failsafe) {
        self.enter(match how {
            Failsafe::Land => self.kind.land_mode(),
            Failsafe::Return if self.kind == AutopilotKind::Px4 => px4::RTL,
            Failsafe::Return => ardupilot::RTL,
        });
        self.critical = true;
    }

    /// From now on something keeps it where it is.
    pub fn catch(&mut self, how: Catch) {
        self.caught = Some((how, self.position));
    }

    /// Whether something keeps it where it is.
    pub fn is_caught(&self) -> bool {
        self.caught.is_some()
    }

    fn enter(&mut self, mode: u32) {
        if mode != self.mode {
            // What was sent before was not followed.
            self.check.restart();
        }
        (self.mode, self.critical, self.lost, self.landing_commanded) = (mode, false, false, false);
        self.takeoff_z = None;
    }

    fn age_s(&self, now: Instant) -> f32 {
        self.target.map_or(f32::INFINITY, |target| (now - target.at).as_secs_f32())
    }

    /// One step of flight and telemetry; what it reports goes to `out`.
    pub fn step(&mut self, now: Instant, floor_z: f32, out: &mut Vec<u8>) {
        if self.kind == AutopilotKind::Px4
            && self.mode == px4::OFFBOARD
            && self.armed
            && self.age_s(now) > PX4_LOSS_S
        {
            self.fail(self.on_loss);
            self.lost = true;
        }
        self.fly(now, floor_z);
        self.report(now, out);
    }
}
