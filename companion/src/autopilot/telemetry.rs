//! The autopilot's telemetry: its messages decoded, and its position and velocity converted from
//! its local NED frame to the mission frame (ENU).
//!
//! Only component 1 of the own system is heard. Frames that repeat or come out of order are dropped
//! by their sequence number, positions also by their time. A position that jumps further than a
//! vehicle can fly means that the EKF origin moved, or that the estimate was wrong before or is
//! now. The position then counts as lost until the origin is reported again and
//! [`POSITION_SETTLE_TIME`] has passed without another jump.
//!
//! While the motors are armed, setpoints are computed with one EKF origin, whatever is received: a
//! GPS_GLOBAL_ORIGIN that an autopilot forwards from its radio looks like its own. When another
//! origin is received, the autopilot is asked for its origin again. If only others than the one
//! flown with come for 0.8 s (`ORIGIN_DOUBT_TIME`), the origin has moved, and the mission lands. An
//! origin further than 30 km (`MAX_ORIGIN_DISTANCE_M`) from the mission's counts as unknown.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA, GLOBAL_POSITION_INT_DATA,
    GPS_GLOBAL_ORIGIN_DATA, LOCAL_POSITION_NED_DATA, SYS_STATUS_DATA,
};
use nalgebra::Vector3;
use planner_core::geo::frames::{self, Geodetic};
use planner_core::{Length, Point};

use crate::autopilot::AutopilotKind;
use crate::autopilot::ardupilot;
use crate::autopilot::landed::LandedReport;
use crate::link::frame::Frame;
use crate::link::sequence::SequenceFilter;
use crate::margins;
use crate::time::{Duration, Instant};

/// Age of the last HEARTBEAT from which the autopilot counts as silent: HEARTBEAT comes at 1 Hz,
/// and a late one is not yet silence.
pub(crate) const MAX_HEARTBEAT_AGE: Duration = Duration::from_millis(1500);
/// Longest gap between HEARTBEATs that [`Telemetry::heartbeats_heard_for`] ignores.
const MAX_HEARTBEAT_GAP: Duration = Duration::from_millis(4500);
/// Age of a position from which a vehicle may have risen unseen: positions come at 30 Hz.
pub(crate) const MAX_POSITION_AGE_ON_PAD: Duration = Duration::from_millis(150);
/// Age from which a position counts as unknown.
pub(crate) const MAX_POSITION_AGE: Duration = Duration::from_millis(500);
const HEARTBEAT: u32 = 0;
const EXTENDED_SYS_STATE: u32 = 245;
const FLAG_ARMED: u8 = 0x80;
const STATE_CRITICAL: u8 = 5;
const LANDED_STATE_ON_GROUND: u8 = 1;
/// Distance of the reported position from the one extrapolated from the last beyond which the
/// position has jumped, metres; [`POSITION_JUMP_MPS`] × time is added.
const POSITION_JUMP_M: f32 = 1.0;
/// Change of velocity between two reported positions that no vehicle has exceeded so far, m/s.
const POSITION_JUMP_MPS: f32 = 5.0;
/// Greatest distance from the mission's origin to the EKF origin, metres. The autopilot's local
/// frame, in f32, rounds a setpoint by up to 1.4 mm at this distance.
const MAX_ORIGIN_DISTANCE_M: f32 = 30_000.0;
/// Longest time between two positions over which the jump test extrapolates, seconds: after a
/// longer silence of the autopilot the mission has ended.
const MAX_EXTRAPOLATION_S: f32 = 60.0;
/// Time for which positions are not used after a jump, or after a gap longer than this time;
/// another jump starts it again. The first messages after a silence may have been delayed.
pub const POSITION_SETTLE_TIME: Duration = Duration::from_millis(1000);
/// Time for which only another EKF origin is reported while armed, after which the origin counts as
/// moved and the mission lands; it is requested several times meanwhile.
const ORIGIN_DOUBT_TIME: Duration = Duration::from_millis(800);

