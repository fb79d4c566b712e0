//! One vehicle of the simulated swarm: a companion, an autopilot and the serial link between them.

use companion::{Companion, Event, Instant, Link, State};
use planner_core::Point;

use super::monitor::{Observation, Phase};
use super::radio::Radio;
use super::serial::{SerialConfig, SerialLink};
use crate::autopilot::{self, Autopilot};
use crate::capacity::{GATES, VEHICLES, WAYPOINTS};
use crate::map::VoxelMap;
use crate::mission::OwnPlan;

/// A companion with the desk's capacities.
pub type DeskCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;

/// Physics step, seconds; the autopilot's own.
pub const STEP_S: f32 = 0.004;
/// The same in microseconds.
pub const STEP_US: u64 = 4_000;
/// Steps between two looks for the ground below, which changes slowly.
const GROUND_STEPS: u64 = 25;

/// One vehicle.
pub struct Member {
    /// What flies.
    pub autopilot: Autopilot,
    /// What decides.
    pub companion: Box<DeskCompanion>,
    /// Whether the companion waits for a plan.
    pub wants_plan: bool,
    /// When it left the ground, seconds.
    pub took_off_s: Option<f64>,
    /// When it stood on the ground again with its motors off, seconds.
    pub landed_s: Option<f64>,
    up: SerialLink,
    down: SerialLink,
    ground_m: f32,
    bytes: Vec<u8>,
}

impl Member {
    /// A vehicle on its pad, powered up.
    pub fn new(
        autopilot: &autopilot::Config,
        companion: Box<DeskCompanion>,
        serial: SerialConfig,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let id = u64::from(autopilot.system_id);
        Ok(Self {
            autopilot: Autopilot::new(autopilot)?,
            companion,
            wants_plan: false,
            took_off_s: None,
            landed_s: None,
            up: SerialLink::new(serial, seed, 2 * id),
            down: SerialLink::new(serial, seed, 2 * id + 1),
            ground_m: autopilot.start.z - autopilot.vehicle.radius_m,
            bytes: Vec::new(),
        })
    }

    /// One physics step of the autopilot and all bytes that arrive by its end; events go to `event`.
    pub fn step(
        &mut self,
        step: u64,
        station: usize,
        map: &VoxelMap,
        radio: &mut Radio,
        places: &[Point],
        mut event: impl FnMut(Event),
    ) {
        let now_us = (step + 1) * STEP_US;
        let now = Instant::from_micros(now_us);
        if step % GROUND_STEPS == station as u64 % GROUND_STEPS {
            self.ground_m = map.ground_below(&self.autopilot.truth().position).unwrap_or(f32::NEG_INFINITY);
        }
        self.autopilot.step(STEP_S, self.ground_m);
        let mut buffer = [0; 512];
        loop {
            let length = self.autopilot.poll_transmit(&mut buffer);
            if length == 0 {
                break;
            }
            self.up.write(now_us, &buffer[..length]);
        }
        self.up.read(now_us, &mut self.bytes);
        if !self.bytes.is_empty() {
            self.companion.handle_bytes(Link::Autopilot, now, &self.bytes);
        }
        while let Some(packet) = radio.receive(now_us, station) {
            self.companion.handle_bytes(Link::Swarm, now, &packet);
        }
        if self.companion.poll_timeout().is_some_and(|due| due <= now) {
            self.companion.handle_timeout(now);
        }
        while let Some(happened) = self.companion.poll_event() {
            self.wants_plan |= happened == Event::PlanRequested;
            event(happened);
        }
        self.drain(now_us, station, radio, places);
        self.down.read(now_us, &mut self.bytes);
        if !self.bytes.is_empty() {
            self.autopilot.handle_bytes(&self.bytes);
        }
        let (t_s, truth) = (now_us as f64 * 1e-6, self.autopilot.truth());
        if !truth.touching && truth.armed {
            self.took_off_s.get_or_insert(t_s);
        }
        if self.took_off_s.is_some() && truth.touching && !truth.armed {
            self.landed_s.get_or_insert(t_s);
        }
    }

    /// Answers the companion's request for a plan.
    pub fn answer_plan(&mut self, now_us: u64, plan: Result<&OwnPlan, companion::PlanFailure>) {
        self.wants_plan = false;
        self.companion.handle_plan(Instant::from_micros(now_us), plan);
    }

    fn drain(&mut self, now_us: u64, station: usize, radio: &mut Radio, places: &[Point]) {
        let mut buffer = [0; 512];
        loop {
            let length = self.companion.poll_transmit(Link::Autopilot, &mut buffer);
            if length == 0 {
                break;
            }
            self.down.write(now_us, &buffer[..length]);
        }
        loop {
            let length = self.companion.poll_transmit(Link::Swarm, &mut buffer);
            if length == 0 {
                break;
            }
            radio.broadcast(now_us, Some(station), places, &buffer[..length]);
        }
    }

    /// What the referee sees.
    pub fn observation(&self) -> Observation {
        let truth = self.autopilot.truth();
        let phase = match (truth.touching, on_path(self.companion.state())) {
            (true, _) if !truth.armed => Phase::Grounded,
            (false, true) => Phase::Flying,
            _ => Phase::TakeOffOrLanding,
        };
        Observation { position: truth.position, phase, progress_m: self.companion.progress_m() }
    }
}

/// Whether a mission in this state will not move on by itself.
pub fn is_finished(state: State) -> bool {
    matches!(state, State::Done | State::Aborted)
}

fn on_path(state: State) -> bool {
    use State::{Alone, AutopilotSilent, Follow, Paused, PilotControl, PositionLost};
    matches!(state, Follow | Paused | Alone | AutopilotSilent | PositionLost | PilotControl)
}
