//! The segment queries compared with brute force: f64 distances to every occupied cell, by another
//! method.

extern crate std;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use std::vec;
use std::vec::Vec;

use super::*;
use crate::map::voxel::{GridShape, Outside};

const DIMS: [u32; 3] = [13, 10, 9];

fn below(rng: &mut Pcg32, n: u32) -> u32 {
    ((u64::from(rng.next_u32()) * u64::from(n)) >> 32) as u32
}

fn unit(rng: &mut Pcg32) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

fn shape(resolution_m: f32) -> GridShape {
    GridShape { dims: DIMS, min: Point::new(-1.0, 2.0, -0.5), resolution_m }
}

/// Cells set with the probability `share`.
fn random_words(rng: &mut Pcg32, shape: &GridShape, share: f32) -> Vec<u64> {
    let mut words = vec![0; shape.word_count()];
    for i in 0..shape.dims[0] {
        for j in 0..shape.dims[1] {
            for k in 0..shape.dims[2] {
                if unit(rng) < share {
                    let (word, mask) = shape.word_and_mask([i, j, k]);
                    words[word] |= mask;
                }
            }
        }
    }
    words
}

/// Distance from a segment to a box in f64: the least over the places where, for each choice of
/// "below, inside or above" on each axis, the sum of squares that choice stands for is least. One
/// of the 27 is the true one.
fn brute_distance(a: [f64; 3], b: [f64; 3], low: [f64; 3], high: [f64; 3]) -> f64 {
    let at = |t: f64| {
        (0..3)
            .map(|i| {
                let p = a[i] + (b[i] - a[i]) * t;
                (low[i] - p).max(p - high[i]).max(0.0).powi(2)
            })
            .sum::<f64>()
    };
    let mut best = at(0.0).min(at(1.0));
    for choice in 0..27 {
        let (mut num, mut den) = (0.0, 0.0);
        for i in 0..3 {
            let face = [None, Some(low[i]), Some(high[i])][choice / 3_usize.pow(i as u32) % 3];
            if let Some(face) = face {
                num += (face - a[i]) * (b[i] - a[i]);
                den += (b[i] - a[i]).powi(2);
            }
        }
        if den > 0.0 {
            best = best.min(at((num / den).clamp(0.0, 1.0)));
        }
    }
    // If the segment runs through the box, no sum of squares is least: the clipped part shows it.
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for i in 0..3 {
        let d = b[i] - a[i];
        if d == 0.0 {
            if a[i] < low[i] || a[i] > high[i] {
                return best.sqrt();
            }
        } else {
            let (t0, t1) = ((low[i] - a[i]) / d, (high[i] - a[i]) / d);
            (enter, leave) = (enter.max(t0.min(t1)), leave.min(t0.max(t1)));
        }
    }
    if enter <= leave { best.min(at(enter)).sqrt() } else { best.sqrt() }
}

/// Least distance in cells to any occupied cell, each grown by `grow` cells, and to the outside if
/// that is blocked.
fn brute_clearance(grid: &VoxelGrid<'_>, a: &Point, b: &Point, grow: f64) -> f64 {
    let shape = grid.shape();
    let cells = |p: &Point| {
        [0, 1, 2]
            .map(|i| (f64::from(p[i]) - f64::from(shape.min[i])) / f64::from(shape.resolution_m))
    };
    let (a, b) = (cells(a), cells(b));
    let mut best = f64::INFINITY;
    if grid.beyond_map() == Outside::Blocked {
        for i in 0..3 {
            best = best
                .min(a[i].min(b[i]) - grow)
                .min(f64::from(shape.dims[i]) - a[i].max(b[i]) - grow);
        }
    }
    for i in 0..shape.dims[0] {
        for j in 0..shape.dims[1] {
            for k in 0..shape.dims[2] {
                if grid.is_occupied([i, j, k]) {
                    let low = [i, j, k].map(f64::from);
                    best = best.min(brute_distance(
                        a,
                        b,
                        low.map(|c| c - grow),
                        low.map(|c| c + 1.0 + grow),
                    ));
                }
            }
        }
    }
    best.max(0.0)
}

/// A point on the lattice of 1/8 cell, sometimes outside the grid.
fn lattice_point(rng: &mut Pcg32, shape: &GridShape) -> Point {
    let mut p = shape.min;
    for axis in 0..3 {
        let eighths = below(rng, shape.dims[axis] * 8 + 8) as f32 - 4.0;
        p[axis] += eighths / 8.0 * shape.resolution_m;
    }
    p
}

fn lattice_step(rng: &mut Pcg32, shape: &GridShape) -> Point {
    Point::from_fn(|_, _| (below(rng, 49) as f32 - 24.0) / 8.0 * shape.resolution_m)
}

