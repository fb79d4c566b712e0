//! Flies an uploaded mission: AUTO.MISSION of PX4, AUTO of ArduCopter.
//!
//! The items NAV_DELAY (93), NAV_TAKEOFF (22), NAV_WAYPOINT (16), NAV_LAND (21) and
//! NAV_RETURN_TO_LAUNCH (20) are flown one after the other. DO_CHANGE_SPEED (178),
//! DO_DIGICAM_CONTROL (203) and DO_SET_CAM_TRIGG_DIST (206) are executed as soon as the item before
//! them is completed. All other items are skipped. ArduPilot's item 0 is home and not flown.
//!
//! Items keep their numbers of the upload; positions are ENU metres in the mission frame; times are
//! microseconds since boot.

use planner_core::Point;
use planner_core::geo::frames::Geodetic;

use crate::SimulatedKind;
use crate::link::cmd::{
    DO_CHANGE_SPEED, DO_DIGICAM_CONTROL, DO_SET_CAM_TRIGG_DIST, NAV_DELAY, NAV_LAND,
    NAV_RETURN_TO_LAUNCH, NAV_TAKEOFF, NAV_WAYPOINT,
};
use crate::link::command::ReceivedCommand;
use crate::link::msg::{MISSION_CURRENT, MISSION_ITEM_REACHED};
use crate::physics::vehicle::wrap_pi_once;
use crate::platform::{Platform, SensorReadings};
use crate::services::mission::MissionItem;

/// Horizontal distance at which a waypoint is reached, metres: `NAV_ACC_RAD` of PX4's multicopters,
/// ArduCopter's `WPNAV_RADIUS`.
const DEFAULT_ACCEPTANCE_RADIUS_M: f32 = 2.0;
/// Vertical distance at which a waypoint is reached, metres (`NAV_MC_ALT_RAD`).
const REACHED_HEIGHT_M: f32 = 0.8;
/// Largest heading error at which PX4 counts a waypoint as reached, radians (`MIS_YAW_ERR`, 12°).
/// ArduCopter does not check the heading.
const MAX_YAW_ERROR_RAD: f32 = 0.21;

/// What the land detector reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LandedState {
    OnGround,
    InAir,
}

/// What the vehicle flies for one mission item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MissionLeg {
    /// Wait for this time, seconds.
    Wait(f32),
    /// Climb to height `up`, ENU metres.
    TakeOff { up: f32 },
    /// Fly to point `at`, with a heading (radians; NaN: none), and stay there (seconds).
    /// `acceptance_radius_m` is the acceptance radius, metres.
    FlyTo { at: Point, heading: f32, stay_s: f32, acceptance_radius_m: f32 },
    /// Land, at this point (east, north; metres) if one is given.
    Land { at: Option<[f32; 2]> },
    /// Return home and land.
    Return,
}

impl MissionLeg {
    /// End point of a leg, at which the next one starts: its waypoint, else the vehicle's position
    /// `here`.
    pub(crate) fn leg_end(leg: Option<Self>, here: &Point) -> Point {
        match leg {
            Some(Self::FlyTo { at, .. }) => at,
            _ => *here,
        }
    }
}

/// Height and climb rate on the straight line between two waypoints, at the point abreast of the
/// vehicle. Both autopilots fly along that line: PX4's `PositionSmoothing` computes one velocity on
/// all three axes towards its end, ArduCopter's `AC_WPNav` one S-curve.
pub(crate) fn interpolate_height(
    from: &Point,
    at: &Point,
    here: &Point,
    velocity: &Point,
) -> (f32, f32) {
    let (way, up) = ((at - from).xy(), at.z - from.z);
    let length = way.norm();
    if length < DEFAULT_ACCEPTANCE_RADIUS_M {
        return (at.z, 0.0);
    }
    let share = ((here - from).xy().dot(&way) / (length * length)).clamp(0.0, 1.0);
    let rate = if share < 1.0 { up / length * velocity.xy().dot(&way) / length } else { 0.0 };
    (from.z + up * share, rate)
}

