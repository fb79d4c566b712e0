//! The ground that a camera looking straight down shows, and the spacings that follow from it.
//!
//! Source: paper CPP eqs. 1 and 2, as SPEC §7 reads them. Heights and sides in metres.

use fpu::sqrtf;
use libm::tanf;

use super::CoverageError;

/// A camera, by its field of view or by its sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Camera {
    /// A camera given by its diagonal field of view.
    Diagonal {
        /// Field of view across the image's diagonal, degrees, below 180.
        fov_deg: f32,
        /// Ratio of the image's long side to its short side.
        aspect: f32,
    },
    /// A camera given by its sensor and focal length.
    Sensor {
        /// Both sides of the sensor, millimetres.
        sides_mm: [f32; 2],
        /// Focal length, millimetres.
        focal_mm: f32,
        /// Number of pixels along each side, in the order of `sides_mm`.
        pixels: [u32; 2],
    },
}

/// The rectangle of ground that one image shows. Its long side is across the lanes, so that lanes
/// are fewest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Side along the lanes, metres.
    pub along_m: f32,
    /// Side across the lanes, metres.
    pub across_m: f32,
}

/// Spacing of lanes and of waypoints along them, and the footprint for which they are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The rectangle of ground that one image shows.
    pub footprint: Footprint,
    /// Greatest distance between neighbouring lanes, metres.
    pub max_lane_spacing_m: f32,
    /// Greatest distance between neighbouring waypoints of a lane, metres.
    pub max_waypoint_spacing_m: f32,
}

impl Camera {
    /// Checks that every number is positive and finite, and the field of view below 180°.
    ///
    /// # Errors
    /// The name of the setting that is wrong.
    pub fn check(&self) -> Result<(), CoverageError> {
        let positive = |name, value: f32| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(CoverageError::SettingOutOfRange(name)),
        };
        match *self {
            Self::Diagonal { fov_deg, aspect } => {
                positive("fov_deg", fov_deg)?;
                positive("aspect", aspect)?;
                if fov_deg >= 180.0 {
                    Err(CoverageError::SettingOutOfRange("fov_deg"))
                } else {
                    Ok(())
                }
            }
            Self::Sensor { sides_mm, focal_mm, pixels } => {
                positive("sensor_mm", sides_mm[0])?;
                positive("sensor_mm", sides_mm[1])?;
                positive("focal_mm", focal_mm)?;
                if pixels.contains(&0) {
                    Err(CoverageError::SettingOutOfRange("pixels"))
                } else {
                    Ok(())
                }
            }
        }
    }

    /// Both sides of the ground rectangle per metre of height, the shorter first.
    fn ground_sides_per_m(&self) -> [f32; 2] {
        let [a, b] = match *self {
            Self::Diagonal { fov_deg, aspect } => {
                let short = 2.0 * tanf(fov_deg.to_radians() / 2.0) / sqrtf(1.0 + aspect * aspect);
                [short, aspect * short]
            }
            Self::Sensor { sides_mm, focal_mm, .. } => sides_mm.map(|side| side / focal_mm),
        };
        if a <= b { [a, b] } else { [b, a] }
    }

    /// The footprint of an image from `height_m` above the ground.
    ///
    /// # Errors
    /// The name of the setting that is wrong.
    pub fn footprint(&self, height_m: f32) -> Result<Footprint, CoverageError> {
        self.check()?;
        if !(height_m > 0.0 && height_m.is_finite()) {
            return Err(CoverageError::SettingOutOfRange("height_m"));
        }
        let [along, across] = self.ground_sides_per_m();
        Ok(Footprint { along_m: along * height_m, across_m: across * height_m })
    }

    /// The height above ground from which a pixel shows `gsd_m` of ground (ground sampling
    /// distance).
    ///
    /// # Errors
    /// The name of the setting that is wrong; `pixels` for a camera given by its field of view.
    pub fn height_for_gsd(&self, gsd_m: f32) -> Result<f32, CoverageError> {
        self.check()?;
        let Self::Sensor { sides_mm, focal_mm, pixels } = *self else {
            return Err(CoverageError::SettingOutOfRange("pixels"));
        };
        if !(gsd_m > 0.0 && gsd_m.is_finite()) {
            return Err(CoverageError::SettingOutOfRange("gsd_m"));
        }
        Ok(gsd_m * pixels[0] as f32 * focal_mm / sides_mm[0])
    }
}

impl Spacing {
    /// Checks that every number is positive and finite, and that neighbouring images leave no gaps.
    ///
    /// # Errors
    /// The name of the setting that is wrong, or [`CoverageError::Gaps`].
    pub fn check(&self) -> Result<(), CoverageError> {
        let sides = [
            ("footprint", self.footprint.along_m),
            ("footprint", self.footprint.across_m),
            ("lane_m", self.max_lane_spacing_m),
            ("waypoint_m", self.max_waypoint_spacing_m),
        ];
        crate::check_positive(&sides).map_err(|error| CoverageError::SettingOutOfRange(error.0))?;
        // Spacings that were computed from the footprint may exceed it by a rounding.
        let beyond = |spacing: f32, side: f32| spacing > side * (1.0 + 1e-5);
        if beyond(self.max_lane_spacing_m, self.footprint.across_m)
            || beyond(self.max_waypoint_spacing_m, self.footprint.along_m)
        {
            return Err(CoverageError::Gaps);
        }
        Ok(())
    }
}
