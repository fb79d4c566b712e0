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
    most_mps2: [2.25, 2.0],
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
                let mut advice = Advice { stop_within_m: if steps % 3 == 0 { 0.0 } else { f32::INFINITY }, ..Advice::FREE };
                // Guidance stops before the fence.
                let v = tracker.speed_mps;
                let braking_m = v * v / 3.0 + 2.0 * v * TICK_S + 0.05;
                if path.point_at(tracker.along_m + braking_m).is_some_and(|ahead| !door.allows(&ahead)) {
                    advice.stop_within_m = advice.stop_within_m.min(braking_m);
                }
                let reference = path::advance(&cfg, &path, &mut tracker, &advice, TICK_S).unwrap();
                door.push(reference.position);
            }
            door.finish();
            let dt_s = dt_s.min(0.2);
            // The fence comes before smoothness.
            let place = door.position();
            let held = fence.is_some_and(|(low, high)| (0..3).any(|i| place[i] == low[i] || place[i] == high[i]));
            let moved = (door.position() - at).norm();
            prop_assert!(moved <= 2.1 * dt_s + 1e-3, "{moved} m in {dt_s} s");
            // The velocity is that of the positions.
            let mean = (door.velocity() + velocity) * 0.5;
            let off = ((door.position() - at) / dt_s - mean).norm();
            prop_assert!(held || off < 0.02 + 0.12 * dt_s / TICK_S * dt_s / TICK_S, "velocity off by {off} m/s in {dt_s} s");
            let a = door.acceleration();
            let [across, up] = LIMITS.most_mps2;
            prop_assert!(a.xy().norm() <= across + 1e-4 && a.z.abs() <= up + 1e-4, "{a:?}");
            let jerk = (a - acceleration).norm() / dt_s;
            let most = LIMITS.jerk(door.stopping);
            prop_assert!(held || jerk <= most * 1.001 + 1e-3, "{jerk} m/s³ of {most}, {pace:?}");
            if let Some((low, high)) = fence {
                prop_assert!((0..3).all(|a| place[a] >= low[a] && place[a] <= high[a]));
            }
            // Corners are rounded, stops are not overshot: never far from the path that the raw point has drawn.
            if fence.is_none() && step % 16 == 0 {
                let place = door.position();
                let near = path.project(&place, tracker.along_m, path.length_m());
                let off = (path.point_at(near).unwrap() - place).norm();
                prop_assert!(off < 0.25, "{off} m off the path");
            }
        }
    }
}
