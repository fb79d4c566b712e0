//! The door over random paths, paces and steps: what it makes of them is finite, smooth, inside the fence and on the path.

extern crate std;

use planner_core::deconflict::Advice;
use planner_core::path::{self, Path, TrackConfig, Tracker};
use proptest::prelude::*;

use super::*;

const LIMITS: Limits = Limits {
    speed_mps: 2.0,
    climb_mps: 1.0,
    descend_mps: 1.0,
    accel_mps2: 1.5,
    accel_z_mps2: 1.5,
    jerk_mps3: 4.0,
};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn setpoints_are_smooth_whatever_the_pace(
        corners in proptest::collection::vec((-6.0f32..6.0, -6.0f32..6.0, -2.0f32..2.0), 1..10),
        origin in -500.0f32..500.0,
        paces in proptest::collection::vec((0u8..4, 0.0f32..1.0, 1u16..80), 1..20),
        late in proptest::collection::vec(0.03f32..0.25, 1..16),
        fenced in any::<bool>(),
    ) {
        let mut path = Path::<16>::new();
        let mut place = Point::new(origin, -origin, 3.0);
        path.push(place, 0.8).unwrap();
        for (x, y, z) in &corners {
            place += Point::new(*x, *y, *z);
            path.push(place, 0.8).unwrap();
        }
        let first = path.point_at(0.0).unwrap();
        let fence = fenced.then(|| (first - Point::new(5.0, 5.0, 1.0), first + Point::new(5.0, 5.0, 1.0)));
        let cfg = TrackConfig::default();
        let (mut tracker, mut door) = (Tracker::default(), Door::new(LIMITS, fence));
        door.reset(first);
        let (mut urgent_before, mut above, mut checked) = (false, 0, 0);
        for (step, (kind, share, steps)) in
            paces.iter().flat_map(|p| (0..p.2).map(move |_| (p.0, p.1, p.2))).enumerate()
        {
            let pace = match kind {
                0 => Pace { share: 0.0, urgent: false },
                1 => Pace { share: 0.0, urgent: true },
                2 => Pace { share, urgent: false },
                _ => Pace { share: 1.0, urgent: false },
            };
            // Most steps are on time.
            let dt_s = if step % 7 == 0 { late[step % late.len()] } else { TICK_S };
            let (at, velocity, acceleration) = (door.position(), door.velocity(), door.acceleration());
            for _ in 0..door.begin(pace, dt_s) {
                let advice = if steps % 3 == 0 { Advice { stop_within_m: 0.0, ..Advice::FREE } } else { Advice::FREE };
                let reference = path::advance(&cfg, &path, &mut tracker, &advice, TICK_S).unwrap();
                door.push(reference.position);
            }
            door.finish();
            let dt_s = dt_s.min(0.2);
            let moved = (door.position() - at).norm();
            prop_assert!(moved <= 2.0 * dt_s + 3e-3, "{moved} m in {dt_s} s");
            // The velocity is that of the positions.
            let mean = (door.velocity() + velocity) * 0.5;
            let off = ((door.position() - at) / dt_s - mean).norm();
            prop_assert!(off < 0.02 + 0.12 * dt_s / TICK_S * dt_s / TICK_S, "velocity off by {off} m/s in {dt_s} s");
            let accel = door.acceleration().norm();
            prop_assert!(accel < 2.8, "{accel} m/s²");
            if fence.is_none() && dt_s <= 0.06 {
                let jerk = (door.acceleration() - acceleration).norm() / dt_s.max(0.02);
                let most = if door.stopping || urgent_before { 8.0 } else { 4.0 };
                // Where the clock meets its end or a pace turns in a corner, a step may exceed the limit.
                prop_assert!(jerk < most * 3.0, "{jerk} m/s³ of {most}, {pace:?}");
                above += u32::from(jerk > most * 1.05);
                checked += 1;
            }
            urgent_before = door.stopping;
            if let Some((low, high)) = fence {
                prop_assert!((0..3).all(|a| door.position()[a] >= low[a] - 1e-3 && door.position()[a] <= high[a] + 1e-3));
            }
            // Corners are rounded, stops are not overshot: never far from the path that the raw point has drawn.
            if fence.is_none() && step % 16 == 0 {
                let place = door.position();
                let near = path.project(&place, tracker.along_m, path.length_m());
                let off = (path.point_at(near).unwrap() - place).norm();
                prop_assert!(off < 0.25, "{off} m off the path");
            }
        }
        prop_assert!(above <= 8 + checked / 20, "{above} of {checked} steps above the jerk");
    }
}
