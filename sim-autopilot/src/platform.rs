//! What both simulated autopilots share: vehicle, estimator, camera, ports, home, stored missions.

use crate::link::cmd;
use planner_core::Point;
use planner_core::geo::frames::{self, Geodetic};

use crate::SimulatedKind;
use crate::camera::{CameraTrigger, Photo};
use crate::config::AutopilotConfig;
use crate::link::command::{ACCEPTED, CommandOutcome, ReceivedCommand, message_id_from_param};
use crate::link::msg::{GPS_GLOBAL_ORIGIN, HOME_POSITION, MESSAGE_INTERVAL};
use crate::link::port::{PendingAck, Port, Sender};
use crate::link::wire::PayloadReader;
use crate::physics::estimator::EstimateErrorState;
use crate::physics::geodesy::LocalFrame;
use crate::physics::noise::{self, Disturbance};
use crate::physics::vehicle::{Demand, Multicopter};
use crate::services::mission::Missions;
use crate::status::MotorState;

/// Delay of a COMMAND_ACK, microseconds: one step. In recordings PX4 took 1.3 to 16 ms and
/// ArduCopter took 2.5 to 7 ms.
const ANSWER_DELAY_US: u64 = 4_000;
/// Time from the command to reboot until the reboot, microseconds: the COMMAND_ACK is sent before.
const REBOOT_DELAY_US: u64 = 200_000;

/// Sensor readings and estimate that the autopilot's mode logic uses in one step.
#[derive(Clone, Copy, Debug)]
pub struct SensorReadings {
    /// Time since boot, microseconds.
    pub now_us: u64,
    /// Estimated position, ENU metres.
    pub position: Point,
    /// Estimated velocity, ENU m/s.
    pub velocity: Point,
    /// Rate of change of the estimated height, m/s, errors included.
    pub height_rate: f32,
    /// True acceleration (0 at rest, so not the specific force), ENU m/s².
    pub acceleration: Point,
    /// True heading, radians clockwise from north.
    pub heading: f32,
    /// Whether the body touches the ground.
    pub touching: bool,
    /// Reading of the distance sensor: height of the body above where it would rest on the ground,
    /// metres; infinite without a sensor.
    pub ground_distance: f32,
    /// Home position, ENU metres.
    pub home: Point,
    /// Remaining battery charge, 0 to 1.
    pub battery: f32,
}

/// What the flight mode gives to the position controller in one step.
#[derive(Clone, Copy, Debug)]
pub struct FlightModeOutput {
    /// Whether the motors carry weight.
    pub motors: MotorState,
    /// What to do with the velocity controller's integral.
    pub integral: IntegralAction,
    /// Position, velocity and limits that the mode demands.
    pub demand: Demand,
}

/// What to do with the velocity controller's integral in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegralAction {
    /// Continue integrating.
    Keep,
    /// Set it to zero, as on the ground.
    SetToZero,
    /// Set it to the acceleration commanded in the last step minus the true one, as ArduCopter does
    /// when its controller starts in flight.
    Match,
}

