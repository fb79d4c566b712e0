//! Frames that must change nothing; what is sent to the swarm; the memory of a companion.

extern crate std;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA};
use planner_core::Point;

use super::super::*;
use super::assert_no_gap;
use crate::autopilot::px4;
use crate::link::frame::Frame;
use crate::link::intent::Intent;
use crate::testing::fake_autopilot::*;

/// Frames that must change nothing in the middle of a flight.
fn nuisance(bench: &mut Bench, kind: u8, seed: u8) -> Vec<u8> {
    use crate::link::frame::{Header, MAX_FRAME_LEN, encode};
    let mode = bench.mode;
    bench.mode = px4::RTL;
    let mut wrong = bench.heartbeat();
    bench.mode = mode;
    let data = HEARTBEAT_DATA { custom_mode: px4::RTL, ..Default::default() };
    let foreign = |system, component| {
        let mut out = [0; MAX_FRAME_LEN];
        let len = encode(Header { system, component, sequence: seed }, &data, &mut out);
        out[..len].to_vec()
    };
    match kind {
        // The kinds: damaged, cut, repeated, from another component, from another system, noise.
        0 => {
            let at = usize::from(seed) % wrong.len();
            wrong[at] ^= 1 << (seed % 8);
        }
        // At least the CRC is cut: if one byte were, the next bytes could complete the frame.
        1 => wrong.truncate(usize::from(seed) % (wrong.len() - 2)),
        2 => {
            let now = bench.heartbeat();
            return [now.clone(), now].concat();
        }
        3 => return foreign(SYSTEM, seed | 2),
        4 => return foreign(SYSTEM.wrapping_add(seed | 1), 1),
        _ => return (0..seed).map(|i| i.wrapping_mul(seed) ^ 0xFD).collect(),
    }
    wrong
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]
    #[test]
    fn repeated_cut_foreign_and_damaged_frames_change_nothing(
        script in proptest::collection::vec((0u8..6, proptest::prelude::any::<u8>()), 1..30),
        radio in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300),
    ) {
        let mut bench = Bench::following(config());
        for (kind, seed) in script {
            let bytes = nuisance(&mut bench, kind, seed);
            bench.companion.handle_bytes(Link::Autopilot, bench.now, &bytes);
            bench.companion.handle_bytes(Link::Swarm, bench.now, &radio);
            bench.drain();
            proptest::prop_assert!(
                matches!(bench.state(), State::Follow | State::Land),
                "{kind} {seed}: {:?}",
                bench.texts
            );
            bench.run(0.1);
        }
        bench.run_until(State::Done, 60.0);
        proptest::prop_assert!((bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2);
        assert_no_gap(&bench);
    }
}

