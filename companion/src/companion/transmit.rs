//! Frames sent: chooses, and makes from the newest state, the next frame when a link is polled.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    FILE_TRANSFER_PROTOCOL_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, MavAutopilot, MavFrame,
    MavModeFlag, MavState, MavType, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA,
    TUNNEL_DATA,
};
use planner_core::Point;
use planner_core::geo::frames;

use super::Companion;
use crate::events::Link;
use crate::guidance::Setpoint;
use crate::link::echo::ReportedPath;
use crate::link::frame::{self, AUTOPILOT_COMPONENT};
use crate::link::intent::{self, Intent};
use crate::link::rate_limit::{ARMED_EXTRA_BYTES_PER_S, DISARMED_EXTRA_BYTES_PER_S};
use crate::link::roster;
use crate::link::severity::Severity;
use crate::link::{OnDemandMessage, photographed};
use crate::margins::{LEASE_RENEWAL_DELAY_S, LEASE_S, UNHEARD_NOTICED_AFTER_S};
use crate::services;
use crate::state::{State, SystemStatus};
use crate::swarm::neighbours::relay;

/// Longest time for which a vehicle in a coverage mission flies on along its part after it was last
/// heard, seconds: its lease of 20 s, 1.8 s for the age of the report that renewed it, 2 s of
/// message delay, and half of the longest stop.
const MAX_FLIGHT_ON_LEASE_S: f32 =
    LEASE_S as f32 + UNHEARD_NOTICED_AFTER_S + LEASE_RENEWAL_DELAY_S + 2.5;
