//! One simulated vehicle of the swarm: companion, autopilot and the serial link between them.

mod observed;

use anyhow::Context;
use companion::storage::store::{MAX_READ_LEN, Store};
use companion::{Config, Event, Instant, Link, PlanKind, PlanRequests, State};
use planner_core::Point;
use sim_autopilot::{Autopilot, Photo};

use super::board::{BoardLinks, RemoteCompanion};
use super::radio::Radio;
use super::serial::{SerialLink, SimulatedSerialConfig};
use super::step::{STEP_S, STEP_US};
use crate::boards::STACK_LEN;
use crate::capacity::{HostCompanion, MAX_VEHICLES, new_companion};
use crate::coverage::check::Picture;
use crate::flash::{HOST_FLASH_LAYOUT, HostFlash};
use crate::mission::{OwnPlan, PreparedMission};
use crate::report::{self, Level};
use crate::say;

/// Steps between two measurements of the ground's height below a vehicle, which changes slowly.
const GROUND_CHECK_STEPS: u64 = 25;

/// How the simulation answers a companion that requests a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlanAnswer {
    /// With the right plan, at once.
    #[default]
    Correct,
    /// Not at all.
    Withheld,
    /// With the result of planning on a damaged roadmap.
    BadRoadmap,
}

/// One vehicle of the simulated swarm.
pub struct SimulatedVehicle {
    /// Autopilot of the vehicle.
    pub autopilot: Autopilot,
    /// The companion in this process; idle if `board` flies the vehicle.
    pub companion: Box<HostCompanion>,
    /// The board or process whose companion flies the vehicle instead of `companion`.
    board: Option<RemoteCompanion>,
    /// Flash of the companion; `None`: it has no store.
    flash: Option<HostFlash>,
    /// The plans that the companion has requested and not got yet.
    plan_requests: PlanRequests,
    /// How a plan request is answered.
    pub plan_answer: PlanAnswer,
    /// First and last warning of the mission table since `Follow` was entered or `Aborted` left.
    warnings: Option<[&'static str; 2]>,
    /// When the vehicle first left the ground, seconds. `None` before.
    pub took_off_s: Option<f64>,
    /// When the vehicle first stood on the ground again, disarmed, seconds; `None` for a vehicle
    /// that lost its power before.
    pub landed_s: Option<f64>,
    /// When the vehicle first stood or lay on the ground again, its motors off, seconds.
    pub back_on_ground_s: Option<f64>,
    /// When the vehicle lost its power, or its motors in the air, seconds. `None` if it did not.
    pub power_lost_at_s: Option<f64>,
    config: Config<MAX_VEHICLES>,
    to_companion: SerialLink,
    to_autopilot: SerialLink,
    /// Height of ground or obstacle below the vehicle, metres ENU, as last measured.
    ground_m: f32,
    received_bytes: Vec<u8>,
    /// When the companion last started, microseconds of simulation time.
    companion_started_us: u64,
    /// Simulation time until which the autopilot boots, microseconds.
    boots_until_us: u64,
    /// Whether the vehicle has lost all power.
    power_cut: bool,
    wrecked: bool,
}

impl SimulatedVehicle {
    /// A vehicle on its pad, switched on.
    pub fn new(
        autopilot: &sim_autopilot::AutopilotConfig,
        config: Config<MAX_VEHICLES>,
        serial: SimulatedSerialConfig,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let id = u64::from(autopilot.system_id);
        Ok(Self {
            autopilot: Autopilot::new(autopilot)?,
            companion: new_companion(config.clone())?,
            board: None,
            flash: None,
            config,
            plan_requests: PlanRequests::new(),
            plan_answer: PlanAnswer::Correct,
            warnings: None,
            took_off_s: None,
            landed_s: None,
            back_on_ground_s: None,
            power_lost_at_s: None,
            to_companion: SerialLink::new(serial, seed, 2 * id),
            to_autopilot: SerialLink::new(serial, seed, 2 * id + 1),
            ground_m: autopilot.start.z - autopilot.vehicle.radius_m,
            received_bytes: Vec::new(),
            companion_started_us: 0,
            boots_until_us: 0,
            power_cut: false,
            wrecked: false,
        })
    }

    /// Restarts the companion with this flash as its store.
    ///
    /// # Errors
    /// As [`Self::new`]; none if that succeeded with the same settings.
    pub fn attach_flash(&mut self, flash: HostFlash) -> anyhow::Result<()> {
        self.flash = Some(flash);
        self.start_companion()
    }

