//! Random coverage scenarios as TOML text, as a user would write them.

use rand_core::Rng;

/// A scenario: three vehicles photograph a small field, without faults.
pub const SMALL_FIELD_SCENARIO: &str = "[area]
polygon = [[0, 0], [150, 10], [170, 90], [80, 120], [-10, 80]]
camera = { fov_deg = 73.7, aspect = 1.5 }
height_m = 25.0
[mission]
cruise_mps = 5.0
[[vehicles]]
id = 1
start = [0, -20, 0]
[[vehicles]]
id = 2
start = [10, -20, 0]
[[vehicles]]
id = 3
start = [20, -20, 0]
";

/// A corner of a polygon, east and north in metres.
type Corner = [f64; 2];

/// Which shape random areas have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Convex, without holes and no-fly zones.
    Convex,
    /// Concave, with up to three holes and up to three no-fly zones, which may cut the border and
    /// each other.
    Any,
}

/// A uniformly distributed random number from 0 to below 1.
pub fn unit_random(random: &mut impl Rng) -> f64 {
    f64::from(random.next_u32()) / (f64::from(u32::MAX) + 1.0)
}

/// A uniformly distributed random number from `low` to below `high`.
pub fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * unit_random(random)
}

/// A star-shaped polygon: the segment from `middle` to any of its points lies inside it.
fn star_polygon(random: &mut impl Rng, middle: Corner, radius: f64, corners: usize) -> Vec<Corner> {
    let mut angles: Vec<f64> =
        (0..corners).map(|_| between(random, 0.0, std::f64::consts::TAU)).collect();
    angles.sort_by(f64::total_cmp);
    let least = between(random, 0.15, 0.9);
    let corner = |angle: f64| {
        let far = radius * between(random, least, 1.0);
        [middle[0] + far * angle.cos(), middle[1] + far * angle.sin()]
    };
    angles.into_iter().map(corner).collect()
}

/// The corners of a convex polygon on a random ellipse around the origin, turned by a random angle.
fn convex_polygon(random: &mut impl Rng, size: Corner, corners: usize) -> Vec<Corner> {
    let mut angles: Vec<f64> =
        (0..corners).map(|_| between(random, 0.0, std::f64::consts::TAU)).collect();
    angles.sort_by(f64::total_cmp);
    let turn = between(random, 0.0, std::f64::consts::TAU);
    let corner = |angle: f64| {
        let (u, v) = (size[0] * angle.cos(), size[1] * angle.sin());
        [u * turn.cos() - v * turn.sin(), u * turn.sin() + v * turn.cos()]
    };
    angles.into_iter().map(corner).collect()
}

/// The rings as a TOML list.
fn toml_rings(rings: &[Vec<Corner>]) -> String {
    let ring = |ring: &Vec<Corner>| {
        let corners: Vec<String> = ring.iter().map(|[x, y]| format!("[{x:.3}, {y:.3}]")).collect();
        format!("[{}]", corners.join(", "))
    };
    rings.iter().map(ring).collect::<Vec<_>>().join(", ")
}

/// A [`scenario`] that can be flown: pictures overlap enough for the deviations of vehicles, and
/// autopilots, gusts, estimates and radio loss vary.
pub fn flyable_scenario(random: &mut impl Rng, shape: Shape, vehicles: usize) -> String {
    let text = scenario(random, shape, vehicles);
    let overlaps = text.lines().filter(|line| line.starts_with("overlap_"));
    let plain: String =
        overlaps.fold(text.clone(), |text, line| text.replacen(&format!("{line}\n"), "", 1));
    let (front, side) = (between(random, 0.5, 0.8), between(random, 0.4, 0.7));
    let cruise = between(random, 2.0, 8.0);
    let place = format!(
        "overlap_front = {front:.2}\noverlap_side = {side:.2}\n[mission]\ncruise_mps = {cruise:.1}\n"
    );
    let mut text = plain.replace("[mission]\ncruise_mps = 5.0\n", &place);
    let trigger = ["distance", "waypoint"][(random.next_u32() % 2) as usize];
    let heading = ["sweep", "lane"][(random.next_u32() % 2) as usize];
    text = text.replace(
        "camera = ",
        &format!("trigger = \"{trigger}\"\nheading = \"{heading}\"\ncamera = "),
    );
    let autopilot = ["px4", "ardupilot"][(random.next_u32() % 2) as usize];
    text = text.replace(
        "speed_max_mps",
        &format!("personality = \"{autopilot}\"\nendurance_s = 7200.0\nspeed_max_mps"),
    );
    let recorded = random.next_u32().is_multiple_of(2);
    let (estimator, separation) = if recorded { ("recorded", 3.6) } else { ("rtk", 2.0) };
    let (gust, loss) = (between(random, 0.0, 3.0), between(random, 0.0, 0.3));
    text + &format!(
        "[deconfliction]\nseparation_m = {separation}\n[simulation]\nestimator = \"{estimator}\"\ngust_mps = {gust:.1}\n\
         radio_loss = {loss:.2}\nradio_range_m = 2000.0\ntime_limit_s = 7200.0\n"
    )
}

/// As [`flyable_scenario`], at heights and speeds of real surveys: up to 15 m/s and 120 m, and in
/// some scenarios with a wide separation.
pub fn survey_scenario(random: &mut impl Rng, shape: Shape, vehicles: usize) -> String {
    let text = flyable_scenario(random, shape, vehicles);
    let drawn = |line: &str| match line.split(" = ").next() {
        Some("cruise_mps") => format!("cruise_mps = {:.1}\n", between(random, 8.0, 15.0)),
        Some("height_m") => format!("height_m = {:.1}\n", between(random, 40.0, 120.0)),
        Some("separation_m") => match random.next_u32() % 3 {
            0 => format!("{line}\n"),
            1 => String::new(),
            _ => format!("separation_m = {:.1}\n", between(random, 4.0, 9.0)),
        },
        _ => format!("{line}\n"),
    };
    text.lines().map(drawn).collect()
}