/// The state that does not depend on the kind of autopilot: vehicle, errors of the estimate, ports,
/// home, missions, camera.
#[derive(Clone, Debug)]
pub struct Platform {
    pub(super) config: AutopilotConfig,
    /// Time since boot, microseconds.
    pub(super) time_us: u64,
    /// Time at which `wind_and_noise` and `estimator_errors` change next, microseconds since boot.
    next_noise_us: u64,
    pub(super) vehicle: Multicopter,
    /// Wind, and the errors of `position_noise_m`.
    pub(super) wind_and_noise: Disturbance,
    /// Errors by the estimator's model ([`crate::EstimatorErrors`]).
    pub(super) estimator_errors: EstimateErrorState,
    /// Error of the position estimate (estimated minus true) that a replay or fault imposes, ENU
    /// metres.
    pub(super) imposed_position_error: Point,
    /// Error of the velocity estimate (estimated minus true) that a replay imposes, ENU m/s.
    pub(super) imposed_velocity_error: Point,
    /// Rate of change of the height estimate's error that a replay imposes, m/s.
    pub(super) imposed_height_error_rate: f32,
    /// Whether GPS has a fix.
    pub(super) gps_ok: bool,
    /// Conversions between the autopilot's frame and the mission frame.
    pub(super) frame: LocalFrame,
    /// Home position.
    pub(super) home: Geodetic,
    /// Home position, ENU metres in the mission frame.
    pub(super) home_enu: Point,
    /// Whether a command or the configuration set home, so that arming does not move it.
    home_fixed: bool,
    /// True height of the body above where it would rest on the ground, metres.
    pub(super) height_above_ground: f32,
    /// Demand of the last step; `None` while disarmed.
    pub(super) last_demand: Option<Demand>,
    pub(super) ports: Vec<Port>,
    /// Stored missions, and the progress of the one that is flown.
    pub(super) missions: Missions,
    /// The camera and its trigger.
    pub(super) camera: CameraTrigger,
    /// Time of the commanded reboot, microseconds since boot; `None` without one.
    pub(super) reboot_us: Option<u64>,
}

impl Platform {
    pub(super) fn new(config: &AutopilotConfig, streams: &[(u32, u32)]) -> Self {
        let mut airframe = config.vehicle;
        airframe.drag_per_s *= config.autopilot.drag_factor();
        airframe.wind_per_s *= config.autopilot.wind_factor();
        let mut vehicle = Multicopter::new(airframe, config.start);
        vehicle.set_heading(config.heading_rad);
        let start = config.start.cast::<f64>();
        let projection = config.autopilot.projection();
        let frame = LocalFrame::new(projection, config.world_origin, config.ekf_origin, start);
        let ports = (0..config.ports.max(1)).map(|_| Port::new(config.system_id, streams));
        let ground = config.ground_port.then(|| Port::for_ground(config.system_id, streams));
        let home = config.home.unwrap_or_else(|| frame.geodetic_from_enu(&start));
        let seed = config.vehicle_seed();
        Self {
            time_us: 0,
            next_noise_us: 0,
            wind_and_noise: Disturbance::new(
                config.wind,
                config.gust_peak_mps,
                config.position_noise_m,
                seed,
            ),
            estimator_errors: EstimateErrorState::new(config.estimator, config.autopilot, seed),
            imposed_position_error: Point::zeros(),
            imposed_velocity_error: Point::zeros(),
            imposed_height_error_rate: 0.0,
            gps_ok: true,
            home,
            home_enu: frames::geodetic_to_enu(&config.world_origin, &home),
            home_fixed: config.home.is_some(),
            height_above_ground: 0.0,
            last_demand: None,
            ports: ports.chain(ground).collect(),
            missions: Missions::default(),
            camera: CameraTrigger::default(),
            reboot_us: None,
            vehicle,
            frame,
            config: config.clone(),
        }
    }

    /// Advances time, wind and estimate errors by `dt_s`, and computes the height above the ground
    /// at `ground_up_m`.
    pub(super) fn advance_time(&mut self, dt_s: f32, ground_up_m: f32) {
        self.time_us += libm::roundf(dt_s * 1e6) as u64;
        if self.time_us >= self.next_noise_us {
            self.next_noise_us += (noise::UPDATE_PERIOD_S * 1e6) as u64;
            self.wind_and_noise.advance();
            self.estimator_errors.advance();
        }
        self.height_above_ground =
            self.vehicle.state().position.z - ground_up_m - self.config.vehicle.radius_m;
    }

    /// What the autopilot estimates and measures now.
    pub(super) fn sensors(&self) -> SensorReadings {
        let state = self.vehicle.state();
        SensorReadings {
            now_us: self.time_us,
            position: state.position + self.position_error(),
            velocity: state.velocity
                + self.wind_and_noise.velocity_error
                + self.imposed_velocity_error
                + self.estimator_errors.velocity,
            height_rate: state.velocity.z
                + self.imposed_height_error_rate
                + self.estimator_errors.position_rate.z,
            acceleration: state.acceleration,
            heading: state.heading_rad,
            touching: state.touching,
            ground_distance: if self.config.distance_sensor {
                self.height_above_ground
            } else {
                f32::INFINITY
            },
            home: self.home_enu,
            battery: state.battery,
        }
    }

