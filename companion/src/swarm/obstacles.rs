//! Obstacles that were not on the map, reported by a ground station.

use heapless::Vec;
use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::frames::{self, Geodetic};
use planner_core::{Length, Point};

use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};

/// Most reported obstacles that were not on the map.
pub(crate) const MAX_OBSTACLES: usize = 16;
/// Greatest radius of a reported obstacle, metres: a wrong digit must not close a whole building.
pub(crate) const MAX_OBSTACLE_RADIUS_M: f32 = 20.0;
/// Two obstacles nearer than this are one that was sent twice, metres; a revocation this near an
/// obstacle revokes it.
const SAME_OBSTACLE_M: f32 = 0.1;

/// Obstacles that were not on the map, and for how many of them a detour was planned.
#[derive(Clone, Debug, Default)]
pub(crate) struct Obstacles {
    known: Vec<KeepOutZone, MAX_OBSTACLES>,
    avoided: usize,
    /// Number of obstacles known when a detour was last requested: the detour does not avoid those
    /// that came later.
    requested: usize,
}

impl Obstacles {
    /// Number of obstacles.
    pub(crate) fn count(&self) -> usize {
        self.known.len()
    }

    /// Forgets the obstacle at this place.
    fn remove_at(&mut self, centre: &Point) {
        while let Some(at) =
            self.known.iter().position(|o| (o.from - centre).length() < SAME_OBSTACLE_M)
        {
            self.known.remove(at);
            self.avoided -= usize::from(at < self.avoided);
            self.requested -= usize::from(at < self.requested);
        }
    }

    /// Takes an obstacle that is not on the map, ENU about `origin`: its centre, and its radius, to
    /// which the required clearance is added; a radius that is not above zero revokes the one at
    /// that place. It stays until revoked, or until the companion starts again: a wall does not go
    /// away by itself.
    pub(crate) fn handle_command(
        &mut self,
        command: &Command,
        origin: &Geodetic,
        clearance_m: f32,
    ) -> u8 {
        let Some((lat, lon, alt_m)) = command.place else { return DENIED };
        let (lat_deg, lon_deg) = (f64::from(lat) * 1e-7, f64::from(lon) * 1e-7);
        let place = Geodetic { lat_deg, lon_deg, alt_m: f64::from(alt_m) };
        if !(place.is_valid() && command.param1 <= MAX_OBSTACLE_RADIUS_M) {
            return DENIED;
        }
        let centre = frames::geodetic_to_enu(origin, &place);
        if command.param1 <= 0.0 {
            self.remove_at(&centre);
            return ACCEPTED;
        }
        let radius_m = command.param1 + clearance_m;
        let told = |o: &KeepOutZone| {
            (o.from - centre).length() < SAME_OBSTACLE_M && o.radius_m >= radius_m
        };
        if self.known.iter().any(told) {
            return ACCEPTED;
        }
        match self.known.push(KeepOutZone {
            from: centre,
            to: centre,
            radius_m,
            kind: ZoneKind::Static,
        }) {
            Ok(()) => ACCEPTED,
            Err(_) => TEMPORARILY_REJECTED,
        }
    }

    /// All reported obstacles.
    pub(crate) fn all(&self) -> &[KeepOutZone] {
        &self.known
    }

    /// Obstacles that no detour was planned around.
    pub(crate) fn new_ones(&self) -> &[KeepOutZone] {
        &self.known[self.avoided..]
    }

    /// No detour around any obstacle has been planned.
    pub(crate) fn forget_avoided(&mut self) {
        self.avoided = 0;
    }

    /// Notes that a detour around all obstacles known now is requested.
    pub(crate) fn mark_requested(&mut self) {
        self.requested = self.known.len();
    }

    /// The requested detour has come.
    pub(crate) fn avoid_requested(&mut self) {
        self.avoided = self.requested;
    }
}

#[cfg(test)]
pub(crate) mod tests;