/// Most streams whose age is kept: no autopilot kind has more streams on.
const MAX_STREAMS: usize = 8;

/// The autopilot's COMMAND_ACK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ack {
    /// `MAV_CMD`.
    pub(crate) command: u16,
    /// `MAV_RESULT`.
    pub(crate) result: u8,
    /// Addressee: system and component id; (0, 0) where the autopilot names none.
    pub(crate) to: (u8, u8),
}

/// The effect of a frame on the telemetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TelemetryChange {
    /// No value of interest changed, or the frame was dropped.
    None,
    /// A value was updated.
    Updated,
    /// The EKF origin is no longer known: the caller is to request it.
    OriginLost,
    /// An EKF origin other than the one flown with was received while armed: the caller is to
    /// request it again.
    OriginDoubted,
    /// The EKF origin was rejected: it is this many kilometres from the mission's origin.
    OriginFar(u32),
}

/// Where an EKF origin is accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OriginRange {
    /// Within 30 km (`MAX_ORIGIN_DISTANCE_M`) of the mission's origin.
    #[default]
    NearMission,
    /// At any distance: the board has no mission.
    Anywhere,
}

/// The autopilot's state as last received.
#[derive(Clone, Debug, Default)]
pub struct Telemetry {
    sequence: SequenceFilter,
    /// Kind of autopilot by the first HEARTBEAT; HEARTBEATs of another kind are ignored from then
    /// on. `None` before.
    pub kind: Option<AutopilotKind>,
    /// When the last HEARTBEAT was received; `None` before.
    pub heartbeat_at: Option<Instant>,
    /// When the first HEARTBEAT after the last gap of more than 4.5 s was received.
    heartbeats_since: Instant,
    /// Estimated height in the mission frame at the last HEARTBEAT, metres.
    pub(super) heartbeat_z_m: f32,
    /// Flight mode in the autopilot's own numbering.
    pub custom_mode: u32,
    /// Whether the motors are armed.
    pub armed: bool,
    /// `MAV_STATE`.
    pub system_status: u8,
    /// The landing detector's last report; `None` before the first.
    pub(super) landed: Option<LandedReport>,
    /// Battery charge in percent, −1 unknown.
    pub battery_percent: i8,
    /// When the charge was last reported; `None` before.
    pub(crate) battery_at: Option<Instant>,
    /// Height above home, metres; ArduCopter's NAV_TAKEOFF takes its height from there.
    pub above_home_m: f32,
    /// Where an EKF origin is accepted.
    origin_range: OriginRange,
    /// EKF origin, which positions are relative to; `None` until one is received, and again after
    /// it was refused as too far away, or after the autopilot restarted or its position jumped.
    pub ekf_origin: Option<Geodetic>,
    /// EKF origin with which the vehicle was armed, kept while it stays armed; `None` while
    /// disarmed.
    armed_origin: Option<Geodetic>,
    /// Since when, while armed, only EKF origins other than `armed_origin` were received.
    origin_doubtful_since: Option<Instant>,
    /// Whether the EKF origin moved while armed.
    pub(crate) origin_moved: bool,
    /// Accuracy of the position (one standard deviation, metres) that the estimator last reported,
    /// and when; infinite for an unsound estimate. ArduPilot's sound estimate counts as 0.
    position_accuracy: Option<(f32, Instant)>,
    /// When the last usable position was received; `None` while the position is unknown.
    pub position_at: Option<Instant>,
    /// When the last usable position was received; kept while the position is unknown.
    pub(super) last_position_at: Option<Instant>,
    /// Position in the mission frame, ENU metres.
    pub position: Point,
    /// Velocity in the mission frame, ENU m/s.
    pub velocity: Point,
    /// The last COMMAND_ACK, until it is taken; else `None`.
    ack: Option<Ack>,
    /// When each stream of [`AutopilotKind::streams`] that is on was last received, in that order;
    /// `Instant::ZERO` for never.
    stream_received_at: [Instant; MAX_STREAMS],
    /// Autopilot's time (`time_boot_ms`) of the newest position received, milliseconds.
    last_boot_ms: u32,
    /// Autopilot's time (`time_boot_ms`) of the last position that passed the jump test,
    /// milliseconds.
    position_boot_ms: u32,
    /// When a position last passed the jump test, whether or not it was usable.
    position_accepted_at: Option<Instant>,
    /// Until when positions are not used after a jump or a change of the EKF origin.
    settling_until: Instant,
    /// From when on positions are usable after a gap.
    positions_valid_from: Instant,
    /// ArduPilot: whether the flags of the last EKF_STATUS_REPORT allow arming and Guided.
    estimator_ready: bool,
}