    fn start_companion(&mut self) -> anyhow::Result<()> {
        self.companion = new_companion(self.config.clone())?;
        if let Some(flash) = &mut self.flash {
            self.companion.attach_store(Store::mount(HOST_FLASH_LAYOUT, flash));
        }
        Ok(())
    }

    /// From now on this board flies the vehicle instead of the companion in this process.
    pub fn attach_board(&mut self, board: RemoteCompanion) {
        self.board = Some(board);
    }

    /// Prints how much stack the vehicle's board used, if that board is in lock step.
    ///
    /// # Errors
    /// The board is gone.
    pub fn print_stack_use(&mut self) -> anyhow::Result<()> {
        let (id, board) = (self.system_id(), self.board.as_mut());
        if let Some(used) = board.map(RemoteCompanion::max_stack_used).transpose()?.flatten() {
            say!("board {id}: stack: {used} of {STACK_LEN} bytes used");
        }
        Ok(())
    }

    /// State of the companion's mission.
    pub fn state(&self) -> State {
        self.board.as_ref().map_or_else(|| self.companion.state(), RemoteCompanion::state)
    }

    /// MAVLink system id.
    pub fn system_id(&self) -> u8 {
        self.config.system_id
    }

    /// Longest time that a lost vehicle takes to come down, seconds; 0 in a mission with goals.
    pub fn lost_vehicle_down_after_s(&self) -> f32 {
        self.config.lost_vehicle_down_after_s.unwrap_or(0.0)
    }

    /// Whether the vehicle has lost all power (`kill`).
    pub fn is_powerless(&self) -> bool {
        self.power_cut
    }

    /// Whether the vehicle fell because its motors stopped in the air.
    pub fn is_wrecked(&self) -> bool {
        self.wrecked
    }

    /// Cuts the power of autopilot and companion for good.
    pub fn cut_power(&mut self) {
        self.cut_motors();
        self.power_cut = true;
    }

    /// Restarts the autopilot: motors off; until `until_us` it neither sends nor receives.
    pub fn reboot_autopilot(&mut self, until_us: u64) {
        self.cut_motors();
        self.boots_until_us = until_us;
    }

    fn cut_motors(&mut self) {
        let truth = self.autopilot.true_state();
        self.wrecked |= truth.armed && !truth.touching;
        self.autopilot.reboot();
    }

    /// Restarts the companion, and its clock from 0.
    ///
    /// # Errors
    /// As [`Self::new`]; none if that succeeded with the same settings.
    pub fn reset_companion(&mut self, now_us: u64) -> anyhow::Result<()> {
        self.start_companion()?;
        self.companion_started_us = now_us;
        self.plan_requests = PlanRequests::new();
        Ok(())
    }

    /// Until `until_us` bytes between companion and autopilot are held back, not delivered; what
    /// does not fit the transmit buffer meanwhile is lost.
    pub fn stall_serial(&mut self, until_us: u64) {
        self.to_companion.stall(until_us);
        self.to_autopilot.stall(until_us);
    }

    /// Sets the share of bytes that the serial link changes, 0 to 1.
    pub fn set_serial_corruption(&mut self, share: f64) {
        self.to_companion.set_corruption(share);
        self.to_autopilot.set_corruption(share);
    }

    /// The companion's own time: since its last start.
    fn companion_now(&self, now_us: u64) -> Instant {
        Instant::from_micros(now_us - self.companion_started_us)
    }

    /// One physics step of the vehicle: its autopilot, and all bytes that arrive by the step's end.
    /// Events of the companion go to `log`.
    ///
    /// # Errors
    /// Its board hangs or is gone.
    pub fn step(
        &mut self,
        step: u64,
        station: usize,
        mission: &PreparedMission,
        radio: &mut Radio,
        places: &[Point],
        log: &mut Vec<report::LogEvent>,
    ) -> anyhow::Result<()> {
        let now_us = (step + 1) * STEP_US;
        if step % GROUND_CHECK_STEPS == station as u64 % GROUND_CHECK_STEPS {
            self.ground_m = mission
                .ground_z_below_m(&self.autopilot.true_state().position)
                .unwrap_or(f32::NEG_INFINITY);
        }
        self.autopilot.step(STEP_S, self.ground_m);
        self.note_flight_times(now_us as f64 * 1e-6);
        if self.power_cut {
            return Ok(());
        }
        let booting = now_us < self.boots_until_us;
        let mut buffer = [0; 512];
        loop {
            let length = self.autopilot.poll_transmit(&mut buffer);
            if length == 0 {
                break;
            }
            if !booting {
                self.to_companion.write(now_us, &buffer[..length]);
            }
        }
        if self.board.is_some() {
            self.step_board(now_us, station, radio, places, log)?;
        } else {
            self.to_companion.read(now_us, &mut self.received_bytes);
            self.step_companion(now_us, station, radio, places, log);
        }
        self.to_autopilot.read(now_us, &mut self.received_bytes);
        if !self.received_bytes.is_empty() && !booting {
            self.autopilot.handle_bytes(&self.received_bytes);
        }
        Ok(())
    }

