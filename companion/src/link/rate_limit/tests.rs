//! The radio gets no more bytes than the rate limit allows, whatever is requested.

extern crate std;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;

use planner_core::Point;

use super::*;
use crate::link::frame::{self, Header};
use crate::link::photographed;
use crate::link::roster::{self, RosterReport, RosterReportEntry};
use crate::storage::store::{ErasePermission, MAX_READ_LEN};
use crate::testing::fake_autopilot::*;
use crate::testing::fake_flash::{Flash, execute, started};
use crate::{Duration, Link, State};

/// A companion, and a ground station that requests everything at once by the radio.
struct Greedy {
    bench: Bench,
    flash: Flash,
    sequence: u8,
    /// Sequence number of the last FTP request.
    packet: u16,
    /// Bytes that went to the radio, and when.
    sent: Vec<(Instant, usize)>,
    /// Number of TUNNEL messages sent: intents, and reports of a coverage mission.
    reported: usize,
    /// Number of roster reports sent.
    rosters: usize,
}

impl Greedy {
    fn new(mut bench: Bench) -> Self {
        let mut flash = Flash::new(3);
        bench.companion.attach_store(started(&mut flash));
        Self { bench, flash, sequence: 0, packet: 0, sent: Vec::new(), reported: 0, rosters: 0 }
    }

    fn ask<M: MessageData>(&mut self, message: &M) {
        let header = Header { system: 255, component: 190, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut bytes = [0; frame::MAX_FRAME_LEN];
        let length = frame::encode(header, message, &mut bytes);
        self.bench.companion.handle_bytes(Link::Swarm, self.bench.now, &bytes[..length]);
        self.drain();
    }

    fn ask_all(&mut self) {
        for id in [0.0, 33.0, 148.0] {
            self.ask(&COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
                param1: id,
                target_system: SYSTEM,
                target_component: crate::COMPANION_COMPONENT,
                ..Default::default()
            });
        }
        self.ask(&PARAM_REQUEST_LIST_DATA {
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
        });
        self.ask(&TIMESYNC_DATA { tc1: 0, ts1: 5 });
        // A request to list files: each FTP answer is as long as a frame can be.
        self.packet = self.packet.wrapping_add(1);
        let mut payload = [0; 251];
        payload[..2].copy_from_slice(&self.packet.to_le_bytes());
        (payload[3], payload[250]) = (3, 1);
        self.ask(&FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            payload,
        });
    }

    fn drain(&mut self) {
        let now = self.bench.now;
        let mut read = [0; MAX_READ_LEN];
        while let Some(request) = self.bench.companion.poll_flash() {
            let outcome = execute(&mut self.flash, request, ErasePermission::Allowed, &mut read)
                .expect("no power cut");
            self.bench.companion.handle_flash(now, outcome.map(|len| &read[..len]));
        }
        self.bench.drain();
        for frame in self.bench.swarm.drain(..) {
            let tunnel = frame.message_id == TUNNEL_DATA::ID;
            let roster = tunnel && frame.payload().starts_with(&roster::PAYLOAD_TYPE.to_le_bytes());
            self.reported += usize::from(tunnel);
            self.rosters += usize::from(roster);
            self.sent.push((now, frame.payload().len() + 12));
        }
    }

    /// Runs for `seconds`, in each of which everything is requested forty times.
    fn run(&mut self, seconds: u32) {
        (self.reported, self.rosters, self.bench.swarm) = (0, 0, Vec::new());
        self.sent.clear();
        for _ in 0..seconds * 20 {
            self.ask_all();
            self.ask_all();
            self.bench.tick();
            self.drain();
        }
    }

    /// Most bytes within any second.
    fn most_in_a_second(&self) -> u32 {
        let second = |from: Instant| {
            let within = self
                .sent
                .iter()
                .filter(|(at, _)| *at >= from && *at - from < Duration::from_secs(1));
            within.map(|(_, bytes)| *bytes as u32).sum()
        };
        self.sent.iter().map(|(at, _)| second(*at)).max().unwrap_or_default()
    }

    fn bytes(&self) -> u32 {
        self.sent.iter().map(|(_, bytes)| *bytes as u32).sum()
    }
}

const HZ: u8 = 5;