/// A frame of a hostile peer, of one of 14 kinds: commands, parameters, files, TIMESYNC, position,
/// intent.
fn forged(kind: u8, system: u8, seed: u8) -> Vec<u8> {
    use crate::link::frame::{Header, MAX_FRAME_LEN, encode};
    use mavlink::dialects::ardupilotmega::*;
    let header = Header { system, component: if seed & 1 == 0 { 190 } else { 1 }, sequence: seed };
    let target_system = if seed & 2 == 0 { SYSTEM } else { 0 };
    let mut out = [0; MAX_FRAME_LEN];
    let long = |command, param1: f32, param2: f32| COMMAND_LONG_DATA {
        command,
        param1,
        param2,
        target_system,
        target_component: crate::COMPANION_COMPONENT,
        ..Default::default()
    };
    let place = planner_core::geo::frames::enu_to_geodetic(&ORIGIN, &GOAL);
    let (lat, lon) = ((place.lat_deg * 1e7) as i32, (place.lon_deg * 1e7) as i32);
    let len = match kind % 14 {
        0 => encode(header, &long(MavCmd::MAV_CMD_MISSION_START, 0.0, 0.0), &mut out),
        1 => encode(header, &long(MavCmd::MAV_CMD_NAV_LAND, 0.0, 0.0), &mut out),
        2 => encode(header, &long(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0), &mut out),
        3 => encode(
            header,
            &long(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, f32::from(seed % 3), 0.0),
            &mut out,
        ),
        4 => encode(header, &long(MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0, 1.0), &mut out),
        5 => {
            let obstacle = COMMAND_INT_DATA {
                command: MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
                param1: 5.0,
                target_system,
                target_component: crate::COMPANION_COMPONENT,
                frame: MavFrame::MAV_FRAME_GLOBAL,
                x: lat,
                y: lon,
                z: place.alt_m as f32,
                ..Default::default()
            };
            encode(header, &obstacle, &mut out)
        }
        6 => {
            let set = PARAM_SET_DATA {
                param_value: 1.0,
                target_system: SYSTEM,
                target_component: crate::COMPANION_COMPONENT,
                param_id: "FLK_SPEED_MAX".into(),
                param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            };
            encode(header, &set, &mut out)
        }
        7 => encode(
            header,
            &PARAM_REQUEST_LIST_DATA {
                target_system: SYSTEM,
                target_component: crate::COMPANION_COMPONENT,
            },
            &mut out,
        ),
        8 => encode(header, &TIMESYNC_DATA { tc1: 0, ts1: i64::from(seed) + 1 }, &mut out),
        9 => encode(header, &long(MavCmd::MAV_CMD_REQUEST_MESSAGE, 148.0, 0.0), &mut out),
        10 => encode(header, &long(MavCmd::MAV_CMD_DO_SET_HOME, 0.0, 0.0), &mut out),
        11 => {
            let mut payload = [0; 251];
            (payload[0], payload[3]) = (seed, [3, 4, 6, 8][usize::from(seed % 4)]);
            let (target_system, target_component) = (SYSTEM, crate::COMPANION_COMPONENT);
            let file = FILE_TRANSFER_PROTOCOL_DATA {
                target_network: 0,
                target_system,
                target_component,
                payload,
            };
            encode(header, &file, &mut out)
        }
        12 => {
            // Far from every path: a position near one would make the safety filter stop the
            // vehicle.
            let data = GLOBAL_POSITION_INT_DATA {
                time_boot_ms: u32::from(seed) * 1000,
                lat: lat + 20_000,
                lon,
                alt: (place.alt_m * 1e3) as i32,
                ..Default::default()
            };
            encode(Header { component: crate::COMPANION_COMPONENT, ..header }, &data, &mut out)
        }
        _ => {
            let intent = Intent {
                system_id: system,
                flags: seed,
                mission_crc: 7,
                plan_crc: 5,
                progress_m: 1e6,
                gates_open_up_to_m: -1e6,
                heard_bits: u32::MAX,
                points: heapless::Vec::from_slice(&[GOAL]).unwrap(),
                ..Intent::default()
            };
            let mut payload = [0; 133];
            let len = intent.encode(&mut payload);
            crate::link::frame::encode_raw(
                Header { component: crate::COMPANION_COMPONENT, ..header },
                TUNNEL_DATA::ID,
                TUNNEL_DATA::EXTRA_CRC,
                &payload[..len],
                &mut out,
            )
        }
    };
    out[..len].to_vec()
}