    /// Notes the times of take-off and loss, and when the vehicle is on the ground again.
    fn note_flight_times(&mut self, t_s: f64) {
        let truth = self.autopilot.true_state();
        if !truth.touching && truth.armed {
            self.took_off_s.get_or_insert(t_s);
        }
        if self.power_cut || self.wrecked {
            self.power_lost_at_s.get_or_insert(t_s);
        }
        if self.took_off_s.is_some() && truth.touching && !truth.armed {
            self.back_on_ground_s.get_or_insert(t_s);
            if !self.power_cut {
                self.landed_s.get_or_insert(t_s);
            }
        }
    }

    /// Carries bytes between the vehicle's board, its autopilot and the radio for one step.
    fn step_board(
        &mut self,
        now_us: u64,
        station: usize,
        radio: &mut Radio,
        places: &[Point],
        log: &mut Vec<report::LogEvent>,
    ) -> anyhow::Result<()> {
        let id = self.system_id();
        let Some(board) = &mut self.board else { return Ok(()) };
        let mut said = |text: &str| {
            say!("board {id}: {text}");
            let t_s = (now_us as f64 * 1e-6) as f32;
            log.push(report::LogEvent {
                t_s,
                vehicle: Some(id),
                level: Level::Info,
                text: text.to_owned(),
            });
        };
        let (up, down) = (&mut self.to_companion, &mut self.to_autopilot);
        board
            .step(
                now_us,
                &mut BoardLinks {
                    to_board: up,
                    to_autopilot: down,
                    radio,
                    station,
                    true_positions: places,
                    on_text: &mut said,
                },
            )
            .with_context(|| format!("the board of vehicle {id}"))
    }

    /// Gives the companion the bytes that arrived by `now_us`; handles timeout, events and flash.
    fn step_companion(
        &mut self,
        now_us: u64,
        station: usize,
        radio: &mut Radio,
        places: &[Point],
        log: &mut Vec<report::LogEvent>,
    ) {
        let now = self.companion_now(now_us);
        if !self.received_bytes.is_empty() {
            self.companion.handle_bytes(Link::Autopilot, now, &self.received_bytes);
        }
        while let Some(packet) = radio.receive(now_us, station) {
            self.companion.handle_bytes(Link::Swarm, now, &packet);
        }
        if self.companion.poll_timeout().is_some_and(|due| due <= now) {
            self.companion.handle_timeout(now);
        }
        let mut restarts = false;
        while let Some(happened) = self.companion.poll_event() {
            match happened {
                Event::PlanRequested(wanted) => self.plan_requests.add(wanted),
                Event::RestartRequested => restarts = true,
                // The companion also sends this as STATUSTEXT, so it is not logged.
                Event::WaitsForUnstartedVehicle { .. } => {}
                Event::DetourSkippedWaypoints { count: left } => {
                    let text = format!("Flown around: {left} waypoints are left");
                    let (t_s, vehicle) = ((now_us as f64 * 1e-6) as f32, Some(self.system_id()));
                    log.push(report::LogEvent { t_s, vehicle, level: Level::Info, text });
                }
                Event::StateChanged { from, to, text, warning } => {
                    let warning = Some(text).filter(|t| warning && !t.is_empty());
                    self.update_warnings(from, to, warning);
                    log.push(self.log_entry(now_us, from, to, text));
                }
            }
        }
        if let Some(flash) = &mut self.flash {
            let mut read = [0; MAX_READ_LEN];
            while let Some(request) = self.companion.poll_flash() {
                let outcome = flash.execute_request(request, &mut read);
                self.companion.handle_flash(now, outcome);
            }
        }
        self.send_companion_output(now_us, station, radio, places);
        if restarts {
            // An error is impossible: the same settings have made a companion before.
            let _ = self.reset_companion(now_us);
        }
    }

    /// Faults of the vehicle's serial link in `lasted_s` seconds, as text; `None` without faults.
    pub fn link_trouble(&self, lasted_s: f64) -> Option<String> {
        self.to_companion
            .describe_fault(lasted_s)
            .or_else(|| self.to_autopilot.describe_fault(lasted_s))
    }

