//! Handles received frames: commands, services, the autopilot's telemetry, other companions.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, GLOBAL_POSITION_INT_DATA,
    HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA,
    PARAM_SET_DATA, PARAM_VALUE_DATA, TIMESYNC_DATA, TUNNEL_DATA,
};

use super::{Companion, WARNING_EVERY};
use crate::autopilot::handshake::ORIGIN_RETRY_EVERY;
use crate::autopilot::telemetry::TelemetryChange;
use crate::events::Link;
use crate::link::answer_limits::{AnswerKind, SenderKind};
use crate::link::commands::{self, ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED};
use crate::link::frame::{AUTOPILOT_COMPONENT, COMPANION_COMPONENT, Frame};
use crate::link::intent::Intent;
use crate::link::outbox::Outgoing;
use crate::link::photographed::PhotographedReport;
use crate::link::roster::RosterReport;
use crate::link::severity::Severity;
use crate::link::{OnDemandMessage, rate_limit};
use crate::services::{ReceivedFrame, answer_timesync, ftp};
use crate::swarm::fleet::StartStatus;
use crate::swarm::neighbours::relay::Relay;
use crate::timers::Timer;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Handles bytes that a link received up to now. Without bytes the framer gives up a partial
    /// frame that is too old, and yields the frames behind it.
    pub(super) fn receive(&mut self, link: Link, mut bytes: &[u8]) {
        let mut relevant = false;
        while let Some(frame) = self.links.receive(link, self.now, &mut bytes) {
            relevant |= self.handle_frame(link, &frame);
        }
        if relevant {
            self.run_mission_table();
        }
    }

    /// Handles a received frame: passes it to the part that its message is for. Returns whether the
    /// mission table has to be evaluated now.
    pub(super) fn handle_frame(&mut self, link: Link, frame: &Frame) -> bool {
        let own = self.config.system_id;
        let sender =
            SenderKind::from_system_id(link, frame.system, own, &self.config.ground_stations);
        let heard = ReceivedFrame { link, sender, frame, now: self.now, own_system_id: own };
        match frame.message_id {
            GLOBAL_POSITION_INT_DATA::ID | TUNNEL_DATA::ID if link == Link::Swarm => {
                self.handle_neighbour_frame(frame);
                false
            }
            COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => {
                match commands::read_command(frame, own) {
                    Some(command) => self.handle_command_frame(&heard, &command),
                    None => self.handle_autopilot_frame(&heard),
                }
            }
            ftp::MESSAGE_ID if heard.is_for_companion(1) => {
                self.services.handle_ftp(&heard, &mut self.links);
                false
            }
            PARAM_REQUEST_LIST_DATA::ID if heard.is_for_vehicle(0) => {
                self.services.send_parameters(&heard, &mut self.links);
                false
            }
            PARAM_REQUEST_READ_DATA::ID if heard.is_for_vehicle(2) => {
                self.services.handle_parameter_read(&heard, &mut self.links);
                false
            }
            PARAM_SET_DATA::ID if heard.is_for_vehicle(4) => {
                self.services.handle_parameter_set(&heard, &mut self.links);
                false
            }
            TIMESYNC_DATA::ID if heard.is_from_another_component() => {
                answer_timesync(&heard, &mut self.links);
                false
            }
            PARAM_VALUE_DATA::ID => {
                if self.is_from_autopilot(&heard) {
                    self.handle_autopilot_parameter(frame);
                }
                false
            }
            _ => self.handle_autopilot_frame(&heard),
        }
    }

    /// Handles a command from any sender, and answers it. A command that changes something counts
    /// only from a ground station of the mission. A duplicate gets the former answer and does not
    /// act again. Returns whether the mission table has to be evaluated now.
    fn handle_command_frame(&mut self, heard: &ReceivedFrame<'_>, command: &Command) -> bool {
        let ReceivedFrame { link, sender, frame, now, .. } = *heard;
        if sender != SenderKind::GroundStation && command.needs_authority() {
            self.reject_command(link, sender, command);
            return false;
        }
        let (result, relevant) = match self.links.previous_answer(frame, now) {
            Some(result) => (result, false),
            None => {
                let result = self.handle_command(link, sender, command);
                self.links.remember_answer(frame, result, now);
                (result, true)
            }
        };
        if let Some(result) = result {
            let ack = Outgoing::Ack { command: command.command, result, to: command.from };
            self.links.queue_answer(now, link, sender, AnswerKind::Ack, ack);
        }
        relevant
    }

    /// Whether this vehicle's autopilot sent the frame: its system id, component 1, on its link.
    fn is_from_autopilot(&self, heard: &ReceivedFrame<'_>) -> bool {
        heard.link == Link::Autopilot
            && heard.sender_ids() == (heard.own_system_id, AUTOPILOT_COMPONENT)
    }

    /// Handles a parameter of this vehicle's autopilot: limits of guidance may follow from it,
    /// unless setpoints are sent now.
    fn handle_autopilot_parameter(&mut self, frame: &Frame) {
        let changed = self.handshake.handle_param_value(&self.telemetry, frame);
        if changed && !self.mission.state().streams_setpoints() {
            self.guidance.set_limits(&self.config, self.handshake.limits());
        }
    }

    /// Handles a frame of this vehicle's autopilot; any other frame changes nothing. Returns
    /// whether the mission table has to be evaluated now.
    fn handle_autopilot_frame(&mut self, heard: &ReceivedFrame<'_>) -> bool {
        if !self.is_from_autopilot(heard) {
            return false;
        }
        let (frame, now) = (heard.frame, self.now);
        let change = self.telemetry.handle_frame(now, &self.config.origin, frame);
        if let Some(ack) = self.telemetry.take_ack() {
            let state = self.mission.state();
            self.handshake.handle_ack(&ack, heard.own_system_id, state, now, &mut self.links);
            self.mission.handle_ack(&ack, &mut self.links);
        }
        self.handshake.update_mode_and_landed(self.mission.state(), &self.telemetry, now);
        match change {
            TelemetryChange::OriginDoubted => {
                self.timers.set_no_later(Timer::Origin, now + ORIGIN_RETRY_EVERY);
                self.telemetry.origin_moved
            }
            TelemetryChange::OriginFar(km) => {
                if self.timers.take_due(Timer::OriginReport, now, WARNING_EVERY) {
                    let text = "EKF origin # km away: not used";
                    self.links.send_text_with_numbers(Severity::Warning, text, [km, 0]);
                }
                true
            }
            TelemetryChange::OriginLost => {
                self.timers.set(Timer::Origin, now);
                // After a restart of the autopilot its telemetry streams have to be requested
                // again. The timer keeps a position that jumps again and again from flooding the
                // link.
                if self.timers.is_due(Timer::Streams, now) {
                    self.request_streams();
                }
                false
            }
            TelemetryChange::Updated => frame.message_id != LOCAL_POSITION_NED_DATA::ID,
            TelemetryChange::None => false,
        }
    }

    /// Handles a position or a private message of another companion.
    pub(super) fn handle_neighbour_frame(&mut self, frame: &Frame) {
        let id = frame.system;
        if id == self.config.system_id || id == 0 || frame.component != COMPANION_COMPONENT {
            return;
        }
        // Only an intent that decodes and is of this mission updates the sender's sequence number.
        if frame.message_id == TUNNEL_DATA::ID {
            self.handle_tunnel(frame);
        } else if let Some(data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            self.neighbours.handle_position(self.now, &self.config.origin, id, &data);
        }
    }

    /// Handles a private message of another companion, by its payload's kind.
    fn handle_tunnel(&mut self, frame: &Frame) {
        let (payload, id) = (frame.padded_payload(), frame.system);
        if let Some(intent) = Intent::decode(payload, id) {
            self.handle_intent(id, frame.sequence, &intent);
        } else if let Some(relay) = Relay::decode(payload, id) {
            let ours =
                self.mission.plan().is_some_and(|plan| plan.swarm_plan_crc == relay.plan_crc);
            if ours && relay.mission_crc == self.config.mission_crc {
                self.neighbours.handle_relay(self.now, id, &relay);
            }
        } else if let Some(roster) = RosterReport::decode(payload, id) {
            if roster.mission_crc == self.config.mission_crc {
                let own = match self.is_not_started() {
                    true => StartStatus::NotStarted,
                    false => StartStatus::Started,
                };
                self.neighbours.handle_roster_report(id, &roster, own);
            }
        } else if let Some(report) = PhotographedReport::decode(payload, id) {
            self.handle_photographed_report(&report);
        }
    }

    /// Handles the intent of vehicle `id`. One of another mission changes nothing but is reported;
    /// one of a vehicle that is not of the roster changes nothing.
    fn handle_intent(&mut self, id: u8, sequence: u8, intent: &Intent) {
        let of_roster = self.config.roster.iter().any(|entry| entry.system_id == id);
        if of_roster && intent.mission_crc != self.config.mission_crc {
            let text = "Vehicle # has another mission file";
            let numbers = [u32::from(id), 0, 0];
            let sender = SenderKind::Other;
            self.links.send_rate_limited_text(self.now, sender, Severity::Warning, text, numbers);
        }
        // A stranger's echo acknowledges nothing: whoever flies by the mission is in its roster.
        if !of_roster || intent.mission_crc != self.config.mission_crc {
            return;
        }
        let echo = intent.echo.filter(|echo| u16::from(echo.rank) == self.neighbours.own_rank());
        let delay_s = echo.and_then(|echo| self.links.message_delay_s(&echo, self.now));
        if let Some(sent) = echo.and_then(|echo| self.links.sent_intents().note_arrival(&echo)) {
            self.guidance.note_acknowledged_path(
                sent.at,
                sent.path.along_m,
                sent.path.points_end_m,
            );
        }
        if let (Some(delay_s), Some(late)) = (delay_s, self.neighbours.message_delay(id)) {
            late.update(delay_s);
        }
        let plan_crc = self.mission.plan().map(|plan| plan.swarm_plan_crc);
        let mission_crc = self.config.mission_crc;
        self.neighbours.handle_numbered_intent(self.now, sequence, intent, mission_crc, plan_crc);
    }

    /// Denies a command from a sender that is no ground station of the mission, and reports it by a
    /// text.
    pub(super) fn reject_command(&mut self, link: Link, sender: SenderKind, command: &Command) {
        if command.to_our_system {
            let ack = Outgoing::Ack { command: command.command, result: DENIED, to: command.from };
            self.links.queue_answer(self.now, link, sender, AnswerKind::Ack, ack);
        }
        let numbers =
            [u32::from(command.command), u32::from(command.from.0), u32::from(command.from.1)];
        self.links.send_rate_limited_text(
            self.now,
            sender,
            Severity::Warning,
            "Command # denied, not a ground station: #/#",
            numbers,
        );
    }

    /// Handles a command and returns its MAV_RESULT; `None`, no COMMAND_ACK, for a broadcast or a
    /// command to another component.
    pub(super) fn handle_command(
        &mut self,
        link: Link,
        sender: SenderKind,
        command: &Command,
    ) -> Option<u8> {
        let (before, known) = (*self.mission.pending(), self.detours.obstacle_count());
        let inputs = self.guard_inputs();
        let result = match self.mission.handle_command(&inputs, command) {
            Some(result) => result,
            None if command.command == commands::REQUEST_MESSAGE => {
                self.handle_message_request(link, sender, command.param1)
            }
            None if command.command == commands::FENCE_EXCLUSION => {
                self.detours.handle_obstacle_command(
                    command,
                    &self.config.origin,
                    self.config.required_clearance_m,
                )
            }
            None if command.command == commands::REBOOT
                && (command.to_our_component || command.param2 == 1.0) =>
            {
                self.handle_restart_command(command)
            }
            // An unknown command to all components is meant for another component.
            None if !command.to_our_component => return None,
            None => UNSUPPORTED,
        };
        let restarts = command.command == commands::REBOOT && result == ACCEPTED;
        if restarts || *self.mission.pending() != before || self.detours.obstacle_count() != known {
            self.links.send_command_text(self.now, sender, command);
        }
        command.to_our_system.then_some(result)
    }

    /// Handles REQUEST_MESSAGE: makes the message with the id `message` due on the same link, if
    /// the companion has such a message and the rate limits allow. Returns the MAV_RESULT.
    pub(super) fn handle_message_request(
        &mut self,
        link: Link,
        sender: SenderKind,
        message: f32,
    ) -> u8 {
        if !self.links.take_answer_token(self.now, link, sender, AnswerKind::Message) {
            return TEMPORARILY_REJECTED;
        }
        if link == Link::Swarm && !self.may_send_by_radio() {
            return TEMPORARILY_REJECTED;
        }
        if message == HEARTBEAT_DATA::ID as f32 {
            self.links.set_due(link, OnDemandMessage::Heartbeat);
        } else if message == AUTOPILOT_VERSION_DATA::ID as f32 {
            self.links.set_due(link, OnDemandMessage::Version);
        } else if message == GLOBAL_POSITION_INT_DATA::ID as f32 && link == Link::Swarm {
            self.set_position_due();
        } else {
            return DENIED;
        }
        if link == Link::Swarm {
            self.links.take_radio_tokens(rate_limit::POSITION_BYTES);
        }
        ACCEPTED
    }
}
