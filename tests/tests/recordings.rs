//! Recordings of real autopilots: the messages sent to them are sent to the simulated ones, and the
//! answers are compared.
//!
//! A `.tlog` holds the frames of both directions with their times. What the autopilot (component 1
//! of system 1) did not send is sent to the simulated one at the same times; its acks must be the
//! same results for the same commands in the same order, and it must have gone through the same
//! modes and landed states.

use std::path::Path;

use companion::link::frame::{self, Frame, Framer, Header};
use companion::{Companion, Config as CompanionConfig, Instant, Link};
use flockmate_tests::{logs, shared_data};
use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, GPS_GLOBAL_ORIGIN_DATA};
use planner_core::Point;
use planner_core::geo::frames::{Geodetic, geodetic_to_enu};
use sim_autopilot::{Autopilot, AutopilotConfig, SimulatedKind};

const COMMAND_ACK: u32 = 77;
const HEARTBEAT: u32 = 0;
const EXTENDED_SYS_STATE: u32 = 245;
const STEP_S: f64 = 0.004;

/// One recorded frame: seconds since the first one, its bytes, and the decoded frame if the dialect
/// knows it.
struct Recorded {
    t_s: f64,
    bytes: Vec<u8>,
    frame: Option<Frame>,
}

fn recording(path: &Path) -> Vec<Recorded> {
    let records = logs::read_log(path);
    let first_us = records.first().map_or(0, |record| record.at_us);
    let decoded = |record: logs::LogRecord| {
        let frame = Framer::new().next(Instant::ZERO, &mut record.bytes.as_slice());
        Recorded { t_s: (record.at_us - first_us) as f64 * 1e-6, bytes: record.bytes, frame }
    };
    records.into_iter().map(decoded).collect()
}

/// What an autopilot did, as far as real and simulated one are compared.
#[derive(Debug, Default)]
struct Story {
    /// Acknowledgements: time (s), command, result.
    acks: Vec<(f64, u16, u8)>,
    /// HEARTBEAT's custom mode, each time it changed. The armed bit may be on and off between two
    /// heartbeats.
    modes: Vec<u32>,
    /// MAV_LANDED_STATE, each time it changed.
    landed: Vec<u8>,
}

impl Story {
    fn hear(&mut self, t_s: f64, frame: &Frame) {
        let p = frame.padded_payload();
        match frame.message_id {
            COMMAND_ACK => self.acks.push((t_s, u16::from_le_bytes([p[0], p[1]]), p[2])),
            HEARTBEAT => {
                let mode = u32::from_le_bytes([p[0], p[1], p[2], p[3]]);
                if self.modes.last() != Some(&mode) {
                    self.modes.push(mode);
                }
            }
            EXTENDED_SYS_STATE if self.landed.last() != Some(&p[1]) => self.landed.push(p[1]),
            _ => {}
        }
    }

    fn results(&self) -> Vec<(u16, u8)> {
        self.acks.iter().map(|&(_, command, result)| (command, result)).collect()
    }
}

/// Sends a simulated autopilot the messages that were sent to the real one, which had booted
/// `booted_s` seconds before the recording. Returns the real story and the simulated one.
fn replay(recorded: &[Recorded], config: &AutopilotConfig, booted_s: f64) -> (Story, Story) {
    let mut autopilot = Autopilot::new(config).unwrap();
    let (mut framer, mut buffer) = (Framer::new(), [0; 2048]);
    let (mut real, mut simulated) = (Story::default(), Story::default());
    let ground_m = config.start.z - config.vehicle.radius_m;
    let mut step_to = |t_s: f64, autopilot: &mut Autopilot, story: Option<&mut Story>| {
        let mut heard = Vec::new();
        while (autopilot.time_us() as f64) * 1e-6 < t_s + booted_s {
            autopilot.step(STEP_S as f32, ground_m);
            let now_us = autopilot.time_us();
            loop {
                let len = autopilot.poll_transmit(&mut buffer);
                if len == 0 {
                    break;
                }
                let mut input = &buffer[..len];
                while let Some(frame) = framer.next(Instant::from_micros(now_us), &mut input) {
                    heard.push((now_us as f64 * 1e-6 - booted_s, frame));
                }
            }
        }
        if let Some(story) = story {
            heard.iter().for_each(|(t_s, frame)| story.hear(*t_s, frame));
        }
    };
    step_to(0.0, &mut autopilot, None);
    for entry in recorded {
        let Some(frame) = &entry.frame else { continue };
        step_to(entry.t_s, &mut autopilot, Some(&mut simulated));
        if (frame.system, frame.component) == (1, 1) {
            real.hear(entry.t_s, frame);
        } else {
            autopilot.handle_bytes(&entry.bytes);
        }
    }
    (real, simulated)
}