/// System id of a hostile peer: one of the roster, an unknown one or the vehicle's own, but never
/// the ground station's.
fn hostile_id(seed: u8) -> u8 {
    match seed % 4 {
        0 => 77,
        1 => SYSTEM,
        _ => 1 + (u16::from(seed) * 251 % 254) as u8,
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]
    /// On the pad nothing starts, in flight nothing changes, and the ground station still gets its
    /// answers.
    #[test]
    fn hostile_radio_peers_command_nothing_and_starve_nothing(
        frames in proptest::collection::vec(proptest::prelude::any::<(u8, u8, u8, bool)>(), 1..400),
        flies in proptest::prelude::any::<bool>(),
    ) {
        use mavlink::dialects::ardupilotmega::*;
        let mut bench = Bench::started_with_neighbour(two_vehicles());
        if flies {
            bench.run_until(State::Follow, 20.0);
        } else {
            bench = Bench::new(two_vehicles());
            bench.neighbour = Some((
                Point::new(8.0, 20.0, 0.0),
                crate::link::intent::ON_PLAN | crate::link::intent::GROUNDED,
                0.0,
                5,
            ));
            bench.run_until(State::Ready, 6.0);
        }
        let mut flash = crate::testing::fake_flash::Flash::new(9);
        bench.companion.attach_store(crate::testing::fake_flash::started(&mut flash));
        let (state, parameters) = (bench.state(), bench.companion.services.parameters().to_bytes());
        let config = bench.companion.config.clone();
        bench.events.clear();
        for (i, (kind, seed, who, wired)) in frames.into_iter().enumerate() {
            let link = if wired { Link::Autopilot } else { Link::Swarm };
            // No forged positions on the autopilot's link, where telemetry is believed
            // (SECURITY.md).
            let kind = if wired && matches!(kind % 14, 12 | 13) { 8 } else { kind };
            bench.companion.handle_bytes(link, bench.now, &forged(kind, hostile_id(who), seed));
            if i % 8 == 0 {
                bench.tick();
            }
            let landed = matches!(bench.state(), State::Land | State::Disarm | State::Done);
            proptest::prop_assert!(
                bench.state() == state || (flies && landed),
                "{:?} {:?}",
                bench.state(),
                bench.texts
            );
        }
        proptest::prop_assert!(!bench.events.contains(&Event::RestartRequested));
        proptest::prop_assert_eq!(bench.companion.detours.obstacle_count(), 0);
        proptest::prop_assert!(
            bench.companion.services.parameters().to_bytes() == parameters
                && bench.companion.config == config
        );
        // The ground station gets all that it requests, within the time that its rate limits need.
        bench.swarm.clear();
        bench.acks.clear();
        let ask = |bench: &mut Bench, bytes: &[u8]| {
            bench.companion.handle_bytes(Link::Swarm, bench.now, bytes);
        };
        let list = PARAM_REQUEST_LIST_DATA {
            target_system: SYSTEM,
            target_component: crate::COMPANION_COMPONENT,
        };
        let mut out = [0; crate::link::frame::MAX_FRAME_LEN];
        let ground =
            |sequence| crate::link::frame::Header { system: 255, component: 190, sequence };
        let len = crate::link::frame::encode(ground(200), &list, &mut out);
        ask(&mut bench, &out[..len]);
        let len =
            crate::link::frame::encode(ground(201), &TIMESYNC_DATA { tc1: 0, ts1: 4711 }, &mut out);
        ask(&mut bench, &out[..len]);
        bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
        for i in 0..200u8 {
            for k in 0..4 {
                let bytes =
                    forged(7 + k % 4, hostile_id(i.wrapping_mul(7) | 2), i.wrapping_mul(4) + k);
                bench.companion.handle_bytes(Link::Swarm, bench.now, &bytes);
            }
            bench.tick();
        }
        let values = bench.swarm.iter().filter_map(Frame::decode::<PARAM_VALUE_DATA>).count();
        let time =
            bench.swarm.iter().filter_map(Frame::decode::<TIMESYNC_DATA>).any(|t| t.ts1 == 4711);
        proptest::prop_assert!(
            values >= crate::config::parameters::PARAMETER_COUNT && time,
            "{values} {time}"
        );
        proptest::prop_assert!(bench.acks.contains(&(512, 0, 255, 190)), "{:?}", bench.acks);
        if flies {
            bench.run_until(State::Done, 60.0);
            proptest::prop_assert!(
                (bench.enu - Point::new(GOAL.x, GOAL.y, 0.0)).norm() < 0.2,
                "{:?}",
                bench.enu
            );
        } else {
            bench.start();
            bench.run_until(State::Follow, 20.0);
        }
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]
    /// Vehicles that the roster does not name report positions anywhere, even at the goal, for any
    /// time. The vehicle still lands in the end; it lands at its goal if all of them are 0.4 m more
    /// than the safety distance beside the path, since a stopped vehicle needs that room to
    /// continue.
    #[test]
    fn strangers_deny_no_goal(
        places in proptest::collection::vec((5f32..19.0, 0f32..4.0, 0f32..5.0, 1u8..=255), 1..7),
        lasts_s in 5u32..120,
    ) {
        let mut bench = Bench::following(config());
        let beside = places.iter().all(|(_, off_m, _, _)| *off_m > 1.9);
        for tick in 0..240 * 20u32 {
            if tick % 4 == 0 && tick < lasts_s * 20 {
                for (i, (x, off_m, z, id)) in places.iter().enumerate() {
                    let place = Point::new(*x, 12.0 + off_m, *z);
                    let bytes = stranger(bench.now, *id, (tick as u8).wrapping_add(i as u8), place);
                    bench.companion.handle_bytes(Link::Swarm, bench.now, &bytes);
                }
            }
            bench.tick();
            if matches!(bench.state(), State::Done | State::Aborted) {
                break;
            }
        }
        proptest::prop_assert!(
            bench.state() == State::Done || (!beside && bench.state() == State::Aborted),
            "{:?} at {:?}: {:?}", bench.state(), bench.enu, bench.texts
        );
        proptest::prop_assert!(bench.on_ground());
    }
}

