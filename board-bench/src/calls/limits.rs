//! With the other `limits_*` files: calls every public function of `planner-core` with extreme and
//! invalid arguments: numbers that are NaN, infinite, zero, negative or huge; indices out of range;
//! memory that is too small. None may panic. The results go into a checksum, by which a test
//! compares host and board.

use heapless::Vec;
use planner_core::Point;
use planner_core::flight::{
    HeadingMode, Path, PicturePlan, Task, Trigger, WaypointOrder, WaypointRange,
};
use planner_core::geo::frames::{self, Geodetic, Projection};
use planner_core::map::segment::{self, MAX_SNAPPED};
use planner_core::map::voxel::{GridError, GridShape, MAX_DIM, Outside, VoxelGrid};
use planner_core::roadmap::prm::{self, PrmConfig, PrmError, Sampling};
use planner_core::track::deconflict::{
    self, Advice, DeconflictConfig, Method, Neighbour, OwnVehicle,
};
use planner_core::track::{self, ReferenceState, TrackConfig};

pub use super::limits_results::{CallListener, Results};
use super::limits_results::{EXTREME_NUMBERS, extreme_points};
use super::limits_safety::call_reachable_sets;

/// Makes all calls that need no roadmap.
pub fn call_without_roadmap(to: &mut Results<'_, impl CallListener>) {
    call_frames(to);
    call_grids(to);
    call_segments(to);
    call_sampling(to);
    call_paths(to);
    call_deconfliction(to);
    call_reachable_sets(to);
}

fn call_frames(to: &mut Results<'_, impl CallListener>) {
    for p in extreme_points() {
        let hard = Geodetic { lat_deg: p.x.into(), lon_deg: p.y.into(), alt_m: p.z.into() };
        let good = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };
        let valid = to.call("frames::Geodetic::is_valid", || hard.is_valid());
        assert!(!valid || hard.lat_deg.abs() <= 90.0);
        for (a, b) in [(good, hard), (hard, good)] {
            let enu = to.call("frames::geodetic_to_enu", || frames::geodetic_to_enu(&a, &b));
            to.add_point(&enu);
            let back = to.call("frames::enu_to_geodetic", || frames::enu_to_geodetic(&a, &p));
            to.add(back.alt_m as f32);
            let apart_m = to.call("frames::haversine_m", || frames::haversine_m(&a, &b));
            assert!(!(valid && apart_m.is_nan()), "{a:?} {b:?}");
            for kind in [Projection::Px4, Projection::ArduPilot] {
                let ned =
                    to.call("frames::geodetic_to_ned", || frames::geodetic_to_ned(kind, &a, &b));
                to.call("frames::ned_to_geodetic", || frames::ned_to_geodetic(kind, &a, &ned));
            }
        }
        let swapped = to.call("frames::swap_enu_ned", || frames::swap_enu_ned(&p));
        to.add_point(&swapped);
    }
}

/// A grid of 5 × 6 × 3 cells with one occupied cell.
const SHAPE: GridShape =
    GridShape { dims: [5, 6, 3], min: Point::new(0.0, 0.0, 0.0), resolution_m: 0.5 };
const WORDS: [u64; 4] = [1 << 17, 0, 0, 0];

