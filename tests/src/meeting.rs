//! Simulates meetings: two to six whole companions, each with a light autopilot, on a radio that
//! loses and delays frames.
//!
//! A meeting follows from its seed. [`fly`] simulates it and returns what went wrong, as judged by
//! [`referee`]. Nothing here uses the safety filter's code.

pub mod autopilot;
pub mod dice;
mod forged;
mod outcome;
mod packet;
mod planner;
pub mod referee;
pub mod scene;
mod vehicle;

use companion::link::frame::{self, Framer, Header, MAX_FRAME_LEN};
use companion::link::intent::Intent;
use companion::{COMPANION_COMPONENT, Event, Instant, Link, PlanFailure, PlanKind, State};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, GLOBAL_POSITION_INT_DATA, MavCmd, STATUSTEXT_DATA, TUNNEL_DATA,
};

use self::autopilot::{ControlSource, STEP_S};
use self::dice::Dice;
use self::forged::{forge_report, reported_position_and_velocity};
pub use self::outcome::{Outcome, Summary, outcome_line, summary};
use self::packet::{Packet, RadioContent};
use self::planner::detour_in_the_open;
use self::referee::MeetingReferee;
use self::scene::{MeetingEvent, Scene, floor_z, landing_point};
use self::vehicle::MeetingVehicle;
use crate::setpoints::SetpointStats;

/// Time for which a meeting goes on after its last event and with all vehicles at rest, seconds.
const AFTERMATH_S: f32 = 3.0;
/// Horizontal distance beyond the safety distance within which a vehicle counts as above another
/// one, metres.
const ABOVE_MARGIN_M: f32 = 1.0;
/// Distance from its path beyond which a vehicle is off it, metres.
const OFF_PATH_M: f32 = 1.2;
/// Horizontal distance within which a vehicle is still where its pilot left it, metres.
const STILL_WHERE_LEFT_M: f32 = 1.0;
/// Step in which the distance from the path is computed, metres.
const PATH_STEP_M: f32 = 0.1;
/// [`STEP_S`] in milliseconds.
const STEP_TIME_MS: u64 = 25;

/// A meeting that is being simulated.
struct World<'a> {
    scene: &'a Scene,
    vehicles: Vec<MeetingVehicle>,
    now: Instant,
    /// Draws for each radio frame and receiver whether it is lost, and its delay.
    dice: Dice,
    /// Log of what happened; `None` if none is kept.
    trace: Option<Vec<String>>,
}

/// Simulates a meeting.
pub fn fly(scene: &Scene) -> Outcome {
    World::new(scene).fly()
}

/// Simulates a meeting; the outcome has a log of what happened.
pub fn fly_traced(scene: &Scene) -> Outcome {
    World { trace: Some(Vec::new()), ..World::new(scene) }.fly()
}

impl<'a> World<'a> {
    fn new(scene: &'a Scene) -> Self {
        Self {
            scene,
            vehicles: (0..scene.vehicles.len()).map(|i| MeetingVehicle::new(scene, i)).collect(),
            now: Instant::ZERO,
            dice: Dice::new(scene.seed ^ 0x5EED),
            trace: None,
        }
    }

    fn fly(mut self) -> Outcome {
        let scene = self.scene;
        let mut referee = MeetingReferee::new(scene.vehicles.len());
        let mut next = 0;
        let mut rested_s = 0.0;
        let steps = ((scene::START_S + scene.limit_s) / STEP_S) as usize;
        let mut ended_s = 0.0;
        for step in 0..steps {
            let now_s = step as f32 * STEP_S;
            self.now = Instant::from_millis(step as u64 * STEP_TIME_MS);
            while let Some(happening) = scene.events.get(next).filter(|h| h.at_s <= now_s) {
                self.apply_event(happening.vehicle, happening.what);
                next += 1;
            }
            self.step();
            let seen: Vec<_> =
                self.vehicles.iter().map(|vehicle| vehicle.state_for_referee(now_s)).collect();
            let heard = |a: usize, b: usize| self.vehicles[a].heard[b].clone();
            referee.observe(&seen, heard, |place| floor_z(&scene.vehicles, place));
            if self.trace.is_some() && step % 20 == 0 {
                self.trace_positions(now_s);
            }
            ended_s = now_s;
            let rest = next == scene.events.len()
                && now_s > scene::START_S + 5.0
                && self.vehicles.iter().all(MeetingVehicle::is_at_rest);
            rested_s = if rest { rested_s + STEP_S } else { 0.0 };
            if rested_s > AFTERMATH_S {
                break;
            }
        }
        referee.finish();
        self.outcome(referee, ended_s)
    }