impl Telemetry {
    /// Telemetry before any frame was received.
    pub fn new(origin_range: OriginRange) -> Self {
        Self { battery_percent: -1, origin_range, ..Self::default() }
    }

    /// Kind of autopilot that flies the vehicle; PX4 until a HEARTBEAT is received.
    pub(crate) fn kind(&self) -> AutopilotKind {
        self.kind.unwrap_or_default()
    }

    /// Whether HEARTBEAT reports `MAV_STATE_CRITICAL` or worse: a failsafe of the autopilot acts.
    pub fn is_critical(&self) -> bool {
        self.system_status >= STATE_CRITICAL
    }

    /// Whether the battery's charge is known and less than `percent`.
    pub(crate) fn is_battery_below(&self, percent: i8) -> bool {
        (0..percent).contains(&self.battery_percent)
    }

    /// Time since the last HEARTBEAT; the greatest duration if none was received.
    pub fn heartbeat_age(&self, now: Instant) -> Duration {
        time_since(self.heartbeat_at, now)
    }

    /// Time since the last usable position; the greatest duration while the position is unknown.
    pub fn position_age(&self, now: Instant) -> Duration {
        time_since(self.position_at, now)
    }

    /// Bound of the error of the estimated position, metres: three times the reported accuracy
    /// (`ACCURACY_FACTOR`), and at least `vouched_m`, which the operator vouches for (`FLK_EST_M`).
    /// Infinite while no recent accuracy is known.
    pub(crate) fn estimate_error_bound_m(&self, now: Instant, vouched_m: f32) -> f32 {
        match self.position_accuracy {
            Some((accuracy_m, at)) if now - at <= margins::MAX_ACCURACY_AGE => {
                libm::fmaxf(margins::ACCURACY_FACTOR * accuracy_m, vouched_m)
            }
            _ => f32::INFINITY,
        }
    }

    /// Whether the last EKF origin received while armed is another than the one flown with: the
    /// autopilot is to be asked again.
    pub(crate) fn is_origin_doubtful(&self) -> bool {
        self.origin_doubtful_since.is_some()
    }

    /// Whether the position jumped, or the EKF origin changed or was refused, within the last
    /// second (`POSITION_SETTLE_TIME`).
    pub fn is_position_settling(&self, now: Instant) -> bool {
        now < self.settling_until
    }

