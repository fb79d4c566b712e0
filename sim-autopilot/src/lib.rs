//! A simulated autopilot with its vehicle: MAVLink bytes and fixed time steps in, MAVLink bytes and
//! motion out.
//!
//! It flies and answers as PX4 1.17 or ArduCopter 4.6 did in their own simulators and recordings.
//! It reads no clock and never blocks: the same bytes at the same steps with the same seed give the
//! same flight, bit for bit.
//!
//! Drain contract: call [`Autopilot::handle_bytes`] whenever bytes have arrived,
//! [`Autopilot::step`] once for each 4 ms of simulated time, and [`Autopilot::poll_transmit`] until
//! it returns 0. The physics are in the mission's ENU frame; MAVLink messages are in NED about the
//! vehicle's own EKF origin, in its autopilot's projection ([`physics::geodesy`]).
//!
//! ```
//! use sim_autopilot::{Autopilot, AutopilotConfig};
//!
//! let mut autopilot = Autopilot::new(&AutopilotConfig::default()).unwrap();
//! let mut buffer = [0; 512];
//! let mut bytes = 0;
//! for _ in 0..250 {
//!     autopilot.step(0.004, 0.0);
//!     loop {
//!         let len = autopilot.poll_transmit(&mut buffer);
//!         if len == 0 {
//!             break;
//!         }
//!         bytes += len;
//!     }
//! }
//! assert!(bytes > 10_000, "a second of PX4's flood");
//! ```
#![forbid(unsafe_code)]

pub mod ardupilot;
mod camera;
mod config;
mod inbox;
mod kinds;
pub mod link;
pub mod physics;
mod platform;
pub mod px4;
pub mod services;
mod software;
mod status;
pub mod telemetry;

use core::cell::OnceCell;

use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames::{self, Geodetic};

pub use self::camera::Photo;
pub use self::config::{AutopilotConfig, AutopilotConfigError};
pub use self::kinds::{EstimatorErrors, GpsFix, SimulatedKind};
use self::link::port::Port;
use self::link::routing;
use self::physics::vehicle::GRAVITY;
pub use self::physics::vehicle::{AirframeParameters, TrueState, power_ratio_at_speed};
use self::platform::{IntegralAction, Platform};
pub use self::px4::Px4Mode;
use self::software::AutopilotSoftware;
use self::status::{AutopilotFlags, MotorState};
use self::telemetry::snapshot::Snapshot;

/// One simulated vehicle with its autopilot and MAVLink ports.
#[derive(Clone, Debug)]
pub struct Autopilot {
    /// What does not depend on the kind of autopilot.
    platform: Platform,
    /// PX4 or ArduCopter.
    software: AutopilotSoftware,
    /// Buffer for the message ids that are due at one port in one step; empty between steps.
    due_messages: Vec<u32>,
}

impl Autopilot {
    /// An autopilot that has just booted, its vehicle at rest and disarmed.
    ///
    /// # Errors
    /// [`AutopilotConfigError`] where the configuration has an invalid value.
    pub fn new(config: &AutopilotConfig) -> Result<Self, AutopilotConfigError> {
        config::check(config)?;
        let mut platform = Platform::new(config, AutopilotSoftware::streams(config.autopilot));
        let mut software = AutopilotSoftware::new(config);
        software.send_boot_messages(&mut platform);
        Ok(Self { platform, software, due_messages: Vec::new() })
    }

    /// The vehicle's true position and motion, without errors of its estimator.
    pub fn true_state(&self) -> &TrueState {
        self.platform.vehicle.state()
    }

    /// Every picture taken since the last call (at most 100 000), with the true position and
    /// heading at which it was taken. The camera is fixed to the body and looks straight down.
    pub fn drain_photos(&mut self) -> Vec<Photo> {
        self.platform.camera.drain_photos()
    }

    /// `custom_mode` of HEARTBEAT: the flight mode in use, a failsafe's included.
    pub fn custom_mode(&self) -> u32 {
        self.software.status(&self.platform, &self.platform.sensors()).custom_mode
    }

    /// Whether the simulated autopilot is in its Land mode.
    pub fn is_in_land_mode(&self) -> bool {
        let land = match self.platform.config.autopilot {
            SimulatedKind::Px4 => Px4Mode::Land.custom_mode(),
            SimulatedKind::Ardupilot => ardupilot::CopterMode::Land.number(),
        };
        self.custom_mode() == land
    }

