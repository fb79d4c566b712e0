//! The shell's flash, and the commands that concern the board.

use super::Companion;
use crate::events::Event;
use crate::link::commands::{ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED};
use crate::mission::State;
use crate::storage::store::{ErasePermission, FlashFault, FlashRequest, Store};
use crate::time::{Duration, Instant};

/// Time after the start at which a board that has heard no autopilot has none that could be armed.
const NO_AUTOPILOT_AFTER: Duration = Duration::from_secs(10);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Gives it a flash to keep its files and parameters in, and uses those; without one there are
    /// no files, and parameters are forgotten.
    pub fn attach_store(&mut self, store: Store) {
        self.services.attach_store(store);
        let Self { services, mission, config, .. } = self;
        mission.photographed_mut().restore(services.photographed(), config.mission_crc);
        self.apply_parameters();
    }

    /// Puts the parameters to use.
    pub(crate) fn apply_parameters(&mut self) {
        self.services.apply_parameters(&mut self.config);
        self.guidance.set_limits(&self.config, self.requests.limits());
    }

    /// What the shell has to do with the flash next; once each, then [`Self::handle_flash`] takes
    /// the result. Drained like the other `poll_*`, but it may take long: nothing else waits for
    /// it.
    pub fn poll_flash(&mut self) -> Option<FlashRequest<'_>> {
        let erasing = self.erase_permission();
        self.services.poll_flash(self.now, erasing, &mut self.links)
    }

    /// Handles how the flash did what [`Self::poll_flash`] asked for: the bytes read, none for an
    /// erasure or a program.
    pub fn handle_flash(&mut self, now: Instant, outcome: Result<&[u8], FlashFault>) {
        self.now = now;
        self.services.handle_flash(outcome);
    }

    /// Sectors are erased only on the ground, disarmed, and not while the roadmap is planned on.
    pub(crate) fn erase_permission(&self) -> ErasePermission {
        let idle = matches!(
            self.mission.state(),
            State::WaitAutopilot
                | State::WaitPosition
                | State::Ready
                | State::Done
                | State::Aborted
        );
        let known = self.telemetry.kind.is_some() || self.now - Instant::ZERO > NO_AUTOPILOT_AFTER;
        match self.mission.state() {
            _ if self.telemetry.armed => ErasePermission::Forbidden,
            _ if idle && known => ErasePermission::Allowed,
            _ if idle => ErasePermission::NotYet,
            State::Planning => ErasePermission::NotYet,
            _ => ErasePermission::Forbidden,
        }
    }

    /// PREFLIGHT_REBOOT_SHUTDOWN: this companion restarts, unless the vehicle is armed.
    pub(crate) fn handle_restart_command(&mut self, command: &Command) -> u8 {
        let asked = command.param2 == 1.0 || (command.to_component && command.param1 == 1.0);
        if !asked {
            return DENIED;
        }
        if self.telemetry.armed {
            return TEMPORARILY_REJECTED;
        }
        // Full only if the shell does not drain: then it is asked again.
        match self.events.push_back(Event::RestartRequested) {
            Ok(()) => ACCEPTED,
            Err(_) => TEMPORARILY_REJECTED,
        }
    }
}
