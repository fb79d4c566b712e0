//! The file of a coverage mission: values that were written are read back and can be planned, and
//! invalid ones are refused by name.

extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec as List;

use planner_core::Point;
use planner_core::flight::WaypointRange;
use planner_core::geo::frames::Geodetic;
use planner_core::map::field::{self, FieldShape, FieldView};
use planner_core::plan::{GoalMode, SwarmPlan, VehicleTask};
use planner_core::schedule::{ScheduleConfig, ScheduleWorkspace};
use planner_core::track::deconflict::Method;
use proptest::prelude::*;

use super::*;
use crate::planner::coverage::{self, Workspace};
use crate::storage::mission_file::{
    self, MissionBlock, MissionHeader, MissionKind, MissionVehicle, MissionView,
};
use crate::swarm::fleet::VehicleDivisionInput;

/// Bytes before the coverage block in a file of two vehicles.
const BEFORE: usize = mission_file::HEADER_LEN + 2 * mission_file::VEHICLE_LEN;

fn mission() -> MissionHeader {
    MissionHeader {
        roadmap_crc: 0,
        mode: GoalMode::Labelled,
        method: Method::Priority,
        origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
        cruise_mps: 5.0,
        schedule: ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.75,
            cruise_mps: 4.5,
            vertical_mps: 1.0,
        },
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: [255, 0, 0, 0],
    }
}

fn header() -> CoverageHeader {
    CoverageHeader {
        assignment_unit: TrackUnit::Waypoint,
        part_eligibility: PartEligibility::Anyone,
        heading_rule: HeadingRule::SameOnAllLanes,
        trigger: Trigger::Distance,
        search_steps: 2000,
        heights: Heights { max_picture_height_m: 25.0, layer_spacing_m: 5.0 },
        spacing: Spacing {
            footprint: Footprint { along_m: 20.0, across_m: 30.0 },
            max_lane_spacing_m: 12.0,
            max_waypoint_spacing_m: 8.0,
        },
        lane_angle_deg: None,
        border_overshoot_m: 0.0,
        ground: None,
    }
}

const RINGS: [Ring; 2] =
    [Ring { end: 4, kind: RingKind::Outer }, Ring { end: 7, kind: RingKind::NoFly }];

fn vertices() -> [Flat; 7] {
    [(0.0, 0.0), (90.0, 0.0), (100.0, 60.0), (0.0, 70.0), (40.0, 30.0), (50.0, 30.0), (45.0, 40.0)]
        .map(|(x, y)| Flat::new(x, y))
}

fn shares() -> [VehicleShare; 2] {
    [0.75, 1.0].map(|weight| VehicleShare { weight, climb_mps: 3.0, descend_mps: 1.0 })
}

fn file() -> List<u8> {
    let vehicle = |id: u8| MissionVehicle {
        task: VehicleTask { id, required_clearance_m: 1.5, climb_m: 3.0, goal: None },
        path_start: Point::new(5.0 * f32::from(id), -10.0, 3.3),
        radius_m: 0.3,
        speed_max_mps: 5.0,
    };
    let (shares, vertices) = (shares(), vertices());
    let parts =
        CoverageBlock { header: header(), shares: &shares, rings: &RINGS, vertices: &vertices };
    let block = MissionBlock::Coverage(parts);
    let mut out = vec![0xAA; block.file_len(2)];
    assert_eq!(
        mission_file::write_mission(&mission(), &[vehicle(1), vehicle(2)], &block, &mut out),
        Ok(out.len())
    );
    out
}

/// The file with its CRC corrected.
fn sealed(mut file: List<u8>) -> List<u8> {
    let end = file.len() - 4;
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&file[..end]);
    file[end..].copy_from_slice(&crc.to_le_bytes());
    file
}

fn forged(at: usize, bytes: &[u8]) -> List<u8> {
    let mut file = file();
    file[BEFORE + at..BEFORE + at + bytes.len()].copy_from_slice(bytes);
    sealed(file)
}