/// Asserts that acks come in the same order with the same results, each about as late as the real
/// one.
fn assert_same_acks(real: &Story, simulated: &Story) {
    assert!(real.acks.len() > 15);
    assert_eq!(real.results(), simulated.results());
    for (a, b) in real.acks.iter().zip(&simulated.acks) {
        assert!(
            (a.0 - b.0).abs() < 0.02,
            "command {} acknowledged at {} s, not at {} s",
            a.1,
            b.0,
            a.0
        );
    }
}

#[test]
fn the_simulated_arducopter_answers_as_the_recorded_one_did() {
    let Some(path) = shared_data("mavlink/arducopter-4.6-guided.tlog") else { return };
    let origin = Geodetic { lat_deg: -35.363_262, lon_deg: 149.165_237, alt_m: 584.09 };
    let config = AutopilotConfig {
        autopilot: SimulatedKind::Ardupilot,
        world_origin: origin,
        ekf_origin: origin,
        estimator_ready_s: 41.6,
        ..AutopilotConfig::default()
    };
    // The TIMESYNC of 10.002 s after boot is 7.648 s into the recording.
    let (real, simulated) = replay(&recording(&path), &config, 2.353);
    assert_same_acks(&real, &simulated);
    assert_eq!(real.modes, simulated.modes);
    assert_eq!(real.landed, simulated.landed);
}

#[test]
fn the_simulated_px4_answers_as_the_recorded_one_did() {
    let Some(path) = shared_data("mavlink/px4-1.17-offboard.tlog") else { return };
    let origin = Geodetic { lat_deg: 47.397_741_4, lon_deg: 8.545_596_2, alt_m: 489.8 };
    let config =
        AutopilotConfig { world_origin: origin, ekf_origin: origin, ..AutopilotConfig::default() };
    let (real, simulated) = replay(&recording(&path), &config, 1.0);
    assert_same_acks(&real, &simulated);
    assert_eq!(real.modes, simulated.modes);
    // When exactly LANDING is reported depends on the land detector; only the first and last states
    // are compared.
    assert_eq!(
        (real.landed.first(), real.landed.last()),
        (simulated.landed.first(), simulated.landed.last())
    );
}

/// A flight as a companion saw it.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    modes: Vec<u32>,
    grounded: Vec<bool>,
    frames: u32,
}