    fn trace_event(&mut self, vehicle: usize, what: &str) {
        let (now, id) = (self.now, self.scene.vehicles[vehicle].id);
        if let Some(trace) = &mut self.trace {
            trace.push(format!("{:7.2} s  {id}: {what}", now.as_micros() as f64 * 1e-6));
        }
    }

    fn trace_positions(&mut self, now_s: f32) {
        let mut line = format!("{now_s:7.2} s ");
        for vehicle in &self.vehicles {
            let (p, v) = (vehicle.autopilot.position, vehicle.autopilot.velocity);
            line += &format!(
                " | {:?} {:.2} {:.2} {:.2} ({:.1} {:.1} {:.1})",
                vehicle.companion.state(),
                p.x,
                p.y,
                p.z,
                v.x,
                v.y,
                v.z
            );
            if let Some(target) = vehicle.autopilot.last_setpoint_position() {
                line += &format!(" to {:.2} {:.2} {:.2}", target.x, target.y, target.z);
            }
            if vehicle.companion.waiting_for() != 0 {
                line += &format!(" for {}", vehicle.companion.waiting_for());
            }
        }
        let vehicles = &self.vehicles;
        for (i, a) in vehicles.iter().enumerate() {
            for (j, b) in vehicles.iter().enumerate().skip(i + 1) {
                let apart_m = (a.autopilot.position - b.autopilot.position).norm();
                if apart_m < 3.0 {
                    line += &format!(" | {}-{} {apart_m:.2} m", i + 1, j + 1);
                }
            }
        }
        if let Some(trace) = &mut self.trace {
            trace.push(line);
        }
    }

    fn apply_event(&mut self, index: usize, what: MeetingEvent) {
        self.trace_event(index, &format!("{what:?}"));
        let now = self.now;
        let vehicle = &mut self.vehicles[index];
        let airborne = vehicle.autopilot.is_airborne();
        match what {
            MeetingEvent::Start => self.send_command(index, MavCmd::MAV_CMD_MISSION_START, 0.0),
            MeetingEvent::Pause => self.send_command(index, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0),
            MeetingEvent::Resume => {
                self.send_command(index, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0);
            }
            MeetingEvent::Return => {
                self.send_command(index, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0);
            }
            MeetingEvent::Land => self.send_command(index, MavCmd::MAV_CMD_NAV_LAND, 0.0),
            MeetingEvent::PilotTakes(velocity) if airborne => {
                vehicle.autopilot.pilot_takes_over(velocity);
            }
            MeetingEvent::PilotReturns if airborne => vehicle.autopilot.pilot_gives_back(now),
            MeetingEvent::PilotLands
                if airborne && vehicle.autopilot.control_source() == ControlSource::Other =>
            {
                vehicle.autopilot.pilot_lands();
            }
            // The autopilot of a dead companion may still be in Guided (ArduCopter).
            MeetingEvent::PilotLands if airborne && vehicle.companion_dead => {
                vehicle.autopilot.pilot_lands();
            }
            MeetingEvent::EntersFailsafe(how) if airborne => vehicle.autopilot.enter_failsafe(how),
            MeetingEvent::PilotTakes(_)
            | MeetingEvent::PilotReturns
            | MeetingEvent::PilotLands
            | MeetingEvent::EntersFailsafe(_) => {}
            MeetingEvent::CompanionDies => vehicle.companion_dead = true,
            MeetingEvent::RadioCut { sending_fails: sends, receiving_fails: hears } => {
                (vehicle.radio_sends, vehicle.radio_hears) = (!sends, !hears);
            }
            MeetingEvent::Caught(how) if airborne => vehicle.autopilot.catch(how),
            MeetingEvent::Caught(_) => {}
            MeetingEvent::RadioHealed => (vehicle.radio_sends, vehicle.radio_hears) = (true, true),
        }
    }