/// The position report of a vehicle that stands at `place`.
fn stranger(now: Instant, system: u8, sequence: u8, place: Point) -> Vec<u8> {
    let at = planner_core::geo::frames::enu_to_geodetic(&ORIGIN, &place);
    let data = GLOBAL_POSITION_INT_DATA {
        time_boot_ms: now.as_boot_ms(),
        lat: (at.lat_deg * 1e7) as i32,
        lon: (at.lon_deg * 1e7) as i32,
        alt: (at.alt_m * 1e3) as i32,
        ..Default::default()
    };
    let mut out = [0; crate::link::frame::MAX_FRAME_LEN];
    let header =
        crate::link::frame::Header { system, component: crate::COMPANION_COMPONENT, sequence };
    let len = crate::link::frame::encode(header, &data, &mut out);
    out[..len].to_vec()
}

#[test]
fn a_command_is_logged_with_its_sender_and_a_foreign_one_denied() {
    let mut bench = Bench::new(config());
    bench.run_until(State::Ready, 6.0);
    bench.companion.handle_bytes(Link::Swarm, bench.now, &forged(0, 9, 4));
    bench.drain();
    assert_eq!((bench.state(), bench.acks.pop()), (State::Ready, Some((300, 2, 9, 190))));
    assert!(
        bench.texts.iter().any(|t| t == "Command 300 denied, not a ground station: 9/190"),
        "{:?}",
        bench.texts
    );
    bench.start();
    assert_eq!((bench.state(), bench.acks.pop()), (State::Scheduled, Some((300, 0, 255, 190))));
    assert!(bench.texts.iter().any(|t| t == "Start from 255/190"), "{:?}", bench.texts);
    let mut other = config();
    other.ground_stations = [9, 245, 0, 0];
    let mut bench = Bench::new(other);
    bench.run_until(State::Ready, 6.0);
    bench.start();
    assert_eq!((bench.state(), bench.acks.pop()), (State::Ready, Some((300, 2, 255, 190))));
    bench.companion.handle_bytes(Link::Swarm, bench.now, &forged(0, 9, 4));
    assert_eq!(bench.state(), State::Scheduled);
}

#[test]
fn a_late_frame_does_not_bring_back_an_old_mode() {
    let mut bench = Bench::following(config());
    bench.mode = px4::HOLD;
    let late = bench.heartbeat();
    bench.mode = px4::OFFBOARD;
    bench.run(0.5);
    bench.companion.handle_bytes(Link::Autopilot, bench.now, &late);
    bench.run(0.5);
    assert_eq!(bench.state(), State::Follow);
}

