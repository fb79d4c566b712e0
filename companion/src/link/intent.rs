//! The intent that a companion reports to the swarm, at `FLK_SWARM_HZ` (by default five times a
//! second): TUNNEL's payload under a private payload type.
//!
//! Little-endian, at most 128 bytes (`README.md` prints the same layout):
//!
//! | byte | type | field |
//! |---|---|---|
//! | 0 | u8 | version, 6 |
//! | 1 | u8 | system id |
//! | 2 | u8 | flags: 1 grounded, 2 flying, 4 landed after the mission, 8 follows the shared plan, 16 out of the plan for good, 32 stands and waits, 64 its path is blocked, 128 flies a detour |
//! | 3 | u8 | lower four bits: number of path points, 0…8; upper four: how many of the last of these the sender flies to only if no other vehicle hears it |
//! | 4 | u32 | CRC-32 of the mission file |
//! | 8 | u32 | CRC-32 of the swarm's plan |
//! | 12 | f32 | progress along the sender's own path, metres; negative while climbing |
//! | 16 | f32 | place along the sender's path up to which its gates are open or will be, metres: it flies on to there though no other vehicle hears it; −1e6 if it may stop at once |
//! | 20 | u32 | vehicles that the sender heard in the last 0.8 s: bit i for the vehicle of rank i, 0…31, in the roster sorted by system id |
//! | 24 | f32 | height of the ground below the sender, as far as it knows, metres up in the mission frame |
//! | 28 | u8 | bit 0: the sender climbs, descends or lands, or a pilot or a failsafe flies it, so that it may come down from where it is; bits 1–7: greatest delay, seconds, of the flight to the place at byte 16, by its gates and its climb, compared with a flight from its progress at 0.4 of the nominal speed |
//! | 29 | 3 × u8 | echo of another vehicle's last intent: its rank + 1, its sequence number, how long the sender held it, in units of 10 ms; 0 for none |
//! | 32 | 12 × n | points that the sender flies along next: f32 east, north, up in the mission frame. They begin at its setpoint and lead to where it will stop for now. No points while a pilot or a failsafe flies it; the setpoint alone while it holds its place. Over an area corners of its path follow, as far as it flies on if no other vehicle hears it |
//!
//! A receiver rejects another version, NaN, a point further than [`MAX_COORDINATE_M`] from the
//! origin, and a system id that is not the sender's.

use heapless::Vec;
use planner_core::Point;
use planner_core::roadmap::MAX_COORDINATE_M;

use crate::link::echo::IntentEcho;

/// Private payload type of TUNNEL, in the range 32768…65535 that MAVLink leaves free.
pub const PAYLOAD_TYPE: u16 = 0xF10C;
/// Most path points in one intent.
pub const MAX_POINTS: usize = 8;
/// Version of the payload's layout.
pub const VERSION: u8 = 6;
/// Bytes of the payload before its path points.
const HEADER_LEN: usize = 32;
/// Bytes of TUNNEL's own fields before the payload: type, target, length.
const TUNNEL_HEADER_LEN: usize = 5;

/// Flag: the sender stands on the ground.
pub const GROUNDED: u8 = 1;
/// Flag: the sender is in the air.
pub const FLYING: u8 = 2;
/// Flag: the sender has landed after its mission.
pub const LANDED: u8 = 4;
/// Flag: the sender follows the shared plan, so its progress opens gates of other vehicles.
pub const ON_PLAN: u8 = 8;
/// Flag: the sender has left the plan for good, at rest where it is or flown by its pilot. It
/// passes no further gate: other vehicles open all gates that wait for it, and count it as an
/// obstacle.
pub const OUT_OF_PLAN: u8 = 16;
/// Flag: the sender stands, and will stand until another vehicle moves.
pub const WAITING: u8 = 32;
/// Flag: an obstacle, or a vehicle that left the plan, blocks the sender's path, or the sender
/// seeks a path home. In a mission with goals it then waits until all other vehicles stand, and
/// flies a detour.
pub const BLOCKED: u8 = 64;
/// Flag: the sender flies a detour or another path off the plan, or evades, or will. On a detour
/// its reported progress is the place along its plan's path where it left that path.
pub const ON_DETOUR: u8 = 128;

