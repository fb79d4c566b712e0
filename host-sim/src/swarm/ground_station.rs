//! The simulated operator's ground station. As QGroundControl or a script would, it starts the
//! whole swarm by radio once every companion is ready, gives the commands of the fault script,
//! resumes a vehicle that its pilot gave back, and reports each obstacle that appears. It does not
//! wait for a vehicle that cannot fly, and waits at most 90 s for a late one.

use companion::State;
use companion::link::frame::{self, Header};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

use super::radio::Radio;
use super::simulated_vehicle::{SimulatedVehicle, is_finished};

/// MAVLink component id of the ground station: MAV_COMP_ID_MISSIONPLANNER.
const COMPONENT_ID: u8 = 190;
/// Time after which a command that a vehicle has not obeyed is repeated, microseconds.
const COMMAND_REPEAT_US: u64 = 1_000_000;
/// Time from the readiness of the first vehicle until ready vehicles are started without the
/// others, microseconds.
const START_WITHOUT_REST_US: u64 = 90_000_000;
/// Time for which a command to one vehicle is repeated, microseconds: some messages are lost.
const COMMAND_REPEATED_FOR_US: u64 = 10_000_000;

/// What the operator commands one vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperatorCommand {
    /// Continue, after a pilot's control or a pause.
    Resume,
    /// Stop and hold (`Paused`).
    Pause,
    /// Fly home (RTL).
    Return,
    /// Land.
    Land,
}

impl OperatorCommand {
    /// Whether a vehicle in this state may not have obeyed the command yet; the state does not show
    /// whether a return or landing was obeyed.
    fn is_still_needed(self, state: State) -> bool {
        match self {
            // A vehicle before its start may need a resume too: a pause holds it on its pad.
            Self::Resume => state.may_need_resume(),
            Self::Pause => state != State::Paused,
            Self::Return | Self::Land => true,
        }
    }

    /// The MAVLink command to the vehicle with this id.
    fn to_command_long(self, id: u8) -> COMMAND_LONG_DATA {
        match self {
            Self::Resume => command_long(PAUSE_CONTINUE, id, 1.0),
            Self::Pause => command_long(PAUSE_CONTINUE, id, 0.0),
            Self::Return => command_long(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, id, 0.0),
            Self::Land => command_long(MavCmd::MAV_CMD_NAV_LAND, id, 0.0),
        }
    }
}

/// A ground station that starts the swarm (MISSION_START) and commands single vehicles.
#[derive(Debug)]
pub struct GroundStation {
    /// System id of the ground station.
    system_id: u8,
    /// Sequence number of the next frame.
    sequence: u8,
    /// When a vehicle was first ready. `None` before.
    first_ready_us: Option<u64>,
    /// When MISSION_START was first sent, microseconds; `None` before.
    start_commanded_us: Option<u64>,
    /// When frames were last due, the start's first one or a repetition.
    last_sent_us: u64,
    /// Commands to single vehicles: vehicle's index, command, and until when it is repeated.
    commands: Vec<(usize, OperatorCommand, u64)>,
    /// Centre and radius (metres) of each obstacle to report.
    obstacles: Vec<(Geodetic, f32)>,
}

impl GroundStation {
    /// A ground station with this system id that has sent nothing yet.
    pub fn new(system_id: u8) -> Self {
        Self {
            system_id,
            sequence: 0,
            first_ready_us: None,
            start_commanded_us: None,
            last_sent_us: 0,
            commands: Vec::new(),
            obstacles: Vec::new(),
        }
    }

    /// Whether the swarm's start was commanded.
    pub fn is_start_commanded(&self) -> bool {
        self.start_commanded_us.is_some()
    }

    /// When the swarm's start was first commanded, seconds; 0 before.
    pub fn start_commanded_s(&self) -> f64 {
        self.start_commanded_us.map_or(0.0, |us| us as f64 * 1e-6)
    }

    /// Sets the command for one vehicle, repeated for 10 s; it replaces the vehicle's earlier one.
    pub fn set_command(&mut self, now_us: u64, vehicle: usize, command: OperatorCommand) {
        self.commands.retain(|&(of, ..)| of != vehicle);
        self.commands.push((vehicle, command, now_us + COMMAND_REPEATED_FOR_US));
    }

    /// Whether the vehicle is being commanded to continue.
    pub fn resumes(&self, vehicle: usize) -> bool {
        self.commands
            .iter()
            .any(|&(of, command, _)| of == vehicle && command == OperatorCommand::Resume)
    }

    /// Reports a spherical obstacle to all vehicles, each second from now on.
    pub fn report_obstacle(&mut self, centre: Geodetic, radius_m: f32) {
        self.obstacles.push((centre, radius_m));
    }