    /// Error of the position estimate: estimated minus true, ENU metres.
    pub(super) fn position_error(&self) -> Point {
        self.wind_and_noise.position_error
            + self.estimator_errors.position
            + self.imposed_position_error
    }

    /// Sets home for good (arming does not move it), and queues HOME_POSITION.
    pub(super) fn set_fixed_home(&mut self, home: Geodetic) {
        self.home = home;
        self.home_enu = frames::geodetic_to_enu(&self.config.world_origin, &home);
        self.home_fixed = true;
        self.send_on_all_ports(HOME_POSITION);
    }

    /// Sets home to the estimated position and sends HOME_POSITION, as both autopilots do on
    /// arming; not if home was set by command or configuration.
    pub(super) fn set_home_here_unless_fixed(&mut self) {
        if self.home_fixed {
            return;
        }
        let position = self.sensors().position;
        self.home_enu = position;
        self.home = self.frame.geodetic_from_enu(&position.cast::<f64>());
        self.send_on_all_ports(HOME_POSITION);
    }

    /// Executes DO_SET_CAM_TRIGG_DIST or DO_DIGICAM_CONTROL and queues its COMMAND_ACK. PX4 answers
    /// at the camera driver's next check.
    pub(super) fn handle_camera_command(&mut self, from: Sender, command: &ReceivedCommand) {
        self.execute_camera_command(command);
        let soon_us = self.time_us + ANSWER_DELAY_US;
        let answer_us = match self.config.autopilot {
            SimulatedKind::Px4 => self.camera.next_poll_us().max(soon_us),
            SimulatedKind::Ardupilot => soon_us,
        };
        let ack =
            PendingAck { command: command.id, result: ACCEPTED, to: from.system_and_component() };
        self.ports[from.port].pending_acks.push((answer_us, ack));
    }

    /// Executes the same commands as `handle_camera_command`, but queues no COMMAND_ACK.
    pub(super) fn execute_camera_command(&mut self, command: &ReceivedCommand) {
        if command.id == cmd::DO_DIGICAM_CONTROL {
            self.camera.handle_digicam_control(command);
        } else {
            self.camera.handle_trigger_distance(command);
        }
    }

    /// Takes a picture if one is due, and queues the message about it on every port.
    pub(super) fn update_camera(&mut self) {
        let state = self.vehicle.state();
        let truth = Photo {
            time_us: self.time_us,
            position: state.position,
            heading_rad: state.heading_rad,
        };
        let estimate = self.gps_ok.then(|| state.position + self.position_error());
        if let Some(message) = self.camera.update(self.config.autopilot, truth, estimate) {
            self.send_on_all_ports(message);
        }
    }

    /// Schedules a reboot, late enough for the COMMAND_ACK to be sent.
    pub(super) fn schedule_reboot(&mut self) {
        self.reboot_us = Some(self.time_us + REBOOT_DELAY_US);
    }

    /// Queues GPS_GLOBAL_ORIGIN on every port.
    pub(super) fn announce_origin(&mut self) {
        self.send_on_all_ports(GPS_GLOBAL_ORIGIN);
    }

    /// Queues message `id` on every port, once, to be sent at the end of the step that runs or else
    /// comes next.
    pub(super) fn send_on_all_ports(&mut self, id: u32) {
        for port in &mut self.ports {
            if !port.requested_once.contains(&id) {
                port.requested_once.push(id);
            }
        }
    }

    /// Queues a STATUSTEXT on every port.
    pub(super) fn send_text(&mut self, severity: u8, text: &str) {
        self.ports.iter_mut().for_each(|port| port.send_text(severity, text));
    }