/// The intent of one vehicle, the sender.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intent {
    /// MAVLink system id of the sender.
    pub system_id: u8,
    /// Bits [`GROUNDED`], [`FLYING`], [`LANDED`], [`ON_PLAN`], [`OUT_OF_PLAN`], [`WAITING`],
    /// [`BLOCKED`], [`ON_DETOUR`].
    pub flags: u8,
    /// CRC-32 of the mission file.
    pub mission_crc: u32,
    /// CRC-32 of the swarm's plan; 0 while the sender has no plan.
    pub plan_crc: u32,
    /// Progress along the sender's own path, metres; negative while it climbs.
    pub progress_m: f32,
    /// Place along the sender's path up to which its gates are open or will be, metres: it flies on
    /// to there though no other vehicle hears it.
    pub gates_open_up_to_m: f32,
    /// Greatest delay of the flight to `gates_open_up_to_m`, seconds, by gates and climb, compared
    /// with a flight at 0.4 of the nominal speed; at most 127.
    pub unheard_flight_delay_s: u8,
    /// Vehicles that the sender heard in the last 0.8 s: bit i for rank i in the roster, sorted by
    /// system id.
    pub heard_bits: u32,
    /// Height of the ground below the sender, as far as it knows, metres up in the mission frame.
    pub ground_m: f32,
    /// Whether the sender may come down from its place: it climbs, descends or lands, or a pilot or
    /// failsafe flies it.
    pub may_come_down: bool,
    /// Echo of another vehicle's intent, by which that vehicle measures the radio's delay. `None`
    /// without one.
    pub echo: Option<IntentEcho>,
    /// Points that the sender flies along next, in the mission frame: first to where it will stop
    /// for now, then as far as it flies on if no other vehicle hears it. Empty while a pilot or a
    /// failsafe flies it.
    pub points: Vec<Point, MAX_POINTS>,
    /// How many of the last of `points` lie beyond where the sender will stop for now: the sender
    /// flies to them only if no other vehicle hears it.
    pub unheard_flight_point_count: u8,
}

impl Intent {
    /// Writes TUNNEL's whole payload, addressed to all. Returns its length.
    pub fn encode(&self, out: &mut [u8; 133]) -> usize {
        let len = HEADER_LEN + 12 * self.points.len();
        out[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
        (out[2], out[3], out[4]) = (0, 0, len as u8);
        let body = &mut out[TUNNEL_HEADER_LEN..];
        body[..4].copy_from_slice(&[
            VERSION,
            self.system_id,
            self.flags,
            self.points.len() as u8 | self.unheard_flight_point_count << 4,
        ]);
        body[4..8].copy_from_slice(&self.mission_crc.to_le_bytes());
        body[8..12].copy_from_slice(&self.plan_crc.to_le_bytes());
        body[12..16].copy_from_slice(&self.progress_m.to_le_bytes());
        body[16..20].copy_from_slice(&self.gates_open_up_to_m.to_le_bytes());
        body[20..24].copy_from_slice(&self.heard_bits.to_le_bytes());
        body[24..28].copy_from_slice(&self.ground_m.to_le_bytes());
        let [rank, sequence, held] =
            self.echo.map_or([0; 3], |e| [e.rank.saturating_add(1), e.sequence, e.held_ticks]);
        body[28..32].copy_from_slice(&[
            u8::from(self.may_come_down) | self.unheard_flight_delay_s.min(127) << 1,
            rank,
            sequence,
            held,
        ]);
        for (to, value) in
            body[HEADER_LEN..].chunks_exact_mut(4).zip(self.points.iter().flat_map(|p| p.iter()))
        {
            to.copy_from_slice(&value.to_le_bytes());
        }
        TUNNEL_HEADER_LEN + len
    }

    /// Decodes TUNNEL's payload, zero-padded, from the system id `sender`. `None` if it is no
    /// intent, or an invalid one.
    pub fn decode(padded: &[u8; 255], sender: u8) -> Option<Self> {
        let payload_type = u16::from_le_bytes([padded[0], padded[1]]);
        let len = usize::from(padded[4]);
        let body = padded[TUNNEL_HEADER_LEN..].get(..len.min(128))?;
        if payload_type != PAYLOAD_TYPE
            || len < HEADER_LEN
            || body[0] != VERSION
            || body[1] != sender
        {
            return None;
        }
        let (count, beyond) = (usize::from(body[3] & 15), body[3] >> 4);
        if count > MAX_POINTS || usize::from(beyond) > count || len < HEADER_LEN + 12 * count {
            return None;
        }
        let word = |at: usize| [body[at], body[at + 1], body[at + 2], body[at + 3]];
        let float = |at: usize| Some(f32::from_le_bytes(word(at))).filter(|v| v.is_finite());
        let coordinate = |at| float(at).filter(|m| libm::fabsf(*m) <= MAX_COORDINATE_M);
        let mut points = Vec::new();
        for i in 0..count {
            let at = HEADER_LEN + 12 * i;
            let [x, y, z] = [at, at + 4, at + 8].map(coordinate);
            points.push(Point::new(x?, y?, z?)).ok()?;
        }
        Some(Self {
            system_id: sender,
            flags: body[2],
            mission_crc: u32::from_le_bytes(word(4)),
            plan_crc: u32::from_le_bytes(word(8)),
            progress_m: float(12)?,
            gates_open_up_to_m: float(16)?,
            heard_bits: u32::from_le_bytes(word(20)),
            ground_m: float(24)?,
            may_come_down: body[28] & 1 != 0,
            unheard_flight_delay_s: body[28] >> 1,
            echo: body[29].checked_sub(1).map(|rank| IntentEcho {
                rank,
                sequence: body[30],
                held_ticks: body[31],
            }),
            points,
            unheard_flight_point_count: beyond,
        })
    }
}

#[cfg(test)]
mod tests;
