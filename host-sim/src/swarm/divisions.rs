//! Logs the divisions that companions of a coverage mission agree on in flight, from their radio
//! messages: the plan that each vehicle flies after a division, and the inputs that the plan is
//! computed from. The plan can be computed again from these inputs and the mission file.

use std::collections::{BTreeSet, HashMap};
use std::rc::Rc;

use companion::link::frame::Framer;
use companion::link::intent::Intent;
use companion::link::roster::{RosterReport, RosterReportEntry, ShareStatus};
use companion::swarm::fleet::VehicleDivisionInput;
use companion::time::Instant;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;

/// A division that the swarm agreed on, as flown by one vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct FlownDivision {
    /// When the vehicle first reported the plan of this division, seconds.
    pub t_s: f32,
    /// MAVLink system id of the vehicle.
    pub vehicle: u8,
    /// Number of divisions agreed on so far, this one included.
    pub number: u8,
    /// Inputs of this division, one a vehicle in the order of the vehicles' ids; empty if no
    /// vehicle reported them.
    pub inputs: Vec<VehicleDivisionInput>,
    /// CRC of the plan that the vehicle flies after this division.
    pub plan_crc: u32,
    /// Time from the first commitment reported for this division until all that take part had
    /// reported that all agree on it, seconds; `None` if not all reported that.
    pub agreement_s: Option<f32>,
}

/// When vehicles agree on a division.
#[derive(Clone, Debug, Default)]
struct Agreement {
    /// When a vehicle first reported a commitment, seconds. `None` before.
    first_commitment_s: Option<f32>,
    /// Ids of the vehicles that reported that all have the same division.
    agreeing: BTreeSet<u8>,
    /// When the last of them did, seconds. `None` before.
    agreed_s: Option<f32>,
}

/// What one vehicle last reported.
#[derive(Clone, Copy, Debug, Default)]
struct VehicleReport {
    /// CRC of the plan in its last intent.
    plan_crc: u32,
    /// Number of divisions agreed on, in its last roster report.
    number: u8,
    /// Hash of the inputs of the last division agreed on.
    committed_hash: u32,
    /// Number of the division whose plan the vehicle flies; `flown_crc` is the CRC of that plan.
    flown_number: u8,
    flown_crc: u32,
}

/// The reports heard so far, and the divisions found in them.
#[derive(Debug, Default)]
pub struct DivisionLog {
    /// What each vehicle last reported, by its system id.
    vehicles: HashMap<u8, VehicleReport>,
    /// Inputs of each division, by the hash that the vehicles reported for it.
    inputs_by_hash: HashMap<u32, Vec<VehicleDivisionInput>>,
    /// The agreement on each division, by its number.
    agreements: HashMap<u8, Agreement>,
    /// The divisions as vehicles flew them, in order of time.
    flown: Vec<FlownDivision>,
}

impl DivisionLog {
    /// Reads the roster reports and intents, both of them TUNNEL messages, among packets that
    /// stations sent at `t_s`.
    pub fn handle_packets(&mut self, t_s: f32, packets: &[Rc<[u8]>]) {
        for packet in packets {
            let mut input = &packet[..];
            let frame = Framer::new().next(Instant::ZERO, &mut input);
            let Some(frame) = frame.filter(|frame| frame.message_id == TUNNEL_DATA::ID) else {
                continue;
            };
            if let Some(roster) = RosterReport::decode(frame.padded_payload(), frame.system) {
                self.handle_roster(t_s, &roster);
            } else if let Some(intent) = Intent::decode(frame.padded_payload(), frame.system) {
                self.handle_intent(t_s, &intent);
            }
        }
    }

    /// Notes how many divisions the report's sender counts, and the inputs of the division under
    /// way that the report has.
    fn handle_roster(&mut self, t_s: f32, roster: &RosterReport) {
        let reported = self.vehicles.entry(roster.system_id).or_default();
        (reported.number, reported.committed_hash) = (roster.division_count, roster.committed_hash);
        if reported.number == reported.flown_number {
            reported.flown_crc = reported.plan_crc;
        }
        self.note_agreement(t_s, roster);
        self.log_division_once_flown(t_s, roster.system_id);
        if roster.pending_hash == 0 {
            return;
        }
        // A vehicle that took no part in the division before takes none in this one.
        let before = self.inputs_by_hash.get(&roster.committed_hash).cloned().unwrap_or_default();
        let inputs = self.inputs_by_hash.entry(roster.pending_hash).or_default();
        for (i, entry) in roster.entries.iter().enumerate() {
            let rank = i + usize::from(roster.first_rank);
            inputs.resize(inputs.len().max(rank + 1), VehicleDivisionInput::default());
            if before.get(rank).is_none_or(|input| input.alive) {
                inputs[rank] = VehicleDivisionInput::from_entry(entry);
            }
        }
    }

    /// Notes when a commitment to the division under way is first reported, and when all vehicles
    /// agree on it. Where a report holds only some of the vehicles, only their agreement is seen.
    fn note_agreement(&mut self, t_s: f32, roster: &RosterReport) {
        let own = |entry: &&RosterReportEntry| entry.status == ShareStatus::Alive;
        let alive = roster.entries.iter().filter(own);
        let agreement = self.agreements.entry(roster.division_count + 1).or_default();
        if agreement.first_commitment_s.is_none()
            && alive.clone().any(|e| e.commitment_dm.is_some())
        {
            agreement.first_commitment_s = Some(t_s);
        }
        if roster.pending_hash != 0 && alive.clone().all(|entry| entry.agrees) {
            agreement.agreeing.insert(roster.system_id);
            if agreement.agreed_s.is_none() && agreement.agreeing.len() >= alive.count() {
                agreement.agreed_s = Some(t_s);
            }
        }
    }

    /// Notes the plan that the intent's sender flies.
    fn handle_intent(&mut self, t_s: f32, intent: &Intent) {
        self.vehicles.entry(intent.system_id).or_default().plan_crc = intent.plan_crc;
        self.log_division_once_flown(t_s, intent.system_id);
    }

    /// Logs a division for `vehicle` once it reports both a higher number of divisions and another
    /// plan.
    fn log_division_once_flown(&mut self, t_s: f32, vehicle: u8) {
        let reported = self.vehicles.entry(vehicle).or_default();
        if reported.number > reported.flown_number && reported.plan_crc != reported.flown_crc {
            (reported.flown_number, reported.flown_crc) = (reported.number, reported.plan_crc);
            let VehicleReport { number, committed_hash, plan_crc, .. } = *reported;
            let inputs = self.inputs_by_hash.get(&committed_hash).cloned().unwrap_or_default();
            let agreement = self.agreements.get(&number);
            let agreement_s = agreement.and_then(|a| Some(a.agreed_s? - a.first_commitment_s?));
            let division = FlownDivision { t_s, vehicle, number, inputs, plan_crc, agreement_s };
            self.flown.push(division);
        }
    }

    /// The divisions that vehicles flew, in order of time.
    pub fn into_divisions(self) -> Vec<FlownDivision> {
        self.flown
    }
}
