//! The smoother over random paths, paces and step lengths: its setpoints are finite, smooth, inside
//! the fence and on the path.

extern crate std;

use planner_core::flight::Path;
use planner_core::track::deconflict::Advice;
use planner_core::track::{self, ReferenceState, TrackConfig};
use proptest::prelude::*;

use super::*;

const LIMITS: MotionLimits = MotionLimits {
    speed_mps: 2.0,
    climb_mps: 1.0,
    descend_mps: 1.0,
    accel_mps2: 1.5,
    accel_z_mps2: 1.5,
    max_setpoint_accel_mps2: [2.25, 2.0],
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
        let fence =
            fenced.then(|| (first - Point::new(5.0, 5.0, 1.0), first + Point::new(5.0, 5.0, 1.0)));
        let cfg = TrackConfig::default();
        let (mut state, mut smoother) =
            (ReferenceState::default(), SetpointSmoother::new(LIMITS, fence));
        smoother.begin_at(first, 0.0);
        for (step, (kind, share, steps)) in
            paces.iter().flat_map(|p| (0..p.2).map(move |_| (p.0, p.1, p.2))).enumerate()
        {
            let pace = match kind {
                0 => ClockPace { speed_share: 0.0, urgency: Urgency::Smooth },
                1 => ClockPace { speed_share: 0.0, urgency: Urgency::Urgent },
                2 => ClockPace { speed_share: share, urgency: Urgency::Smooth },
                _ => ClockPace { speed_share: 1.0, urgency: Urgency::Smooth },
            };
            // Most steps are on time.
            let dt_s = if step % 7 == 0 { late[step % late.len()] } else { TICK_S };
            let (at, velocity, acceleration) =
                (smoother.position(), smoother.velocity(), smoother.acceleration());
            for _ in 0..smoother.begin_step(pace, dt_s) {
                let mut advice = Advice {
                    stop_within_m: if steps % 3 == 0 { 0.0 } else { f32::INFINITY },
                    ..Advice::FREE
                };
                // Guidance stops before the fence.
                let v = state.speed_mps;
                let braking_m = v * v / 3.0 + 2.0 * v * TICK_S + 0.05;
                if path
                    .point_at(state.along_m + braking_m)
                    .is_some_and(|ahead| !smoother.is_within_fence_slack(&ahead))
                {
                    advice.stop_within_m = advice.stop_within_m.min(braking_m);
                }
                let reference = track::advance(&cfg, &path, &mut state, &advice, TICK_S).unwrap();
                smoother.push_raw_point(reference.position);
            }
            smoother.make_setpoint();
            let dt_s = dt_s.min(0.2);
            let place = smoother.position();
            let moved = (smoother.position() - at).norm();
            prop_assert!(moved <= 2.1 * dt_s + 1e-3, "{moved} m in {dt_s} s");
            // The velocity agrees with the change of the positions.
            let mean = (smoother.velocity() + velocity) * 0.5;
            let off = ((smoother.position() - at) / dt_s - mean).norm();
            prop_assert!(
                off < 0.02 + 0.12 * dt_s / TICK_S * dt_s / TICK_S,
                "velocity off by {off} m/s in {dt_s} s"
            );
            let a = smoother.acceleration();
            let [across, up] = LIMITS.max_setpoint_accel_mps2;
            prop_assert!(a.xy().norm() <= across + 1e-4 && a.z.abs() <= up + 1e-4, "{a:?}");
            let jerk = (a - acceleration).norm() / dt_s;
            let most = LIMITS.jerk(smoother.urgency);
            prop_assert!(jerk <= most * 1.001 + 1e-3, "{jerk} m/s³ of {most}, {pace:?}");
            if let Some((low, high)) = fence {
                prop_assert!((0..3).all(|a| place[a] >= low[a] && place[a] <= high[a]));
            }
            // Corners are rounded, stops are not overshot: the setpoint is never far from the path
            // that the raw point has flown, though every seventh step of a hairpin is late.
            if fence.is_none() && step % 16 == 0 {
                let place = smoother.position();
                let near = path.project(&place, state.along_m, path.length_m());
                let off = (path.point_at(near).unwrap() - place).norm();
                prop_assert!(off < 0.3, "{off} m off the path");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]
    /// Setpoints stay inside the fence and smooth, whatever the raw point does beside the fence and
    /// with whatever motion the setpoint reached it.
    #[test]
    fn the_fence_is_kept_without_a_jerk(
        size in (2.0f32..30.0, 2.0f32..30.0, 1.0f32..10.0),
        share in (0.0f32..1.0, 0.0f32..1.0, 0.0f32..1.0),
        came_at in (-3.0f32..3.0, -3.0f32..3.0, -2.0f32..2.0),
        targets in proptest::collection::vec(
            (-0.2f32..1.2, -0.2f32..1.2, -0.2f32..1.2, 0.2f32..2.0, 1u16..60),
            1..12,
        ),
        paces in proptest::collection::vec((0u8..4, 0.0f32..1.0), 1..40),
        late in proptest::collection::vec(0.03f32..0.25, 1..16),
        slow_climber in any::<bool>(),
    ) {
        let limits = if slow_climber {
            MotionLimits { accel_z_mps2: 1.0, max_setpoint_accel_mps2: [2.25, 1.0], ..LIMITS }
        } else {
            LIMITS
        };
        let (low, size) = (Point::new(-7.0, 12.0, 0.0), Point::new(size.0, size.1, size.2));
        let high = low + size;
        let mut smoother = SetpointSmoother::new(limits, Some((low, high)));
        let came_at = Point::new(came_at.0, came_at.1, came_at.2);
        let place = low + size.component_mul(&Point::new(share.0, share.1, share.2));
        for step in 0..8 {
            smoother.follow_vehicle(place + came_at * (TICK_S * step as f32), TICK_S);
            smoother.mark_sent();
        }
        smoother.brake_from_velocity(&came_at);
        let mut step = 0;
        for (x, y, z, speed_mps, steps) in targets {
            let target = low + size.component_mul(&Point::new(x, y, z));
            for _ in 0..steps {
                step += 1;
                let (kind, share) = paces[step % paces.len()];
                let pace = match kind {
                    0 if step % 3 == 0 => ClockPace { speed_share: 0.0, urgency: Urgency::Urgent },
                    0 => ClockPace { speed_share: 0.0, urgency: Urgency::Smooth },
                    1 => ClockPace { speed_share: share, urgency: Urgency::Smooth },
                    _ => ClockPace { speed_share: 1.0, urgency: Urgency::Smooth },
                };
                let dt_s = if step % 7 == 0 { late[step % late.len()] } else { TICK_S };
                let before = smoother.acceleration();
                for _ in 0..smoother.begin_step(pace, dt_s) {
                    let raw = smoother.raw_point();
                    smoother.push_raw_point(raw + clamp_length(target - raw, speed_mps * TICK_S));
                }
                smoother.make_setpoint();
                let place = smoother.position();
                prop_assert!(
                    (0..3).all(|a| place[a] >= low[a] && place[a] <= high[a]),
                    "{place:?}"
                );
                let a = smoother.acceleration();
                let [across, up] = limits.max_setpoint_accel_mps2;
                // Two axes that begin to brake at once pass the disc's edge by a hair.
                prop_assert!(a.xy().norm() <= across * 1.02 && a.z.abs() <= up + 1e-3, "{a:?}");
                let jerk = (a - before).norm() / dt_s.min(0.2);
                let most = limits.jerk(smoother.urgency);
                prop_assert!(
                    jerk <= most * 1.001 + 1e-3,
                    "{jerk} m/s³ of {most} at {place:?} of {low:?} {high:?}"
                );
            }
        }
    }
}