/// Ends on the lattice of 1/8 cell: anywhere, along an axis or in a plane, on faces and edges of
/// cells, or through a corner or an edge of a cell with both ends off it.
fn lattice_segment(rng: &mut Pcg32, shape: &GridShape) -> (Point, Point) {
    let mut a = lattice_point(rng, shape);
    let mut b = lattice_point(rng, shape);
    match below(rng, 5) {
        0 => {}
        kind @ 1..=3 => {
            // Some axes equal, some of those on a face.
            let keep = below(rng, 3) as usize;
            for axis in 0..3 {
                if axis != keep && (kind != 3 || axis == (keep + 1) % 3) {
                    if kind != 1 {
                        let cell = ((a[axis] - shape.min[axis]) / shape.resolution_m).round();
                        a[axis] = shape.min[axis] + cell * shape.resolution_m;
                    }
                    b[axis] = a[axis];
                }
            }
        }
        _ => {
            let mut corner = lattice_point(rng, shape);
            for axis in 0..3 {
                let cell = ((corner[axis] - shape.min[axis]) / shape.resolution_m).round();
                corner[axis] = shape.min[axis] + cell * shape.resolution_m;
            }
            let step = lattice_step(rng, shape);
            a = corner - step * (1 + below(rng, 3)) as f32;
            b = corner + step * below(rng, 3) as f32;
        }
    }
    (a, b)
}

/// 60 000 segments whose ends are on the lattice: no tolerance, touching is blocked.
#[test]
fn lattice_segments_agree_with_brute_force_exactly() {
    let mut blocked = 0;
    for seed in 0..60 {
        let mut rng = Pcg32::seed_from_u64(seed);
        let shape = shape([0.25, 0.5, 1.0][seed as usize % 3]);
        let words = random_words(&mut rng, &shape, [0.004, 0.02, 0.1][seed as usize / 3 % 3]);
        let outside = if seed % 2 == 0 { Outside::Blocked } else { Outside::Free };
        let grid = VoxelGrid::new(shape, outside, &words).unwrap();
        for _ in 0..1000 {
            let (a, b) = lattice_segment(&mut rng, &shape);
            // Corners of cells and ends of segments are lattice points: a corner that is not on the
            // line is at least 1e-4 cells from it.
            let touches = brute_clearance(&grid, &a, &b, 0.0) < 1e-7;
            assert_eq!(
                segment_is_clear(&grid, &a, &b, 0.0),
                !touches,
                "seed {seed}: {a:?} to {b:?}"
            );
            assert_eq!(
                segment_is_clear(&grid, &b, &a, 0.0),
                !touches,
                "seed {seed}: reversed {a:?} to {b:?}"
            );
            blocked += i32::from(touches);
        }
    }
    assert!(
        (15_000..45_000).contains(&blocked),
        "{blocked} of 60000 blocked: the sample says little"
    );
}

/// 40 000 segments with any f32 ends: right wherever the true distance is not within 6e-5 cells of
/// touching. That is the most by which snapping may shift the segment: [`max_snap_error_cells`] of
/// a grid this small along each of three axes.
#[test]
fn any_segments_agree_with_brute_force() {
    let band = f64::from(max_snap_error_cells(16.0)) * 3.0_f64.sqrt();
    let (mut blocked, mut undecided) = (0, 0);
    for seed in 0..40 {
        let mut rng = Pcg32::seed_from_u64(1000 + seed);
        let shape = shape([0.25, 0.1, 0.3][seed as usize % 3]);
        let words = random_words(&mut rng, &shape, [0.01, 0.03, 0.1][seed as usize / 3 % 3]);
        let outside = if seed % 2 == 0 { Outside::Blocked } else { Outside::Free };
        let grid = VoxelGrid::new(shape, outside, &words).unwrap();
        let size = shape.max() - shape.min;
        for _ in 0..1000 {
            let draw = |rng: &mut Pcg32| shape.min + size.map(|s| s * (unit(rng) * 1.1 - 0.05));
            let (a, mut b) = (draw(&mut rng), draw(&mut rng));
            if below(&mut rng, 4) == 0 {
                b = a + (b - a) * 0.1;
            }
            let clear = segment_is_clear(&grid, &a, &b, 0.0);
            if brute_clearance(&grid, &a, &b, band) > 0.0 {
                assert!(clear, "seed {seed}: {a:?} to {b:?} is clear");
            } else if brute_clearance(&grid, &a, &b, -band) < 1e-12 {
                assert!(!clear, "seed {seed}: {a:?} to {b:?} is blocked");
                blocked += 1;
            } else {
                undecided += 1;
            }
        }
    }
    assert!(
        (8_000..32_000).contains(&blocked) && undecided < 40,
        "{blocked} blocked, {undecided} undecided"
    );
}

