//! When a simulation ends.

use companion::State;

use super::simulated_vehicle::{SimulatedVehicle, is_finished, is_started};
use super::{SimulationRun, is_left_to_pilot};

/// Simulated time after the last vehicle is done, before the simulation ends, seconds.
const AFTERMATH_S: f64 = 1.0;
/// Time without any armed vehicle, after all faults, after which no vehicle is expected to fly any
/// more, seconds: longer than from a gate's opening to the take-off.
const END_AFTER_STANDSTILL_S: f64 = 30.0;

impl SimulationRun<'_> {
    /// Sets the end of the simulation once no vehicle is expected to move any more, and withdraws
    /// it while one flies again that its pilot gave back.
    pub(super) fn update_end(&mut self) {
        let (vehicles, plan) = (&self.vehicles, self.plan);
        let started = self.ground_station.is_start_commanded();
        let done = |i: usize| {
            let at_rest = is_finished(vehicles[i].state()) || vehicles[i].is_powerless();
            let has_no_goal = !plan.flights[i].task.leaves_pad();
            at_rest
                || (has_no_goal && started && !is_started(vehicles[i].state()))
                || is_left_to_pilot(&vehicles[i])
        };
        let still = |v: &SimulatedVehicle| !v.autopilot.true_state().armed || is_left_to_pilot(v);
        if !(self.script.has_no_change_left() && started && vehicles.iter().all(still)) {
            self.last_active_s = self.t_s;
        }
        // In a coverage mission vehicles on the ground wait until a lost vehicle is down.
        let still_s = END_AFTER_STANDSTILL_S + f64::from(vehicles[0].lost_vehicle_down_after_s());
        let over = (0..vehicles.len()).all(done) || self.t_s - self.last_active_s > still_s;
        if (0..vehicles.len()).any(|i| self.is_to_come_down(i)) {
            self.ends_at_s = f64::INFINITY;
        } else if self.ends_at_s.is_infinite() && self.script.has_no_change_left() && over {
            self.ends_at_s = self.t_s + AFTERMATH_S;
        }
    }

    /// Whether the vehicle is in the air, armed, and its companion or autopilot flies it, or will
    /// once it hears the command to continue that is being sent.
    fn is_to_come_down(&self, i: usize) -> bool {
        let (vehicle, truth) = (&self.vehicles[i], self.vehicles[i].autopilot.true_state());
        let resumes = vehicle.state() == State::PilotReturned && self.ground_station.resumes(i);
        truth.armed && !truth.touching && (!is_left_to_pilot(vehicle) || resumes)
    }
}

#[cfg(test)]
mod tests;