/// As [`survey_scenario`], with more lanes than a vehicle's path has room for, so that it is flown
/// in stretches.
pub fn many_lanes_scenario(random: &mut impl Rng, shape: Shape, vehicles: usize) -> String {
    let text = survey_scenario(random, shape, vehicles);
    let drawn = |line: &str| match line.split(" = ").next() {
        Some("height_m") => format!("height_m = {:.1}\n", between(random, 12.0, 20.0)),
        Some("overlap_side") => format!("overlap_side = {:.2}\n", between(random, 0.6, 0.85)),
        Some("cruise_mps") => format!("cruise_mps = {:.1}\n", between(random, 4.0, 12.0)),
        _ => format!("{line}\n"),
    };
    text.lines().map(drawn).collect()
}

/// As [`lossy_radio_scenario_of`], over a convex area.
pub fn lossy_radio_scenario(random: &mut impl Rng, vehicles: usize, loss: f32) -> String {
    lossy_radio_scenario_of(random, Shape::Convex, vehicles, loss)
}

/// A random area with minutes of work for each of so many vehicles; their radio loses the share
/// `loss` of messages.
pub fn lossy_radio_scenario_of(
    random: &mut impl Rng,
    shape: Shape,
    vehicles: usize,
    loss: f32,
) -> String {
    let mut text = flyable_scenario(random, shape, vehicles);
    let keep = |line: &&str| !line.starts_with("radio_loss") && !line.starts_with("cruise_mps");
    text = text.lines().filter(keep).map(|line| format!("{line}\n")).collect();
    text = text.replace(
        "[mission]\n",
        &format!("[mission]\ncruise_mps = {:.1}\n", between(random, 3.0, 6.0)),
    );
    text = text.replace("time_limit_s = 7200.0", "time_limit_s = 3600.0");
    // With "recorded" estimates the separation is random: at least 3.6 m, as their errors require.
    let separation = format!("separation_m = {:.1}", between(random, 3.6, 8.0));
    text = text.replace("separation_m = 3.6", &separation);
    text + &format!("radio_loss = {loss}\n")
}

/// The scenario `text` without a camera: one picture is as wide as a lane and as long as the
/// distance of waypoints, so pictures do not overlap. Half of the scenarios have square pictures.
pub fn without_overlap(random: &mut impl Rng, text: &str) -> String {
    let lane_m = between(random, 4.0, 20.0);
    let share = if random.next_u32().is_multiple_of(2) { 1.0 } else { between(random, 0.4, 1.0) };
    let drawn = |line: &&str| !["camera", "overlap_"].iter().any(|key| line.starts_with(key));
    let rest: String = text.lines().filter(drawn).map(|line| format!("{line}\n")).collect();
    let spacing = format!("lane_m = {lane_m:.2}\nwaypoint_m = {:.2}\nheight_m", lane_m * share);
    rest.replacen("height_m", &spacing, 1)
}

/// A random coverage scenario with so many vehicles. Some cannot be planned: corners may lie on one
/// line, or a hole outside the area.
pub fn scenario(random: &mut impl Rng, shape: Shape, vehicles: usize) -> String {
    let radius = between(random, 40.0, 250.0);
    let count = 3 + (random.next_u32() % 20) as usize;
    let outer = match shape {
        Shape::Convex => {
            let flat = between(random, 0.2, 1.0);
            convex_polygon(random, [radius, radius * flat], count.min(9))
        }
        Shape::Any => star_polygon(random, [0.0, 0.0], radius, count),
    };
    let mut text = format!("[area]\npolygon = {}\n", toml_rings(&[outer]));
    if shape == Shape::Any {
        for (key, most, size) in [("holes", 4, 0.15), ("no_fly", 4, 0.35)] {
            let rings = (0..random.next_u32() % most).map(|_| {
                let middle = [0, 1].map(|_| between(random, -0.6, 0.6) * radius);
                let size = size * radius * between(random, 0.2, 1.0);
                let corners = 3 + (random.next_u32() % 7) as usize;
                star_polygon(random, middle, size, corners)
            });
            let rings: Vec<_> = rings.collect();
            text += &format!("{key} = [{}]\n", toml_rings(&rings));
        }
        if random.next_u32().is_multiple_of(3) {
            text += &format!("angle_deg = {:.1}\n", between(random, 0.0, 180.0));
        }
        if random.next_u32().is_multiple_of(4) {
            text += &format!("margin_m = {:.1}\n", between(random, 0.0, 10.0));
        }
    }
    let height = between(random, 15.0, 60.0);
    let (front, side) = (between(random, 0.1, 0.8), between(random, 0.1, 0.7));
    text += &format!("camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = {height:.1}\n");
    text += &format!(
        "overlap_front = {front:.2}\noverlap_side = {side:.2}\n[mission]\ncruise_mps = 5.0\n"
    );
    let base = [0, 1].map(|_| between(random, -1.2, 1.2) * radius);
    let scattered = random.next_u32().is_multiple_of(2);
    for id in 1..=vehicles {
        let place = match scattered {
            true => [0, 1].map(|_| between(random, -1.3, 1.3) * radius),
            false => [base[0] + 4.0 * id as f64, base[1]],
        };
        text += &format!(
            "[[vehicles]]\nid = {id}\nspeed_max_mps = 20.0\nstart = [{:.2}, {:.2}, 0.0]\n",
            place[0], place[1]
        );
    }
    text
}