    /// Sends a ground station's frame by the serial link to a board without simulated radio.
    pub fn forward_to_board(&mut self, now_us: u64, frame: &[u8]) {
        if self.board.as_ref().is_some_and(|board| !board.has_radio()) && !self.is_offline(now_us) {
            self.to_companion.write(now_us, frame);
        }
    }

    /// Gives the autopilot bytes from the ground station behind `--qgc`.
    pub fn handle_qgc_bytes(&mut self, now_us: u64, bytes: &[u8]) {
        if !self.is_offline(now_us) {
            self.autopilot.handle_ground_bytes(bytes);
        }
    }

    /// Moves whole frames for the ground station behind `--qgc` into `out`; returns their length.
    pub fn poll_qgc_transmit(&mut self, now_us: u64, out: &mut [u8]) -> usize {
        let length = self.autopilot.poll_ground_transmit(out);
        if self.is_offline(now_us) { 0 } else { length }
    }

    /// Whether the vehicle has no power, or its autopilot boots.
    fn is_offline(&self, now_us: u64) -> bool {
        self.power_cut || now_us < self.boots_until_us
    }

    fn update_warnings(&mut self, from: State, to: State, warning: Option<&'static str>) {
        if let Some(last) = warning {
            self.warnings = Some([self.warnings.map_or(last, |[first, _]| first), last]);
        } else if to == State::Follow || from == State::Aborted {
            self.warnings = None;
        }
    }

    fn log_entry(&self, now_us: u64, from: State, to: State, text: &str) -> report::LogEvent {
        let level = match to {
            _ if to.has_given_up() => Level::Error,
            _ if to.is_interrupted_by_loss() || to == State::SwarmLinkLost => Level::Warning,
            _ => Level::Info,
        };
        let colon = if text.is_empty() { "" } else { ": " };
        let text = format!("{from:?} → {to:?}{colon}{text}");
        report::LogEvent {
            t_s: (now_us as f64 * 1e-6) as f32,
            vehicle: Some(self.system_id()),
            level,
            text,
        }
    }

    /// How the vehicle's flight ended: the state of its mission, and the warnings that led there.
    pub fn describe_end(&self) -> String {
        match (self.power_cut, self.warnings) {
            (true, _) => "Killed".to_owned(),
            (false, Some([first, last])) if first == last => format!("{:?}: {last}", self.state()),
            (false, Some([first, last])) => format!("{:?}: {first}; {last}", self.state()),
            (false, None) => format!("{:?}", self.state()),
        }
    }

    /// Removes and returns the companion's most urgent plan request; `None` if there is none, or if
    /// requests are not answered (`late-plan`).
    pub fn take_plan_request(&self) -> Option<PlanKind> {
        if self.plan_answer == PlanAnswer::Withheld { None } else { self.plan_requests.take() }
    }

    /// Gives the companion the plan that it requested, or the failure.
    pub fn hand_over_plan(
        &mut self,
        now_us: u64,
        wanted: PlanKind,
        plan: Result<&OwnPlan, companion::PlanFailure>,
    ) {
        let now = self.companion_now(now_us);
        self.companion.handle_plan(now, wanted, plan);
    }

    fn send_companion_output(
        &mut self,
        now_us: u64,
        station: usize,
        radio: &mut Radio,
        places: &[Point],
    ) {
        let mut buffer = [0; 512];
        loop {
            let length = self.companion.poll_transmit(Link::Autopilot, &mut buffer);
            if length == 0 {
                break;
            }
            self.to_autopilot.write(now_us, &buffer[..length]);
        }
        loop {
            let length = self.companion.poll_transmit(Link::Swarm, &mut buffer);
            if length == 0 {
                break;
            }
            radio.broadcast(now_us, Some(station), places, &buffer[..length]);
        }
    }

    /// Removes and returns the photos that the autopilot has taken since the last call.
    pub fn drain_pictures(&mut self) -> Vec<Picture> {
        let vehicle = Some(self.system_id());
        let picture = |photo: Photo| Picture {
            vehicle,
            t_s: photo.time_us as f32 * 1e-6,
            position: photo.position,
            yaw_enu_rad: std::f32::consts::FRAC_PI_2 - photo.heading_rad,
        };
        self.autopilot.drain_photos().into_iter().map(picture).collect()
    }
}

/// Whether a vehicle in this state was started: without a part of the area it may wait for one.
pub fn is_started(state: State) -> bool {
    !state.is_before_start()
}

/// Whether the mission of a vehicle in this state is over: done or aborted.
pub fn is_finished(state: State) -> bool {
    state.is_over()
}
