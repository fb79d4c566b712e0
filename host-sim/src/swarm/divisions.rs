//! Divisions that companions of a coverage mission make in flight, from their radio messages: the
//! plans that they fly after it, and what each division follows from. Whoever has the mission file
//! can plan the same again.

use std::collections::HashMap;
use std::rc::Rc;

use companion::link::frame::Framer;
use companion::link::intent::Intent;
use companion::link::roster::RosterReport;
use companion::swarm::fleet::DivisionInput;
use companion::time::Instant;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;

/// A division that counts, as one vehicle flies it.
#[derive(Clone, Debug, PartialEq)]
pub struct Division {
    /// When the vehicle first reported that it flies it, seconds.
    pub t_s: f32,
    /// MAVLink system id of the vehicle.
    pub vehicle: u8,
    /// Divisions that count, this one among them.
    pub number: u8,
    /// The lots that this one follows from, by the rank of the vehicles' ids; empty where nobody
    /// reported them.
    pub lots: Vec<DivisionInput>,
    /// The CRC of the plan that the vehicle flies.
    pub plan_crc: u32,
}

/// Last report of one vehicle.
#[derive(Clone, Copy, Debug, Default)]
struct Reported {
    plan_crc: u32,
    number: u8,
    counted: u32,
    /// The division whose plan it flies, and the CRC of that.
    flies: u8,
    flown_crc: u32,
}

/// Reports heard so far.
#[derive(Debug, Default)]
pub struct DivisionLog {
    vehicles: HashMap<u8, Reported>,
    /// Lots by the hash under which they were reported.
    lots: HashMap<u32, Vec<DivisionInput>>,
    reported: Vec<Division>,
}

impl DivisionLog {
    /// Handles what stations sent.
    pub fn handle_packets(&mut self, t_s: f32, packets: &[Rc<[u8]>]) {
        for packet in packets {
            let mut input = &packet[..];
            let frame = Framer::new().next(Instant::ZERO, &mut input);
            let Some(frame) = frame.filter(|frame| frame.message_id == TUNNEL_DATA::ID) else {
                continue;
            };
            if let Some(roster) = RosterReport::decode(frame.padded(), frame.system) {
                self.take_roster(t_s, &roster);
            } else if let Some(intent) = Intent::decode(frame.padded(), frame.system) {
                self.take_intent(t_s, &intent);
            }
        }
    }

    fn take_roster(&mut self, t_s: f32, roster: &RosterReport) {
        let reported = self.vehicles.entry(roster.system_id).or_default();
        (reported.number, reported.counted) = (roster.divisions, roster.committed_hash);
        if reported.number == reported.flies {
            reported.flown_crc = reported.plan_crc;
        }
        self.note_division(t_s, roster.system_id);
        if roster.hash == 0 {
            return;
        }
        // A vehicle without a part in the division before has none in this one.
        let before = self.lots.get(&roster.committed_hash).cloned().unwrap_or_default();
        let lots = self.lots.entry(roster.hash).or_default();
        for (i, entry) in roster.entries.iter().enumerate() {
            let rank = i + usize::from(roster.first);
            lots.resize(lots.len().max(rank + 1), DivisionInput::default());
            if before.get(rank).is_none_or(|lot| lot.alive) {
                lots[rank] = DivisionInput::from_entry(entry);
            }
        }
    }

    fn take_intent(&mut self, t_s: f32, intent: &Intent) {
        self.vehicles.entry(intent.system_id).or_default().plan_crc = intent.plan_crc;
        self.note_division(t_s, intent.system_id);
    }

    /// A division that counts is flown once the plan is another one.
    fn note_division(&mut self, t_s: f32, vehicle: u8) {
        let reported = self.vehicles.entry(vehicle).or_default();
        if reported.number > reported.flies && reported.plan_crc != reported.flown_crc {
            (reported.flies, reported.flown_crc) = (reported.number, reported.plan_crc);
            let Reported { number, counted, plan_crc, .. } = *reported;
            let lots = self.lots.get(&counted).cloned().unwrap_or_default();
            self.reported.push(Division { t_s, vehicle, number, lots, plan_crc });
        }
    }

    /// The divisions that were flown, in order of time.
    pub fn into_divisions(self) -> Vec<Division> {
        self.reported
    }
}
