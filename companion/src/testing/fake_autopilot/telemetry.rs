//! Telemetry of the scripted autopilot.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::*;

use super::Bench;
use crate::Link;
use crate::autopilot::AutopilotKind;

impl Bench {
    /// The autopilot's next HEARTBEAT, as a frame.
    pub(crate) fn heartbeat(&mut self) -> Vec<u8> {
        let armed =
            if self.armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        let mut data =
            HEARTBEAT_DATA { custom_mode: self.mode, base_mode: armed, ..Default::default() };
        data.autopilot = match self.kind {
            AutopilotKind::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            AutopilotKind::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        };
        data.system_status = if self.status >= 5 {
            MavState::MAV_STATE_CRITICAL
        } else {
            MavState::MAV_STATE_ACTIVE
        };
        self.bytes(&data)
    }

    /// Sends GPS_GLOBAL_ORIGIN.
    pub(crate) fn send_origin(&mut self) {
        let origin = GPS_GLOBAL_ORIGIN_DATA {
            latitude: (self.origin.lat_deg * 1e7).round() as i32,
            longitude: (self.origin.lon_deg * 1e7).round() as i32,
            altitude: (self.origin.alt_m * 1e3) as i32,
        };
        self.send(&origin);
    }

    /// Whether the autopilot sends this message: PX4 sends all without a request, ArduCopter those
    /// requested.
    fn sends(&self, id: u16) -> bool {
        self.kind == AutopilotKind::Px4 || self.streams.contains(&id)
    }

    /// Sends the messages that only ArduCopter sends.
    fn report_ardupilot(&mut self) {
        if self.sends(193) {
            let flags = EkfStatusFlags::from_bits_retain(self.ekf_flags);
            let pos_horiz_variance = self.pos_horiz_variance;
            self.send(&EKF_STATUS_REPORT_DATA { flags, pos_horiz_variance, ..Default::default() });
        }
        if self.sends(33) {
            // The autopilot's home is two metres below the pad.
            let relative_alt = ((self.enu.z + 2.0) * 1e3) as i32;
            self.send(&GLOBAL_POSITION_INT_DATA { relative_alt, ..Default::default() });
        }
    }

    /// Sends the messages of the autopilot that are due at this tick.
    pub(super) fn report(&mut self) {
        if self.silent {
            return;
        }
        let count = self.now.as_micros() / 50_000;
        if count.is_multiple_of(20) {
            let bytes = self.heartbeat();
            if !self.no_heartbeat {
                self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
                self.drain();
            }
            if self.kind == AutopilotKind::Px4
                && let Some(pos_horiz_accuracy) = self.accuracy_m
            {
                self.send(&ESTIMATOR_STATUS_DATA { pos_horiz_accuracy, ..Default::default() });
            }
            if self.sends(1) && !self.no_battery {
                let status =
                    SYS_STATUS_DATA { battery_remaining: self.battery, ..Default::default() };
                self.send(&status);
            }
        }
        if count.is_multiple_of(4) && self.sends(245) && !self.no_landed_state {
            let landed_state = if self.reports_ground() {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND
            } else {
                MavLandedState::MAV_LANDED_STATE_IN_AIR
            };
            self.send(&EXTENDED_SYS_STATE_DATA { landed_state, ..Default::default() });
        }
        if count.is_multiple_of(4) && self.kind == AutopilotKind::ArduPilot {
            self.report_ardupilot();
        }
        if !self.no_position && self.sends(32) {
            let ned = self.ned();
            self.send(&LOCAL_POSITION_NED_DATA {
                time_boot_ms: self.now.as_boot_ms(),
                x: ned.x as f32,
                y: ned.y as f32,
                z: ned.z as f32,
                vz: -self.climbs_mps,
                ..Default::default()
            });
        }
    }
}
