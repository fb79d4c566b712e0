//! A simulated autopilot: bytes of MAVLink and fixed time steps in, bytes and motion out.
//!
//! It flies as PX4 1.17 was seen to fly and says what PX4 was seen to say. Nothing in it reads a clock or blocks: the
//! same bytes at the same steps give the same flight, bit for bit, from the same seed.
//!
//! Drain contract: call [`Autopilot::handle_bytes`] whenever bytes have arrived, [`Autopilot::step`] once for each
//! 4 ms of simulated time, and [`Autopilot::poll_transmit`] until it returns 0. Physics are in the mission's ENU frame;
//! what is said and heard is NED about the vehicle's own EKF origin in PX4's projection ([`geodesy`]).
//!
//! ```
//! use host_sim::autopilot::{Autopilot, Config};
//!
//! let mut autopilot = Autopilot::new(&Config::default()).unwrap();
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

mod config;
pub mod geodesy;
mod inbox;
mod messages;
pub mod noise;
pub mod port;
pub mod px4;
pub mod server;
pub mod telemetry;
pub mod vehicle;
pub mod wire;

use core::cell::OnceCell;

use nalgebra::Vector3;
use planner_core::Point;
use planner_core::frames::{self, Geodetic, Projection};

pub use self::config::{Config, ConfigError, Personality};
use self::geodesy::LocalFrame;
use self::noise::Disturbance;
use self::port::Port;
pub use self::px4::Mode;
use self::px4::params::{Params, TYPE_INT32, Tuning};
use self::px4::{Commander, Sense};
use self::telemetry::Snapshot;
use self::vehicle::{Demand, Vehicle};
pub use self::vehicle::{State, VehicleLimits};

/// One simulated vehicle with its autopilot.
#[derive(Clone, Debug)]
pub struct Autopilot {
    config: Config,
    time_us: u64,
    slot_us: u64,
    vehicle: Vehicle,
    disturbance: Disturbance,
    jump: Point,
    gps_ok: bool,
    frame: LocalFrame,
    commander: Commander,
    params: Params,
    tuning: Tuning,
    home: Geodetic,
    home_enu: Point,
    home_fixed: bool,
    height: f32,
    demand: Option<Demand>,
    ports: Vec<Port>,
    due: Vec<u32>,
}

