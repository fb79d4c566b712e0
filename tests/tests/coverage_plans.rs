//! The plans that `cover` writes, flown without a companion: uploaded to both simulated autopilots,
//! in memory. Pictures are counted and placed by the truth.

use std::f32::consts::FRAC_PI_2;

use companion::link::frame::{self, Framer, Header};
use companion::time::Instant;
use host_sim::coverage::CoveragePlan;
use host_sim::coverage::check::{self, Picture};
use host_sim::coverage::export::{self, ExportedItem};
use host_sim::coverage::flight::{FlightPoint, WaypointAction};
use host_sim::scenario;
use host_sim::scenario::coverage::CoverageMethod;
use planner_core::Point;
use sim_autopilot::{Autopilot, AutopilotConfig, Photo, SimulatedKind};

/// Greatest horizontal distance at which a waypoint is passed, metres: 2 m, and the flight of one
/// step.
const PASSED_M: f32 = 2.2;
/// Greatest vertical distance, metres: 0.8 m, and the descent of one step to the first picture.
const PASSED_UP_M: f32 = 1.1;
const CRUISE_MPS: f32 = 5.0;
/// Flight between two checks of PX4's camera trigger, every 50 ms, metres.
const LATE_M: f32 = 0.05 * CRUISE_MPS;
/// Most by which the gap of two pictures by distance exceeds the planned one, metres: the check
/// comes up to one step of 4 ms later. There are no gusts or estimate errors here.
const GAP_M: f32 = LATE_M + 0.05;

fn scenario(autopilot: &str, trigger: &str) -> String {
    format!(
        "[area]\npolygon = [[0, 0], [70, 0], [70, 20], [40, 45], [0, 45]]\nheight_m = 20.0\nlane_m = 9.0\n\
         waypoint_m = 8.0\ntrigger = \"{trigger}\"\nno_fly = [[[20, 15], [30, 15], [30, 25], [20, 25]]]\n\
         [mission]\ncruise_mps = {CRUISE_MPS}\n[[vehicles]]\nid = 1\nstart = [-10, -10, 0.3]\n\
         personality = \"{autopilot}\"\n[[vehicles]]\nid = 2\nstart = [80, -10, 0.3]\n\
         personality = \"{autopilot}\"\n"
    )
}

/// One end of a link to an autopilot.
struct Client {
    autopilot: Autopilot,
    framer: Framer,
    acks: Vec<(u32, u8)>,
    reached: Vec<u16>,
    announced: usize,
}

impl Client {
    fn send(&mut self, id: u32, payload: &[u8]) {
        let header = Header { system: 255, component: 190, sequence: 0 };
        let mut out = [0; frame::MAX_FRAME_LEN];
        let seed = frame::extra_crc(id).expect("a known message");
        let len = frame::encode_raw(header, id, seed, payload, &mut out);
        self.autopilot.handle_bytes(&out[..len]);
    }

    fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds / 0.004) as usize {
            self.autopilot.step(0.004, 0.0);
            let mut buffer = [0; 1024];
            loop {
                let len = self.autopilot.poll_transmit(&mut buffer);
                if len == 0 {
                    break;
                }
                let now = Instant::from_micros(self.autopilot.time_us());
                let mut bytes = &buffer[..len];
                while let Some(frame) = self.framer.next(now, &mut bytes) {
                    let b = frame.padded_payload();
                    match frame.message_id {
                        46 => self.reached.push(u16::from_le_bytes([b[0], b[1]])),
                        47 => self.acks.push((47, b[2])),
                        77 => self.acks.push((u32::from(u16::from_le_bytes([b[0], b[1]])), b[2])),
                        180 | 263 => self.announced += 1,
                        _ => {}
                    }
                }
            }
        }
    }

    fn upload(&mut self, items: &[ExportedItem]) {
        let count = items.len() as u16;
        let [low, high] = count.to_le_bytes();
        self.send(44, &[low, high, 1, 1, 0]);
        for (k, item) in items.iter().enumerate() {
            let mut payload = [0; 37];
            for (at, param) in item.params_1_to_4.iter().enumerate() {
                let value = param.map_or(f32::NAN, |value| value as f32);
                payload[4 * at..4 * at + 4].copy_from_slice(&value.to_le_bytes());
            }
            let scale = if item.frame == 2 { 1.0 } else { 1e7 };
            for (at, value) in [(16, item.params_5_to_7[0]), (20, item.params_5_to_7[1])] {
                payload[at..at + 4]
                    .copy_from_slice(&((value * scale).round() as i32).to_le_bytes());
            }
            payload[24..28].copy_from_slice(&(item.params_5_to_7[2] as f32).to_le_bytes());
            payload[28..30].copy_from_slice(&(k as u16).to_le_bytes());
            payload[30..32].copy_from_slice(&item.command.to_le_bytes());
            payload[32..37].copy_from_slice(&[1, 1, item.frame, 0, 1]);
            self.send(73, &payload);
            self.run(0.01);
        }
        assert_eq!(self.acks.last(), Some(&(47, 0)), "the upload is accepted");
    }

    fn command(&mut self, id: u16, first: f32, second: f32) {
        let mut payload = [0; 33];
        payload[..4].copy_from_slice(&first.to_le_bytes());
        payload[4..8].copy_from_slice(&second.to_le_bytes());
        payload[28..30].copy_from_slice(&id.to_le_bytes());
        payload[30..32].copy_from_slice(&[1, 1]);
        self.send(76, &payload);
        self.run(0.1);
        assert_eq!(self.acks.last(), Some(&(u32::from(id), 0)), "command {id} is accepted");
    }
}

/// Flies one vehicle's plan and returns its pictures.
fn fly(
    planned: &CoveragePlan<'_>,
    points: &[FlightPoint],
    items: &[ExportedItem],
    autopilot: SimulatedKind,
) -> Vec<Photo> {
    let origin = planned.area_settings.origin;
    let start = points[0].position;
    let config = AutopilotConfig {
        autopilot,
        world_origin: origin,
        ekf_origin: origin,
        start,
        estimator_ready_s: 2.0,
        ..AutopilotConfig::default()
    };
    let mut client = Client {
        autopilot: Autopilot::new(&config).expect("a sound configuration"),
        framer: Framer::new(),
        acks: Vec::new(),
        reached: Vec::new(),
        announced: 0,
    };
    client.run(3.0);
    // The delay item is left out, as it serves the swarm; ArduPilot's item 0 is home.
    let mut items: Vec<ExportedItem> =
        items.iter().filter(|item| item.command != 93).cloned().collect();
    if autopilot == SimulatedKind::Ardupilot {
        items.insert(
            0,
            ExportedItem {
                command: 16,
                frame: 0,
                params_1_to_4: [Some(0.0); 4],
                params_5_to_7: [0.0; 3],
            },
        );
    }
    client.upload(&items);
    if autopilot == SimulatedKind::Ardupilot {
        client.command(176, 1.0, 4.0);
        client.command(400, 1.0, 0.0);
    }
    client.command(300, 0.0, 0.0);
    let mut seconds = 0;
    while client.autopilot.true_state().armed {
        client.run(1.0);
        seconds += 1;
        assert!(
            seconds < 600,
            "it flies for ever: {:?}, at item {:?}",
            client.autopilot.true_state(),
            client.reached
        );
    }
    client.run(0.1);
    let off =
        (client.autopilot.true_state().position - points[points.len() - 1].position).xy().norm();
    assert!(off < 1.0, "{autopilot:?} came home {off} m off");
    let all: Vec<u16> =
        (u16::from(autopilot == SimulatedKind::Ardupilot)..items.len() as u16).collect();
    assert_eq!(client.reached, all, "each item is reported once");
    let photos = client.autopilot.drain_photos();
    assert_eq!(client.announced, photos.len(), "each picture is announced");
    photos
}

fn off_by(photo: &Photo, place: &Point) -> (f32, f32) {
    let off = photo.position - place;
    (off.xy().norm(), off.z.abs())
}