    /// Whether a failsafe is active.
    pub fn in_failsafe(&self) -> bool {
        self.software.in_failsafe()
    }

    /// Time since boot, microseconds.
    pub fn time_us(&self) -> u64 {
        self.platform.time_us
    }

    /// Wind at the vehicle now (mean and gust), ENU m/s.
    pub fn wind(&self) -> &Point {
        &self.platform.wind_and_noise.wind
    }

    /// Handles bytes that arrived at port 0.
    pub fn handle_bytes(&mut self, bytes: &[u8]) {
        self.handle_bytes_on(0, bytes);
    }

    /// Handles bytes that arrived at `port`; ignores them if there is no such port.
    pub fn handle_bytes_on(&mut self, port: usize, mut bytes: &[u8]) {
        if port >= self.platform.ports.len() {
            return;
        }
        let now_us = self.platform.time_us;
        while let Some(frame) = self.platform.ports[port].next_frame(now_us, &mut bytes) {
            if self.platform.config.forwards_between_ports {
                routing::forward_to_other_ports(
                    &mut self.platform.ports,
                    port,
                    self.platform.config.system_id,
                    &frame,
                );
            }
            self.handle_frame(port, &frame);
        }
    }

    /// Moves bytes to be sent from port 0 into `out`, whole frames only, and returns the number of
    /// bytes. 280 bytes hold any frame.
    pub fn poll_transmit(&mut self, out: &mut [u8]) -> usize {
        self.poll_transmit_from(0, out)
    }

    /// Like [`Autopilot::poll_transmit`], for any port.
    pub fn poll_transmit_from(&mut self, port: usize, out: &mut [u8]) -> usize {
        self.platform.ports.get_mut(port).map_or(0, |port| port.poll_transmit(out))
    }

    /// Adds a port with a ground station's stream rates as the last port, unless there is one. A
    /// reboot keeps that port.
    pub fn add_ground_port(&mut self) {
        let config = &mut self.platform.config;
        if !config.ground_port {
            config.ground_port = true;
            let streams = AutopilotSoftware::streams(config.autopilot);
            self.platform.ports.push(Port::for_ground(config.system_id, streams));
        }
    }

    /// Handles bytes that arrived at the ground station's port; ignores them if there is none.
    pub fn handle_ground_bytes(&mut self, bytes: &[u8]) {
        if self.platform.config.ground_port {
            self.handle_bytes_on(self.platform.ports.len() - 1, bytes);
        }
    }

    /// Like [`Autopilot::poll_transmit`], for the ground station's port.
    pub fn poll_ground_transmit(&mut self, out: &mut [u8]) -> usize {
        let last = self.platform.ports.len() - 1;
        if self.platform.config.ground_port { self.poll_transmit_from(last, out) } else { 0 }
    }

    /// Advances the simulation by `dt_s` (0.004): controller, motion, camera, telemetry.
    /// `ground_up_m` is the height of the ground below the vehicle in the mission frame, metres.
    pub fn step(&mut self, dt_s: f32, ground_up_m: f32) {
        self.platform.advance_time(dt_s, ground_up_m);
        let sensors = self.platform.sensors();
        let output = self.software.update(&mut self.platform, &sensors, dt_s);
        let (armed, landed) = (self.software.armed(), self.software.landed());
        let platform = &mut self.platform;
        platform.vehicle.set_flags(AutopilotFlags { armed, landed });
        match output.integral {
            IntegralAction::Keep => {}
            IntegralAction::SetToZero => platform.vehicle.reset_integral(),
            IntegralAction::Match => platform.vehicle.match_integral_to_demand(),
        }
        if output.motors == MotorState::Lifting {
            let gains = self.software.gains();
            let mut velocity = sensors.velocity;
            velocity.z += output.demand.height_rate_weight * (sensors.height_rate - velocity.z);
            platform.vehicle.control(&output.demand, gains, &sensors.position, &velocity, dt_s);
        }
        platform.last_demand = armed.then_some(output.demand);
        platform.vehicle.advance(output.motors, &platform.wind_and_noise.wind, ground_up_m, dt_s);
        platform.frame.recentre_if_far(platform.vehicle.position());
        platform.update_camera();
        self.transmit();
        if self.platform.reboot_us.is_some_and(|at_us| self.platform.time_us >= at_us) {
            self.reboot();
        }
    }

