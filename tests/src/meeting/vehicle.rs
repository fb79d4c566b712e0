//! One vehicle of a meeting: its companion, its autopilot, and what it has received from others.

use companion::link::frame::Framer;
use companion::{Companion, Config, Instant, RosterEntry, State};
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames::{self, Geodetic};

use super::autopilot::{Autopilot, ControlSource};
use super::packet::{ORIGIN, Packet};
use super::referee::{Heard, VehicleState};
use super::scene::{
    self, CLIMB_MPS, CRUISE_MPS, GATES, SAFETY_DISTANCE_M, Scene, VEHICLES, WAYPOINTS,
};
use crate::setpoints::{SetpointCheck, SetpointLimits};

/// Fence that no vehicle may leave, metres: lowest and highest corner.
const FENCE: (Point, Point) = (Point::new(-40.0, -40.0, -5.0), Point::new(70.0, 70.0, 60.0));
/// Time without a position of any other vehicle after which a vehicle counts as deaf, seconds: its
/// companion has stopped it long before, and now lands it.
const DEAF_AFTER_S: f32 = 20.0;
/// Time within which a neighbour's position was received for the safety filter to expect it on its
/// reported points, seconds; later it may be anywhere within a ball (SPEC §4).
const HEARD_WITHIN_S: f32 = 1.0;
/// Speed above which a vehicle does not count as stopped, m/s.
const MOVES_ABOVE_MPS: f32 = 0.7;
/// Speed limit of setpoints, m/s: the nominal speed plus the excess of a setpoint that catches up.
const MAX_SETPOINT_SPEED_MPS: f32 = 2.2;

type MeetingCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;

/// A vehicle of a meeting with its companion.
pub(super) struct MeetingVehicle {
    pub(super) companion: MeetingCompanion,
    pub(super) autopilot: Autopilot,
    /// Radio frames on their way to it.
    pub(super) inbox: Vec<Packet>,
    /// What it last received from each vehicle, by index.
    pub(super) heard: Vec<Heard>,
    /// Reads the frames that its companion sends by radio.
    pub(super) framer: Framer,
    /// Whether the companion computes and sends nothing.
    pub(super) companion_dead: bool,
    /// Whether the radio sends.
    pub(super) radio_sends: bool,
    /// Whether the radio receives.
    pub(super) radio_hears: bool,
    /// Bytes that the companion receives from its autopilot in the next step.
    pub(super) bytes_to_companion: Vec<u8>,
    /// Sequence number of the ground station's next command to it.
    pub(super) command_sequence: u8,
    /// Number of stops by the safety filter.
    pub(super) filter_stops: u32,
    /// System ids of all vehicles, in the order of `heard`.
    ids: Vec<u8>,
    /// Since when the present stop lasts, and whether the neighbour that the filter stops for was
    /// silent for longer than [`HEARD_WITHIN_S`] in it.
    pub(super) stop_since: Option<(Instant, bool)>,
    /// Longest stop by the safety filter for a neighbour that was heard, seconds.
    pub(super) longest_stop_s: f32,
    /// Longest stop by the safety filter for a neighbour that was silent, seconds.
    pub(super) longest_unheard_stop_s: f32,
    /// Number of times that its companion found its path blocked.
    pub(super) blocked_count: u32,
}

fn config(scene: &Scene, i: usize) -> Config<VEHICLES> {
    let own = &scene.vehicles[i];
    let start = |vehicle: &scene::Vehicle| vehicle.plan.path.waypoints()[0].position;
    let mut config = Config::new(own.id, start(own), ORIGIN);
    config.roster.clear();
    for vehicle in &scene.vehicles {
        let entry = RosterEntry { system_id: vehicle.id, path_start: start(vehicle) };
        config.roster.push(entry).expect("a meeting fits");
    }
    config.mission_crc = 0xC0FFEE;
    config.cruise_mps = CRUISE_MPS;
    config.climb_mps = CLIMB_MPS;
    config.safety_distance_m = SAFETY_DISTANCE_M;
    config.geofence = Some(FENCE);
    config
}

