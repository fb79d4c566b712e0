//! Fast conversion between the mission's ENU frame and the autopilot's NED frame, latitude and
//! longitude, without trigonometry in every step.
//!
//! The exact conversion goes through latitude and longitude, by the autopilot's own projection
//! (`planner_core::geo::frames`). Within 100 m a linear approximation deviates from it by d² / 2R <
//! 1 mm. So a linear approximation about a point near the vehicle is used; it is renewed when the
//! vehicle is 50 m away, and points farther than 100 m are converted exactly.

use nalgebra::{Matrix3, Vector3};
use planner_core::Point;
use planner_core::geo::frames::{self, Geodetic, Projection};

/// Distance of the vehicle from the linear approximation's centre beyond which the approximation is
/// renewed about the vehicle, metres.
const RENEW_BEYOND_M: f64 = 50.0;
/// Distance from the linear approximation's centre beyond which a point is converted exactly,
/// metres.
const LINEAR_WITHIN_M: f64 = 100.0;
/// Half of the distance over which the linear approximation's slopes are computed, metres: whole
/// metres, as the centre has, so that the points are exact in f32.
const SLOPE_HALF_SPAN_M: f64 = 64.0;

/// Conversions between one autopilot's frame (EKF origin and projection) and the mission frame.
#[derive(Clone, Debug)]
pub struct LocalFrame {
    /// Projection that the autopilot uses.
    projection: Projection,
    /// Origin of the mission frame.
    world_origin: Geodetic,
    /// Origin of the autopilot's frame.
    ekf_origin: Geodetic,
    /// Point about which the conversions are linear, ENU metres in the mission frame.
    centre: Vector3<f64>,
    /// `centre` in the autopilot's frame, NED metres.
    centre_ned: Vector3<f64>,
    /// `centre` by latitude, longitude and altitude.
    centre_geodetic: Geodetic,
    /// Change of NED for each metre of ENU.
    ned_slope: Matrix3<f64>,
    /// Change of ENU for each metre of NED.
    enu_slope: Matrix3<f64>,
    /// Change of latitude and longitude (degrees) and altitude (metres) for each metre of ENU.
    geodetic_slope: Matrix3<f64>,
}

impl LocalFrame {
    /// Conversions with a linear approximation about `near` (ENU metres).
    pub fn new(
        projection: Projection,
        world_origin: Geodetic,
        ekf_origin: Geodetic,
        near: Vector3<f64>,
    ) -> Self {
        let mut frame = Self {
            projection,
            world_origin,
            ekf_origin,
            centre: Vector3::zeros(),
            centre_ned: Vector3::zeros(),
            centre_geodetic: world_origin,
            ned_slope: Matrix3::identity(),
            enu_slope: Matrix3::identity(),
            geodetic_slope: Matrix3::zeros(),
        };
        frame.linearise(near);
        frame
    }

    /// The EKF origin.
    pub fn ekf_origin(&self) -> &Geodetic {
        &self.ekf_origin
    }

    /// Moves the EKF origin, as a reset of the estimator does.
    pub fn set_ekf_origin(&mut self, origin: Geodetic) {
        self.ekf_origin = origin;
        self.linearise(self.centre);
    }

    /// Renews the linear approximation if `enu` is more than 50 m from its centre; to be called in
    /// every step.
    pub fn recentre_if_far(&mut self, enu: &Vector3<f64>) {
        if (enu - self.centre).norm_squared() > RENEW_BEYOND_M * RENEW_BEYOND_M {
            self.linearise(*enu);
        }
    }

    /// Converts a point from ENU to NED about the EKF origin, metres.
    pub fn ned_from_enu(&self, enu: &Vector3<f64>) -> Vector3<f64> {
        let d = enu - self.centre;
        if d.norm_squared() < LINEAR_WITHIN_M * LINEAR_WITHIN_M {
            return self.centre_ned + self.ned_slope * d;
        }
        self.exact_ned(enu)
    }

    /// Converts a point from NED about the EKF origin to ENU, metres.
    pub fn enu_from_ned(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        let d = ned - self.centre_ned;
        if d.norm_squared() < LINEAR_WITHIN_M * LINEAR_WITHIN_M {
            return self.centre + self.enu_slope * d;
        }
        self.enu_from_geodetic(&frames::ned_to_geodetic(self.projection, &self.ekf_origin, ned))
    }

    /// Converts a velocity from ENU to NED.
    pub fn ned_velocity_from_enu(&self, enu: &Point) -> Vector3<f64> {
        self.ned_slope * enu.cast::<f64>()
    }

    /// Converts a velocity from NED to ENU.
    pub fn enu_velocity_from_ned(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        self.enu_slope * ned
    }

    /// Converts a point from ENU to latitude, longitude and altitude.
    pub fn geodetic_from_enu(&self, enu: &Vector3<f64>) -> Geodetic {
        let d = enu - self.centre;
        if d.norm_squared() >= LINEAR_WITHIN_M * LINEAR_WITHIN_M {
            return frames::enu_to_geodetic(&self.world_origin, &enu.cast::<f32>());
        }
        let step = self.geodetic_slope * d;
        Geodetic {
            lat_deg: self.centre_geodetic.lat_deg + step.x,
            lon_deg: self.centre_geodetic.lon_deg + step.y,
            alt_m: self.centre_geodetic.alt_m + step.z,
        }
    }

    /// Converts latitude, longitude and altitude to ENU, metres.
    pub fn enu_from_geodetic(&self, position: &Geodetic) -> Vector3<f64> {
        frames::geodetic_to_enu(&self.world_origin, position).cast::<f64>()
    }

    /// Converts a point from ENU to NED through latitude and longitude.
    fn exact_ned(&self, enu: &Vector3<f64>) -> Vector3<f64> {
        let geodetic = frames::enu_to_geodetic(&self.world_origin, &enu.cast::<f32>());
        frames::geodetic_to_ned(self.projection, &self.ekf_origin, &geodetic)
    }

    /// Renews the linear approximation about `near`, rounded to whole metres.
    fn linearise(&mut self, near: Vector3<f64>) {
        // Whole metres are exact in f32, the type of the conversions' arguments.
        self.centre = near.map(libm::round);
        self.centre_ned = self.exact_ned(&self.centre);
        self.centre_geodetic =
            frames::enu_to_geodetic(&self.world_origin, &self.centre.cast::<f32>());
        for axis in 0..3 {
            let mut offset = Vector3::zeros();
            offset[axis] = SLOPE_HALF_SPAN_M;
            let (ahead, behind) = (self.centre + offset, self.centre - offset);
            self.ned_slope.set_column(
                axis,
                &((self.exact_ned(&ahead) - self.exact_ned(&behind)) / (2.0 * SLOPE_HALF_SPAN_M)),
            );
            let a = frames::enu_to_geodetic(&self.world_origin, &ahead.cast::<f32>());
            let b = frames::enu_to_geodetic(&self.world_origin, &behind.cast::<f32>());
            let slope =
                Vector3::new(a.lat_deg - b.lat_deg, a.lon_deg - b.lon_deg, a.alt_m - b.alt_m);
            self.geodetic_slope.set_column(axis, &(slope / (2.0 * SLOPE_HALF_SPAN_M)));
        }
        // The map is a rotation by much less than a degree and a scale near 1: it is invertible
        // wherever it is finite.
        self.enu_slope = self.ned_slope.try_inverse().unwrap_or_else(Matrix3::identity);
    }
}

#[cfg(test)]
mod tests;
