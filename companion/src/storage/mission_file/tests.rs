//! The mission file: values that were written are read back, and invalid ones are refused by name.

extern crate std;
use std::vec;
use std::vec::Vec as List;

use planner_core::roadmap::{self, RoadmapHeader};
use proptest::prelude::*;

use super::*;

fn header() -> MissionHeader {
    MissionHeader {
        roadmap_crc: 0x1234_5678,
        mode: GoalMode::Unlabelled(Objective::Makespan),
        method: Method::Priority,
        origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
        cruise_mps: 2.0,
        schedule: ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.75,
            cruise_mps: 1.8,
            vertical_mps: 1.0,
        },
        safety_distance_m: 1.5,
        geofence: Some((Point::new(-5.0, -5.0, 0.0), Point::new(50.0, 30.0, 60.0))),
        ground_stations: [255, 0, 245, 9],
    }
}

fn vehicle(id: u8, goal: Option<u16>) -> MissionVehicle {
    MissionVehicle {
        task: VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.2, goal },
        path_start: Point::new(0.1 * f32::from(id), 3.0, 1.5),
        radius_m: 0.3,
        speed_max_mps: 1.5,
    }
}

fn goal(i: usize) -> MissionGoal {
    MissionGoal { position: Point::new(28.0, i as f32, 1.8), descent_m: 1.5 }
}

fn file() -> List<u8> {
    let vehicles = [vehicle(7, None), vehicle(2, Some(1)), vehicle(250, Some(0))];
    let goals = [goal(0), goal(1)];
    let mut out = vec![0xAA; encoded_len(3, 2)];
    assert_eq!(
        write_mission(&header(), &vehicles, &MissionBlock::Goals(&goals), &mut out),
        Ok(out.len())
    );
    out
}

#[test]
fn all_vehicles_know_the_slowest_and_the_fastest_of_the_mission() {
    for (cruise_mps, expected) in [(4.0, (0.4, 4.0)), (0.3, (0.3, 0.3)), (20.0, (0.4, 9.0))] {
        let speeds = [(7, 1.5), (2, 0.4), (250, 9.0)];
        let vehicles =
            speeds.map(|(id, speed_max_mps)| MissionVehicle { speed_max_mps, ..vehicle(id, None) });
        let mut out = vec![0; encoded_len(3, 2)];
        let block = MissionBlock::Goals(&[goal(0), goal(1)]);
        let header = MissionHeader { cruise_mps, ..header() };
        assert_eq!(write_mission(&header, &vehicles, &block, &mut out), Ok(out.len()));
        let view = MissionView::parse(&out).unwrap();
        for (id, speed_max_mps) in speeds {
            let config = view.companion_config::<3>(id).unwrap();
            assert_eq!(config.cruise_mps, speed_max_mps.min(cruise_mps));
            assert_eq!((config.slowest_vehicle_mps, config.fastest_vehicle_mps), expected, "{id}");
        }
    }
}

/// A file with changed bytes and a corrected CRC.
fn forged(at: usize, bytes: &[u8]) -> List<u8> {
    let mut file = file();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    let end = file.len() - 4;
    let crc = CRC32.checksum(&file[..end]);
    file[end..].copy_from_slice(&crc.to_le_bytes());
    file
}

#[test]
fn comes_back_as_written() {
    let file = file();
    assert_eq!(file.len(), 104 + 3 * 32 + 2 * 16 + 4);
    let view = MissionView::parse(&file).unwrap();
    assert_eq!(view.header(), &header());
    assert_eq!(view.vehicles().nth(1), Some(vehicle(2, Some(1))));
    assert_eq!(view.goals().nth(1), Some(goal(1)));
    let (mut tasks, mut descents) = (Vec::<_, 3>::new(), Vec::new());
    let request = view.plan_request(&mut tasks, &mut descents, 128).unwrap();
    assert_eq!(
        (request.vehicles.len(), request.goal_descents_m, request.mode),
        (3, &[1.5, 1.5][..], header().mode)
    );
    let whole = [file.as_slice(), &[0xFF; 40]].concat();
    assert_eq!(MissionView::parse(&whole).unwrap().crc(), view.crc(), "as it lies in flash");
}

/// A roadmap with these numbers of starts and goals, without edges.
fn roadmap(starts: u16, goals: u16) -> List<u8> {
    let header = RoadmapHeader {
        origin: header().origin,
        edge_min_m: 0.5,
        edge_max_m: 5.0,
        tested_clearance_m: 0.5,
        max_clearance_m: 10.0,
        start_count: starts,
        goal_count: goals,
    };
    let nodes: List<_> = (0..starts + goals).map(|i| Point::new(f32::from(i), 0.0, 1.5)).collect();
    let mut out = vec![0; roadmap::encoded_len(nodes.len(), 0, 0).unwrap()];
    roadmap::write(&header, &nodes, &[], &mut out).unwrap();
    out
}

