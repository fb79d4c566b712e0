//! The neighbour of the test bench, as its messages arrive by radio.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, TUNNEL_DATA};
use planner_core::geo::frames;

use super::{Bench, ORIGIN, SYSTEM};
use crate::Link;
use crate::link::echo::IntentEcho;
use crate::link::frame::{self, Header, MAX_FRAME_LEN};
use crate::link::intent::Intent;

impl Bench {
    /// Sends the neighbour's intent and position to the companion, at every fourth tick of 50 ms.
    pub(super) fn report_neighbour(&mut self) {
        let Some((place, flags, progress_m, plan_crc)) = self.neighbour else { return };
        let roster = &self.companion.config.roster;
        let id = roster.iter().map(|entry| entry.system_id).find(|id| *id != SYSTEM).unwrap_or(77);
        self.neighbour_sequence = self.neighbour_sequence.wrapping_add(1);
        if !self.neighbour_sequence.is_multiple_of(4) {
            return;
        }
        let mut sent = self
            .swarm
            .iter()
            .rev()
            .filter(|frame| Intent::decode(frame.padded_payload(), SYSTEM).is_some());
        let echo =
            self.neighbour_echoes.and_then(|behind| sent.nth(behind)).map(|sent| IntentEcho {
                rank: self.companion.neighbours.own_rank() as u8,
                sequence: sent.sequence,
                held_ticks: self.neighbour_held,
            });
        let intent = Intent {
            echo,
            system_id: id,
            flags,
            mission_crc: 0xC0FFEE,
            plan_crc,
            progress_m,
            gates_open_up_to_m: self.neighbour_clear_m,
            heard_bits: self.neighbour_hears,
            ..Intent::default()
        };
        let mut payload = [0; 133];
        let len = intent.encode(&mut payload);
        let place = frames::enu_to_geodetic(&ORIGIN, &place);
        let place = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.neighbour_clock.unwrap_or(self.now).as_boot_ms(),
            lat: (place.lat_deg * 1e7) as i32,
            lon: (place.lon_deg * 1e7) as i32,
            alt: (place.alt_m * 1e3) as i32,
            ..Default::default()
        };
        let head =
            |sequence| Header { system: id, component: crate::COMPANION_COMPONENT, sequence };
        let mut out = [0; MAX_FRAME_LEN];
        let (id, seed) = (TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC);
        let n =
            frame::encode_raw(head(self.neighbour_sequence), id, seed, &payload[..len], &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..n]);
        let n = frame::encode(head(self.neighbour_sequence.wrapping_add(1)), &place, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..n]);
    }
}