    /// Updates the telemetry from an autopilot's frame, for a mission frame about `mission_origin`.
    pub fn handle_frame(
        &mut self,
        now: Instant,
        mission_origin: &Geodetic,
        frame: &Frame,
    ) -> TelemetryChange {
        // While armed GPS_GLOBAL_ORIGIN only confirms the origin: a forwarded one, with another
        // sender's sequence number, must not make the filter drop the autopilot's own frames.
        let confirmed = self.armed && frame.message_id == GPS_GLOBAL_ORIGIN_DATA::ID;
        if !confirmed && !self.sequence.accept_if_new(frame.sequence, now) {
            return TelemetryChange::None;
        }
        self.note_stream_received(frame.message_id, now);
        match frame.message_id {
            // Decoded field by field: the command may be one that the crate does not know.
            COMMAND_ACK_DATA::ID => {
                let p = frame.padded_payload();
                let command = u16::from_le_bytes([p[0], p[1]]);
                self.ack = Some(Ack { command, result: p[2], to: (p[8], p[9]) });
                TelemetryChange::Updated
            }
            // Decoded field by field: a vehicle type newer than the crate must not make the
            // autopilot silent.
            HEARTBEAT => {
                let p = frame.padded_payload();
                let Some(kind) = AutopilotKind::from_heartbeat(p[5]) else {
                    return TelemetryChange::None;
                };
                if *self.kind.get_or_insert(kind) != kind {
                    return TelemetryChange::None;
                }
                self.custom_mode = u32::from_le_bytes([p[0], p[1], p[2], p[3]]);
                self.armed = p[6] & FLAG_ARMED != 0;
                self.update_origin_trust();
                self.system_status = p[7];
                if self.heartbeat_age(now) > MAX_HEARTBEAT_GAP {
                    self.heartbeats_since = now;
                }
                (self.heartbeat_at, self.heartbeat_z_m) = (Some(now), self.position.z);
                TelemetryChange::Updated
            }
            EXTENDED_SYS_STATE => {
                let landed = frame.padded_payload()[1];
                if landed != 0 {
                    let on_ground = landed == LANDED_STATE_ON_GROUND;
                    self.landed =
                        Some(LandedReport { on_ground, received_at: now, z_m: self.position.z });
                }
                TelemetryChange::Updated
            }
            SYS_STATUS_DATA::ID => match frame.decode::<SYS_STATUS_DATA>() {
                Some(status) => {
                    // Unknown (−1) does not replace a known charge.
                    if status.battery_remaining >= 0 {
                        self.battery_percent = status.battery_remaining;
                        self.battery_at = Some(now);
                    }
                    TelemetryChange::Updated
                }
                None => TelemetryChange::None,
            },
            GPS_GLOBAL_ORIGIN_DATA::ID => match frame.decode::<GPS_GLOBAL_ORIGIN_DATA>() {
                Some(origin) => self.handle_origin(now, mission_origin, &origin),
                None => TelemetryChange::None,
            },
            EKF_STATUS_REPORT_DATA::ID => {
                // Decoded field by field: flags newer than the crate's must not hide the others.
                let p = frame.padded_payload();
                self.estimator_ready =
                    ardupilot::estimator_ready(u16::from_le_bytes([p[20], p[21]]));
                let ratio =
                    |at: usize| f32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
                // Ratios of velocity, horizontal and vertical position, compass. ArduPilot reports
                // no metres: 0 leaves the bound at what the operator vouches for.
                let sound = self.estimator_ready
                    && [0, 4, 8, 12]
                        .into_iter()
                        .all(|at| ardupilot::is_variance_ratio_good(ratio(at)));
                self.position_accuracy = Some((if sound { 0.0 } else { f32::INFINITY }, now));
                if !self.estimator_ready && self.kind == Some(AutopilotKind::ArduPilot) {
                    self.position_at = None;
                }
                TelemetryChange::Updated
            }
            ESTIMATOR_STATUS_DATA::ID if self.kind == Some(AutopilotKind::Px4) => {
                // Decoded field by field: flags newer than the crate's must not hide the accuracy.
                let p = frame.padded_payload();
                let metres =
                    |at: usize| f32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
                let (across_m, height_m) = (metres(32), metres(36));
                // A NaN or negative accuracy counts as unknown.
                let known = across_m >= 0.0 && height_m >= 0.0;
                let worst_m = if known { libm::fmaxf(across_m, height_m) } else { f32::INFINITY };
                self.position_accuracy = Some((worst_m, now));
                TelemetryChange::Updated
            }
            GLOBAL_POSITION_INT_DATA::ID => match frame.decode::<GLOBAL_POSITION_INT_DATA>() {
                Some(global) => {
                    self.above_home_m = global.relative_alt as f32 * 1e-3;
                    TelemetryChange::None
                }
                None => TelemetryChange::None,
            },
            LOCAL_POSITION_NED_DATA::ID => match frame.decode::<LOCAL_POSITION_NED_DATA>() {
                Some(local) => self.handle_position(now, mission_origin, &local),
                None => TelemetryChange::None,
            },
            _ => TelemetryChange::None,
        }
    }

