//! What ArduCopter says unasked beside its streams: texts, the origin when it is set, and stray parameters.

use super::Copter;
use crate::platform::Platform;

const PARAM_VALUE: u32 = 22;
const HOME_POSITION: u32 = 242;
/// Period at which the autopilot counts its time in STAT_RUNTIME and reports it, microseconds.
const RUNTIME_EVERY_US: u64 = 30_000_000;
/// MAV_PARAM_TYPE_INT32.
const INT32: u8 = 6;

impl Copter {
    /// Messages that the autopilot sends when it has booted.
    pub fn boot(&mut self, platform: &mut Platform) {
        platform.say(6, "ArduPilot Ready");
        platform.announce(1);
    }

    /// Reports what has become so since the last step.
    pub(super) fn tell_progress(&mut self, platform: &mut Platform, now_us: u64) {
        if !self.said[0] && self.origin_known(now_us) {
            self.said[0] = true;
            platform.announce_origin();
            platform.announce(HOME_POSITION);
            platform.say(6, "EKF3 IMU0 origin set");
        }
        if !self.said[1] && self.position_known(now_us) {
            self.said[1] = true;
            platform.say(6, "EKF3 IMU0 is using GPS");
        }
        if now_us >= self.runtime_us + RUNTIME_EVERY_US {
            self.runtime_us = now_us;
            self.tell_runtime(platform, (now_us / 1_000_000) as f32);
        }
    }

    /// PARAM_VALUE that nobody asked for.
    fn tell_runtime(&self, platform: &mut Platform, seconds: f32) {
        let mut payload = [0; 25];
        payload[..4].copy_from_slice(&seconds.to_le_bytes());
        payload[4..6].copy_from_slice(&(self.params.len() as u16).to_le_bytes());
        payload[6..8].copy_from_slice(&u16::MAX.to_le_bytes());
        payload[8..20].copy_from_slice(b"STAT_RUNTIME");
        payload[24] = INT32;
        platform.ports.iter_mut().for_each(|port| port.send_raw(PARAM_VALUE, &payload));
    }
}