fn call_grids(to: &mut Results<'_, impl CallListener>) {
    let dims = [0, 1, 4, MAX_DIM, MAX_DIM + 1, u32::MAX];
    for i in 0..dims.len() * dims.len() {
        let shape = GridShape { dims: [dims[i % 6], dims[i / 6], dims[(i * 5 + 1) % 6]], ..SHAPE };
        let bricks = to.call("voxel::GridShape::brick_dims", || shape.brick_dims());
        let count = to.call("voxel::GridShape::word_count", || shape.word_count());
        assert!(bricks.iter().all(|&b| b as usize <= count.max(b as usize)));
        to.call("voxel::GridShape::max", || shape.max());
        let (word, mask) = to.call("voxel::GridShape::word_and_mask", || {
            shape.word_and_mask([u32::MAX, 7, dims[i / 6]])
        });
        to.add_count(word ^ mask as usize);
        let grid =
            to.call("voxel::VoxelGrid::new", || VoxelGrid::new(shape, Outside::Free, &WORDS));
        // None of these shapes has four words, so `new` must refuse `WORDS`, which fit [`SHAPE`].
        assert!(grid.is_err(), "{shape:?}");
    }
    for hard in EXTREME_NUMBERS {
        let shape = GridShape { resolution_m: hard, ..SHAPE };
        let grid = VoxelGrid::new(shape, Outside::Free, &WORDS);
        assert_eq!(grid.is_ok(), hard > 0.0 && hard.is_finite());
        for p in extreme_points() {
            let cell = to.call("voxel::GridShape::cell_of", || shape.cell_of(&p));
            assert!(cell.is_none_or(|cell| (0..3).all(|a| cell[a] < shape.dims[a])));
        }
        to.call("voxel::GridShape::center", || shape.center([u32::MAX; 3]));
    }
    // Padding bits, which belong to no cell and must be 0, and bits beside them that belong to a
    // cell.
    for (word, bit, padding) in
        [(1, 1, true), (1, 0, false), (2, 8, true), (2, 4, false), (0, 48, true)]
    {
        let mut words = WORDS;
        words[word] |= 1 << bit;
        let checked = VoxelGrid::new(SHAPE, Outside::Free, &words).map(|_| ());
        assert_eq!(checked, if padding { Err(GridError::Padding) } else { Ok(()) }, "{word} {bit}");
    }
    for outside in [Outside::Free, Outside::Blocked] {
        let grid = VoxelGrid::new(SHAPE, outside, &WORDS).expect("a good grid");
        assert_eq!(to.call("voxel::VoxelGrid::beyond_map", || grid.beyond_map()), outside);
        assert_eq!(to.call("voxel::VoxelGrid::shape", || grid.shape().dims), SHAPE.dims);
        assert_eq!(to.call("voxel::VoxelGrid::words", || grid.words().len()), 4);
        for cell in [[5, 0, 0], [0, 6, 0], [0, 0, 3], [u32::MAX; 3], [4, u32::MAX, 2]] {
            let blocked = to.call("voxel::VoxelGrid::is_occupied", || grid.is_occupied(cell));
            assert_eq!(blocked, outside == Outside::Blocked);
        }
        for p in extreme_points() {
            let blocked = to.call("voxel::VoxelGrid::is_blocked_at", || grid.is_blocked_at(&p));
            to.add_count(usize::from(blocked));
        }
    }
}

fn call_segments(to: &mut Results<'_, impl CallListener>) {
    for outside in [Outside::Free, Outside::Blocked] {
        let grid = VoxelGrid::new(SHAPE, outside, &WORDS).expect("a good grid");
        let inside = Point::new(2.2, 2.7, 1.2);
        for p in extreme_points() {
            let snapped = to.call("lattice::snap", || segment::snap(&SHAPE, &p));
            for hard in EXTREME_NUMBERS {
                let clear = to.call("segment::segment_is_clear", || {
                    segment::segment_is_clear(&grid, &p, &inside, hard)
                });
                assert!(!clear || (snapped.is_some() && hard >= 0.0 && hard.is_finite()));
                let distance = [p, inside].map(|from| {
                    to.call("distance::segment_clearance", || {
                        segment::segment_clearance(&grid, &from, &p, hard)
                    })
                });
                distance.iter().for_each(|&d| {
                    assert!((0.0..=hard.max(0.0)).contains(&d), "{p:?} {hard}: {d}");
                });
                let alone = to.call("distance::point_clearance", || {
                    segment::point_clearance(&grid, &p, hard)
                });
                assert_eq!(alone.to_bits(), distance[0].to_bits());
                to.add_count(usize::from(clear));
                to.add(distance[1]);
            }
        }
        for cells in EXTREME_NUMBERS {
            let error =
                to.call("lattice::max_snap_error_cells", || segment::max_snap_error_cells(cells));
            to.add(error);
        }
        let edge = [MAX_SNAPPED, -MAX_SNAPPED, 0, i32::MAX, i32::MIN];
        for i in 0..25 {
            let (a, b) = ([edge[i % 5], 0, 1], [0, edge[i / 5], edge[(i * 3) % 5]]);
            let touches = to.call("walk::snapped_segment_touches", || {
                segment::snapped_segment_touches(&grid, &a, &b)
            });
            let beyond = a.iter().chain(&b).any(|c| c.unsigned_abs() > MAX_SNAPPED as u32);
            assert!(touches || !beyond, "{a:?} {b:?}");
        }
    }
}