/// Plays the autopilot's messages to a companion whose mission origin is `origin`; after twenty
/// frames `announced` is sent too. Where a global position was sent, the companion's own one,
/// computed from local metres by that autopilot's projection, must be the same place. Returns what
/// was recorded, and what the companion saw.
fn play(
    recorded: &[Recorded],
    origin: Geodetic,
    announced: Option<&GPS_GLOBAL_ORIGIN_DATA>,
) -> (Seen, Seen) {
    let mut companion: Companion<2, 4, 2> =
        Companion::new(CompanionConfig::new(1, Point::zeros(), origin)).unwrap();
    let (mut story, mut seen, mut compared, mut buffer) =
        (Story::default(), Seen::default(), 0, [0; 512]);
    let (mut grounded, mut sent) = (Vec::new(), 0);
    let from_autopilot =
        |entry: &&Recorded| entry.frame.as_ref().is_none_or(|f| (f.system, f.component) == (1, 1));
    for (number, entry) in recorded.iter().filter(from_autopilot).enumerate() {
        let now = Instant::from_micros((entry.t_s * 1e6) as u64);
        companion.handle_bytes(Link::Autopilot, now, &entry.bytes);
        sent += u32::from(entry.frame.is_some());
        if let (20, Some(announced)) = (number, announced) {
            let sequence = entry.frame.as_ref().map_or(0, |f| f.sequence.wrapping_add(1));
            let length =
                frame::encode(Header { system: 1, component: 1, sequence }, announced, &mut buffer);
            companion.handle_bytes(Link::Autopilot, now, &buffer[..length]);
            sent += 1;
        }
        if companion.poll_timeout().is_some_and(|due| due <= now) {
            companion.handle_timeout(now);
        }
        for link in [Link::Autopilot, Link::Swarm] {
            while companion.poll_transmit(link, &mut buffer) > 0 {}
        }
        while companion.poll_event().is_some() {}
        let telemetry = companion.telemetry();
        if telemetry.heartbeat_at.is_some() && seen.modes.last() != Some(&telemetry.custom_mode) {
            seen.modes.push(telemetry.custom_mode);
        }
        let on_ground = telemetry.reports_ground(now);
        if (on_ground || telemetry.last_reported_flight())
            && seen.grounded.last() != Some(&on_ground)
        {
            seen.grounded.push(on_ground);
        }
        let Some(heard) = &entry.frame else { continue };
        story.hear(entry.t_s, heard);
        if heard.message_id == EXTENDED_SYS_STATE {
            let on_ground = heard.padded_payload()[1] == 1;
            if grounded.last() != Some(&on_ground) {
                grounded.push(on_ground);
            }
        }
        let Some(global) = heard.decode::<GLOBAL_POSITION_INT_DATA>() else { continue };
        if let Some(at) = telemetry.position_at {
            let place = Geodetic {
                lat_deg: f64::from(global.lat) * 1e-7,
                lon_deg: f64::from(global.lon) * 1e-7,
                alt_m: f64::from(global.alt) * 1e-3,
            };
            let age_s = (now - at).as_secs_f32();
            let apart =
                telemetry.position + telemetry.velocity * age_s - geodetic_to_enu(&origin, &place);
            // Local and global position are sent up to a stream's period apart.
            assert!(
                age_s > 0.2 || apart.xy().norm() < 0.1,
                "{apart} at {} s, {age_s} s old",
                entry.t_s
            );
            compared += 1;
        }
    }
    println!("{compared} places compared");
    assert!(compared > 300, "{compared} places compared");
    seen.frames = companion.counters(Link::Autopilot).frames;
    (Seen { modes: story.modes, grounded, frames: sent }, seen)
}

#[test]
fn the_companion_sees_px4s_recorded_flight_as_it_was() {
    let Some(path) = shared_data("mavlink/px4-1.17-offboard.tlog") else { return };
    // The recording holds no GPS_GLOBAL_ORIGIN; it follows from its HOME_POSITION (planner-core's
    // tests of frames).
    let announced =
        GPS_GLOBAL_ORIGIN_DATA { latitude: 473_977_415, longitude: 85_455_963, altitude: 489_824 };
    let origin = Geodetic { lat_deg: 47.405, lon_deg: 8.55, alt_m: 480.0 };
    let (story, seen) = play(&recording(&path), origin, Some(&announced));
    assert_eq!(story, seen);
}

#[test]
fn the_companion_sees_arducopters_recorded_flight_as_it_was() {
    let Some(path) = shared_data("mavlink/arducopter-4.6-guided.tlog") else { return };
    let origin = Geodetic { lat_deg: -35.357, lon_deg: 149.17, alt_m: 580.0 };
    let (story, seen) = play(&recording(&path), origin, None);
    assert_eq!(story, seen);
}
