//! Calls on cameras and on spacings of lanes and waypoints, with extreme and invalid arguments.

use planner_core::coverage::CoverageError;
use planner_core::coverage::footprint::{Camera, Footprint, Spacing};

use super::limits_results::{CallListener, EXTREME_NUMBERS, Results, is_positive_and_finite};

pub(super) const SPACING: Spacing = Spacing {
    footprint: Footprint { along_m: 10.0, across_m: 10.0 },
    max_lane_spacing_m: 10.0,
    max_waypoint_spacing_m: 10.0,
};

pub(super) fn call_cameras(to: &mut Results<'_, impl CallListener>) {
    let pixels = [6000, 4000];
    for hard in EXTREME_NUMBERS {
        for camera in [
            Camera::Diagonal { fov_deg: 73.7, aspect: 1.5 },
            Camera::Diagonal { fov_deg: hard, aspect: 1.5 },
            Camera::Diagonal { fov_deg: 73.7, aspect: hard },
            Camera::Sensor { sides_mm: [hard, 15.6], focal_mm: 16.0, pixels },
            Camera::Sensor { sides_mm: [23.5, hard], focal_mm: 16.0, pixels },
            Camera::Sensor { sides_mm: [23.5, 15.6], focal_mm: hard, pixels },
            Camera::Sensor { sides_mm: [23.5, 15.6], focal_mm: 16.0, pixels: [0, u32::MAX] },
        ] {
            let checked = to.call("footprint::Camera::check", || camera.check());
            let seen = to.call("footprint::Camera::footprint", || camera.footprint(hard));
            let height_m =
                to.call("footprint::Camera::height_for_gsd", || camera.height_for_gsd(hard));
            assert!(checked.is_ok() || seen.is_err() && height_m.is_err());
            assert!(is_positive_and_finite(hard) || seen.is_err() && height_m.is_err());
            let Ok(footprint) = seen else { continue };
            to.add(footprint.along_m);
            to.add(footprint.across_m);
            to.add(height_m.unwrap_or(0.0));
            let spacing =
                Spacing { footprint, max_lane_spacing_m: hard, max_waypoint_spacing_m: 1.0 };
            let checked = check_spacing(to, &spacing).is_ok();
            to.add_count(usize::from(checked));
        }
        for spacing in [
            Spacing { max_lane_spacing_m: hard, ..SPACING },
            Spacing { max_waypoint_spacing_m: hard, ..SPACING },
            Spacing { footprint: Footprint { along_m: hard, across_m: hard }, ..SPACING },
        ] {
            assert!(is_positive_and_finite(hard) || check_spacing(to, &spacing).is_err());
        }
    }
}

fn check_spacing(
    to: &mut Results<'_, impl CallListener>,
    spacing: &Spacing,
) -> Result<(), CoverageError> {
    to.call("footprint::Spacing::check", || spacing.check())
}