/// The f32 at byte `at` of an item.
fn item_f32(item: &MissionItem, at: usize) -> f32 {
    f32::from_le_bytes([item[at], item[at + 1], item[at + 2], item[at + 3]])
}

/// The i32 at byte `at` of an item.
fn item_i32(item: &MissionItem, at: usize) -> i32 {
    i32::from_le_bytes([item[at], item[at + 1], item[at + 2], item[at + 3]])
}

/// The item's `MAV_CMD` number.
fn item_command(item: &MissionItem) -> u16 {
    u16::from_le_bytes([item[30], item[31]])
}

impl Platform {
    /// Number of the first item that is flown.
    fn first_flown_item(&self) -> u16 {
        u16::from(self.config.autopilot == SimulatedKind::Ardupilot)
    }

    /// Whether a mission with items to fly is stored.
    pub(crate) fn has_mission(&self) -> bool {
        self.missions.items().len() > usize::from(self.first_flown_item())
    }

    /// Whether the mission begins with a take-off; it may have a delay before.
    pub(crate) fn mission_begins_with_takeoff(&self) -> bool {
        let flown = self.missions.items().iter().skip(usize::from(self.first_flown_item()));
        let mut legs = flown.map(item_command).filter(|&id| has_leg(id) && id != NAV_DELAY);
        legs.next() == Some(NAV_TAKEOFF)
    }

    /// Executes the commands that are due and returns the leg to fly; `None` once all items are
    /// completed.
    pub(crate) fn advance_mission(
        &mut self,
        sensors: &SensorReadings,
        landed: LandedState,
    ) -> Option<MissionLeg> {
        let first = self.first_flown_item();
        self.missions.progress.skip_items_before(first);
        while let Some(item) =
            self.missions.items().get(usize::from(self.missions.progress.current_item)).copied()
        {
            match self.leg_of_item(&item) {
                Some(leg) => {
                    let begun = self.missions.progress.item_begun_us.is_some();
                    self.missions.progress.item_begun_us.get_or_insert(sensors.now_us);
                    if !(begun && self.is_leg_done(&leg, sensors, landed)) {
                        return Some(leg);
                    }
                }
                None => self.execute_item(&item),
            }
            self.complete_item();
        }
        None
    }

    /// Completes the current item: sends MISSION_ITEM_REACHED and MISSION_CURRENT, and the next
    /// item begins.
    pub(crate) fn complete_item(&mut self) {
        let passed = self.missions.progress.complete_item();
        let reached = passed.to_le_bytes();
        self.ports.iter_mut().for_each(|port| port.send_raw(MISSION_ITEM_REACHED, &reached));
        self.send_on_all_ports(MISSION_CURRENT);
    }

    /// Makes the next flight start with the first item.
    pub(crate) fn rewind_mission(&mut self) {
        self.missions.progress.rewind();
    }

    /// The leg of an item that is flown; `None` for items that are executed at once or skipped.
    fn leg_of_item(&self, item: &MissionItem) -> Option<MissionLeg> {
        let heading = item_f32(item, 12);
        let turn = core::f32::consts::TAU;
        let leg = match item_command(item) {
            NAV_DELAY => MissionLeg::Wait(item_f32(item, 0)),
            NAV_TAKEOFF => MissionLeg::TakeOff { up: self.item_position(item).z },
            NAV_WAYPOINT => {
                let radians = heading.to_radians();
                let asked_m = item_f32(item, 4);
                MissionLeg::FlyTo {
                    at: self.item_position(item),
                    heading: radians - turn * libm::roundf(radians / turn),
                    stay_s: item_f32(item, 0),
                    acceptance_radius_m: if asked_m > 0.0 {
                        asked_m
                    } else {
                        DEFAULT_ACCEPTANCE_RADIUS_M
                    },
                }
            }
            NAV_LAND => {
                let at = self.item_position(item);
                let given = item_i32(item, 16) != 0 || item_i32(item, 20) != 0;
                MissionLeg::Land { at: given.then_some([at.x, at.y]) }
            }
            NAV_RETURN_TO_LAUNCH => MissionLeg::Return,
            _ => return None,
        };
        Some(leg)
    }

