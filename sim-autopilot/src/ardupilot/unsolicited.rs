//! Messages that ArduCopter sends without a request, beside its streams: STATUSTEXTs, origin and
//! home once set, PARAM_VALUE of its runtime.

use super::Copter;
use crate::link::msg::{HOME_POSITION, PARAM_VALUE, SYS_STATUS};
use crate::platform::Platform;

/// Period at which ArduCopter updates STAT_RUNTIME and sends it, microseconds.
const STAT_RUNTIME_EVERY_US: u64 = 30_000_000;
/// Value of MAV_PARAM_TYPE_INT32.
const PARAM_TYPE_INT32: u8 = 6;

impl Copter {
    /// Sends the messages of a boot: a STATUSTEXT and one SYS_STATUS.
    pub fn send_boot_messages(&mut self, platform: &mut Platform) {
        platform.send_text(6, "ArduPilot Ready");
        platform.send_on_all_ports(SYS_STATUS);
    }

    /// Sends messages once the estimator gets its origin and its position, and STAT_RUNTIME every
    /// 30 s.
    pub(super) fn send_unsolicited_messages(&mut self, platform: &mut Platform, now_us: u64) {
        if !self.reported_origin_and_position[0] && self.origin_known(now_us) {
            self.reported_origin_and_position[0] = true;
            platform.announce_origin();
            platform.send_on_all_ports(HOME_POSITION);
            platform.send_text(6, "EKF3 IMU0 origin set");
        }
        if !self.reported_origin_and_position[1] && self.position_known(now_us) {
            self.reported_origin_and_position[1] = true;
            platform.send_text(6, "EKF3 IMU0 is using GPS");
        }
        if now_us >= self.runtime_sent_us + STAT_RUNTIME_EVERY_US {
            self.runtime_sent_us = now_us;
            self.send_runtime_param(platform, (now_us / 1_000_000) as f32);
        }
    }

    /// Sends a PARAM_VALUE of STAT_RUNTIME that nobody requested.
    fn send_runtime_param(&self, platform: &mut Platform, seconds: f32) {
        let mut payload = [0; 25];
        payload[..4].copy_from_slice(&seconds.to_le_bytes());
        payload[4..6].copy_from_slice(&(self.params.len() as u16).to_le_bytes());
        payload[6..8].copy_from_slice(&u16::MAX.to_le_bytes());
        payload[8..20].copy_from_slice(b"STAT_RUNTIME");
        payload[24] = PARAM_TYPE_INT32;
        platform.ports.iter_mut().for_each(|port| port.send_raw(PARAM_VALUE, &payload));
    }
}