#[test]
fn goals_are_flown_to_on_the_roadmap_they_are_made_for() {
    for (starts, goals, same_crc, fits) in
        [(3, 2, true, true), (3, 2, false, false), (2, 2, true, false), (3, 1, true, false)]
    {
        let bytes = roadmap(starts, goals);
        let roadmap = RoadmapView::parse(&bytes).unwrap();
        let crc = roadmap.crc() ^ u32::from(!same_crc);
        let file = forged(16, &crc.to_le_bytes());
        let view = MissionView::parse(&file).unwrap();
        assert_eq!(view.can_be_planned_with(Some(&roadmap)), fits, "{starts} {goals} {same_crc}");
        assert!(!view.can_be_planned_with(None));
    }
}

#[test]
fn a_companion_is_configured_from_it() {
    let file = file();
    let view = MissionView::parse(&file).unwrap();
    let config = view.companion_config::<3>(2).unwrap();
    assert_eq!(config.check(), Ok(()));
    let ids: List<u8> = config.roster.iter().map(|e| e.system_id).collect();
    assert_eq!((ids, config.mission_crc), (vec![2, 7, 250], view.crc()));
    assert_eq!((config.cruise_mps, config.geofence), (1.5, header().geofence));
    assert_eq!(config.ground_stations, [255, 0, 245, 9]);
    assert_eq!(view.companion_config::<3>(9), Err(MissionError::NotInRoster(9)));
    assert_eq!(view.companion_config::<2>(2), Err(MissionError::TooManyVehiclesOrGoals));
    assert!(view.plan_request(&mut Vec::<_, 2>::new(), &mut Vec::new(), 128).is_err());
}

#[test]
fn what_is_not_sound_is_refused_by_name() {
    let nan = f32::NAN.to_le_bytes();
    let vehicle_at = |i: usize, byte: usize| HEADER_LEN + i * VEHICLE_LEN + byte;
    for (file, why) in [
        (forged(0, b"X"), FileError::Magic.into()),
        (forged(8, &[9]), FileError::Version(9).into()),
        (forged(10, &[103]), FileError::Length.into()),
        (forged(24, &[4]), FileError::Length.into()),
        (forged(24, &[0xFF; 4]), FileError::Length.into()),
        (forged(20, &[3]), FileError::Header("mode").into()),
        (forged(21, &[3]), FileError::Header("method").into()),
        (forged(22, &[2]), FileError::Header("flags").into()),
        (forged(28, &[0; 4]), FileError::Header("ground_stations").into()),
        (forged(29, &[2]), FileError::Header("ground_stations").into()),
        (forged(32, &f64::NAN.to_le_bytes()), FileError::Header("origin").into()),
        (forged(56, &nan), FileError::Header("cruise_mps").into()),
        (forged(60, &(-1.0f32).to_le_bytes()), FileError::Header("vertical_mps").into()),
        (forged(64, &0.0f32.to_le_bytes()), FileError::Header("safety_distance_m").into()),
        (forged(68, &f32::INFINITY.to_le_bytes()), FileError::Header("separation_m").into()),
        (forged(72, &nan), FileError::Header("parked_separation_m").into()),
        (forged(100, &nan), FileError::Header("schedule_mps").into()),
        (forged(76, &99.0f32.to_le_bytes()), FileError::Header("geofence").into()),
        (forged(vehicle_at(1, 0), &[7]), MissionError::InvalidVehicle(1)),
        (forged(vehicle_at(0, 0), &[0]), MissionError::InvalidVehicle(0)),
        (forged(vehicle_at(2, 2), &[2, 0]), MissionError::InvalidVehicle(2)),
        (forged(vehicle_at(2, 4), &nan), MissionError::InvalidVehicle(2)),
        (forged(vehicle_at(0, 24), &(-0.1f32).to_le_bytes()), MissionError::InvalidVehicle(0)),
        (forged(HEADER_LEN + 3 * VEHICLE_LEN + 12, &nan), MissionError::InvalidGoal(0)),
        (forged(vehicle_at(2, 4), &(-5.1f32).to_le_bytes()), MissionError::StartOutside(250)),
        (
            forged(HEADER_LEN + 3 * VEHICLE_LEN + GOAL_LEN + 8, &60.5f32.to_le_bytes()),
            MissionError::GoalOutside(1),
        ),
    ] {
        assert_eq!(MissionView::parse(&file).err(), Some(why));
    }
    let mut small = [0; 100];
    let needed = encoded_len(1, 0);
    let one = [vehicle(1, None)];
    assert_eq!(
        write_mission(&header(), &one, &MissionBlock::Goals(&[]), &mut small),
        Err(MissionError::BufferTooSmall { needed })
    );
    assert_eq!(
        write_mission(&header(), &[vehicle(1, Some(0))], &MissionBlock::Goals(&[]), &mut [0; 200]),
        Err(MissionError::InvalidVehicle(0))
    );
}

