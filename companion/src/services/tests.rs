//! Files, parameters, time and a restart, by frames on either link.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::*;

use mavlink::MessageData;

use super::*;
use crate::config::parameters::TABLE;
use crate::events::Event;
use crate::link::frame::{self, Framer, Header};
use crate::state::State;
use crate::storage::store::MAX_READ_LEN;
use crate::testing::fake_autopilot::*;
use crate::testing::fake_flash::{Flash, execute, started};

/// A ground station, and a companion with a flash.
struct Ground {
    bench: Bench,
    flash: Flash,
    sequence: u8,
}

/// System id and component id of the ground station.
const GROUND: (u8, u8) = (255, 190);

impl Ground {
    fn new() -> Self {
        let mut flash = Flash::new(9);
        let mut bench = Bench::new(config());
        bench.companion.attach_store(started(&mut flash));
        Self { bench, flash, sequence: 0 }
    }

    /// Sends a message on a link. Returns the frames that come back on that link.
    fn ask<M: MessageData>(&mut self, link: Link, message: &M) -> Vec<Frame> {
        let header = Header { system: GROUND.0, component: GROUND.1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut bytes = [0; frame::MAX_FRAME_LEN];
        let length = frame::encode(header, message, &mut bytes);
        let now = self.bench.now;
        self.bench.companion.handle_bytes(link, now, &bytes[..length]);
        let mut read = [0; MAX_READ_LEN];
        let mut heard = Vec::new();
        let mut framer = Framer::new();
        loop {
            let mut idle = true;
            while let Some(request) = self.bench.companion.poll_flash() {
                let outcome =
                    execute(&mut self.flash, request, ErasePermission::Allowed, &mut read)
                        .expect("no power cut");
                self.bench.companion.handle_flash(now, outcome.map(|len| &read[..len]));
            }
            loop {
                let length = self.bench.companion.poll_transmit(link, &mut bytes);
                if length == 0 {
                    break;
                }
                idle = false;
                heard.extend(framer.next(now, &mut &bytes[..length]));
            }
            if idle {
                return heard;
            }
        }
    }
}

fn values(frames: &[Frame]) -> Vec<PARAM_VALUE_DATA> {
    frames.iter().filter_map(Frame::decode::<PARAM_VALUE_DATA>).collect()
}

fn errors(frames: &[Frame]) -> Vec<PARAM_ERROR_DATA> {
    frames.iter().filter_map(Frame::decode::<PARAM_ERROR_DATA>).collect()
}

#[test]
fn parameters_are_listed_read_set_and_kept() {
    for link in [Link::Autopilot, Link::Swarm] {
        let mut ground = Ground::new();
        let list = PARAM_REQUEST_LIST_DATA { target_system: SYSTEM, target_component: 0 };
        let listed = values(&ground.ask(link, &list));
        assert_eq!(listed.len(), TABLE.len());
        for (i, (reported, parameter)) in listed.iter().zip(TABLE).enumerate() {
            assert_eq!(
                (reported.param_index, reported.param_count),
                (i as u16, TABLE.len() as u16)
            );
            assert_eq!(
                (reported.param_id.to_str(), reported.param_value),
                (Ok(parameter.name), parameter.default)
            );
        }
        let read = |index: i16, name: &str| PARAM_REQUEST_READ_DATA {
            param_index: index,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            param_id: name.into(),
        };
        assert_eq!(
            values(&ground.ask(link, &read(2, "")))[0].param_id.to_str(),
            Ok("FLK_CLIMB_MAX")
        );
        assert_eq!(
            values(&ground.ask(link, &read(-1, "FLK_SYS_ID")))[0].param_index,
            TABLE.len() as u16 - 1
        );
        for unknown in [read(TABLE.len() as i16, ""), read(-1, "FLK_NONE"), read(i16::MIN, "")] {
            let heard = ground.ask(link, &unknown);
            assert_eq!(errors(&heard)[0].error, MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST);
            assert!(values(&heard).is_empty());
        }
        let set = |name: &str, value: f32| PARAM_SET_DATA {
            param_value: value,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        assert_eq!(values(&ground.ask(link, &set("FLK_ACCEL", 2.5)))[0].param_value, 2.5);
        let heard = ground.ask(link, &set("FLK_ACCEL", 99.0));
        assert_eq!(values(&heard)[0].param_value, 2.5, "what stands");
        assert_eq!(errors(&heard)[0].error, MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE);
        assert_eq!((errors(&heard)[0].target_system, errors(&heard)[0].target_component), GROUND);
        let integer = PARAM_SET_DATA {
            param_type: MavParamType::MAV_PARAM_TYPE_INT32,
            ..set("FLK_ACCEL", 1.0)
        };
        assert_eq!(
            errors(&ground.ask(link, &integer))[0].error,
            MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH
        );
        let other = PARAM_SET_DATA { target_system: SYSTEM + 1, ..set("FLK_ACCEL", 1.0) };
        assert!(ground.ask(link, &other).iter().all(|f| f.message_id != PARAM_VALUE_DATA::ID));
        assert_eq!(
            started(&mut ground.flash).parameters().get(0),
            Some(("FLK_ACCEL", 2.5)),
            "kept"
        );
    }
}

#[test]
fn a_restart_is_asked_of_the_shell_unless_armed() {
    let reboot = |param1, param2, target_component| COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        param1,
        param2,
        target_system: SYSTEM,
        target_component,
        ..COMMAND_LONG_DATA::default()
    };
    let result = |frames: &[Frame]| {
        frames.iter().find_map(Frame::decode::<COMMAND_ACK_DATA>).map(|ack| ack.result)
    };
    let restarts = |ground: &mut Ground| {
        core::iter::from_fn(|| ground.bench.companion.poll_event())
            .filter(|event| *event == Event::RestartRequested)
            .count()
    };
    let mut ground = Ground::new();
    for (message, wanted, asked) in [
        (reboot(1.0, 0.0, crate::COMPANION_COMPONENT), Some(MavResult::MAV_RESULT_ACCEPTED), 1),
        (reboot(0.0, 1.0, crate::COMPANION_COMPONENT), Some(MavResult::MAV_RESULT_ACCEPTED), 1),
        (reboot(0.0, 1.0, 0), Some(MavResult::MAV_RESULT_ACCEPTED), 1),
        (reboot(2.0, 0.0, crate::COMPANION_COMPONENT), Some(MavResult::MAV_RESULT_DENIED), 0),
        // With `param1` and all components as the target this command is for the autopilot.
        (reboot(1.0, 0.0, 0), None, 0),
    ] {
        let heard = ground.ask(Link::Autopilot, &message);
        assert_eq!((result(&heard), restarts(&mut ground)), (wanted, asked), "{message:?}");
    }
    let mut ground = Ground::new();
    ground.bench = Bench::following(config());
    let heard = ground.ask(Link::Swarm, &reboot(1.0, 0.0, crate::COMPANION_COMPONENT));
    assert_eq!(result(&heard), Some(MavResult::MAV_RESULT_TEMPORARILY_REJECTED));
    assert_eq!(restarts(&mut ground), 0);
}

#[test]
fn a_flying_companion_asks_for_no_erasure() {
    let mut ground = Ground::new();
    ground.bench = Bench::following(config());
    // A flash as delivered: all areas would have to be erased.
    let mut flash = Flash::new(1);
    ground
        .bench
        .companion
        .attach_store(Store::mount(crate::testing::fake_flash::LAYOUT, &mut flash));
    for _ in 0..100 {
        ground.bench.run(0.1);
        assert!(ground.bench.companion.poll_flash().is_none());
    }
}

#[test]
fn time_and_version_are_answered_on_either_link() {
    for link in [Link::Autopilot, Link::Swarm] {
        let mut ground = Ground::new();
        let heard = ground.ask(link, &TIMESYNC_DATA { tc1: 0, ts1: 42 });
        let answer = heard.iter().find_map(Frame::decode::<TIMESYNC_DATA>).expect("answered");
        assert_eq!((answer.tc1, answer.ts1), (ground.bench.now.as_micros() as i64 * 1000, 42));
        let frame = heard.iter().find(|f| f.message_id == TIMESYNC_DATA::ID).unwrap();
        assert_eq!(
            (frame.padded_payload()[16], frame.padded_payload()[17]),
            GROUND,
            "an autopilot does not forward its own"
        );
        assert!(
            ground
                .ask(link, &TIMESYNC_DATA { tc1: 5, ts1: 42 })
                .iter()
                .all(|f| f.message_id != 111)
        );
        let request = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
            param1: AUTOPILOT_VERSION_DATA::ID as f32,
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
            ..COMMAND_LONG_DATA::default()
        };
        let heard = ground.ask(link, &request);
        let version =
            heard.iter().find_map(Frame::decode::<AUTOPILOT_VERSION_DATA>).expect("reported");
        assert!(version.capabilities.contains(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP));
        assert!(version.flight_sw_version > 0);
    }
}