/// Asserts for the trigger by distance that a lane's pictures are nowhere further apart than
/// planned, apart from the wait for the camera's check.
fn judge_gaps(photos: &[Photo], wanted: &[&FlightPoint], label: &str) {
    for lane in wanted.chunk_by(|a, b| a.lane == b.lane) {
        let [first, .., last] = lane else { continue };
        let (from, way) = (first.position.xy(), (last.position - first.position).xy());
        let step_m = (lane[1].position - first.position).xy().norm();
        // No neighbouring lane is so near.
        let beside = |at: &Point| ((at.xy() - from).perp(&way) / way.norm()).abs() < PASSED_M;
        let own = photos.iter().map(|photo| photo.position).filter(beside);
        let mut along: Vec<f32> = own.map(|at| (at.xy() - from).dot(&way) / way.norm()).collect();
        // The two lanes left of one that a zone divides lie in one line: only this lane's pictures
        // count.
        along.retain(|at| (-PASSED_M..way.norm() + PASSED_M).contains(at));
        along.sort_by(f32::total_cmp);
        assert!(
            along[0] < PASSED_M && along[along.len() - 1] > way.norm() - PASSED_M,
            "{label}: {along:?}"
        );
        let widest_m = along.windows(2).fold(0.0, |most: f32, pair| most.max(pair[1] - pair[0]));
        assert!(
            widest_m < step_m + GAP_M,
            "{label}: {widest_m} m without a picture, {step_m} m planned"
        );
    }
}

/// Flies the plans of a scenario, and judges their pictures.
fn judge(text: &str, autopilot: SimulatedKind, trigger: &str) {
    let scenario = scenario::parse(text, "plans").expect("a scenario");
    let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).expect("a plan");
    let flights = planned.flights();
    assert_eq!(flights.len(), 2);
    for (sortie, points, _) in &flights {
        let items = export::flight_items(&planned, sortie, points);
        let photos = fly(&planned, points, &items, autopilot);
        let wanted: Vec<&FlightPoint> =
            points.iter().filter(|s| matches!(s.action, WaypointAction::Photo(_))).collect();
        assert!(wanted.len() > 10);
        let lanes = 1 + wanted.windows(2).filter(|pair| pair[0].lane != pair[1].lane).count();
        let label = format!("{autopilot:?}, {trigger}: {} of {}", photos.len(), wanted.len());
        match trigger {
            "waypoint" => {
                assert_eq!(photos.len(), wanted.len(), "{label}");
                for (photo, point) in photos.iter().zip(&wanted) {
                    let (across, up) = off_by(photo, &point.position);
                    assert!(
                        across < PASSED_M && up < PASSED_UP_M,
                        "{label}: {across} m, {up} m off"
                    );
                }
            }
            "distance" => {
                // The last picture of a lane may come after its end, or one may be added.
                let counts = wanted.len() - lanes..=wanted.len() + lanes;
                assert!(counts.contains(&photos.len()), "{label}, {lanes} lanes");
                judge_gaps(&photos, &wanted, &label);
                // Both ends of a lane are photographed as they are passed; each picture between is
                // late by the checks before it.
                for (k, point) in wanted.iter().enumerate() {
                    let before =
                        wanted[..k].iter().rev().take_while(|s| s.lane == point.lane).count();
                    let near = |photo: &Photo| {
                        let (across, up) = off_by(photo, &point.position);
                        across < PASSED_M + LATE_M * before as f32 && up < PASSED_UP_M
                    };
                    assert!(photos.iter().any(near), "{label}: none at {}", point.position);
                }
            }
            _ => assert_eq!(photos.len(), 0, "{label}"),
        }
        if autopilot == SimulatedKind::Px4 && trigger == "waypoint" {
            // With the heading of the sweep all pictures look the same way, within the error for
            // which PX4 waits.
            let turned =
                photos.iter().map(|photo| (photo.heading_rad - photos[0].heading_rad).abs());
            assert!(turned.fold(0.0, f32::max) < 0.43, "{label}");
        }
    }
}

