//! Checks whether a companion's settings can be flown.

use planner_core::Point;

use super::{CheckedConfig, Config, ConfigError, RosterEntry, box_contains};
use crate::autopilot::AutopilotKind;
use crate::config::limits::GuidanceLimits;

impl<const V: usize> Config<V> {
    /// The settings as [`CheckedConfig`], with the vehicle's start, if [`Self::check`] accepts
    /// them.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn checked(self) -> Result<CheckedConfig<V>, ConfigError> {
        self.check()?;
        let (_, own) = self.own_roster_entry().ok_or(ConfigError::NotInRoster)?;
        Ok(CheckedConfig { path_start: own.path_start, config: self })
    }

    /// Checks ids, order of the roster, ranges of all numbers, geofence, and limits with both
    /// autopilot kinds' defaults; the first error found is returned.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.system_id == 0 || self.own_roster_entry().is_none() {
            return Err(ConfigError::NotInRoster);
        }
        if self.roster.iter().any(|e| e.system_id == 0)
            || self.roster.windows(2).any(|pair| pair[0].system_id >= pair[1].system_id)
        {
            return Err(ConfigError::RosterOrder);
        }
        let positive = [
            self.cruise_mps,
            self.slowest_vehicle_mps,
            self.fastest_vehicle_mps,
            self.climb_mps,
            self.descend_mps,
            self.accel_mps2,
            self.radius_m,
            self.required_clearance_m,
            self.safety_distance_m,
            self.start_tolerance_m,
            self.min_estimate_error_m,
            self.radio_range_m,
        ];
        let starts = self.roster.iter().flat_map(|e| e.path_start.iter());
        let bad = positive.iter().any(|v| !(v.is_finite() && *v > 0.0)) || self.swarm_hz == 0;
        if bad || starts.into_iter().any(|c| !c.is_finite()) {
            return Err(ConfigError::NotPositive);
        }
        if !self.origin.is_valid() {
            return Err(ConfigError::Origin);
        }
        let sound = |(low, high): (Point, Point)| {
            (0..3).all(|a| low[a].is_finite() && high[a].is_finite() && low[a] <= high[a])
        };
        if !self.geofence.is_none_or(sound) {
            return Err(ConfigError::Geofence);
        }
        let inside = |entry: &&RosterEntry| {
            self.geofence.is_none_or(|fence| box_contains(&fence, &entry.path_start))
        };
        if let Some(outside) = self.roster.iter().find(|entry| !inside(entry)) {
            return Err(ConfigError::StartOutside(outside.system_id));
        }
        for kind in [AutopilotKind::Px4, AutopilotKind::ArduPilot] {
            let limits = GuidanceLimits::new(self, &kind.default_limits());
            limits.check().map_err(|error| ConfigError::Setting(error.0))?;
        }
        Ok(())
    }
}
