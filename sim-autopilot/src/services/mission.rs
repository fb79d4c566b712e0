//! The mission protocol: missions, geofences and rally points are stored and can be read back; only
//! missions have an effect (`mission_flight`).
//!
//! Upload: COUNT → items requested one by one, each again if it has not come after 0.25 s → ACK.
//! Download: REQUEST_LIST → COUNT, then each item on request. Source: MAVLink guide, "Mission
//! Protocol".

use crate::link::msg::{
    MISSION_ACK as ACK, MISSION_CLEAR_ALL as CLEAR_ALL, MISSION_COUNT as COUNT,
    MISSION_CURRENT as CURRENT, MISSION_ITEM, MISSION_ITEM_INT, MISSION_REQUEST as REQUEST,
    MISSION_REQUEST_INT as REQUEST_INT, MISSION_REQUEST_LIST as REQUEST_LIST,
    MISSION_SET_CURRENT as SET_CURRENT,
};
use crate::link::port::{Port, Sender};
use crate::link::wire::PayloadReader;

/// Values of MAV_MISSION_RESULT.
const ACCEPTED: u8 = 0;
const UNSUPPORTED: u8 = 3;
const NO_SPACE: u8 = 4;
const INVALID: u8 = 5;
const INVALID_SEQUENCE: u8 = 13;

/// Number of mission types that are stored: mission, geofence, rally points.
const MISSION_TYPES: usize = 3;
/// Most items of a mission: 724 as in ArduCopter on small boards; PX4 has at least 500.
const MAX_ITEMS: u16 = 724;
/// Time after which an item of an upload is requested again, microseconds.
const RETRY_AFTER_US: u64 = 250_000;
/// Most repeated requests for one item; then the upload is dropped.
const MAX_RETRIES: u32 = 20;

/// An item as the first 37 bytes of MISSION_ITEM_INT's payload, without the mission type.
pub(crate) type MissionItem = [u8; 37];

/// An upload in progress.
#[derive(Clone, Debug)]
struct MissionUpload {
    /// Sender of the upload.
    from: Sender,
    /// MAV_MISSION_TYPE: mission 0, geofence 1, rally points 2.
    mission_type: u8,
    /// Number of items that COUNT announced.
    count: u16,
    /// Items received so far.
    items: Vec<MissionItem>,
    /// Time of the last item request, microseconds since boot.
    requested_us: u64,
    /// Number of times that the present item was requested again.
    retries: u32,
}

/// Progress of the mission that is flown.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MissionProgress {
    /// Number of the current item; the number of items when all are completed.
    pub current_item: u16,
    /// Time at which the current item began, microseconds since boot. `None` before.
    pub(crate) item_begun_us: Option<u64>,
    /// Time at which the vehicle first was at the current item's place, microseconds since boot.
    /// `None` before.
    pub(crate) arrived_us: Option<u64>,
}

impl MissionProgress {
    /// Progress at the start of item `current`.
    pub(crate) fn starting_at(current: u16) -> Self {
        Self { current_item: current, ..Self::default() }
    }

    /// Skips the items before `first`.
    pub(crate) fn skip_items_before(&mut self, first: u16) {
        self.current_item = self.current_item.max(first);
    }

    /// Completes the current item: the next one begins. Returns the number of the completed one.
    pub(super) fn complete_item(&mut self) -> u16 {
        let completed = self.current_item;
        *self = Self::starting_at(completed + 1);
        completed
    }

    /// Makes the next flight start with the first item.
    pub(super) fn rewind(&mut self) {
        *self = Self::default();
    }

    /// Notes that the vehicle is at the current item's place; only the first time counts.
    pub(super) fn note_arrival(&mut self, now_us: u64) {
        self.arrived_us.get_or_insert(now_us);
    }

    /// The current item starts from its beginning when the mission is continued.
    pub(crate) fn restart_item(&mut self) {
        (self.item_begun_us, self.arrived_us) = (None, None);
    }
}

/// Stored missions, geofences and rally points, and the mission's progress.
#[derive(Clone, Debug, Default)]
pub struct Missions {
    /// Items of each mission type: mission, geofence, rally points.
    stored: [Vec<MissionItem>; MISSION_TYPES],
    /// The upload in progress; `None` without one.
    upload: Option<MissionUpload>,
    /// Progress of the mission that is flown.
    pub(crate) progress: MissionProgress,
    /// Speed that a mission item set, m/s, until the mode logic takes it.
    pub(super) requested_speed: Option<f32>,
}

impl Missions {
    /// Takes the speed that a mission item requested since the last call, m/s.
    pub(crate) fn take_requested_speed(&mut self) -> Option<f32> {
        self.requested_speed.take()
    }

    /// Items of the stored mission.
    pub(crate) fn items(&self) -> &[MissionItem] {
        &self.stored[0]
    }

    /// Requests the next item of an upload again if it did not come in time; after 20 repetitions
    /// drops the upload.
    pub(crate) fn retry_item_request(&mut self, now_us: u64, index: usize, port: &mut Port) {
        let Some(upload) = &mut self.upload else { return };
        if upload.from.port != index || now_us < upload.requested_us + RETRY_AFTER_US {
            return;
        }
        upload.retries += 1;
        if upload.retries > MAX_RETRIES {
            self.upload = None;
            return;
        }
        upload.request_item(now_us, port);
    }
}

impl MissionUpload {
    /// Requests the next item.
    fn request_item(&mut self, now_us: u64, port: &mut Port) {
        self.requested_us = now_us;
        let [low, high] = (self.items.len() as u16).to_le_bytes();
        port.send_raw(
            REQUEST_INT,
            &[low, high, self.from.system, self.from.component, self.mission_type],
        );
    }
}

