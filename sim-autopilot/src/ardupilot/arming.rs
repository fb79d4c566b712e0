//! ArduCopter's arming and disarming.

use super::Copter;
use super::setpoint::GuidedGoal;
use crate::link::command::{Arming, CommandOutcome};
use crate::platform::{Platform, SensorReadings};

impl Copter {
    /// Whether the arming checks pass; the error is the text of the STATUSTEXT.
    pub(super) fn check_arming(&self, sensors: &SensorReadings) -> Result<(), &'static str> {
        if !self.mode.allows_arming() {
            Err("Arm: Mode not armable")
        } else if self.tuning.arming_checks_enabled && !self.position_known(sensors.now_us) {
            Err("Arm: Need Position Estimate")
        } else if sensors.battery < self.tuning.battery_to_arm_charge {
            Err("Arm: Battery 1 below minimum arming capacity")
        } else {
            Ok(())
        }
    }

    /// Arms, and sets home. Refused with a STATUSTEXT if the checks fail, unless forced.
    pub(super) fn arm(
        &mut self,
        platform: &mut Platform,
        sensors: &SensorReadings,
        arming: Arming,
    ) -> CommandOutcome {
        if self.armed {
            return CommandOutcome::Done;
        }
        if arming == Arming::Checked
            && let Err(why) = self.check_arming(sensors)
        {
            platform.send_text(2, why);
            return CommandOutcome::Refused;
        }
        self.armed = true;
        self.since.armed_us = sensors.now_us;
        self.since.idle_us = sensors.now_us;
        self.goal = GuidedGoal::STOP;
        platform.announce_origin();
        platform.set_home_here_unless_fixed();
        platform.send_text(6, "Arming motors");
        CommandOutcome::Done
    }

    /// Disarms. Refused in the air, unless forced.
    pub(super) fn disarm(&mut self, platform: &mut Platform, arming: Arming) -> CommandOutcome {
        if self.armed && !self.landed && arming == Arming::Checked {
            return CommandOutcome::Refused;
        }
        if self.armed {
            platform.send_text(6, "Disarming motors");
        }
        self.end_auto(platform);
        self.armed = false;
        self.takeoff = None;
        self.failsafe = None;
        self.commanded_speed = None;
        CommandOutcome::Done
    }
}