const ALL: [(&str, SimulatedKind); 2] =
    [("px4", SimulatedKind::Px4), ("ardupilot", SimulatedKind::Ardupilot)];

#[test]
fn each_plan_is_flown_and_photographs_what_was_planned() {
    for (name, autopilot) in ALL {
        for trigger in ["waypoint", "distance", "none"] {
            judge(&scenario(name, trigger), autopilot, trigger);
        }
    }
}

/// Along lanes that rise and fall pictures are as far apart, and as near to where they were
/// planned, as over level ground.
#[test]
fn plans_above_terrain_are_flown_as_planned() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("hill.asc");
    // A ridge across the middle of the area, 10 m high, and a slope along it.
    let height = |x: f64, y: f64| 400.0 + 10.0 * (-((x - 35.0) / 15.0).powi(2)).exp() + 0.05 * y;
    let mut text = "ncols 100\nnrows 100\nxllcorner -80\nyllcorner -80\ncellsize 2\n".to_owned();
    for row in (0..100).rev() {
        let at = |k: i32| f64::from(k) * 2.0 - 79.0;
        let row: Vec<String> =
            (0..100).map(|column| format!("{:.2}", height(at(column), at(row)))).collect();
        text += &(row.join(" ") + "\n");
    }
    std::fs::write(&file, text).expect("a file");
    // The ground of a simulated autopilot is level: both pads are at its height.
    let origin = "origin = { lat_deg = 47.0, lon_deg = 8.0, alt_m = 399.55 }";
    let file = file.display();
    let terrain = format!("{origin}\nterrain = \"{file}\"\nterrain_tolerance_m = 1.0\nheight_m");
    for (name, autopilot) in ALL {
        for trigger in ["waypoint", "distance", "none"] {
            let text = scenario(name, trigger).replace("height_m", &terrain);
            judge(&text, autopilot, trigger);
            let found = scenario::parse(&text, "plans").expect("a scenario");
            let planned = CoveragePlan::new(&found, CoverageMethod::Binpat).expect("a plan");
            let flights = planned.flights();
            let heights = flights
                .iter()
                .flat_map(|(_, points, _)| points)
                .filter(|point| point.lane.is_some());
            let heights: Vec<f32> = heights.map(|point| point.position.z).collect();
            let lowest_m = heights.iter().copied().fold(f32::INFINITY, f32::min);
            let rise_m = heights.iter().fold(0.0, |most: f32, z| most.max(z - lowest_m));
            assert!(rise_m > 5.0, "its lanes rise over the ridge: {rise_m}");
        }
    }
}

/// With the overlaps that a scenario has by default, autopilots alone leave nothing out: they pass
/// the ends of lanes within 2 m, and ArduPilot turns while it flies on.
#[test]
fn plans_flown_without_a_companion_photograph_the_whole_area() {
    for (name, autopilot) in ALL {
        for trigger in ["waypoint", "distance"] {
            let camera = "camera = { fov_deg = 73.7, aspect = 1.5 }";
            let text = scenario(name, trigger).replace("lane_m = 9.0\nwaypoint_m = 8.0", camera);
            assert!(text.contains(camera));
            let scenario = scenario::parse(&text, "plans").expect("a scenario");
            let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).expect("a plan");
            let mut pictures = Vec::new();
            for (sortie, points, _) in &planned.flights() {
                let items = export::flight_items(&planned, sortie, points);
                pictures.extend(fly(&planned, points, &items, autopilot).iter().map(|photo| {
                    Picture {
                        vehicle: None,
                        t_s: photo.time_us as f32 * 1e-6,
                        position: photo.position,
                        yaw_enu_rad: FRAC_PI_2 - photo.heading_rad,
                    }
                }));
            }
            let found = check::check_pictures(&planned, pictures);
            assert_eq!(
                (found.covered_share, found.first_missing_cell_centre),
                (1.0, None),
                "{autopilot:?}, {trigger}"
            );
        }
    }
}
