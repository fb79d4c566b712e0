//! The camera that the autopilot triggers: by distance flown (DO_SET_CAM_TRIGG_DIST, 206) or at
//! once (DO_DIGICAM_CONTROL, 203).
//!
//! Each autopilot checks in its own way. PX4's `camera_trigger` (TRIG_MODE 4) runs every 50 ms:
//! then it executes a command, takes a picture where triggering by distance is switched on, and
//! another whenever the distance from the last picture is reached. ArduPilot's `AP_Camera` runs
//! every 20 ms: it measures from where triggering is switched on or from the last picture, and
//! takes a requested picture immediately. Both measure horizontally, on the estimated position. So
//! pictures are farther apart than commanded, by what is flown between two checks. Each picture
//! is announced on every port, with the estimated position, by CAMERA_IMAGE_CAPTURED (263, PX4,
//! counted from 0) or CAMERA_FEEDBACK (180, ArduPilot, counted from 1). Source:
//! `camera_trigger.cpp`, `AP_Camera_Backend.cpp`.
//!
//! The true position of each picture is kept for a referee ([`crate::Autopilot::drain_photos`]).

use planner_core::Point;

use crate::SimulatedKind;
use crate::link::command::ReceivedCommand;
use crate::link::msg::{CAMERA_FEEDBACK, CAMERA_IMAGE_CAPTURED};
use crate::link::port::Port;
use crate::telemetry::messages::to_mavlink_units;
use crate::telemetry::snapshot::Snapshot;

/// Period at which PX4 and ArduPilot check the trigger distance, microseconds.
const TRIGGER_CHECK_EVERY_US: [u64; 2] = [50_000, 20_000];
/// Most photos that are kept if no referee fetches them.
const MAX_KEPT_PHOTOS: usize = 100_000;

/// A picture with the true position and heading at which it was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photo {
    /// Time since boot, microseconds.
    pub time_us: u64,
    /// True position of the body's centre, ENU metres.
    pub position: Point,
    /// True heading, radians clockwise from north.
    pub heading_rad: f32,
}

/// State of the camera's trigger.
#[derive(Clone, Debug, Default)]
pub struct CameraTrigger {
    /// Distance between pictures while the camera triggers by distance, metres; else `None`.
    trigger_distance_m: Option<f32>,
    /// Estimated position (east, north; metres) from which the distance is measured. `None` until
    /// it is first measured.
    measured_from: Option<[f32; 2]>,
    /// Whether a single picture was requested.
    picture_requested: bool,
    /// Time of the next trigger check, microseconds since boot.
    next_poll_us: u64,
    /// Number of pictures since boot.
    pictures_taken: u32,
    /// Photos that the referee has not fetched yet.
    photos: Vec<Photo>,
}

impl CameraTrigger {
    /// Executes DO_SET_CAM_TRIGG_DIST: parameter 1 is the distance in metres, 0 or less switches
    /// triggering off; parameter 3 requests one picture at once.
    pub(super) fn handle_trigger_distance(&mut self, command: &ReceivedCommand) {
        let distance_m = command.param[0];
        self.trigger_distance_m = (distance_m > 0.0).then_some(distance_m);
        self.measured_from = None;
        self.picture_requested |= command.param[2] > 0.0;
    }

    /// Executes DO_DIGICAM_CONTROL: 1 in parameter 5 requests a picture.
    pub(super) fn handle_digicam_control(&mut self, command: &ReceivedCommand) {
        self.picture_requested |= libm::roundf(command.param5) == 1.0;
    }

    /// The state after a reboot: only the photos are kept.
    pub(super) fn after_reboot(&mut self) -> Self {
        Self { photos: core::mem::take(&mut self.photos), ..Self::default() }
    }

    /// Returns the photos since the last call.
    pub(super) fn drain_photos(&mut self) -> Vec<Photo> {
        core::mem::take(&mut self.photos)
    }

    /// Number of pictures since boot.
    pub(super) fn picture_count(&self) -> u32 {
        self.pictures_taken
    }

