//! Only vehicles of the mission acknowledge what this vehicle reported of its path.

extern crate std;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;

use super::super::*;
use crate::link::echo::IntentEcho;
use crate::link::frame::{Header, MAX_FRAME_LEN, encode_raw};
use crate::link::intent::Intent;
use crate::testing::fake_autopilot::*;

/// Sends, as vehicle `id`, an intent that echoes each of this vehicle's last intents. Returns
/// whether guidance or the stored intents changed.
fn echo_changes_anything(id: u8) -> bool {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 30.0);
    bench.run(2.0);
    let known = |bench: &mut Bench| {
        let Companion { guidance, links, .. } = &mut bench.companion;
        std::format!("{guidance:?} {:?}", links.sent_intents())
    };
    let before = known(&mut bench);
    let rank = bench.companion.neighbours.own_rank() as u8;
    for sequence in 0..=u8::MAX {
        let echo = Some(IntentEcho { rank, sequence, held_ticks: 0 });
        let intent = Intent { system_id: id, mission_crc: 0xC0FFEE, echo, ..Intent::default() };
        let mut payload = [0; 133];
        let len = intent.encode(&mut payload);
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: id, component: crate::COMPANION_COMPONENT, sequence };
        let (message, seed) = (TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC);
        let len = encode_raw(header, message, seed, &payload[..len], &mut out);
        bench.companion.handle_bytes(Link::Swarm, bench.now, &out[..len]);
    }
    known(&mut bench) != before
}

#[test]
fn only_a_vehicle_of_the_roster_acknowledges_intents() {
    assert!(echo_changes_anything(77));
    for stranger in [1, 30, 76, 78, 254, 255] {
        assert!(!echo_changes_anything(stranger), "vehicle {stranger}");
    }
}