/// A file with this [`UnevenGround`]: least height above the ground, height of the band of paths
/// above that, lowest and highest ground, metres.
fn file_above_ground(ground: [f32; 4]) -> List<u8> {
    let bytes: List<u8> = ground.into_iter().flat_map(f32::to_le_bytes).collect();
    forged(44, &bytes)
}

type Memory = (Workspace<64, 128, 8>, ScheduleWorkspace, SwarmPlan<4, 64>);

fn planned(file: &[u8], memory: &mut Memory) -> Option<Result<(), coverage::Error>> {
    let view = MissionView::parse(file).ok()?;
    let MissionKind::Coverage(area) = view.kind() else { return None };
    let (ws, schedule, plan) = memory;
    let request = coverage::Request {
        mission: &view,
        view: area,
        max_gates: 128,
        field: None,
        photographed: &[],
    };
    Some(coverage::plan_flights::<64, 128, 8, 16, 4, 64>(
        &request,
        core::iter::empty(),
        ws,
        schedule,
        plan,
    ))
}

#[test]
fn comes_back_as_written_and_is_planned() {
    let file = file();
    let view = MissionView::parse(&file).unwrap();
    assert!(view.can_be_planned_with(None), "it is planned without a roadmap");
    let MissionKind::Coverage(area) = view.kind() else { panic!("a coverage mission") };
    assert_eq!(area.header(), &header());
    assert_eq!(area.shares().collect::<List<_>>(), shares());
    assert_eq!(area.rings().collect::<List<_>>(), RINGS);
    assert_eq!(area.vertices().collect::<List<_>>(), vertices());
    assert_eq!(view.byte_len(), file.len());
    let config = view.companion_config::<2>(2).unwrap();
    assert_eq!((config.check(), config.climb_mps, config.descend_mps), (Ok(()), 3.0, 1.0));
    let mut memory = Box::<Memory>::default();
    assert_eq!(planned(&file, &mut memory), Some(Ok(())));
    let (ws, _, plan) = &*memory;
    assert!(plan.flights.iter().all(|flight| flight.task.leaves_pad()));
    // Every waypoint of the lanes is photographed once.
    let pictures = plan.flights.iter().map(|flight| match &flight.task {
        planner_core::flight::Task::Photograph(photographs) => {
            photographs.planned_count(&flight.path)
        }
        _ => 0,
    });
    assert_eq!(pictures.sum::<u32>(), ws.tracks().waypoint_count());
}

/// The vertices form as many rings as possible.
#[test]
fn what_32_vehicles_photograph_within_256_vertices_fits_into_a_board() {
    let vehicles: List<MissionVehicle> = (1..=32)
        .map(|id| MissionVehicle {
            task: VehicleTask { id, required_clearance_m: 1.5, climb_m: 3.0, goal: None },
            path_start: Point::new(5.0 * f32::from(id), -10.0, 3.3),
            radius_m: 0.3,
            speed_max_mps: 5.0,
        })
        .collect();
    let shares = [shares()[0]; 32];
    let vertices: List<Flat> = (0..256).map(|i| Flat::new(i as f32, (i * i % 7) as f32)).collect();
    let kind = |i: u16| if i == 0 { RingKind::Outer } else { RingKind::NoFly };
    let rings: List<Ring> = (0..85)
        .map(|i| Ring { end: if i == 84 { 256 } else { 3 * i + 3 }, kind: kind(i) })
        .collect();
    let parts =
        CoverageBlock { header: header(), shares: &shares, rings: &rings, vertices: &vertices };
    let block = MissionBlock::Coverage(parts);
    let mut out = [0; 4096];
    let length = mission_file::write_mission(&mission(), &vehicles, &block, &mut out);
    assert_eq!(length, Ok(104 + 32 * 32 + 60 + 32 * 12 + 85 * 4 + 256 * 8 + 4));
    assert!(length.unwrap() <= mission_file::MAX_BYTES, "a board stores it");
    let view = MissionView::parse(&out).unwrap();
    let MissionKind::Coverage(area) = view.kind() else { panic!("a coverage mission") };
    assert_eq!((area.shares().len(), area.rings().len(), area.vertices().len()), (32, 85, 256));
    assert_eq!(area.vertices().last(), vertices.last().copied());
}