    /// Sends what is due: the start once all are ready, or 90 s after the first; then each second
    /// obstacles to all vehicles, and the start and commands to vehicles that need them.
    pub fn step(
        &mut self,
        now_us: u64,
        vehicles: &mut [SimulatedVehicle],
        radio: &mut Radio,
        places: &[Point],
    ) {
        let frames = self.due_frames(now_us, vehicles);
        for frame in frames {
            radio.broadcast(now_us, None, places, &frame);
            vehicles.iter_mut().for_each(|vehicle| vehicle.forward_to_board(now_us, &frame));
        }
    }

    /// Frames that the ground station sends at `now_us`; empty if none is due.
    fn due_frames(&mut self, now_us: u64, vehicles: &[SimulatedVehicle]) -> Vec<Vec<u8>> {
        let state = |v: &SimulatedVehicle| v.state();
        if self.start_commanded_us.is_none() {
            let ready = || vehicles.iter().filter(|v| state(v) == State::Ready);
            if ready().next().is_some() {
                self.first_ready_us.get_or_insert(now_us);
            }
            let settled =
                vehicles.iter().all(|v| state(v) == State::Ready || is_finished(state(v)));
            let waited = self
                .first_ready_us
                .is_some_and(|since_us| now_us >= since_us + START_WITHOUT_REST_US);
            if !(self.first_ready_us.is_some() && (settled || waited)) {
                return Vec::new();
            }
            self.start_commanded_us = Some(now_us);
            self.last_sent_us = now_us;
            return vec![self.command_frame(&command_long(START, ALL_SYSTEMS, 0.0))];
        }
        if now_us < self.last_sent_us + COMMAND_REPEAT_US {
            return Vec::new();
        }
        self.last_sent_us = now_us;
        // A pause that was obeyed is not repeated: another station may resume the vehicle.
        self.commands.retain(|&(of, command, until_us)| {
            now_us < until_us
                && (command != OperatorCommand::Pause
                    || command.is_still_needed(state(&vehicles[of])))
        });
        let mut frames = Vec::new();
        for (centre, radius_m) in self.obstacles.clone() {
            frames.push(self.command_frame(&COMMAND_INT_DATA {
                command: MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
                target_system: ALL_SYSTEMS,
                frame: MavFrame::MAV_FRAME_GLOBAL,
                param1: radius_m,
                x: (centre.lat_deg * 1e7).round() as i32,
                y: (centre.lon_deg * 1e7).round() as i32,
                z: centre.alt_m as f32,
                ..COMMAND_INT_DATA::DEFAULT
            }));
        }
        for (i, vehicle) in vehicles.iter().enumerate() {
            let id = vehicle.system_id();
            if state(vehicle) == State::Ready {
                frames.push(self.command_frame(&command_long(START, id, 0.0)));
            }
            for (_, command, _) in self.commands.clone().into_iter().filter(|&(of, ..)| of == i) {
                if command.is_still_needed(state(vehicle)) {
                    frames.push(self.command_frame(&command.to_command_long(id)));
                }
            }
        }
        frames
    }

    /// The frame of a command.
    fn command_frame(&mut self, command: &impl MessageData) -> Vec<u8> {
        let mut buffer = [0; frame::MAX_FRAME_LEN];
        let length = encode(command, self.system_id, self.sequence, &mut buffer);
        self.sequence = self.sequence.wrapping_add(1);
        buffer[..length].to_vec()
    }
}

const START: MavCmd = MavCmd::MAV_CMD_MISSION_START;
const PAUSE_CONTINUE: MavCmd = MavCmd::MAV_CMD_DO_PAUSE_CONTINUE;

/// Target system that addresses all vehicles.
const ALL_SYSTEMS: u8 = 0;

/// Writes a MISSION_START of ground station `from` to `target_system` into `out`; returns its
/// length.
pub fn encode_mission_start(
    from: u8,
    target_system: u8,
    out: &mut [u8; frame::MAX_FRAME_LEN],
) -> usize {
    encode(&command_long(START, target_system, 0.0), from, 0, out)
}

/// A COMMAND_LONG whose other parameters are 0.
fn command_long(command: MavCmd, target_system: u8, param1: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA { command, target_system, param1, ..COMMAND_LONG_DATA::DEFAULT }
}

/// Writes the frame of a command to `out`; returns its length, bytes.
fn encode(
    command: &impl MessageData,
    system: u8,
    sequence: u8,
    out: &mut [u8; frame::MAX_FRAME_LEN],
) -> usize {
    frame::encode(Header { system, component: COMPONENT_ID, sequence }, command, out)
}