    /// Queues what is due at each port: messages requested once, COMMAND_ACKs, the next parameter
    /// of a list, streams.
    fn transmit(&mut self) {
        let now_us = self.platform.time_us;
        let mut snapshot = None;
        for index in 0..self.platform.ports.len() {
            let once = core::mem::take(&mut self.platform.ports[index].requested_once);
            if !once.is_empty() {
                let snapshot = snapshot.get_or_insert_with(|| self.snapshot());
                once.iter().for_each(|&id| {
                    snapshot.send(id, &mut self.platform.ports[index]);
                });
            }
            let port = &mut self.platform.ports[index];
            port.send_due_acks(now_us);
            self.platform.missions.retry_item_request(now_us, index, port);
            if let Some(next) = port.param_cursor
                && !port.is_congested()
            {
                self.send_param(index, next, next as u16);
                let more = next + 1 < self.software.params().len();
                self.platform.ports[index].param_cursor = more.then_some(next + 1);
            }
            let port = &mut self.platform.ports[index];
            if !port.has_due_stream(now_us) {
                continue;
            }
            let mut due = core::mem::take(&mut self.due_messages);
            port.take_due(now_us, &mut due);
            if !due.is_empty() {
                let snapshot = snapshot.get_or_insert_with(|| self.snapshot());
                for &id in &due {
                    snapshot.send(id, &mut self.platform.ports[index]);
                }
            }
            self.due_messages = due;
        }
    }

    /// The state for the telemetry messages of this step.
    fn snapshot(&mut self) -> Snapshot {
        let sensors = self.platform.sensors();
        let status = self.software.status(&self.platform, &sensors);
        let armed = self.software.armed();
        let platform = &mut self.platform;
        let error = platform.position_error().cast::<f64>();
        let position = *platform.vehicle.position() + error;
        let truth = platform.vehicle.state();
        let force = platform.vehicle.specific_force();
        let force = if truth.touching { Point::new(0.0, 0.0, GRAVITY) } else { force };
        let nan = Vector3::repeat(f64::NAN);
        let target = match &platform.last_demand {
            Some(demand) => [
                platform.frame.ned_from_enu(&demand.position.cast::<f64>()),
                platform.frame.ned_velocity_from_enu(&platform.vehicle.velocity_setpoint),
                platform.frame.ned_velocity_from_enu(&platform.vehicle.acceleration_setpoint),
            ],
            None => [nan, nan, Vector3::new(0.0, 0.0, 100.0)],
        };
        let heading_rate = truth.heading_rate;
        let noise = if platform.config.position_noise_m > 0.0 {
            platform.config.position_noise_m
        } else {
            0.0
        };
        let gps = if noise > 0.0 {
            (
                noise * platform.wind_and_noise.unit_sensor_noise(),
                noise * platform.wind_and_noise.unit_sensor_noise(),
                platform.gps_ok,
            )
        } else {
            (0.0, 0.0, platform.gps_ok)
        };
        Snapshot {
            time_us: platform.time_us,
            unix_us: platform.config.boot_unix_us + platform.time_us,
            system_id: platform.config.system_id,
            status,
            armed,
            mission_item_and_count: (
                platform.missions.progress.current_item,
                platform.missions.items().len() as u16,
            ),
            pictures: platform.camera.picture_count(),
            ned: platform.frame.ned_from_enu(&position),
            velocity: platform.frame.ned_velocity_from_enu(&sensors.velocity),
            geodetic: platform.frame.geodetic_from_enu(&position),
            gps_error_and_fix: gps,
            home: (platform.home, platform.frame.ned_from_enu(&platform.home_enu.cast::<f64>())),
            ekf_origin: *platform.frame.ekf_origin(),
            specific_force: frames::swap_enu_ned(&force),
            heading_and_rate: (sensors.heading, heading_rate),
            target,
            height_above_ground: platform.height_above_ground,
            accuracy: platform.config.estimator.accuracy_m(),
            battery: sensors.battery,
            attitude: OnceCell::new(),
        }
    }

    /// Reboots the autopilot: it keeps parameters, missions, battery charge and EKF origin, but not
    /// stream rates. The motors stop, so in the air the vehicle falls.
    pub fn reboot(&mut self) {
        let platform = &self.platform;
        let mut fresh = platform.config.clone();
        fresh.start = platform.vehicle.state().position;
        fresh.heading_rad = platform.vehicle.state().heading_rad;
        fresh.ekf_origin = *platform.frame.ekf_origin();
        fresh.seed = platform.config.seed.wrapping_add(1);
        let battery = platform.vehicle.state().battery;
        if let Ok(mut booted) = Self::new(&fresh) {
            booted.platform.vehicle.set_battery(battery);
            booted.platform.missions = self.platform.missions.clone();
            booted.platform.camera = self.platform.camera.after_reboot();
            booted.software.copy_params_from(&self.software);
            *self = booted;
        }
    }
}