impl Missions {
    /// Handles a message of the mission protocol that `from` sent and that arrived at `port`.
    pub(crate) fn handle_message(
        &mut self,
        now_us: u64,
        port: &mut Port,
        from: Sender,
        id: u32,
        fields: &PayloadReader<'_>,
    ) {
        let kind_at = match id {
            REQUEST_LIST | CLEAR_ALL => 2,
            COUNT | REQUEST | REQUEST_INT => 4,
            MISSION_ITEM | MISSION_ITEM_INT => 37,
            SET_CURRENT => return self.set_current(port, from, fields.u16(0)),
            // An ACK ends a download, which needs no action.
            _ => return,
        };
        let kind = fields.u8(kind_at);
        let slot = usize::from(kind);
        if slot >= MISSION_TYPES && !(id == CLEAR_ALL && kind == u8::MAX) {
            return send_mission_ack(port, from, UNSUPPORTED, kind);
        }
        match id {
            REQUEST_LIST => {
                let [low, high] = (self.stored[slot].len() as u16).to_le_bytes();
                port.send_raw(COUNT, &[low, high, from.system, from.component, kind]);
            }
            REQUEST | REQUEST_INT => match self.stored[slot].get(usize::from(fields.u16(0))) {
                Some(item) => {
                    let mut payload = [0; 38];
                    payload[..37].copy_from_slice(item);
                    payload[32..34].copy_from_slice(&[from.system, from.component]);
                    payload[37] = kind;
                    port.send_raw(MISSION_ITEM_INT, &payload);
                }
                None => send_mission_ack(port, from, INVALID_SEQUENCE, kind),
            },
            COUNT if fields.u16(0) > MAX_ITEMS => send_mission_ack(port, from, NO_SPACE, kind),
            COUNT if fields.u16(0) == 0 => {
                self.stored[slot].clear();
                send_mission_ack(port, from, ACCEPTED, kind);
            }
            COUNT => {
                let mut upload = MissionUpload {
                    from,
                    mission_type: kind,
                    count: fields.u16(0),
                    items: Vec::new(),
                    requested_us: 0,
                    retries: 0,
                };
                upload.request_item(now_us, port);
                self.upload = Some(upload);
            }
            CLEAR_ALL => {
                let all = kind == u8::MAX;
                for (k, stored) in self.stored.iter_mut().enumerate() {
                    if all || k == slot {
                        stored.clear();
                    }
                }
                send_mission_ack(port, from, ACCEPTED, kind);
            }
            _ => self.handle_item(now_us, port, from, id, kind, fields),
        }
    }

    /// Stores an item of the upload; requests the next one, or ends the upload.
    fn handle_item(
        &mut self,
        now_us: u64,
        port: &mut Port,
        from: Sender,
        id: u32,
        kind: u8,
        fields: &PayloadReader<'_>,
    ) {
        let Some(upload) = &mut self.upload else {
            return send_mission_ack(port, from, INVALID_SEQUENCE, kind);
        };
        if upload.from.system_and_component() != from.system_and_component()
            || upload.mission_type != kind
        {
            return send_mission_ack(port, from, INVALID_SEQUENCE, kind);
        }
        let sequence = usize::from(fields.u16(28));
        if sequence < upload.items.len() {
            // A repeated item: the next one was requested already.
            return;
        }
        let Some(item) = read_item(id, fields) else {
            self.upload = None;
            return send_mission_ack(port, from, INVALID, kind);
        };
        if sequence == upload.items.len() {
            upload.items.push(item);
            upload.retries = 0;
        }
        if upload.items.len() < usize::from(upload.count) {
            upload.request_item(now_us, port);
        } else if let Some(done) = self.upload.take() {
            self.stored[usize::from(kind)] = done.items;
            if kind == 0 {
                self.progress = MissionProgress::default();
            }
            send_mission_ack(port, from, ACCEPTED, kind);
        }
    }

    /// Makes the stored mission continue with item `sequence` (SET_CURRENT).
    fn set_current(&mut self, port: &mut Port, from: Sender, sequence: u16) {
        if usize::from(sequence) < self.stored[0].len() {
            self.progress = MissionProgress::starting_at(sequence);
            port.send_raw(CURRENT, &sequence.to_le_bytes());
        } else {
            send_mission_ack(port, from, INVALID_SEQUENCE, 0);
        }
    }
}

/// Sends a MISSION_ACK.
fn send_mission_ack(port: &mut Port, from: Sender, result: u8, kind: u8) {
    port.send_raw(ACK, &[from.system, from.component, result, kind]);
}

/// Converts an item of either message to MISSION_ITEM_INT; `None` if a number in it is infinite or
/// a coordinate is out of range.
fn read_item(id: u32, fields: &PayloadReader<'_>) -> Option<MissionItem> {
    let mut item = [0; 37];
    for (at, byte) in item.iter_mut().enumerate() {
        *byte = fields.u8(at);
    }
    if (0..4).any(|k| fields.f32(4 * k).is_infinite()) || !fields.f32(24).is_finite() {
        return None;
    }
    // MISSION_ITEM holds degrees, or metres in a local frame, as floats.
    if id == MISSION_ITEM {
        let local = matches!(fields.u8(34), 1 | 4 | 7 | 8 | 9);
        let scale = if local { 1e4 } else { 1e7 };
        for at in [16, 20] {
            let value = f64::from(fields.f32(at)) * scale;
            if !value.is_finite() || value.abs() > f64::from(i32::MAX) {
                return None;
            }
            item[at..at + 4].copy_from_slice(&(libm::round(value) as i32).to_le_bytes());
        }
    }
    Some(item)
}