impl MeetingVehicle {
    pub(super) fn new(scene: &Scene, i: usize) -> Self {
        let vehicle = &scene.vehicles[i];
        let ekf_origin = Geodetic {
            lat_deg: ORIGIN.lat_deg + 0.00002 * i as f64,
            lon_deg: ORIGIN.lon_deg - 0.00003 * i as f64,
            alt_m: ORIGIN.alt_m + i as f64,
        };
        let ned = |point: &Point| {
            let place = frames::enu_to_geodetic(&ORIGIN, point);
            frames::geodetic_to_ned(vehicle.kind.projection(), &ekf_origin, &place).cast::<f32>()
        };
        let (low, high) = (ned(&FENCE.0), ned(&FENCE.1));
        let (low, high) = (low.inf(&high), low.sup(&high));
        let slack = Vector3::repeat(0.05);
        let limits = SetpointLimits {
            max_speed_mps: MAX_SETPOINT_SPEED_MPS,
            fence: Some((low - slack, high + slack)),
        };
        let mut autopilot = Autopilot::new(
            vehicle.kind,
            vehicle.id,
            (ORIGIN, ekf_origin),
            vehicle.pad,
            vehicle.stream_phase,
            SetpointCheck::new(limits),
        );
        autopilot.on_setpoint_loss = vehicle.on_setpoint_loss;
        Self {
            companion: MeetingCompanion::new(config(scene, i)).expect("a sound configuration"),
            autopilot,
            inbox: Vec::new(),
            heard: vec![Heard::default(); scene.vehicles.len()],
            framer: Framer::new(),
            companion_dead: false,
            radio_sends: true,
            radio_hears: true,
            bytes_to_companion: Vec::new(),
            command_sequence: 0,
            filter_stops: 0,
            ids: scene.vehicles.iter().map(|vehicle| vehicle.id).collect(),
            stop_since: None,
            longest_stop_s: 0.0,
            longest_unheard_stop_s: 0.0,
            blocked_count: 0,
        }
    }

    /// Updates the length of the longest stop by the filter: a stop ends when the filter stops for
    /// no neighbour any more (a wait at a gate may follow), or the vehicle flies again.
    pub(super) fn note_stops(&mut self, now: Instant) {
        let (stops, blocker) =
            (self.companion.filter_stop_count(), self.companion.query_filter_blocker(now));
        if core::mem::replace(&mut self.filter_stops, stops) != stops {
            self.stop_since.get_or_insert((now, false));
        } else if blocker == 0 || self.autopilot.velocity.norm() > MOVES_ABOVE_MPS {
            self.stop_since = None;
        }
        let Some((since, unheard)) = &mut self.stop_since else { return };
        let now_s = now.as_micros() as f32 * 1e-6;
        let stops_for = self.ids.iter().position(|&id| id == blocker).map(|k| &self.heard[k]);
        let silent =
            |heard: &Heard| heard.position.is_some_and(|(.., at_s)| now_s - at_s > HEARD_WITHIN_S);
        *unheard |= stops_for.is_some_and(silent);
        let longest_s = match unheard {
            true => &mut self.longest_unheard_stop_s,
            false => &mut self.longest_stop_s,
        };
        *longest_s = longest_s.max((now - *since).as_secs_f32());
    }

    pub(super) fn state_for_referee(&self, now_s: f32) -> VehicleState {
        let lately =
            |heard: &Heard| heard.position.is_some_and(|(.., at_s)| now_s - at_s < DEAF_AFTER_S);
        // In the landing mode, or led down by setpoints.
        let lands = (self.autopilot.control_source() == ControlSource::Commanded
            && self.autopilot.mode == self.autopilot.kind.land_mode())
            || self.companion.state() == State::Land;
        VehicleState {
            position: self.autopilot.position,
            velocity: self.autopilot.velocity,
            airborne: self.autopilot.is_airborne(),
            companion_controls: !self.companion_dead
                && self.autopilot.armed
                && self.autopilot.control_source() != ControlSource::Other,
            lands_on_command: lands,
            deaf: !self.heard.iter().any(lately),
        }
    }

    /// Whether it stands disarmed, and its mission has ended or its companion is dead.
    pub(super) fn is_at_rest(&self) -> bool {
        let over = matches!(self.companion.state(), State::Done | State::Aborted);
        !self.autopilot.armed && !self.autopilot.is_airborne() && (over || self.companion_dead)
    }
}