/// Faults and outside influences that a scenario may impose on a vehicle.
impl Autopilot {
    /// Sets the mode given by its `custom_mode`, as the pilot's switch does, even if it cannot run.
    /// Returns false if the autopilot has no such mode.
    pub fn set_pilot_mode(&mut self, mode: impl Into<u32>) -> bool {
        let sensors = self.platform.sensors();
        self.software.force_mode(mode.into(), &sensors)
    }

    /// The pilot takes over: mode Position in PX4, BRAKE in ArduCopter. Both hold where the vehicle
    /// is.
    pub fn take_over_by_pilot(&mut self) {
        self.set_pilot_mode(match self.platform.config.autopilot {
            SimulatedKind::Px4 => Px4Mode::Position.custom_mode(),
            SimulatedKind::Ardupilot => ardupilot::CopterMode::Brake.number(),
        });
    }

    /// The pilot hands control back: mode Offboard in PX4, Guided in ArduCopter.
    pub fn return_from_pilot(&mut self) {
        self.set_pilot_mode(match self.platform.config.autopilot {
            SimulatedKind::Px4 => Px4Mode::Offboard.custom_mode(),
            SimulatedKind::Ardupilot => ardupilot::CopterMode::Guided.number(),
        });
    }

    /// Sets the battery's remaining charge, 0 to 1.
    pub fn set_battery(&mut self, charge: f32) {
        self.platform.vehicle.set_battery(charge);
    }

    /// Adds `offset` (ENU metres) to the position estimate from now on.
    pub fn jump_estimated_position(&mut self, offset: &Point) {
        self.platform.imposed_position_error += offset;
    }

    /// Sets the errors of the estimate (estimated minus true): position (ENU metres), velocity (ENU
    /// m/s) and rate of change of the height's error (m/s). A replay uses this to impose recorded
    /// errors.
    pub fn set_estimate_error(&mut self, position: &Point, velocity: &Point, height_rate: f32) {
        (self.platform.imposed_position_error, self.platform.imposed_velocity_error) =
            (*position, *velocity);
        self.platform.imposed_height_error_rate = height_rate;
    }

    /// Estimated position (ENU metres) and velocity (ENU m/s).
    pub fn estimate(&self) -> [Point; 2] {
        let sensors = self.platform.sensors();
        [sensors.position, sensors.velocity]
    }

    /// Moves the EKF origin to `origin` and sends GPS_GLOBAL_ORIGIN, as after a reset of the
    /// estimator.
    pub fn set_ekf_origin(&mut self, origin: Geodetic) {
        self.platform.frame.set_ekf_origin(origin);
        self.platform.announce_origin();
    }

    /// Moves the EKF origin by `by`, ENU metres, and sends GPS_GLOBAL_ORIGIN.
    pub fn move_ekf_origin(&mut self, by: &Point) {
        let origin = frames::enu_to_geodetic(self.platform.frame.ekf_origin(), by);
        self.set_ekf_origin(origin);
    }

    /// Sets PX4's failsafe after a loss of setpoints to Land (`COM_OBL_RC_ACT` 4), for flights
    /// under a ceiling: PX4's default is to climb and return. ArduCopter has no such parameter; it
    /// brakes.
    pub fn set_land_on_offboard_loss(&mut self) {
        if self.platform.config.autopilot == SimulatedKind::Px4 {
            self.set_parameter("COM_OBL_RC_ACT", 4).expect("PX4 has this parameter");
        }
    }

    /// Sets an integer parameter, as the user does before a flight.
    ///
    /// # Errors
    /// The autopilot has no integer parameter of this name.
    pub fn set_parameter(
        &mut self,
        name: &'static str,
        value: i32,
    ) -> Result<(), AutopilotConfigError> {
        if self.software.set_integer(name, value) {
            Ok(())
        } else {
            Err(AutopilotConfigError::NoIntegerParameter(name))
        }
    }

    /// Takes the GPS fix away or restores it.
    pub fn set_gps_fix(&mut self, fix: GpsFix) {
        self.platform.gps_ok = fix == GpsFix::Held;
        self.software.set_gps_fix(fix);
    }
}

#[cfg(test)]
mod tests;