impl Autopilot {
    /// An autopilot at rest, disarmed, in Hold.
    ///
    /// # Errors
    /// Refuses what [`ConfigError`] names.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        config::check(config)?;
        let mut vehicle = Vehicle::new(config.vehicle, config.start);
        vehicle.set_heading(config.heading_rad);
        let start = config.start.cast::<f64>();
        let frame = LocalFrame::new(Projection::Px4, config.world_origin, config.ekf_origin, start);
        let params = Params::new(config.system_id, &config.vehicle);
        let ports = (0..config.ports.max(1)).map(|_| Port::new(config.system_id, &telemetry::STREAMS));
        let home = config.home.unwrap_or_else(|| frame.geodetic(&start));
        let mut autopilot = Self {
            time_us: 0,
            slot_us: 0,
            disturbance: Disturbance::new(
                config.wind,
                config.gust_mps,
                config.position_noise_m,
                config.seed ^ (u64::from(config.system_id) << 32),
            ),
            jump: Point::zeros(),
            gps_ok: true,
            tuning: params.tuning(),
            params,
            commander: Commander::new(),
            home,
            home_enu: frames::geodetic_to_enu(&config.world_origin, &home),
            home_fixed: config.home.is_some(),
            height: 0.0,
            demand: None,
            ports: ports.collect(),
            due: Vec::new(),
            vehicle,
            frame,
            config: config.clone(),
        };
        autopilot.announce_origin();
        Ok(autopilot)
    }

    /// The truth about the vehicle.
    pub fn truth(&self) -> &State {
        self.vehicle.state()
    }

    /// The flight mode that flies.
    pub fn mode(&self) -> Mode {
        self.commander.mode()
    }

    /// Whether a failsafe flies.
    pub fn in_failsafe(&self) -> bool {
        self.commander.in_failsafe()
    }

    /// Microseconds since boot.
    pub fn time_us(&self) -> u64 {
        self.time_us
    }

    /// Wind at the vehicle now, ENU m/s.
    pub fn wind(&self) -> &Point {
        &self.disturbance.wind
    }

    /// Framing counters of a port.
    pub fn counters(&self, port: usize) -> companion::frame::Counters {
        self.ports.get(port).map(Port::counters).unwrap_or_default()
    }

    /// Takes bytes that arrived at port 0.
    pub fn handle_bytes(&mut self, bytes: &[u8]) {
        self.handle_bytes_on(0, bytes);
    }

    /// Takes bytes that arrived at a port; a port that is not there ignores them.
    pub fn handle_bytes_on(&mut self, port: usize, mut bytes: &[u8]) {
        if port >= self.ports.len() {
            return;
        }
        while let Some(frame) = self.ports[port].next_frame(self.time_us, &mut bytes) {
            self.handle_frame(port, &frame);
        }
    }

    /// Moves bytes to send at port 0 into `out`, whole frames only; the bytes moved. 280 bytes fit any frame.
    pub fn poll_transmit(&mut self, out: &mut [u8]) -> usize {
        self.poll_transmit_from(0, out)
    }

    /// As [`Autopilot::poll_transmit`], of any port.
    pub fn poll_transmit_from(&mut self, port: usize, out: &mut [u8]) -> usize {
        self.ports.get_mut(port).map_or(0, |port| port.poll_transmit(out))
    }

    /// Advances time by `dt_s` (0.004) over ground at `ground_up_m` below the vehicle, in the mission frame.
    pub fn step(&mut self, dt_s: f32, ground_up_m: f32) {
        self.time_us += libm::roundf(dt_s * 1e6) as u64;
        if self.time_us >= self.slot_us {
            self.slot_us += (noise::SLOT_S * 1e6) as u64;
            self.disturbance.advance();
        }
        self.height = self.vehicle.state().position.z - ground_up_m - self.config.vehicle.radius_m;
        let was_armed = self.commander.armed();
        let sense = self.sense();
        let order = self.commander.update(&sense, &self.tuning);
        self.vehicle.set_flags(self.commander.armed(), self.commander.landed());
        if order.reset {
            self.vehicle.reset_integral();
        }
        if order.lift {
            self.vehicle.control(&order.demand, &self.tuning.gains, &sense.position, &sense.velocity, dt_s);
        }
        self.demand = self.commander.armed().then_some(order.demand);
        self.vehicle.advance(order.lift, &self.disturbance.wind, ground_up_m, dt_s);
        self.frame.follow(self.vehicle.position());
        if was_armed && !self.commander.armed() {
            self.vehicle.set_flags(false, self.commander.landed());
        }
        self.transmit();
    }

    pub(crate) fn sense(&self) -> Sense {
        let state = self.vehicle.state();
        Sense {
            now_us: self.time_us,
            position: state.position + self.disturbance.position_error + self.jump,
            velocity: state.velocity + self.disturbance.velocity_error,
            heading: state.heading_rad,
            touching: state.touching,
            height: self.height,
            home: self.home_enu,
            battery: state.battery,
        }
    }

    pub(crate) fn home(&self) -> &Geodetic {
        &self.home
    }

    pub(crate) fn set_fixed_home(&mut self, home: Geodetic) {
        self.home = home;
        self.home_enu = frames::geodetic_to_enu(&self.config.world_origin, &home);
        self.home_fixed = true;
        self.broadcast(242);
    }

    /// Home where it stands, as PX4 sets it on arming.
    pub(crate) fn set_home_here(&mut self) {
        if self.home_fixed {
            return;
        }
        let position = self.sense().position;
        self.home_enu = position;
        self.home = self.frame.geodetic(&position.cast::<f64>());
        self.broadcast(242);
    }

    fn transmit(&mut self) {
        let mut snapshot = None;
        for index in 0..self.ports.len() {
            while let Some(ack) = self.ports[index].later.pop() {
                self.ports[index].send_ack(ack);
            }
            if let Some(next) = self.ports[index].param_cursor
                && !self.ports[index].is_congested()
            {
                self.send_param(index, next);
                self.ports[index].param_cursor = (next + 1 < self.params.len()).then_some(next + 1);
            }
            if !self.ports[index].is_due(self.time_us) {
                continue;
            }
            let mut due = core::mem::take(&mut self.due);
            self.ports[index].take_due(self.time_us, &mut due);
            if !due.is_empty() {
                let snapshot = snapshot.get_or_insert_with(|| self.snapshot());
                for &id in &due {
                    snapshot.send(id, &mut self.ports[index]);
                }
            }
            self.due = due;
        }
    }

    /// Sends one message through one port; false where there is no such message.
    pub(crate) fn send_message(&mut self, port: usize, id: u32) -> bool {
        let snapshot = self.snapshot();
        snapshot.send(id, &mut self.ports[port])
    }

    fn broadcast(&mut self, id: u32) {
        let snapshot = self.snapshot();
        for port in &mut self.ports {
            snapshot.send(id, port);
        }
    }

    fn snapshot(&mut self) -> Snapshot {
        let sense = self.sense();
        let position = *self.vehicle.position() + (self.disturbance.position_error + self.jump).cast::<f64>();
        let (status, flags) = self.commander.heartbeat(self.time_us, &self.tuning);
        let force = self.vehicle.specific_force();
        let force =
            if self.vehicle.state().touching { Point::new(0.0, 0.0, vehicle::GRAVITY) } else { force };
        let nan = Vector3::repeat(f64::NAN);
        let target = match &self.demand {
            Some(demand) => [
                self.frame.ned(&demand.position.cast::<f64>()),
                self.frame.ned_rate(&self.vehicle.velocity_setpoint),
                self.frame.ned_rate(&self.vehicle.acceleration_setpoint),
            ],
            None => [nan, nan, Vector3::new(0.0, 0.0, 100.0)],
        };
        let noise = if self.config.position_noise_m > 0.0 { self.config.position_noise_m } else { 0.0 };
        let gps = if noise > 0.0 {
            (noise * self.disturbance.sensor(), noise * self.disturbance.sensor(), self.gps_ok)
        } else {
            (0.0, 0.0, self.gps_ok)
        };
        Snapshot {
            time_us: self.time_us,
            unix_us: self.config.boot_unix_us + self.time_us,
            system_id: self.config.system_id,
            mode: (self.commander.mode().custom_mode(), flags, status),
            intended_mode: self.commander.intention().custom_mode(),
            armable: self.commander.armable(&sense, &self.tuning),
            armed: self.commander.armed(),
            landed_state: self.commander.landed_state(),
            ned: self.frame.ned(&position),
            velocity: self.frame.ned_rate(&sense.velocity),
            geodetic: self.frame.geodetic(&position),
            gps,
            home: (self.home, self.frame.ned(&self.home_enu.cast::<f64>())),
            ekf_origin: *self.frame.ekf_origin(),
            specific_force: frames::swap_enu_ned(&force),
            heading: (sense.heading, self.vehicle.state().heading_rate),
            target,
            height: self.height,
            battery: sense.battery,
            attitude: OnceCell::new(),
        }
    }

    fn announce_origin(&mut self) {
        self.broadcast(49);
    }

    /// Starts anew: parameters, charge and EKF origin stay, the motors stop. In the air it falls.
    pub fn reboot(&mut self) {
        let mut fresh = self.config.clone();
        fresh.start = self.vehicle.state().position;
        fresh.heading_rad = self.vehicle.state().heading_rad;
        fresh.ekf_origin = *self.frame.ekf_origin();
        fresh.seed = self.config.seed.wrapping_add(1);
        let battery = self.vehicle.state().battery;
        if let Ok(mut booted) = Self::new(&fresh) {
            booted.vehicle.set_battery(battery);
            booted.params = self.params.clone();
            booted.tuning = self.tuning;
            *self = booted;
        }
    }
}