/// Bit of `type_mask` in SET_POSITION_TARGET_LOCAL_NED: the yaw is ignored.
const MASK_YAW_IGNORED: u16 = 0x400;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Writes the next frame for a link to `out`. Returns its length; 0 when there is none, or
    /// `out` is shorter than [`frame::MAX_FRAME_LEN`].
    pub fn poll_transmit(&mut self, link: Link, out: &mut [u8]) -> usize {
        if out.len() < frame::MAX_FRAME_LEN {
            return 0;
        }
        let system = self.config.system_id;
        if link == Link::Autopilot
            && self.links.take_due(link, OnDemandMessage::Setpoint)
            && let Some(data) = self.setpoint_message()
        {
            return frame::encode(self.links.next_header(link, system), &data, out);
        }
        if self.links.take_due(link, OnDemandMessage::Heartbeat) {
            return frame::encode(
                self.links.next_header(link, system),
                &self.heartbeat_message(),
                out,
            );
        }
        if link == Link::Swarm && self.links.take_due(link, OnDemandMessage::Position) {
            let data = self.global_position_message();
            return frame::encode(self.links.next_header(link, system), &data, out);
        }
        if link == Link::Swarm && self.links.take_due(link, OnDemandMessage::Intent) {
            let mut payload = [0; 133];
            let len = self.own_intent().encode(&mut payload);
            let header = self.links.intent_header(system, self.reported_path(), self.now);
            self.guidance.note_intent_sent(self.now, self.config.swarm_hz);
            return encode_tunnel(header, &payload[..len], out);
        }
        if link == Link::Swarm
            && self.links.take_due(link, OnDemandMessage::Roster)
            && let Some(mut roster) = self.neighbours.next_roster_report()
        {
            (roster.system_id, roster.mission_crc) = (system, self.config.mission_crc);
            let mut payload = [0; roster::MAX_LEN];
            let len = roster.encode(&mut payload);
            let header = self.links.next_header(link, system);
            return encode_tunnel(header, &payload[..len], out);
        }
        if link == Link::Swarm && self.links.take_due(link, OnDemandMessage::PhotographedReport) {
            let mut payload = [0; photographed::MAX_LEN];
            let len = self.photographed_report().encode(&mut payload);
            let header = self.links.next_header(link, system);
            return encode_tunnel(header, &payload[..len], out);
        }
        if self.links.take_due(link, OnDemandMessage::PhotographedCount) {
            let data = self.photographed_count_message();
            return frame::encode(self.links.next_header(link, system), &data, out);
        }
        if link == Link::Swarm && !self.may_send_by_radio() {
            return 0;
        }
        let relayed = if link == Link::Swarm { self.transmit_relay(out) } else { 0 };
        let length = if relayed > 0 { relayed } else { self.transmit_answer(link, out) };
        if link == Link::Swarm {
            self.links.take_radio_tokens(length);
        }
        length
    }

    /// Whether another frame may be sent to the radio beside the state messages.
    pub(super) fn may_send_by_radio(&mut self) -> bool {
        let rate =
            if self.telemetry.armed { ARMED_EXTRA_BYTES_PER_S } else { DISARMED_EXTRA_BYTES_PER_S };
        self.links.may_send_by_radio(self.now, rate)
    }

    /// Makes the message with this vehicle's position due if the position is known.
    pub(super) fn set_position_due(&mut self) {
        match self.telemetry.position_at {
            Some(_) => self.links.set_due(Link::Swarm, OnDemandMessage::Position),
            None => self.links.clear_due(Link::Swarm, OnDemandMessage::Position),
        }
    }

    /// Writes a message that relays the progress of vehicles that some neighbour does not hear,
    /// while more than half of the radio's token bucket is left for answers. Returns its length, 0
    /// for none.
    fn transmit_relay(&mut self, out: &mut [u8]) -> usize {
        if !self.links.is_radio_bucket_half_full()
            || !self.links.take_due(Link::Swarm, OnDemandMessage::Relay)
        {
            return 0;
        }
        let plan_crc = self.mission.plan().map_or(0, |plan| plan.swarm_plan_crc);
        let crc = self.config.mission_crc;
        let relay = self.neighbours.next_relay(self.now, crc, plan_crc);
        if relay.is_empty() {
            return 0;
        }
        let mut payload = [0; relay::MAX_LEN];
        let len = relay.encode(self.config.system_id, &mut payload);
        let header = self.links.next_header(Link::Swarm, self.config.system_id);
        frame::encode_raw(header, TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC, &payload[..len], out)
    }

    /// Writes AUTOPILOT_VERSION if requested, else the link's first queued message, else an FTP
    /// reply. Returns its length, 0 for none.
    fn transmit_answer(&mut self, link: Link, out: &mut [u8]) -> usize {
        let system = self.config.system_id;
        if self.links.take_due(link, OnDemandMessage::Version) {
            return frame::encode(
                self.links.next_header(link, system),
                &services::autopilot_version(system),
                out,
            );
        }
        let length = self.links.write_queued(link, system, out);
        if length > 0 {
            return length;
        }
        let Some(payload) = self.services.poll_ftp(link) else { return 0 };
        let header = self.links.next_header(link, system);
        let (id, extra) = (FILE_TRANSFER_PROTOCOL_DATA::ID, FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC);
        frame::encode_raw(header, id, extra, &payload, out)
    }

    /// Queues a STATUSTEXT, at most 50 bytes, on both links.
    pub fn send_text(&mut self, severity: Severity, text: &'static str) {
        self.links.send_text(severity, text);
    }

    /// Queues a STATUSTEXT on both links; each `#` in the text is replaced by one of the numbers.
    pub fn send_text_with_numbers(
        &mut self,
        severity: Severity,
        text: &'static str,
        numbers: [u32; 2],
    ) {
        self.links.send_text_with_numbers(severity, text, numbers);
    }

    /// The setpoint in NED about the autopilot's EKF origin; while that origin is unknown, a stop.
    /// `None` if none is to be sent.
    fn setpoint_message(&self) -> Option<SET_POSITION_TARGET_LOCAL_NED_DATA> {
        let still = Point::zeros();
        let kind = self.autopilot_kind();
        let stop = |velocity: &Point| {
            (still, frames::swap_enu_ned(velocity), still, None, kind.stop_type_mask())
        };
        let (position, velocity, acceleration, heading, mask) =
            match self.guidance.setpoint_to_send(self.mission.state(), &self.guidance_inputs()) {
                Setpoint::None => return None,
                Setpoint::Stop(velocity) => stop(&velocity),
                Setpoint::Move(position, velocity, acceleration, heading) => self
                    .telemetry
                    .to_ned(&self.config.origin, &position)
                    .map_or(stop(&still), |ned| {
                        let velocity = frames::swap_enu_ned(&velocity);
                        (
                            ned,
                            velocity,
                            frames::swap_enu_ned(&acceleration),
                            heading,
                            kind.move_type_mask(),
                        )
                    }),
            };
        Some(SET_POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: self.now.as_boot_ms(),
            x: position.x,
            y: position.y,
            z: position.z,
            vx: velocity.x,
            vy: velocity.y,
            vz: velocity.z,
            afx: acceleration.x,
            afy: acceleration.y,
            afz: acceleration.z,
            // ENU heading (counter-clockwise from east) to MAVLink's yaw (clockwise from north).
            yaw: heading.map_or(0.0, |heading| core::f32::consts::FRAC_PI_2 - heading),
            type_mask: PositionTargetTypemask::from_bits_truncate(match heading {
                Some(_) => mask & !MASK_YAW_IGNORED,
                None => mask,
            }),
            target_system: self.config.system_id,
            target_component: AUTOPILOT_COMPONENT,
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            ..SET_POSITION_TARGET_LOCAL_NED_DATA::default()
        })
    }

    /// The companion's HEARTBEAT; its `custom_mode` is the number of the mission state.
    fn heartbeat_message(&self) -> HEARTBEAT_DATA {
        let system_status = match self.mission.state().system_status() {
            SystemStatus::Boot => MavState::MAV_STATE_BOOT,
            SystemStatus::Standby => MavState::MAV_STATE_STANDBY,
            SystemStatus::Active => MavState::MAV_STATE_ACTIVE,
            SystemStatus::Critical => MavState::MAV_STATE_CRITICAL,
        };
        HEARTBEAT_DATA {
            custom_mode: self.mission.state() as u32,
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            system_status,
            mavlink_version: 3,
        }
    }

    /// This vehicle's position and velocity for the swarm; `relative_alt` is the height above the
    /// origin of the mission frame.
    fn global_position_message(&self) -> GLOBAL_POSITION_INT_DATA {
        let reported = self.detours.reported_place(&self.telemetry, self.now);
        let place = frames::enu_to_geodetic(&self.config.origin, &reported.position);
        let cm = frames::swap_enu_ned(&reported.velocity) * 100.0;
        GLOBAL_POSITION_INT_DATA {
            // The time at which the position was measured, so that receivers recognise a repeated
            // one.
            time_boot_ms: reported.measured_at.as_boot_ms(),
            lat: libm::round(place.lat_deg * 1e7) as i32,
            lon: libm::round(place.lon_deg * 1e7) as i32,
            alt: libm::round(place.alt_m * 1e3) as i32,
            relative_alt: libm::roundf(reported.position.z * 1e3) as i32,
            vx: cm.x as i16,
            vy: cm.y as i16,
            vz: cm.z as i16,
            hdg: u16::MAX,
        }
    }

    /// Flags of this vehicle's intent: whether it flies, follows the plan, waits or is blocked.
    fn intent_flags(&self) -> u8 {
        use State::*;
        let view = self.detour_view();
        let flown_again = view.is_piloted_after_mission();
        let grounded = match self.mission.state() {
            state if state.has_landed() => !flown_again,
            // On its path it flies, whatever the landing detector reports.
            state => {
                self.telemetry.rests_disarmed(self.now)
                    || (!state.is_on_path() && view.is_on_ground())
            }
        };
        let on_plan = !self.guidance.returning
            && self.mission.state().is_on_plan()
            // In `SwarmLinkLost` a vehicle that may fly on unheard waits for its gates, so it still
            // follows the plan.
            || self.mission.state() == SwarmLinkLost && self.may_fly_unheard()
            || (self.mission.state().lands_or_landing_is_held()
                || self.mission.state().has_landed())
                && self.guidance.is_reference_at_goal(&self.guidance_inputs());
        let flag = |flag: u8, holds: bool| if holds { flag } else { 0 };
        let out = self.detours.is_own_vehicle_out_of_plan(&view);
        let flies = if grounded { intent::GROUNDED } else { intent::FLYING };
        flies
            | flag(intent::LANDED, self.mission.state() == Done && !flown_again)
            | flag(intent::ON_PLAN, on_plan && self.mission.plan().is_some())
            | flag(intent::OUT_OF_PLAN, out)
            | flag(intent::WAITING, self.detours.is_waiting_for_others(&view))
            | flag(intent::BLOCKED, self.detours.is_blocked())
            | flag(intent::ON_DETOUR, self.is_detouring_or_evading())
    }

    /// Whether this companion flies the vehicle off its plan, on a detour or to evade, or will.
    /// False while a pilot or a failsafe flies it, and in `Aborted`: nothing then keeps it from
    /// coming down on others.
    fn is_detouring_or_evading(&self) -> bool {
        let state = self.mission.state();
        !(state.is_left_to_pilot_or_failsafe() || state == State::Aborted)
            && (self.detours.is_on_detour()
                || self.detours.has_left_plan()
                || self.guidance.evading)
    }

    /// Height of the ground below this vehicle as far as its plan says, ENU up, metres. Without a
    /// plan that is its own height if it stands disarmed, or else the lowest that is known.
    pub(super) fn planned_ground_m(&self) -> f32 {
        if let Some(plan) = self.mission.plan() {
            return self.guidance.planned_ground_m(plan);
        }
        let start_m = self.mission.path_start().z;
        let own_m = self.telemetry.position_at.map_or(start_m, |_| self.telemetry.position.z);
        let lowest_m = if self.telemetry.armed { self.guidance.lowest_ground_m() } else { own_m };
        start_m.min(own_m).min(lowest_m)
    }

    /// This vehicle's intent, as it is reported to the swarm now.
    pub(super) fn own_intent(&self) -> Intent {
        let plan = self.mission.plan();
        let along_m =
            self.guidance.reported_progress_m(self.mission.state(), &self.guidance_inputs());
        let (mut points, column) = self.points_to_stop_and_may_come_down();
        let near = points.len();
        self.add_unheard_points(&mut points);
        let beyond = (points.len() - near) as u8;
        let (clear_m, clear_in_s) = self.unheard_end_m_and_delay_s(along_m);
        Intent {
            system_id: self.config.system_id,
            flags: self.intent_flags(),
            mission_crc: self.config.mission_crc,
            plan_crc: plan.map_or(0, |plan| plan.swarm_plan_crc),
            progress_m: if self.detours.is_on_detour() {
                self.detours.left_at_m()
            } else {
                along_m
            },
            heard_bits: self.neighbours.heard_bits(self.now),
            gates_open_up_to_m: clear_m,
            unheard_flight_delay_s: clear_in_s,
            ground_m: self.planned_ground_m(),
            may_come_down: column,
            echo: self.neighbours.next_echo(self.links.intents_sent(), self.now),
            points,
            unheard_flight_point_count: beyond,
        }
    }

    /// Appends, in a coverage mission, the corners of the path beyond the points ahead, along which
    /// this vehicle flies if no other vehicle hears it: as far as its lease takes it, or to the
    /// path's end if it takes no part any more and needs no lease.
    fn add_unheard_points(&self, points: &mut heapless::Vec<Point, { intent::MAX_POINTS }>) {
        let flies = self.mission.state().may_fly_on_lease();
        let descends = self.guidance.reference_along_m() >= 0.0 && self.guidance.is_in_descent();
        let Some(plan) = self.mission.plan().filter(|_| flies && !descends) else { return };
        // With `MAX_POINTS` points the list is full: later corners are not reported.
        let mut add = |point: Point| _ = points.push(point);
        let (path, on_path) = (&plan.path, self.guidance.reference_along_m() >= 0.0);
        let from_m = if on_path { self.guidance.setpoint_along_m } else { 0.0 };
        let Some(most_m) = self.coverage_unheard_end_m() else { return };
        if self.guidance.returning {
            let back = path.waypoints().iter().rev().filter(|w| w.along_m < from_m);
            return back.for_each(|w| add(w.position));
        }
        let stops_m = if on_path { self.guidance.stops_at_m.max(from_m) } else { 0.0 };
        let stops_m = if self.guidance.hold.is_reported() { from_m } else { stops_m };
        let ahead = path.waypoints().iter().filter(|w| w.along_m > stops_m && w.along_m < most_m);
        ahead.for_each(|w| add(w.position));
        path.point_at(most_m).filter(|_| most_m > stops_m).into_iter().for_each(add);
    }

    /// Place along this vehicle's path, metres, up to which it flies in a coverage mission while no
    /// other vehicle hears it; `None` in a mission without an area.
    fn coverage_unheard_end_m(&self) -> Option<f32> {
        let (fleet, plan) = (self.neighbours.fleet()?, self.mission.plan()?);
        let lease_m = MAX_FLIGHT_ON_LEASE_S * self.config.cruise_mps;
        let from_m = self.guidance.setpoint_along_m.max(0.0);
        let most_m = if fleet.takes_part() { from_m + lease_m } else { f32::INFINITY };
        Some(most_m.min(plan.path.length_m()))
    }

    /// Part of this vehicle's path that its intent reports.
    fn reported_path(&self) -> ReportedPath {
        let from_m = self.guidance.setpoint_along_m;
        let along_m =
            self.guidance.measured_progress_m(self.mission.state(), &self.guidance_inputs());
        let flies = self.guidance.reference_along_m() >= 0.0 && !self.guidance.hold.is_reported();
        let Some(plan) = self.mission.plan().filter(|_| flies) else {
            return ReportedPath { along_m, points_end_m: from_m };
        };
        // The setpoint and these waypoints are as many points as an intent holds.
        let last =
            plan.path.waypoints().iter().filter(|w| w.along_m > from_m).nth(intent::MAX_POINTS - 2);
        let last_m = last.map_or(f32::INFINITY, |last| last.along_m);
        ReportedPath { along_m, points_end_m: self.guidance.stops_at_m.max(from_m).min(last_m) }
    }

    /// Points along which this vehicle flies next, from its setpoint to where it will stop for now;
    /// and whether it may come down from where it is: false only while it holds, flies or brakes on
    /// its path and does not descend.
    fn points_to_stop_and_may_come_down(
        &self,
    ) -> (heapless::Vec<Point, { intent::MAX_POINTS }>, bool) {
        use State::*;
        let mut points = heapless::Vec::new();
        let here = self.telemetry.position;
        let setpoint =
            match self.guidance.setpoint_to_send(self.mission.state(), &self.guidance_inputs()) {
                Setpoint::Move(place, ..) => place,
                _ => here,
            };
        let mut add = |point: Point| {
            // With `MAX_POINTS` points the list is full: the other points are further ahead than
            // the vehicle flies before its next intent.
            let _ = points.push(point);
        };
        let Some(plan) = self.mission.plan() else { return (points, true) };
        let path = &plan.path;
        let (first, last) = (path.point_at(0.0), path.point_at(path.length_m()));
        let mut column = true;
        match self.mission.state() {
            // On the pad too: it may have lifted off before its next intent is heard.
            state if state.is_started_before_path() => {
                add(setpoint);
                first.into_iter().for_each(add);
            }
            // A mission that is over in the air ends in a landing too.
            state if state.lands_or_landing_is_held() || state == Aborted => {
                add(here);
                add(Point::new(here.x, here.y, self.guidance.planned_ground_m(plan)));
            }
            state if state.is_on_path() && self.guidance.hold.is_reported() => {
                column = false;
                add(setpoint);
            }
            Follow if self.guidance.descends_or_will(&self.guidance_inputs(), self.now) => {
                add(setpoint);
                last.into_iter().for_each(|last| {
                    add(Point::new(last.x, last.y, self.guidance.planned_ground_m(plan)));
                });
            }
            state if state.is_on_path_or_stopping() => {
                column = false;
                add(setpoint);
                let (from_m, most_m) = (
                    self.guidance.setpoint_along_m,
                    self.coverage_unheard_end_m().unwrap_or(f32::INFINITY),
                );
                let to_m = self.guidance.stops_at_m.min(most_m);
                let ahead =
                    path.waypoints().iter().filter(|w| w.along_m > from_m && w.along_m < to_m);
                ahead.for_each(|w| add(w.position));
                path.point_at(to_m).filter(|_| to_m > from_m).into_iter().for_each(add);
            }
            _ => {}
        }
        (points, column)
    }
}

/// Writes a TUNNEL frame with one of the swarm's own payloads.
fn encode_tunnel(header: frame::Header, payload: &[u8], out: &mut [u8]) -> usize {
    frame::encode_raw(header, TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC, payload, out)
}