#[test]
fn above_uneven_ground_only_the_field_of_the_mission_is_planned_on() {
    // A ramp of 4 m over the area.
    let shape =
        FieldShape { south_west: Flat::new(-50.0, -50.0), cell_m: 50.0, columns: 5, rows: 4 };
    let nodes: List<i16> = (0..20).map(|i| 10 * (i % 5)).collect();
    let mut field = vec![0; shape.encoded_len()];
    field::write(&shape, &nodes, &mut field).unwrap();
    let field = FieldView::parse(&field).unwrap();
    let mut file = file_above_ground([18.0, 3.0, 0.0, 4.0]);
    let mut with = |crc: u32, field: Option<FieldView<'_>>| {
        file[16..20].copy_from_slice(&crc.to_le_bytes());
        let file = sealed(file.clone());
        let view = MissionView::parse(&file).unwrap();
        let MissionKind::Coverage(area) = view.kind() else { panic!("a coverage mission") };
        assert_eq!(view.companion_config::<2>(2).unwrap().ground, area.header().ground);
        let mut memory = Box::<Memory>::default();
        let (ws, schedule, plan) = &mut *memory;
        let request = coverage::Request {
            mission: &view,
            view: area,
            field,
            max_gates: 128,
            photographed: &[],
        };
        coverage::plan_flights::<64, 128, 8, 16, 4, 64>(
            &request,
            core::iter::empty(),
            ws,
            schedule,
            plan,
        )?;
        let points =
            plan.flights.iter().flat_map(|flight| flight.path.waypoints()).map(|w| w.position);
        // Points above the pads are lower, and not checked.
        Ok(points
            .filter(|p| p.z > 4.0)
            .map(|p| p.z - field.map_or(0.0, |f| f.height_at(&p.xy())))
            .collect())
    };
    assert_eq!(with(field.crc(), None), Err(coverage::Error::NoField));
    assert_eq!(with(field.crc() ^ 1, Some(field)), Err(coverage::Error::NoField));
    let above_m: List<f32> = with(field.crc(), Some(field)).unwrap();
    assert!(above_m.len() > 8 && above_m.iter().all(|m| *m >= 17.99), "{above_m:?}");
    assert!(above_m.iter().any(|m| *m < 21.1), "{above_m:?}");
}

#[test]
fn what_is_not_sound_is_refused_by_name() {
    let nan = f32::NAN.to_le_bytes();
    for (file, why) in [
        (forged(0, &[8]), FileError::Length.into()),
        (forged(2, &[3]), FileError::Length.into()),
        (forged(4, &[2]), FileError::Header("unit").into()),
        (forged(5, &[2]), FileError::Header("parts").into()),
        (forged(6, &[2]), FileError::Header("heading").into()),
        (forged(7, &[3]), FileError::Header("trigger").into()),
        (forged(8, &[0xFF; 4]), FileError::Header("search_steps").into()),
        (forged(12, &nan), FileError::Header("heights").into()),
        (forged(28, &31.0f32.to_le_bytes()), FileError::Header("spacing").into()),
        (forged(36, &f32::INFINITY.to_le_bytes()), FileError::Header("angle_deg").into()),
        (forged(40, &(-1.0f32).to_le_bytes()), FileError::Header("margin_m").into()),
        (forged(44, &nan), FileError::Header("ground").into()),
        (forged(48, &1.0f32.to_le_bytes()), FileError::Header("ground").into()),
        (file_above_ground([20.0, 3.0, 9.0, 4.0]), FileError::Header("ground").into()),
        (file_above_ground([20.0, 3.0, 1.0, 6.0]), FileError::Header("ground").into()),
        (file_above_ground([20.0, 0.0, 1.0, 4.0]), FileError::Header("ground").into()),
        (forged(60, &nan), MissionError::InvalidVehicle(0)),
        (forged(72 + 4, &0.0f32.to_le_bytes()), MissionError::InvalidVehicle(1)),
        (forged(84 + 2, &[3]), FileError::Header("rings").into()),
        (forged(92, &1e9f32.to_le_bytes()), FileError::Header("vertices").into()),
    ] {
        assert_eq!(MissionView::parse(&file).err(), Some(why));
    }
    let mut other = file();
    other[23] = 0xFF;
    assert_eq!(MissionView::parse(&sealed(other)).err(), Some(FileError::Header("kind").into()));
    let mut old = file();
    old[8] = 2;
    assert_eq!(
        MissionView::parse(&sealed(old)).err(),
        Some(FileError::Length.into()),
        "it had no kinds"
    );
}