#[test]
fn labelled_no_two_vehicles_have_one_goal() {
    let goals = [goal(0), goal(1)];
    let written = |mode: GoalMode, goal: Option<u16>| {
        let vehicles = [vehicle(7, goal), vehicle(2, Some(1)), vehicle(250, goal)];
        write_mission(
            &MissionHeader { mode, ..header() },
            &vehicles,
            &MissionBlock::Goals(&goals),
            &mut [0; 300],
        )
        .map(|_| ())
    };
    assert_eq!(written(GoalMode::Labelled, Some(0)), Err(MissionError::SameGoal(250)));
    assert_eq!(written(GoalMode::Labelled, Some(1)), Err(MissionError::SameGoal(2)));
    assert_eq!(written(GoalMode::Labelled, None), Ok(()));
    assert_eq!(written(GoalMode::Unlabelled(Objective::TotalDistance), Some(0)), Ok(()));
}

#[test]
fn a_text_has_room_for_why_a_mission_is_refused() {
    use std::string::ToString;
    for error in [
        FileError::Version(u16::MAX).into(),
        FileError::Length.into(),
        FileError::Header("parked_separation_m").into(),
        FileError::Crc.into(),
        MissionError::InvalidVehicle(u16::MAX),
        MissionError::SameGoal(255),
        MissionError::StartOutside(255),
        MissionError::GoalOutside(u16::MAX),
        MissionError::BufferTooSmall { needed: usize::MAX },
        MissionError::TooManyVehiclesOrGoals,
    ] {
        assert!(error.to_string().len() <= 41, "{error}");
    }
}

/// The mission of [`file`] in the layout of version 1 or 2, byte by byte, independent of the code
/// that writes files.
fn old_file(version: u8) -> List<u8> {
    let f32s = |numbers: &[f32]| -> List<u8> {
        numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
    };
    let mut out = b"FLKMISS\n".to_vec();
    out.extend([version, 0, 104, 0, 236, 0, 0, 0, 0x78, 0x56, 0x34, 0x12]);
    // Least makespan, priority, a geofence; three vehicles, two goals.
    out.extend([2, 2, 1, 0, 3, 0, 2, 0]);
    // Ground stations; reserved bytes in version 1.
    out.extend(if version == 1 { [0; 4] } else { [255, 0, 245, 9] });
    out.extend([40.3327f64, -3.7659, 700.0].iter().flat_map(|number| number.to_le_bytes()));
    out.extend(f32s(&[2.0, 1.0, 1.5, 2.0, 1.75, -5.0, -5.0, 0.0, 50.0, 30.0, 60.0, 1.8]));
    for (id, goal, east_m) in [(7, [0xFF, 0xFF], 0.1 * 7.0), (2, [1, 0], 0.2), (250, [0, 0], 25.0)]
    {
        out.extend([id, 0, goal[0], goal[1]]);
        out.extend(f32s(&[east_m, 3.0, 1.5, 0.3, 0.8, 1.2, 1.5]));
    }
    out.extend(f32s(&[28.0, 0.0, 1.8, 1.5, 28.0, 1.0, 1.8, 1.5]));
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&out);
    out.extend(crc.to_le_bytes());
    out
}

#[test]
fn files_of_versions_1_and_2_are_read_with_their_values() {
    for (version, ground_stations) in [(1, [255, 0, 0, 0]), (2, [255, 0, 245, 9])] {
        let old = old_file(version);
        let view = MissionView::parse(&old).unwrap();
        assert_eq!(view.header(), &MissionHeader { ground_stations, ..header() }, "{version}");
        let vehicles: List<_> = view.vehicles().collect();
        let today = [vehicle(7, None), vehicle(2, Some(1)), vehicle(250, Some(0))];
        assert_eq!((vehicles, view.byte_len()), (today.to_vec(), old.len()));
        assert_eq!(view.goals().collect::<List<_>>(), [goal(0), goal(1)]);
        assert!(matches!(view.kind(), MissionKind::Goals));
        let config = view.companion_config::<3>(2).unwrap();
        assert_eq!((config.check(), config.ground_stations), (Ok(()), ground_stations));
        assert_eq!((config.mission_crc, config.geofence), (view.crc(), header().geofence));
    }
    // The bytes reserved in version 1 are ignored.
    let reserved = forged(8, &[1]);
    let config = MissionView::parse(&reserved).unwrap().companion_config::<3>(2).unwrap();
    assert_eq!(config.ground_stations, [255, 0, 0, 0]);
}

#[test]
fn no_cut_and_no_changed_bit_passes() {
    let file = file();
    for length in 0..file.len() {
        assert!(MissionView::parse(&file[..length]).is_err(), "cut at {length}");
    }
    for bit in 0..8 * file.len() {
        let mut damaged = file.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(MissionView::parse(&damaged).is_err(), "bit {bit}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_survived(
        patches in proptest::collection::vec((8usize..232, any::<u8>()), 0..6),
    ) {
        let mut bytes = file();
        for (at, byte) in patches {
            bytes[at] = byte;
        }
        let end = bytes.len() - 4;
        let crc = CRC32.checksum(&bytes[..end]);
        bytes[end..].copy_from_slice(&crc.to_le_bytes());
        if let Ok(view) = MissionView::parse(&bytes) {
            for vehicle in view.vehicles() {
                let config = view.companion_config::<8>(vehicle.task.id).unwrap();
                prop_assert_eq!(config.check(), Ok(()));
            }
        }
    }
}