#[test]
fn a_flood_of_each_question_is_answered_at_its_rate() {
    for (link, sender, seconds) in
        [(Link::Swarm, 9, 60), (Link::Autopilot, SYSTEM, 60), (Link::Autopilot, 9, 60)]
    {
        let mut bench = Bench::new(config());
        bench.run_until(State::Ready, 6.0);
        let (mut counts, mut framer) = ([0u32; 3], Framer::new());
        let mut out = [0; frame::MAX_FRAME_LEN];
        for i in 0..seconds * 20u32 {
            for k in 0..30u32 {
                let header = Header { system: sender, component: 7, sequence: (i * 30 + k) as u8 };
                let length = match k % 3 {
                    0 => frame::encode(header, &TIMESYNC_DATA { tc1: 0, ts1: 9 }, &mut out),
                    1 => {
                        let list = PARAM_REQUEST_LIST_DATA {
                            target_system: SYSTEM,
                            target_component: 191,
                        };
                        frame::encode(header, &list, &mut out)
                    }
                    _ => {
                        let start = COMMAND_LONG_DATA {
                            command: MavCmd::MAV_CMD_MISSION_START,
                            target_system: SYSTEM,
                            target_component: 191,
                            ..Default::default()
                        };
                        frame::encode(header, &start, &mut out)
                    }
                };
                bench.companion.handle_bytes(link, bench.now, &out[..length]);
            }
            loop {
                let length = bench.companion.poll_transmit(link, &mut out);
                if length == 0 {
                    break;
                }
                let frame = framer.next(bench.now, &mut &out[..length]).expect("a frame");
                for (count, id) in counts.iter_mut().zip([
                    TIMESYNC_DATA::ID,
                    PARAM_VALUE_DATA::ID,
                    COMMAND_ACK_DATA::ID,
                ]) {
                    *count += u32::from(frame.message_id == id);
                }
            }
            bench.tick();
        }
        assert_eq!(bench.state(), State::Ready);
        let rates: [u32; 3] = if sender == SYSTEM { [2, 5, 5] } else { [1, 1, 1] };
        for (count, rate) in counts.into_iter().zip(rates) {
            assert!(count <= seconds * rate + 20, "{link:?} {sender}: {counts:?}");
            assert!(count >= seconds / 3, "{link:?} {sender}: {counts:?}");
        }
    }
}