    /// Time of the next trigger check, microseconds since boot.
    pub(super) fn next_poll_us(&self) -> u64 {
        self.next_poll_us
    }

    /// Advances one step. Takes a picture if one is due and returns the id of the message that
    /// announces it. `estimate` is the estimated position, `None` without one.
    pub(super) fn update(
        &mut self,
        autopilot: SimulatedKind,
        truth: Photo,
        estimate: Option<Point>,
    ) -> Option<u32> {
        let px4 = autopilot == SimulatedKind::Px4;
        let check_due = truth.time_us >= self.next_poll_us;
        if check_due {
            self.next_poll_us += TRIGGER_CHECK_EVERY_US[usize::from(!px4)];
        }
        let mut shoot = (check_due || !px4) && core::mem::take(&mut self.picture_requested);
        if shoot {
            self.measured_from = estimate.map(|at| [at.x, at.y]);
        }
        if let (Some(distance_m), Some(at)) = (self.trigger_distance_m, estimate)
            && check_due
        {
            let far = self
                .measured_from
                .map(|last| libm::hypotf(at.x - last[0], at.y - last[1]) >= distance_m);
            // PX4 takes a picture where triggering starts; ArduPilot only measures from there.
            let due = far.unwrap_or(px4);
            if due || far.is_none() {
                self.measured_from = Some([at.x, at.y]);
            }
            shoot |= due;
        }
        if !shoot {
            return None;
        }
        self.pictures_taken += 1;
        if self.photos.len() < MAX_KEPT_PHOTOS {
            self.photos.push(truth);
        }
        Some(if px4 { CAMERA_IMAGE_CAPTURED } else { CAMERA_FEEDBACK })
    }
}

impl Snapshot {
    /// Sends CAMERA_IMAGE_CAPTURED or CAMERA_FEEDBACK of this step's picture; false for any other
    /// id.
    pub(super) fn send_camera(&self, id: u32, port: &mut Port) -> bool {
        let (latitude, longitude, altitude_mm) = to_mavlink_units(&self.geodetic);
        let relative_m = (self.geodetic.alt_m - self.home.0.alt_m) as f32;
        match id {
            CAMERA_IMAGE_CAPTURED => {
                let mut payload = [0; 50];
                payload[..8].copy_from_slice(&self.unix_us.to_le_bytes());
                payload[8..12].copy_from_slice(&self.boot_ms().to_le_bytes());
                let relative_mm = libm::roundf(1e3 * relative_m) as i32;
                let index = self.pictures.saturating_sub(1) as i32;
                for (at, value) in [
                    (12, latitude),
                    (16, longitude),
                    (20, altitude_mm),
                    (24, relative_mm),
                    (44, index),
                ] {
                    payload[at..at + 4].copy_from_slice(&value.to_le_bytes());
                }
                for (k, q) in self.attitude().quaternion.iter().enumerate() {
                    payload[28 + 4 * k..32 + 4 * k].copy_from_slice(&q.to_le_bytes());
                }
                // Camera 1; success; no file URL.
                payload[48..].copy_from_slice(&[1, 1]);
                port.send_raw(id, &payload);
            }
            CAMERA_FEEDBACK => {
                let mut payload = [0; 47];
                payload[..8].copy_from_slice(&self.unix_us.to_le_bytes());
                for (at, value) in [(8, latitude), (12, longitude)] {
                    payload[at..at + 4].copy_from_slice(&value.to_le_bytes());
                }
                let [roll, pitch, yaw] = self.attitude().euler.map(f32::to_degrees);
                let reals = [self.geodetic.alt_m as f32, relative_m, roll, pitch, yaw, 0.0];
                for (k, real) in reals.iter().enumerate() {
                    payload[16 + 4 * k..20 + 4 * k].copy_from_slice(&real.to_le_bytes());
                }
                payload[40..42].copy_from_slice(&(self.pictures as u16).to_le_bytes());
                port.send_raw(id, &payload);
            }
            _ => return false,
        }
        true
    }
}
