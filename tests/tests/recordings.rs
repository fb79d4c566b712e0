//! Recordings of real autopilots: what was said to them is said to the simulated one, and its answers are compared.
//!
//! A `.tlog` holds the frames of both directions with their times. What the autopilot (component 1 of system 1) did not send is sent to the simulated one at the same times; its acks must be the same results for
//! the same commands in the same order, and it must have gone through the same modes and landed states.

use std::path::Path;

use companion::Instant;
use companion::frame::{Frame, Framer};
use flockmate_tests::{logs, shared_data};
use host_sim::autopilot::{Autopilot, Config, Personality};
use planner_core::frames::Geodetic;

const COMMAND_ACK: u32 = 77;
const HEARTBEAT: u32 = 0;
const EXTENDED_SYS_STATE: u32 = 245;
const STEP_S: f64 = 0.004;

/// One recorded frame: seconds since the first, its bytes, and what they say if the dialect knows it.
struct Recorded {
    t_s: f64,
    bytes: Vec<u8>,
    frame: Option<Frame>,
}

fn recording(path: &Path) -> Vec<Recorded> {
    let records = logs::read(path);
    let first_us = records.first().map_or(0, |record| record.at_us);
    let decoded = |record: logs::Recorded| {
        let frame = Framer::new().next(Instant::ZERO, &mut record.bytes.as_slice());
        Recorded { t_s: (record.at_us - first_us) as f64 * 1e-6, bytes: record.bytes, frame }
    };
    records.into_iter().map(decoded).collect()
}

/// What an autopilot did, as far as the two are compared.
#[derive(Debug, Default)]
struct Story {
    /// Acknowledged: when, command, result.
    acks: Vec<(f64, u16, u8)>,
    /// HEARTBEAT's custom mode, each time it changed. The armed bit may be on and off between two heartbeats.
    modes: Vec<u32>,
    /// MAV_LANDED_STATE, each time it changed.
    landed: Vec<u8>,
}

impl Story {
    fn hear(&mut self, t_s: f64, frame: &Frame) {
        let p = frame.padded();
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

/// Says to a simulated autopilot what was said to the real one, which had booted `booted_s` before the recording.
fn replay(recorded: &[Recorded], config: &Config, booted_s: f64) -> (Story, Story) {
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

/// Acks in the same order with the same results, each about as late as the real one.
fn assert_same_acks(real: &Story, simulated: &Story) {
    assert!(real.acks.len() > 15);
    assert_eq!(real.results(), simulated.results());
    for (a, b) in real.acks.iter().zip(&simulated.acks) {
        assert!((a.0 - b.0).abs() < 0.02, "command {} acknowledged at {} s, not at {} s", a.1, b.0, a.0);
    }
}

#[test]
fn the_simulated_arducopter_answers_as_the_recorded_one_did() {
    let Some(path) = shared_data("mavlink/arducopter-4.6-guided.tlog") else { return };
    let origin = Geodetic { lat_deg: -35.363_262, lon_deg: 149.165_237, alt_m: 584.09 };
    let config = Config {
        personality: Personality::Ardupilot,
        world_origin: origin,
        ekf_origin: origin,
        estimator_ready_s: 41.6,
        ..Config::default()
    };
    // TIMESYNC: 10.002 s after boot came 7.648 s into the recording.
    let (real, simulated) = replay(&recording(&path), &config, 2.353);
    assert_same_acks(&real, &simulated);
    assert_eq!(real.modes, simulated.modes);
    assert_eq!(real.landed, simulated.landed);
}

#[test]
fn the_simulated_px4_answers_as_the_recorded_one_did() {
    let Some(path) = shared_data("mavlink/px4-1.17-offboard.tlog") else { return };
    let origin = Geodetic { lat_deg: 47.397_741_4, lon_deg: 8.545_596_2, alt_m: 489.8 };
    let config = Config { world_origin: origin, ekf_origin: origin, ..Config::default() };
    let (real, simulated) = replay(&recording(&path), &config, 1.0);
    assert_same_acks(&real, &simulated);
    assert_eq!(real.modes, simulated.modes);
    // Where exactly LANDING is told is the land detector's; the rest is the flight's.
    assert_eq!(
        (real.landed.first(), real.landed.last()),
        (simulated.landed.first(), simulated.landed.last())
    );
}