#[test]
fn an_origin_that_moves_in_flight_lands_the_vehicle_where_it_is() {
    for (north_deg, east_deg, up_m) in
        [(0.0005, 0.0, 0.0), (0.002, 0.0, -30.0), (0.0, 0.000_004, 0.0), (0.0, 0.0, 0.4)]
    {
        let mut bench = Bench::following(config());
        let place = bench.enu;
        bench.origin.lat_deg += north_deg;
        bench.origin.lon_deg += east_deg;
        bench.origin.alt_m += up_m;
        // PX4 sends an origin that changes without a request.
        bench.send_origin();
        bench.run_until(State::Land, 3.0);
        assert!(bench.texts.iter().any(|t| t == "EKF origin moved: landing"), "{:?}", bench.texts);
        bench.run_until(State::Aborted, 60.0);
        assert!((bench.enu - place).xy().norm() < 3.0, "{:?} {place:?}", bench.enu);
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]
    /// GPS_GLOBAL_ORIGIN of the own system and component 1, sent by radio and forwarded by the
    /// autopilot to its other port.
    #[test]
    fn forged_origins_move_no_vehicle(
        forged in proptest::collection::vec(
            (0u8..=255, -30_000i32..30_000, -30_000i32..30_000, 0u8..12),
            1..40,
        ),
    ) {
        use mavlink::dialects::ardupilotmega::GPS_GLOBAL_ORIGIN_DATA;
        let mut bench = Bench::following(config());
        let (lat, lon) = ((bench.origin.lat_deg * 1e7) as i32, (bench.origin.lon_deg * 1e7) as i32);
        for (sequence, north, east, ticks) in forged {
            let data = GPS_GLOBAL_ORIGIN_DATA {
                latitude: lat + north,
                longitude: lon + east,
                altitude: 720_000,
            };
            let header = crate::link::frame::Header { system: SYSTEM, component: 1, sequence };
            let mut out = [0; crate::link::frame::MAX_FRAME_LEN];
            let len = crate::link::frame::encode(header, &data, &mut out);
            bench.companion.handle_bytes(Link::Autopilot, bench.now, &out[..len]);
            bench.drain();
            (0..ticks).for_each(|_| bench.tick());
        }
        bench.run_until(State::Done, 60.0);
        // The path runs along y = 12: setpoints and vehicle stay on it.
        let wide = |(_, at, mask): &&(Instant, Point, u16)| {
            *mask != px4::MASK_VELOCITY && (at.y - 12.0).abs() > 0.05
        };
        proptest::prop_assert_eq!(bench.setpoints.iter().filter(wide).count(), 0);
        proptest::prop_assert!((bench.enu.y - 12.0).abs() < 0.05, "{:?}", bench.enu);
    }
}

#[test]
fn a_neighbour_heard_again_lets_it_go_on() {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 20.0);
    let neighbour = bench.neighbour.take();
    bench.run_until(State::SwarmLinkLost, 5.0);
    bench.neighbour = neighbour;
    bench.run_until(State::Done, 60.0);
    assert!(bench.texts.iter().any(|t| t == "Neighbours heard again"));
}

#[test]
fn the_swarm_hears_where_it_is_and_where_it_goes() {
    let mut bench = Bench::following(config());
    bench.swarm.clear();
    bench.run(1.0);
    let places: Vec<_> = bench
        .swarm
        .iter()
        .filter_map(crate::link::frame::Frame::decode::<GLOBAL_POSITION_INT_DATA>)
        .collect();
    let intents: Vec<_> =
        bench.swarm.iter().filter_map(|f| Intent::decode(f.padded_payload(), SYSTEM)).collect();
    assert_eq!((places.len(), intents.len()), (5, 5));
    let last = &places[4];
    let place = planner_core::geo::frames::Geodetic {
        lat_deg: f64::from(last.lat) * 1e-7,
        lon_deg: f64::from(last.lon) * 1e-7,
        alt_m: f64::from(last.alt) * 1e-3,
    };
    let enu = planner_core::geo::frames::geodetic_to_enu(&ORIGIN, &place);
    assert!((enu - bench.enu).norm() < 0.45, "{enu:?} {:?}", bench.enu);
    let intent = &intents[4];
    assert_eq!((intent.mission_crc, intent.plan_crc), (0xC0FFEE, 5));
    assert_eq!(intent.flags, crate::link::intent::FLYING | crate::link::intent::ON_PLAN);
    assert!((intent.progress_m - (bench.enu.x - START.x)).abs() < 0.45, "{}", intent.progress_m);
    assert_eq!(intent.points.last(), Some(&GOAL));
}

/// The README states this size for a board, where pointers are shorter.
#[test]
fn a_companion_fits_its_memory() {
    let bytes = core::mem::size_of::<Companion<32, 64, 64>>();
    assert!(bytes <= 36 * 1024, "{bytes}");
}