    /// The last COMMAND_ACK, if it has not been taken yet.
    pub(crate) fn take_ack(&mut self) -> Option<Ack> {
        self.ack.take()
    }

    /// Time since a stream's message was last received; the greatest duration if it never was.
    pub(crate) fn stream_age(&self, message_id: u32, now: Instant) -> Duration {
        let heard =
            self.stream_index(message_id).and_then(|at| self.stream_received_at.get(at)).copied();
        time_since(heard.filter(|at| *at > Instant::ZERO), now)
    }

    /// Index of the message among the streams that are on; `None` if it is none of them.
    fn stream_index(&self, message_id: u32) -> Option<usize> {
        let kept = self.kind.unwrap_or_default().streams();
        let mut on = kept.iter().filter(|(_, interval_us)| *interval_us > 0.0);
        on.position(|(id, _)| u32::from(*id) == message_id)
    }

    fn note_stream_received(&mut self, message_id: u32, now: Instant) {
        let slot = self.stream_index(message_id).and_then(|at| self.stream_received_at.get_mut(at));
        if let Some(slot) = slot {
            *slot = now;
        }
    }

    fn handle_origin(
        &mut self,
        now: Instant,
        mission_origin: &Geodetic,
        data: &GPS_GLOBAL_ORIGIN_DATA,
    ) -> TelemetryChange {
        let origin = Geodetic {
            lat_deg: f64::from(data.latitude) * 1e-7,
            lon_deg: f64::from(data.longitude) * 1e-7,
            alt_m: f64::from(data.altitude) * 1e-3,
        };
        if !origin.is_valid() {
            return TelemetryChange::None;
        }
        if self.armed
            && let Some(flown) = self.armed_origin
        {
            if flown != origin {
                let since = *self.origin_doubtful_since.get_or_insert(now);
                self.origin_moved |= now - since >= ORIGIN_DOUBT_TIME;
                return TelemetryChange::OriginDoubted;
            }
            self.origin_doubtful_since = None;
        }
        let away_m = frames::geodetic_to_enu(mission_origin, &origin).length();
        if away_m > MAX_ORIGIN_DISTANCE_M && self.origin_range == OriginRange::NearMission {
            (self.ekf_origin, self.position_at, self.position_accepted_at) = (None, None, None);
            self.settling_until = now + POSITION_SETTLE_TIME;
            return TelemetryChange::OriginFar((away_m * 1e-3) as u32);
        }
        if self.ekf_origin.is_some_and(|known| known != origin) {
            // A position received next may still be relative to the old origin.
            self.settling_until = now + POSITION_SETTLE_TIME;
        }
        if self.ekf_origin != Some(origin) {
            self.ekf_origin = Some(origin);
            // The next position is relative to the new origin: the jump test must not compare it
            // with the last.
            self.position_at = None;
            self.position_accepted_at = None;
        }
        self.update_origin_trust();
        TelemetryChange::Updated
    }

    /// While armed, keeps the origin that setpoints are computed with. While disarmed, forgets an
    /// origin that has moved, so that it is requested again.
    fn update_origin_trust(&mut self) {
        if self.armed {
            self.armed_origin = self.armed_origin.or(self.ekf_origin);
            return;
        }
        if self.origin_moved {
            (self.ekf_origin, self.position_at, self.position_accepted_at) = (None, None, None);
        }
        (self.armed_origin, self.origin_doubtful_since, self.origin_moved) = (None, None, false);
    }

