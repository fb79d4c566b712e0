//! States of the mission, and the sets of them that decisions are made by.

pub(crate) mod interruption;

/// State of one vehicle's mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No HEARTBEAT of an autopilot was received yet, or, before take-off is prepared, none for 3
    /// s.
    #[default]
    WaitAutopilot,
    /// Connected to the autopilot; its position or its EKF origin is not known.
    WaitPosition,
    /// The shell was asked for the vehicle's plan.
    Planning,
    /// The plan has come; waits for MISSION_START.
    Ready,
    /// Started; waits on the pad for departure time and gates, or in reserve for a part of the
    /// area. Waits disarmed, since PX4 would disarm after 10 s on the ground.
    Scheduled,
    /// Sends setpoints at the current position, before Offboard or Guided is requested.
    Streaming,
    /// Offboard or Guided was requested.
    Engaging,
    /// Arming is requested, as soon as the column above the pad is free.
    Arming,
    /// NAV_TAKEOFF was requested from an autopilot that takes off by command only; with another
    /// autopilot the state is left at once.
    TakeOff,
    /// Climbs straight up to the start of the path.
    Climb,
    /// Flies along the path; advice and safety filter slow and stop it for neighbours.
    Follow,
    /// Stands after DO_PAUSE_CONTINUE 0, on the path or in the climb.
    Paused,
    /// Stands on the path, since no neighbour hears this vehicle or none is heard.
    SwarmLinkLost,
    /// HEARTBEAT is missing in flight; the setpoint stops on the path or in the climb.
    AutopilotSilent,
    /// The position is missing in flight, or jumped; the setpoint stops.
    PositionLost,
    /// The autopilot lands the vehicle.
    Land,
    /// On the ground; waits until the motors are disarmed.
    Disarm,
    /// A pilot set a mode that the companion did not request; setpoints sent are the current
    /// position.
    PilotControl,
    /// The autopilot's own failsafe acts, or the companion was started in flight: no setpoints are
    /// sent.
    Failsafe,
    /// Landed at the goal and disarmed, or started without a goal or part to fly.
    Done,
    /// The mission was given up; MISSION_START plans again.
    Aborted,
    /// Stands on the path, which a vehicle that left the plan or an obstacle blocks; waits until
    /// the path is free or a detour may be requested. In a coverage mission also: stops to request
    /// a path home.
    Blocked,
    /// Holds its place; the shell was asked for a detour, a path home, a path aside or a place to
    /// land.
    Replanning,
    /// Waits on the pad, disarmed; the shell was asked for a detour.
    PadReplanning,
    /// Brakes along the path to a stop, then lands.
    Stopping,
    /// The autopilot is in Offboard or Guided again after its pilot: holds the position at which
    /// that was seen, until DO_PAUSE_CONTINUE 1.
    PilotReturned,
    /// The start was cancelled or paused after arming was requested: holds on the pad until the
    /// motors are certain to be disarmed.
    CancelStart,
    /// The landing was stopped, since another vehicle is below or may be: holds its place until the
    /// column below is free.
    LandingHeld,
    /// Holds on its path, in a coverage mission, until the rest of the area is divided among the
    /// vehicles again, or, after a detour, until the rest of its own plan has come.
    Dividing,
}