fn call_sampling(to: &mut Results<'_, impl CallListener>) {
    let grid = VoxelGrid::new(SHAPE, Outside::Blocked, &WORDS).expect("a good grid");
    let solid = VoxelGrid::new(GridShape { dims: [4; 3], ..SHAPE }, Outside::Blocked, &[u64::MAX])
        .expect("it is");
    let good = PrmConfig {
        random_nodes: 6,
        edge_min_m: 0.1,
        edge_max_m: 2.0,
        clearance_m: 0.1,
        seed: 1,
        sampling: Sampling::Halton,
    };
    let mut nodes = [Point::zeros(); 8];
    let mut node_grid = to.call("neighbours::NodeGrid::new", prm::NodeGrid::<8, 16>::new);
    assert!(to.call("neighbours::NodeGrid::is_empty", || node_grid.is_empty()));
    for hard in EXTREME_NUMBERS {
        for config in [
            PrmConfig { edge_min_m: hard, ..good },
            PrmConfig { edge_max_m: hard, ..good },
            PrmConfig { clearance_m: hard, ..good },
            PrmConfig { random_nodes: hard as usize, ..good },
        ] {
            let checked = to.call("config::PrmConfig::check", || config.check());
            let sampled = to.call("prm::sample_nodes", || {
                prm::sample_nodes(&grid, Some(&grid), &[], &config, &mut nodes)
            });
            assert!(checked.is_ok() || sampled == Err(checked.unwrap_err()));
            let mut edges = [prm::PrmEdge { a: 0, b: 0 }; 4];
            let joined = to.call("prm::connect", || {
                prm::connect(&grid, &nodes[..6], &config, &mut node_grid, &mut edges)
            });
            let mut pairs = 0;
            let all = to.call("prm::connect_all_pairs", || {
                prm::connect_all_pairs(&grid, &nodes[..6], &config, |_| pairs += 1)
            });
            match joined {
                Ok(count) => assert_eq!(count, pairs),
                Err(PrmError::RoadmapFull) => assert!(pairs > edges.len()),
                Err(error) => assert_eq!(all, Err(error)),
            }
            to.add_count(pairs);
        }
    }
    assert!(
        prm::sample_nodes(&solid, None, &[], &good, &mut nodes) == Err(PrmError::NoFreeSpace(0))
    );
    assert!(prm::sample_nodes(&grid, None, &[Point::zeros()], &good, &mut nodes[..3]).is_err());
    for p in extreme_points() {
        let indexed = to.call("neighbours::NodeGrid::sort_nodes", || {
            node_grid.sort_nodes(&[p, Point::zeros()], &good)
        });
        assert_eq!(indexed.is_ok(), p.iter().all(|c| c.abs() <= 1e6));
        let len = to.call("neighbours::NodeGrid::len", || node_grid.len());
        assert_eq!(len, if indexed.is_ok() { 2 } else { 0 });
        // Ranges of nodes that do not exist yield no edges.
        for range in [0..2, 1..usize::MAX, usize::MAX..usize::MAX] {
            let found = to.call("prm::connect_range", || {
                prm::connect_range(&grid, &node_grid, &good, range.clone(), |_| {
                    Err(PrmError::RoadmapFull)
                })
            });
            to.add_count(usize::from(found.is_ok()));
            let full = |_: prm::PrmEdge, _: f32| Err(PrmError::RoadmapFull);
            let found = to.call("prm::connect_range_with_clearance_bound", || {
                prm::connect_range_with_clearance_bound(
                    &grid,
                    &node_grid,
                    &good,
                    range,
                    |_| None,
                    full,
                )
            });
            to.add_count(usize::from(found.is_ok()));
        }
        let square = to.call("config::squared_length", || prm::squared_length(p.into(), [0.0; 3]));
        to.add(square);
        let pair = [p, Point::new(1.0, 1.0, 1.0)];
        for (a, b) in [(0, 1), (0, 0), (0, 2), (u16::MAX, 0)] {
            let clearance_m = to.call("prm::edge_clearance", || {
                prm::edge_clearance(&grid, &pair, prm::PrmEdge { a, b }, p.y)
            });
            assert_eq!(clearance_m.is_some(), a.max(b) < 2);
            to.add(clearance_m.unwrap_or(-1.0));
        }
    }
}

