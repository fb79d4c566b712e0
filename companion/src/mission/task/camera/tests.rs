//! No gap between two pictures is too wide, whatever frames are lost and however the flight is
//! interrupted.

extern crate std;

use std::vec::Vec;

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, STATUSTEXT_DATA};
use planner_core::Point;
use planner_core::flight::WaypointRange;
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::link::frame::{Frame, Framer};

/// Time of a step, seconds.
const STEP_S: f32 = 0.05;
/// Speed of the vehicle, m/s.
const MPS: f32 = 5.0;
/// Distance flown from a picture's place until a step finds it passed and the command has arrived,
/// metres.
const LATE_M: f32 = 3.0 * STEP_S * MPS;
/// As [`LATE_M`], where every try of the command but the last is lost.
const LOST_M: f32 = LATE_M + MPS * 0.3 * (MAX_TRIES as f32 - 1.0);

fn path() -> Path<16> {
    let mut path = Path::new();
    for (x, y) in
        [(0.0, 0.0), (10.0, 0.0), (70.0, 0.0), (70.0, 9.0), (10.0, 9.0), (10.0, 18.0), (0.0, 18.0)]
    {
        path.push(Point::new(x, y, 30.0), 1.0).unwrap();
    }
    path
}

fn photographs(trigger: Trigger) -> PicturePlan {
    let mut photographs = PicturePlan::new(8.0, HeadingMode::Ahead, trigger);
    photographs.add_stretch(1, 2, WaypointRange { first: 0, end: 9 }).unwrap();
    photographs.add_stretch(3, 4, WaypointRange { first: 0, end: 9 }).unwrap();
    photographs.add_stretch(5, 5, WaypointRange { first: 0, end: 1 }).unwrap();
    photographs
}

/// An autopilot with a camera, on a path.
#[derive(Default)]
struct Fake {
    /// Distance between two pictures of the trigger by distance, metres; 0: it is off.
    step_m: f32,
    /// Place along the path of the last picture, or where the trigger was last set, metres.
    last_m: f32,
    /// Places along the path of the pictures taken, metres.
    pictures_m: Vec<f32>,
}

impl Fake {
    fn take(&mut self, at_m: f32) {
        self.pictures_m.push(at_m);
        self.last_m = at_m;
    }

    fn command(&mut self, command: &COMMAND_LONG_DATA, at_m: f32) {
        let number = command.command as u32 as u16;
        if number == DO_SET_CAM_TRIGG_DIST {
            (self.step_m, self.last_m) = (command.param1, at_m);
        }
        let at_once = command.param3 == 1.0;
        if (number == DO_SET_CAM_TRIGG_DIST && at_once)
            || (number == DO_DIGICAM_CONTROL && command.param5 == 1.0)
        {
            self.take(at_m);
        }
    }

    fn fly(&mut self, at_m: f32) {
        if self.step_m > 0.0 && (at_m - self.last_m).abs() >= self.step_m {
            self.take(at_m);
        }
    }
}

/// The frames sent to the autopilot since the last call.
fn sent_frames(links: &mut Links, framer: &mut Framer, now: Instant) -> Vec<Frame> {
    let mut out = [0; 512];
    let length = links.write_queued(Link::Autopilot, 1, &mut out);
    let mut bytes = &out[..length];
    core::iter::from_fn(|| framer.next(now, &mut bytes)).collect()
}

/// Delivers all frames to the autopilot, which is at `at_m` and accepts all commands.
fn deliver(
    camera: &mut CameraControl,
    fake: &mut Fake,
    links: &mut Links,
    framer: &mut Framer,
    now: Instant,
    at_m: f32,
) {
    for frame in sent_frames(links, framer, now) {
        let Some(command) = frame.decode::<COMMAND_LONG_DATA>() else { continue };
        fake.command(&command, at_m);
        let command = command.command as u32 as u16;
        camera.handle_ack(&Ack { command, result: ACCEPTED, to: (1, 191) }, links);
    }
}

