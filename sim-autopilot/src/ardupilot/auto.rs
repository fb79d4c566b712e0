//! ArduCopter's mode AUTO, which flies an uploaded mission.
//!
//! AUTO can be entered only with a mission; if armed on the ground, only with one that begins with
//! a take-off. The vehicle cannot be armed in AUTO. On the ground it waits for MISSION_START (no
//! throttle stick is simulated); in the air it flies the mission at once. The vehicle faces its
//! direction of flight (`WP_YAW_BEHAVIOR` 2), whatever heading an item has. Return and landing
//! items are flown within AUTO.

use planner_core::Point;

use super::auto_state::Auto;
use super::setpoint::GuidedGoal;
use super::{Copter, CopterMode, RtlLeg, TakeOff};
use crate::link::command::CommandOutcome;
use crate::platform::{Platform, SensorReadings};
use crate::services::mission_flight::{LandedState, MissionLeg, interpolate_height};

/// Distance within which the place of a landing is reached, metres.
const LANDING_POINT_REACHED_M: f32 = 0.5;
/// Horizontal distance to a waypoint beyond which the vehicle faces the waypoint, metres.
const TURN_BEYOND_M: f32 = 2.0;

impl Copter {
    /// Whether AUTO can be entered; if the take-off is missing, sends a STATUSTEXT.
    pub(super) fn can_enter_auto(&self, platform: &mut Platform) -> bool {
        if platform.has_mission()
            && self.armed
            && self.landed
            && !platform.mission_begins_with_takeoff()
        {
            platform.send_text(2, "Auto: Missing Takeoff Cmd");
            return false;
        }
        platform.has_mission()
    }

    /// Executes MISSION_START: enters AUTO and allows the take-off. Refused if AUTO cannot be
    /// entered.
    pub(super) fn start_mission(&mut self, platform: &mut Platform) -> CommandOutcome {
        if !self.can_enter_auto(platform) {
            return CommandOutcome::Refused;
        }
        let started = self.request_mode(CopterMode::Auto, &platform.sensors());
        self.auto.may_lift |= started.is_done() && self.armed;
        started
    }

    /// Whether the vehicle descends to land in AUTO (landing item, or the end of a return item).
    pub(super) fn is_landing_in_auto(&self) -> bool {
        self.mode == CopterMode::Auto
            && match self.auto.leg {
                Some(MissionLeg::Land { .. }) => true,
                Some(MissionLeg::Return) => self.rtl_leg == RtlLeg::Land,
                _ => false,
            }
    }

    /// Ends AUTO at disarming: a landing counts as completed, and the next flight starts with the
    /// first item.
    pub(super) fn end_auto(&mut self, platform: &mut Platform) {
        if self.is_landing_in_auto() {
            platform.complete_item();
        }
        if self.auto.leg.is_some() {
            platform.rewind_mission();
        }
        self.auto = Auto::default();
    }

    /// Advances the mission by one step: updates the leg to fly, speed and take-off.
    pub(super) fn fly_mission(&mut self, platform: &mut Platform, sensors: &SensorReadings) {
        if self.mode != CopterMode::Auto {
            if self.auto.leg.take().is_some() {
                platform.missions.progress.restart_item();
            }
            return;
        }
        if self.landed && !self.auto.may_lift {
            return;
        }
        let landed = if self.landed { LandedState::OnGround } else { LandedState::InAir };
        let leg = platform.advance_mission(sensors, landed);
        if let Some(speed) = platform.missions.take_requested_speed() {
            self.commanded_speed = (speed > 0.0).then_some(speed);
        }
        if leg != self.auto.leg {
            self.auto.leg_start = MissionLeg::leg_end(self.auto.leg, &sensors.position);
            // The take-off climbs at least 1 m.
            self.takeoff = match leg {
                Some(MissionLeg::TakeOff { up }) if self.landed => {
                    Some(TakeOff { since_us: sensors.now_us, up: up.max(sensors.position.z + 1.0) })
                }
                _ => None,
            };
            if leg == Some(MissionLeg::Return) {
                self.rtl_leg = RtlLeg::Climb { up: f32::NAN };
            }
        }
        self.auto.leg = leg;
    }

    /// Where AUTO flies to now: the goal of the take-off or of the mission's current leg, or the
    /// point to hold. On a leg to a waypoint it also updates heading and hold point.
    pub(super) fn auto_goal(&mut self, sensors: &SensorReadings) -> GuidedGoal {
        if self.takeoff.is_some() {
            return self.take_off_goal();
        }
        let at = self.reference.position;
        match self.auto.leg {
            Some(MissionLeg::FlyTo { at, .. }) => {
                let off = at - sensors.position;
                if libm::hypotf(off.x, off.y) > TURN_BEYOND_M {
                    self.auto.heading = Some(libm::atan2f(off.x, off.y));
                }
                self.auto.hold_point = Some(at);
                let reference = &self.reference;
                let (up, rate) = interpolate_height(
                    &self.auto.leg_start,
                    &at,
                    &reference.position,
                    &reference.velocity,
                );
                let heading = self.auto.heading.unwrap_or(f32::NAN);
                let velocity = Point::new(0.0, 0.0, rate);
                GuidedGoal { heading, velocity, ..GuidedGoal::hold(Point::new(at.x, at.y, up)) }
            }
            Some(MissionLeg::TakeOff { up }) => {
                let stay = self.auto.hold_point.unwrap_or(at);
                GuidedGoal::hold(Point::new(stay.x, stay.y, up))
            }
            Some(MissionLeg::Land { at: Some([east, north]) })
                if libm::hypotf(east - sensors.position.x, north - sensors.position.y)
                    > LANDING_POINT_REACHED_M
                    && !sensors.touching =>
            {
                let up = self.auto.hold_point.map_or(at.z, |stay| stay.z);
                GuidedGoal::hold(Point::new(east, north, up))
            }
            Some(MissionLeg::Land { .. }) => self.landing_goal(sensors),
            Some(MissionLeg::Return) => self.return_goal(sensors),
            Some(MissionLeg::Wait(_)) | None => {
                self.auto.hold_point.map_or(GuidedGoal::STOP, GuidedGoal::hold)
            }
        }
    }
}