    /// Position of an item, ENU metres. Without latitude and longitude the vehicle's are used. An
    /// invalid position becomes home.
    fn item_position(&self, item: &MissionItem) -> Point {
        let base = if matches!(item[34], 3 | 6 | 10 | 11) { self.home.alt_m } else { 0.0 };
        let here = self.frame.geodetic_from_enu(self.vehicle.position());
        let degrees = |at: usize| f64::from(item_i32(item, at)) * 1e-7;
        let given = item_i32(item, 16) != 0 || item_i32(item, 20) != 0;
        let asked = Geodetic {
            lat_deg: if given { degrees(16) } else { here.lat_deg },
            lon_deg: if given { degrees(20) } else { here.lon_deg },
            alt_m: f64::from(item_f32(item, 24)) + base,
        };
        let place = if asked.is_valid() { asked } else { self.home };
        self.frame.enu_from_geodetic(&place).cast::<f32>()
    }

    /// Executes an item without a leg; an unknown one has no effect.
    fn execute_item(&mut self, item: &MissionItem) {
        match item_command(item) {
            DO_CHANGE_SPEED => self.missions.requested_speed = Some(item_f32(item, 4)),
            id @ (DO_DIGICAM_CONTROL | DO_SET_CAM_TRIGG_DIST) => {
                self.execute_camera_command(&ReceivedCommand {
                    id,
                    param: [0, 4, 8, 12].map(|at| item_f32(item, at)),
                    param5: item_i32(item, 16) as f32,
                    lat_lon_deg: [f64::NAN; 2],
                    z: item_f32(item, 24),
                    relative_to_home: false,
                });
            }
            _ => {}
        }
    }

    /// Whether the current item's leg is flown. A landing and a return are completed elsewhere.
    fn is_leg_done(
        &mut self,
        leg: &MissionLeg,
        sensors: &SensorReadings,
        landed: LandedState,
    ) -> bool {
        let in_air = landed == LandedState::InAir;
        let since = |us: Option<u64>| {
            sensors.now_us.saturating_sub(us.unwrap_or(sensors.now_us)) as f32 * 1e-6
        };
        match *leg {
            MissionLeg::Wait(s) => since(self.missions.progress.item_begun_us) >= s,
            MissionLeg::TakeOff { up } => in_air && sensors.position.z > up - REACHED_HEIGHT_M,
            MissionLeg::FlyTo { at, heading, stay_s, acceptance_radius_m: reached_m } => {
                let off = at - sensors.position;
                // NaN: no heading to wait for.
                let turned = wrap_pi_once(heading - sensors.heading).abs() < MAX_YAW_ERROR_RAD;
                let turned =
                    turned || heading.is_nan() || self.config.autopilot == SimulatedKind::Ardupilot;
                if libm::hypotf(off.x, off.y) <= reached_m
                    && off.z.abs() <= REACHED_HEIGHT_M
                    && turned
                {
                    self.missions.progress.note_arrival(sensors.now_us);
                }
                let arrived_us = self.missions.progress.arrived_us;
                let stayed = arrived_us.is_some() && since(arrived_us) >= stay_s;
                in_air && (stayed || arrived_us.is_some() && stay_s.is_nan())
            }
            MissionLeg::Land { .. } | MissionLeg::Return => false,
        }
    }
}

/// Whether items of this command are flown, not executed at once or skipped.
fn has_leg(id: u16) -> bool {
    matches!(id, NAV_WAYPOINT | NAV_RETURN_TO_LAUNCH | NAV_LAND | NAV_TAKEOFF | NAV_DELAY)
}