/// Faults: what a scenario may do to a vehicle.
impl Autopilot {
    /// The pilot's switch: changes the mode without asking whether it can run.
    pub fn set_pilot_mode(&mut self, mode: Mode) {
        let sense = self.sense();
        self.commander.force_mode(mode, &sense);
    }

    /// Sets the charge left, 0 to 1.
    pub fn set_battery(&mut self, charge: f32) {
        self.vehicle.set_battery(charge);
    }

    /// Shifts the position estimate by ENU metres from now on.
    pub fn jump_position(&mut self, offset: &Point) {
        self.jump += offset;
    }

    /// Moves the EKF origin and says so, as an estimator that resets does.
    pub fn set_ekf_origin(&mut self, origin: Geodetic) {
        self.frame.set_ekf_origin(origin);
        self.announce_origin();
    }

    /// The same, by ENU metres.
    pub fn move_ekf_origin(&mut self, by: &Point) {
        let origin = frames::enu_to_geodetic(self.frame.ekf_origin(), by);
        self.set_ekf_origin(origin);
    }

    /// Sets an integer parameter as an installer does before the flight.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn set_parameter(&mut self, name: &'static str, value: i32) -> Result<(), ConfigError> {
        let wire = f32::from_bits(value as u32);
        self.params.set(name, wire, TYPE_INT32).ok_or(ConfigError::Parameter(name))?;
        self.tuning = self.params.tuning();
        Ok(())
    }

    /// Takes the GPS fix away or gives it back; without it no position control flies.
    pub fn set_gps_ok(&mut self, ok: bool) {
        self.gps_ok = ok;
        self.commander.set_position_ok(ok);
    }
}

#[cfg(test)]
mod tests;