/// Flies the path. `loss`: share of the messages that are lost; `stops`: chance of a pause in each
/// step. Returns where pictures were taken, metres along it, and whether the trigger was left on.
fn fly(photographs: &PicturePlan, loss: f64, stops: f64, seed: u64) -> (Vec<f32>, bool) {
    let path = path();
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut chance = |share: f64| f64::from(rng.next_u32()) < share * f64::from(u32::MAX);
    let (mut camera, mut links, mut fake) =
        (CameraControl::default(), Links::default(), Fake::default());
    let mut timers = Timers::default();
    let (mut framer, mut now, mut at_m, mut held) = (Framer::default(), Instant::ZERO, 0.0, 0);
    // At least one try of each command arrives; otherwise the command would be given up and
    // reported.
    let (mut settle, mut lost) = (0, 0);
    while settle < 60 {
        now = now + Duration::from_millis(50);
        // A pause holds the vehicle where it is.
        if stops > 0.0 && held == 0 && chance(stops) {
            held = 40;
        }
        held = if held > 0 { held - 1 } else { 0 };
        if held == 0 {
            at_m += MPS * STEP_S;
        }
        settle += i32::from(at_m > path.length_m());
        let along = PathProgress {
            progress_m: at_m.min(path.length_m()),
            reference_m: at_m.min(path.length_m()),
            relation: if held == 0 { PathRelation::OnPath } else { PathRelation::Elsewhere },
        };
        camera.step(photographs, &path, along);
        camera.send_current_command(now, &mut timers, &mut links);
        fake.fly(at_m);
        for frame in sent_frames(&mut links, &mut framer, now) {
            let Some(command) = frame.decode::<COMMAND_LONG_DATA>() else { continue };
            if lost < MAX_TRIES - 1 && chance(loss) {
                lost += 1;
                continue;
            }
            lost = 0;
            fake.command(&command, at_m);
            if !chance(loss) {
                let ack =
                    Ack { command: command.command as u32 as u16, result: ACCEPTED, to: (1, 191) };
                camera.handle_ack(&ack, &mut links);
            }
        }
    }
    (fake.pictures_m, fake.step_m > 0.0)
}

