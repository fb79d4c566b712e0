//! The flash operations that the shell performs, and the restart command.

use super::Companion;
use crate::events::Event;
use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};
use crate::state::State;
use crate::storage::store::{ErasePermission, FlashFault, FlashRequest, Store};
use crate::time::{Duration, Instant};

/// Time since the start after which a companion that has heard no autopilot may erase flash: no
/// autopilot is connected that could be armed.
const ERASE_WITHOUT_AUTOPILOT_AFTER: Duration = Duration::from_secs(10);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Attaches a flash that keeps files, parameters and photographed waypoints, and takes over the
    /// parameters and waypoints stored there. Without a flash there is no FTP, and parameters are
    /// lost at a restart.
    pub fn attach_store(&mut self, store: Store) {
        self.services.attach_store(store);
        let Self { services, mission, config, .. } = self;
        mission.photographed_mut().restore(services.photographed_record(), config.mission_crc);
        self.apply_parameters();
    }

    /// Applies the parameters to the settings, and the settings to guidance.
    pub(crate) fn apply_parameters(&mut self) {
        self.services.apply_parameters(&mut self.config);
        self.guidance.set_limits(&self.config, self.handshake.limits());
    }

    /// The next flash operation for the shell; `None` where there is none. Each is returned once;
    /// its outcome goes to [`Self::handle_flash`]. To be called until it returns `None`, as
    /// [`Self::poll_event`]. An operation may take long: setpoints do not wait for it.
    pub fn poll_flash(&mut self) -> Option<FlashRequest<'_>> {
        let erasing = self.erase_permission();
        self.services.poll_flash(self.now, erasing, &mut self.links)
    }

    /// Handles the outcome of the operation from [`Self::poll_flash`]: the bytes read, none for an
    /// erasure or a program.
    pub fn handle_flash(&mut self, now: Instant, outcome: Result<&[u8], FlashFault>) {
        self.now = now;
        self.services.handle_flash(outcome);
    }

    /// Sectors are erased only on the ground, disarmed, and not while a plan is computed on the
    /// roadmap.
    pub(crate) fn erase_permission(&self) -> ErasePermission {
        let idle = self.mission.state().is_idle();
        let known = self.telemetry.kind.is_some()
            || self.now - Instant::ZERO > ERASE_WITHOUT_AUTOPILOT_AFTER;
        match self.mission.state() {
            _ if self.telemetry.armed => ErasePermission::Forbidden,
            _ if idle && known => ErasePermission::Allowed,
            _ if idle => ErasePermission::NotYet,
            State::Planning => ErasePermission::NotYet,
            _ => ErasePermission::Forbidden,
        }
    }

    /// Handles PREFLIGHT_REBOOT_SHUTDOWN: requests a restart of this companion from the shell,
    /// unless the vehicle is armed. Denies it unless it restarts the onboard computer (`param2` 1),
    /// or names this component with `param1` 1. Returns the MAV_RESULT.
    pub(crate) fn handle_restart_command(&mut self, command: &Command) -> u8 {
        let asked = command.param2 == 1.0 || (command.to_our_component && command.param1 == 1.0);
        if !asked {
            return DENIED;
        }
        if self.telemetry.armed {
            return TEMPORARILY_REJECTED;
        }
        // The queue is full only if the shell does not drain the events: then the sender repeats
        // the command.
        match self.events.push_back(Event::RestartRequested) {
            Ok(()) => ACCEPTED,
            Err(_) => TEMPORARILY_REJECTED,
        }
    }
}