proptest! {
    /// A file with random values and the right CRC is refused or planned, soon and without a panic.
    #[test]
    fn any_bytes_are_survived(
        patches in proptest::collection::vec((20usize..300, any::<u8>()), 0..8),
    ) {
        let mut bytes = file();
        let end = bytes.len() - 4;
        for (at, byte) in patches {
            bytes[at.min(end - 1)] = byte;
        }
        let mut memory = Box::<Memory>::default();
        if let Some(Ok(())) = planned(&sealed(bytes), &mut memory) {
            for flight in &memory.2.flights {
                prop_assert!(
                    flight
                        .path
                        .waypoints()
                        .iter()
                        .all(|w| w.position.iter().all(|c| c.is_finite()))
                );
            }
        }
    }
}

/// A change between two plans.
#[derive(Clone, Copy)]
enum Step {
    /// A further division.
    Further,
    /// Another division in place of the last one.
    Other,
    /// The last division is withdrawn.
    Withdrawn,
    /// A new start.
    Restarted,
    /// Another mission file.
    OtherFile,
}

/// A workspace that holds an earlier plan gives the plan that an empty one gives, whatever
/// divisions are added, withdrawn or changed, and whatever was planned in between.
#[test]
fn a_kept_workspace_plans_what_an_empty_one_plans() {
    use Step::*;
    let steps = [Further, Further, Further, Other, Withdrawn, Restarted, OtherFile];
    let files = [file(), forged(60, &0.5f32.to_le_bytes())];
    let mut random = rand_pcg::Pcg32::new(7, 9);
    let mut draw = |below: u32| rand_core::Rng::next_u32(&mut random) % below;
    let mut kept = Box::<Memory>::default();
    let (mut which, mut done) = (0, List::new());
    let mut losses: List<[VehicleDivisionInput; 2]> = List::new();
    let (mut plans, mut failures) = (0, 0);
    for _ in 0..400 {
        let input = |draw: &mut dyn FnMut(u32) -> u32| VehicleDivisionInput {
            alive: draw(4) > 0,
            along_dm: draw(3000) as u16,
        };
        let step = steps[draw(7) as usize];
        match step {
            Further if losses.len() < 5 => losses.push([input(&mut draw), input(&mut draw)]),
            Further => losses.truncate(1),
            Other => {
                losses.pop();
                losses.push([input(&mut draw), input(&mut draw)]);
            }
            Withdrawn => _ = losses.pop(),
            Restarted => {
                losses.clear();
                done = vec![WaypointRange { first: draw(9), end: 9 + draw(9) }];
            }
            OtherFile => which = 1 - which,
        }
        let plan = |memory: &mut Memory| {
            let view = MissionView::parse(&files[which]).unwrap();
            let MissionKind::Coverage(area) = view.kind() else { panic!("a coverage mission") };
            let request = coverage::Request {
                mission: &view,
                view: area,
                max_gates: 128,
                field: None,
                photographed: &done,
            };
            let (ws, schedule, plan) = memory;
            let losses = losses.iter().map(|inputs| &inputs[..]);
            coverage::plan_flights::<64, 128, 8, 16, 4, 64>(&request, losses, ws, schedule, plan)
        };
        let mut fresh = Box::<Memory>::default();
        let (outcome, expected) = (plan(&mut kept), plan(&mut fresh));
        assert_eq!(outcome, expected);
        failures += usize::from(outcome.is_err());
        if outcome.is_ok() {
            plans += 1;
            assert!(kept.2 == fresh.2);
            assert_eq!(kept.0.routes().routes, fresh.0.routes().routes);
        }
    }
    assert!(plans > 200 && failures > 0, "{plans} plans, {failures} failures");
}
