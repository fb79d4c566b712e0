//! Obstacles that are not on the map, which a ground station reports.

use heapless::Vec;
use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::geo::frames::{self, Geodetic};
use planner_core::{Length, Point};

use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};

/// Maximum number of reported obstacles.
pub(crate) const MAX_OBSTACLES: usize = 16;
/// Greatest radius of a reported obstacle, metres: a wrong digit must not close a whole building.
pub(crate) const MAX_OBSTACLE_RADIUS_M: f32 = 20.0;
/// An obstacle whose centre is nearer than this to that of a known one is the same, reported again
/// or revoked, metres.
const SAME_OBSTACLE_M: f32 = 0.1;

/// Reported obstacles; the first `avoided_count` of them are avoided by the detour that is flown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Obstacles {
    /// The obstacles, in the order of their reports.
    known: Vec<KeepOutZone, MAX_OBSTACLES>,
    /// Number of obstacles that the detour avoids.
    avoided_count: usize,
    /// Number of obstacles known when a detour was last requested: the detour does not avoid later
    /// ones.
    requested_count: usize,
}

impl Obstacles {
    /// Number of reported obstacles.
    pub(crate) fn count(&self) -> usize {
        self.known.len()
    }

    /// Removes every obstacle whose centre is at this place.
    fn remove_at(&mut self, centre: &Point) {
        while let Some(at) =
            self.known.iter().position(|o| (o.from - centre).length() < SAME_OBSTACLE_M)
        {
            self.known.remove(at);
            self.avoided_count -= usize::from(at < self.avoided_count);
            self.requested_count -= usize::from(at < self.requested_count);
        }
    }

    /// Handles the command that reports an obstacle; returns the MAV_RESULT. The command's place is
    /// the centre, `param1` the radius, metres, to which the required clearance is added; `origin`
    /// is the mission frame's. A radius of zero or less revokes the obstacle there. An obstacle
    /// stays until revoked, or until the companion starts again: a wall does not go away by itself.
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
        let reported = |o: &KeepOutZone| {
            (o.from - centre).length() < SAME_OBSTACLE_M && o.radius_m >= radius_m
        };
        if self.known.iter().any(reported) {
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

    /// Obstacles that the detour flown now does not avoid: these may block the path.
    pub(crate) fn unavoided(&self) -> &[KeepOutZone] {
        &self.known[self.avoided_count..]
    }

    /// Makes all obstacles count as new: the path changes to one that avoids none of them.
    pub(crate) fn forget_avoided(&mut self) {
        self.avoided_count = 0;
    }

    /// Notes that a detour around all obstacles known now is requested from the shell.
    pub(crate) fn mark_requested(&mut self) {
        self.requested_count = self.known.len();
    }

    /// Notes that the requested detour is flown: the obstacles known at the request are avoided.
    pub(crate) fn mark_requested_avoided(&mut self) {
        self.avoided_count = self.requested_count;
    }
}

#[cfg(test)]
pub(crate) mod tests;