    /// Takes over a position in local NED, unless it is late, jumps or cannot be converted.
    fn handle_position(
        &mut self,
        now: Instant,
        mission_origin: &Geodetic,
        d: &LOCAL_POSITION_NED_DATA,
    ) -> TelemetryChange {
        let fields = [d.x, d.y, d.z, d.vx, d.vy, d.vz];
        let older = self.last_boot_ms.wrapping_sub(d.time_boot_ms);
        let rebooted = older > 10_000 && older < u32::MAX / 2;
        let stale = older < u32::MAX / 2 && !rebooted && self.position_accepted_at.is_some();
        if fields.iter().any(|f| !f.is_finite()) || stale {
            return TelemetryChange::None;
        }
        self.last_boot_ms = d.time_boot_ms;
        let Some(kind) =
            self.kind.filter(|kind| *kind == AutopilotKind::Px4 || self.estimator_ready)
        else {
            return TelemetryChange::None;
        };
        let Some(ekf_origin) = self.ekf_origin.filter(|_| !rebooted) else {
            return if rebooted { self.lose_origin(now) } else { TelemetryChange::None };
        };
        let ned = Vector3::new(f64::from(d.x), f64::from(d.y), f64::from(d.z));
        let geodetic = frames::ned_to_geodetic(kind.projection(), &ekf_origin, &ned);
        let position = frames::geodetic_to_enu(mission_origin, &geodetic);
        if let Some(at) = self.position_accepted_at {
            // Time by the autopilot's clock: delayed positions arrive all at once.
            let passed_s = d.time_boot_ms.wrapping_sub(self.position_boot_ms) as f32 * 1e-3;
            let dt_s = passed_s.min(MAX_EXTRAPOLATION_S);
            if now - at > POSITION_SETTLE_TIME {
                self.positions_valid_from = now + POSITION_SETTLE_TIME;
            }
            let led_to = self.position + self.velocity * dt_s;
            if (position - led_to).length() > POSITION_JUMP_M + POSITION_JUMP_MPS * dt_s {
                return self.lose_origin(now);
            }
        }
        (self.position_accepted_at, self.position_boot_ms) = (Some(now), d.time_boot_ms);
        self.position = position;
        // The norths of the mission frame and of the autopilot's frame differ by the convergence of
        // meridians, 1e-4 rad a kilometre; the velocity is not corrected for it.
        self.velocity = frames::swap_enu_ned(&Vector3::new(d.vx, d.vy, d.vz));
        if !self.is_position_settling(now) && now >= self.positions_valid_from {
            self.position_at = Some(now);
            self.last_position_at = Some(now);
        }
        TelemetryChange::Updated
    }

    /// Forgets the EKF origin and the position after a jump or a restart of the autopilot.
    fn lose_origin(&mut self, now: Instant) -> TelemetryChange {
        self.ekf_origin = None;
        self.position_at = None;
        self.position_accepted_at = None;
        self.settling_until = now + POSITION_SETTLE_TIME;
        TelemetryChange::OriginLost
    }

    /// A point of the mission frame in NED metres about this autopilot's EKF origin; `None` while
    /// that origin is unknown.
    pub fn to_ned(&self, mission_origin: &Geodetic, point: &Point) -> Option<Vector3<f32>> {
        let geodetic = frames::enu_to_geodetic(mission_origin, point);
        let ned = frames::geodetic_to_ned(self.kind?.projection(), &self.ekf_origin?, &geodetic);
        Some(Vector3::new(ned.x as f32, ned.y as f32, ned.z as f32))
    }
}

fn time_since(at: Option<Instant>, now: Instant) -> Duration {
    at.map_or(Duration::from_micros(u64::MAX), |at| now - at)
}

mod reports;
#[cfg(test)]
mod tests;