impl State {
    /// Every state, in the order of its number, which HEARTBEAT carries as `custom_mode`.
    pub const ALL: &'static [Self] = &[
        Self::WaitAutopilot,
        Self::WaitPosition,
        Self::Planning,
        Self::Ready,
        Self::Scheduled,
        Self::Streaming,
        Self::Engaging,
        Self::Arming,
        Self::TakeOff,
        Self::Climb,
        Self::Follow,
        Self::Paused,
        Self::SwarmLinkLost,
        Self::AutopilotSilent,
        Self::PositionLost,
        Self::Land,
        Self::Disarm,
        Self::PilotControl,
        Self::Failsafe,
        Self::Done,
        Self::Aborted,
        Self::Blocked,
        Self::Replanning,
        Self::PadReplanning,
        Self::Stopping,
        Self::PilotReturned,
        Self::CancelStart,
        Self::LandingHeld,
        Self::Dividing,
    ];

    /// Whether setpoints are sent in this state: from before Offboard or Guided until the motors
    /// are disarmed, but not in a failsafe nor in a take-off by command.
    pub fn streams_setpoints(self) -> bool {
        use State::*;
        matches!(
            self,
            Streaming
                | Engaging
                | Arming
                | Climb
                | Follow
                | Paused
                | SwarmLinkLost
                | Blocked
                | Replanning
                | Stopping
                | AutopilotSilent
                | PositionLost
                | Land
                | PilotControl
                | PilotReturned
                | CancelStart
                | Disarm
                | LandingHeld
                | Dividing
        )
    }

    /// Whether a vehicle in this state is on its coverage path, or is about to be: it prepares its
    /// take-off or climbs. While its lease lasts it flies on along that path even if no other
    /// vehicle hears it.
    pub(crate) fn may_fly_on_lease(self) -> bool {
        self.is_on_path() || self.prepares_take_off() || self.takes_off()
    }

    /// What HEARTBEAT says of a vehicle in this state.
    pub(crate) fn system_status(self) -> SystemStatus {
        use State::*;
        match self {
            WaitAutopilot | WaitPosition => SystemStatus::Boot,
            Planning | Ready | Done | Aborted => SystemStatus::Standby,
            AutopilotSilent | PositionLost | Failsafe => SystemStatus::Critical,
            _ => SystemStatus::Active,
        }
    }

    /// Whether autopilot, position or plan of the vehicle are still missing.
    pub(crate) fn is_before_plan(self) -> bool {
        matches!(self, Self::WaitAutopilot | Self::WaitPosition | Self::Planning)
    }

    /// Whether the vehicle was not started yet.
    pub fn is_before_start(self) -> bool {
        self == Self::Ready || self.is_before_plan()
    }

    /// Whether nothing is under way: no plan is being computed, and the vehicle was not started or
    /// its mission has ended.
    pub(crate) fn is_idle(self) -> bool {
        (self.is_before_start() && self != Self::Planning) || self.is_over()
    }

    /// Whether the vehicle waits with its plan on its pad, disarmed: started or not.
    pub(crate) fn waits_on_pad_with_plan(self) -> bool {
        self == Self::Ready || self.waits_on_pad_after_start()
    }

    /// Whether the vehicle waits on its pad, disarmed, and is to fly its plan from there: no detour
    /// is sought.
    pub(crate) fn waits_to_fly_plan(self) -> bool {
        self.waits_on_pad_with_plan() && !self.waits_for_detour()
    }

    /// Whether the vehicle has been started and waits on its pad, disarmed.
    pub(crate) fn waits_on_pad_after_start(self) -> bool {
        matches!(self, Self::Scheduled | Self::PadReplanning)
    }

    /// Whether the autopilot is being brought to fly: setpoints, mode, arming.
    pub(crate) fn prepares_take_off(self) -> bool {
        matches!(self, Self::Streaming | Self::Engaging | Self::Arming)
    }

    /// Whether the vehicle has been started, and arming was not requested yet.
    pub(crate) fn is_started_before_arming(self) -> bool {
        self.waits_on_pad_after_start() || matches!(self, Self::Streaming | Self::Engaging)
    }

    /// Whether the vehicle has been started and has not left its pad: before its take-off, or after
    /// its start was cancelled.
    pub(crate) fn is_started_on_pad(self) -> bool {
        self.waits_on_pad_after_start() || self.prepares_take_off() || self == Self::CancelStart
    }

    /// Whether the vehicle has been started and has not reached its path: it waits on its pad, is
    /// brought to fly, or rises.
    pub(crate) fn is_started_before_path(self) -> bool {
        self.waits_on_pad_after_start() || self.prepares_take_off() || self.takes_off()
    }

    /// Whether a further MISSION_START changes nothing, since the vehicle is on its way to its path
    /// or on it.
    pub(crate) fn is_mission_under_way(self) -> bool {
        self.is_started_before_path() || self.is_on_path()
    }

    /// Whether the vehicle rises from its pad to the start of its path.
    pub(crate) fn takes_off(self) -> bool {
        matches!(self, Self::TakeOff | Self::Climb)
    }

    /// Whether the setpoint advances: up the climb, or along the path.
    pub(crate) fn setpoint_advances(self) -> bool {
        matches!(self, Self::Climb | Self::Follow)
    }

    /// Whether the vehicle follows its path, or would if nothing blocked it.
    pub fn follows_path_or_is_blocked(self) -> bool {
        self == Self::Follow || self.is_blocked()
    }

    /// Whether the vehicle follows its path, or stands before what blocks it and seeks no other
    /// path.
    pub(crate) fn follows_path_or_waits_blocked(self) -> bool {
        matches!(self, Self::Follow | Self::Blocked)
    }

    /// Whether the vehicle may be kept by a gate that another vehicle has not passed, on its pad or
    /// on its path.
    pub(crate) fn may_wait_at_gate(self) -> bool {
        self == Self::Scheduled || self.follows_path_or_waits_blocked()
    }

    /// Whether a vehicle in a coverage mission flies its part, or holds on its path and may fly on:
    /// for a division, or before what blocks the path.
    pub(crate) fn flies_or_holds_its_part(self) -> bool {
        self == Self::Dividing || self.follows_path_or_waits_blocked()
    }

    /// Whether the vehicle flies on, as far as others let it, after a pause or its pilot: a further
    /// command to resume changes nothing.
    pub(crate) fn has_resumed(self) -> bool {
        self.setpoint_advances() || self.is_blocked() || self == Self::Dividing
    }

    /// Whether the vehicle stands on its path because something blocks it.
    pub(crate) fn is_blocked(self) -> bool {
        matches!(self, Self::Blocked | Self::Replanning)
    }

    /// Whether the shell was asked for a path other than the plan's.
    pub(crate) fn waits_for_detour(self) -> bool {
        matches!(self, Self::Replanning | Self::PadReplanning)
    }

    /// Whether the vehicle lands, or would if the column below were free.
    pub(crate) fn lands_or_landing_is_held(self) -> bool {
        matches!(self, Self::Land | Self::LandingHeld)
    }

    /// Whether the vehicle brakes to a stop to land, or lands.
    pub(crate) fn stops_to_land_or_lands(self) -> bool {
        matches!(self, Self::Stopping | Self::Land)
    }

    /// Whether the vehicle lands, would if the column below were free, or has landed and waits
    /// until its motors are disarmed.
    pub(crate) fn lands_or_disarms(self) -> bool {
        self.lands_or_landing_is_held() || self == Self::Disarm
    }

    /// Whether the vehicle takes no part in the mission any more: it stops to land, lands or has
    /// landed, its mission has ended, or the autopilot's failsafe acts.
    pub(crate) fn has_left_mission(self) -> bool {
        self.stops_to_land_or_lands()
            || self.lands_or_disarms()
            || self.is_over()
            || self == Self::Failsafe
    }

    /// Whether the vehicle is on the ground after its flight, or had none to make.
    pub(crate) fn has_landed(self) -> bool {
        matches!(self, Self::Disarm | Self::Done)
    }

    /// Whether the mission has ended, well or not.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Aborted)
    }

    /// Whether the mission was given up, or the autopilot's own failsafe acts.
    pub fn has_given_up(self) -> bool {
        matches!(self, Self::Aborted | Self::Failsafe)
    }

    /// Whether a pilot or the autopilot's failsafe flies the vehicle.
    pub(crate) fn is_flown_by_pilot_or_failsafe(self) -> bool {
        matches!(self, Self::PilotControl | Self::Failsafe)
    }

    /// Whether a pilot flies the vehicle, or did and has not let the mission go on.
    pub fn is_left_to_pilot(self) -> bool {
        matches!(self, Self::PilotControl | Self::PilotReturned)
    }

    /// Whether somebody else flies the vehicle, or did and has not let the mission go on.
    pub(crate) fn is_left_to_pilot_or_failsafe(self) -> bool {
        self.is_left_to_pilot() || self == Self::Failsafe
    }

    /// Whether setpoints lead to a place only while the position is new: a pilot or the autopilot's
    /// own mode may fly the vehicle away unseen.
    pub(crate) fn needs_fresh_position(self) -> bool {
        self.is_left_to_pilot() || self.lands_or_disarms()
    }

    /// Whether the vehicle may stand away from its path before its mission goes on: after its
    /// pilot, or after its position was lost.
    pub(crate) fn may_be_off_path_on_resume(self) -> bool {
        matches!(self, Self::PilotReturned | Self::PositionLost)
    }

    /// Whether in this state the mission stands interrupted: the autopilot fell silent, the
    /// position was lost, or a pilot took over (also after the pilot gave the vehicle back, until
    /// it resumes).
    pub fn is_interrupted_by_loss(self) -> bool {
        matches!(self, Self::AutopilotSilent | Self::PositionLost) || self.is_left_to_pilot()
    }

    /// Whether the vehicle stands until its operator resumes, or its autopilot is heard again.
    pub(crate) fn stands_until_resumed(self) -> bool {
        matches!(self, Self::Paused | Self::AutopilotSilent)
    }

    /// Whether a pause or a pilot keeps the vehicle until the command to resume, or would: on its
    /// pad a pause may be pending.
    pub fn may_need_resume(self) -> bool {
        matches!(self, Self::PilotReturned | Self::Paused | Self::CancelStart)
            || self.waits_on_pad_with_plan()
    }

    /// Whether a pause is stored in this state until a row of the table can act on it: before the
    /// climb, and while the mission is interrupted.
    pub(crate) fn stores_pause(self) -> bool {
        use State::*;
        match self {
            Planning | CancelStart | TakeOff | AutopilotSilent | PositionLost | PilotReturned => {
                true
            }
            _ => self.waits_on_pad_with_plan(),
        }
    }

    /// Whether, once this state is entered, the position is trusted again after a jump.
    pub(crate) fn trusts_position_again(self) -> bool {
        matches!(self, Self::Follow | Self::WaitPosition)
    }

    /// Whether a vehicle in this state may continue its plan while no other vehicle hears it.
    pub(crate) fn may_continue_unheard(self) -> bool {
        self.takes_off() || matches!(self, Self::Follow | Self::SwarmLinkLost)
    }

    /// Whether a vehicle in this state follows the plan that all share, and its gates.
    pub(crate) fn is_on_plan(self) -> bool {
        use State::*;
        match self {
            Ready | Follow | Paused | Dividing => true,
            _ => self.is_started_before_path() || self.is_blocked(),
        }
    }

    /// Whether a vehicle in this state is on its path under this companion's control, flying or
    /// holding.
    pub(crate) fn is_on_path(self) -> bool {
        use State::*;
        matches!(self, Follow | Paused | SwarmLinkLost | Blocked | Replanning | Dividing)
    }

    /// Whether a vehicle in a coverage mission is on its path and does not hold for a division yet,
    /// so that it may promise where it will hold.
    pub(crate) fn may_promise_hold(self) -> bool {
        self.is_on_path() && self != Self::Dividing
    }

    /// Whether the vehicle flies or holds on its path, or brakes along it to land.
    pub fn is_on_path_or_stopping(self) -> bool {
        self.is_on_path() || self == Self::Stopping
    }

    /// Whether a landing that is requested in this state begins at the reference. In other states
    /// the vehicle is off its path, and the reference may be behind a wall.
    pub(crate) fn lands_at_reference(self) -> bool {
        self.is_on_path_or_stopping() || matches!(self, Self::Land | Self::Disarm)
    }
}

/// What HEARTBEAT says of a vehicle: `MAV_STATE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SystemStatus {
    /// The autopilot or its position is not known yet.
    Boot,
    /// On the ground, before the start or after the mission.
    Standby,
    /// Started.
    Active,
    /// The autopilot or the position is lost, or a failsafe acts.
    Critical,
}

#[cfg(test)]
mod tests;
