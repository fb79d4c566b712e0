//! Forges frames from random numbers: fields are random or at their bounds, and some are set such
//! that the companion believes the message.

use companion::autopilot::AutopilotKind;
use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::link::intent::MAX_POINTS;
use companion::link::roster::{self, RosterReport, RosterReportEntry, ShareStatus};
use companion::{AUTOPILOT_COMPONENT, COMPANION_COMPONENT, Link};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;
use planner_core::Point;
use planner_core::geo::frames;

use super::entropy::Entropy;
use super::{AttackedFlight, Mission, NEIGHBOUR_ID, ORIGIN, VICTIM_ID, neighbour_intent};

impl AttackedFlight {
    /// Forges one frame of one of `messages`, and gives it to the companion on one of `links`.
    pub(super) fn forge(&mut self, entropy: &mut impl Entropy, links: &[Link], messages: &[u32]) {
        let head = entropy.bits();
        let pick = |shift: u32, count: u64| (head >> shift) % count;
        let link = links[pick(0, links.len() as u64) as usize];
        let message_id = messages[pick(1, messages.len() as u64) as usize];
        let system = match pick(8, 6) {
            0..=2 if link == Link::Autopilot => VICTIM_ID,
            0 | 1 => NEIGHBOUR_ID,
            2 => VICTIM_ID,
            3 => 1 + pick(16, 5) as u8,
            // Any sender but the mission's ground station, whose forged frames only signing could
            // detect.
            _ => pick(16, 255) as u8,
        };
        let component = match pick(24, 4) {
            0 => (head >> 26) as u8,
            1 | 2 if link == Link::Autopilot => AUTOPILOT_COMPONENT,
            _ => COMPANION_COMPONENT,
        };
        let header = Header { system, component, sequence: (head >> 32) as u8 };
        let mut payload = [0; 255];
        let length = self.fill_payload(message_id, &mut payload, entropy, (head >> 40) as u8);
        let extra = frame::extra_crc(message_id).unwrap_or(0);
        let mut out = [0; MAX_FRAME_LEN];
        let length = frame::encode_raw(header, message_id, extra, &payload[..length], &mut out);
        self.report.frames += 1;
        self.companion.handle_bytes(link, self.now, &out[..length]);
    }

    /// Fills a payload with random or extreme numbers, some replaced by believable ones; returns
    /// its length. The bits of `how` choose what is believable.
    fn fill_payload(
        &self,
        id: u32,
        payload: &mut [u8; 255],
        entropy: &mut impl Entropy,
        how: u8,
    ) -> usize {
        if id == TUNNEL_DATA::ID && how & 3 != 0 {
            return match self.mission == Mission::Area && how & 3 == 1 {
                true => fill_roster(payload, entropy, how),
                false => self.fill_intent(payload, entropy, how),
            };
        }
        let length = PAYLOAD_LENGTHS
            .iter()
            .find(|(known, _)| *known == id)
            .map_or(255, |(_, length)| *length);
        for word in payload[..length].chunks_mut(4) {
            let bits = entropy.bits();
            let value = match bits % 8 {
                0 => (bits >> 8) as u32,
                1 => 0,
                2 => u32::MAX,
                3 => EXTREME_NUMBERS[(bits >> 8) as usize % EXTREME_NUMBERS.len()].to_bits(),
                _ => scaled_number(bits >> 8, 50.0).to_bits(),
            };
            word.copy_from_slice(&value.to_le_bytes()[..word.len()]);
        }
        self.make_believable(id, payload, how);
        length
    }

    /// Fills a payload with an intent like those of the neighbour; returns its length.
    fn fill_intent(&self, payload: &mut [u8; 255], entropy: &mut impl Entropy, how: u8) -> usize {
        let mut intent = neighbour_intent();
        let bits = entropy.bits();
        intent.system_id = if how & 8 == 0 { NEIGHBOUR_ID } else { bits as u8 };
        intent.flags = (bits >> 8) as u8;
        intent.mission_crc = if how & 16 == 0 { 0xC0FFEE } else { bits as u32 };
        intent.plan_crc = if how & 32 == 0 { 5 } else { (bits >> 16) as u32 };
        intent.heard_bits = (bits >> 24) as u32;
        intent.ground_m = scaled_number(bits >> 32, 10.0);
        intent.may_come_down = how & 64 != 0;
        intent.progress_m = scaled_number(bits >> 40, 30.0);
        intent.gates_open_up_to_m = scaled_number(bits >> 48, 5.0);
        for _ in 0..(bits >> 56) as usize % (MAX_POINTS + 1) {
            let bits = entropy.bits();
            let here = self.autopilot.position;
            let near = |shift: u32| scaled_number(bits >> shift, 6.0);
            let point = here + Point::new(near(0), near(16), near(32));
            intent.points.push(point).expect("no more than fit");
        }
        let mut whole = [0; 133];
        let length = intent.encode(&mut whole);
        payload[..length].copy_from_slice(&whole[..length]);
        length
    }