    /// Sends a vehicle a command of the ground station, without loss or delay.
    fn send_command(&mut self, index: usize, command: MavCmd, param1: f32) {
        let vehicle = &mut self.vehicles[index];
        if vehicle.companion_dead {
            return;
        }
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: self.scene.vehicles[index].id,
            target_component: COMPANION_COMPONENT,
            ..Default::default()
        };
        let mut out = [0; MAX_FRAME_LEN];
        let header = Header { system: 255, component: 190, sequence: vehicle.command_sequence };
        vehicle.command_sequence = vehicle.command_sequence.wrapping_add(1);
        let len = frame::encode(header, &data, &mut out);
        vehicle.companion.handle_bytes(Link::Swarm, self.now, &out[..len]);
        self.drain_outputs(index);
    }

    fn step(&mut self) {
        let now = self.now;
        for i in 0..self.vehicles.len() {
            let floor = floor_z(&self.scene.vehicles, &self.vehicles[i].autopilot.position);
            let vehicle = &mut self.vehicles[i];
            let mut bytes = core::mem::take(&mut vehicle.bytes_to_companion);
            vehicle.autopilot.step(now, floor, &mut bytes);
            let mut arrived = Vec::new();
            vehicle.inbox.retain_mut(|packet| {
                let due = packet.due_at <= now;
                if due {
                    let none = Packet {
                        due_at: now,
                        from: 0,
                        bytes: Vec::new(),
                        content: RadioContent::Other,
                    };
                    arrived.push(core::mem::replace(packet, none));
                }
                !due
            });
            if vehicle.companion_dead {
                continue;
            }
            if !bytes.is_empty() {
                vehicle.companion.handle_bytes(Link::Autopilot, now, &bytes);
            }
            bytes.clear();
            vehicle.bytes_to_companion = bytes;
            for packet in arrived.into_iter().filter(|_| vehicle.radio_hears) {
                vehicle.companion.handle_bytes(Link::Swarm, now, &packet.bytes);
                let heard = &mut vehicle.heard[packet.from];
                let now_s = now.as_micros() as f32 * 1e-6;
                match packet.content {
                    RadioContent::Position(place, velocity, boot_ms) => {
                        if heard.position.is_none_or(|(_, _, known, _)| boot_ms > known) {
                            heard.position = Some((place, velocity, boot_ms, now_s));
                        }
                    }
                    RadioContent::Intent(intent) => heard.intent = Some(intent),
                    RadioContent::Other => {}
                }
            }
            if vehicle.companion.poll_timeout().is_some_and(|due| due <= now) {
                vehicle.companion.handle_timeout(now);
                vehicle.note_stops(now);
            }
            self.drain_outputs(i);
        }
    }

    fn drain_outputs(&mut self, i: usize) {
        let mut buffer = [0; MAX_FRAME_LEN];
        loop {
            let length = self.vehicles[i].companion.poll_transmit(Link::Autopilot, &mut buffer);
            if length == 0 {
                break;
            }
            let (now, vehicle) = (self.now, &mut self.vehicles[i]);
            vehicle.autopilot.setpoint_check.in_urgent_stop = vehicle.companion.is_in_urgent_stop();
            vehicle.autopilot.handle_bytes(now, &buffer[..length], &mut vehicle.bytes_to_companion);
        }
        loop {
            let length = self.vehicles[i].companion.poll_transmit(Link::Swarm, &mut buffer);
            if length == 0 {
                break;
            }
            self.broadcast(i, &buffer[..length]);
        }
        while let Some(event) = self.vehicles[i].companion.poll_event() {
            match event {
                Event::PlanRequested(_) => self.answer_plan_request(i),
                Event::StateChanged { from, to, text, .. } => {
                    self.vehicles[i].blocked_count +=
                        u32::from((from, to) == (State::Follow, State::Blocked));
                    self.trace_event(i, &format!("{from:?} → {to:?} {text}"));
                }
                Event::RestartRequested
                | Event::WaitsForUnstartedVehicle { .. }
                | Event::DetourSkippedWaypoints { .. } => {}
            }
        }
    }

    /// Sends a vehicle's frame to all others, each with its own loss and delay; a liar's is forged.
    fn broadcast(&mut self, from: usize, bytes: &[u8]) {
        let now = self.now;
        let mut input = bytes;
        let Some(mut frame) = self.vehicles[from].framer.next(now, &mut input) else { return };
        let mut bytes = bytes.to_vec();
        if let Some((liar, lie)) = self.scene.liar
            && liar == from
            && let Some(forged) = forge_report(&frame, lie)
        {
            bytes = forged;
            let mut input = &bytes[..];
            frame = Framer::new().next(now, &mut input).expect("a forged frame is whole");
        }
        let said = if let Some(data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            let (place, velocity) = reported_position_and_velocity(&data);
            RadioContent::Position(place, velocity, data.time_boot_ms)
        } else if frame.message_id == TUNNEL_DATA::ID {
            Intent::decode(frame.padded_payload(), frame.system)
                .map_or(RadioContent::Other, RadioContent::Intent)
        } else {
            if let Some(data) = frame.decode::<STATUSTEXT_DATA>()
                && let Ok(text) = data.text.to_str()
            {
                self.trace_event(from, &format!("\"{text}\""));
            }
            RadioContent::Other
        };
        if !self.vehicles[from].radio_sends {
            return;
        }
        let (low, high) = self.scene.radio_delay_s;
        for to in (0..self.vehicles.len()).filter(|to| *to != from) {
            let lost = self.dice.chance(self.scene.radio_loss);
            let delay_s = self.dice.real(low, high);
            if !lost {
                let at = now + companion::Duration::from_micros((delay_s * 1e6) as u64);
                let packet =
                    Packet { due_at: at, from, bytes: bytes.clone(), content: said.clone() };
                self.vehicles[to].inbox.push(packet);
            }
        }
    }

    /// Answers a companion's request by the scene's plan, or by a detour if it requests one.
    fn answer_plan_request(&mut self, i: usize) {
        let own = &self.scene.vehicles[i].plan;
        let mut keep = Vec::new();
        let vehicle = &mut self.vehicles[i];
        match vehicle.companion.detour_request(|obstacle| keep.push(obstacle)) {
            Some(request) => {
                let answer = detour_in_the_open(&request, &keep, own);
                let text = if answer.is_some() { "a way around" } else { "no way around" };
                let answer = answer.as_ref().ok_or(PlanFailure::Unreachable);
                vehicle.companion.handle_plan(self.now, PlanKind::Detour, answer);
                self.trace_event(i, text);
            }
            None => vehicle.companion.handle_plan(self.now, PlanKind::Mission, Ok(own)),
        }
    }

    /// Whether a vehicle can neither move away nor land: it is above another one, and something
    /// holds it, or its pilot left it so far from its path that a wall may stand between.
    fn is_held_above_another(&self, i: usize) -> bool {
        let own = &self.vehicles[i];
        let place = own.autopilot.position;
        let below = |other: &MeetingVehicle| {
            let away = place - other.autopilot.position;
            away.z > 0.0 && away.xy().norm() < scene::SAFETY_DISTANCE_M + ABOVE_MARGIN_M
        };
        let others = self.vehicles.iter().enumerate().filter(|(j, _)| *j != i);
        (own.autopilot.is_caught() || self.was_left_off_path(i))
            && own.companion.state() == State::LandingHeld
            && others.into_iter().any(|(_, other)| below(other))
    }

    /// Whether a vehicle is where its pilot left it, off its path.
    fn was_left_off_path(&self, i: usize) -> bool {
        let (autopilot, path) = (&self.vehicles[i].autopilot, &self.scene.vehicles[i].plan.path);
        let steps = (path.length_m() / PATH_STEP_M).ceil() as usize;
        let away = |step| Some(path.point_at(step as f32 * PATH_STEP_M)? - autopilot.position);
        autopilot
            .given_back_at
            .is_some_and(|at| (at - autopilot.position).xy().norm() < STILL_WHERE_LEFT_M)
            && (0..=steps).filter_map(away).all(|away| away.norm() > OFF_PATH_M)
    }

    fn outcome(self, referee: MeetingReferee, ended_s: f32) -> Outcome {
        let scene = self.scene;
        let mut setpoints = SetpointStats::default();
        let mut unfit = Vec::new();
        let (mut stuck, mut held) = (Vec::new(), 0);
        let mut arrived = 0;
        for (i, vehicle) in self.vehicles.iter().enumerate() {
            setpoints.merge(&vehicle.autopilot.setpoint_check.stats);
            unfit.extend(
                vehicle
                    .autopilot
                    .setpoint_check
                    .faults
                    .iter()
                    .map(|(at_s, what)| (i, *at_s, what.clone())),
            );
            match vehicle.autopilot.armed || vehicle.autopilot.is_airborne() {
                true if self.is_held_above_another(i) => held += 1,
                true => stuck.push((i, vehicle.companion.state())),
                false => {}
            }
            let goal = landing_point(&scene.vehicles[i].plan);
            arrived += usize::from(
                goal.is_some_and(|goal| (goal - vehicle.autopilot.position).norm() < 0.7),
            );
        }
        Outcome {
            seed: scene.seed,
            kind: scene.kind,
            on_plan: scene.on_plan,
            has_liar: scene.liar.is_some(),
            vehicle_count: scene.vehicles.len(),
            violations: referee.violations,
            touches: referee.touches,
            unforeseen_touches: referee.unforeseen_touches,
            not_landed: stuck,
            held_above_another: held,
            min_distance_m: referee.min_distance_m,
            ended_s,
            setpoints,
            unfit_setpoints: unfit,
            arrived_count: arrived,
            filter_stops: self.vehicles.iter().map(|vehicle| vehicle.filter_stops).sum(),
            longest_stop_s: self.vehicles.iter().map(|m| m.longest_stop_s).fold(0.0, f32::max),
            longest_unheard_stop_s: self
                .vehicles
                .iter()
                .map(|m| m.longest_unheard_stop_s)
                .fold(0.0, f32::max),
            max_blocked_count: self
                .vehicles
                .iter()
                .map(|vehicle| vehicle.blocked_count)
                .max()
                .unwrap_or_default(),
            trace: self.trace.unwrap_or_default(),
        }
    }
}