#[test]
fn the_radio_gets_no_more_whatever_is_asked() {
    let saved = MAX_BURST_BYTES + MAX_FRAME_LEN as u32;
    let mut ground = Greedy::new(Bench::new(config()));
    ground.bench.run_until(State::Ready, 6.0);
    ground.run(20);
    assert!(
        ground.most_in_a_second() <= state_bytes_per_s(HZ) + DISARMED_EXTRA_BYTES_PER_S + saved,
        "{}",
        ground.most_in_a_second()
    );
    assert!(ground.bytes() <= 20 * (state_bytes_per_s(HZ) + DISARMED_EXTRA_BYTES_PER_S) + saved);
    assert!(
        ground.bytes() > 20 * DISARMED_EXTRA_BYTES_PER_S / 2,
        "it was asked for more: {}",
        ground.bytes()
    );

    let mut air = Greedy::new(Bench::following(config()));
    air.bench.stuck = true;
    air.run(20);
    assert_eq!(air.bench.state(), State::Follow);
    assert!(
        air.most_in_a_second() <= state_bytes_per_s(HZ) + ARMED_EXTRA_BYTES_PER_S + saved,
        "{}",
        air.most_in_a_second()
    );
    assert!(
        air.bytes() <= 20 * (state_bytes_per_s(HZ) + ARMED_EXTRA_BYTES_PER_S) + saved,
        "{}",
        air.bytes()
    );
    assert!(
        air.reported >= 20 * usize::from(HZ) - 1,
        "the state goes out all the same: {}",
        air.reported
    );
}

#[test]
fn rosters_go_out_whatever_is_asked_and_are_counted() {
    let mut over_area = two_vehicles();
    over_area.lost_vehicle_down_after_s = Some(60.0);
    let mut bench = Bench::new(over_area);
    bench.answer_plan = Some(Ok(field_plan()));
    bench.neighbour = Some((Point::new(8.0, 120.0, 1.5), crate::link::intent::ON_PLAN, 0.0, 5));
    bench.run_until(State::Ready, 6.0);
    bench.start();
    bench.run_until(State::Follow, 30.0);
    bench.stuck = true;
    let mut air = Greedy::new(bench);
    air.run(20);
    assert_eq!(air.bench.state(), State::Follow);
    assert!((39..=41).contains(&air.rosters), "{}", air.rosters);
    let most = state_bytes_per_s(HZ) + COVERAGE_STATE_BYTES_PER_S + ARMED_EXTRA_BYTES_PER_S;
    assert!(air.bytes() <= 20 * most + MAX_BURST_BYTES + MAX_FRAME_LEN as u32, "{}", air.bytes());
}

/// The table of docs/coverage-losses.md, and the reports of [`COVERAGE_STATE_BYTES_PER_S`].
#[test]
fn reports_of_a_coverage_mission_are_as_long_as_said() {
    let roster = |vehicles: usize| {
        let entries = core::iter::repeat_n(RosterReportEntry::default(), vehicles).collect();
        let report = RosterReport { entries, ..RosterReport::default() };
        report.encode(&mut [0; roster::MAX_LEN]) + 12
    };
    assert_eq!([3, 5, 22, 10].map(roster), [50, 60, 145, 85]);
    assert_eq!(roster(4) - roster(3), 5, "5 bytes a vehicle");
    assert_eq!(NAMED_VALUE_FLOAT_DATA::ENCODED_LEN + 12, 30);
    assert_eq!(photographed::MAX_LEN + 12, 141);
    assert_eq!(COVERAGE_STATE_BYTES_PER_S, 575 + 30 + 141);
    assert_ne!(roster::PAYLOAD_TYPE, crate::link::intent::PAYLOAD_TYPE);
}

#[test]
fn state_is_as_long_as_said() {
    let mut bench = Greedy::new(Bench::following(config()));
    bench.bench.stuck = true;
    bench.bench.swarm.clear();
    for _ in 0..200 {
        bench.bench.tick();
    }
    bench.drain();
    // The bytes of ten seconds; intents of this plan have fewer than the most points.
    assert!(
        bench.bytes() <= 10 * state_bytes_per_s(HZ)
            && bench.bytes() > 10 * state_bytes_per_s(HZ) / 3,
        "{}",
        bench.bytes()
    );
    assert_eq!(
        STATE_BYTES as usize,
        (28 + 12) + (5 + 32 + 12 * crate::link::intent::MAX_POINTS + 12)
    );
}

#[test]
fn what_is_owed_is_paid_back_by_time() {
    let mut rate_limit = RadioTokenBucket::default();
    let at = |ms| Instant::ZERO + Duration::from_millis(ms);
    let mut sent = 0;
    while rate_limit.may_send(at(0), ARMED_EXTRA_BYTES_PER_S) {
        rate_limit.take_tokens(MAX_FRAME_LEN);
        sent += MAX_FRAME_LEN as u32;
    }
    assert!((MAX_BURST_BYTES..=MAX_BURST_BYTES + MAX_FRAME_LEN as u32).contains(&sent));
    assert!(!rate_limit.may_send(at(10), ARMED_EXTRA_BYTES_PER_S));
    assert!(rate_limit.may_send(at(1100), ARMED_EXTRA_BYTES_PER_S));
    assert!(
        rate_limit.may_send(at(u64::from(u32::MAX)), ARMED_EXTRA_BYTES_PER_S),
        "and never overflows"
    );
}
