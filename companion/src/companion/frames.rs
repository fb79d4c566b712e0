//! What becomes of a frame that came in.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA,
    PARAM_VALUE_DATA, TUNNEL_DATA,
};

use super::{Companion, REPORT_EVERY};
use crate::autopilot::requests::ORIGIN_RETRY_EVERY;
use crate::autopilot::telemetry::Change;
use crate::events::Link;
use crate::link::answer_limits::{Kind as AnswerKind, Sender};
use crate::link::commands::{self, ACCEPTED, Command, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED};
use crate::link::done::DoneReport;
use crate::link::frame::Frame;
use crate::link::intent::Intent;
use crate::link::outbox::Outgoing;
use crate::link::roster::Roster;
use crate::link::{Fresh, rate_limit};
use crate::services::Heard;
use crate::swarm::neighbours::relay::Relay;
use crate::timers::Timer;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Returns whether the mission table should be looked at.
    pub(super) fn handle_frame(&mut self, link: Link, frame: &Frame) -> bool {
        let own = self.config.system_id;
        let sender = Sender::of(link, frame.system, own, &self.config.ground_stations);
        if let Some(command) = commands::read(frame, self.config.system_id) {
            if sender != Sender::GroundStation && command.acts() {
                self.deny(link, sender, &command);
                return false;
            }
            let now = self.now;
            let (result, relevant) = match self.links.answered(frame, now) {
                Some(result) => (result, false),
                None => {
                    let result = self.handle_command(link, sender, &command);
                    self.links.remember(frame, result, now);
                    (result, true)
                }
            };
            if let Some(result) = result {
                let ack = Outgoing::Ack { command: command.command, result, to: command.from };
                self.links.answer(self.now, link, sender, AnswerKind::Ack, ack);
            }
            return relevant;
        }
        let heard = Heard { link, sender, frame, now: self.now, own };
        if self.services.serve(&heard, &mut self.links) {
            return false;
        }
        match link {
            Link::Autopilot => {
                if frame.system != self.config.system_id || frame.component != crate::AUTOPILOT_COMPONENT {
                    return false;
                }
                if frame.message_id == PARAM_VALUE_DATA::ID {
                    let changed = self.requests.handle_limit(&self.telemetry, frame);
                    if changed && !self.mission.state().streams_setpoints() {
                        self.guidance.tune(&self.config, self.requests.limits());
                    }
                    return false;
                }
                let change = self.telemetry.handle(self.now, &self.config.origin, frame);
                if let Some(ack) = self.telemetry.ack.take() {
                    self.requests.handle_ack(&ack, own, self.mission.state(), self.now, &mut self.links);
                    self.mission.handle_ack(&ack, &mut self.links);
                }
                self.requests.watch(self.mission.state(), &self.telemetry);
                if change == Change::OriginDoubted {
                    self.timers.hasten(Timer::Origin, self.now + ORIGIN_RETRY_EVERY);
                    return self.telemetry.origin_moved;
                }
                if let Change::OriginFar(km) = change {
                    if self.timers.take(Timer::OriginReport, self.now, REPORT_EVERY) {
                        self.links.say_count(true, "EKF origin # km away: not used", [km, 0]);
                    }
                    return true;
                }
                if change == Change::OriginLost {
                    self.timers.set(Timer::Origin, self.now);
                    // The autopilot may have been restarted and have lost the streams that were
                    // requested. Positions that jump again and again are no reason to flood the
                    // link.
                    if self.timers.is_due(Timer::Streams, self.now) {
                        self.connect();
                    }
                }
                change == Change::Updated && frame.message_id != LOCAL_POSITION_NED_DATA::ID
            }
            Link::Swarm => {
                self.handle_neighbour(frame);
                false
            }
        }
    }

    pub(super) fn handle_neighbour(&mut self, frame: &Frame) {
        let relevant = matches!(frame.message_id, TUNNEL_DATA::ID | GLOBAL_POSITION_INT_DATA::ID);
        let id = frame.system;
        if !relevant
            || id == self.config.system_id
            || id == 0
            || frame.component != crate::COMPANION_COMPONENT
        {
            return;
        }
        // The frame's sequence number counts only if the frame decodes.
        if frame.message_id == TUNNEL_DATA::ID {
            if let Some(relay) = Relay::decode(frame.padded(), id) {
                let ours = self.mission.plan().is_some_and(|plan| plan.plan_crc == relay.plan_crc);
                if ours && relay.mission_crc == self.config.mission_crc {
                    self.neighbours.handle_relay(self.now, id, &relay);
                }
                return;
            }
            if let Some(roster) = Roster::decode(frame.padded(), id) {
                if roster.mission_crc == self.config.mission_crc {
                    let waits = self.waits_on_ground();
                    self.neighbours.handle_roster(id, &roster, waits);
                }
                return;
            }
            if let Some(report) = DoneReport::decode(frame.padded(), id) {
                self.handle_done(&report);
                return;
            }
            let Some(intent) = Intent::decode(frame.padded(), id) else { return };
            if intent.mission_crc != self.config.mission_crc {
                if self.config.roster.iter().any(|entry| entry.system_id == id) {
                    let text = "Vehicle # has another mission file";
                    self.links.say_of(self.now, Sender::Other, true, text, [u32::from(id), 0, 0]);
                }
                return;
            }
            let echo = intent.echo.filter(|echo| u16::from(echo.rank) == self.neighbours.own_rank());
            let delay_s = echo.and_then(|echo| self.links.delay_s(&echo, self.now));
            if let (Some(delay_s), Some(late)) = (delay_s, self.neighbours.lateness(id)) {
                late.take(delay_s);
            }
            if self.neighbours.accept(id, frame.sequence, self.now) {
                let plan_crc = self.mission.plan().map(|plan| plan.plan_crc);
                self.neighbours.handle_intent(
                    self.now,
                    self.neighbours.own_rank(),
                    &intent,
                    self.config.mission_crc,
                    plan_crc,
                );
            }
        } else if let Some(data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            self.neighbours.handle_position(self.now, &self.config.origin, id, &data);
        }
    }

    /// Answers a command of a sender whose commands do not count.
    pub(super) fn deny(&mut self, link: Link, sender: Sender, command: &Command) {
        if command.to_us {
            let ack = Outgoing::Ack { command: command.command, result: DENIED, to: command.from };
            self.links.answer(self.now, link, sender, AnswerKind::Ack, ack);
        }
        let numbers = [u32::from(command.command), u32::from(command.from.0), u32::from(command.from.1)];
        self.links.say_of(self.now, sender, true, "Command # denied, not a ground station: #/#", numbers);
    }

    /// Returns the answer; none is due to a broadcast, nor to a command that is another component's.
    pub(super) fn handle_command(&mut self, link: Link, sender: Sender, command: &Command) -> Option<u8> {
        let (before, known) = (*self.mission.pending(), self.detours.obstacles());
        let inputs = self.inputs();
        let result = match self.mission.handle_command(&inputs, command) {
            Some(result) => result,
            None if command.command == commands::REQUEST => self.request(link, sender, command.param1),
            None if command.command == commands::EXCLUDE => {
                self.detours.exclude(command, &self.config.origin, self.config.required_clearance_m)
            }
            None if command.command == commands::RESTART
                && (command.to_component || command.param2 == 1.0) =>
            {
                self.restart(command)
            }
            // A command to all components is for another one.
            None if !command.to_component => return None,
            None => UNSUPPORTED,
        };
        let restarts = command.command == commands::RESTART && result == ACCEPTED;
        if restarts || *self.mission.pending() != before || self.detours.obstacles() != known {
            self.links.log_command(self.now, sender, command);
        }
        command.to_us.then_some(result)
    }

    pub(super) fn request(&mut self, link: Link, sender: Sender, message: f32) -> u8 {
        if !self.links.may_answer(self.now, link, sender, AnswerKind::Message) {
            return TEMPORARILY_REJECTED;
        }
        if link == Link::Swarm && !self.links.radio_allows(self.now, self.telemetry.armed) {
            return TEMPORARILY_REJECTED;
        }
        if message == HEARTBEAT_DATA::ID as f32 {
            self.links.set_due(link, Fresh::Heartbeat, true);
        } else if message == AUTOPILOT_VERSION_DATA::ID as f32 {
            self.links.set_due(link, Fresh::Version, true);
        } else if message == GLOBAL_POSITION_INT_DATA::ID as f32 && link == Link::Swarm {
            self.links.set_due(link, Fresh::Position, self.telemetry.position_at.is_some());
        } else {
            return DENIED;
        }
        if link == Link::Swarm {
            self.links.spend(rate_limit::POSITION_BYTES);
        }
        ACCEPTED
    }
}
