use std::fmt::Write as _;

use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::*;
use crate::coverage::heights::is_at_lane_height;

/// Cells along a side of the height map.
const SIDE: usize = 60;
/// Side of a cell, metres.
const CELL_M: usize = 5;

/// A height map that is level around the pads, and elsewhere has a random height of up to `most_m`
/// in blocks of 3 × 3 cells: steeper than vehicles climb.
fn rough_ground(seed: u64, most_m: f32) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let mut text =
        format!("ncols {SIDE}\nnrows {SIDE}\nxllcorner -100\nyllcorner -100\ncellsize {CELL_M}\n");
    let blocks: Vec<f32> =
        (0..SIDE * SIDE).map(|_| most_m * (random.next_u32() as f32 / u32::MAX as f32)).collect();
    for row in (0..SIDE).rev() {
        for column in 0..SIDE {
            let level = row * CELL_M < 110;
            let up_m = if level { 0.0 } else { blocks[row / 3 * SIDE + column / 3] };
            let _ = write!(text, "{:.2} ", 100.0 + up_m);
        }
        text.push('\n');
    }
    text
}

/// A field above that ground, with three pads beside it and these lines of `[area]`.
fn field(ground: &std::path::Path, keys: &str) -> Scenario {
    let text = format!(
        "[area]\npolygon = [[0, 10], [120, 10], [120, 90], [0, 90]]\nterrain = \"{}\"\n\
         camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 25.0\ntrigger = \"none\"\n{keys}\n\
         [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [-20, -40, 0]\n\
         [[vehicles]]\nid = 2\nstart = [-30, -40, 0]\n[[vehicles]]\nid = 3\nstart = [-40, -40, 0]",
        ground.display()
    );
    crate::scenario::parse(&text, "field.toml").unwrap()
}

/// Points each metre along the planned flights, a track for each vehicle: those on lanes and
/// between them, or those in transit layers.
fn planned_tracks(scenario: &Scenario, on_lanes: bool) -> Vec<Vec<(f32, Point)>> {
    let planned = CoveragePlan::plan_as_companions(scenario).unwrap();
    let mut tracks = vec![Vec::new(); scenario.vehicles.len()];
    for (sortie, points, times_s) in planned.flights() {
        let track = &mut tracks[usize::from(sortie.route.vehicle_index)];
        for (leg, t_s) in points.windows(2).zip(times_s) {
            let (from, step) = (leg[0].position, leg[1].position - leg[0].position);
            // What rises or sinks on the spot passes all heights.
            if step.xy().norm() < 0.5 || leg.iter().any(|p| is_at_lane_height(p) != on_lanes) {
                continue;
            }
            let count = step.xy().norm().ceil() as u16;
            let share = |k: u16| f32::from(k) / f32::from(count);
            track.extend((0..=count).map(|k| (t_s, from + step * share(k))));
        }
    }
    tracks
}

/// Lanes follow a smoothed field, so they are higher above hollows by design. Each point of them
/// counts, and none of the transit layers above.
#[test]
fn lanes_above_rough_ground_count_and_transit_layers_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let ground = folder.path().join("ground.asc");
    for seed in 0..12 {
        let (most_m, tolerance_m) = ([0.0, 4.0, 12.0, 25.0][seed as usize % 4], 1 + seed % 5);
        std::fs::write(&ground, rough_ground(seed, most_m)).unwrap();
        let scenario = field(&ground, &format!("terrain_tolerance_m = {tolerance_m}.0"));
        for on_lanes in [true, false] {
            let tracks = planned_tracks(&scenario, on_lanes);
            let points: usize = tracks.iter().map(Vec::len).sum();
            let counted = track_points_as_pictures(&scenario, &tracks).unwrap().unwrap().len();
            assert!(points > 100, "seed {seed}, {on_lanes}: {points}");
            let expected = if on_lanes { points } else { 0 };
            assert_eq!(counted, expected, "seed {seed}, {on_lanes}: of {points}");
        }
    }
}

/// A vehicle as much as a layer below or above its lanes is not on them.
#[test]
fn points_a_layer_off_the_lanes_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let ground = folder.path().join("ground.asc");
    for (seed, most_m) in [(1, 0.0), (2, 12.0)] {
        std::fs::write(&ground, rough_ground(seed, most_m)).unwrap();
        let scenario = field(&ground, "terrain_tolerance_m = 1.0");
        let layer_m = scenario.area.as_ref().unwrap().heights.layer_spacing_m;
        for (off_m, counts) in [(-layer_m - 1.0, false), (0.0, true), (layer_m + 1.0, false)] {
            let mut tracks = planned_tracks(&scenario, true);
            tracks.iter_mut().flatten().for_each(|(_, place)| place.z += off_m);
            let counted = track_points_as_pictures(&scenario, &tracks).unwrap().unwrap();
            assert_eq!(!counted.is_empty(), counts, "{off_m} m off, {most_m} m of hills");
        }
    }
}
