//! Standstills in flight, and which of them count as deadlocks.

use super::{Incident, Observation, Referee, RefereePhase};

/// Time without progress in flight that counts as a deadlock, seconds.
const DEADLOCK_S: f64 = 20.0;
/// Longest wait for a vehicle out of radio range, seconds: 45 until it counts as lost, and a
/// reserve.
const MAX_OUT_OF_RANGE_WAIT_S: f64 = 60.0;
/// Least increase of arc length along the path that counts as progress, metres.
const MIN_COUNTED_PROGRESS_M: f32 = 0.1;
/// Distance from its last place of progress at which a vehicle that reports no progress counts as
/// moving, metres: more than it sways in hover.
const MOVED_FROM_HOVER_M: f32 = 1.0;

impl Referee<'_> {
    /// Counts vehicle `i`'s standstill as a deadlock once it has lasted too long. A vehicle that
    /// stands by command is in none; but whether one that was counted before ends, only its flight
    /// after that command shows.
    pub(super) fn watch_progress(&mut self, i: usize, t_s: f64, now: &Observation) {
        let vehicle = &mut self.vehicles[i];
        // Progress decreases only if it is now counted along another path.
        let on_other_path = now
            .progress_m
            .filter(|progress_m| *progress_m < vehicle.best_progress_m - MOVED_FROM_HOVER_M);
        if let Some(progress_m) = on_other_path {
            vehicle.best_progress_m = progress_m - MOVED_FROM_HOVER_M;
        }
        let moved = match now.progress_m {
            Some(progress_m) => progress_m > vehicle.best_progress_m + MIN_COUNTED_PROGRESS_M,
            None => (now.position - vehicle.progress_position).norm() > MOVED_FROM_HOVER_M,
        };
        // A vehicle whose power fails may have waited for a good reason.
        let ends = now.phase != RefereePhase::Flying || (moved && !now.holds_by_command);
        if ends || now.holds_by_command {
            vehicle.best_progress_m =
                now.progress_m.unwrap_or(f32::NEG_INFINITY).max(vehicle.best_progress_m);
            vehicle.progress_position = now.position;
            if vehicle.in_deadlock && !ends {
                vehicle.deadlock_held_since_s.get_or_insert(t_s);
                return;
            }
            let until_s = vehicle.deadlock_held_since_s.take().unwrap_or(t_s);
            let stood_s = until_s - std::mem::replace(&mut vehicle.last_progress_s, t_s);
            if std::mem::take(&mut vehicle.in_deadlock) {
                let waited = moved && stood_s <= MAX_OUT_OF_RANGE_WAIT_S;
                if self.retracts_ended_deadlocks || (waited && self.retracts_out_of_range_waits) {
                    self.retract_deadlock(i, stood_s);
                }
            }
            return;
        }
        if let Some(since_s) = vehicle.deadlock_held_since_s.take() {
            vehicle.last_progress_s += t_s - since_s;
        }
        if t_s - vehicle.last_progress_s > DEADLOCK_S && !vehicle.in_deadlock {
            vehicle.in_deadlock = true;
            self.deadlocks += 1;
            self.incidents.push(Incident::new(t_s, i, no_progress_text()));
        }
    }

    /// Retracts vehicle `i`'s deadlock, in which it stood for `stood_s`: it has ended.
    fn retract_deadlock(&mut self, i: usize, stood_s: f64) {
        self.deadlocks -= 1;
        let counted = |to: &&mut Incident| to.vehicle == i && to.text == no_progress_text();
        if let Some(incident) = self.incidents.iter_mut().rfind(counted) {
            incident.retracted = true;
            incident.text = format!("stood for {stood_s:.0} s");
        }
    }
}

/// What the log says of a deadlock.
fn no_progress_text() -> String {
    format!("no progress for {DEADLOCK_S} s")
}