fn call_paths(to: &mut Results<'_, impl CallListener>) {
    let mut path: Path<4> = to.call("path::Path::new", Path::new);
    let track = TrackConfig::default();
    assert!(
        track::advance(&track, &path, &mut ReferenceState::default(), &Advice::FREE, 0.05)
            .is_none()
    );
    assert!(path.point_at(f32::NAN).is_none() && path.points_from(0.0, 1.0).next().is_none());
    for round in 0..3 {
        for p in extreme_points() {
            let before = path.waypoints().len();
            let pushed = to.call("path::Path::push", || path.push(p, p.x));
            assert!(pushed.is_ok() || path.waypoints().len() == before);
            assert!(pushed.is_err() || p.iter().all(|c| c.is_finite()));
        }
        let _ = path.push(Point::new(round as f32, 0.0, 1.0), 1.0);
        let length_m = to.call("path::Path::length_m", || path.length_m());
        assert!(length_m.is_finite() && length_m >= 0.0, "{length_m}");
        for (i, &hard) in EXTREME_NUMBERS.iter().enumerate() {
            let other = EXTREME_NUMBERS[(i * 5 + round) % EXTREME_NUMBERS.len()];
            to.call("path::Path::set_times_at_speed", || path.set_times_at_speed(hard, other));
            to.call("path::Path::set_last_waypoint_times", || {
                path.set_last_waypoint_times(hard, other);
            });
            to.call("path::Path::set_times_by_leg", || {
                path.set_times_by_leg(hard, |from, to| (to - from).norm() * other);
            });
            let at = to
                .call("path::Path::point_at", || path.point_at(hard))
                .expect("a path with waypoints");
            let count = to
                .call("path::Path::points_from", || path.points_from(hard, other).take(20).count());
            assert_eq!(count, 20);
            let along_m = to.call("path::Path::project", || path.project(&at, hard, other));
            to.add(along_m);
            call_tracking(to, &path, hard, other);
        }
        call_tasks(to, &path);
        to.add_count(waypoint_count(&path));
        path = Path::new();
        let _ = path.push(Point::zeros(), 1.0);
    }
    assert!(!to.call("path::Path::waypoints", || path.waypoints().is_empty()));
}

/// Calls of the reference along a path, with extreme advice, time steps and limits.
fn call_tracking(to: &mut Results<'_, impl CallListener>, path: &Path<4>, hard: f32, other: f32) {
    let track = TrackConfig::default();
    let advice = |scale: f32, within_m: f32| Advice {
        speed_scale: scale,
        stop_within_m: within_m,
        waiting_for_id: 0,
    };
    let length_m = path.length_m();
    for dt_s in [0.05, hard] {
        let mut state = ReferenceState { along_m: 0.5 * length_m, speed_mps: 1.0 };
        let reference = to
            .call("track::advance", || {
                track::advance(&track, path, &mut state, &advice(hard, other), dt_s)
            })
            .expect("a path with waypoints");
        assert!(reference.position.iter().all(|c| c.is_finite()), "{hard} {other} {reference:?}");
        let brakes_m = to
            .call("track::braking_distance_m", || track::braking_distance_m(&track, path, &state));
        assert!(brakes_m >= 0.0, "{hard} {other} {brakes_m}");
        assert!((0.0..=length_m).contains(&state.along_m), "{hard} {other} {state:?}");
        let waits = dt_s.is_nan() || dt_s <= 0.0;
        assert!(!waits || state == ReferenceState { along_m: 0.5 * length_m, speed_mps: 1.0 });
    }
    let config = TrackConfig { accel_mps2: hard, response_s: other, ..track };
    let checked = to.call("track::TrackConfig::check", || config.check());
    let good = |x: f32| x > 0.0 && x.is_finite();
    assert_eq!(checked.is_ok(), good(hard) && good(other));
    track::advance(&config, path, &mut ReferenceState::default(), &Advice::FREE, 0.05);
}