#[test]
fn a_parameter_counts_at_once_on_the_ground_and_after_the_flight_in_the_air() {
    let set = |value, name: &str| PARAM_SET_DATA {
        param_value: value,
        target_system: SYSTEM,
        target_component: crate::COMPANION_COMPONENT,
        param_id: name.into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    };
    let speeds = |ground: &Ground| {
        let config = &ground.bench.companion.config;
        (config.cruise_mps, config.climb_mps, config.accel_mps2)
    };
    let mut ground = Ground::new();
    ground.bench.run_until(State::Ready, 6.0);
    let mission = speeds(&ground);
    ground.ask(Link::Autopilot, &set(0.5, "FLK_SPEED_MAX"));
    ground.ask(Link::Autopilot, &set(0.8, "FLK_ACCEL"));
    ground.bench.run(0.5);
    assert_eq!(speeds(&ground), (0.5, mission.1, 0.8));
    ground.bench.start();
    ground.bench.run_until(State::Follow, 20.0);
    ground.ask(Link::Autopilot, &set(1.0, "FLK_SPEED_MAX"));
    let begun = ground.bench.setpoints.len();
    ground.bench.run(4.0);
    let pairs = ground.bench.setpoints[begun..].windows(2);
    let fastest = pairs
        .map(|p| (p[1].1 - p[0].1).norm() / (p[1].0 - p[0].0).as_secs_f32())
        .fold(0.0, f32::max);
    assert!((0.4..0.55).contains(&fastest), "not while it flies: {fastest}");
    assert_eq!(speeds(&ground).0, 0.5);
    ground.bench.run_until(State::Done, 90.0);
    ground.bench.run(0.5);
    assert_eq!(speeds(&ground).0, 1.0);
    ground.ask(Link::Autopilot, &set(20.0, "FLK_SPEED_MAX"));
    ground.bench.run(0.5);
    assert_eq!(speeds(&ground).0, mission.0, "the mission's own, not more");
}
