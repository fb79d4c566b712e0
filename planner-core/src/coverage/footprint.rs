//! What a camera that looks straight down sees, and the spacings that follow.
//!
//! Source: CPP eqs. 1, 2, as SPEC §7 has them. Heights and sides in metres.

use fpu::sqrtf;
use libm::tanf;

use super::CoverageError;

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Camera {
    /// A camera given by its diagonal field of view.
    Diagonal {
        /// Across the picture's diagonal, degrees, below 180.
        fov_deg: f32,
        /// Long side by short side.
        aspect: f32,
    },
    /// A camera given by its sensor and focal length.
    Sensor {
        /// Sides of the sensor, millimetres.
        sides_mm: [f32; 2],
        /// Focal length, millimetres.
        focal_mm: f32,
        /// Pixels along both sides.
        pixels: [u32; 2],
    },
}

/// The rectangle on the ground in one picture; the long side lies across the lanes, so that there
/// are the fewest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Along the lanes, metres.
    pub along_m: f32,
    /// Across the lanes, metres.
    pub across_m: f32,
}

/// Spacing of lanes and waypoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The rectangle that one picture shows.
    pub footprint: Footprint,
    /// Between two lanes, metres: at most.
    pub lane_m: f32,
    /// Between two waypoints of a lane, metres: at most.
    pub waypoint_m: f32,
}

impl Camera {
    /// The camera, if every number is positive and finite and the field of view below 180°.
    ///
    /// # Errors
    /// The setting that is wrong.
    pub fn check(&self) -> Result<(), CoverageError> {
        let positive = |name, value: f32| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(CoverageError::Setting(name)),
        };
        match *self {
            Self::Diagonal { fov_deg, aspect } => {
                positive("fov_deg", fov_deg)?;
                positive("aspect", aspect)?;
                if fov_deg >= 180.0 { Err(CoverageError::Setting("fov_deg")) } else { Ok(()) }
            }
            Self::Sensor { sides_mm, focal_mm, pixels } => {
                positive("sensor_mm", sides_mm[0])?;
                positive("sensor_mm", sides_mm[1])?;
                positive("focal_mm", focal_mm)?;
                if pixels.contains(&0) { Err(CoverageError::Setting("pixels")) } else { Ok(()) }
            }
        }
    }

    /// Both sides of the picture on the ground for each metre of height, the longer last.
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

    /// The footprint from `height_m` above the ground.
    ///
    /// # Errors
    /// The setting that is wrong.
    pub fn footprint(&self, height_m: f32) -> Result<Footprint, CoverageError> {
        self.check()?;
        if !(height_m > 0.0 && height_m.is_finite()) {
            return Err(CoverageError::Setting("height_m"));
        }
        let [along, across] = self.ground_sides_per_m();
        Ok(Footprint { along_m: along * height_m, across_m: across * height_m })
    }

    /// The height from which one pixel shows `gsd_m` of ground (ground sampling distance).
    ///
    /// # Errors
    /// The setting that is wrong; `pixels` where the camera is given by its field of view.
    pub fn height_for_gsd(&self, gsd_m: f32) -> Result<f32, CoverageError> {
        self.check()?;
        let Self::Sensor { sides_mm, focal_mm, pixels } = *self else {
            return Err(CoverageError::Setting("pixels"));
        };
        if !(gsd_m > 0.0 && gsd_m.is_finite()) {
            return Err(CoverageError::Setting("gsd_m"));
        }
        Ok(gsd_m * pixels[0] as f32 * focal_mm / sides_mm[0])
    }
}

impl Spacing {
    /// Whether every side is positive and finite, and no gaps are left.
    ///
    /// # Errors
    /// The setting that is wrong, or [`CoverageError::Gaps`].
    pub fn check(&self) -> Result<(), CoverageError> {
        let sides = [
            ("footprint", self.footprint.along_m),
            ("footprint", self.footprint.across_m),
            ("lane_m", self.lane_m),
            ("waypoint_m", self.waypoint_m),
        ];
        crate::all_positive(&sides).map_err(|error| CoverageError::Setting(error.0))?;
        // Spacings that were computed from the footprint may be a rounding above it.
        let beyond = |spacing: f32, side: f32| spacing > side * (1.0 + 1e-5);
        if beyond(self.lane_m, self.footprint.across_m)
            || beyond(self.waypoint_m, self.footprint.along_m)
        {
            return Err(CoverageError::Gaps);
        }
        Ok(())
    }
}