/// Calls of the pictures along a path, with extreme spacings.
fn call_tasks(to: &mut Results<'_, impl CallListener>, path: &Path<4>) {
    let last =
        to.call("path::Path::last_index", || path.last_index()).expect("a path with waypoints");
    let waypoints = WaypointRange {
        first: PicturePlan::MAX_AREA_WAYPOINTS - 1,
        end: PicturePlan::MAX_AREA_WAYPOINTS,
    };
    for spacing_m in EXTREME_NUMBERS {
        let new = || PicturePlan::new(spacing_m, HeadingMode::Ahead, Trigger::Distance);
        let mut plan = to.call("photographs::PicturePlan::new", new);
        for (from, until) in
            [(0, last), (last, last), (1, 0), (0, PicturePlan::MAX_PATH_WAYPOINTS), (62, 63)]
        {
            let marked = to.call("photographs::PicturePlan::add_stretch", || {
                plan.add_stretch(from, until, waypoints)
            });
            assert_eq!(marked.is_ok(), from <= until && until < PicturePlan::MAX_PATH_WAYPOINTS);
        }
        let plan = to.call("photographs::PicturePlan::with_area_waypoints", || {
            let order =
                if spacing_m > 0.0 { WaypointOrder::Falling } else { WaypointOrder::Rising };
            plan.with_area_waypoints(u32::MAX, order)
        });
        assert_eq!(
            to.call("photographs::PicturePlan::area_waypoint_count", || plan.area_waypoint_count()),
            u32::MAX
        );
        let all = to.call("photographs::PicturePlan::planned_count", || plan.planned_count(path));
        let end_m =
            to.call("photographs::PicturePlan::last_picture_m", || plan.last_picture_m(path));
        assert!(end_m.is_none_or(|end_m| end_m <= path.length_m()));
        let stretches =
            to.call("photographs::PicturePlan::stretches", || plan.stretches(path).count());
        for along_m in [-1.0, 0.0, f32::NAN, f32::INFINITY] {
            let taken = to
                .call("photographs::PicturePlan::taken_count", || plan.taken_count(path, along_m));
            let passed = to.call("photographs::PicturePlan::certainly_taken_count", || {
                plan.certainly_taken_count(path, along_m)
            });
            assert!(passed <= taken || spacing_m <= 0.0, "{along_m}: {passed} of {taken}");
            let at_m = to.call("photographs::PicturePlan::last_picture_before_m", || {
                plan.last_picture_before_m(path, along_m)
            });
            assert!(
                taken <= all && at_m.is_none_or(|at_m| at_m <= path.length_m() + 1.0),
                "{along_m}: {taken}"
            );
        }
        assert!(all as usize >= stretches && stretches <= 4, "{spacing_m}: {all} in {stretches}");
        call_pictures(to, path, &plan, all);
        let task = Task::Photograph(plan);
        assert!(to.call("flight::Task::leaves_pad", || task.leaves_pad()));
        assert_eq!(to.call("flight::Task::goal", || task.goal()), None);
    }
}

/// Calls for the waypoints that pictures show, and for the pictures' places.
fn call_pictures(
    to: &mut Results<'_, impl CallListener>,
    path: &Path<4>,
    plan: &PicturePlan,
    all: u32,
) {
    let stretches = plan.stretches(path).count();
    for count in [0, 1, all, u32::MAX] {
        let pictures = WaypointRange { first: 0, end: count };
        let shown = to.call("photographs::PicturePlan::waypoints_of_pictures", || {
            plan.waypoints_of_pictures(path, pictures).count()
        });
        assert!(shown <= stretches, "{count}: {shown} of {stretches}");
    }
    for shots in plan.stretches(path) {
        let place_m = to.call("photographs::PictureStretch::picture_arc_length_m", || {
            shots.picture_arc_length_m(shots.count)
        });
        to.add(place_m);
    }
}

fn waypoint_count<const W: usize>(path: &Path<W>) -> usize {
    path.waypoints().len()
}

fn call_deconfliction(to: &mut Results<'_, impl CallListener>) {
    let mut path: Path<4> = Path::new();
    let empty: Path<4> = Path::new();
    [0.0, 4.0].iter().for_each(|&x| path.push(Point::new(x, 0.0, 1.0), 1.0).expect("two points"));
    for (i, p) in extreme_points().enumerate() {
        let hard = EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()];
        let all: Vec<Neighbour, 4> = (0..4)
            .map(|k| Neighbour {
                id: k,
                rank: u16::MAX - u16::from(k),
                position: p,
                velocity: p * 0.5,
                age_s: hard,
                progress_m: (k > 1).then_some(hard),
                ..Neighbour::default()
            })
            .collect();
        let gates = [hard, p.x, -hard].map(|at_m| planner_core::flight::Gate {
            at_m,
            wait_for_id: 2,
            open_from_progress_m: p.y,
        });
        for method in [Method::Off, Method::Algorithm2, Method::Priority] {
            let cfg = DeconflictConfig {
                method,
                safety_distance_m: 1.5,
                cruise_mps: 2.0,
                accel_mps2: 1.5,
            };
            for path in [&path, &empty] {
                let own =
                    OwnVehicle { rank: 0, position: p, along_m: hard, path, on_detour: i % 2 == 0 };
                let advice =
                    to.call("deconflict::advise", || deconflict::advise(&cfg, &own, &gates, &all));
                assert!((0.0..=1.0).contains(&advice.speed_scale), "{p:?} {hard} {advice:?}");
                to.add(advice.stop_within_m);
                to.call("deconflict::has_late_neighbour", || {
                    deconflict::has_late_neighbour(&cfg, hard, path, &gates, &all)
                });
                let bad = DeconflictConfig { accel_mps2: hard, ..cfg };
                deconflict::advise(&bad, &own, &gates, &all);
                let checked = to.call("deconflict::DeconflictConfig::check", || bad.check());
                assert_eq!(checked.is_ok(), hard > 0.0 && hard.is_finite());
            }
        }
    }
}
