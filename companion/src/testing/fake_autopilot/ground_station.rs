//! The ground station reports obstacles.

use mavlink::dialects::ardupilotmega::{COMMAND_INT_DATA, MavCmd, MavFrame};
use planner_core::Point;
use planner_core::geo::frames;

use super::{Bench, ORIGIN, SYSTEM};
use crate::Link;
use crate::link::frame::{self, Header, MAX_FRAME_LEN};

impl Bench {
    /// Sends MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: an obstacle of `radius_m` metres at `place`, ENU
    /// metres.
    pub fn report_obstacle(&mut self, place: &Point, radius_m: f32) {
        let place = frames::enu_to_geodetic(&ORIGIN, place);
        let data = COMMAND_INT_DATA {
            command: MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
            param1: radius_m,
            x: (place.lat_deg * 1e7) as i32,
            y: (place.lon_deg * 1e7) as i32,
            z: place.alt_m as f32,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            frame: MavFrame::MAV_FRAME_GLOBAL,
            ..Default::default()
        };
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: 255, component: 190, sequence: 200 };
        let len = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..len]);
        self.drain();
    }
}