/// With a clearance: 20 000 segments, right unless the distance is within 1e-4 cells of the
/// clearance; and the distance itself to 1e-4 cells.
#[test]
fn clearances_agree_with_brute_force() {
    let mut blocked = 0;
    for seed in 0..20 {
        let mut rng = Pcg32::seed_from_u64(2000 + seed);
        let shape = shape([0.25, 0.1, 0.5][seed as usize % 3]);
        let words = random_words(&mut rng, &shape, [0.002, 0.01, 0.03][seed as usize / 3 % 3]);
        let outside = if seed % 2 == 0 { Outside::Blocked } else { Outside::Free };
        let grid = VoxelGrid::new(shape, outside, &words).unwrap();
        for round in 0..1000 {
            let (a, mut b) = lattice_segment(&mut rng, &shape);
            if round % 2 == 0 {
                b = a + (b - a) * 0.2;
            }
            if round % 10 == 0 {
                b = a;
            }
            let truth = brute_clearance(&grid, &a, &b, 0.0);
            let clearance = [0.125, 0.5, 1.0, 2.0][below(&mut rng, 4) as usize];
            let clear = segment_is_clear(&grid, &a, &b, clearance * shape.resolution_m);
            if (truth - f64::from(clearance)).abs() > 1e-4 {
                assert_eq!(
                    clear,
                    truth > f64::from(clearance),
                    "seed {seed}: {a:?} to {b:?} at {truth}"
                );
            }
            blocked += i32::from(!clear);
            let max = [0.5, 3.0, 40.0][below(&mut rng, 3) as usize];
            let found = f64::from(
                segment_clearance(&grid, &a, &b, max * shape.resolution_m) / shape.resolution_m,
            );
            let expected = truth.min(f64::from(max));
            assert!(
                (found - expected).abs() < 1e-4,
                "seed {seed}: {found}, not {expected}, for {a:?} to {b:?}"
            );
        }
    }
    assert!((4_000..16_000).contains(&blocked), "{blocked} of 20000 blocked");
}

/// A wall at exactly the clearance blocks, on a power-of-two lattice; a hair farther does not.
#[test]
fn touching_at_the_clearance_is_blocked() {
    let shape = GridShape { dims: [20, 20, 20], min: Point::zeros(), resolution_m: 0.25 };
    let mut words = vec![0; shape.word_count()];
    let (word, mask) = shape.word_and_mask([10, 10, 10]);
    words[word] = mask;
    let grid = VoxelGrid::new(shape, Outside::Free, &words).unwrap();
    // The cell spans 2.5 to 2.75 m; the segments pass below it along y.
    for (z, clear) in [(2.0, false), (1.999, true), (2.25, false)] {
        let (a, b) = (Point::new(2.6, 1.0, z), Point::new(2.6, 4.0, z));
        assert_eq!(segment_is_clear(&grid, &a, &b, 0.5), clear, "z = {z}");
    }
    // Beside an edge of it, diagonally: 0.3 and 0.4 m make 0.5 m, but for the rounding of the
    // decimals.
    let beside = |dx: f32, dz: f32| {
        segment_clearance(
            &grid,
            &Point::new(2.5 - dx, 1.0, 2.5 - dz),
            &Point::new(2.5 - dx, 4.0, 2.5 - dz),
            4.0,
        )
    };
    assert!((beside(0.3, 0.4) - 0.5).abs() < 1e-5);
}

#[test]
fn what_is_not_a_number_is_blocked() {
    let shape = shape(0.25);
    let words = vec![0; shape.word_count()];
    let grid = VoxelGrid::new(shape, Outside::Free, &words).unwrap();
    let good = Point::new(0.0, 3.0, 0.0);
    assert!(segment_is_clear(&grid, &good, &good, 0.1));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        for axis in 0..3 {
            let mut p = good;
            p[axis] = bad;
            for clearance in [0.0, 0.1] {
                assert!(
                    !segment_is_clear(&grid, &p, &good, clearance)
                        && !segment_is_clear(&grid, &good, &p, clearance)
                );
            }
            assert_eq!(segment_clearance(&grid, &good, &p, 1.0), 0.0);
        }
    }
    for bad in [f32::NAN, f32::INFINITY, -0.1] {
        assert!(!segment_is_clear(&grid, &good, &good, bad), "clearance {bad}");
    }
    assert_eq!(point_clearance(&grid, &good, f32::NAN), 0.0);
    assert_eq!(point_clearance(&grid, &good, f32::INFINITY), f32::INFINITY);
}