    /// Overwrites fields whose random values would make the companion drop the message at once.
    fn make_believable(&self, id: u32, payload: &mut [u8; 255], how: u8) {
        let near = |shift: u32, how: u8| f32::from(how.rotate_left(shift)) * 0.01 - 1.28;
        match id {
            // A position near the true one, so that it is no jump, in some of the messages.
            32 if how & 3 == 0 => {
                payload[..4].copy_from_slice(&self.now.as_boot_ms().to_le_bytes());
                let geodetic = frames::enu_to_geodetic(&ORIGIN, &self.autopilot.position);
                let origin = self.companion.telemetry().ekf_origin.unwrap_or(ORIGIN);
                let ned =
                    frames::geodetic_to_ned(self.autopilot.kind.projection(), &origin, &geodetic)
                        .cast::<f32>();
                for (axis, shift) in [(0, 0), (1, 3), (2, 5)] {
                    let value = ned[axis] + near(shift, how);
                    payload[4 + 4 * axis..8 + 4 * axis].copy_from_slice(&value.to_le_bytes());
                }
            }
            33 if how & 1 == 0 => {
                let place = self.autopilot.position
                    + Point::new(near(0, how), near(3, how), near(5, how)) * 4.0;
                let geodetic = frames::enu_to_geodetic(&ORIGIN, &place);
                payload[..4].copy_from_slice(&self.now.as_boot_ms().to_le_bytes());
                payload[4..8].copy_from_slice(&((geodetic.lat_deg * 1e7) as i32).to_le_bytes());
                payload[8..12].copy_from_slice(&((geodetic.lon_deg * 1e7) as i32).to_le_bytes());
                payload[12..16].copy_from_slice(&((geodetic.alt_m * 1e3) as i32).to_le_bytes());
            }
            75 | 76 => {
                let command = FORGED_COMMANDS[usize::from(how) % FORGED_COMMANDS.len()];
                payload[28..30].copy_from_slice(&command.to_le_bytes());
                payload[30] = if how & 1 == 0 { VICTIM_ID } else { 0 };
                payload[31] = if how & 2 == 0 { COMPANION_COMPONENT } else { 0 };
                if how & 4 == 0 {
                    payload[..4].copy_from_slice(&f32::from(how >> 7).to_le_bytes());
                }
            }
            0 => {
                payload[5] = if self.autopilot.kind == AutopilotKind::Px4 { 12 } else { 3 };
                if how & 1 == 0 {
                    let mode = self.autopilot.kind.setpoint_mode();
                    payload[..4].copy_from_slice(&mode.to_le_bytes());
                }
                payload[7] = if how & 2 == 0 { 4 } else { 5 };
            }
            20 | 21 | 23 | 110 | 111 => {
                let at = if id == 110 {
                    1
                } else if id == 20 {
                    2
                } else if id == 23 {
                    4
                } else {
                    0
                };
                (payload[at], payload[at + 1]) = (VICTIM_ID, COMPANION_COMPONENT);
            }
            _ => {}
        }
    }
}

/// A random number between −`size` and `size`.
fn scaled_number(bits: u64, size: f32) -> f32 {
    (f32::from(bits as u16) / 32768.0 - 1.0) * size
}

/// Payload length of each message, bytes.
const PAYLOAD_LENGTHS: [(u32, usize); 19] = [
    (0, 9),
    (1, 31),
    (20, 20),
    (21, 2),
    (22, 25),
    (23, 23),
    (32, 28),
    (33, 28),
    (49, 20),
    (66, 6),
    (75, 35),
    (76, 33),
    (77, 10),
    (110, 254),
    (111, 18),
    (193, 26),
    (230, 42),
    (245, 2),
    (253, 54),
];
/// Numbers of commands that a companion obeys, and of some that it does not.
const FORGED_COMMANDS: [u16; 12] = [20, 21, 176, 193, 246, 300, 400, 511, 512, 5004, 22, 0xFFFF];
/// Numbers at the bounds of f32.
const EXTREME_NUMBERS: [f32; 10] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e30,
    -1e-30,
    16_777_217.0,
    -0.0,
];

/// Fills a payload with a roster report like those of the neighbour; returns its length.
fn fill_roster(payload: &mut [u8; 255], entropy: &mut impl Entropy, how: u8) -> usize {
    const ALL: [ShareStatus; 4] =
        [ShareStatus::Alive, ShareStatus::Lost, ShareStatus::Left, ShareStatus::Finished];
    let entry = |bits: u64| RosterReportEntry {
        incarnation: bits as u8 & 7,
        status: ALL[(bits >> 3) as usize % 4],
        progress_dm: (bits >> 8) as u16,
        commitment_dm: (bits & 32 != 0).then_some((bits >> 24) as u16),
        holds: bits & 64 != 0,
        agrees: bits & 128 != 0,
    };
    let bits = entropy.bits();
    // Two contents make the vehicle land at once, so they are rare: the others have given it up, or
    // they are several divisions ahead.
    let (about_it, ahead) = (bits >> 40 & 255 == 0, bits >> 48 & 255 == 0);
    let mut entry_of = |rank| {
        let drawn = entry(entropy.bits());
        if rank == 0 && !about_it { RosterReportEntry::default() } else { drawn }
    };
    let roster = RosterReport {
        system_id: if how & 8 == 0 { NEIGHBOUR_ID } else { bits as u8 },
        division_count: if ahead { (bits >> 8) as u8 } else { 0 },
        has_started: bits >> 4 & 1 != 0,
        hears_started_vehicle: bits >> 5 & 1 != 0,
        // The plan of the flight, whose CRC is 5, or another one.
        plan_crc8: if how & 32 == 0 { 5 } else { (bits >> 16) as u8 },
        first_rank: if how & 64 == 0 { 0 } else { 1 + (bits >> 16) as u8 % 255 },
        mission_crc: if how & 16 == 0 { 0xC0FFEE } else { bits as u32 },
        committed_hash: (bits >> 24) as u32 % 3,
        pending_hash: (bits >> 32) as u32,
        entries: (0..1 + (bits >> 56) as usize % roster::MAX_ENTRIES_PER_MESSAGE)
            .map(&mut entry_of)
            .collect(),
    };
    let mut whole = [0; roster::MAX_LEN];
    let length = roster.encode(&mut whole);
    payload[..length].copy_from_slice(&whole[..length]);
    length
}