/// Checks that each stretch is photographed from end to end; the error is the first gap that is too
/// wide: from where to where along the path, metres.
fn first_gap(photographs: &PicturePlan, pictures_m: &[f32], late_m: f32) -> Result<(), (f32, f32)> {
    for shots in photographs.stretches(&path()) {
        let mut before_m = shots.from_m - shots.ground_spacing_m;
        let inside =
            pictures_m.iter().filter(|m| **m >= shots.from_m - 0.1 && **m <= shots.to_m + late_m);
        for &at_m in inside.chain([&(shots.to_m + shots.ground_spacing_m)]) {
            if at_m - before_m > shots.ground_spacing_m + late_m {
                return Err((before_m, at_m));
            }
            before_m = at_m;
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn nothing_is_left_out(
        seed in any::<u64>(),
        stops in any::<bool>(),
        distance in any::<bool>(),
    ) {
        let photographs = photographs(if distance { Trigger::Distance } else { Trigger::Waypoint });
        let (pictures_m, on) = fly(&photographs, 0.0, if stops { 0.01 } else { 0.0 }, seed);
        prop_assert_eq!(first_gap(&photographs, &pictures_m, LATE_M), Ok(()), "{:?}", pictures_m);
        prop_assert!(!on);
        if !stops {
            // With the trigger by distance the last picture of a stretch may be taken twice.
            let least = photographs.planned_count(&path());
            prop_assert!(
                (least..=least + 3).contains(&(pictures_m.len() as u32)),
                "{:?}",
                pictures_m
            );
        }
    }

    #[test]
    fn lost_commands_and_answers_are_repeated(seed in any::<u64>(), distance in any::<bool>()) {
        let photographs = photographs(if distance { Trigger::Distance } else { Trigger::Waypoint });
        let (pictures_m, on) = fly(&photographs, 0.1, 0.0, seed);
        prop_assert_eq!(first_gap(&photographs, &pictures_m, LOST_M), Ok(()), "{:?}", pictures_m);
        prop_assert!(!on);
    }
}

proptest! {
    /// If the reference holds at a picture's place or a little before it, that picture is taken
    /// before the path is replaced, however rarely the autopilot's trigger checks the distance and
    /// however far the vehicle lags. The trigger is then off.
    #[test]
    fn where_a_vehicle_holds_for_another_path_the_last_picture_is_taken(
        distance in any::<bool>(),
        number in 0_u32..9,
        before_m in 0.0_f32..0.2,
        lag_m in 0.0_f32..1.2,
        looks_every in 1_u32..8,
    ) {
        let photographs = photographs(if distance { Trigger::Distance } else { Trigger::Waypoint });
        let path = path();
        let hold_m = photographs.stretches(&path).next().unwrap().picture_arc_length_m(number);
        let (mut camera, mut links, mut fake) =
            (CameraControl::default(), Links::default(), Fake::default());
        let mut timers = Timers::default();
        let (mut framer, mut now, mut at_m) = (Framer::default(), Instant::ZERO, 0.0_f32);
        let bare = PicturePlan::new(8.0, HeadingMode::Ahead, photographs.trigger);
        for step in 0..800_u32 {
            now = now + Duration::from_millis(50);
            let reference_m = (MPS * STEP_S * step as f32).min(hold_m - before_m);
            at_m = (reference_m - lag_m).max(at_m);
            if step == 600 {
                camera.begin_path();
            }
            let flown = if step < 600 { &photographs } else { &bare };
            let place = PathRelation::OnPath;
            let along = PathProgress { progress_m: at_m, reference_m, relation: place };
            camera.step(flown, &path, along);
            camera.send_current_command(now, &mut timers, &mut links);
            if step % looks_every == 0 {
                fake.fly(at_m);
            }
            deliver(&mut camera, &mut fake, &mut links, &mut framer, now, at_m);
        }
        let near = |m: &f32| (m - hold_m).abs() <= lag_m + HOLDS_AT_PICTURE_WITHIN_M;
        let near = fake.pictures_m.iter().any(near);
        prop_assert!(near, "held at {} m: {:?}", hold_m, fake.pictures_m);
        prop_assert_eq!(fake.step_m, 0.0);
    }
}

proptest! {
    /// A vehicle that leaves its path for good between two pictures of a stretch takes one more
    /// picture there and switches the trigger off: its pictures end where it left the path.
    #[test]
    fn where_a_vehicle_leaves_its_path_a_last_picture_is_taken(
        distance in any::<bool>(),
        share in 0.01_f32..0.99,
    ) {
        let photographs = photographs(if distance { Trigger::Distance } else { Trigger::Waypoint });
        let path = path();
        let shots = photographs.stretches(&path).next().unwrap();
        let leaves_m = shots.from_m + share * (shots.to_m - shots.from_m);
        let (mut camera, mut links, mut fake) =
            (CameraControl::default(), Links::default(), Fake::default());
        let mut timers = Timers::default();
        let (mut framer, mut now, mut at_m) = (Framer::default(), Instant::ZERO, 0.0_f32);
        let mut taken_before = 0;
        for _ in 0..800_u32 {
            now = now + Duration::from_millis(50);
            let on_path = at_m < leaves_m;
            taken_before = if on_path { fake.pictures_m.len() } else { taken_before };
            at_m += MPS * STEP_S;
            let place = if on_path { PathRelation::OnPath } else { PathRelation::Elsewhere };
            let along = PathProgress { progress_m: at_m, reference_m: at_m, relation: place };
            camera.step(&photographs, &path, along);
            camera.send_current_command(now, &mut timers, &mut links);
            fake.fly(at_m);
            deliver(&mut camera, &mut fake, &mut links, &mut framer, now, at_m);
        }
        let last_m = *fake.pictures_m.last().unwrap();
        prop_assert!((last_m - leaves_m).abs() <= LATE_M, "{} m: {:?}", leaves_m, fake.pictures_m);
        // The command for the first picture of the stretch may still be under way.
        prop_assert!(fake.pictures_m.len() <= taken_before + 2);
        prop_assert_eq!(fake.step_m, 0.0);
    }
}

/// With a silent autopilot pictures follow each other faster than commands are given up: the queue
/// overflows, and the silence is still reported, once.
#[test]
fn a_silent_autopilot_is_reported_at_any_speed() {
    let (photographs, path) = (photographs(Trigger::Waypoint), path());
    for mps in [2.0, 5.0, 10.0, 20.0, 40.0, 80.0] {
        let (mut camera, mut links) = (CameraControl::default(), Links::default());
        let mut timers = Timers::default();
        let (mut framer, mut now, mut texts) = (Framer::default(), Instant::ZERO, 0);
        for step in 0..2000_u16 {
            now = now + Duration::from_millis(50);
            let progress_m = (mps * STEP_S * f32::from(step)).min(path.length_m());
            let place = PathRelation::OnPath;
            let along = PathProgress { progress_m, reference_m: progress_m, relation: place };
            camera.step(&photographs, &path, along);
            camera.send_current_command(now, &mut timers, &mut links);
            for frame in sent_frames(&mut links, &mut framer, now) {
                texts += usize::from(frame.decode::<STATUSTEXT_DATA>().is_some());
            }
        }
        assert_eq!(texts, 1, "at {mps} m/s");
    }
}

#[test]
fn without_a_trigger_nothing_is_commanded() {
    assert_eq!(fly(&photographs(Trigger::None), 0.0, 0.01, 1), (Vec::new(), false));
}

#[test]
fn a_vehicle_looks_along_the_next_lane_or_one_way() {
    let path = path();
    let ahead = photographs(Trigger::Distance);
    let at = |m: f32| heading(&ahead, &path, m).unwrap().to_degrees();
    assert_eq!((at(0.0), at(30.0)), (0.0, 0.0), "before and on the first lane");
    assert_eq!(
        (at(75.0), at(100.0), at(160.0)),
        (180.0, 180.0, 180.0),
        "it turns on the way to the second"
    );
    let fixed = PicturePlan::new(8.0, HeadingMode::FixedEnuRad(1.0), Trigger::Distance);
    assert_eq!(heading(&fixed, &path, 75.0), Some(1.0));
    let mut point = PicturePlan::new(8.0, HeadingMode::Ahead, Trigger::Distance);
    point.add_stretch(5, 5, WaypointRange { first: 0, end: 1 }).unwrap();
    assert_eq!(heading(&point, &path, 3.0), None, "one picture leads no way");
}