    /// Handles a message of the mission protocol.
    pub(super) fn handle_mission(&mut self, from: Sender, id: u32, fields: &PayloadReader<'_>) {
        self.missions.handle_message(self.time_us, &mut self.ports[from.port], from, id, fields);
    }

    /// Queues a COMMAND_ACK to the command's sender, due after [`ANSWER_DELAY_US`].
    pub(super) fn acknowledge(&mut self, from: Sender, command: u16, result: u8) {
        let ack = PendingAck { command, result, to: from.system_and_component() };
        self.ports[from.port].pending_acks.push((self.time_us + ANSWER_DELAY_US, ack));
    }

    /// Target of DO_REPOSITION in ENU metres, NaN on axes that the command leaves out; `None` if
    /// latitude, longitude or altitude is invalid.
    pub(super) fn reposition_target(&self, command: &ReceivedCommand) -> Option<Point> {
        let here = self.frame.geodetic_from_enu(self.vehicle.position());
        let [lat_deg, lon_deg] = command.lat_lon_deg;
        let base = if command.relative_to_home { self.home.alt_m } else { 0.0 };
        let across = lat_deg.is_finite() && lon_deg.is_finite();
        let asked = Geodetic {
            lat_deg: if across { lat_deg } else { here.lat_deg },
            lon_deg: if across { lon_deg } else { here.lon_deg },
            alt_m: if command.z.is_finite() { f64::from(command.z) + base } else { here.alt_m },
        };
        if !asked.is_valid() {
            return None;
        }
        let enu = self.frame.enu_from_geodetic(&asked).cast::<f32>();
        let (east, north) = if across { (enu.x, enu.y) } else { (f32::NAN, f32::NAN) };
        Some(Point::new(east, north, if command.z.is_finite() { enu.z } else { f32::NAN }))
    }

    /// Executes DO_SET_HOME. Refused if the commanded position is invalid.
    pub(super) fn handle_set_home(&mut self, command: &ReceivedCommand) -> CommandOutcome {
        let [lat_deg, lon_deg] = command.lat_lon_deg;
        let home = if command.param[0] == 1.0 {
            self.frame.geodetic_from_enu(self.vehicle.position())
        } else {
            Geodetic { lat_deg, lon_deg, alt_m: f64::from(command.z) }
        };
        if !home.is_valid() {
            return CommandOutcome::Refused;
        }
        self.set_fixed_home(home);
        CommandOutcome::Done
    }

    /// Executes SET_MESSAGE_INTERVAL and returns the MAV_RESULT. An interval of 0 restores the
    /// default in `streams`, a negative one switches the stream off. `refused` is the result for an
    /// unknown message id.
    pub(super) fn set_interval(
        &mut self,
        from: Sender,
        command: &ReceivedCommand,
        streams: &[(u32, u32)],
        refused: u8,
    ) -> u8 {
        let Some(id) = message_id_from_param(command.param[0]) else { return refused };
        let interval = match command.param[1] {
            0.0 => streams.iter().find(|stream| stream.0 == id).map_or(0, |stream| stream.1),
            us if us < 0.0 => 0,
            us => us as u32,
        };
        let now = self.time_us;
        if self.ports[from.port].set_interval(id, interval, now) { ACCEPTED } else { refused }
    }

    /// Executes GET_MESSAGE_INTERVAL: queues MESSAGE_INTERVAL and returns the MAV_RESULT, `refused`
    /// for an unknown message id.
    pub(super) fn report_interval(&mut self, from: Sender, id: f32, refused: u8) -> u8 {
        let port = &mut self.ports[from.port];
        let Some(stream) = message_id_from_param(id)
            .and_then(|id| port.streams.iter().find(|stream| stream.id == id))
        else {
            return refused;
        };
        let interval_us = if stream.interval_us == 0 { -1 } else { stream.interval_us as i32 };
        let mut payload = [0; 6];
        payload[..4].copy_from_slice(&interval_us.to_le_bytes());
        payload[4..].copy_from_slice(&(stream.id as u16).to_le_bytes());
        port.send_raw(MESSAGE_INTERVAL, &payload);
        ACCEPTED
    }
}
